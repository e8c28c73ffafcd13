//! A model-free learner on disk. In: a learner. Out: files in a checkpoint's folder, from which it goes on exactly where it stopped.
//!
//! ```text
//! sac.safetensors             networks, with their configuration in the metadata
//! sac_optimizer.safetensors   Adam's moments of each group of parameters
//! sac.json                    Adam's steps of each group
//! ```

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use burn::tensor::Device;
use vibes_model::checkpoint::{load_tensors, save_tensors};
use vibes_model::parameters::read_parameters;
use vibes_model::sac::SacNetworks;
use vibes_model::sac::networks::FILE as NETWORKS;

use super::update::{Optimizers, SacLearner};
use crate::error::{Result, TrainError, io, malformed};
use crate::json::write_json;
use crate::learners::optimizer::Optimizer;

const MOMENTS: &str = "sac_optimizer.safetensors";
const STEPS: &str = "sac.json";

impl Optimizers {
    /// Each with the name its moments have on disk.
    fn named(&mut self) -> [(&'static str, &mut Optimizer); 4] {
        let Self { critic, further, actor, temperature } = self;
        [("critic", critic), ("further", further), ("actor", actor), ("temperature", temperature)]
    }
}

impl SacLearner {
    /// Writes everything that is needed to go on into a folder. Never a network whose last step overflowed: it would take the place of the last good checkpoint.
    ///
    /// # Errors
    /// A weight is no number, or the folder cannot be written.
    pub fn save(&self, folder: &Path) -> Result<()> {
        let mut weights = read_parameters(&self.networks.critic, "critic");
        if let Some(actor) = &self.networks.actor {
            weights.extend(read_parameters(actor, "actor"));
        }
        if let Some(value) = weights.values().flat_map(|tensor| &tensor.values).find(|value| !value.is_finite()) {
            return Err(TrainError::NotFinite { what: "a weight", value: *value });
        }
        self.networks.save(&folder.join(NETWORKS))?;
        let (mut moments, mut steps) = (BTreeMap::new(), BTreeMap::new());
        for (name, optimizer) in self.optimizers.clone().named() {
            moments.extend(optimizer.to_tensors(name));
            steps.insert(name, optimizer.steps());
        }
        save_tensors(&folder.join(MOMENTS), &moments, HashMap::new())?;
        write_json(&folder.join(STEPS), &steps)
    }

    /// The learner that was saved there.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn load(folder: &Path, device: &Device) -> Result<Self> {
        let mut learner = Self::new(SacNetworks::load(&folder.join(NETWORKS), device)?, device);
        let (moments, _) = load_tensors(&folder.join(MOMENTS))?;
        let file = folder.join(STEPS);
        let text = std::fs::read_to_string(&file).map_err(io("read", &file))?;
        let steps: BTreeMap<String, u64> = serde_json::from_str(&text)
            .map_err(|error| malformed(&file, error, "Adam's steps of each group of parameters"))?;
        for (name, optimizer) in learner.optimizers.named() {
            optimizer.restore(name, &moments, steps.get(name).copied().unwrap_or(0), device);
        }
        Ok(learner)
    }
}
