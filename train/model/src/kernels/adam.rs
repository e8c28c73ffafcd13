//! Adam (Kingma and Ba, 2015, algorithm 1) in one pass over a parameter, its gradient and its moments.
//!
//! In: a parameter, its gradient, the moments so far. Out: the updated parameter and moments.

use burn::tensor::Tensor;

/// Adam's constants. The defaults are PyTorch's: rates 0.9 and 0.999, ε 1e-8 (added to the root), no weight decay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adam {
    /// Decay of the gradient's running mean.
    pub beta1: f32,
    /// Decay of the squared gradient's running mean.
    pub beta2: f32,
    /// Added to the root of the second moment.
    pub epsilon: f32,
}

impl Default for Adam {
    fn default() -> Self {
        Self {
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
        }
    }
}

/// Running means of one parameter's gradient and squared gradient, of the parameter's shape.
#[derive(Clone, Debug)]
pub struct Moments<const D: usize> {
    /// Running mean of the gradient, not corrected for its start at zero.
    pub first: Tensor<D>,
    /// Running mean of the squared gradient, not corrected for its start at zero.
    pub second: Tensor<D>,
}

impl Adam {
    /// The parameter and its moments after update number `step` (the first is 1).
    ///
    /// `scale` multiplies the gradient first: the factor of a global norm clip, or 1. All tensors are on the inner device, without
    /// autodiff; pass them by value and keep no clones, then on `flex` nothing is copied. `moments` is `None` before the first update.
    pub fn update<const D: usize>(
        &self,
        parameter: Tensor<D>,
        gradient: Tensor<D>,
        moments: Option<Moments<D>>,
        learning_rate: f64,
        scale: f32,
        step: u64,
    ) -> (Tensor<D>, Moments<D>) {
        let gradient = gradient * scale;
        let (first, second) = match moments {
            Some(Moments { first, second }) => (first, second),
            None => (gradient.zeros_like(), gradient.zeros_like()),
        };
        let first = first * self.beta1 + gradient.clone() * (1.0 - self.beta1);
        let second = second * self.beta2 + gradient.clone() * gradient * (1.0 - self.beta2);
        let (rate, root) = self.corrections(learning_rate, step);
        let change = first.clone() / (second.clone().sqrt() / root + self.epsilon) * rate;
        (parameter - change, Moments { first, second })
    }

    /// Step size and root of the second moment's correction: `lr / (1 − β₁ᵗ)` and `√(1 − β₂ᵗ)`.
    fn corrections(&self, learning_rate: f64, step: u64) -> (f32, f32) {
        let step = step as f64;
        let rate = learning_rate / (1.0 - f64::from(self.beta1).powf(step));
        (
            rate as f32,
            (1.0 - f64::from(self.beta2).powf(step)).sqrt() as f32,
        )
    }
}
