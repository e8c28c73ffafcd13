//! Is the model fit to be steered by? From a state `(h_t, s_t)` the dynamics are run ahead without a picture, and the rewards they lead to are compared with those that
//! were earned. In: a model, rows, and the tables `s` and `h` of them. Out: R² of the reward 1, 5, 10 and 15 steps ahead, under the recorded actions, under shuffled ones,
//! and of the reward that is earned now.
//!
//! ```text
//! r̂_t+k = mean of R(ŝ_t+k, a_t+k),   h_t+i+1 = f(h_t+i, ŝ_t+i, a_t+i),   ŝ_t+i+1 = mean of p(· | h_t+i+1)
//! R²(k): of r̂_t+k against the earned r_t+k, over starts t and episodes
//! ```
//!
//! Shuffled actions are a stretch of another episode's (of another state trajectory, on a grid). A model that a policy can learn from predicts well under the
//! recorded actions and clearly worse under the shuffled ones; where the two agree it hardly cares what is done. The third prediction is *persistence*: the reward of the
//! start, as though nothing changed. Where rewards change slowly it is high, and only a model above it knows more than where it is.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_data::EpisodeView;
use vibes_measure::intervals::{Interval, Trajectories};
use vibes_measure::numbers::{Number, Numbers};
use vibes_measure::r_squared::{Squares, r_squared};
use vibes_model::parameters::to_values;
use vibes_model::{Model, World, scale};

use super::{Features, Rows};
use crate::error::Result;

/// Steps ahead that are judged, in episodes that are long enough.
pub const AHEAD: [usize; 4] = [1, 5, 10, 15];
/// Rows at the start of an episode that are no starts, at most: the hidden states have not seen enough yet. Of short episodes it is their first quarter.
const SKIP: usize = 16;
/// Rows between one start and the next.
const STRIDE: usize = 3;
/// Starts run ahead together.
const TOGETHER: usize = 1024;

/// The numbers `open_loop_reward_r2@K`, `open_loop_reward_r2_shuffled@K` and `open_loop_reward_r2_persistence@K` of all episodes that are long enough, for the `K` that the
/// longest has; none if no two trajectories have a start.
/// `latents` and `states` are the tables `s` and `h` of these rows.
///
/// # Errors
/// Tables of other rows.
pub fn open_loop(
    model: &Model,
    rows: &Rows,
    (latents, states): (&Features, &Features),
    seed: u64,
    device: &Device,
) -> Result<Numbers> {
    let episodes = episodes(rows, model);
    let reach = Reach::of(episodes.iter().map(|episode| episode.steps).max().unwrap_or(0));
    let starts = starts(&episodes, &reach, &mut ChaCha8Rng::seed_from_u64(seed));
    if starts.is_empty() {
        return Ok(Numbers::default());
    }
    let scene = Scene { model, world: model.world.valid(), episodes: &episodes, latents, states, device };
    let trajectories = rows.table(latents)?.trajectories();
    let named = [
        ("open_loop_reward_r2", scene.predictions(&starts, &reach, false)),
        ("open_loop_reward_r2_shuffled", scene.predictions(&starts, &reach, true)),
        ("open_loop_reward_r2_persistence", vec![persistence(&episodes, &starts); reach.ahead.len()]),
    ];
    let numbers = named.iter().flat_map(|(name, predictions)| {
        let number = |(&ahead, predicted): (&usize, &Vec<f64>)| Number {
            name: format!("{name}@{ahead}"),
            value: judge(&episodes, &starts, predicted, ahead, &trajectories, seed),
            chance: 0.0,
            past_actions: None,
        };
        reach.ahead.iter().zip(predictions).map(number).collect::<Vec<_>>()
    });
    Ok(numbers.collect())
}

/// From where in an episode it is run ahead, and how far.
struct Reach {
    skip: usize,
    ahead: &'static [usize],
}

impl Reach {
    /// What episodes of so many steps have room for.
    fn of(steps: usize) -> Self {
        let skip = SKIP.min(steps / 4);
        let fitting = AHEAD.iter().filter(|&&ahead| skip + ahead < steps).count();
        Self { skip, ahead: &AHEAD[..fitting] }
    }

    /// Steps of the longest run ahead.
    fn longest(&self) -> Option<usize> {
        self.ahead.last().copied()
    }
}

/// What is needed of an episode beside its rows in the tables.
struct Episode<'a> {
    view: &'a EpisodeView,
    /// Its first row in the tables.
    first: usize,
    /// Rows that have an action.
    steps: usize,
    /// Episodes of one state trajectory share their actions, so they lend each other none.
    trajectory: (u8, u32),
    /// Scaled to −1..1: `[steps, A]`
    actions: Vec<f32>,
}

fn episodes<'a>(rows: &'a Rows, model: &Model) -> Vec<Episode<'a>> {
    let mut first = 0;
    let of = |(index, view): (usize, &'a EpisodeView)| {
        let steps = view.steps();
        let mut actions = view.actions();
        scale::actions(&mut actions, &model.config.action_min, &model.config.action_max);
        let trajectory = view.cell().map_or((1, index as u32), |cell| (0, cell.state));
        let episode = Episode { view, first, steps, trajectory, actions };
        first += view.rows();
        episode
    };
    rows.views().iter().enumerate().map(of).collect()
}

/// Where to run ahead from, and whose actions are borrowed.
struct Start {
    episode: usize,
    step: usize,
    lender: usize,
    lent_from: usize,
}

fn starts(episodes: &[Episode<'_>], reach: &Reach, rng: &mut ChaCha8Rng) -> Vec<Start> {
    let mut starts = Vec::new();
    let Some(longest) = reach.longest() else { return starts };
    let long: Vec<usize> = (0..episodes.len()).filter(|&index| episodes[index].steps > longest).collect();
    for (index, episode) in episodes.iter().enumerate() {
        let is_other = |lender: &usize| episodes[*lender].trajectory != episode.trajectory;
        let lenders: Vec<usize> = long.iter().copied().filter(is_other).collect();
        if lenders.is_empty() {
            continue;
        }
        for step in (reach.skip..episode.steps.saturating_sub(longest)).step_by(STRIDE) {
            let lender = lenders[rng.random_range(0..lenders.len())];
            let lent_from = rng.random_range(0..episodes[lender].steps - longest);
            starts.push(Start { episode: index, step, lender, lent_from });
        }
    }
    starts
}

struct Scene<'a> {
    model: &'a Model,
    world: World,
    episodes: &'a [Episode<'a>],
    latents: &'a Features,
    states: &'a Features,
    device: &'a Device,
}

impl Scene<'_> {
    /// Predicted rewards by step ahead: `[ahead][starts]`.
    fn predictions(&self, starts: &[Start], reach: &Reach, shuffled: bool) -> Vec<Vec<f64>> {
        let mut predicted = vec![Vec::with_capacity(starts.len()); reach.ahead.len()];
        for together in starts.chunks(TOGETHER) {
            self.run_ahead(together, reach, shuffled, &mut predicted);
        }
        predicted
    }

    fn run_ahead(&self, starts: &[Start], reach: &Reach, shuffled: bool, predicted: &mut [Vec<f64>]) {
        let mut latent = self.gather(starts, self.latents);
        let mut state = self.gather(starts, self.states).squeeze_dim::<2>(0);
        let longest = reach.longest().unwrap_or(0);
        for step in 0..=longest {
            let actions = self.actions(starts, shuffled, step);
            if let Some(index) = reach.ahead.iter().position(|&ahead| ahead == step) {
                let rewards = to_values(self.world.reward.forward(latent.clone(), actions.clone()).mean);
                predicted[index].extend(rewards.into_iter().map(f64::from));
            }
            if step < longest {
                let (next, states) = self.world.dynamics.forward(latent, actions, Some(state));
                (latent, state) = (next.mean, states.squeeze_dim::<2>(0));
            }
        }
    }

    /// The starts' rows of a table: `[1, starts, dims]`.
    fn gather(&self, starts: &[Start], table: &Features) -> Tensor<3> {
        let row = |start: &Start| {
            let row = self.episodes[start.episode].first + start.step;
            &table.values[row * table.dims..(row + 1) * table.dims]
        };
        self.tensor(starts.iter().flat_map(row).copied().collect(), starts.len(), table.dims)
    }

    /// The actions `step` steps after the starts: `[1, starts, A]`.
    fn actions(&self, starts: &[Start], shuffled: bool, step: usize) -> Tensor<3> {
        let width = self.model.config.actions();
        let action = |start: &Start| {
            let (episode, from) = if shuffled { (start.lender, start.lent_from) } else { (start.episode, start.step) };
            &self.episodes[episode].actions[(from + step) * width..(from + step + 1) * width]
        };
        self.tensor(starts.iter().flat_map(action).copied().collect(), starts.len(), width)
    }

    fn tensor(&self, values: Vec<f32>, rows: usize, width: usize) -> Tensor<3> {
        Tensor::from_data(TensorData::new(values, [1, rows, width]), &self.device.clone().inner())
    }
}

/// The rewards of the starts' own actions, as though nothing changed.
fn persistence(episodes: &[Episode<'_>], starts: &[Start]) -> Vec<f64> {
    starts.iter().map(|start| f64::from(episodes[start.episode].view.reward(start.step))).collect()
}

fn judge(
    episodes: &[Episode<'_>],
    starts: &[Start],
    predicted: &[f64],
    ahead: usize,
    trajectories: &Trajectories,
    seed: u64,
) -> Interval {
    let mut squares = vec![Squares::default(); trajectories.units()];
    for (start, &predicted) in starts.iter().zip(predicted) {
        let episode = &episodes[start.episode];
        let earned = f64::from(episode.view.reward(start.step + ahead));
        squares[trajectories.unit(episode.first + start.step)].add(earned, predicted);
    }
    trajectories.bootstrap(&mut ChaCha8Rng::seed_from_u64(seed), |weights| r_squared(&squares, weights))
}
