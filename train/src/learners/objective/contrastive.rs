//! Which picture of the batch comes next, recognised from what the dynamics remember (apple/ml-core's form of next-feature contrast). No reward
//! shapes the latents, and none of `CoRe`'s other terms is here.
//!
//! ```text
//! L = − ½ [cross entropy over rows + over columns] of softplus(τ) y_i · x_j,   y_t = f(h_t),  x_t: features of the picture o_t
//! ```
//!
//! Features are of single pictures, before any memory, so that past actions give nothing away. The models of dynamics and reward stand beside it: the dynamics'
//! hidden state is shaped by this loss, their predictions learn apart from the latents.

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use vibes_model::HeadConfig;
use vibes_model::numbers::NumberConfig;

use super::steps::{Steps, models_apart};
use super::{Definition, Networks, Pictures, Rival, Value};
use crate::error::Result;
use crate::learners::losses::contrast;
use crate::learners::scene::Scene;
use crate::settings::Settings;

/// The objective.
#[derive(Debug)]
pub struct Contrastive;

const HEAD: &str = "next feature";
const TEMPERATURE: &str = "contrast temperature";

impl Definition for Contrastive {
    fn name(&self) -> &'static str {
        "contrastive"
    }

    fn about(&self) -> &'static str {
        "the next picture's features must be recognised among those of the whole batch, from what the dynamics remember; no reward (CoRe's contrastive term)"
    }

    fn networks(&self, options: &Settings, _actions: usize) -> Networks {
        let head = HeadConfig { name: HEAD.to_owned(), input: options.hidden, output: options.hidden };
        let number = NumberConfig { name: TEMPERATURE.to_owned(), start: 1.0 };
        Networks { heads: vec![head], numbers: vec![number], ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn rewards_shape_latents(&self) -> bool {
        false
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = Steps::of(scene);
        let pairs = scene.batch.length - 1;
        let after_first = |x: &Tensor<3>| x.clone().narrow(0, 1, pairs);
        let predictions = scene.world.head(HEAD)?.forward(steps.choose(after_first(scene.states())));
        let features = steps.choose(after_first(&scene.features));
        // Both by the root of their width, so that the first logits are of the size of one.
        let width = (features.dims()[1] as f32).sqrt();
        let loss = contrast::next_feature(predictions / width, features, scene.world.number(TEMPERATURE)?);
        Ok(models_apart(scene).less("contrastive_loss", loss))
    }
}
