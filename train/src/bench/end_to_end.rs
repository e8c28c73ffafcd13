//! The loop of online training as it runs, for a few short episodes: acting, drawing and learning at once, on as many cores as there are. In: options. Out: control steps a second, and how long
//! either thread waited for the other.

use std::path::Path;

use burn::tensor::Device;
use serde::Serialize;

use super::median_of_all;
use crate::error::Result;
use crate::fit::Go;
use crate::online::options::{OnlineOptions, WorldOptions};
use crate::online::{Event, Pace, Setup, online, prepare};
use crate::options::Options;

/// Rounds that are timed.
const ROUNDS: u64 = 3;
/// Agent steps of an episode.
const STEPS: u32 = 40;

/// Medians over rounds.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct EndToEnd {
    /// Rounds: an episode each, and the updates that it asks for.
    pub rounds: usize,
    /// Control steps a second.
    pub control_steps_per_second: f64,
    /// Share of a round that the learner waited for the actor's thread.
    pub waiting_for_actor_share: f64,
    /// Share of a round that the actor's thread was at work.
    pub acting_share: f64,
}

/// Begins a run in `folder`, which is left there, and times its rounds; neither evaluations nor the random episode before are counted.
///
/// # Errors
/// The task is unknown, this machine cannot draw, or the folder cannot be written.
pub(super) fn end_to_end(
    folder: &Path,
    options: &Options,
    settings: &OnlineOptions,
    device: &Device,
) -> Result<EndToEnd> {
    // The first round has nothing to learn yet, since the episode before it pays for no updates.
    let episodes = 1 + 1 + ROUNDS;
    let paying = (1.0 / settings.updates_per_step(options.length * options.batch)).ceil() as u32;
    let steps = STEPS.max(options.length as u32).max(paying);
    let asked = OnlineOptions {
        world: WorldOptions { steps, ..settings.world.clone() },
        control_steps: episodes * u64::from(steps * settings.world.action_repeat),
        prefill: 1,
        first_updates: 0,
        critic_first: 0,
        evaluate_every: 0,
        final_episodes: 1,
        ..settings.clone()
    };
    let prepared = prepare::from_nothing(folder, options, asked)?;
    let setup = Setup { run: &prepared.run, options: &prepared.options, given: &prepared.given, device };
    let mut paces: Vec<Pace> = Vec::new();
    online(&setup, &mut |event| {
        // The first episode has no updates beside it.
        if let Event::Metrics(line) = event
            && line.learned.is_some()
        {
            paces.extend(line.pace);
        }
        Go::On
    })?;
    let of = |part: fn(&Pace) -> f64| median_of_all(&paces.iter().map(part).collect::<Vec<_>>());
    Ok(EndToEnd {
        rounds: paces.len(),
        control_steps_per_second: of(|pace| pace.control_steps_per_second),
        waiting_for_actor_share: of(|pace| pace.waiting_for_actor_share),
        acting_share: of(|pace| pace.acting_share),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loop_is_timed_as_it_runs() {
        let folder = tempfile::tempdir().unwrap();
        let world = WorldOptions { size: None, ..prepare::default_world("known-slide").unwrap() };
        let settings = OnlineOptions { rows_per_step: 8.0, ..prepare::default_options(world, false) };
        let options = Options::preset("tiny").unwrap();
        let found = end_to_end(&folder.path().join("run"), &options, &settings, &Device::flex()).unwrap();
        assert_eq!(found.rounds as u64, ROUNDS);
        assert!(found.control_steps_per_second > 0.0);
        assert!([found.waiting_for_actor_share, found.acting_share].iter().all(|share| (0.0..=1.0).contains(share)));
    }
}
