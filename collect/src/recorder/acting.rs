//! One thread's acting: policies, and eyes on simulations of its own.
//!
//! In: a policy and the number of a state trajectory. Out: the trajectory, and the distractor trajectory that the policy saw. Which thread acts never changes a number, so that a
//! recording and an evaluation without one are of the same episodes.

use std::path::Path;
use std::sync::Arc;

use super::{Progress, RecordRun};
use crate::Result;
use crate::plan::{acting_distractor, state_seed};
use crate::played::check_policy;
use crate::studio::StudioSettings;
use vibes_env::render::{RenderSettings, check_drawing};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, EpisodeSeeds, Eyes, Policy, PolicySpec, StateTrajectory, rollout};

/// What all threads share that act.
pub(super) struct Stage<'a> {
    pub(super) run: &'a RecordRun<'a>,
    /// The recording, or where numbers come from that nobody typed.
    pub(super) place: &'a Path,
    pub(super) studio: StudioSettings,
    pub(super) report: &'a (dyn Fn(Progress) + Sync),
}

impl<'a> Stage<'a> {
    /// Opens the background videos, where somebody sees any: the recording, or whoever acts.
    ///
    /// # Errors
    /// [`vibes_env::Error::NoEgl`] on a machine that cannot draw what is asked for, and as [`RecordRun::videos_for`].
    pub(super) fn open(
        (run, place): (&'a RecordRun<'a>, &'a Path),
        environment: &Environment,
        report: &'a (dyn Fn(Progress) + Sync),
    ) -> Result<Self> {
        let seen = run.options.seen();
        if seen.is_some() {
            check_drawing()?;
        }
        let videos = seen.map(|pictures| run.videos_for(pictures, report)).transpose()?;
        let videos = videos.unwrap_or_else(|| Arc::new(VideoLibrary::none()));
        let studio = StudioSettings::new(run.options, run.seed, environment, videos)?;
        Ok(Self { run, place, studio, report })
    }
}

/// One thread's simulations and policies.
pub(super) struct Actor<'a> {
    stage: &'a Stage<'a>,
    /// For policies that need no picture; also lends its model to whoever draws stored states.
    pub(super) blind: Eyes,
    /// For policies that see pictures, by what they see.
    seeing: Vec<Eyes>,
    policies: Vec<(PolicySpec, Box<dyn Policy>)>,
}

impl<'a> Actor<'a> {
    pub(super) fn new(stage: &'a Stage<'a>) -> Result<Self> {
        let blind = Eyes::blind(stage.run.options.environment()?)?;
        Ok(Self { stage, blind, seeing: Vec::new(), policies: Vec::new() })
    }

    /// Acts out a state trajectory; says under which distractor trajectory, of a policy that sees pictures.
    pub(super) fn act(&mut self, spec: &PolicySpec, state: u32) -> Result<(StateTrajectory, Option<u32>)> {
        let run = self.stage.run;
        let policy = self.policy(spec)?;
        let distractor = acting_distractor(state);
        let seeds =
            EpisodeSeeds { state: state_seed(run.seed, state), distractors: self.stage.studio.seeds(distractor) };
        let pictures = self.policies[policy].1.pictures();
        let eyes = match pictures {
            None => &mut self.blind,
            Some(pictures) => {
                let place = self.eyes(pictures)?;
                &mut self.seeing[place]
            }
        };
        let trajectory = rollout(eyes, self.policies[policy].1.as_mut(), run.options.steps, seeds)?;
        Ok((trajectory, pictures.map(|_| distractor)))
    }

    /// The place of a policy among those at hand.
    fn policy(&mut self, spec: &PolicySpec) -> Result<usize> {
        if let Some(place) = self.policies.iter().position(|(made, _)| made == spec) {
            return Ok(place);
        }
        let options = self.stage.run.options;
        if !options.actions.is_empty() {
            check_policy(spec, &options.mix()?, &options.actions, self.stage.place)?;
        }
        let make = self.stage.run.policies.0;
        let policy = make(spec, &options.task, options.environment_options())?;
        self.policies.push((spec.clone(), policy));
        Ok(self.policies.len() - 1)
    }

    /// The place of the eyes that draw such pictures.
    fn eyes(&mut self, pictures: RenderSettings) -> Result<usize> {
        if let Some(place) = self.seeing.iter().position(|eyes| eyes.pictures() == Some(pictures)) {
            return Ok(place);
        }
        let stage = self.stage;
        let options = stage.run.options;
        let recorded = stage.studio.videos();
        let fits = options.distractors.axes.background && recorded.side() == pictures.look.sky_side(pictures.size);
        let videos = if fits { recorded.clone() } else { stage.run.videos_for(pictures, stage.report)? };
        let eyes = Eyes::new(options.environment()?, options.distractors, Some(pictures), videos)?;
        self.seeing.push(eyes);
        Ok(self.seeing.len() - 1)
    }
}
