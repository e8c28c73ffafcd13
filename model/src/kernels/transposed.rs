//! Transposed 4×4 convolutions of stride 2: feature maps to maps twice as large, for the decoder.
//!
//! In: `[frames, height, width, in]` maps, weights and a bias. Out: `[frames, 2·height + 2 + padding, 2·width + 2 + padding, out]`.

use burn::tensor::Tensor;

use super::{Instructions, TransposedLayer, plain};

mod layout;
mod maps;
mod operation;
#[cfg(test)]
mod tests;

/// The layer's output, channels last. Differentiable in the maps, the weights and the bias. On `flex` it runs as one operation.
///
/// # Panics
/// If the channel counts do not follow from each other.
pub fn transposed(maps: Tensor<4>, layer: &TransposedLayer) -> Tensor<4> {
    operation::transposed(&maps, layer, Instructions::best()).unwrap_or_else(|| plain::transposed(maps, layer))
}
