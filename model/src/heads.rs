//! Further heads of a world model: perceptrons by name, for whatever an objective or an auxiliary term predicts beside the next latent and the reward
//! (the action between two latents, say). In: a name and two widths. Out: a perceptron that is trained, saved and read with the rest.

use burn::module::Module;
use burn::tensor::Device;
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::mlp::{Mlp, MlpConfig};

/// Name and sizes of a [`Head`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeadConfig {
    /// What it is found by.
    pub name: String,
    /// Width of the input.
    pub input: usize,
    /// Width of the output.
    pub output: usize,
}

/// A perceptron with a name.
#[derive(Module, Debug)]
pub struct Head {
    #[module(skip)]
    name: String,
    /// The perceptron itself.
    pub mlp: Mlp,
}

impl HeadConfig {
    /// He-initialised layers with hidden layers of width `hidden`.
    pub fn init(&self, hidden: usize, rng: &mut impl Rng, device: &Device) -> Head {
        let mlp = MlpConfig { input: self.input, hidden, output: self.output }.init(rng, device);
        Head { name: self.name.clone(), mlp }
    }
}

impl Head {
    /// What it is found by.
    pub fn name(&self) -> &str {
        &self.name
    }
}
