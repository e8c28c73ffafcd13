//! The same operations as ordinary Burn tensor operations: what every backend but `flex` runs, and what the kernels are tested against.
//!
//! In and out: as the functions of the same name in [`kernels`](super).

use burn::tensor::module::{conv_transpose2d, conv2d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn::tensor::{Int, Tensor, activation, module};

use super::{Conv3Layer, ConvLayer, LayerWeights, TransposedLayer};

/// Convolutional features of pixels, as [`features`](super::features) defines them.
pub fn features(pixels: Tensor<4, Int>, layers: &[ConvLayer]) -> Tensor<2> {
    let x = pixels.float().permute([0, 3, 1, 2]) / 255.0 - 0.5;
    let y = layers.iter().fold(x, |x, layer| {
        let options = ConvOptions::new([2, 2], [0, 0], [1, 1], 1);
        activation::relu(conv2d(x, layer.weight.clone(), Some(layer.bias.clone()), options))
    });
    y.permute([0, 2, 3, 1]).flatten(1, 3)
}

/// Convolutional features of stacked pictures, as [`conv3_features`](super::conv3_features) defines them.
pub fn conv3_features(pixels: Tensor<4, Int>, layers: &[Conv3Layer]) -> Tensor<2> {
    let x = pixels.float().permute([0, 3, 1, 2]) / 255.0;
    let y = layers.iter().enumerate().fold(x, |x, (index, layer)| {
        let stride = if index == 0 { 2 } else { 1 };
        let options = ConvOptions::new([stride, stride], [0, 0], [1, 1], 1);
        activation::relu(conv2d(x, layer.weight.clone(), Some(layer.bias.clone()), options))
    });
    y.permute([0, 2, 3, 1]).flatten(1, 3)
}

/// A transposed convolution, as [`transposed`](super::transposed()) defines it.
pub fn transposed(maps: Tensor<4>, layer: &TransposedLayer) -> Tensor<4> {
    let options = ConvTransposeOptions::new([2, 2], [0, 0], layer.padding, [1, 1], 1);
    let maps = maps.permute([0, 3, 1, 2]);
    let y = conv_transpose2d(maps, layer.weight.clone(), Some(layer.bias.clone()), options).permute([0, 2, 3, 1]);
    if layer.relu { activation::relu(y) } else { y }
}

/// Squared errors of pictures, as [`pixel_error`](super::pixel_error()) defines them.
pub fn pixel_error(pictures: Tensor<4>, pixels: Tensor<4, Int>) -> Tensor<1> {
    let errors: Tensor<2> = (pictures - (pixels.float() / 255.0 - 0.5)).flatten(1, 3);
    errors.square().sum_dim(1).squeeze_dim(1)
}

/// Hidden states of a GRU, as [`gru`](super::gru) defines them.
pub fn gru(
    gates: Tensor<3>,
    weight: Tensor<2>,
    bias: Tensor<1>,
    initial: Tensor<2>,
    keep: Option<Tensor<2>>,
) -> Tensor<3> {
    let [length, batch, _] = gates.dims();
    let width = initial.dims()[1];
    let bias = bias.unsqueeze::<2>();
    let mut state = initial;
    let mut states = Vec::with_capacity(length);
    for t in 0..length {
        if let Some(keep) = &keep {
            state = state * keep.clone().slice([t..t + 1, 0..batch]).reshape([batch, 1]);
        }
        let x = gates.clone().narrow(0, t, 1).squeeze_dim::<2>(0);
        let h = state.clone().matmul(weight.clone()) + bias.clone();
        let part = |tensor: &Tensor<2>, gate: usize| tensor.clone().slice([0..batch, gate * width..(gate + 1) * width]);
        let reset = activation::sigmoid(part(&x, 0) + part(&h, 0));
        let update = activation::sigmoid(part(&x, 1) + part(&h, 1));
        let candidate = (part(&x, 2) + reset * part(&h, 2)).tanh();
        state = candidate.clone() + update * (state - candidate);
        states.push(state.clone());
    }
    Tensor::stack(states, 0)
}

/// Three layers with ELU between them, as [`perceptron`](super::perceptron()) defines them.
pub fn perceptron(x: Tensor<2>, [first, second, last]: [LayerWeights; 3]) -> Tensor<2> {
    let linear = |x, (weight, bias): LayerWeights| module::linear(x, weight, Some(bias));
    linear(elu(linear(elu(linear(x, first)), second)), last)
}

/// `x` where it is positive, `exp(x) − 1` elsewhere. Burn's own takes the exponential of every number before it chooses, and so has the gradient 0 · ∞ for
/// numbers above 88, which a head whose output is normalised reaches in time.
pub fn elu<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    x.clone().clamp_min(0.0) + x.clamp_max(0.0).exp() - 1.0
}
