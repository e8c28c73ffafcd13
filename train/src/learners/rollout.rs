//! The dynamics run ahead without pictures, under the recorded actions. In: the windows, their latents and
//! the dynamics' states before each row. Out: for each step ahead, the predicted latents of all starts at once.
//!
//! ```text
//! start (h_t, s_t);   h_t+k+1 = f(h_t+k, s_t+k, a_t+k),   s_t+k+1 = mean of p_θ(· | h_t+k+1)
//! ```

use burn::tensor::Tensor;
use vibes_model::dynamics::Dynamics;
use vibes_model::gaussian::Gaussian;

use crate::batch::Batch;

/// Predictions of all steps ahead. Who looks `reach` steps ahead starts from every row that has as many after it in its window, however much further others look: `N` is the number of
/// these starts, `(length − reach) · batch`.
#[derive(Debug)]
pub struct Rollout {
    length: usize,
    batch: usize,
    /// The latent after 1, 2, … steps, from the first rows on of as many starts as anyone needs there.
    latents: Vec<Gaussian>,
    /// 1 where a row counts: `[length, batch, 1]`
    counted: Tensor<3>,
}

/// Rolls the dynamics ahead as far as each of `reaches` asks for, all of which are below the windows' length.
pub fn roll(
    dynamics: &Dynamics,
    batch: &Batch,
    (latents, states): (&Tensor<3>, &Tensor<3>),
    reaches: &[usize],
) -> Rollout {
    let (longest, shortest) = (reaches.iter().max().copied().unwrap_or(0), reaches.iter().min().copied().unwrap_or(0));
    let mut starts = batch.length - shortest;
    let mut state = rows(states, 0, starts).squeeze_dim::<2>(0);
    let mut latent = rows(latents, 0, starts);
    let mut ahead = Vec::with_capacity(longest);
    for step in 0..longest {
        // Those who look no further than this need no more of it, and the starts that only they have are left behind.
        let nearest = reaches.iter().filter(|reach| **reach > step).min().copied().unwrap_or(longest);
        starts = starts.min(batch.length - nearest);
        let count = starts * batch.batch;
        let (state_here, latent_here) = (state.narrow(0, 0, count), latent.narrow(1, 0, count));
        let (next, states) = dynamics.forward(latent_here, rows(&batch.actions, step, starts), Some(state_here));
        state = states.squeeze_dim::<2>(0);
        latent = next.mean.clone();
        ahead.push(next);
    }
    Rollout { length: batch.length, batch: batch.batch, latents: ahead, counted: batch.counted.clone() }
}

/// Rows `from..from + count` of every window, side by side: `[1, count · batch, …]`.
pub fn rows(x: &Tensor<3>, from: usize, count: usize) -> Tensor<3> {
    let [_, batch, width] = x.dims();
    x.clone().narrow(0, from, count).reshape([1, count * batch, width])
}

/// All steps ahead are read at once, `[1, reach · N, …]`: those of one step for all starts, then those of the next. A step at a time would pay for every operation as often as
/// there are steps.
impl Rollout {
    /// First rows of a window that are starts of who looks so far ahead.
    fn starts(&self, reach: usize) -> usize {
        self.length - reach
    }

    /// 1 where a start counts: `[1, N, 1]`
    pub fn counted(&self, reach: usize) -> Tensor<3> {
        rows(&self.counted, 0, self.starts(reach))
    }

    /// The latents of the first `reach` steps, as distributions.
    pub fn ahead(&self, reach: usize) -> Gaussian {
        let count = self.starts(reach) * self.batch;
        let all = |part: fn(&Gaussian) -> &Tensor<3>| {
            let steps = self.latents[..reach].iter().map(part);
            Tensor::cat(steps.map(|latents| latents.clone().narrow(1, 0, count)).collect(), 1)
        };
        Gaussian { mean: all(|latent| &latent.mean), std: all(|latent| &latent.std) }
    }

    /// What the windows hold there.
    pub fn recorded(&self, x: &Tensor<3>, reach: usize) -> Tensor<3> {
        Tensor::cat((1..=reach).map(|step| rows(x, step, self.starts(reach))).collect(), 1)
    }

    /// Mean of a log-likelihood, `[1, reach · N, …]`, over steps and the starts that count; 0 where no start counts.
    pub fn mean(&self, log_prob: Tensor<3>, reach: usize) -> Tensor<1> {
        let counted = self.counted(reach);
        let count = counted.clone().sum().clamp_min(1.0) * reach as f32;
        (log_prob * counted.repeat_dim(1, reach)).sum() / count
    }
}
