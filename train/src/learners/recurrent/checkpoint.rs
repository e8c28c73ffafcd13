//! A recurrent learner on disk, as [`sac::checkpoint`](crate::learners::sac::checkpoint) has it: `recurrent.safetensors`, `recurrent_optimizer.safetensors`,
//! `recurrent.json`.

use std::path::Path;

use burn::tensor::Device;
use vibes_model::recurrent::RecurrentNetworks;
use vibes_model::recurrent::networks::FILE;

use super::update::{Optimizers, RecurrentLearner};
use crate::error::Result;
use crate::learners::moments::{self, Files};
use crate::learners::optimizer::{Counts, Optimizer, counts};

const FILES: Files = Files { moments: "recurrent_optimizer.safetensors", steps: "recurrent.json" };

impl Optimizers {
    /// Each with the name its moments have on disk.
    fn named(&mut self) -> [(&'static str, &mut Optimizer); 4] {
        let Self { model, critic, actor, temperature } = self;
        [("model", model), ("critic", critic), ("actor", actor), ("temperature", temperature)]
    }
}

impl RecurrentLearner {
    /// Writes everything that is needed to go on into a folder. Never a network whose last step overflowed: it would take the place of the last good checkpoint.
    ///
    /// # Errors
    /// A weight is no number, or the folder cannot be written.
    pub fn save(&self, folder: &Path) -> Result<()> {
        moments::finite(&self.networks.parameters())?;
        self.networks.save(&folder.join(FILE))?;
        moments::save(folder, FILES, &mut self.optimizers.clone().named())
    }

    /// The learner that was saved there.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn load(folder: &Path, device: &Device) -> Result<Self> {
        let mut learner = Self::new(RecurrentNetworks::load(&folder.join(FILE), device)?, device);
        let counts = counts_of(&learner.networks);
        moments::load(folder, FILES, learner.optimizers.named(), counts, device)?;
        Ok(learner)
    }
}

/// Of each group of parameters, as [`Optimizers::named`] has them.
fn counts_of(networks: &RecurrentNetworks) -> [Counts; 4] {
    let RecurrentNetworks { world, critic, actor, temperature, .. } = networks;
    [counts(world), counts(critic), counts(actor), counts(temperature)]
}
