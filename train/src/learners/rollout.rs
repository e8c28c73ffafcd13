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

/// Predictions of all steps ahead; `N` is the number of starts, `starts · batch`.
#[derive(Debug)]
pub struct Rollout {
    /// First rows of a window that are starts: all that have as many rows after them as there are steps.
    pub starts: usize,
    /// The latent after 1, 2, … steps, as distributions `[1, N, …]`.
    pub latents: Vec<Gaussian>,
    /// 1 where a start counts: `[1, N, 1]`
    pub counted: Tensor<3>,
}

/// Rolls the dynamics `steps` steps ahead, at most as many as leave one start in a window.
pub fn roll(dynamics: &Dynamics, batch: &Batch, (latents, states): (&Tensor<3>, &Tensor<3>), steps: usize) -> Rollout {
    let steps = steps.min(batch.length - 1);
    let starts = batch.length - steps;
    let mut state = rows(states, 0, starts).squeeze_dim::<2>(0);
    let mut latent = rows(latents, 0, starts);
    let mut ahead = Vec::with_capacity(steps);
    for step in 0..steps {
        let (next, states) = dynamics.forward(latent, rows(&batch.actions, step, starts), Some(state));
        state = states.squeeze_dim::<2>(0);
        latent = next.mean.clone();
        ahead.push(next);
    }
    Rollout { starts, latents: ahead, counted: rows(&batch.counted, 0, starts) }
}

/// Rows `from..from + count` of every window, side by side: `[1, count · batch, …]`.
pub fn rows(x: &Tensor<3>, from: usize, count: usize) -> Tensor<3> {
    let [_, batch, width] = x.dims();
    x.clone().narrow(0, from, count).reshape([1, count * batch, width])
}

/// All steps ahead are read at once, `[1, reach · N, …]`: those of one step for all starts, then those of the next. A step at a time would pay for every operation as often as
/// there are steps.
impl Rollout {
    /// The latents of the first `reach` steps.
    pub fn ahead(&self, reach: usize) -> Gaussian {
        let all = |part: fn(&Gaussian) -> &Tensor<3>| {
            Tensor::cat(self.latents[..self.within(reach)].iter().map(part).cloned().collect(), 1)
        };
        Gaussian { mean: all(|latent| &latent.mean), std: all(|latent| &latent.std) }
    }

    /// What the windows hold there.
    pub fn recorded(&self, x: &Tensor<3>, reach: usize) -> Tensor<3> {
        Tensor::cat((1..=self.within(reach)).map(|step| rows(x, step, self.starts)).collect(), 1)
    }

    /// Mean of a log-likelihood, `[1, reach · N, …]`, over steps and the starts that count; 0 where no start counts.
    pub fn mean(&self, log_prob: Tensor<3>) -> Tensor<1> {
        let reach = log_prob.dims()[1] / self.counted.dims()[1];
        let count = self.counted.clone().sum().clamp_min(1.0) * reach as f32;
        (log_prob * self.counted.clone().repeat_dim(1, reach)).sum() / count
    }

    /// As far as a window has room for.
    fn within(&self, reach: usize) -> usize {
        reach.min(self.latents.len())
    }
}
