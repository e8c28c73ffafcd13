//! Transposed 4×4 convolutions of stride 2: feature maps to maps twice as large, for the decoder.
//!
//! In: `[frames, height, width, in]` maps, weights and a bias. Out: `[frames, 2·height + 2 + padding, 2·width + 2 + padding, out]`.

use burn::tensor::Tensor;

use super::{Instructions, plain};

mod layout;
mod maps;
mod operation;
#[cfg(test)]
mod tests;

/// One transposed 4×4 convolution of stride 2.
#[derive(Clone, Debug)]
pub struct TransposedLayer {
    /// `[in_channels, out_channels, 4, 4]`, Burn's and PyTorch's order.
    pub weight: Tensor<4>,
    /// `[out_channels]`
    pub bias: Tensor<1>,
    /// Rows and columns added at the far edge, which see the bias alone.
    pub padding: [usize; 2],
    /// Whether negative results become zero.
    pub relu: bool,
}

/// The layer's output, channels last. Differentiable in the maps, the weights and the bias. On `flex` it runs as one operation.
///
/// # Panics
/// If the channel counts do not follow from each other.
pub fn transposed(maps: Tensor<4>, layer: &TransposedLayer) -> Tensor<4> {
    operation::transposed(&maps, layer, Instructions::best()).unwrap_or_else(|| plain::transposed(maps, layer))
}
