//! Weights between Burn's order and the kernels'.
//!
//! In: `[out, in, 4, 4]` weights, or summed gradients in the kernels' order. Out: the other. For the pixel layer the kernels' order is panels
//! `[48, PANEL]` over output channels; for the others nine transformed matrices `[4·channels, out]` in panels.

use rayon::prelude::*;

use super::geometry::{Layer, Planes, padded};
use super::pixels::{COLORS, KERNEL};
use super::winograd::PRODUCTS;
use crate::kernels::{memory::Buffer, product::PANEL};

/// Numbers of one kernel: 4×4.
const TAPS: usize = 16;

/// The taps (of two) that make up factor `index` (of three): g0, g0 + g1, g1. The other way round, the factors that a tap is part of.
const PARTS: [&[usize]; 3] = [&[0], &[0, 1], &[1]];

/// Weights of the pixel layer.
pub(super) fn pixel_planes(layer: &Layer, weight: &[f32], bias: &[f32]) -> Planes {
    let mut planes = pixel_sums(layer);
    planes.bias[..bias.len()].copy_from_slice(bias);
    for (n, weight) in weight.chunks_exact(COLORS * TAPS).enumerate() {
        let panel = &mut planes.weights[n / PANEL * KERNEL * PANEL..];
        for (at, value) in weight.iter().enumerate() {
            panel[pixel_place(at) * PANEL + n % PANEL] = *value;
        }
    }
    planes
}

/// Zeros to add the pixel layer's gradients to.
pub(super) fn pixel_sums(layer: &Layer) -> Planes {
    let n = layer.panelled_channels();
    Planes {
        weights: Buffer::zeros(KERNEL * n),
        turned: Buffer::zeros(0),
        bias: Buffer::zeros(n),
    }
}

/// Gradient of the pixel layer's weight, in Burn's order.
pub(super) fn pixel_gradient(layer: &Layer, sums: &Planes) -> Vec<f32> {
    let mut gradient = vec![0.0; layer.out_channels * COLORS * TAPS];
    for (n, gradient) in gradient.chunks_exact_mut(COLORS * TAPS).enumerate() {
        let panel = &sums.weights[n / PANEL * KERNEL * PANEL..];
        for (at, value) in gradient.iter_mut().enumerate() {
            *value = panel[pixel_place(at) * PANEL + n % PANEL];
        }
    }
    gradient
}

/// From `[channel, row, column]` to `[row, column, channel]`.
fn pixel_place(at: usize) -> usize {
    at % TAPS * COLORS + at / TAPS
}

/// Transformed weights of a later layer; `turned` only if the input's gradient is wanted.
pub(super) fn planes(layer: &Layer, weight: &[f32], bias: &[f32], turned: bool) -> Planes {
    let [k, n] = layer.product();
    let mut plain = Buffer::zeros(PRODUCTS * k * n);
    plain
        .par_chunks_exact_mut(k * n)
        .enumerate()
        .for_each(|(index, plane)| {
            each_factor(layer, weight, index, |at, row, value| {
                let place = if turned {
                    (at / PANEL * n + row) * PANEL + at % PANEL
                } else {
                    (row / PANEL * k + at) * PANEL + row % PANEL
                };
                plane[place] = value;
            });
        });
    let (weights, turned) = if turned {
        (Buffer::zeros(0), plain)
    } else {
        (plain, Buffer::zeros(0))
    };
    let mut padded_bias = Buffer::zeros(n);
    padded_bias[..bias.len()].copy_from_slice(bias);
    Planes {
        weights,
        turned,
        bias: padded_bias,
    }
}

/// Calls `set(k, n, value)` for every number of factor matrix `index`.
fn each_factor(
    layer: &Layer,
    weight: &[f32],
    index: usize,
    mut set: impl FnMut(usize, usize, f32),
) {
    let (across, down) = (PARTS[index % 3], PARTS[index / 3]);
    let stride = padded(layer.in_channels);
    for (n, weight) in weight.chunks_exact(layer.in_channels * TAPS).enumerate() {
        for (c, taps) in weight.chunks_exact(TAPS).enumerate() {
            for cell in 0..4 {
                let (a, b) = (cell / 2, cell % 2);
                let value = down
                    .iter()
                    .flat_map(|u| {
                        across
                            .iter()
                            .map(move |v| taps[(2 * u + a) * 4 + 2 * v + b])
                    })
                    .sum();
                set(cell * stride + c, n, value);
            }
        }
    }
}

/// Zeros to add a later layer's gradients to.
pub(super) fn sums(layer: &Layer) -> Planes {
    let [k, n] = layer.product();
    Planes {
        weights: Buffer::zeros(PRODUCTS * k * n),
        turned: Buffer::zeros(0),
        bias: Buffer::zeros(n),
    }
}

/// Gradient of a later layer's weight, in Burn's order.
pub(super) fn gradient(layer: &Layer, sums: &Planes) -> Vec<f32> {
    let [k, n] = layer.product();
    let width = layer.in_channels * TAPS;
    let mut gradient = vec![0.0; layer.out_channels * width];
    gradient
        .par_chunks_mut(PANEL * width)
        .enumerate()
        .for_each(|(panel, gradient)| {
            for at in 0..k {
                let (cell, c) = (
                    at / padded(layer.in_channels),
                    at % padded(layer.in_channels),
                );
                if c >= layer.in_channels {
                    continue;
                }
                let row = |index: usize| {
                    &sums.weights[index * k * n + (panel * k + at) * PANEL..][..PANEL]
                };
                for tap in 0..4 {
                    let (u, v) = (tap / 2, tap % 2);
                    let rows = [(u, v), (u, v + 1), (u + 1, v), (u + 1, v + 1)]
                        .map(|(i, j)| row(3 * i + j));
                    let place = c * TAPS + (2 * u + cell / 2) * 4 + 2 * v + cell % 2;
                    for (lane, gradient) in gradient.chunks_exact_mut(width).enumerate() {
                        gradient[place] =
                            (rows[0][lane] + rows[1][lane]) + (rows[2][lane] + rows[3][lane]);
                    }
                }
            }
        });
    gradient
}
