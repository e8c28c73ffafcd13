//! `DeepMDP`: the next latent and the reward are predicted from the latent and the action of one step, and nothing else. It is the metrics' plain control.
//!
//! ```text
//! L = Σ log p(r_t | s_t, a_t) − mean [½ ((sg z′ − μ(z, a)) / σ(z, a))² + ln σ(z, a)]      z: mean of the latent
//! ```
//!
//! The dynamics model with its hidden state, which this objective does not have, is fitted beside it to latents that none of its gradient reaches.

use burn::tensor::Tensor;
use burn::tensor::activation::sigmoid;
use rand_chacha::ChaCha8Rng;
use vibes_model::HeadConfig;

use super::steps::{Steps, dynamics_apart};
use super::{Definition, Networks, Pictures, Rival, Value};
use crate::error::Result;
use crate::learners::losses::dbc::NextLatent;
use crate::learners::losses::transition;
use crate::learners::scene::Scene;
use crate::settings::Settings;

/// The objective.
#[derive(Debug)]
pub struct DeepMdp;

impl Definition for DeepMdp {
    fn name(&self) -> &'static str {
        "deepmdp"
    }

    fn about(&self) -> &'static str {
        "the next latent and the reward are predicted from one step's latent and action (DeepMDP)"
    }

    fn networks(&self, options: &Settings, actions: usize) -> Networks {
        Networks { heads: vec![Transition::head(options, actions)], ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = Steps::of(scene);
        let loss = transition::latent(&Transition::predict(scene, &steps)?, steps.next.clone());
        Ok(dynamics_apart(scene).less("transition_loss", loss))
    }
}

/// (latent, action) to the next latent, each dimension with a standard deviation of its own (`facebookresearch/deep_bisim4control`).
#[derive(Debug)]
pub struct Transition;

impl Transition {
    const NAME: &str = "transition";
    /// Least and most standard deviation.
    const STD: [f32; 2] = [1e-2, 10.0];

    /// Its head.
    pub fn head(options: &Settings, actions: usize) -> HeadConfig {
        HeadConfig { name: Self::NAME.to_owned(), input: options.latent + actions, output: 2 * options.latent }
    }

    /// Its prediction for every step.
    ///
    /// # Errors
    /// The model has no such head.
    pub fn predict(scene: &Scene<'_>, steps: &Steps) -> Result<NextLatent> {
        let input = Tensor::cat(vec![steps.now.clone(), steps.actions.clone()], 1);
        let output = scene.world.head(Self::NAME)?.forward(input);
        let width = output.dims()[1] / 2;
        let [low, high] = Self::STD;
        Ok(NextLatent {
            mean: output.clone().narrow(1, 0, width),
            std: sigmoid(output.narrow(1, width, width)) * (high - low) + low,
        })
    }
}
