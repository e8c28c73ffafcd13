//! Single numbers of a world model that are learned like its weights, by name: the temperature of a contrast, the logarithm of a dual variable. In: a name and a first
//! value. Out: a parameter that is trained, saved and read with the rest.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use crate::init::constant;

/// Name and first value of a [`Number`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NumberConfig {
    /// What it is found by.
    pub name: String,
    /// Its first value.
    pub start: f32,
}

/// A learned number with a name.
#[derive(Module, Debug)]
pub struct Number {
    #[module(skip)]
    name: String,
    /// `[1]`
    pub value: Param<Tensor<1>>,
}

impl NumberConfig {
    /// The number at its first value.
    pub fn init(&self, device: &Device) -> Number {
        Number { name: self.name.clone(), value: constant([1], self.start, device) }
    }
}

impl Number {
    /// What it is found by.
    pub fn name(&self) -> &str {
        &self.name
    }
}
