//! Deep bisimulation for control (`facebookresearch/deep_bisim4control`): latents differ, dimension by dimension, as much as rewards and predicted next latents do.
//!
//! ```text
//! L = Σ log p(r_t | s_t, a_t) − ½ mean (h(z_i − z_j) − h(r_i − r_j) − γ W₂(p(·|z_i, a_i), p(·|z_j, a_j)))² − transition loss
//! ```
//!
//! The latents keep the length the encoder gives them: a distance per dimension has no meaning on a sphere. The reward is read from (s, a) as everywhere here, where
//! DBC reads it from the predicted next latent.

use burn::tensor::{Int, Tensor, TensorData};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use vibes_model::gaussian::LatentForm;

use super::deepmdp::Transition;
use super::steps::{Steps, dynamics_apart};
use super::{Definition, Networks, Pictures, Rival, Value};
use crate::error::Result;
use crate::learners::losses::{dbc, transition};
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::{Declared, Kind};

/// The objective.
#[derive(Debug)]
pub struct Dbc;

/// Discount of the distances.
pub const DISCOUNT: Declared = Declared {
    flag: "metric-discount",
    kind: Kind::Number { default: 0.99 },
    help: "Discount γ of the next distance in the bisimulation metrics (dbc, mico, simsr)",
};

impl Definition for Dbc {
    fn name(&self) -> &'static str {
        "dbc"
    }

    fn about(&self) -> &'static str {
        "latents lie as far apart, per dimension, as rewards and predicted next latents differ (deep bisimulation for control); latents are not normalised"
    }

    fn options(&self) -> &'static [Declared] {
        &[DISCOUNT]
    }

    fn networks(&self, options: &Settings, actions: usize) -> Networks {
        Networks { heads: vec![Transition::head(options, actions)], latents: LatentForm::Raw, ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = Steps::of(scene);
        let next = Transition::predict(scene, &steps)?;
        let mut partners: Vec<i32> = (0..steps.rewards.dims()[0] as i32).collect();
        partners.shuffle(rng);
        let count = partners.len();
        let partners = Tensor::<1, Int>::from_data(TensorData::new(partners, [count]), &steps.now.device());
        let discount = scene.options.own.number(&DISCOUNT) as f32;
        let metric = dbc::loss(steps.now.clone(), &steps.rewards, &next, &partners, discount);
        let model = transition::latent(&next, steps.next);
        Ok(dynamics_apart(scene).less("metric_loss", metric).less("transition_loss", model))
    }
}
