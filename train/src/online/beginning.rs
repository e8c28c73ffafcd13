//! What an online run begins with: how many control steps others lived through for it, and whether the held-out videos are new to it. In: the run that it goes on from, as far as that, the
//! runs before it and their recordings are there. Out: what `online.json` says of it from then on, or why a protocol cannot be followed from there.

mod given;

use std::collections::BTreeSet;
use std::path::Path;

use vibes_data::{HeadStart, Recording};
use vibes_env::{Environment, EnvironmentOptions};
use vibes_model::ObservationKind;

use self::given::{Past, control_steps_of};
use super::options::{GivenFrom, OnlineOptions, WorldOptions};
use crate::error::{Result, TrainError};
use crate::evaluate::films;
use crate::run::Run;
use crate::summary::given_in_words;

/// The options of a run at `path`, with what is to be said of its beginning; `from` is the run that it goes on from, or the run itself where it has begun.
///
/// # Errors
/// They are under a protocol, and it is not known what the run begins with, or that has seen videos which the protocol holds out.
pub(super) fn settled(path: &Path, from: &Run, kind: ObservationKind, options: OnlineOptions) -> Result<OnlineOptions> {
    let found = OnlineOptions::read(path)?;
    let past = Past::of(from)?;
    let (given_control_steps, given_from) = match &found {
        // Recordings are taken away on the way; a run that was begun before this was kept has neither.
        Some(found) => (found.given_control_steps, found.given_from),
        None => {
            let start = past.head_start(Some(&options.world), options.world.action_repeat);
            (start.given_control_steps, Some(start.given_from))
        }
    };
    let mut seen: BTreeSet<String> = found.into_iter().flat_map(|found| found.held_out_seen).collect();
    if matches!(kind, ObservationKind::Pixels { .. }) {
        seen.extend(held_out_seen(&options.world, &past.chain.seen().recordings));
        seen.extend(seen_before(&past, &options.world));
    }
    let held_out_seen = seen.into_iter().collect();
    let options = OnlineOptions { given_control_steps, given_from, held_out_seen, ..options };
    check(&options, from)?;
    Ok(options)
}

/// That what a run begins with allows the protocol that it is to follow.
fn check(options: &OnlineOptions, from: &Run) -> Result<()> {
    let Some(protocol) = options.protocol else { return Ok(()) };
    let refuse = |fact: &str, right: &str| {
        let place = from.path().display();
        Err(TrainError::Options(format!("{fact}; {right}, or leave out --protocol: {place}")))
    };
    if options.given_from == Some(GivenFrom::Unknown) {
        let fact = format!(
            "{protocol} has every evaluation say how many control steps a run began with, and that is not known here: a run that this one goes back to is gone, and none between says it"
        );
        return refuse(&fact, "put it back where it was");
    }
    if !options.held_out_seen.is_empty() {
        let seen = options.held_out_seen.join(", ");
        let fact = format!("{protocol} holds out videos that are in the recordings this run begins with ({seen})");
        return refuse(&fact, "begin with recordings under training videos");
    }
    Ok(())
}

/// What a run began with, for a copy of it that is to say this without the runs before it; none where its `online.json` says it already, or it began anew, or that is not known.
///
/// # Errors
/// An `online.json` is damaged.
pub(crate) fn head_start(run: &Run) -> Result<Option<HeadStart>> {
    let online = OnlineOptions::read(run.path())?;
    if online.as_ref().is_some_and(|online| online.given_from.is_some()) {
        return Ok(None);
    }
    let known = run.info().began_with;
    let (None, Ok(Some(from))) = (known, run.open_from()) else { return Ok(known) };
    let past = Past::of(&from)?;
    let world = online.map(|online| online.world);
    let left = run.recordings_left().into_iter().chain(past.chain.seen().recordings).next();
    let repeat = world.as_ref().map(|world| world.action_repeat);
    let repeat = repeat.or_else(|| left.map(|recording| recording.manifest().spec.action_repeat));
    // Where no recording is left, as long as the task holds an action; of a task of somebody's own nobody knows.
    let environment = || Environment::new(&run.info().model.task, EnvironmentOptions::default()).ok();
    let repeat = repeat.or_else(|| environment().map(|environment| environment.action_repeat()));
    let start = repeat.map(|repeat| past.head_start(world.as_ref(), repeat));
    Ok(start.filter(|start| start.given_from != GivenFrom::Unknown))
}

/// The control steps that a run began with: as they were counted then, or, of a run that was begun before that was kept, of those recordings of the runs before it that are left.
pub(super) fn given_control_steps(run: &Run, options: &OnlineOptions, given: &[Recording]) -> Option<u64> {
    if options.given_from.is_some() {
        return options.given_control_steps;
    }
    let mut recordings = given.to_vec();
    recordings.extend(run.before().0.iter().flat_map(Run::recordings_left));
    Some(control_steps_of(&recordings)).filter(|steps| *steps > 0)
}

/// The held-out videos of a world that are among those of some recordings.
fn held_out_seen(world: &WorldOptions, recordings: &[Recording]) -> BTreeSet<String> {
    let held_out: BTreeSet<String> = world.names_held_out().into_iter().collect();
    let films = recordings.iter().flat_map(films);
    let seen = films.filter(|(source, film)| held_out.contains(&film.name) && world.videos.has_film(film, source));
    seen.map(|(_, film)| film.name).collect()
}

/// The held-out videos of a world that one of the runs before is known to have seen, though its recordings may be gone.
fn seen_before(past: &Past, world: &WorldOptions) -> BTreeSet<String> {
    let held_out: BTreeSet<String> = world.names_held_out().into_iter().collect();
    let known = past.online().filter(|online| online.world.videos == world.videos);
    let seen = known.flat_map(|online| &online.held_out_seen);
    seen.filter(|name| held_out.contains(*name)).cloned().collect()
}

/// What is to be known of a run's beginning, a sentence each.
pub(super) fn notes(run: &Run, options: &OnlineOptions) -> Vec<String> {
    let given =
        options.given_in_words().map(|given| format!("it begins with {given}, which --control-steps does not count"));
    let is_unknown = options.given_from == Some(GivenFrom::Unknown);
    let unknown = is_unknown.then(|| {
        let text = "how many control steps it begins with is not known: a run that it goes back to is gone, and none between says it";
        text.to_owned()
    });
    let is_seen = !options.held_out_seen.is_empty();
    let seen = is_seen.then(|| {
        let videos = options.held_out_seen.join(", ");
        format!("the recordings it begins with are under videos that it is evaluated under ({videos}): no evaluation is held out, and each says so (is_held_out)")
    });
    let has_eyes = matches!(run.info().model.observation, ObservationKind::Pixels { .. });
    // Where everything was there when the run began, it was known then.
    let was_there = options.given_from == Some(GivenFrom::Recordings);
    let is_unsure = !is_seen && !was_there && has_eyes && options.world.has_videos() && !is_all_there(run);
    let unsure = is_unsure.then(|| {
        let text = "some of what it begins with is gone, so that it is not known whether that was under videos that it is evaluated under";
        text.to_owned()
    });
    [given, unknown, seen, unsure].into_iter().flatten().collect()
}

/// Whether everything is there that the runs before one have learned from.
fn is_all_there(run: &Run) -> bool {
    match run.open_from() {
        Ok(from) => from.is_none_or(|from| from.seen().is_whole),
        Err(_gone) => false,
    }
}

impl OnlineOptions {
    /// The control steps that the run began with, in words; none where there are none, or they are not known.
    pub fn given_in_words(&self) -> Option<String> {
        let is_from_run_file = self.given_from == Some(GivenFrom::RunFile);
        self.given_control_steps.map(|steps| given_in_words(steps, is_from_run_file))
    }
}

#[cfg(test)]
mod tests;
