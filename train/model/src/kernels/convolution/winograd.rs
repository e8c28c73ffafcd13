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
    lanes::{LANES, Lanes, with_lanes},
    memory::Buffer,
    product::{Left, PANEL},
};

/// Numbers of Winograd products per tile.
pub(super) const PRODUCTS: usize = 9;

/// Cells to factors along one axis.
#[inline(always)]
fn spread<V: Lanes>(a: V, b: V, c: V) -> [V; 3] {
    [a.minus(b), b, b.minus(c)]
}

/// Its transpose: gradients of factors to gradients of cells.
#[inline(always)]
fn spread_back<V: Lanes>([a, b, c]: [V; 3]) -> [V; 3] {
    [a, b.plus(c).minus(a), V::zero().minus(c)]
}

/// Products to outputs along one axis.
#[inline(always)]
fn gather<V: Lanes>([a, b, c]: [V; 3]) -> [V; 2] {
    [a.plus(b), b.minus(c)]
}

/// Its transpose: gradients of outputs to gradients of products.
#[inline(always)]
fn gather_back<V: Lanes>(a: V, b: V) -> [V; 3] {
    [a, a.plus(b), V::zero().minus(b)]
}

/// What lies at a place, or zero beyond an edge.
#[inline(always)]
fn value<V: Lanes>(from: &[f32], place: Option<usize>, offset: usize) -> V {
    match place {
        Some(place) => V::at(from, place + offset),
        None => V::zero(),
    }
}

/// Factors along one line of cells.
#[inline(always)]
fn cell_line<V: Lanes>(places: &[Option<usize>; 3], input: &[f32], offset: usize) -> [V; 3] {
    let [a, b, c] = *places;
    spread(value(input, a, offset), value(input, b, offset), value(input, c, offset))
}

/// Line `i` of the nine products or factors of a tile.
#[inline(always)]
fn product_line<V: Lanes>(from: &[f32], plane: usize, i: usize, at: usize) -> [V; 3] {
    [V::at(from, 3 * i * plane + at), V::at(from, (3 * i + 1) * plane + at), V::at(from, (3 * i + 2) * plane + at)]
}

/// The gradient where ReLU was open.
#[inline(always)]
fn open<V: Lanes>(output: &[f32], gradient: &[f32], place: Option<usize>, offset: usize) -> V {
    value::<V>(gradient, place, offset).where_open(value(output, place, offset))
}

/// The factors of all tiles: nine matrices `[tiles, 4·channels]` in panels.
#[inline(always)]
fn factors<V: Lanes>(layer: &Layer, frames: usize, input: &[f32], factors: &mut [f32]) {
    let tiles = frames * layer.tiles();
    let plane = layer.cell_width() * tiles;
    let places: Vec<_> = (0..layer.tiles()).map(|tile| layer.cells(tile)).collect();
    for (frame, input) in input.chunks_exact(layer.input_len()).take(frames).enumerate() {
        for (tile, [top, middle, bottom]) in places.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for part in (0..layer.cell_width()).step_by(LANES) {
                let offset = layer.cell_offset(part);
                let top = cell_line::<V>(top, input, offset);
                let middle = cell_line::<V>(middle, input, offset);
                let bottom = cell_line::<V>(bottom, input, offset);
                let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                for j in 0..3 {
                    let column = spread(top[j], middle[j], bottom[j]);
                    for (i, value) in column.into_iter().enumerate() {
                        value.put(factors, (3 * i + j) * plane + at);
                    }
                }
            }
        }
    }
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

#[inline(always)]
fn outputs<V: Lanes>(layer: &Layer, frames: usize, summed: &[f32], bias: &[f32], output: &mut [f32]) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.panelled_channels();
    let places: Vec<_> = (0..layer.tiles()).map(|tile| layer.spots(tile)).collect();
    for (frame, output) in output.chunks_exact_mut(layer.output_len()).take(frames).enumerate() {
        for (tile, spots) in places.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for part in (0..layer.output_stride()).step_by(LANES) {
                let bias = V::at(bias, part);
                let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                let top = gather(product_line::<V>(summed, plane, 0, at));
                let middle = gather(product_line::<V>(summed, plane, 1, at));
                let bottom = gather(product_line::<V>(summed, plane, 2, at));
                for j in 0..2 {
                    for (i, value) in gather([top[j], middle[j], bottom[j]]).into_iter().enumerate() {
                        if let Some(spot) = spots[i][j] {
                            value.plus(bias).positive().put(output, spot + part);
                        }
                    }
                }
            }
        }
    }
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

/// Gradients of the nine products; where ReLU was shut there is none. Adds the bias's.
#[inline(always)]
fn output_gradients<V: Lanes>(
    layer: &Layer,
    frames: usize,
    [output, gradient]: [&[f32]; 2],
    summed: &mut [f32],
    bias: &mut [f32],
) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.panelled_channels();
    let places: Vec<_> = (0..layer.tiles()).map(|tile| layer.spots(tile)).collect();
    let pairs = output.chunks_exact(layer.output_len()).zip(gradient.chunks_exact(layer.output_len()));
    for (frame, (output, gradient)) in pairs.take(frames).enumerate() {
        for (tile, spots) in places.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for part in (0..layer.output_stride()).step_by(LANES) {
                let top = [open::<V>(output, gradient, spots[0][0], part), open(output, gradient, spots[0][1], part)];
                let bottom =
                    [open::<V>(output, gradient, spots[1][0], part), open(output, gradient, spots[1][1], part)];
                let sum = top[0].plus(top[1]).plus(bottom[0].plus(bottom[1]));
                V::at(bias, part).plus(sum).put(bias, part);
                let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                let (top, bottom) = (gather_back(top[0], top[1]), gather_back(bottom[0], bottom[1]));
                for j in 0..3 {
                    for (i, value) in gather_back(top[j], bottom[j]).into_iter().enumerate() {
                        value.put(summed, (3 * i + j) * plane + at);
                    }
                }
            }
        }
    }
}

/// Gradients of the factors to gradients of the layer's input.
#[inline(always)]
fn input_gradients<V: Lanes>(layer: &Layer, frames: usize, spread: &[f32], gradient: &mut [f32]) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.cell_width();
    let places: Vec<_> = (0..layer.tiles()).map(|tile| layer.cells(tile)).collect();
    for (frame, gradient) in gradient.chunks_exact_mut(layer.input_len()).take(frames).enumerate() {
        gradient.fill(0.0);
        for (tile, cells) in places.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for part in (0..layer.cell_width()).step_by(LANES) {
                let offset = layer.cell_offset(part);
                let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                let top = spread_back(product_line::<V>(spread, plane, 0, at));
                let middle = spread_back(product_line::<V>(spread, plane, 1, at));
                let bottom = spread_back(product_line::<V>(spread, plane, 2, at));
                for j in 0..3 {
                    let column = spread_back([top[j], middle[j], bottom[j]]);
                    for (i, value) in column.into_iter().enumerate() {
                        if let Some(cell) = cells[i][j] {
                            V::at(gradient, cell + offset).plus(value).put(gradient, cell + offset);
                        }
                    }
                }
            }
        }
    }
}
