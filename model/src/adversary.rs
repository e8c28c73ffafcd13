//! The adversary `p_ψ(s_t | s_<t, o_<t, a_<t)`: built like the encoder (its own observation network, its own GRU), with the latent as a further
//! input before the GRU, predicting the next latent. It bounds how well any predictor that sees the whole history could do.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::config::ModelConfig;
use crate::error::ModelError;
use crate::gaussian::{Gaussian, LatentForm};
use crate::gru::{Gru, GruConfig};
use crate::mlp::{Mlp, MlpConfig};
use crate::observe::Observe;

/// The whole history to the next latent.
#[derive(Module, Debug)]
pub struct Adversary {
    /// Observation to features.
    pub observe: Observe,
    /// Over (features, latent, action).
    pub gru: Gru,
    /// Hidden state to mean and standard deviation.
    pub head: Mlp,
    #[module(skip)]
    floor: f32,
    #[module(skip)]
    form: LatentForm,
}

impl Adversary {
    /// # Errors
    /// The picture is too small.
    pub fn init(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        let input = config.hidden + config.latent + config.actions();
        Ok(Self {
            observe: Observe::init(config, rng, device)?,
            gru: GruConfig { input, hidden: config.hidden }.init(rng, device).with_update_bias(config.gru_update_bias),
            head: MlpConfig { input: config.hidden, hidden: config.head, output: config.latent + 1 }.init(rng, device),
            floor: config.prediction_floor,
            form: config.latents,
        })
    }

    /// The distribution of the latent after each step.
    ///
    /// # Shapes
    /// - `features`: `[length, batch, hidden]`, this network's own features of the observations
    /// - `latents`: `[length, batch, latent]`, `actions`: `[length, batch, A]`, taken there
    /// - output: step `t` is the prediction of latent `t + 1`
    pub fn forward(&self, features: Tensor<3>, latents: Tensor<3>, actions: Tensor<3>) -> Gaussian {
        self.predict(self.states(features, latents, actions))
    }

    /// The hidden state after each step, which has seen the observation, the latent and the action there: `[length, batch, hidden]`.
    pub fn states(&self, features: Tensor<3>, latents: Tensor<3>, actions: Tensor<3>) -> Tensor<3> {
        self.gru.forward(Tensor::cat(vec![features, latents, actions], 2), None)
    }

    /// The prediction made from hidden states.
    fn predict(&self, states: Tensor<3>) -> Gaussian {
        Gaussian::latent(self.head.forward(states), self.form, self.floor)
    }
}
