//! One thread's part of a recording: it takes a job, gets the states, draws them, writes the episode.

use std::sync::atomic::Ordering;

use vibes_data::{Episode, EpisodeInfo};

use super::acting::Actor;
use super::{Row, Shared};
use crate::paths::policy_name;
use crate::plan::{PlannedEpisode, state_seed};
use crate::stored::{Acted, rotate};
use crate::studio::Studio;
use crate::{Error, Result};

/// One thread's simulation, policies and render context.
pub(super) struct Worker<'a> {
    shared: &'a Shared<'a>,
    /// Lends its model to the studio.
    actor: Actor<'a>,
    studio: Studio<'a>,
}

impl<'a> Worker<'a> {
    pub(super) fn new(shared: &'a Shared<'a>) -> Result<Self> {
        let actor = Actor::new(&shared.stage)?;
        let studio = Studio::new(&shared.stage.studio, actor.blind.environment())?;
        Ok(Self { shared, actor, studio })
    }

    pub(super) fn work(&mut self) -> Result<()> {
        while let Some((planned, row)) = self.shared.queue.take() {
            if self.shared.writer.has(planned.index) {
                self.shared.writer.add_log(planned.index)?;
                continue;
            }
            let made = match self.shared.stored.episode(planned) {
                Some(stored) => Some(stored),
                None => self.make(planned, &row)?,
            };
            // Without states, another thread failed to make them and has said so.
            let Some((episode, info)) = made else { return Ok(()) };
            let rows = episode.rows() as u64;
            self.shared.writer.write_owned(episode, info)?;
            self.shared.rows.fetch_add(rows, Ordering::Relaxed);
            self.shared.tell();
        }
        Ok(())
    }

    fn make(&mut self, planned: PlannedEpisode, row: &Row) -> Result<Option<(Episode, EpisodeInfo)>> {
        let acted =
            row.0.get_or_init(|| self.states(planned).map_err(|error| self.shared.queue.fail_on(Err(error))).ok());
        let Some(acted) = acted else { return Ok(None) };
        let distractors = match self.shared.stored.distractors(planned)? {
            Some(stored) => stored,
            None => {
                let repeat = self.shared.stage.run.options.action_repeat;
                self.shared.stage.studio.distractor(planned.distractor, acted.trajectory.steps(), repeat)
            }
        };
        let episode = self.studio.draw_episode(planned, acted, &distractors, self.actor.blind.environment_mut())?;
        Ok(Some((episode, acted.info.clone())))
    }

    /// A state trajectory, from where it is stored or simulated, and turned if asked for.
    fn states(&mut self, planned: PlannedEpisode) -> Result<Acted> {
        let mut acted = match self.shared.stored.states(planned)? {
            Some(stored) => stored,
            None => self.simulate(planned.state)?,
        };
        if self.shared.stage.run.turn != 0.0 {
            rotate(&mut acted.trajectory, self.actor.blind.environment_mut(), self.shared.stage.run.turn)?;
            acted.info.model_overrides =
                serde_json::to_value(&acted.trajectory.start.model_overrides).unwrap_or_default();
        }
        Ok(acted)
    }

    fn simulate(&mut self, state: u32) -> Result<Acted> {
        let Some(mix) = &self.shared.mix else {
            let fact = format!("no states of episode {state}");
            return Err(Error::malformed(self.shared.path, fact, "what is drawn again has all its states"));
        };
        let spec = mix.policy(state);
        let (trajectory, acting_distractor) = self.actor.act(spec, state)?;
        let info = EpisodeInfo {
            policy: policy_name(spec, self.shared.path),
            seed: state_seed(self.shared.stage.run.seed, state),
            model_overrides: serde_json::to_value(&trajectory.start.model_overrides).unwrap_or_default(),
        };
        Ok(Acted { trajectory, info, acting_distractor })
    }
}
