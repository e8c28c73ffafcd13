//! What online training leaves in a checkpoint beside the world model, and how it is taken up again. In: the learner of actor and critic, and the
//! counters. Out: the files that the module above lists, and everything from them.

use std::collections::HashMap;
use std::path::Path;

use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use vibes_data::RunFolder;
use vibes_model::behaviour::Behaviour;
use vibes_model::checkpoint::{load_tensors, save_tensors};
use vibes_model::guard::Guard;
use vibes_model::parameters::HostTensors;
use vibes_model::returns::ReturnScale;

use crate::checkpoints;
use crate::error::{Result, TrainError, io, malformed};
use crate::json::{is_zero, write_json};
use crate::learners::behaviour::BehaviourLearner;
use crate::learners::behaviour::guard::GuardLearner;
use crate::learners::optimizer::counts;
use crate::learners::world::Learner;
use crate::run::{Run, State};

/// Where online training stands, beside the world model's own state: saved with every checkpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct OnlineState {
    /// Episodes admitted, random ones included.
    pub episodes: u32,
    /// Control steps of them.
    pub control_steps: u64,
    /// Agent steps of them.
    pub agent_steps: u64,
    /// Updates paid for and not made yet; a fraction remains from round to round.
    pub credit: f64,
    /// Updates of actor and critic.
    pub updates: u64,
    /// How often world model, actor and critic were begun anew.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub resets: u64,
    /// Of the updates those before the last time.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub updates_before_reset: u64,
    /// Control steps at which the next evaluation is due.
    pub next_evaluation: u64,
    /// Adam's steps of the actor.
    pub actor_steps: u64,
    /// Adam's steps of the critic.
    pub critic_steps: u64,
    /// Adam's steps of the guard; 0 without one.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub guard_steps: u64,
    /// What returns are divided by.
    pub scale: ReturnScale,
    /// Whether the last evaluation has been made.
    pub is_finished: bool,
}

impl OnlineState {
    /// Updates that the weights of actor and critic have behind them.
    pub fn updates_since_reset(&self) -> u64 {
        self.updates - self.updates_before_reset
    }
}

/// What a checkpoint gives back.
pub(super) struct Resumed {
    pub(super) learner: Learner,
    pub(super) behaviour: BehaviourLearner,
    pub(super) world: State,
    pub(super) online: OnlineState,
}

const BEHAVIOUR: &str = "behaviour.safetensors";
const GUARD: &str = "guard.safetensors";
const WORLD_MOMENTS: &str = "optimizer.safetensors";
const MOMENTS: &str = "behaviour_optimizer.safetensors";
const STATE: &str = "online.json";

/// Writes the files of actor, critic and guard, and where training stands.
pub(super) fn save_behaviour(folder: &Path, learner: &BehaviourLearner, state: OnlineState) -> Result<()> {
    learner.behaviour.save(&folder.join(BEHAVIOUR))?;
    let mut moments = learner.actor_optimizer.to_tensors("actor");
    moments.extend(learner.critic_optimizer.to_tensors("critic"));
    if let Some(guard) = &learner.guard {
        guard.guard.save(&folder.join(GUARD))?;
        moments.extend(guard.optimizer.to_tensors("guard"));
    }
    save_tensors(&folder.join(MOMENTS), &moments, HashMap::new())?;
    write_json(&folder.join(STATE), &state)
}

/// That a folder is no copy of an online run that `vibes-train keep` has made, which has nothing to go on with.
///
/// # Errors
/// [`TrainError::KeptCopy`].
pub(super) fn check_whole(run: &Path) -> Result<()> {
    let newest = RunFolder::at(run).newest_checkpoint();
    let is_kept = |folder: &Path| folder.join(STATE).is_file() && !folder.join(MOMENTS).is_file();
    if newest.is_ok_and(|folder| is_kept(&folder)) {
        return Err(TrainError::KeptCopy { path: run.to_owned() });
    }
    Ok(())
}

/// Control steps that a run had lived through at its newest checkpoint, which a kept copy says too; none of a run without one.
pub(super) fn lived(run: &Run) -> Option<u64> {
    let file = run.places().newest_checkpoint().ok()?.join(STATE);
    let state: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(file).ok()?).ok()?;
    state["control_steps"].as_u64()
}

/// Takes up the newest checkpoint, with its guard if the run `is_guarded`; none in a run without one.
///
/// # Errors
/// [`TrainError`]: a file is missing or damaged.
pub(super) fn resume(run: &Run, is_guarded: bool, device: &Device) -> Result<Option<Resumed>> {
    let Some((learner, world)) = run.resume(device)? else { return Ok(None) };
    checkpoints::newest(run.places(), |folder| take_up(run, (learner, world), folder, is_guarded, device))
}

fn take_up(
    run: &Run,
    (learner, world): (Learner, State),
    folder: &Path,
    is_guarded: bool,
    device: &Device,
) -> Result<Resumed> {
    // Kept copies lack it, which are not gone on with.
    let world_moments = folder.join(WORLD_MOMENTS);
    std::fs::metadata(&world_moments).map_err(io("read", &world_moments))?;
    let file = folder.join(STATE);
    let text = std::fs::read_to_string(&file).map_err(io("read", &file))?;
    let online: OnlineState = serde_json::from_str(&text)
        .map_err(|error| malformed(&file, error, "an online.json as `vibes-train online` writes it"))?;
    let behaviour = Behaviour::load(&folder.join(BEHAVIOUR), &run.info().model, device)?;
    let guard = is_guarded.then(|| Guard::load(&folder.join(GUARD), &run.info().model, device)).transpose()?;
    let mut behaviour = BehaviourLearner::new(behaviour, device).guarded(guard);
    let place = folder.join(MOMENTS);
    let (moments, _) = load_tensors(&place)?;
    restore(&mut behaviour, online, (&moments, &place), device)?;
    behaviour.scale = online.scale;
    Ok(Resumed { learner, behaviour, world, online })
}

fn restore(
    learner: &mut BehaviourLearner,
    online: OnlineState,
    from: (&HostTensors, &Path),
    device: &Device,
) -> Result<()> {
    let Behaviour { actor, critic, .. } = &learner.behaviour;
    learner.actor_optimizer.restore("actor", &counts(actor), from, online.actor_steps, device)?;
    learner.critic_optimizer.restore("critic", &counts(critic), from, online.critic_steps, device)?;
    let Some(GuardLearner { guard, optimizer }) = &mut learner.guard else { return Ok(()) };
    optimizer.restore("guard", &counts(&guard.members), from, online.guard_steps, device)
}
