//! How well an agent does: whole episodes on held-out and on training videos, the same starts and distractors at every evaluation. In: an agent. Out: a line of
//! `evaluations.jsonl` with mean returns and their 95 % intervals. The gap between the two sets is what the distractors cost.

use std::path::Path;

use serde::Serialize;
use vibes_data::write_atomically;
use vibes_env::videos::VideoSet;
use vibes_measure::returns::mean_return;
use vibes_model::actions::Choice;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;

use super::actor::{ActorThread, EpisodeKind, Task, episode_seed};
use super::options::OnlineOptions;
use super::protocol::Protocol;
use crate::error::{Result, io};

/// Where a run stood.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Counters {
    /// Updates made.
    pub update: u64,
    /// Control steps lived through, action repeats counted.
    pub control_steps: u64,
    /// Agent steps lived through.
    pub agent_steps: u64,
    /// Episodes admitted.
    pub episodes: u32,
}

/// Returns of some episodes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Returns {
    /// Their mean.
    pub mean_return: f64,
    /// 95 % interval of the mean (Student's t over episodes); absent with fewer than two episodes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
    /// Every one.
    pub returns: Vec<f64>,
}

/// A line of `evaluations.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Where the run stood.
    #[serde(flatten)]
    pub counters: Counters,
    /// The protocol, if the run follows one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<Protocol>,
    /// Under held-out videos.
    pub held_out: Returns,
    /// Under training videos; the last evaluation leaves them out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training_videos: Option<Returns>,
    /// Whether it is the last one.
    pub is_final: bool,
}

impl Returns {
    fn of(returns: Vec<f64>) -> Result<Self> {
        let found = mean_return(&returns)?;
        let interval = found.low.is_finite().then_some([found.low, found.high]);
        Ok(Self { mean_return: found.estimate, interval, returns })
    }
}

/// Evaluates; the last evaluation has its own number of episodes and starts.
///
/// # Errors
/// An episode cannot be lived through.
pub fn evaluate(
    acting: &ActorThread,
    agent: &TrainedAgent,
    options: &OnlineOptions,
    counters: Counters,
    seed: u64,
    is_final: bool,
) -> Result<Evaluation> {
    let choice = if options.evaluate_mode { Choice::Mode } else { Choice::Sample };
    let returns = |kind, videos, count| {
        let task = |number: u32| Task {
            player: Some(Player::new(agent.clone(), choice, 0.0)),
            videos,
            seed: episode_seed(seed, kind, u64::from(number)),
            keep: None,
        };
        let lived = (0..count).map(|number| Ok(acting.live(task(number))?.episode_return));
        Returns::of(lived.collect::<Result<Vec<f64>>>()?)
    };
    let (held_out, training_videos) = if is_final {
        (returns(EpisodeKind::Final, VideoSet::Val, options.final_episodes.max(1))?, None)
    } else {
        let count = options.evaluation_episodes.max(1);
        let held_out = returns(EpisodeKind::EvaluationVal, VideoSet::Val, count)?;
        (held_out, Some(returns(EpisodeKind::EvaluationTrain, VideoSet::Train, count)?))
    };
    Ok(Evaluation { counters, protocol: options.protocol, held_out, training_videos, is_final })
}

/// Drops the lines of evaluations that a stopped run made after its last checkpoint: those from `next` control steps on.
///
/// # Errors
/// The file cannot be read or written.
pub(super) fn drop_beyond(path: &Path, next: u64) -> Result<()> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(io("read", path)(error)),
    };
    let is_kept = |line: &&str| {
        let line: Option<serde_json::Value> = serde_json::from_str(line).ok();
        line.and_then(|line| line["control_steps"].as_u64()).is_some_and(|steps| steps < next)
    };
    let kept: String = text.lines().filter(is_kept).flat_map(|line| [line, "\n"]).collect();
    Ok(write_atomically(path, kept.as_bytes())?)
}
