//! Is the model fit to be steered by? From a state `(h_t, s_t)` the dynamics are run ahead without a picture, and the rewards they lead to are compared with those that
//! were earned. In: a model, rows, and the tables `s` and `h` of them. Out: R² of the reward 1, 5, 10 and 15 steps ahead, under the recorded actions and under shuffled ones.
//!
//! ```text
//! r̂_t+k = mean of R(ŝ_t+k, a_t+k),   h_t+i+1 = f(h_t+i, ŝ_t+i, a_t+i),   ŝ_t+i+1 = mean of p(· | h_t+i+1)
//! R²(k): of r̂_t+k against the earned r_t+k, over starts t and episodes
//! ```
//!
//! Shuffled actions are a stretch of another episode's (of another state trajectory, on a grid). A model that a policy can learn from predicts well under the
//! recorded actions and clearly worse under the shuffled ones; where the two agree it hardly cares what is done.

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

/// Steps ahead that are judged.
pub const AHEAD: [usize; 4] = [1, 5, 10, 15];
const LONGEST: usize = AHEAD[AHEAD.len() - 1];
/// Rows at the start of an episode that are no starts: the hidden states have not seen enough yet.
const SKIP: usize = 16;
/// Steps that an episode needs to be judged.
pub const LEAST_STEPS: usize = SKIP + LONGEST + 1;
/// Rows between one start and the next.
const STRIDE: usize = 3;
/// Starts run ahead together.
const TOGETHER: usize = 1024;

/// The numbers `open_loop_reward_r2@K` and `open_loop_reward_r2_shuffled@K` of all episodes that are long enough; none if no two trajectories are.
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
    let starts = starts(&episodes, &mut ChaCha8Rng::seed_from_u64(seed));
    if starts.is_empty() {
        return Ok(Numbers::default());
    }
    let scene = Scene { model, world: model.world.valid(), episodes: &episodes, latents, states, device };
    let trajectories = rows.table(latents)?.trajectories();
    let named = [("open_loop_reward_r2", false), ("open_loop_reward_r2_shuffled", true)];
    let numbers = named.into_iter().flat_map(|(name, shuffled)| {
        let predicted = scene.predictions(&starts, shuffled);
        let number = |(&ahead, predicted): (&usize, &Vec<f64>)| Number {
            name: format!("{name}@{ahead}"),
            value: judge(&episodes, &starts, predicted, ahead, &trajectories, seed),
            chance: 0.0,
            past_actions: None,
        };
        AHEAD.iter().zip(&predicted).map(number).collect::<Vec<_>>()
    });
    Ok(numbers.collect())
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

fn starts(episodes: &[Episode<'_>], rng: &mut ChaCha8Rng) -> Vec<Start> {
    let mut starts = Vec::new();
    let long: Vec<usize> = (0..episodes.len()).filter(|&index| episodes[index].steps > LONGEST).collect();
    for (index, episode) in episodes.iter().enumerate() {
        let is_other = |lender: &usize| episodes[*lender].trajectory != episode.trajectory;
        let lenders: Vec<usize> = long.iter().copied().filter(is_other).collect();
        if lenders.is_empty() {
            continue;
        }
        for step in (SKIP..episode.steps.saturating_sub(LONGEST)).step_by(STRIDE) {
            let lender = lenders[rng.random_range(0..lenders.len())];
            let lent_from = rng.random_range(0..episodes[lender].steps - LONGEST);
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
    /// Predicted rewards by step ahead: `[AHEAD][starts]`.
    fn predictions(&self, starts: &[Start], shuffled: bool) -> Vec<Vec<f64>> {
        let mut predicted = vec![Vec::with_capacity(starts.len()); AHEAD.len()];
        for together in starts.chunks(TOGETHER) {
            self.run_ahead(together, shuffled, &mut predicted);
        }
        predicted
    }

    fn run_ahead(&self, starts: &[Start], shuffled: bool, predicted: &mut [Vec<f64>]) {
        let mut latent = self.gather(starts, self.latents);
        let mut state = self.gather(starts, self.states).squeeze_dim::<2>(0);
        for step in 0..=LONGEST {
            let actions = self.actions(starts, shuffled, step);
            if let Some(index) = AHEAD.iter().position(|&ahead| ahead == step) {
                let rewards = to_values(self.world.reward.forward(latent.clone(), actions.clone()).mean);
                predicted[index].extend(rewards.into_iter().map(f64::from));
            }
            if step < LONGEST {
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
