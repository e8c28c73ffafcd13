//! The encoder `e_φ(s_t | o_≤t, a_<t)`: features of the observation, the encoder's own GRU over (features, previous action), and a mean
//! of unit norm. Its standard deviation is a constant of the model.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::config::ModelConfig;
use crate::error::ModelError;
use crate::gaussian::LatentForm;
use crate::gru::{Gru, GruConfig};
use crate::linear::{Linear, LinearConfig};
use crate::observe::{Frames, Observe};

/// History to the mean of the latent.
#[derive(Module, Debug)]
pub struct Encoder {
    /// Observation to features.
    pub observe: Observe,
    /// Over (features, previous action).
    pub gru: Gru,
    /// Hidden state to the mean before it is normalised.
    pub mean: Linear,
    #[module(skip)]
    form: LatentForm,
    #[module(skip)]
    blind: bool,
}

/// What the encoder gives for a window.
#[derive(Debug, Clone)]
pub struct Encoding {
    /// Means of the latents, of the model's form: `[length, batch, latent]`
    pub means: Tensor<3>,
    /// Features of the observations by themselves: `[length, batch, hidden]`
    pub features: Tensor<3>,
    /// Hidden state after the last step, to go on from: `[batch, hidden]`
    pub state: Tensor<2>,
}

impl Encoder {
    /// # Errors
    /// The picture is too small.
    pub fn init(config: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        Ok(Self {
            observe: Observe::init(config, rng, device)?,
            gru: GruConfig { input: config.hidden + config.actions(), hidden: config.hidden }
                .init(rng, device)
                .with_update_bias(config.gru_update_bias),
            mean: LinearConfig { input: config.hidden, output: config.latent }.init(rng, device),
            form: config.latents,
            blind: config.blind_to_actions,
        })
    }

    /// The encoder with features, and latents before they are normalised, standardized over this window: its latents begin spread over the
    /// whole sphere. Without this the pictures' common part drowns their differences, and the latents begin as one point with the noise around it.
    ///
    /// # Shapes
    /// As [`Encoder::forward`].
    ///
    /// # Errors
    /// The frames are of another kind than the model's.
    pub fn calibrated(mut self, frames: Frames, previous_actions: Tensor<3>) -> Result<Self, ModelError> {
        let [length, batch, _] = previous_actions.dims();
        self.observe = self.observe.calibrated(frames.clone())?;
        let features = self.observe.forward(frames, length)?;
        let states = self.gru.forward(self.seen(features, previous_actions), None);
        self.mean = self.mean.standardized(states.reshape([length * batch, self.gru.hidden()]));
        Ok(self)
    }

    /// # Shapes
    /// - `frames`: `length·batch` observations
    /// - `previous_actions`: `[length, batch, A]`, the action before each observation, zeros at an episode's start
    /// - `state`: `[batch, hidden]`, zeros if absent
    ///
    /// # Errors
    /// The frames are of another kind than the model's.
    pub fn forward(
        &self,
        frames: Frames,
        previous_actions: Tensor<3>,
        state: Option<Tensor<2>>,
    ) -> Result<Encoding, ModelError> {
        let [length, batch, _] = previous_actions.dims();
        let features = self.observe.forward(frames, length)?;
        let states = self.gru.forward(self.seen(features.clone(), previous_actions), state);
        let means = self.form.mean(self.mean.forward(states.clone()));
        let state = states.narrow(0, length - 1, 1).reshape([batch, self.gru.hidden()]);
        Ok(Encoding { means, features, state })
    }

    /// What the GRU takes in; an encoder that sees no actions gets zeros in their place.
    fn seen(&self, features: Tensor<3>, previous_actions: Tensor<3>) -> Tensor<3> {
        let actions = if self.blind { previous_actions.zeros_like() } else { previous_actions };
        Tensor::cat(vec![features, actions], 2)
    }
}
