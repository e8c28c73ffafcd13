//! The latent dynamics `p_θ(s_t | h_{t−1}, s_{t−1}, a_{t−1})`: a GRU over (latent, action), and a Gaussian with a mean of unit norm and one
//! learned standard deviation.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::config::ModelConfig;
use crate::gaussian::{Gaussian, LatentForm};
use crate::gru::{Gru, GruConfig};
use crate::mlp::{Mlp, MlpConfig};

/// Past latents and actions to the next latent.
#[derive(Module, Debug)]
pub struct Dynamics {
    /// `h_t = f(h_{t−1}, s_{t−1}, a_{t−1})`
    pub gru: Gru,
    /// Hidden state to mean and standard deviation.
    pub head: Mlp,
    #[module(skip)]
    floor: f32,
    #[module(skip)]
    form: LatentForm,
}

impl Dynamics {
    /// He-initialised head.
    pub fn init(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Self {
        Self {
            gru: GruConfig { input: config.latent + config.actions(), hidden: config.hidden }
                .init(rng, device)
                .with_update_bias(config.gru_update_bias),
            head: MlpConfig { input: config.hidden, hidden: config.head, output: config.latent + 1 }.init(rng, device),
            floor: config.prediction_floor,
            form: config.latents,
        }
    }

    /// The form of its latents.
    pub(crate) fn form(&self) -> LatentForm {
        self.form
    }

    /// Least standard deviation of a prediction.
    pub(crate) fn floor(&self) -> f32 {
        self.floor
    }

    /// The distribution of the latent after each step.
    ///
    /// # Shapes
    /// - `latents`: `[length, batch, latent]`, `actions`: `[length, batch, A]`, taken there
    /// - `state`: `[batch, hidden]`, zeros if absent
    /// - output: step `t` is the prediction of latent `t + 1`; and the hidden states `[length, batch, hidden]`
    pub fn forward(&self, latents: Tensor<3>, actions: Tensor<3>, state: Option<Tensor<2>>) -> (Gaussian, Tensor<3>) {
        let states = self.gru.forward(Tensor::cat(vec![latents, actions], 2), state);
        (Gaussian::latent(self.head.forward(states.clone()), self.form, self.floor), states)
    }
}
