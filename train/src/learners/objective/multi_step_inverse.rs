//! Which action was taken, predicted from the latent before it and the one some steps later, and nothing else (AC-State, arXiv 2207.08229; ACRO, arXiv 2211.00164). No reward
//! shapes the latents: they keep what actions move.
//!
//! ```text
//! L = − mean ½ |a_t − f(z_t, z_t+k, k)|²,   k uniform in 1..K for every pair
//! ```
//!
//! The encoder sees no actions: with them in its memory it would hand over the answer. The models of dynamics and reward stand beside it, apart from the latents.

use burn::tensor::{Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use vibes_model::HeadConfig;
use vibes_model::parameters::to_values;

use super::steps::models_apart;
use super::{Definition, Networks, Pictures, Rival, Value};
use crate::error::Result;
use crate::learners::losses::inverse::{self, Pairs};
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The objective.
#[derive(Debug)]
pub struct MultiStepInverse;

/// K.
pub const STEPS: Declared = Declared {
    flag: "multi-step-inverse-steps",
    kind: Kind::Whole { default: 5 },
    help: "Most steps between the two latents of the objective multi-step-inverse",
};

const HEAD: &str = "multi-step inverse";

impl Definition for MultiStepInverse {
    fn name(&self) -> &'static str {
        "multi-step-inverse"
    }

    fn about(&self) -> &'static str {
        "the action taken is predicted from the latent there and the latent some steps later; no reward (AC-State, ACRO); the encoder sees no actions"
    }

    fn options(&self) -> &'static [Declared] {
        &[STEPS]
    }

    fn steps(&self) -> Option<&'static Declared> {
        Some(&STEPS)
    }

    fn networks(&self, options: &Settings, actions: usize) -> Networks {
        let input = 2 * options.latent + most_steps(options);
        let head = HeadConfig { name: HEAD.to_owned(), input, output: actions };
        Networks { heads: vec![head], blind_to_actions: true, ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn rewards_shape_latents(&self) -> bool {
        false
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, rng: &mut ChaCha8Rng) -> Result<Value> {
        let (length, batch, most) = (scene.batch.length, scene.batch.batch, most_steps(scene.options));
        let counted = to_values(scene.batch.counted.clone());
        let pairs = Pairs::draw(length, batch, most, rng).that(|row| counted[row] > 0.0);
        let device = scene.means.device();
        let rows = |x: &Tensor<3>, rows: &[i32]| {
            let indices = Tensor::<1, Int>::from_data(TensorData::new(rows.to_vec(), [rows.len()]), &device);
            let width = x.dims()[2];
            x.clone().reshape([length * batch, width]).select(0, indices)
        };
        let mut distance = vec![0.0_f32; pairs.steps.len() * most];
        for (row, steps) in distance.chunks_exact_mut(most).zip(&pairs.steps) {
            row[steps - 1] = 1.0;
        }
        let distance = Tensor::<2>::from_data(TensorData::new(distance, [pairs.steps.len(), most]), &device);
        let input = vec![rows(&scene.means, &pairs.earlier), rows(&scene.means, &pairs.later), distance];
        let predictions = scene.world.head(HEAD)?.forward(Tensor::cat(input, 1));
        let loss = inverse::loss(predictions, rows(&scene.batch.actions, &pairs.earlier));
        Ok(models_apart(scene).less("inverse_loss", loss))
    }
}

fn most_steps(options: &Settings) -> usize {
    options.own.whole(&STEPS) as usize
}
