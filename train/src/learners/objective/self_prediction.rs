//! Where the dynamics, run ahead without pictures, arrive, the encoder should arrive too (SPR, mila-iqia/spr). No reward shapes the latents.
//!
//! ```text
//! L = − w mean Σ_k [2 − 2 cos(q(ŝ_t+k), sg z_t+k)],   ŝ: the dynamics' mean k steps ahead, q: a perceptron
//! ```
//!
//! The targets are the encoder's own latents without gradient (SPR's rate of 1, its choice with augmentation), which the perceptron q keeps from collapsing. The
//! encoder sees no actions, as SPR's does not: from past actions alone it could foretell what it will know of them. The models of dynamics and reward learn beside it.

use burn::tensor::{Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use vibes_model::HeadConfig;
use vibes_model::parameters::to_values;

use super::steps::models_apart;
use super::{Definition, Networks, Pictures, Rival, Value};
use crate::error::Result;
use crate::learners::auxiliary;
use crate::learners::losses::self_prediction;
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The objective.
#[derive(Debug)]
pub struct SelfPrediction;

/// K.
pub const STEPS: Declared = Declared {
    flag: "self-prediction-steps",
    kind: Kind::Whole { default: 5 },
    help: "Steps ahead that the objective self-prediction runs the dynamics (SPR's 5)",
};

/// The loss's weight beside the models'.
const WEIGHT: f32 = 5.0;
const HEAD: &str = "self-prediction";

impl Definition for SelfPrediction {
    fn name(&self) -> &'static str {
        "self-prediction"
    }

    fn about(&self) -> &'static str {
        "later latents are predicted by running the dynamics ahead; no reward (SPR); the encoder sees no actions"
    }

    fn options(&self) -> &'static [Declared] {
        &[STEPS]
    }

    fn steps(&self) -> Option<&'static Declared> {
        Some(&STEPS)
    }

    fn networks(&self, options: &Settings, _actions: usize) -> Networks {
        let head = HeadConfig { name: HEAD.to_owned(), input: options.latent, output: options.latent };
        Networks { heads: vec![head], blind_to_actions: true, ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn rewards_shape_latents(&self) -> bool {
        false
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = scene.options.own.whole(&STEPS) as usize;
        // The rollout is shared with the auxiliary terms: as far as each of them looks, too.
        let rollout = scene.rollout(&[auxiliary::reaches(scene.options), vec![steps]].concat());
        let counted = to_values(rollout.counted(steps));
        let (starts, latent) = (counted.len(), scene.means.dims()[2]);
        let chosen: Vec<i32> = (0..).zip(&counted).filter(|(_, counted)| **counted > 0.0).map(|(row, _)| row).collect();
        let count = chosen.len();
        if count == 0 {
            return Ok(models_apart(scene).less("self_prediction_loss", scene.means.clone().sum() * 0.0));
        }
        let predictions = scene.world.head(HEAD)?.forward(rollout.ahead(steps).mean.reshape([steps, starts, latent]));
        let targets = rollout.recorded(&scene.means, steps).reshape([steps, starts, latent]);
        let chosen = Tensor::<1, Int>::from_data(TensorData::new(chosen, [count]), &scene.means.device());
        let loss = self_prediction::loss(predictions.select(1, chosen.clone()), targets.select(1, chosen));
        let apart = models_apart(scene);
        Ok(Value { objective: apart.objective.clone() - loss.clone() * (WEIGHT - 1.0), ..apart }
            .less("self_prediction_loss", loss))
    }
}
