//! A model-free learner on disk. In: a learner. Out: files in a checkpoint's folder, from which it goes on exactly where it stopped.
//!
//! ```text
//! sac.safetensors             networks, with their configuration in the metadata
//! sac_optimizer.safetensors   Adam's moments of each group of parameters
//! sac.json                    Adam's steps of each group
//! ```

use std::path::Path;

use burn::tensor::Device;
use vibes_model::sac::SacNetworks;
use vibes_model::sac::networks::FILE as NETWORKS;

use super::update::{Optimizers, SacLearner};
use crate::error::Result;
use crate::learners::moments::{self, Files};
use crate::learners::optimizer::{Counts, Optimizer, counts};

const FILES: Files = Files { moments: "sac_optimizer.safetensors", steps: "sac.json" };

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
        moments::finite(&self.networks.parameters())?;
        self.networks.save(&folder.join(NETWORKS))?;
        moments::save(folder, FILES, &mut self.optimizers.clone().named())
    }

    /// The learner that was saved there.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn load(folder: &Path, device: &Device) -> Result<Self> {
        let mut learner = Self::new(SacNetworks::load(&folder.join(NETWORKS), device)?, device);
        let counts = counts_of(&learner.networks);
        moments::load(folder, FILES, learner.optimizers.named(), counts, device)?;
        Ok(learner)
    }
}

/// Of each group of parameters, as [`Optimizers::named`] has them.
fn counts_of(networks: &SacNetworks) -> [Counts; 4] {
    let SacNetworks { critic, further, actor, temperature, .. } = networks;
    [counts(critic), counts(further), actor.as_ref().map(counts).unwrap_or_default(), counts(temperature)]
}
