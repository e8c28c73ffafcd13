//! Single numbers out of tensors, and that they are numbers: what an update measures, and what ends a run that has diverged.

use burn::tensor::Tensor;

use crate::error::{Result, TrainError};

/// The one number of a tensor.
pub fn scalar(value: &Tensor<1>) -> f32 {
    value.clone().into_scalar()
}

/// A quantity that must be a number.
///
/// # Errors
/// It is not.
pub fn finite(what: &'static str, value: f32) -> Result<f32> {
    if value.is_finite() { Ok(value) } else { Err(TrainError::NotFinite { what, value }) }
}
