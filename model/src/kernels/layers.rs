//! The weights that the operations take, whichever way they run.

use burn::tensor::Tensor;

/// One 4×4 convolution of stride 2 without padding, followed by ReLU.
#[derive(Clone, Debug)]
pub struct ConvLayer {
    /// `[out_channels, in_channels, 4, 4]`, Burn's and PyTorch's order.
    pub weight: Tensor<4>,
    /// `[out_channels]`
    pub bias: Tensor<1>,
}

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

/// One 3×3 convolution without padding, followed by ReLU.
#[derive(Clone, Debug)]
pub struct Conv3Layer {
    /// `[out_channels, in_channels, 3, 3]`, Burn's and PyTorch's order.
    pub weight: Tensor<4>,
    /// `[out_channels]`
    pub bias: Tensor<1>,
}

/// Weights `[input, output]` and bias `[output]` of a layer.
pub type LayerWeights = (Tensor<2>, Tensor<1>);
