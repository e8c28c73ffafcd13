//! What a policy earns, without a recording: its episodes are acted out, their returns kept, and nothing else of them.
//!
//! In: how a recording would be made. Out: the [`Returns`] that the recording would say, number for number.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::acting::{Actor, Stage};
use super::queue::Queue;
use super::{Progress, RecordRun};
use crate::returns::Returns;
use crate::{Error, Result};
use vibes_env::{PolicyMix, StateTrajectory};

/// What all workers share.
struct Evaluation<'a> {
    stage: Stage<'a>,
    mix: PolicyMix,
    queue: Queue<'a, u32>,
    wanted: u32,
    /// Returns by state trajectory.
    earned: Mutex<BTreeMap<u32, f64>>,
    rows: AtomicU64,
}

/// Acts out every state trajectory of a run that simulates, and nothing is written. `place` is where numbers come from that nobody typed, such as the trained run which acts.
///
/// # Errors
/// The first thing that goes wrong, [`Error::Stopped`] when asked to stop; [`vibes_env::Error::NoEgl`] on a machine that cannot draw what a policy sees.
pub fn evaluate(run: &RecordRun<'_>, place: &Path, report: &(dyn Fn(Progress) + Sync)) -> Result<Option<Returns>> {
    let options = run.options;
    options.check(place)?;
    let environment = options.environment()?;
    let mix = options.mix()?;
    mix.shares().iter().try_for_each(|(policy, _)| policy.check(options.steps, &environment))?;
    // The cells of a grid's row share their states.
    let wanted = options.grid.map_or(options.episodes, |grid| grid.states);
    let evaluation = Evaluation {
        stage: Stage::open((run, place), &environment, report)?,
        mix,
        queue: Queue::new((0..wanted).collect(), run.stop),
        wanted,
        earned: Mutex::default(),
        rows: AtomicU64::new(0),
    };
    evaluation.queue.share(run.threads, || evaluation.work());
    let earned = evaluation.earned.into_inner().unwrap_or_else(PoisonError::into_inner);
    match evaluation.queue.into_failure() {
        Some(error) => Err(error),
        None if earned.len() < wanted as usize => Err(Error::Stopped),
        None => Ok(Returns::of_episodes(earned.into_iter().map(|(state, earned)| (earned, state)))),
    }
}

impl Evaluation<'_> {
    /// One thread's part.
    fn work(&self) -> Result<()> {
        let mut actor = Actor::new(&self.stage)?;
        while let Some(state) = self.queue.take() {
            let (trajectory, _) = actor.act(self.mix.policy(state), state)?;
            self.rows.fetch_add(trajectory.steps() as u64 + 1, Ordering::Relaxed);
            self.keep(state, recorded_return(state, &trajectory)?);
        }
        Ok(())
    }

    fn keep(&self, state: u32, earned: f64) {
        let mut all = self.earned.lock().unwrap_or_else(PoisonError::into_inner);
        all.insert(state, earned);
        let (episodes, wanted) = (all.len() as u64, u64::from(self.wanted));
        drop(all);
        (self.stage.report)(Progress { preparing: 0, episodes, wanted, rows: self.rows.load(Ordering::Relaxed) });
    }
}

/// The return as a recording has it, whose rewards are single precision, and which holds no other than finite ones.
fn recorded_return(state: u32, trajectory: &StateTrajectory) -> Result<f64> {
    let earned = trajectory.rewards.iter().fold(0.0, |sum, &reward| sum + f64::from(reward as f32));
    if earned.is_finite() {
        return Ok(earned);
    }
    let (fact, expected) = (format!("its return is {earned}"), "a finite number".to_owned());
    Err(vibes_data::Error::Episode { index: state, fact, expected }.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_return_is_the_sum_of_the_rewards_that_are_recorded() {
        let earned = |rewards: &[f64]| {
            recorded_return(3, &StateTrajectory { rewards: rewards.to_vec(), ..StateTrajectory::default() })
        };
        assert_eq!(earned(&[0.1, 0.2]).unwrap(), f64::from(0.1_f32) + f64::from(0.2_f32));
        assert_eq!(earned(&[]).unwrap(), 0.0);
        let refused = earned(&[0.1, f64::NAN]).unwrap_err().to_string();
        assert!(refused.contains("episode 3") && refused.contains("NaN"), "{refused}");
    }
}
