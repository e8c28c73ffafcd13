//! One environment of a world: which episode it plays, how far it has come, and the recording that keeps it.

use std::sync::Arc;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::{Cell, EpisodeBuilder, EpisodeInfo};
use vibes_env::videos::VideoLibrary;
use vibes_env::{EpisodeSeeds, Eyes, Start, state_seed};

use super::options::WorldOptions;
use super::rows::Place;
use crate::keeper::Keeper;

/// What is wrong with a step before the first reset, or after an error.
const NOT_BEGUN: &str = "no episode is being played; call reset first";

/// Which episode of which recording: that of state trajectory `state` under distractor trajectory `distractor` in a recording of this seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EpisodeKey {
    pub seed: u64,
    pub state: u32,
    pub distractor: u32,
}

/// An environment and its episode.
#[derive(Debug)]
pub(super) struct Slot {
    eyes: Eyes,
    options: WorldOptions,
    /// The episode that is being played; none before the first, and after an error.
    playing: Option<Playing>,
    steps: u32,
    keeper: Option<Keeper>,
}

#[derive(Debug)]
struct Playing {
    key: EpisodeKey,
    step: u32,
    start: Start,
    /// The rows so far, when they are kept.
    kept: Option<EpisodeBuilder>,
}

impl Slot {
    pub(super) fn open(options: &WorldOptions, videos: &Arc<VideoLibrary>) -> vibes_env::Result<Self> {
        let environment = options.environment()?;
        let steps = environment.episode_steps();
        let eyes = Eyes::new(environment, options.distractors, options.pictures(), videos.clone())?;
        Ok(Self { eyes, options: options.clone(), playing: None, steps, keeper: None })
    }

    /// Whether this episode may begin; nothing has changed where it may not.
    pub(super) fn can_begin(&self, key: EpisodeKey) -> Result<(), String> {
        self.place(key).map(drop)
    }

    /// The number and cell of this episode in the recording that keeps it; none where none does.
    fn place(&self, key: EpisodeKey) -> Result<Option<(u32, Option<Cell>)>, String> {
        self.keeper.as_ref().map(|keeper| may_keep(keeper, key)).transpose()
    }

    /// Begins an episode; one that is not over is dropped.
    pub(super) fn begin(&mut self, key: EpisodeKey) -> Result<(), String> {
        let place = self.place(key)?;
        self.playing = None;
        let seeds: EpisodeSeeds = self.options.seeds(key.seed, key.state, key.distractor);
        let [mut rng, _] = seeds.generators();
        let start = self.eyes.reset(&mut rng, seeds.distractors).map_err(|error| error.to_string())?;
        let mut playing = Playing { key, step: 0, start, kept: None };
        if let (Some(keeper), Some((index, cell))) = (&self.keeper, place) {
            let first = self.eyes.frame().map_err(|error| error.to_string())?;
            let acting = keeper.acts_by_pictures.then_some(key.state);
            playing.kept = Some(EpisodeBuilder::first(index, cell, first).acting_under(acting));
        }
        self.playing = Some(playing);
        Ok(())
    }

    /// Whether this action may be taken now; nothing has changed where it may not.
    pub(super) fn can_step(&self, action: &[f32]) -> Result<(), String> {
        let playing = self.playing.as_ref().ok_or(NOT_BEGUN)?;
        if playing.step >= self.steps {
            return Err("the episode is over; call reset".to_owned());
        }
        match action.iter().position(|number| !number.is_finite()) {
            None => Ok(()),
            Some(at) => Err(format!("action[{at}] is {}; actions are finite numbers", action[at])),
        }
    }

    /// One agent step; returns its reward. After an error a new episode has to begin, unless the action may not be taken.
    pub(super) fn step(&mut self, action: &[f32]) -> Result<f64, String> {
        self.can_step(action)?;
        let mut playing = self.playing.take().ok_or(NOT_BEGUN)?;
        let asked: Vec<f64> = action.iter().map(|&number| f64::from(number)).collect();
        let executed = self.eyes.environment().executable(&asked);
        let reward = self.eyes.step(&executed).map_err(|error| error.to_string())?;
        playing.step += 1;
        if let Some(kept) = &mut playing.kept {
            let next = self.eyes.frame().map_err(|error| error.to_string())?;
            let action: Vec<f32> = executed.iter().map(|&number| number as f32).collect();
            kept.step(&action, reward as f32, 1.0, next);
        }
        if playing.step == self.steps {
            self.file(&mut playing)?;
        }
        self.playing = Some(playing);
        Ok(reward)
    }

    /// Writes a finished episode, if it was kept.
    fn file(&self, playing: &mut Playing) -> Result<(), String> {
        let (Some(kept), Some(keeper)) = (playing.kept.take(), &self.keeper) else { return Ok(()) };
        let overrides = serde_json::to_value(&playing.start.model_overrides).map_err(|error| error.to_string())?;
        let info = EpisodeInfo {
            policy: "python".to_owned(),
            seed: state_seed(playing.key.seed, playing.key.state),
            model_overrides: overrides,
        };
        // The suite's tasks stop, but never end in a terminal state.
        keeper.writer.write(&kept.finish(false), info).map_err(|error| error.to_string())
    }

    /// Writes the present row, with its picture if there is room for one.
    pub(super) fn show(&mut self, reward: f64, place: Place<'_>) -> Result<(), String> {
        if !place.pixels.is_empty() {
            place.pixels.copy_from_slice(self.eyes.picture().map_err(|error| error.to_string())?);
        }
        for (shown, &number) in place.observation.iter_mut().zip(self.eyes.observation()) {
            *shown = number as f32;
        }
        *place.reward = reward;
        *place.is_last = self.playing.as_ref().is_some_and(|playing| playing.step >= self.steps);
        Ok(())
    }

    /// Puts the episodes that begin from now on into a recording, or into none.
    pub(super) fn keep(&mut self, keeper: Option<Keeper>) {
        self.keeper = keeper;
    }

    /// Random actions, episode after episode.
    pub(super) fn roll(&mut self, steps: u32, draw: bool) -> Result<(), String> {
        let spec = self.eyes.environment().action_spec();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut episode = 0;
        for _ in 0..steps {
            if self.playing.as_ref().is_none_or(|playing| playing.step >= self.steps) {
                self.begin(EpisodeKey { seed: 0, state: episode, distractor: episode })?;
                episode += 1;
            }
            let draws = spec.min.iter().zip(&spec.max).map(|(&low, &high)| rng.random_range(low..=high) as f32);
            let action: Vec<f32> = draws.collect();
            self.step(&action)?;
            if draw {
                self.eyes.picture().map_err(|error| error.to_string())?;
            }
        }
        Ok(())
    }
}

/// The number and cell under which the recording keeps an episode. Its episodes are told apart by their numbers under the recording's seed.
fn may_keep(keeper: &Keeper, key: EpisodeKey) -> Result<(u32, Option<Cell>), String> {
    let EpisodeKey { seed, state, distractor } = key;
    if seed != keeper.seed {
        return Err(format!("an episode of seed {seed}; this recording keeps those of seed {}", keeper.seed));
    }
    let (index, cell) = keeper.place(state, distractor)?;
    if keeper.writer.has(index) {
        return Err(match cell {
            Some(_) => {
                format!("state {state} under distractor {distractor} is in the recording already; begin another cell")
            }
            None => format!(
                "episode {index} is in the recording already; begin another (env.world.seek(writer.next_episode()) goes to \
                 the first that is not there)"
            ),
        });
    }
    Ok((index, cell))
}
