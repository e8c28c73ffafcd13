//! The `MICo` distance between latents (google-research/google-research, mico) and nothing else: they keep what rewards, now or later, depend on.
//!
//! ```text
//! L = − mean Huber(U(z_i, sg z_j) − |r_i − r_j| − γ U(sg z′_i, sg z′_j)),   U(x, y) = ½ (|x|² + |y|²) + 0.1 angle(x, y)
//! ```
//!
//! Here the slow copy is the encoder itself without gradient: a second pass would double the cost of an update. The latents keep their length, which the distance
//! reads. The models of dynamics and reward stand beside it, apart from the latents.

use rand_chacha::ChaCha8Rng;
use vibes_model::gaussian::LatentForm;

use super::dbc::DISCOUNT;
use super::steps::{Steps, models_apart};
use super::{Definition, Networks, Pictures, Rival, Value};
use crate::error::Result;
use crate::learners::losses::mico;
use crate::learners::scene::Scene;
use crate::settings::Settings;
use crate::settings::own::Declared;

/// The objective.
#[derive(Debug)]
pub struct Mico;

impl Definition for Mico {
    fn name(&self) -> &'static str {
        "mico"
    }

    fn about(&self) -> &'static str {
        "latents lie as far apart as rewards and next latents differ, by the MICo distance; latents are not normalised"
    }

    fn reads(&self) -> &'static [Declared] {
        &[DISCOUNT]
    }

    fn networks(&self, _options: &Settings, _actions: usize) -> Networks {
        Networks { latents: LatentForm::Raw, ..Networks::default() }
    }

    fn pictures(&self, length: usize) -> Pictures {
        Pictures { encoded: length, decoded: 0 }
    }

    fn rewards_shape_latents(&self) -> bool {
        false
    }

    fn value(&self, scene: &Scene<'_>, _rival: Rival<'_>, _rng: &mut ChaCha8Rng) -> Result<Value> {
        let steps = Steps::of(scene);
        let discount = scene.options.own.number(&DISCOUNT) as f32;
        let loss = mico::loss(&steps.now, steps.now.clone(), steps.next.clone(), &steps.rewards, discount);
        Ok(models_apart(scene).less("metric_loss", loss))
    }
}
