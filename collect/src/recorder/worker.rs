//! One thread's part of a recording: it takes a job, gets the states, draws them, writes the episode.

use std::sync::atomic::Ordering;

use vibes_data::{Episode, EpisodeInfo};

use super::{Row, Shared};
use crate::paths::policy_name;
use crate::plan::{PlannedEpisode, acting_distractor, state_seed};
use crate::stored::{Acted, rotate};
use crate::studio::Studio;
use crate::{Error, Result};
use vibes_env::render::RenderSettings;
use vibes_env::{EpisodeSeeds, Eyes, Policy, PolicySpec, rollout};

/// One thread's simulation, policies and render context.
pub(super) struct Worker<'a> {
    shared: &'a Shared<'a>,
    /// For policies that need no picture; also lends its model to the studio.
    blind: Eyes,
    /// For policies that see pictures, by what they see.
    seeing: Vec<Eyes>,
    policies: Vec<(PolicySpec, Box<dyn Policy>)>,
    studio: Studio<'a>,
}

impl<'a> Worker<'a> {
    pub(super) fn new(shared: &'a Shared<'a>) -> Result<Self> {
        let blind = Eyes::blind(shared.run.options.environment()?)?;
        let studio = Studio::new(&shared.studio, blind.environment())?;
        Ok(Self { shared, blind, seeing: Vec::new(), policies: Vec::new(), studio })
    }

    pub(super) fn work(&mut self) -> Result<()> {
        while let Some((planned, row)) = self.shared.next_job() {
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
            self.shared.writer.write(&episode, info)?;
            self.shared.rows.fetch_add(episode.rows() as u64, Ordering::Relaxed);
            self.shared.tell();
        }
        Ok(())
    }

    fn make(&mut self, planned: PlannedEpisode, row: &Row) -> Result<Option<(Episode, EpisodeInfo)>> {
        let acted = row.0.get_or_init(|| self.states(planned).map_err(|error| self.shared.fail_on(Err(error))).ok());
        let Some(acted) = acted else { return Ok(None) };
        let distractors = match self.shared.stored.distractors(planned)? {
            Some(stored) => stored,
            None => {
                let repeat = self.shared.run.options.action_repeat;
                self.shared.studio.distractor(planned.distractor, acted.trajectory.steps(), repeat)
            }
        };
        let episode = self.studio.draw_episode(planned, acted, &distractors, self.blind.environment_mut())?;
        Ok(Some((episode, acted.info.clone())))
    }

    /// A state trajectory, from where it is stored or simulated, and turned if asked for.
    fn states(&mut self, planned: PlannedEpisode) -> Result<Acted> {
        let mut acted = match self.shared.stored.states(planned)? {
            Some(stored) => stored,
            None => self.simulate(planned.state)?,
        };
        if self.shared.run.turn != 0.0 {
            rotate(&mut acted.trajectory, self.blind.environment_mut(), self.shared.run.turn)?;
            acted.info.model_overrides =
                serde_json::to_value(&acted.trajectory.start.model_overrides).unwrap_or_default();
        }
        Ok(acted)
    }

    fn simulate(&mut self, state: u32) -> Result<Acted> {
        let run = self.shared.run;
        let Some(mix) = &self.shared.mix else {
            let fact = format!("no states of episode {state}");
            return Err(Error::malformed(self.shared.path, fact, "what is drawn again has all its states"));
        };
        let spec = mix.policy(state);
        let policy = self.policy(spec)?;
        let distractor = acting_distractor(state);
        let seed = state_seed(run.seed, state);
        let seeds = EpisodeSeeds { state: seed, distractors: self.shared.studio.seeds(distractor) };
        let pictures = self.policies[policy].1.pictures();
        let eyes = match pictures {
            None => &mut self.blind,
            Some(pictures) => {
                let place = self.eyes(pictures)?;
                &mut self.seeing[place]
            }
        };
        let trajectory = rollout(eyes, self.policies[policy].1.as_mut(), run.options.steps, seeds)?;
        let model_overrides = serde_json::to_value(&trajectory.start.model_overrides).unwrap_or_default();
        let info = EpisodeInfo { policy: policy_name(spec, self.shared.path), seed, model_overrides };
        Ok(Acted { trajectory, info, acting_distractor: pictures.map(|_| distractor) })
    }

    /// The place of a policy among those at hand.
    fn policy(&mut self, spec: &PolicySpec) -> Result<usize> {
        if let Some(place) = self.policies.iter().position(|(made, _)| made == spec) {
            return Ok(place);
        }
        let options = self.shared.run.options;
        let make = self.shared.run.policies.0;
        let policy = make(spec, &options.task, options.environment_options())?;
        self.policies.push((spec.clone(), policy));
        Ok(self.policies.len() - 1)
    }

    /// The place of the eyes that draw such pictures.
    fn eyes(&mut self, pictures: RenderSettings) -> Result<usize> {
        if let Some(place) = self.seeing.iter().position(|eyes| eyes.pictures() == Some(pictures)) {
            return Ok(place);
        }
        let options = self.shared.run.options;
        let shared = self.shared;
        let recorded = shared.studio.videos();
        let fits = options.distractors.axes.background && recorded.side() == pictures.look.sky_side(pictures.size);
        let videos = if fits { recorded.clone() } else { shared.run.videos_for(pictures, shared.report)? };
        let eyes = Eyes::new(options.environment()?, options.distractors, Some(pictures), videos)?;
        self.seeing.push(eyes);
        Ok(self.seeing.len() - 1)
    }
}
