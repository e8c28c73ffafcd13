//! What stands beside the critics' loss in `CoRe` (apple/ml-core). In: a window of features, latents and predictions. Out: one number to minimise.
//!
//! ```text
//! L = w_c · contrast(y_t, x_t) + w_r · smooth L1(r(h_{t+1}, s_{t+1}), r_t) + w_a · ½ |tanh g(state_t, state_{t+1}) − a_t|² + w_d · max(KL, free nats)
//! y_t = f(prior mean of s_t), x_t: features of the picture o_t; t = 0 is left out, where there is no prior
//! ```

use burn::tensor::Tensor;
use vibes_model::World;
use vibes_model::gaussian::Gaussian;

use super::options::{ACTION, NEXT_FEATURE, REWARD, RecurrentOptions, SHARPNESS};
use crate::error::Result;
use crate::learners::losses::kl_constraint::Beliefs;
use crate::learners::losses::{contrast, inverse, pair};

/// Rows `1..length` of windows, each with the row before it: `[rows, …]`.
#[derive(Debug, Clone)]
pub struct Pairs {
    /// (h, s) of the row before: `[rows, state]`
    pub before: Tensor<2>,
    /// (h, s): `[rows, state]`
    pub after: Tensor<2>,
    /// The action between: `[rows, A]`
    pub actions: Tensor<2>,
    /// The reward between: `[rows]`
    pub rewards: Tensor<1>,
    /// Features of the picture: `[rows, features]`
    pub features: Tensor<2>,
    /// Means of the latents: `[rows, latent]`
    pub means: Tensor<2>,
    /// What the dynamics predicted of the latents, `[length − 1, batch, latent]`
    pub prior: Gaussian,
}

/// What the networks predict of them.
#[derive(Debug, Clone)]
pub struct Predicted {
    /// The picture's features: `[rows, features]`
    pub features: Tensor<2>,
    /// What the contrast's logits are scaled by, before softplus: `[1]`
    pub sharpness: Tensor<1>,
    /// The reward: `[rows]`
    pub rewards: Tensor<1>,
    /// The action, before tanh: `[rows, A]`
    pub actions: Tensor<2>,
    /// Posterior and prior of the latents.
    pub beliefs: Beliefs,
}

/// The loss: `[1]`.
///
/// # Errors
/// The networks lack a head.
pub fn loss(world: &World, latent_std: f32, pairs: &Pairs, options: &RecurrentOptions) -> Result<Tensor<1>> {
    let rows = pairs.means.dims()[0];
    let prior_mean = pairs.prior.mean.clone().reshape([rows, pairs.means.dims()[1]]);
    let states = Tensor::cat(vec![pairs.before.clone(), pairs.after.clone()], 1);
    let predicted = Predicted {
        features: world.head(NEXT_FEATURE)?.forward(prior_mean.clone()),
        sharpness: world.number(SHARPNESS)?,
        rewards: world.head(REWARD)?.forward(pairs.after.clone()).squeeze_dim::<1>(1),
        actions: world.head(ACTION)?.forward(states),
        beliefs: Beliefs {
            mean: pairs.means.clone(),
            std: latent_std,
            prior_mean,
            prior_std: pairs.prior.std.clone().reshape([rows, 1]),
        },
    };
    Ok(of(predicted, pairs.features.clone(), pairs.rewards.clone(), pairs.actions.clone(), options))
}

/// The loss of predictions of these features, rewards and actions: `[1]`.
pub fn of(
    predicted: Predicted,
    features: Tensor<2>,
    rewards: Tensor<1>,
    actions: Tensor<2>,
    options: &RecurrentOptions,
) -> Tensor<1> {
    // Divided by the root of the width, so that the first logits are of the size of one.
    let width = (features.dims()[1] as f32).sqrt();
    let contrast = contrast::next_feature(predicted.features / width, features, predicted.sharpness);
    let reward = pair::huber(predicted.rewards - rewards).mean();
    let action = inverse::loss(predicted.actions.tanh(), actions);
    // Where the divergence is below the free nats it costs nothing.
    let divergence = predicted.beliefs.divergence().mean().clamp_min(options.free_nats as f32);
    contrast * options.contrast_weight as f32
        + reward * options.reward_weight as f32
        + action * options.inverse_weight as f32
        + divergence * options.divergence_weight as f32
}
