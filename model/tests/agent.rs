//! An agent at work: the numbers it acts on are those it was trained on, and nothing of one episode is left in the next.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod made_up;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_model::actions::ActionDistribution;
use vibes_model::actions::Choice;
use vibes_model::actor::{Actor, features};
use vibes_model::agent::Agent;
use vibes_model::behaviour::Behaviour;
use vibes_model::config::BehaviourConfig;
use vibes_model::encode::{EpisodeEncoder, RawFrames};
use vibes_model::parameters::to_values;
use vibes_model::values::ValueDistribution;
use vibes_model::{Model, ModelError, ObservationKind, scale};

const SIDE: usize = 20;
const STEPS: usize = 12;
const VECTOR: usize = 7;

/// Observations and executed actions of an episode, in the task's bounds.
struct Episode {
    pixels: Vec<u8>,
    vectors: Vec<f32>,
    actions: Vec<f32>,
}

impl Episode {
    fn made_up(model: &Model, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (low, high) = (&model.config.action_min, &model.config.action_max);
        Self {
            pixels: (0..STEPS * SIDE * SIDE * 3).map(|_| rng.random()).collect(),
            vectors: (0..STEPS * VECTOR).map(|_| rng.random_range(-3.0..3.0)).collect(),
            actions: (0..STEPS)
                .flat_map(|_| low.iter().zip(high).map(|(&low, &high)| rng.random_range(low..high)).collect::<Vec<_>>())
                .collect(),
        }
    }

    fn frames(&self, kind: ObservationKind, rows: std::ops::Range<usize>) -> RawFrames<'_> {
        let bytes = SIDE * SIDE * 3;
        match kind {
            ObservationKind::Pixels { .. } => RawFrames::Pixels(&self.pixels[rows.start * bytes..rows.end * bytes]),
            ObservationKind::Vector { .. } => RawFrames::Vectors(&self.vectors[rows.start * VECTOR..rows.end * VECTOR]),
        }
    }

    fn action_before(&self, row: usize) -> &[f32] {
        if row == 0 { &[] } else { &self.actions[(row - 1) * 2..row * 2] }
    }
}

fn kinds() -> [ObservationKind; 2] {
    [ObservationKind::Pixels { height: SIDE, width: SIDE }, ObservationKind::Vector { len: VECTOR }]
}

fn model(kind: ObservationKind) -> Model {
    Model::init(made_up::config(kind), &mut ChaCha8Rng::seed_from_u64(3), &Device::flex()).unwrap()
}

fn behaviour(model: &Model, actions: ActionDistribution) -> Behaviour {
    let config = BehaviourConfig { actions, values: ValueDistribution::TwoHot, hidden: 16 };
    let mut behaviour = Behaviour::init(&model.config, config, &mut ChaCha8Rng::seed_from_u64(4), &Device::flex());
    behaviour.actor.mlp = behaviour.actor.mlp.last_scaled(100.0);
    behaviour
}

fn actor(model: &Model) -> Actor {
    behaviour(model, ActionDistribution::BoundedNormal).actor
}

fn assert_close(found: &[f32], wanted: &[f32]) {
    assert_eq!(found.len(), wanted.len());
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        assert!((found - wanted).abs() <= 1e-5, "{index}: {found} {wanted}");
    }
}

/// Latents and features of an episode, step by step as an agent meets it.
fn stepped(agent: &mut Agent, kind: ObservationKind, episode: &Episode) -> (Vec<f32>, Vec<f32>) {
    agent.begin();
    let (mut latents, mut seen) = (Vec::new(), Vec::new());
    for row in 0..STEPS {
        latents.extend(agent.observe(episode.frames(kind, row..row + 1), episode.action_before(row)).unwrap());
        seen.extend(agent.features());
    }
    (latents, seen)
}

#[test]
fn step_by_step_an_agent_sees_what_a_window_of_the_episode_holds() {
    for kind in kinds() {
        let model = model(kind);
        let episode = Episode::made_up(&model, 1);
        let mut agent = Agent::new(&model, &actor(&model), &Device::flex());
        let (latents, seen) = stepped(&mut agent, kind, &episode);
        let mut encoder = EpisodeEncoder::new(&model, &Device::flex());
        let mut previous = vec![0.0, 0.0];
        previous.extend_from_slice(&episode.actions[..(STEPS - 1) * 2]);
        let means = encoder.push(episode.frames(kind, 0..STEPS), &previous).unwrap();
        assert_close(&latents, &means);
        // The dynamics' state at a row has consumed every action before it and not its own.
        let tensor = |values: Vec<f32>, width| {
            Tensor::<3>::from_data(TensorData::new(values, [STEPS, 1, width]), &Device::flex())
        };
        let mut actions = episode.actions.clone();
        scale::actions(&mut actions, &model.config.action_min, &model.config.action_max);
        let latent = model.config.latent;
        let means = tensor(means, latent);
        let (_, after) = model.world.dynamics.valid().forward(means.clone(), tensor(actions, 2), None);
        let before = Tensor::cat(
            vec![Tensor::zeros([1, 1, model.config.hidden], &Device::flex()), after.narrow(0, 0, STEPS - 1)],
            0,
        );
        assert_close(&seen, &to_values(features(before, means)));
    }
}

#[test]
fn nothing_of_an_episode_is_left_in_the_next() {
    for kind in kinds() {
        let model = model(kind);
        let (first, second) = (Episode::made_up(&model, 1), Episode::made_up(&model, 2));
        let mut agent = Agent::new(&model, &actor(&model), &Device::flex());
        let fresh = stepped(&mut agent, kind, &second);
        stepped(&mut agent, kind, &first);
        assert_eq!(stepped(&mut agent, kind, &second), fresh);
        // Whatever is handed in as the action before an episode's start is not looked at.
        agent.begin();
        let latent = agent.observe(second.frames(kind, 0..1), &[0.7, 3.0]).unwrap();
        assert_eq!(latent, fresh.0[..latent.len()]);
    }
}

#[test]
fn actions_keep_to_the_tasks_bounds_and_follow_the_seed() {
    let kind = kinds()[0];
    let model = model(kind);
    let episode = Episode::made_up(&model, 1);
    for distribution in [ActionDistribution::BoundedNormal, ActionDistribution::TanhNormal] {
        let mut agent = Agent::new(&model, &behaviour(&model, distribution).actor, &Device::flex());
        for choice in [Choice::Mode, Choice::Sample] {
            let mut act = |seed| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                agent.begin();
                let mut actions: Vec<f32> = Vec::new();
                for row in 0..STEPS {
                    let before = actions[row.saturating_sub(1) * 2..row * 2].to_vec();
                    let frames = episode.frames(kind, row..row + 1);
                    actions.extend(agent.act(frames, &before, choice, &mut rng).unwrap());
                }
                actions
            };
            let actions = act(5);
            for action in actions.chunks(2) {
                assert!((-1.0..=1.0).contains(&action[0]) && (0.0..=4.0).contains(&action[1]), "{action:?}");
            }
            assert_eq!(act(5), actions);
            assert_eq!(act(6) == actions, choice == Choice::Mode);
        }
    }
}

#[test]
fn a_saved_agent_acts_as_before_and_a_model_without_an_actor_says_so() {
    let kind = kinds()[1];
    let model = model(kind);
    let behaviour = behaviour(&model, ActionDistribution::TanhNormal);
    let folder = tempfile::tempdir().unwrap();
    model.save(&folder.path().join("model.safetensors")).unwrap();
    let missing = Agent::load(folder.path(), &Device::flex()).unwrap_err();
    assert!(matches!(missing, ModelError::Io { .. }), "{missing}");
    behaviour.save(&folder.path().join("behaviour.safetensors")).unwrap();
    let mut loaded = Agent::load(folder.path(), &Device::flex()).unwrap();
    let mut agent = Agent::new(&model, &behaviour.actor, &Device::flex());
    let episode = Episode::made_up(&model, 1);
    let act = |agent: &mut Agent| {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        agent.act(episode.frames(kind, 0..1), &[], Choice::Sample, &mut rng).unwrap()
    };
    assert_eq!(act(&mut loaded), act(&mut agent));
}

#[test]
fn observations_of_another_kind_and_actions_of_another_width_are_refused() {
    let model = model(kinds()[0]);
    let mut agent = Agent::new(&model, &actor(&model), &Device::flex());
    let error = agent.observe(RawFrames::Vectors(&[0.0; VECTOR]), &[]).unwrap_err();
    assert!(error.to_string().contains("vectors of 7"), "{error}");
    let episode = Episode::made_up(&model, 1);
    agent.observe(episode.frames(kinds()[0], 0..1), &[]).unwrap();
    let error = agent.observe(episode.frames(kinds()[0], 1..2), &[0.0]).unwrap_err();
    assert!(error.to_string().contains("actions of 2"), "{error}");
}
