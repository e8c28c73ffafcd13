//! Weights between Burn's order and the kernels'.
//!
//! In: `[out, in, 4, 4]` weights, or summed gradients in the kernels' order. Out: the other. For the pixel layer the kernels' order is panels
//! `[48, PANEL]` over output channels; for the others nine transformed matrices `[4·channels, out]`, panel by panel.

use rayon::prelude::*;

use super::geometry::{Layer, Planes, padded};
use super::pixels::{COLORS, KERNEL};
use super::winograd::PRODUCTS;
use crate::kernels::{instructions::Instructions, lanes::LANES, memory::Buffer, product::PANEL};

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
pub(super) fn planes(layer: &Layer, weight: &[f32], bias: &[f32], turned: bool, instructions: Instructions) -> Planes {
    let [k, n] = layer.product();
    let mut padded_bias = Buffer::zeros(n);
    padded_bias[..bias.len()].copy_from_slice(bias);
    // Only what fills up panels has to be zero.
    let is_full = layer.in_channels == layer.input_stride() && layer.out_channels == n;
    let mut made = if is_full { Buffer::stale(PRODUCTS * k * n) } else { Buffer::zeros(PRODUCTS * k * n) };
    let chunk = PRODUCTS * PANEL * if turned { n } else { k };
    made.par_chunks_exact_mut(chunk).enumerate().for_each(|(panel, made)| {
        instructions.run(
            #[inline(always)]
            || if turned { turned_panel(layer, weight, panel, made) } else { panel_of(layer, weight, panel, made) },
        );
    });
    let (weights, turned) = if turned { (Buffer::zeros(0), made) } else { (made, Buffer::zeros(0)) };
    Planes { weights, turned, bias: padded_bias }
}

/// Which taps of a kernel fall on number `cell` of the 2×2 cells: g00, g01, g10, g11.
#[inline(always)]
fn cell_taps(cell: usize) -> [usize; 4] {
    let first = cell / 2 * 4 + cell % 2;
    [first, first + 2, first + 8, first + 10]
}

/// The nine factors of four taps, of `N` kernels side by side: along each axis g0, g0 + g1, g1.
#[inline(always)]
fn spread<const N: usize>([a, b, c, d]: [&[f32; N]; 4]) -> [[f32; N]; PRODUCTS] {
    let mut rows = [[0.0; N]; PRODUCTS];
    for lane in 0..N {
        let [a, b, c, d] = [a[lane], b[lane], c[lane], d[lane]];
        let factors = [a, a + b, b, a + c, (a + b) + (c + d), b + d, c, c + d, d];
        for index in 0..PRODUCTS {
            rows[index][lane] = factors[index];
        }
    }
    rows
}

/// One panel of output channels.
#[inline(always)]
fn panel_of(layer: &Layer, weight: &[f32], panel: usize, made: &mut [f32]) {
    let [k, _] = layer.product();
    let outs = panel * PANEL..layer.out_channels.min((panel + 1) * PANEL);
    let mut taps = [[0.0; PANEL]; TAPS];
    for c in 0..layer.in_channels {
        for (lane, n) in outs.clone().enumerate() {
            let kernel = &weight[(n * layer.in_channels + c) * TAPS..][..TAPS];
            for tap in 0..TAPS {
                taps[tap][lane] = kernel[tap];
            }
        }
        for cell in 0..4 {
            let [first, second, third, fourth] = cell_taps(cell);
            let rows = spread([&taps[first], &taps[second], &taps[third], &taps[fourth]]);
            for (index, row) in rows.iter().enumerate() {
                made[(index * k + cell * padded(layer.in_channels) + c) * PANEL..][..PANEL].copy_from_slice(row);
            }
        }
    }
}

/// One panel of input numbers. Sixteen neighbours are channels of one cell.
#[inline(always)]
fn turned_panel(layer: &Layer, weight: &[f32], panel: usize, made: &mut [f32]) {
    let [_, width] = layer.product();
    let stride = padded(layer.in_channels);
    for n in 0..layer.out_channels {
        let kernels = &weight[n * layer.in_channels * TAPS..][..layer.in_channels * TAPS];
        for part in (0..PANEL).step_by(LANES) {
            let [cell, from] = [(panel * PANEL + part) / stride, (panel * PANEL + part) % stride];
            let mut taps = [[0.0; LANES]; 4];
            let (places, kernels) = (cell_taps(cell), kernels.chunks_exact(TAPS).skip(from));
            for (lane, kernel) in kernels.take(LANES).enumerate() {
                for tap in 0..4 {
                    taps[tap][lane] = kernel[places[tap]];
                }
            }
            for (index, row) in spread(taps.each_ref()).iter().enumerate() {
                made[(index * width + n) * PANEL + part..][..LANES].copy_from_slice(row);
            }
        }
    }
}

/// Room for a later layer's gradients, in the order of [`planes`]; only the bias's are zeros.
pub(super) fn sums(layer: &Layer) -> Planes {
    let [k, n] = layer.product();
    Planes { weights: Buffer::stale(PRODUCTS * k * n), turned: Buffer::zeros(0), bias: Buffer::zeros(n) }
}

/// Gradient of a later layer's weight in Burn's order, from the shares' sums, added in their order.
pub(super) fn gradient(layer: &Layer, shares: &[&Planes], instructions: Instructions) -> Vec<f32> {
    let width = layer.in_channels * TAPS;
    let mut gradient = vec![0.0; layer.out_channels * width];
    gradient.par_chunks_mut(PANEL * width).enumerate().for_each(|(panel, gradient)| {
        instructions.run(
            #[inline(always)]
            || panel_gradient(layer, shares, panel, gradient),
        );
    });
    gradient
}

/// The kernels' gradients of one panel of output channels.
#[inline(always)]
fn panel_gradient(layer: &Layer, shares: &[&Planes], panel: usize, gradient: &mut [f32]) {
    let ([k, _], width) = (layer.product(), layer.in_channels * TAPS);
    for c in 0..layer.in_channels {
        let mut taps = [[0.0; PANEL]; TAPS];
        for cell in 0..4 {
            let rows = summed_rows(shares, panel * PRODUCTS * k + cell * padded(layer.in_channels) + c, k);
            for (tap, place) in cell_taps(cell).into_iter().enumerate() {
                let first = tap / 2 * 3 + tap % 2;
                for lane in 0..PANEL {
                    taps[place][lane] =
                        (rows[first][lane] + rows[first + 1][lane]) + (rows[first + 3][lane] + rows[first + 4][lane]);
                }
            }
        }
        for (lane, gradient) in gradient.chunks_exact_mut(width).enumerate() {
            let gradient = &mut gradient[c * TAPS..][..TAPS];
            for tap in 0..TAPS {
                gradient[tap] = taps[tap][lane];
            }
        }
    }
}

/// Row `row`, `row + step`, … of the nine matrices, summed over the shares.
#[inline(always)]
fn summed_rows(shares: &[&Planes], row: usize, step: usize) -> [[f32; PANEL]; PRODUCTS] {
    let mut rows = [[0.0; PANEL]; PRODUCTS];
    for share in shares {
        for (index, sum) in rows.iter_mut().enumerate() {
            let row = &share.weights[(row + index * step) * PANEL..][..PANEL];
            for lane in 0..PANEL {
                sum[lane] += row[lane];
            }
        }
    }
    rows
}

/// Gradient of a bias, from the shares' sums.
pub(super) fn bias_gradient(layer: &Layer, shares: &[&Planes]) -> Vec<f32> {
    (0..layer.out_channels).map(|n| shares.iter().map(|share| share.bias[n]).sum()).collect()
}
