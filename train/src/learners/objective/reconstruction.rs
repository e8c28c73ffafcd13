//! The ablation "Recon.": the latent must explain the whole observation, as in Dreamer. The encoder's entropy is constant, because its variance is, and left
//! out as in the paper.
//!
//! ```text
//! L = 1/(T B) Σ_t Σ_b [ log p_θ(o_t | s_t) + log p_θ(r_t | s_t, a_t) + log p_θ(s_t | h_t−1, s_t−1, a_t−1) ]
//! ```

use burn::tensor::Tensor;

use rand_chacha::ChaCha8Rng;

use super::{Definition, Networks, Pictures, Rival, Value, Weights, no_adversary};
use crate::error::{Result, TrainError};
use crate::learners::scene::{Predictions, Scene};
use crate::settings::Settings;

/// The ablation that reconstructs observations.
#[derive(Debug)]
pub struct Reconstruction;

impl Definition for Reconstruction {
    fn name(&self) -> &'static str {
        "reconstruction"
    }

    fn about(&self) -> &'static str {
        "the observation, the next latent and the reward are predicted: the paper's ablation \"Recon.\""
    }

    fn dynamics_shape_latents(&self) -> bool {
        true
    }

    fn networks(&self, _options: &Settings, _actions: usize) -> Networks {
        Networks { decoder: true, ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: length }
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let Some(decoder) = &scene.world.decoder else {
            let fact = "this model was made without the decoder that `reconstruction` needs";
            return Err(TrainError::Options(fact.to_owned()));
        };
        let observations = decoder.log_prob(scene.batch.frames.clone(), scene.latents.clone())?;
        Ok(value(&scene.predictions, observations, Weights::of(scene)))
    }
}

/// The value of the objective; `observations` is the log-density of each row's observation, `[length, batch]`.
pub fn value(predictions: &Predictions, observations: Tensor<2>, weights: Weights) -> Value {
    let counted = predictions.counted.clone().squeeze_dim::<2>(2);
    let reconstruction = (observations * counted).sum() / predictions.count;
    let mut value = no_adversary::value(predictions, weights);
    value.objective = value.objective + reconstruction.clone();
    value.stated.push(("reconstruction_log_likelihood", reconstruction));
    value
}
