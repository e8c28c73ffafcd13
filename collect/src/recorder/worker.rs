//! One thread's part of a recording: it takes a job, gets the states, draws them, writes the episode.

use std::sync::atomic::Ordering;

use vibes_data::{Episode, EpisodeInfo};

use super::{Row, Shared, environment_of};
use crate::Result;
use crate::plan::{PlannedEpisode, RecordOptions, state_seed};
use crate::stored::rotate;
use crate::studio::Studio;
use vibes_env::{Environment, EnvironmentOptions, Policy, PolicySpec, StateTrajectory, rollout};

/// One thread's simulation, policies and render context.
pub(super) struct Worker<'a> {
    shared: &'a Shared<'a>,
    environment: Environment,
    policies: Vec<(PolicySpec, Policy)>,
    studio: Studio<'a>,
}

impl<'a> Worker<'a> {
    pub(super) fn new(shared: &'a Shared<'a>) -> Result<Self> {
        let environment = environment_of(shared.run.options)?;
        let studio = Studio::new(&shared.studio, &environment)?;
        Ok(Self { shared, environment, policies: Vec::new(), studio })
    }

    pub(super) fn work(&mut self) -> Result<()> {
        while let Some((planned, row)) = self.shared.next_job() {
            let made = match self.shared.stored.episode(planned) {
                Some(stored) => Some(stored),
                None => self.make(planned, &row)?,
            };
            // Without states, another thread failed to make them and has said so.
            let Some((episode, info)) = made else { return Ok(()) };
            self.shared.writer.write(&episode, info)?;
            self.shared.rows.fetch_add(episode.rows() as u64, Ordering::Relaxed);
            self.shared.tell();
        }
        Ok(())
    }

    fn make(&mut self, planned: PlannedEpisode, row: &Row) -> Result<Option<(Episode, EpisodeInfo)>> {
        let states = row.0.get_or_init(|| self.states(planned).map_err(|error| self.shared.fail_on(Err(error))).ok());
        let Some((states, info)) = states else { return Ok(None) };
        let distractors = match self.shared.stored.distractors(planned)? {
            Some(stored) => stored,
            None => {
                let repeat = self.environment.action_repeat();
                self.shared.studio.distractor(planned.distractor, states.steps(), repeat)
            }
        };
        let episode = self.studio.draw_episode(planned, states, &distractors, &mut self.environment)?;
        Ok(Some((episode, info.clone())))
    }

    /// A state trajectory, from where it is stored or simulated, and turned if asked for.
    fn states(&mut self, planned: PlannedEpisode) -> Result<(StateTrajectory, EpisodeInfo)> {
        let (mut states, mut info) = match self.shared.stored.states(planned)? {
            Some(stored) => stored,
            None => self.simulate(planned.state)?,
        };
        if self.shared.run.turn != 0.0 {
            rotate(&mut states, &mut self.environment, self.shared.run.turn)?;
            info.model_overrides = serde_json::to_value(&states.start.model_overrides).unwrap_or_default();
        }
        Ok((states, info))
    }

    fn simulate(&mut self, state: u32) -> Result<(StateTrajectory, EpisodeInfo)> {
        let run = self.shared.run;
        let spec = self.shared.mix.policy(state);
        let known = self.policies.iter().position(|(made, _)| made == spec);
        let place = match known {
            Some(place) => place,
            None => {
                let RecordOptions { action_repeat, raw_torques, .. } = *run.options;
                let options = EnvironmentOptions { action_repeat: Some(action_repeat), raw_torques };
                self.policies.push((spec.clone(), Policy::new(spec, &run.options.task, options)?));
                self.policies.len() - 1
            }
        };
        let seed = state_seed(run.seed, state);
        let states = rollout(&mut self.environment, &mut self.policies[place].1, run.options.steps, seed)?;
        let model_overrides = serde_json::to_value(&states.start.model_overrides).unwrap_or_default();
        Ok((states, EpisodeInfo { policy: spec.to_string(), seed, model_overrides }))
    }
}
