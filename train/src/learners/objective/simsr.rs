//! `SimSR` (bit1029public/SimSR) and nothing else: the cosine distance of two latents is that of their rewards and of their sampled successors.
//!
//! ```text
//! L = − mean Huber((1 − cos(z_i, z_j)) − |r_i − r_j| − γ (1 − cos(ẑ′_i, ẑ′_j))),   ẑ′ drawn from the dynamics
//! ```
//!
//! The successors come from the dynamics model that every objective here has, fitted apart from the latents, where `SimSR` has an ensemble of five.

use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use vibes_model::init::normal;

use super::dbc::DISCOUNT;
use super::steps::Steps;
use super::{Definition, Networks, Pictures, Rival, Value, Weights, no_adversary};
use crate::error::Result;
use crate::learners::losses::simsr;
use crate::learners::scene::{Scene, predict};
use crate::settings::Settings;
use crate::settings::own::Declared;

/// The objective.
#[derive(Debug)]
pub struct SimSr;

impl Definition for SimSr {
    fn name(&self) -> &'static str {
        "simsr"
    }

    fn about(&self) -> &'static str {
        "latents lie as far apart as rewards and sampled next latents differ, by their cosine (SimSR)"
    }

    fn reads(&self) -> &'static [Declared] {
        &[DISCOUNT]
    }

    fn networks(&self, _options: &Settings, _actions: usize) -> Networks {
        Networks::default()
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn rewards_shape_latents(&self) -> bool {
        false
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = Steps::of(scene);
        let fixed = scene.latents.clone().detach();
        let (predictions, _) = predict(scene.world, scene.batch, &fixed, fixed.clone());
        let mean = steps.choose(predictions.dynamics.mean.clone());
        let std = steps.choose(predictions.dynamics.std.clone());
        let noise = normal(mean.shape().num_elements(), rng);
        let noise = Tensor::<2>::from_data(TensorData::new(noise, mean.dims()), &mean.device());
        let discount = scene.options.own.number(&DISCOUNT) as f32;
        let loss = simsr::loss(&steps.now, mean + noise * std, &steps.rewards, discount);
        Ok(no_adversary::value(&predictions, Weights::of(scene)).less("metric_loss", loss))
    }
}
