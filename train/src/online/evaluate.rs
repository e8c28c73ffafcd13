//! How well an agent does: whole episodes on held-out and on training videos, the same starts and distractors at every evaluation. In: an agent. Out: a line of
//! `evaluations.jsonl` with mean returns and their 95 % intervals. An episode of either set has the start, the camera and the colours of the same number of the other, so that the gap
//! between the two is what new videos cost.

use std::path::Path;

use serde::Serialize;
use vibes_env::render::Look;
use vibes_env::videos::VideoSet;
use vibes_measure::returns::mean_return;
use vibes_model::ObservationKind;
use vibes_model::actions::Choice;
use vibes_model::player::Player;
use vibes_model::trained::TrainedAgent;

use super::actor::{ActorThread, EpisodeKind, Task, episode_seed};
use super::options::{GivenFrom, OnlineOptions};
use super::protocol::Protocol;
use super::unfinished::{Unfinished, Which};
use crate::error::Result;
use crate::fit::Go;
use crate::json::keep_lines;

/// Where a run stood.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Counters {
    /// Updates made.
    pub update: u64,
    /// Control steps lived through, action repeats counted.
    pub control_steps: u64,
    /// Agent steps lived through.
    pub agent_steps: u64,
    /// Episodes admitted.
    pub episodes: u32,
    /// Control steps of the recordings that the run began with, which it did not live through itself. None where there were no recordings, or how long they were is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given_control_steps: Option<u64>,
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

/// What new videos cost: the return under training videos less that under held-out ones, paired by episode.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gap {
    /// Its mean.
    pub mean: f64,
    /// 95 % interval of the mean (Student's t over pairs); absent with fewer than two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
}

/// A line of `evaluations.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Where the run stood.
    #[serde(flatten)]
    pub counters: Counters,
    /// What `given_control_steps` is known from, where that is not the recordings: of those that are gone every view of an episode counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given_from: Option<GivenFrom>,
    /// False where the run began with recordings under videos of the held-out set; else it is not said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub is_held_out: Option<bool>,
    /// The protocol, if the run follows one; none of a last evaluation that came before its control steps were lived through, as where the minutes were up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<Protocol>,
    /// Where the videos of a protocol came from: `procedural`, or the name of a folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub videos: Option<String>,
    /// How the pictures were drawn under a protocol, which leaves that free.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look: Option<Look>,
    /// Side of the pictures under a protocol, in pixels, which it leaves free too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<u32>,
    /// Under held-out videos.
    pub held_out: Returns,
    /// Under training videos.
    pub training_videos: Returns,
    /// The gap between the two; none where nobody sees a video.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gap: Option<Gap>,
    /// Whether it is the last one.
    pub is_final: bool,
}

impl Gap {
    fn between(training_videos: &Returns, held_out: &Returns) -> Result<Self> {
        let pairs = training_videos.returns.iter().zip(&held_out.returns);
        let Returns { mean_return, interval, .. } = Returns::of(pairs.map(|(known, new)| known - new).collect())?;
        Ok(Self { mean: mean_return, interval })
    }
}

impl Returns {
    fn of(returns: Vec<f64>) -> Result<Self> {
        let found = mean_return(&returns)?;
        let interval = found.low.is_finite().then_some([found.low, found.high]);
        Ok(Self { mean_return: found.estimate, interval, returns })
    }
}

/// Evaluates; the last evaluation has its own number of episodes and starts. Nothing comes of it where `listen`, which is asked after every episode, stops it; what was lived
/// through then lies in the folder `run`, where the same evaluation goes on with it.
///
/// # Errors
/// An episode cannot be lived through.
pub fn evaluate(
    acting: &ActorThread,
    agent: &TrainedAgent,
    (run, options): (&Path, &OnlineOptions),
    counters: Counters,
    (seed, is_final): (u64, bool),
    listen: &mut dyn FnMut() -> Go,
) -> Result<Option<Evaluation>> {
    let choice = if options.evaluate_mode { Choice::Mode } else { Choice::Sample };
    let (kind, count) = match is_final {
        true => (EpisodeKind::Final, options.final_episodes.max(1)),
        false => (EpisodeKind::Evaluation, options.evaluation_episodes.max(1)),
    };
    let Counters { update, control_steps, .. } = counters;
    let mut unfinished = Unfinished::open(run, Which { update, control_steps, is_final });
    let mut returns = |videos| {
        for number in unfinished.of(videos).len() as u32..count {
            let player = Some(Player::new(agent.clone(), choice, 0.0));
            let seed = episode_seed(seed, kind, u64::from(number));
            unfinished.push(videos, acting.live(Task { player, videos, seed, keep: None })?.episode_return)?;
            if listen() == Go::Stop {
                return Ok(None);
            }
        }
        let lived = unfinished.of(videos);
        Returns::of(lived[..lived.len().min(count as usize)].to_vec()).map(Some)
    };
    let Some(held_out) = returns(VideoSet::Val)? else { return Ok(None) };
    // Where nobody sees a video the episodes of the two sets are the same; an agent may look at the numbers of a world that is drawn.
    let has_eyes = matches!(agent.observation(), ObservationKind::Pixels { .. });
    let has_videos = has_eyes && options.world.has_videos();
    let training_videos = if has_videos { returns(VideoSet::Train)? } else { Some(held_out.clone()) };
    let Some(training_videos) = training_videos else { return Ok(None) };
    let gap = has_videos.then(|| Gap::between(&training_videos, &held_out)).transpose()?;
    let is_over = counters.control_steps >= options.control_steps;
    let protocol = options.protocol.filter(|_| is_over || !is_final);
    Ok(Some(Evaluation {
        counters,
        given_from: options.given_from.filter(|from| *from == GivenFrom::RunFile),
        is_held_out: (!options.held_out_seen.is_empty()).then_some(false),
        protocol,
        videos: protocol.map(|_| options.world.videos.name()),
        look: protocol.map(|_| options.world.look),
        size: protocol.and(options.world.size),
        held_out,
        training_videos,
        gap,
        is_final,
    }))
}

/// Drops the lines of evaluations that a stopped run made after its last checkpoint, of so many updates and control steps: those from `next` control steps on, and of a run that was
/// not `finished` there the last evaluation of these weights. That of fewer updates, after which the run was given more minutes, was saved with a checkpoint before this one.
///
/// # Errors
/// The file cannot be read or written.
pub(super) fn drop_beyond(path: &Path, next: u64, (update, control_steps): (u64, u64), finished: bool) -> Result<()> {
    keep_lines(path, |line| {
        let is_unsaved = !finished && line["is_final"] == true && line["update"] == update;
        let end = if is_unsaved { next.min(control_steps) } else { next };
        line["control_steps"].as_u64().is_some_and(|steps| steps < end)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gap_is_of_pairs() {
        let of = |returns: &[f64]| Returns::of(returns.to_vec()).unwrap();
        let (known, new) = (of(&[100.0, 900.0, 500.0]), of(&[90.0, 880.0, 494.0]));
        let gap = Gap::between(&known, &new).unwrap();
        assert!((gap.mean - 12.0).abs() < 1e-9);
        let [low, high] = gap.interval.unwrap();
        assert!(0.0 > low && high < 40.0, "{low} to {high}: starts that differ by hundreds do not count");
        assert_eq!(Gap::between(&of(&[3.0]), &of(&[1.0])).unwrap(), Gap { mean: 2.0, interval: None });
    }

    #[test]
    fn what_was_evaluated_after_the_last_checkpoint_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("evaluations.jsonl");
        let line = |update: u64, steps: u64, is_final: bool| {
            format!("{{\"update\":{update},\"control_steps\":{steps},\"is_final\":{is_final}}}\n")
        };
        let all = [line(10, 100, false), line(20, 150, true), line(40, 200, false)];
        let left = |next, at, finished| {
            std::fs::write(&file, all.concat()).unwrap();
            drop_beyond(&file, next, at, finished).unwrap();
            std::fs::read_to_string(&file).unwrap()
        };
        assert_eq!(left(300, (40, 200), true), all.concat(), "a run that is longer now keeps the end that it had");
        assert_eq!(left(200, (20, 150), true), all[..2].concat());
        assert_eq!(left(200, (20, 150), false), all[0], "the last evaluation was not saved");
        assert_eq!(left(200, (30, 150), false), all[..2].concat(), "that of fewer updates was");
        drop_beyond(&folder.path().join("none"), 0, (0, 0), false).unwrap();
    }
}
