//! Soft actor-critic's losses (facts of the SAC-AE lineage: MishaLaskin/rad, denisyarats/drq) and QT-Opt's. In: action values, log-probabilities, rewards, all `[rows]`
//! or `[views, rows]`. Out: targets and losses.

use burn::tensor::Tensor;

use super::pair::huber;

/// The soft value `min(Q₁, Q₂) − α log π` of what follows: `[rows]`.
pub fn soft_value(values: [Tensor<1>; 2], log_probability: Tensor<1>, temperature: f32) -> Tensor<1> {
    let [first, second] = values;
    first.min_pair(second) - log_probability * temperature
}

/// `r + γ V′`, without gradient; a time limit is no end, so every step bootstraps.
pub fn target(rewards: Tensor<1>, next_value: Tensor<1>, discount: f32) -> Tensor<1> {
    (rewards + next_value * discount).detach()
}

/// Mean of both critics' squared errors, added up: `[1]`.
pub fn critic_loss(values: [Tensor<1>; 2], target: &Tensor<1>) -> Tensor<1> {
    let [first, second] = values.map(|value| (value - target.clone()).square().mean());
    first + second
}

/// QT-Opt's: Huber errors instead of squared ones (tensorflow/agents, qtopt).
pub fn huber_critic_loss(values: [Tensor<1>; 2], target: &Tensor<1>) -> Tensor<1> {
    let [first, second] = values.map(|value| huber(value - target.clone()).mean());
    first + second
}

/// `mean(α log π − min(Q₁, Q₂))`
pub fn actor_loss(values: [Tensor<1>; 2], log_probability: Tensor<1>, temperature: f32) -> Tensor<1> {
    soft_value(values, log_probability, temperature).mean().neg()
}

/// `mean(α (−log π − target entropy))`, gradient to the temperature's logarithm alone: `[1]`.
pub fn temperature_loss(log_temperature: Tensor<1>, log_probability: Tensor<1>, target_entropy: f32) -> Tensor<1> {
    log_temperature.exp() * (log_probability.detach().neg() - target_entropy).mean()
}

/// The mean over augmented views of the same rows (denisyarats/drq averages its targets so): `[rows]`.
///
/// # Panics
/// If there is no view.
pub fn over_views(values: Vec<Tensor<1>>) -> Tensor<1> {
    Tensor::stack::<2>(values, 0).mean_dim(0).squeeze_dim(0)
}
