//! What online training can be asked for, beside the model's own options: the world, how much is learned from every step of it, when it is evaluated. Saved as
//! `online.json` in the run folder.

use std::path::Path;

use serde::{Deserialize, Serialize};
pub use vibes_data::GivenFrom;
use vibes_data::write_atomically;
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::Look;
use vibes_env::videos::{VideoSource, davis};

pub(super) use self::typed::{difference, flag};
use super::protocol::Protocol;
use crate::error::{Result, TrainError, io, malformed};
use crate::json::is_zero;
use crate::learners::behaviour::BehaviourOptions;

mod typed;
mod work;

/// Most rows that may be replayed for every agent step: far more than anybody has time for, and few enough to count.
const MOST_ROWS_PER_STEP: f64 = 1e6;

/// The world that is acted in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorldOptions {
    /// The task's name.
    pub task: String,
    /// Control steps an action is held.
    pub action_repeat: u32,
    /// Agent steps of an episode.
    pub steps: u32,
    /// Which distractors, how strong, and whether they move.
    pub distractors: DistractorSettings,
    /// Where background videos come from.
    pub videos: VideoSource,
    /// How many videos of a set; the suite's number for the difficulty when none is given.
    pub video_count: Option<usize>,
    /// Side of the pictures; none for a policy of vector observations.
    pub size: Option<u32>,
    /// How pictures are drawn.
    pub look: Look,
}

/// The resolved options of online training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OnlineOptions {
    /// The protocol whose settings these are, if one was asked for.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub protocol: Option<Protocol>,
    /// The world.
    pub world: WorldOptions,
    /// Actor and critic.
    pub behaviour: BehaviourOptions,
    /// Control steps to live through in all, action repeats counted.
    pub control_steps: u64,
    /// Rows that go through the world model's update for every agent step: the one number that sets the work.
    pub rows_per_step: f64,
    /// Random episodes before anything is learned.
    pub prefill: u32,
    /// Share of every batch that comes from the recordings the run was given.
    pub given_share: f64,
    /// Updates before the first episode with the actor (after the random ones): they see only what is there.
    pub first_updates: u64,
    /// Of all updates, the first so many in which the critic learns and the actor does not move.
    pub critic_first: u64,
    /// Horizon of the first updates; 0 for the recipe's from the start.
    pub short_horizon: usize,
    /// Updates with that horizon.
    pub short_for: u64,
    /// Control steps, rising, after each of which world model, actor and critic begin anew on all that has been lived through.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub reset_at: Vec<u64>,
    /// Updates from then on before the next episode.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub reset_updates: u64,
    /// Standard deviation of noise on the executed actions, in units of −1..1.
    pub exploration: f64,
    /// Control steps between evaluations; 0 for none.
    pub evaluate_every: u64,
    /// Episodes of an evaluation, on held-out and on training videos each.
    pub evaluation_episodes: u32,
    /// Episodes of the last evaluation.
    pub final_episodes: u32,
    /// Whether the actor's mode is evaluated rather than a sample.
    pub evaluate_mode: bool,
    /// The held-out videos of a folder, as they were when the run began: its returns are of these to the end. None of built-in videos, which do not change.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub held_out_videos: Option<Vec<String>>,
    /// Control steps that the run began with and did not live through itself: of the recordings that the runs before it learned from. Counted when it was begun, since
    /// recordings are taken away; none where there are none, or it is not known.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub given_control_steps: Option<u64>,
    /// What that number rests on; none of a run from nothing, and of one that was begun before this was kept.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub given_from: Option<GivenFrom>,
    /// Held-out videos that the run began with recordings of: its returns under held-out videos are then not of new ones.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub held_out_seen: Vec<String>,
}

impl OnlineOptions {
    /// Updates before the first episode with an actor that has been begun anew, unless another number is asked for: so many that VIBES holds the task of a hundred episodes of
    /// cartpole-swingup (`docs/online.md`).
    pub const DEFAULT_RESET_UPDATES: u64 = 4000;

    /// Reads a run's options; none if it is no online run.
    ///
    /// # Errors
    /// The file is damaged.
    pub fn read(run: &Path) -> Result<Option<Self>> {
        let file = run.join("online.json");
        let text = match std::fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(io("read", &file)(error)),
        };
        let options: Self = serde_json::from_str(&text)
            .map_err(|error| malformed(&file, error, "an online.json as `vibes-train online` writes it"))?;
        Ok(Some(Self { world: options.world.found(run), ..options }))
    }

    /// That a run that may be there was begun with the same; only how long to go on may change.
    ///
    /// # Errors
    /// The run was begun with others.
    pub fn check_found(&self, run: &Path) -> Result<()> {
        let Some(found) = Self::read(run)? else { return Ok(()) };
        if let Some((key, found, asked)) = found.stored(run).first_difference(&self.stored(run)) {
            return Err(TrainError::OtherRun { key: flag(&key), found, asked, path: run.to_owned() });
        }
        self.check_held_out(&found, run)
    }

    /// That the folder of videos still holds out what it did when the run began, where the run says it.
    ///
    /// # Errors
    /// It holds out others, by which returns could not be compared with those before.
    pub fn check_held_out(&self, found: &Self, run: &Path) -> Result<()> {
        match (&found.held_out_videos, self.world.held_out_videos()) {
            (Some(before), Some(now)) if *before != now => {
                let key = "held-out videos of the folder".to_owned();
                Err(TrainError::OtherRun { key, found: before.join(", "), asked: now.join(", "), path: run.to_owned() })
            }
            _ => Ok(()),
        }
    }

    /// Writes them, or checks that a run that is there was begun with the same.
    ///
    /// # Errors
    /// As [`Self::check_found`], or the file cannot be written.
    pub fn keep(&self, run: &Path) -> Result<()> {
        self.check_found(run)?;
        let file = run.join("online.json");
        let text = serde_json::to_string_pretty(&self.stored(run))
            .map_err(|error| malformed(&file, error, "options that JSON can hold"))?;
        Ok(write_atomically(&file, (text + "\n").as_bytes())?)
    }

    /// The same for a file of the run.
    pub(super) fn stored(&self, run: &Path) -> Self {
        let held_out_videos = self.world.held_out_videos();
        Self { world: self.world.stored(run), held_out_videos, ..self.clone() }
    }

    /// At which control steps the next evaluation is due, seen from so many.
    pub fn next_evaluation(&self, control_steps: u64) -> u64 {
        match self.evaluate_every {
            0 => u64::MAX,
            every => (control_steps / every + 1) * every,
        }
    }

    /// Whether an evaluation on the way is due after so many control steps, of which the next was to come at `next`.
    pub fn is_evaluation_due(&self, next: u64, control_steps: u64) -> bool {
        self.evaluate_every > 0 && control_steps >= next
    }

    /// Actor and critic after so many updates of them: with the short first horizon, if there is one and it is not over.
    pub fn behaviour_at(&self, updates: u64) -> BehaviourOptions {
        let is_short = self.short_horizon > 0 && updates < self.short_for;
        let horizon = if is_short { self.short_horizon.min(self.behaviour.horizon) } else { self.behaviour.horizon };
        BehaviourOptions { horizon, ..self.behaviour.clone() }
    }

    /// That the values make sense.
    ///
    /// # Errors
    /// One does not; the message names it.
    pub fn check(&self) -> Result<()> {
        self.behaviour.check()?;
        let wrong = |text: String| Err(TrainError::Options(text));
        if !(self.rows_per_step.is_finite() && self.rows_per_step > 0.0) {
            return wrong(format!("--rows-per-step is {}; it must be above 0", self.rows_per_step));
        }
        if self.rows_per_step > MOST_ROWS_PER_STEP {
            let most = MOST_ROWS_PER_STEP;
            return wrong(format!("--rows-per-step is {}; it must be at most {most}", self.rows_per_step));
        }
        if !(0.0..=1.0).contains(&self.given_share) {
            return wrong(format!("--given-share is {}; it must lie between 0 and 1", self.given_share));
        }
        if !(self.exploration.is_finite() && self.exploration >= 0.0) {
            return wrong(format!("--exploration is {}; it must be 0 or more", self.exploration));
        }
        if self.reset_at.first() == Some(&0) || self.reset_at.windows(2).any(|pair| pair[0] >= pair[1]) {
            let asked = self.reset_at.iter().map(u64::to_string).collect::<Vec<_>>().join(",");
            return wrong(format!("--reset-at is {asked}; these control steps must be above 0 and rise"));
        }
        if self.short_horizon > 0 && self.short_horizon >= self.behaviour.horizon {
            let (short, horizon) = (self.short_horizon, self.behaviour.horizon);
            return wrong(format!("--short-horizon is {short}; it must be below the horizon of {horizon}"));
        }
        self.world.check_videos()?;
        match self.protocol {
            Some(protocol) => self.is_under(protocol),
            None => Ok(()),
        }
    }

    /// Puts a protocol's settings in.
    pub fn settle(&mut self, protocol: Protocol) {
        self.protocol = Some(protocol);
        self.world.video_count = None;
        if let Some(settings) = protocol.settings(&self.world.task) {
            self.control_steps = settings.control_steps;
            self.final_episodes = settings.final_episodes;
            self.world.distractors = settings.distractors;
            self.world.action_repeat = settings.action_repeat;
            self.world.steps = vibes_env::EPISODE_CONTROL_STEPS.div_ceil(settings.action_repeat);
        }
    }

    /// That every setting is the protocol's; the message names the first that is not.
    fn is_under(&self, protocol: Protocol) -> Result<()> {
        let world = &self.world;
        let refuse = |setting: &str, found: String, wanted: String| {
            Err(TrainError::Options(format!(
                "{protocol} has {setting} {wanted}, not {found}; leave out --protocol for other settings"
            )))
        };
        let Some(settings) = protocol.settings(&world.task) else {
            return refuse("the tasks", world.task.clone(), protocol.tasks().collect::<Vec<_>>().join(", "));
        };
        let numbers = [
            ("the action repeat", u64::from(world.action_repeat), u64::from(settings.action_repeat)),
            ("control steps", self.control_steps, settings.control_steps),
            ("final episodes", u64::from(self.final_episodes), u64::from(settings.final_episodes)),
        ];
        if let Some((setting, found, wanted)) = numbers.into_iter().find(|(_, found, wanted)| found != wanted) {
            return refuse(setting, found.to_string(), wanted.to_string());
        }
        if world.distractors != settings.distractors || world.video_count.is_some() {
            let wanted = "all three axes, easy and dynamic, four videos";
            return refuse("the distractors", "others".to_owned(), wanted.to_owned());
        }
        let count = settings.distractors.difficulty.videos();
        if world.videos != VideoSource::Procedural && !world.videos.is_davis(count.unwrap_or(davis::VAL.len())) {
            let wanted = "of DAVIS 2017, whole and the first of both of its lists, or the built-in ones";
            return refuse("videos", "of another folder".to_owned(), wanted.to_owned());
        }
        if world.size.is_none() {
            return refuse("observations", "vectors".to_owned(), "pictures".to_owned());
        }
        let (steps, whole) = (world.steps, vibes_env::EPISODE_CONTROL_STEPS.div_ceil(world.action_repeat));
        if steps != whole {
            return refuse("agent steps of an episode", steps.to_string(), whole.to_string());
        }
        if !self.evaluate_mode {
            return refuse("evaluations", "of samples".to_owned(), "of the actor's mode".to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
