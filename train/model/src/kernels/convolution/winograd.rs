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
    memory::Buffer,
    product::{Left, PANEL},
};

/// Numbers of Winograd products per tile.
pub(super) const PRODUCTS: usize = 9;

/// Lanes handled at once by the transforms.
const LANES: usize = 16;
type Vector = [f32; LANES];

#[inline(always)]
fn load(from: &[f32]) -> Vector {
    let mut vector = [0.0; LANES];
    vector.copy_from_slice(&from[..LANES]);
    vector
}

#[inline(always)]
fn map(a: Vector, b: Vector, f: impl Fn(f32, f32) -> f32) -> Vector {
    let mut out = [0.0; LANES];
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = f(a, b);
    }
    out
}

#[inline(always)]
fn plus(a: Vector, b: Vector) -> Vector {
    map(a, b, |a, b| a + b)
}

#[inline(always)]
fn minus(a: Vector, b: Vector) -> Vector {
    map(a, b, |a, b| a - b)
}

/// Cells to factors along one axis.
#[inline(always)]
fn spread([a, b, c]: [Vector; 3]) -> [Vector; 3] {
    [minus(a, b), b, minus(b, c)]
}

/// Its transpose: gradients of factors to gradients of cells.
#[inline(always)]
fn spread_back([a, b, c]: [Vector; 3]) -> [Vector; 3] {
    [a, minus(plus(b, c), a), minus([0.0; LANES], c)]
}

/// Products to outputs along one axis.
#[inline(always)]
fn gather([a, b, c]: [Vector; 3]) -> [Vector; 2] {
    [plus(a, b), minus(b, c)]
}

/// Its transpose: gradients of outputs to gradients of products.
#[inline(always)]
fn gather_back([a, b]: [Vector; 2]) -> [Vector; 3] {
    [a, plus(a, b), minus([0.0; LANES], b)]
}

/// Applies a map to the rows, then to the columns.
#[inline(always)]
fn both<const I: usize, const O: usize>(
    cells: [[Vector; I]; I],
    f: impl Fn([Vector; I]) -> [Vector; O],
) -> [[Vector; O]; O] {
    let mut rows = [[[0.0; LANES]; O]; I];
    for (row, cells) in rows.iter_mut().zip(cells) {
        *row = f(cells);
    }
    let mut out = [[[0.0; LANES]; O]; O];
    for column in 0..O {
        let mut line = [[0.0; LANES]; I];
        for (line, row) in line.iter_mut().zip(&rows) {
            *line = row[column];
        }
        for (out, value) in out.iter_mut().zip(f(line)) {
            out[column] = value;
        }
    }
    out
}

/// The factors of all tiles: nine matrices `[tiles, 4·channels]` in panels.
fn factors(
    layer: &Layer,
    frames: usize,
    input: &[f32],
    factors: &mut [f32],
    instructions: Instructions,
) {
    let tiles = frames * layer.tiles();
    let plane = layer.cell_width() * tiles;
    instructions.run(
        #[inline(always)]
        || {
            for (frame, input) in input
                .chunks_exact(layer.input_len())
                .take(frames)
                .enumerate()
            {
                for tile in 0..layer.tiles() {
                    let row = frame * layer.tiles() + tile;
                    let cells = layer.cells(tile);
                    for part in (0..layer.cell_width()).step_by(LANES) {
                        let offset = layer.cell_offset(part);
                        let cells = cells.map(|line| {
                            line.map(|at| at.map_or([0.0; LANES], |at| load(&input[at + offset..])))
                        });
                        let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                        for (index, value) in both(cells, spread).iter().flatten().enumerate() {
                            factors[index * plane + at..][..LANES].copy_from_slice(value);
                        }
                    }
                }
            }
        },
    );
}

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
        let weights = weights[index * k * n..][..k * n].chunks_exact(k * PANEL);
        for (weights, out) in
            weights.zip(out[index * rows * n..][..rows * n].chunks_exact_mut(rows * PANEL))
        {
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
    factors(layer, frames, input, &mut spread, instructions);
    let mut summed = Buffer::stale(PRODUCTS * tiles * n);
    products(
        tiles,
        [k, n],
        &spread,
        &planes.weights,
        &mut summed,
        instructions,
    );
    outputs(layer, frames, &summed, &planes.bias, output, instructions);
}

fn outputs(
    layer: &Layer,
    frames: usize,
    summed: &[f32],
    bias: &[f32],
    output: &mut [f32],
    instructions: Instructions,
) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.panelled_channels();
    instructions.run(
        #[inline(always)]
        || {
            for (frame, output) in output
                .chunks_exact_mut(layer.output_len())
                .take(frames)
                .enumerate()
            {
                for tile in 0..layer.tiles() {
                    let row = frame * layer.tiles() + tile;
                    let spots = layer.spots(tile);
                    for part in (0..layer.output_stride()).step_by(LANES) {
                        let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                        let mut values = [[[0.0; LANES]; 3]; 3];
                        for (index, value) in values.iter_mut().flatten().enumerate() {
                            *value = load(&summed[index * plane + at..]);
                        }
                        let bias = load(&bias[part..]);
                        let values = both(values, gather);
                        for (at, value) in spots.iter().flatten().zip(values.iter().flatten()) {
                            if let Some(at) = at.map(|at| at + part) {
                                let value =
                                    map(*value, bias, |value, bias| (value + bias).max(0.0));
                                output[at..at + LANES].copy_from_slice(&value);
                            }
                        }
                    }
                }
            }
        },
    );
}

/// Gradients of one layer for `frames` frames, from the gradient of its output (after ReLU). `weights` and `bias` are added to;
/// `input_gradient` is set.
pub(super) fn backward(
    layer: &Layer,
    frames: usize,
    [input, output]: [&[f32]; 2],
    output_gradient: &[f32],
    planes: &Planes,
    sums: &mut Planes,
    input_gradient: &mut [f32],
    instructions: Instructions,
) {
    let (tiles, [k, n]) = (frames * layer.tiles(), layer.product());
    let mut summed = Buffer::stale(PRODUCTS * tiles * n);
    output_gradients(
        layer,
        frames,
        output,
        output_gradient,
        &mut summed,
        &mut sums.bias,
        instructions,
    );
    let mut spread = Buffer::stale(PRODUCTS * tiles * k);
    factors(layer, frames, input, &mut spread, instructions);
    for index in 0..PRODUCTS {
        let spread = &spread[index * tiles * k..][..tiles * k];
        let panels = summed[index * tiles * n..][..tiles * n].chunks_exact(tiles * PANEL);
        for (summed, sums) in
            panels.zip(sums.weights[index * k * n..][..k * n].chunks_exact_mut(k * PANEL))
        {
            for (spread, sums) in spread
                .chunks_exact(tiles * PANEL)
                .zip(sums.chunks_exact_mut(PANEL * PANEL))
            {
                Left::turned(spread, tiles).times(summed, PANEL, sums, true, instructions);
            }
        }
    }
    products(
        tiles,
        [n, k],
        &summed,
        &planes.turned,
        &mut spread,
        instructions,
    );
    input_gradients(layer, frames, &spread, input_gradient, instructions);
}

/// Gradients of the nine products; where ReLU was shut there is none. Adds the bias's.
fn output_gradients(
    layer: &Layer,
    frames: usize,
    output: &[f32],
    gradient: &[f32],
    summed: &mut [f32],
    bias: &mut [f32],
    instructions: Instructions,
) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.panelled_channels();
    if layer.output_stride() < layer.panelled_channels() {
        summed.fill(0.0);
    }
    instructions.run(
        #[inline(always)]
        || {
            let frames = output
                .chunks_exact(layer.output_len())
                .zip(gradient.chunks_exact(layer.output_len()))
                .take(frames);
            for (frame, (output, gradient)) in frames.enumerate() {
                for tile in 0..layer.tiles() {
                    let row = frame * layer.tiles() + tile;
                    let spots = layer.spots(tile);
                    for part in (0..layer.output_stride()).step_by(LANES) {
                        let values = spots.map(|line| {
                            line.map(|at| {
                                at.map_or([0.0; LANES], |at| {
                                    map(
                                        load(&output[at + part..]),
                                        load(&gradient[at + part..]),
                                        |output, gradient| {
                                            if output > 0.0 { gradient } else { 0.0 }
                                        },
                                    )
                                })
                            })
                        });
                        let sum = values
                            .iter()
                            .flatten()
                            .fold(load(&bias[part..]), |sum, value| plus(sum, *value));
                        bias[part..part + LANES].copy_from_slice(&sum);
                        let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                        for (index, value) in both(values, gather_back).iter().flatten().enumerate()
                        {
                            summed[index * plane + at..][..LANES].copy_from_slice(value);
                        }
                    }
                }
            }
        },
    );
}

/// Gradients of the factors to gradients of the layer's input.
fn input_gradients(
    layer: &Layer,
    frames: usize,
    spread: &[f32],
    gradient: &mut [f32],
    instructions: Instructions,
) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.cell_width();
    instructions.run(
        #[inline(always)]
        || {
            for (frame, gradient) in gradient
                .chunks_exact_mut(layer.input_len())
                .take(frames)
                .enumerate()
            {
                gradient.fill(0.0);
                for tile in 0..layer.tiles() {
                    let row = frame * layer.tiles() + tile;
                    let cells = layer.cells(tile);
                    for part in (0..layer.cell_width()).step_by(LANES) {
                        let offset = layer.cell_offset(part);
                        let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                        let mut values = [[[0.0; LANES]; 3]; 3];
                        for (index, value) in values.iter_mut().flatten().enumerate() {
                            *value = load(&spread[index * plane + at..]);
                        }
                        let values = both(values, spread_back);
                        for (at, value) in cells.iter().flatten().zip(values.iter().flatten()) {
                            if let Some(at) = at.map(|at| at + offset) {
                                let sum = plus(load(&gradient[at..]), *value);
                                gradient[at..at + LANES].copy_from_slice(&sum);
                            }
                        }
                    }
                }
            }
        },
    );
}
