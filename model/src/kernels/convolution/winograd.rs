//! A 4×4 convolution of stride 2 as nine matrix products, with 9/16 of the multiplications.
//!
//! In: channels-last activations of some frames and transformed weights. Out: the next activations, or all gradients.
//!
//! Pixels are taken in 2×2 cells, which turns the kernel into 2×2 taps on cells of `4·channels` numbers. Two neighbouring outputs of
//! a two-tap filter need three products instead of four (Winograd's minimal filtering F(2, 2)):
//!
//! ```text
//! m0 = (d0 − d1)·g0    m1 = d1·(g0 + g1)    m2 = (d1 − d2)·g1    y0 = m0 + m1    y1 = m1 − m2
//! ```
//!
//! and in two dimensions nine instead of sixteen for a tile of 2×2 outputs from 3×3 cells. Only sums and differences surround the
//! products, so the rounding error stays that of float32. The gradients are the transposed maps, with the same saving.

use super::geometry::{Layer, Planes};
use crate::kernels::{
    instructions::Instructions,
    lanes::with_lanes,
    memory::Buffer,
    product::{Left, PANEL},
};

mod transforms;
use transforms::{factors, input_gradients, output_gradients, outputs};

/// Numbers of Winograd products per tile.
pub(super) const PRODUCTS: usize = 9;

/// `out[p] = left[p] · weights[p]` for the nine products; `[rows, k]` times `[k, n]`.
fn products(
    rows: usize,
    [k, n]: [usize; 2],
    left: &[f32],
    weights: &[f32],
    out: &mut [f32],
    instructions: Instructions,
) {
    for index in 0..PRODUCTS {
        let left = Left::panels(&left[index * rows * k..][..rows * k], rows, k);
        let out = out[index * rows * n..][..rows * n].chunks_exact_mut(rows * PANEL);
        for (panel, out) in out.enumerate() {
            let weights = &weights[(panel * PRODUCTS + index) * k * PANEL..][..k * PANEL];
            left.times(weights, rows, out, false, instructions);
        }
    }
}

/// The layer's output for `frames` frames: convolution, bias, ReLU.
pub(super) fn forward(
    layer: &Layer,
    frames: usize,
    input: &[f32],
    planes: &Planes,
    output: &mut [f32],
    instructions: Instructions,
) {
    let (tiles, [k, n]) = (frames * layer.tiles(), layer.product());
    let mut spread = Buffer::stale(PRODUCTS * tiles * k);
    with_lanes!(instructions, factors(layer, frames, input, &mut spread));
    let mut summed = Buffer::stale(PRODUCTS * tiles * n);
    products(tiles, [k, n], &spread, &planes.weights, &mut summed, instructions);
    with_lanes!(instructions, outputs(layer, frames, &summed, &planes.bias, output));
}

/// Gradients of one layer for `frames` frames, from the gradient of its output (after ReLU). `sums` are added to, except that the
/// weights' are set if these are the `first` frames; `input_gradient` is set.
pub(super) fn backward(
    layer: &Layer,
    frames: usize,
    [input, output]: [&[f32]; 2],
    output_gradient: &[f32],
    planes: &Planes,
    (sums, first): (&mut Planes, bool),
    input_gradient: &mut [f32],
    instructions: Instructions,
) {
    let (tiles, [k, n]) = (frames * layer.tiles(), layer.product());
    let mut summed = Buffer::stale(PRODUCTS * tiles * n);
    if layer.output_stride() < layer.panelled_channels() {
        summed.fill(0.0);
    }
    let activations = [output, output_gradient];
    with_lanes!(instructions, output_gradients(layer, frames, activations, &mut summed, &mut sums.bias));
    let mut spread = Buffer::stale(PRODUCTS * tiles * k);
    with_lanes!(instructions, factors(layer, frames, input, &mut spread));
    for index in 0..PRODUCTS {
        let spread = &spread[index * tiles * k..][..tiles * k];
        let panels = summed[index * tiles * n..][..tiles * n].chunks_exact(tiles * PANEL);
        for (panel, summed) in panels.enumerate() {
            let sums = &mut sums.weights[(panel * PRODUCTS + index) * k * PANEL..][..k * PANEL];
            let spread = spread.chunks_exact(tiles * PANEL);
            for (spread, sums) in spread.zip(sums.chunks_exact_mut(PANEL * PANEL)) {
                Left::turned(spread, tiles).times(summed, PANEL, sums, !first, instructions);
            }
        }
    }
    products(tiles, [n, k], &summed, &planes.turned, &mut spread, instructions);
    with_lanes!(instructions, input_gradients(layer, frames, &spread, input_gradient));
}
