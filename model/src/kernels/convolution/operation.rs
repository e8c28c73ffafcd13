//! The convolutions as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: a Burn tensor whose backward pass is [`Stack::backward`], or `None` where the custom path does not apply.

use std::sync::Arc;

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::{Int, Tensor};
use burn_flex::FlexTensor;

use super::geometry;
use super::pixels::COLORS;
use super::stack::{Stack, Weights};
use crate::kernels::ConvLayer;
use crate::kernels::flex::{self, Followed};
use crate::kernels::instructions::Instructions;
use crate::kernels::memory::Buffer;

/// See [`features`](super::features).
pub(super) fn features(pixels: &Tensor<4, Int>, layers: &[ConvLayer]) -> Option<Tensor<2>> {
    features_with(pixels, layers, Instructions::best())
}

/// The same with given instructions.
pub(super) fn features_with(
    pixels: &Tensor<4, Int>,
    layers: &[ConvLayer],
    instructions: Instructions,
) -> Option<Tensor<2>> {
    let [_, height, width, colors] = pixels.dims();
    if colors != COLORS || !flex::runs_on_flex(&pixels.device()) {
        return None;
    }
    let channels: Vec<[usize; 2]> = layers.iter().map(|layer| layer.weight.dims()).map(|[n, c, _, _]| [c, n]).collect();
    let kernels_fit = layers.iter().all(|layer| layer.weight.dims()[2..] == [4, 4]);
    if !kernels_fit || channels.first()?[0] != COLORS {
        return None;
    }
    let stack = Stack { layers: geometry::layers([height, width], &channels)?, instructions };
    let input = Input { stack, bytes: flex::bytes(pixels)? };
    let followed = layers.iter().any(|layer| layer.weight.device().is_autodiff() || layer.bias.device().is_autodiff());
    if followed { input.followed(layers) } else { input.unfollowed(layers) }
}

/// What the convolutions look at.
#[derive(Clone, Debug)]
struct Input {
    stack: Stack,
    bytes: FlexTensor,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
struct Kept {
    input: Input,
    weights: Vec<FlexTensor>,
    activations: Arc<Vec<Buffer>>,
}

impl Input {
    fn bytes(&self) -> &[u8] {
        self.bytes.as_slice().expect("bytes in one piece")
    }

    fn unfollowed(&self, layers: &[ConvLayer]) -> Option<Tensor<2>> {
        let mut weights = Vec::with_capacity(2 * layers.len());
        for layer in layers {
            weights.push(flex::unfollowed(layer.weight.clone())?);
            weights.push(flex::unfollowed(layer.bias.clone())?);
        }
        let activations = self.stack.forward(self.bytes(), &pairs(&weights));
        Some(Tensor::from_primitive::<Flex>(self.output(&activations)))
    }

    fn followed(self, layers: &[ConvLayer]) -> Option<Tensor<2>> {
        let mut weights = Vec::with_capacity(2 * layers.len());
        for layer in layers {
            weights.push(flex::followed(layer.weight.clone())?);
            weights.push(flex::followed(layer.bias.clone())?);
        }
        let output = match layers.len() {
            1 => self.record::<2>(weights),
            2 => self.record::<4>(weights),
            3 => self.record::<6>(weights),
            4 => self.record::<8>(weights),
            5 => self.record::<10>(weights),
            6 => self.record::<12>(weights),
            _ => None,
        };
        Some(Tensor::from_primitive::<Autodiff<Flex>>(output?))
    }

    /// Runs forward and records the backward step on `N` weights and biases.
    fn record<const N: usize>(self, weights: Vec<Followed>) -> Option<Followed> {
        let weights: [Followed; N] = weights.try_into().ok()?;
        let nodes = weights.each_ref().map(Followed::node);
        let weights: Vec<FlexTensor> =
            weights.into_iter().map(|weight| weight.into_primitive().to_contiguous()).collect();
        let activations = self.stack.forward(self.bytes(), &pairs(&weights));
        let output = self.output(&activations);
        Some(match Convolutions.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let kept = Kept { input: self, weights, activations: Arc::new(activations) };
                prepared.finish(kept, output)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(output),
        })
    }

    /// The last activations without padding.
    fn output(&self, activations: &[Buffer]) -> FlexTensor {
        let last = &self.stack.layers[self.stack.layers.len() - 1];
        let activations = &activations[activations.len() - 1];
        let numbers: Vec<f32> = activations
            .chunks_exact(last.output_stride())
            .flat_map(|channels| &channels[..last.out_channels])
            .copied()
            .collect();
        let frames = activations.len() / last.output_len();
        flex::tensor(numbers, [frames, last.output[0] * last.output[1] * last.out_channels])
    }
}

/// Weights and biases in turn, as pairs.
fn pairs(weights: &[FlexTensor]) -> Vec<Weights<'_>> {
    weights
        .chunks_exact(2)
        .map(|pair| Weights { weight: flex::numbers(&pair[0]), bias: flex::numbers(&pair[1]) })
        .collect()
}

/// The backward step.
#[derive(Debug)]
struct Convolutions;

impl<const N: usize> Backward<Flex, N> for Convolutions {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, N>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let kept = ops.state;
        let output = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let stack = &kept.input.stack;
        let last = &stack.layers[stack.layers.len() - 1];
        let mut padded = Buffer::stale(kept.activations[stack.layers.len() - 1].len());
        let positions = flex::numbers(&output).chunks_exact(last.out_channels);
        for (padded, position) in padded.chunks_exact_mut(last.output_stride()).zip(positions) {
            padded[..last.out_channels].copy_from_slice(position);
            padded[last.out_channels..].fill(0.0);
        }
        let found = stack.backward(kept.input.bytes(), &pairs(&kept.weights), &kept.activations, &padded);
        let found = found.into_iter().flat_map(|layer| [layer.weight, layer.bias]);
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        flex::register(gradients, parents, &kept.weights, found);
    }
}
