//! Multi-step inverse dynamics (AC-State, arXiv 2207.08229; ACRO, arXiv 2211.00164): the action taken at a step should be predicted from the latent there and the latent
//! k steps later. Actions here are continuous: a normal distribution of variance 1 around the prediction, its constant left out.

use burn::tensor::Tensor;
use rand::Rng;

/// `½ |a − prediction|²`, mean over the pairs.
///
/// # Shapes
/// - `predictions`, `actions`: `[pairs, A]`
pub fn loss(predictions: Tensor<2>, actions: Tensor<2>) -> Tensor<1> {
    let pairs = actions.dims()[0];
    (predictions - actions).square().sum() * 0.5 / pairs as f32
}

/// Rows of a window and their partners some steps later.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pairs {
    /// Rows `step·batch + window` of the earlier latents.
    pub earlier: Vec<i32>,
    /// Rows of the later latents.
    pub later: Vec<i32>,
    /// Steps between them.
    pub steps: Vec<usize>,
}

impl Pairs {
    /// One pair for every row that has a successor: its partner is k steps later, k uniform in `1..=most` as far as the window reaches.
    pub fn draw(length: usize, batch: usize, most: usize, rng: &mut impl Rng) -> Self {
        let mut pairs = Self { earlier: Vec::new(), later: Vec::new(), steps: Vec::new() };
        for step in 0..length.saturating_sub(1) {
            for window in 0..batch {
                let k = rng.random_range(1..=most.min(length - 1 - step).max(1));
                pairs.earlier.push((step * batch + window) as i32);
                pairs.later.push(((step + k) * batch + window) as i32);
                pairs.steps.push(k);
            }
        }
        pairs
    }

    /// The pairs whose earlier row is wanted.
    pub fn that(self, wanted: impl Fn(usize) -> bool) -> Self {
        let mut kept = Self { earlier: Vec::new(), later: Vec::new(), steps: Vec::new() };
        for ((earlier, later), steps) in self.earlier.into_iter().zip(self.later).zip(self.steps) {
            if wanted(earlier as usize) {
                kept.earlier.push(earlier);
                kept.later.push(later);
                kept.steps.push(steps);
            }
        }
        kept
    }
}
