//! One batch, again and again: every objective must fit it, the adversary must learn, and what must stay fixed must stay fixed.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use toml::Table;
use vibes_model::ObservationKind;
use vibes_model::actions::ActionDistribution;
use vibes_model::agent::Agent;
use vibes_model::behaviour::Behaviour;
use vibes_model::config::BehaviourConfig;
use vibes_model::encode::RawFrames;
use vibes_model::values::ValueDistribution;

use super::*;
use crate::bench::{Sizes, made_up_spec, made_up_windows};
use crate::learners::objective::Objective;
use crate::options::Options;

mod adversary;
mod laws;

const SIZES: Sizes = Sizes { picture: 16, actions: 2, repeats: 1 };

fn learner(objective: &str, more: &str) -> (Learner, Batch, Options) {
    let shared = format!("objective = '{objective}'\nlr = 0.002\nadversary_lr = 0.002\nburn_in = 0");
    let layer = |text: &str| ("the test", text.parse::<Table>().unwrap());
    let options = Options::resolve("tiny", &[layer(&shared), layer(more)]).unwrap();
    let device = Device::flex();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let config = options.model(&made_up_spec(SIZES), ObservationKind::Pixels { height: 16, width: 16 }, 1.0);
    let model = Model::init(config, &mut rng, &device).unwrap();
    let windows = made_up_windows(&options, SIZES, &mut rng);
    let batch = Batch::new(&windows, &model.config, options.burn_in, &device.clone().autodiff()).unwrap();
    (Learner::new(model, &options, &device), batch, options)
}

#[test]
fn one_batch_overfits() {
    for objective in Objective::all() {
        let (mut learner, batch, options) = learner(objective.name(), "");
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut rewards = Vec::new();
        let mut first_and_last = Vec::new();
        for _ in 0..150 {
            let (next, measures) =
                learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
            learner = next;
            rewards.push(measures.reward);
            first_and_last.push((measures.objective, measures.stated, measures.dynamics));
        }
        let (first, last) = (&first_and_last[0], &first_and_last[149]);
        assert!(last.0 > first.0 && rewards[149] > rewards[0] + 0.5, "{objective}: {} to {}", rewards[0], rewards[149]);
        assert_eq!(first.1.keys().collect::<Vec<_>>(), last.1.keys().collect::<Vec<_>>(), "{objective}");
        if let Some(observation) = last.1.get("reconstruction_log_likelihood") {
            assert!(*observation > first.1["reconstruction_log_likelihood"], "{objective}");
        }
        // Where the dynamics term shapes the latents it is the objective's own; latents that something else shapes may become harder to foretell.
        if objective.dynamics_shape_latents() {
            assert!(last.2 > first.2, "{objective}: dynamics {} to {}", first.2, last.2);
        }
    }
}

#[test]
fn the_adversary_learns_to_predict_latents_that_stay() {
    // With a step size of almost nothing the encoder stays; the adversary's likelihood must rise.
    let (mut learner, batch, options) = learner("vibes", "lr = 1e-12");
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut likelihood = Vec::new();
    for _ in 0..100 {
        let (next, measures) = learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
        learner = next;
        let (before, after) =
            (measures.stated["adversary_log_likelihood_before"], measures.stated["adversary_log_likelihood"]);
        assert!(after > before - 0.5, "a step is not a setback: {before} to {after}");
        likelihood.push(after);
    }
    assert!(likelihood[99] > likelihood[0] + 1.0, "{} to {}", likelihood[0], likelihood[99]);
}

#[test]
fn warm_up_rows_carry_no_reward() {
    let (learner, _, options) = learner("no-adversary", "burn_in = 3");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut windows = made_up_windows(&options, SIZES, &mut rng);
    windows.is_first[1] = true;
    let config = &learner.model.config;
    let device = Device::flex().autodiff();
    let batch = Batch::new(&windows, config, options.burn_in, &device).unwrap();
    // Four windows of eight rows; three rows are left out in each but the one that begins its episode.
    assert_eq!(batch.count, (4 * 8 - 3 * 3) as f32);
    let mut other = windows.clone();
    for (index, reward) in other.rewards.iter_mut().enumerate().take(3 * windows.batch) {
        if index % windows.batch != 1 {
            *reward += 100.0;
        }
    }
    let other = Batch::new(&other, config, options.burn_in, &device).unwrap();
    let objective = |batch: &Batch| {
        let made = learner.clone().update(
            batch,
            options.schedule(0, Some(0)),
            options.parts(),
            &mut ChaCha8Rng::seed_from_u64(1),
        );
        made.unwrap().1.objective
    };
    assert_eq!(objective(&batch), objective(&other));
}

/// Windows of whole episodes: each begins one, and has before every other row the action of the row before.
fn whole_episodes(options: &Options, rng: &mut ChaCha8Rng) -> WindowBatch {
    let mut windows = made_up_windows(options, SIZES, rng);
    let (batch, row) = (windows.batch, windows.batch * SIZES.actions);
    let rest = windows.actions.len() - row;
    windows.is_first.iter_mut().enumerate().for_each(|(place, is_first)| *is_first = place < batch);
    windows.previous_actions[..row].fill(0.0);
    windows.previous_actions[row..].copy_from_slice(&windows.actions[..rest]);
    windows
}

/// Of latents without noise an update hands on to actor and critic, row by row, what an agent sees that meets the episode step by step.
#[test]
fn an_update_hands_on_what_an_agent_sees_step_by_step() {
    let (mut learner, _, options) = learner("no-adversary", "");
    learner.model.config.latent_std = 1e-7;
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(7));
    let windows = whole_episodes(&options, &mut rng);
    let batch = Batch::new(&windows, &learner.model.config, 0, &device.clone().autodiff()).unwrap();
    let config =
        BehaviourConfig { actions: ActionDistribution::BoundedNormal, values: ValueDistribution::TwoHot, hidden: 8 };
    let actor = Behaviour::init(&learner.model.config, config, &mut rng, &device).actor;
    let mut agent = Agent::new(&learner.model, &actor, &device);
    let (_, mut measures) = learner.update(&batch, options.schedule(0, Some(0)), options.parts(), &mut rng).unwrap();
    let replayed = measures.take_replayed(&batch, &windows);
    let handed_on = to_values(Tensor::cat(vec![replayed.states, replayed.latents], 2));
    let (bytes, actions) = (16 * 16 * 3, SIZES.actions);
    for window in 0..windows.batch {
        agent.begin();
        for row in 0..windows.length {
            let place = row * windows.batch + window;
            let before =
                if row == 0 { &[][..] } else { &windows.actions[(place - windows.batch) * actions..][..actions] };
            agent.observe(RawFrames::Pixels(&windows.pixels[place * bytes..][..bytes]), before).unwrap();
            let seen = agent.features();
            assert_eq!(seen.len() * windows.length * windows.batch, handed_on.len());
            let handed_on = &handed_on[place * seen.len()..][..seen.len()];
            let is_close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5;
            assert!(seen.iter().zip(handed_on).all(is_close), "row {row} of window {window}: {seen:?} {handed_on:?}");
        }
    }
}
