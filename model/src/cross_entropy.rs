//! The cross-entropy method: the action a critic values most, found by drawing actions, keeping the best, and drawing again around those. In: standard normal noise and
//! a function that values actions. Out: one action a row. It is QT-Opt's actor.

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use crate::described::must;

/// Sizes of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrossEntropy {
    /// Actions drawn in every iteration.
    pub samples: usize,
    /// Best of them that the next iteration is drawn around.
    pub elites: usize,
    /// Iterations.
    pub iterations: usize,
}

impl Default for CrossEntropy {
    /// Those of tensorflow/agents' QT-Opt.
    fn default() -> Self {
        Self { samples: 32, elites: 4, iterations: 3 }
    }
}

/// Actions drawn for a row in one search, at most.
const MOST_DRAWN: usize = 1 << 20;

impl CrossEntropy {
    /// What is wrong with sizes that were read from a file, where something is.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Self { samples, elites, iterations } = *self;
        must(samples >= 1, "samples", samples, "be 1 or more")?;
        must((1..=samples).contains(&elites), "elites", elites, &format!("lie within 1..{samples}, the samples"))?;
        let most = format!("draw {MOST_DRAWN} samples or fewer in all");
        must(iterations <= MOST_DRAWN / samples, "iterations", iterations, &most)
    }

    /// The best action found for every row: the first draw is around 0 with standard deviation 1, each later one around the elites' mean with their
    /// (population) standard deviation; actions are cut to −1..1. The best of all draws wins.
    ///
    /// # Shapes
    /// - `noise`: `[iterations, rows·samples, A]`, standard normal, the samples of one row side by side
    /// - `value`: of actions `[rows·samples, A]`: `[rows·samples]`
    /// - output: `[rows, A]`
    pub fn search(&self, noise: Tensor<3>, value: impl Fn(Tensor<2>) -> Tensor<1>) -> Tensor<2> {
        let [iterations, drawn, width] = noise.dims();
        let rows = drawn / self.samples;
        let device = noise.device();
        let mut mean = Tensor::<3>::zeros([rows, 1, width], &device);
        let mut std = Tensor::<3>::ones([rows, 1, width], &device);
        let mut best: Option<(Tensor<3>, Tensor<2>)> = None;
        for iteration in 0..iterations {
            let noise = noise.clone().narrow(0, iteration, 1).reshape([rows, self.samples, width]);
            let actions = (mean + std * noise).clamp(-1.0, 1.0);
            let values = value(actions.clone().reshape([drawn, width])).reshape([rows, self.samples]);
            let (highest, order) = values.topk_with_indices(self.elites, 1);
            let elites = actions.gather(1, order.unsqueeze_dim::<3>(2).repeat_dim(2, width));
            mean = elites.clone().mean_dim(1);
            std = (elites.clone() - mean.clone()).square().mean_dim(1).sqrt();
            let found = (elites.narrow(1, 0, 1), highest.narrow(1, 0, 1));
            best = Some(match best {
                None => found,
                Some(before) => better(before, found),
            });
        }
        best.map_or_else(|| Tensor::zeros([rows, width], &device), |(actions, _)| actions.reshape([rows, width]))
    }
}

/// Row by row the one of higher value; `[rows, 1, A]` and `[rows, 1]`.
fn better(before: (Tensor<3>, Tensor<2>), found: (Tensor<3>, Tensor<2>)) -> (Tensor<3>, Tensor<2>) {
    let wins = found.1.clone().greater(before.1.clone());
    let [rows, _, width] = before.0.dims();
    let chosen = wins.clone().unsqueeze_dim::<3>(2).expand([rows, 1, width]);
    (before.0.mask_where(chosen, found.0), before.1.mask_where(wins, found.1))
}
