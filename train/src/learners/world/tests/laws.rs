//! Laws over the registry of objectives: what moves the encoder, and that the losses that an objective states are learned. Otherwise an objective could lose its own loss, or let the reward into latents that it says
//! no reward shapes, and nothing would be seen of it in how well a batch is fitted: models of dynamics and reward stand beside every one of them.

use vibes_model::parameters::HostTensors;

use super::*;

/// Whether what an objective states under this name is a loss of its own.
fn is_loss(name: &str) -> bool {
    name.ends_with("_loss") || name == "divergence"
}

/// What an objective states at each of so many updates on one batch. The targets of distances are made of later latents' distances, which grow with the latents where the discount is near 1: only with a
/// small one must a distance come nearer to its target.
fn stated(objective: Objective, updates: usize) -> Vec<BTreeMap<&'static str, f32>> {
    let (mut learner, batch, options) = learner(objective.name(), "metric_discount = 0.25");
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut stated = Vec::with_capacity(updates);
    for _ in 0..updates {
        let (next, measures) = learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
        learner = next;
        stated.push(measures.stated);
    }
    stated
}

/// Names of the losses that an objective states.
fn losses(objective: Objective) -> Vec<&'static str> {
    stated(objective, 1)[0].keys().copied().filter(|name| is_loss(name)).collect()
}

#[test]
fn every_loss_that_an_objective_states_falls() {
    for objective in Objective::all() {
        let losses = losses(objective);
        // What shapes the latents neither by the dynamics term nor by a loss under a name that this test knows would go untested.
        assert!(objective.dynamics_shape_latents() || !losses.is_empty(), "{objective} states no loss");
        if losses.is_empty() {
            continue;
        }
        let stated = stated(objective, 150);
        for loss in losses {
            let mean = |rows: &[BTreeMap<&str, f32>]| rows.iter().map(|row| row[loss]).sum::<f32>() / rows.len() as f32;
            let (first, last) = (mean(&stated[..10]), mean(&stated[140..]));
            assert!(last < first, "{objective}, {loss}: {first} to {last}");
        }
    }
}

/// The encoder's gradient in one update with these weights, all rewards multiplied by `rewards`. Adam's first moments are a tenth of it after the first step, where no norm is limited.
fn encoder_gradient(objective: Objective, dynamics: f64, reward: f64, rewards: f32) -> HostTensors {
    let weights = format!("gradient_clip = 1e9\ndynamics_weight = {dynamics:?}\nreward_weight = {reward:?}");
    let (learner, batch, options) = learner(objective.name(), &weights);
    let batch = Batch { rewards: batch.rewards.clone() * rewards, ..batch };
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let (learner, _) = learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
    let moments = learner.optimizer.to_tensors("world");
    moments.into_iter().filter(|(name, _)| name.starts_with("world.first.encoder.")).collect()
}

fn moves(gradient: &HostTensors) -> bool {
    gradient.values().flat_map(|tensor| &tensor.values).any(|value| *value != 0.0)
}

/// To the last digit: what does not reach the encoder is no part of the sums that its gradient is made of.
#[test]
fn the_encoder_is_moved_by_what_an_objective_says_and_by_nothing_else() {
    for objective in Objective::all() {
        let gradient = |dynamics, reward, rewards| encoder_gradient(objective, dynamics, reward, rewards);
        let whole = gradient(1.0, 1.0, 1.0);
        assert!(moves(&whole), "{objective}: nothing moves the encoder");
        let by_reward = gradient(1.0, 0.0, 1.0) != whole;
        assert_eq!(by_reward, objective.rewards_shape_latents(), "{objective}: the reward's log-likelihood");
        let by_dynamics = gradient(0.0, 1.0, 1.0) != whole;
        assert_eq!(by_dynamics, objective.dynamics_shape_latents(), "{objective}: the dynamics term");
        // Distances have targets that are made of rewards. What sees none in any way says so where it is chosen.
        let sees_no_reward = gradient(1.0, 1.0, 0.5) == whole;
        assert_eq!(sees_no_reward, objective.about().contains("no reward"), "{objective}: the rewards themselves");
        // Without both terms nothing is left but the objective's own.
        let (_, _, options) = learner(objective.name(), "");
        let has_own = !losses(objective).is_empty() || objective.networks(&options, SIZES.actions).decoder;
        assert_eq!(moves(&gradient(0.0, 0.0, 1.0)), has_own, "{objective}: its own term");
    }
}
