//! Is the model fit to be steered by? From a state (h_t, s_t) the dynamics are run ahead without a picture, and the rewards they lead to are compared with those that
//! were earned. In: a model and recorded episodes. Out: R² of the reward 1, 5, 10 and 15 steps ahead, under the recorded actions and under shuffled ones.
//!
//! ```text
//! r̂_t+k = mean of R(ŝ_t+k, a_t+k),   h_t+i+1 = f(h_t+i, ŝ_t+i, a_t+i),   ŝ_t+i+1 = mean of p(· | h_t+i+1)
//! R²(k) = 1 − Σ (r_t+k − r̂_t+k)² / Σ (r_t+k − mean r)²,   over starts t and episodes
//! ```
//!
//! Shuffled actions are a stretch of another episode's (of another state trajectory, on a grid). A model that a policy can learn from predicts well under the
//! recorded actions and clearly worse under the shuffled ones; where the two agree it hardly cares what is done.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::EpisodeView;
use vibes_model::encode::EpisodeEncoder;
use vibes_model::parameters::to_values;
use vibes_model::{Model, World, scale};

use crate::encode::encode_rows;
use crate::error::Result;

/// Steps ahead that are judged.
pub const AHEAD: [usize; 4] = [1, 5, 10, 15];
/// Rows at the start of an episode that are no starts: the hidden states have not seen enough yet.
const SKIP: usize = 16;
/// Rows between one start and the next.
const STRIDE: usize = 3;
/// Starts run ahead together.
const TOGETHER: usize = 1024;
/// Rows encoded at a time.
const CHUNK: usize = 128;
/// Seed of the shuffled actions.
const SEED: u64 = 0;

/// R² of the reward some steps ahead, with the ends of a 95% interval over trajectories.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OpenLoop {
    /// Steps ahead.
    pub steps: usize,
    /// Under the recorded actions.
    pub recorded: vibes_measure::intervals::Interval,
    /// Under a stretch of another episode's.
    pub shuffled: vibes_measure::intervals::Interval,
}

/// An episode as the model follows it; rows that have an action, from the first.
#[derive(Debug, Clone)]
pub struct Followed {
    /// What is drawn again for intervals and never lends its actions to itself: the state trajectory on a grid, the episode elsewhere.
    pub trajectory: u32,
    /// Rows.
    pub rows: usize,
    /// Posterior means: `[rows, latent]`
    pub latents: Vec<f32>,
    /// Hidden states before each row's action is consumed, zeros at the first: `[rows, hidden]`
    pub states: Vec<f32>,
    /// Scaled to −1..1: `[rows, A]`
    pub actions: Vec<f32>,
    /// `[rows]`
    pub rewards: Vec<f32>,
}

/// Follows an episode from its start: what the policy would see at every row.
///
/// # Errors
/// The episode's observations are not the model's.
pub fn follow(model: &Model, episode: &EpisodeView, trajectory: u32, device: &Device) -> Result<Followed> {
    let (rows, config) = (episode.steps(), &model.config);
    let world = model.world.valid();
    let mut encoder = EpisodeEncoder::new(model, device);
    let mut latents = Vec::with_capacity(rows * config.latent);
    for start in (0..rows).step_by(CHUNK) {
        latents.extend(encode_rows(model, &mut encoder, episode, start..rows.min(start + CHUNK))?);
    }
    let mut actions: Vec<f32> = (0..rows).flat_map(|row| episode.action(row)).copied().collect();
    scale::actions(&mut actions, &config.action_min, &config.action_max);
    let device = device.clone().inner();
    let tensor = |values: &[f32], width| {
        Tensor::<3>::from_data(TensorData::new(values.to_vec(), [rows, 1, width]), &device)
    };
    let inputs = Tensor::cat(vec![tensor(&latents, config.latent), tensor(&actions, config.actions())], 2);
    let after = to_values(world.dynamics.gru.forward(inputs, None));
    let mut states = vec![0.0; config.hidden];
    states.extend_from_slice(&after[..after.len() - config.hidden]);
    let rewards = (0..rows).map(|row| episode.reward(row)).collect();
    Ok(Followed { trajectory, rows, latents, states, actions, rewards })
}

/// R² at every step of [`AHEAD`] that the episodes are long enough for.
///
/// # Errors
/// None of its own.
pub fn open_loop(model: &Model, episodes: &[Followed], device: &Device) -> Result<Vec<OpenLoop>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let starts = starts(episodes, &mut rng);
    let world = model.world.valid();
    let run = |shuffled: bool| errors(model, &world, episodes, &starts, shuffled, device);
    let (recorded, shuffled) = (run(false), run(true));
    let groups = groups(episodes);
    let judge = |errors: &[Vec<f64>], index: usize, rng: &mut ChaCha8Rng| {
        let sums = sums(episodes, &starts, &groups, &errors[index], AHEAD[index]);
        vibes_measure::intervals::bootstrap(sums.len(), rng, |counts| r_squared(&sums, counts))
    };
    let one = |index: usize| OpenLoop {
        steps: AHEAD[index],
        recorded: judge(&recorded, index, &mut ChaCha8Rng::seed_from_u64(SEED)),
        shuffled: judge(&shuffled, index, &mut ChaCha8Rng::seed_from_u64(SEED)),
    };
    Ok(if starts.is_empty() { Vec::new() } else { (0..AHEAD.len()).map(one).collect() })
}

/// Where to run ahead from, and whose actions are borrowed.
struct Start {
    episode: usize,
    row: usize,
    lender: usize,
    lent_from: usize,
}

const LONGEST: usize = AHEAD[AHEAD.len() - 1];

fn starts(episodes: &[Followed], rng: &mut ChaCha8Rng) -> Vec<Start> {
    let mut starts = Vec::new();
    let long: Vec<usize> = (0..episodes.len()).filter(|&episode| episodes[episode].rows > LONGEST).collect();
    for (index, episode) in episodes.iter().enumerate() {
        for row in (SKIP..episode.rows.saturating_sub(LONGEST)).step_by(STRIDE) {
            let lenders = || long.iter().copied().filter(|&lender| episodes[lender].trajectory != episode.trajectory);
            let Some(lender) = lenders().nth(match lenders().count() {
                0 => 0,
                count => rng.random_range(0..count),
            }) else {
                continue;
            };
            let lent_from = rng.random_range(0..episodes[lender].rows - LONGEST);
            starts.push(Start { episode: index, row, lender, lent_from });
        }
    }
    starts
}

/// Predicted rewards of every start, by step ahead: `[AHEAD][starts]`.
fn errors(
    model: &Model,
    world: &World,
    episodes: &[Followed],
    starts: &[Start],
    shuffled: bool,
    device: &Device,
) -> Vec<Vec<f64>> {
    let device = device.clone().inner();
    let config = &model.config;
    let mut predicted = vec![Vec::with_capacity(starts.len()); AHEAD.len()];
    for together in starts.chunks(TOGETHER) {
        let count = together.len();
        let gather = |of: &dyn Fn(&Start) -> (usize, usize), values: fn(&Followed) -> &[f32], width: usize| {
            let row = |start: &Start| {
                let (episode, row) = of(start);
                &values(&episodes[episode])[row * width..(row + 1) * width]
            };
            let all: Vec<f32> = together.iter().flat_map(row).copied().collect();
            Tensor::<3>::from_data(TensorData::new(all, [1, count, width]), &device)
        };
        let here = |start: &Start| (start.episode, start.row);
        let mut latent = gather(&here, |episode| &episode.latents, config.latent);
        let mut state = gather(&here, |episode| &episode.states, config.hidden).squeeze_dim::<2>(0);
        for step in 0..=LONGEST {
            let acting = |start: &Start| match shuffled {
                false => (start.episode, start.row + step),
                true => (start.lender, start.lent_from + step),
            };
            let actions = gather(&acting, |episode| &episode.actions, config.actions());
            if let Some(index) = AHEAD.iter().position(|&ahead| ahead == step) {
                let rewards = to_values(world.reward.forward(latent.clone(), actions.clone()).mean);
                predicted[index].extend(rewards.into_iter().map(f64::from));
            }
            if step < LONGEST {
                let (next, states) = world.dynamics.forward(latent, actions, Some(state));
                (latent, state) = (next.mean, states.squeeze_dim::<2>(0));
            }
        }
    }
    predicted
}

/// The distinct trajectories.
fn groups(episodes: &[Followed]) -> Vec<u32> {
    let mut groups: Vec<u32> = episodes.iter().map(|episode| episode.trajectory).collect();
    groups.sort_unstable();
    groups.dedup();
    groups
}

/// Sums over a trajectory's starts.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    reward: f64,
    reward_squares: f64,
    error_squares: f64,
}

fn sums(episodes: &[Followed], starts: &[Start], groups: &[u32], predicted: &[f64], ahead: usize) -> Vec<Sums> {
    let mut sums = vec![Sums::default(); groups.len()];
    for (start, predicted) in starts.iter().zip(predicted) {
        let episode = &episodes[start.episode];
        let earned = f64::from(episode.rewards[start.row + ahead]);
        let Ok(group) = groups.binary_search(&episode.trajectory) else { continue };
        let sums = &mut sums[group];
        sums.count += 1.0;
        sums.reward += earned;
        sums.reward_squares += earned * earned;
        sums.error_squares += (predicted - earned).powi(2);
    }
    sums
}

/// R² where trajectory `i` was drawn `counts[i]` times.
fn r_squared(sums: &[Sums], counts: &[f64]) -> f64 {
    let total = |of: fn(&Sums) -> f64| sums.iter().zip(counts).map(|(sums, count)| count * of(sums)).sum::<f64>();
    let count = total(|sums| sums.count);
    let mean = total(|sums| sums.reward) / count;
    let spread = total(|sums| sums.reward_squares) - count * mean * mean;
    if spread > 1e-9 * count { 1.0 - total(|sums| sums.error_squares) / spread } else { f64::NAN }
}
