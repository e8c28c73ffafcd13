//! Weights between Burn's order and the kernels'.
//!
//! In: `[out, in, 4, 4]` weights, or summed gradients in the kernels' order. Out: the other. For the pixel layer the kernels' order is panels
//! `[48, PANEL]` over output channels; for the others nine transformed matrices `[4·channels, out]`, panel by panel.

use rayon::prelude::*;

use super::geometry::{Layer, Planes, padded};
use super::pixels::{COLORS, KERNEL};
use super::winograd::PRODUCTS;
use crate::kernels::{memory::Buffer, product::PANEL};

/// Numbers of one kernel: 4×4.
const TAPS: usize = 16;

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
    Planes { weights: Buffer::zeros(KERNEL * n), turned: Buffer::zeros(0), bias: Buffer::zeros(n) }
}

/// Gradient of the pixel layer's weight in Burn's order, from the shares' sums, added in their order.
pub(super) fn pixel_gradient(layer: &Layer, shares: &[&Planes]) -> Vec<f32> {
    let mut gradient = vec![0.0; layer.out_channels * COLORS * TAPS];
    for (n, gradient) in gradient.chunks_exact_mut(COLORS * TAPS).enumerate() {
        for (at, value) in gradient.iter_mut().enumerate() {
            let place = (n / PANEL * KERNEL + pixel_place(at)) * PANEL + n % PANEL;
            *value = shares.iter().map(|share| share.weights[place]).sum();
        }
    }
    gradient
}

/// From `[channel, row, column]` to `[row, column, channel]`.
fn pixel_place(at: usize) -> usize {
    at % TAPS * COLORS + at / TAPS
}

/// Transformed weights of a later layer: `[out panels][9][4·channels, PANEL]`, or turned round for the input's gradient
/// `[input panels][9][out, PANEL]`.
pub(super) fn planes(layer: &Layer, weight: &[f32], bias: &[f32], turned: bool) -> Planes {
    let [k, n] = layer.product();
    let mut padded_bias = Buffer::zeros(n);
    padded_bias[..bias.len()].copy_from_slice(bias);
    let mut made = Buffer::zeros(PRODUCTS * k * n);
    let chunk = PRODUCTS * PANEL * if turned { n } else { k };
    made.par_chunks_exact_mut(chunk).enumerate().for_each(|(panel, made)| {
        if turned {
            turned_panel(layer, weight, panel, made);
        } else {
            panel_of(layer, weight, panel, made);
        }
    });
    let (weights, turned) = if turned { (Buffer::zeros(0), made) } else { (made, Buffer::zeros(0)) };
    Planes { weights, turned, bias: padded_bias }
}

/// The four taps of a kernel that fall on number `cell` of the 2×2 cells: g00, g01, g10, g11.
fn cell_taps(taps: &[f32], cell: usize) -> [f32; 4] {
    let first = cell / 2 * 4 + cell % 2;
    [taps[first], taps[first + 2], taps[first + 8], taps[first + 10]]
}

/// The nine factors of four taps: along each axis g0, g0 + g1, g1.
fn spread([a, b, c, d]: [f32; 4]) -> [f32; PRODUCTS] {
    [a, a + b, b, a + c, (a + b) + (c + d), b + d, c, c + d, d]
}

/// One panel of output channels.
fn panel_of(layer: &Layer, weight: &[f32], panel: usize, made: &mut [f32]) {
    let [k, _] = layer.product();
    let outs = panel * PANEL..layer.out_channels.min((panel + 1) * PANEL);
    for c in 0..layer.in_channels {
        for cell in 0..4 {
            let mut rows = [[0.0; PANEL]; PRODUCTS];
            for (lane, n) in outs.clone().enumerate() {
                let taps = &weight[(n * layer.in_channels + c) * TAPS..][..TAPS];
                for (row, value) in rows.iter_mut().zip(spread(cell_taps(taps, cell))) {
                    row[lane] = value;
                }
            }
            for (index, row) in rows.iter().enumerate() {
                made[(index * k + cell * padded(layer.in_channels) + c) * PANEL..][..PANEL].copy_from_slice(row);
            }
        }
    }
}

/// One panel of input numbers.
fn turned_panel(layer: &Layer, weight: &[f32], panel: usize, made: &mut [f32]) {
    let [_, width] = layer.product();
    let stride = padded(layer.in_channels);
    for n in 0..layer.out_channels {
        let mut rows = [[0.0; PANEL]; PRODUCTS];
        for lane in 0..PANEL {
            let (cell, c) = ((panel * PANEL + lane) / stride, (panel * PANEL + lane) % stride);
            if c < layer.in_channels {
                let taps = &weight[(n * layer.in_channels + c) * TAPS..][..TAPS];
                for (row, value) in rows.iter_mut().zip(spread(cell_taps(taps, cell))) {
                    row[lane] = value;
                }
            }
        }
        for (index, row) in rows.iter().enumerate() {
            made[(index * width + n) * PANEL..][..PANEL].copy_from_slice(row);
        }
    }
}

/// Room for a later layer's gradients, in the order of [`planes`]; only the bias's are zeros.
pub(super) fn sums(layer: &Layer) -> Planes {
    let [k, n] = layer.product();
    Planes { weights: Buffer::stale(PRODUCTS * k * n), turned: Buffer::zeros(0), bias: Buffer::zeros(n) }
}

/// Gradient of a later layer's weight in Burn's order, from the shares' sums, added in their order.
pub(super) fn gradient(layer: &Layer, shares: &[&Planes]) -> Vec<f32> {
    let [k, _] = layer.product();
    let width = layer.in_channels * TAPS;
    let mut gradient = vec![0.0; layer.out_channels * width];
    gradient.par_chunks_mut(PANEL * width).enumerate().for_each(|(panel, gradient)| {
        for cell in 0..4 {
            for c in 0..layer.in_channels {
                let rows = summed_rows(shares, panel * PRODUCTS * k + cell * padded(layer.in_channels) + c, k);
                for (lane, gradient) in gradient.chunks_exact_mut(width).enumerate() {
                    for tap in 0..4 {
                        let first = tap / 2 * 3 + tap % 2;
                        let sum = (rows[first][lane] + rows[first + 1][lane])
                            + (rows[first + 3][lane] + rows[first + 4][lane]);
                        gradient[c * TAPS + (tap / 2 * 2 + cell / 2) * 4 + tap % 2 * 2 + cell % 2] = sum;
                    }
                }
            }
        }
    });
    gradient
}

/// Row `row`, `row + step`, … of the nine matrices, summed over the shares.
fn summed_rows(shares: &[&Planes], row: usize, step: usize) -> [[f32; PANEL]; PRODUCTS] {
    let mut rows = [[0.0; PANEL]; PRODUCTS];
    for share in shares {
        for (index, sum) in rows.iter_mut().enumerate() {
            let row = &share.weights[(row + index * step) * PANEL..][..PANEL];
            sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
    }
    rows
}

/// Gradient of a bias, from the shares' sums.
pub(super) fn bias_gradient(layer: &Layer, shares: &[&Planes]) -> Vec<f32> {
    (0..layer.out_channels).map(|n| shares.iter().map(|share| share.bias[n]).sum()).collect()
}
