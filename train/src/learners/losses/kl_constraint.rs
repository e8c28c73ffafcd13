//! A divergence held at a target by a dual variable (`RePo`, zchuning/repo). In: the posterior and the prior of the same latents. Out: their Kullback–Leibler divergence,
//! whose gradient goes mostly to the prior, and the loss that moves the dual variable β.
//!
//! ```text
//! KL = Σ_i ln(σ_p / σ_q) + (σ_q² + (μ_q − μ_p)²) / (2 σ_p²) − ½      loss of ln β: β (target − KL), so β rises while KL is above its target
//! ```

use burn::tensor::Tensor;

/// Share of the divergence's gradient that goes to the prior: five steps of the prior to one of the posterior.
pub const PRIOR_SHARE: f32 = 5.0 / 6.0;

/// Posterior `N(mean, posterior_std² I)` and prior `N(prior_mean, prior_std² I)`.
#[derive(Debug, Clone)]
pub struct Beliefs {
    /// `[rows, dims]`
    pub mean: Tensor<2>,
    /// The encoder's constant standard deviation.
    pub std: f32,
    /// `[rows, dims]`
    pub prior_mean: Tensor<2>,
    /// `[rows, 1]`
    pub prior_std: Tensor<2>,
}

impl Beliefs {
    /// Divergence of the posterior from the prior, summed over the dimensions: `[rows]`.
    pub fn divergence(&self) -> Tensor<1> {
        let (variance, spread) = (self.std * self.std, self.prior_std.clone());
        let distance = (self.mean.clone() - self.prior_mean.clone()).square() + variance;
        let terms = spread.clone().log() - self.std.ln() + distance / (spread.square() * 2.0) - 0.5;
        terms.sum_dim(1).squeeze_dim(1)
    }

    /// The same value, with [`PRIOR_SHARE`] of its gradient to the prior and the rest to the posterior.
    pub fn balanced_divergence(&self) -> Tensor<1> {
        let posterior_fixed = Self { mean: self.mean.clone().detach(), ..self.clone() };
        let prior_fixed = Self {
            prior_mean: self.prior_mean.clone().detach(),
            prior_std: self.prior_std.clone().detach(),
            ..self.clone()
        };
        posterior_fixed.divergence() * PRIOR_SHARE + prior_fixed.divergence() * (1.0 - PRIOR_SHARE)
    }
}

/// The dual variable's loss; gradient to `log_beta` alone.
///
/// # Shapes
/// - `log_beta`: `[1]`; `divergence`: `[1]`, its mean over the rows
pub fn dual_loss(log_beta: Tensor<1>, divergence: Tensor<1>, target: f32) -> Tensor<1> {
    log_beta.exp() * (divergence.detach().neg() + target)
}
