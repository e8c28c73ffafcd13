//! How long online training takes, and of what: a whole update of world model, actor and critic by part, and an episode as the actor's thread lives through it. In: options.
//! Out: milliseconds by part, control steps a second of the loop as it runs, and which of its two threads is waited for.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::RecordingWriter;
use vibes_env::videos::VideoSet;
use vibes_model::actions::Choice;
use vibes_model::agent::Agent;
use vibes_model::behaviour::Behaviour;
use vibes_model::encode::RawFrames;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;
use vibes_model::{Model, ObservationKind};

use super::end_to_end::{EndToEnd, end_to_end};
use super::{Part, Sizes, made_up_windows, median, ms, phase_parts};
use crate::batch::Batch;
use crate::error::Result;
use crate::learners::behaviour::{BehaviourLearner, BehaviourMeasures};
use crate::learners::world::Learner;
use crate::online::actor::{ActorThread, Task};
use crate::online::options::OnlineOptions;
use crate::options::Options;

/// What was measured; medians, in milliseconds.
#[derive(Debug, Clone, Serialize)]
pub struct OnlineReport {
    /// The task whose episode was lived through.
    pub task: String,
    /// One whole update: world model, actor, critic.
    pub update_ms: f64,
    /// The world model's part of it.
    pub world_ms: f64,
    /// Actor's and critic's part of it.
    pub behaviour_ms: f64,
    /// All parts, in order.
    pub parts: Vec<Part>,
    /// The networks' part of acting, a step.
    pub acting_ms: f64,
    /// A step of an episode: simulation, drawing, acting.
    pub step_ms: f64,
    /// Updates for every agent step.
    pub updates_per_step: f64,
    /// The loop as it runs, in short episodes.
    pub end_to_end: EndToEnd,
    /// Who is waited for: `learner` or `actor`.
    pub waited_for: &'static str,
}

/// Times updates on made-up windows, one episode of `online`'s world, and the two at once.
///
/// # Errors
/// The task is unknown, or this machine cannot draw.
pub fn bench_online(
    options: &Options,
    online: &OnlineOptions,
    repeats: usize,
    device: &Device,
) -> Result<OnlineReport> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let spec = online.world.spec()?;
    let picture = online.world.size.unwrap_or(64) as usize;
    let sizes = Sizes { picture, actions: spec.action_len(), repeats };
    let config = options.model(&spec, ObservationKind::Pixels { height: picture, width: picture }, 1.0);
    let behaviour = Behaviour::init(&config, online.behaviour.config(), &mut rng, device);
    let guard = online.behaviour.guard(&config, &mut rng, device);
    let mut learner = Learner::new(Model::init(config, &mut rng, device)?, options, device);
    let mut behaviour = BehaviourLearner::new(behaviour, device).guarded(guard);
    let windows = made_up_windows(options, sizes, &mut rng);
    let autodiff = device.clone().autodiff();
    let (mut worlds, mut behaviours, mut phases, mut made) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for _ in 0..=repeats {
        let begun = Instant::now();
        let batch = Batch::new(&windows, &learner.model.config, options.burn_in, &autodiff)?;
        let (next, mut measures) =
            learner.update(&batch, options.schedule(u64::MAX, Some(0)), options.parts(), &mut rng)?;
        learner = next;
        worlds.push(ms(begun));
        phases.push(measures.phases);
        let begun = Instant::now();
        let rows = measures.take_replayed(&batch, &windows);
        let (next, measures) = behaviour.update(&learner.model.world, &rows, &online.behaviour, true, &mut rng)?;
        behaviour = next;
        behaviours.push(ms(begun));
        made.push(measures);
    }
    let agent = Agent::new(&learner.model, &behaviour.behaviour.actor, device);
    let acting_ms = acting(&agent, &windows.pixels, sizes, repeats)?;
    let step_ms = living(&agent, online)?;
    let (world_ms, behaviour_ms) = (median(&worlds), median(&behaviours));
    let mut parts = phase_parts(&phases);
    parts.extend(behaviour_parts(&made));
    let updates_per_step = online.updates_per_step(options.length * options.batch);
    let folder = scratch("loop");
    // One that was killed under the same number may have left it.
    forget(&folder);
    let timed = end_to_end(&folder, options, online, device);
    forget(&folder);
    let timed = timed?;
    Ok(OnlineReport {
        task: online.world.task.clone(),
        update_ms: world_ms + behaviour_ms,
        world_ms,
        behaviour_ms,
        parts,
        acting_ms,
        step_ms,
        updates_per_step,
        end_to_end: timed,
        waited_for: if timed.acting_share < 1.0 - timed.waiting_for_actor_share { "learner" } else { "actor" },
    })
}

/// A folder for what is written while it is timed.
fn scratch(what: &str) -> PathBuf {
    std::env::temp_dir().join(format!("vibes-bench-{what}-{}", std::process::id()))
}

/// What was written is of no use to anyone, and a folder left in the temporary files does no harm.
fn forget(folder: &Path) {
    let _ = std::fs::remove_dir_all(folder);
}

fn behaviour_parts(made: &[BehaviourMeasures]) -> Vec<Part> {
    let part =
        |name, of: fn(&BehaviourMeasures) -> f64| Part { name, ms: median(&made.iter().map(of).collect::<Vec<_>>()) };
    vec![
        part("imagination and values", |measures| measures.phases.imagine),
        part("actor, backward and Adam", |measures| measures.phases.actor),
        part("critic, both passes and Adam", |measures| measures.phases.critic),
    ]
}

/// The networks alone, a step.
fn acting(agent: &Agent, pixels: &[u8], sizes: Sizes, repeats: usize) -> Result<f64> {
    let mut agent = agent.clone();
    agent.begin();
    let (mut times, mut rng) = (Vec::new(), ChaCha8Rng::seed_from_u64(0));
    let mut action = vec![0.0; sizes.actions];
    for frame in pixels.chunks_exact(3 * sizes.picture * sizes.picture).take(10 * repeats.max(1)) {
        let begun = Instant::now();
        action = agent.act(RawFrames::Pixels(frame), &action, Choice::Sample, &mut rng)?;
        times.push(ms(begun));
    }
    Ok(median(&times))
}

/// An episode as the actor's thread lives through it, milliseconds a step; the first, which opens the renderer, is not counted.
fn living(agent: &Agent, online: &OnlineOptions) -> Result<f64> {
    let libraries = online.world.libraries()?;
    let folder = scratch("acting");
    forget(&folder);
    let manifest = online.world.manifest(0, libraries[0].videos(), &folder)?;
    let writer = Arc::new(RecordingWriter::create_or_resume(&folder, manifest, false)?);
    let lived = std::thread::scope(|scope| {
        let thread = ActorThread::start(scope, &online.world, libraries, writer);
        let task = |number| Task {
            player: Some(Player::new(TrainedAgent::World(Box::new(agent.clone())), Choice::Sample, 0.0)),
            videos: VideoSet::Train,
            seed: u64::from(number),
            keep: Some((number, "bench".to_owned())),
        };
        thread.live(task(0))?;
        thread.live(task(1))
    });
    forget(&folder);
    let lived = lived?;
    Ok(lived.seconds * 1e3 / f64::from(lived.steps))
}
