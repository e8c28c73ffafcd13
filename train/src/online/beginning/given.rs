//! How many control steps others lived through for a run. In: the runs that it goes on from, the nearest first, with what is left of what they learned from. Out: the number, and what it is
//! known from.
//!
//! The nearest run that has kept what it began with itself ends the count: what lies further back may be gone.

use std::collections::{BTreeMap, BTreeSet};

use vibes_data::{EpisodeEntry, GivenFrom, HeadStart, Recording};

use super::super::checkpoint::lived;
use super::super::options::{OnlineOptions, WorldOptions};
use crate::error::Result;
use crate::prepare::held;
use crate::run::{Chain, Link, Run, RunInfo};

/// The runs that a run goes on from, read once.
#[derive(Debug)]
pub(super) struct Past {
    pub(super) chain: Chain,
    /// Of each its options, where it is an online run.
    online: Vec<Option<OnlineOptions>>,
}

impl Past {
    /// That of a run which goes on from this one.
    ///
    /// # Errors
    /// An `online.json` is damaged.
    pub(super) fn of(from: &Run) -> Result<Self> {
        let chain = from.chain();
        let online = chain.links.iter().map(|link| OnlineOptions::read(link.run.path())).collect::<Result<_>>()?;
        Ok(Self { chain, online })
    }

    /// The options of the online runs among them.
    pub(super) fn online(&self) -> impl Iterator<Item = &OnlineOptions> {
        self.online.iter().flatten()
    }

    /// Control steps that a run in this world begins with: all that these runs have learned from. The action repeat is that of recordings of which nobody else says it.
    pub(super) fn head_start(&self, world: Option<&WorldOptions>, action_repeat: u32) -> HeadStart {
        let unknown = HeadStart { given_control_steps: None, given_from: GivenFrom::Unknown };
        let links = &self.chain.links;
        let kept = (0..links.len()).find_map(|at| Some((at, self.kept(at, world)?)));
        let near = match kept {
            Some((at, _)) => at + 1,
            None if self.chain.is_to_the_first => links.len(),
            None => return unknown,
        };
        let Some(lost) = self.lost(near) else { return unknown };
        let covered = self.covered(kept.map(|(at, _)| at));
        let gone = gone(&links[..near], covered, action_repeat);
        let is_counted = gone.is_none() && lost.is_empty();
        let given_from = match kept.map_or(GivenFrom::Recordings, |(_, start)| start.given_from) {
            GivenFrom::Recordings if is_counted => GivenFrom::Recordings,
            _ => GivenFrom::RunFile,
        };
        let before = kept.and_then(|(_, start)| start.given_control_steps).unwrap_or(0);
        let there = there(links, near, covered, before);
        let steps = lost.into_iter().chain(gone).fold(there, u64::saturating_add);
        HeadStart { given_control_steps: Some(steps).filter(|steps| *steps > 0), given_from }
    }

    /// What one of them has kept of its own beginning, if it was known then. Nothing was looked for then but the held-out videos of its own world, so that for another world this is no
    /// more than what a file says; nor is what stands in the `run.json` of a copy.
    fn kept(&self, at: usize, world: Option<&WorldOptions>) -> Option<HeadStart> {
        let has_looked_for = |own: &WorldOptions| {
            world.is_some_and(|world| own.videos == world.videos && own.names_held_out() == world.names_held_out())
        };
        let own = self.online[at].as_ref().and_then(|online| {
            let given_from = match online.given_from? {
                GivenFrom::Recordings if !has_looked_for(&online.world) => GivenFrom::RunFile,
                found => found,
            };
            Some(HeadStart { given_control_steps: online.given_control_steps, given_from })
        });
        let in_run_file = self.chain.links[at].run.info().began_with;
        let is_known = |start: &HeadStart| start.given_from != GivenFrom::Unknown;
        let told = in_run_file.filter(is_known).map(|start| HeadStart { given_from: GivenFrom::RunFile, ..start });
        own.filter(is_known).or(told)
    }

    /// Control steps of each of the nearest runs that lived through some itself and lacks its replay, as a kept copy does: its checkpoint counts them. None where one of them does not say.
    fn lost(&self, near: usize) -> Option<Vec<u64>> {
        let online = self.chain.links[..near].iter().zip(&self.online).filter(|(_, online)| online.is_some());
        online.filter(|(link, _)| link.replay.is_none()).map(|(link, _)| lived(&link.run)).collect()
    }

    /// The runs whose recordings are in the number of the one that has kept it: all before it, and an online run itself, which was given recordings of theirs.
    fn covered(&self, kept: Option<usize>) -> &[Link] {
        let links = &self.chain.links;
        let first = kept.map_or(links.len(), |at| at + usize::from(self.online[at].is_none()));
        &links[first..]
    }
}

/// Control steps of what is left beside those `before`, which were counted by a run that has kept them: the recordings of the `covered` runs are among these, and a recording that has
/// grown since is counted as it is now.
fn there(links: &[Link], near: usize, covered: &[Link], before: u64) -> u64 {
    let all = trajectories(links[..near].iter().flat_map(Link::left));
    let replays = links[near..].iter().flat_map(|link| &link.replay);
    let known = trajectories(covered.iter().flat_map(|link| &link.recordings).chain(replays));
    let new = control_steps(all.difference(&known));
    before.saturating_add(new).max(control_steps(&all))
}

/// Control steps of the recordings that are gone, as `run.json` has them of the runs that learned from them; none where all are there. Runs that name the same recordings learned from the
/// same episodes, and those of the `covered` runs are counted.
fn gone(runs: &[Link], covered: &[Link], action_repeat: u32) -> Option<u64> {
    let what = |info: &RunInfo| (info.recording_names(), info.episodes, info.steps);
    let mut by_names: BTreeMap<Vec<String>, u64> = BTreeMap::new();
    for link in runs.iter().filter(|link| !link.has_its_recordings()) {
        let info = link.run.info();
        if covered.iter().any(|other| what(other.run.info()) == what(info)) {
            continue;
        }
        // All recordings of a run hold an action for as long; where none is left, as long as the world that is gone on in.
        let left = &link.recordings;
        let repeat = left.first().map_or(action_repeat, |recording| recording.manifest().spec.action_repeat);
        let steps = info.steps.saturating_sub(held(left).1).saturating_mul(u64::from(repeat));
        let most = by_names.entry(info.recording_names()).or_default();
        *most = steps.max(*most);
    }
    (!by_names.is_empty()).then(|| by_names.values().fold(0, |sum: u64, steps| sum.saturating_add(*steps)))
}

/// Control steps of some recordings; a state trajectory that was recorded under several distractors, or drawn again, counts once.
pub(super) fn control_steps_of<'a>(recordings: impl IntoIterator<Item = &'a Recording>) -> u64 {
    control_steps(&trajectories(recordings))
}

/// What state trajectories are told apart by; the last two are how many steps they have, and for how many control steps each holds its action.
type Trajectory = (Option<String>, u64, String, u64, u32, u32);

fn trajectories<'a>(recordings: impl IntoIterator<Item = &'a Recording>) -> BTreeSet<Trajectory> {
    let of = |recording: &'a Recording| {
        let repeat = recording.manifest().spec.action_repeat;
        // What another program recorded has no seeds of its own to tell its trajectories apart by.
        let is_imported = recording.manifest().is_imported();
        let own = move |entry: &EpisodeEntry| is_imported.then(|| entry.arrow.sha256.clone());
        recording.episodes().iter().map(move |entry| {
            (own(entry), entry.seed, entry.policy.clone(), entry.episode_return.to_bits(), entry.steps, repeat)
        })
    };
    recordings.into_iter().flat_map(of).collect()
}

fn control_steps<'a>(trajectories: impl IntoIterator<Item = &'a Trajectory>) -> u64 {
    trajectories.into_iter().map(|(.., steps, repeat)| u64::from(*steps) * u64::from(*repeat)).sum()
}
