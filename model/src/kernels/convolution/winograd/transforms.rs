//! The sums and differences around the nine products.
//!
//! In: activations, products, or gradients of either. Out: factors of the products, activations, or their gradients. Each transform goes
//! through the tiles in order, sixteen channels at a time.

use crate::kernels::convolution::geometry::Layer;
use crate::kernels::lanes::{LANES, Lanes};
use crate::kernels::product::PANEL;

/// Cells to factors along one axis.
#[inline(always)]
fn spread<V: Lanes>(a: V, b: V, c: V) -> [V; 3] {
    [a.minus(b), b, b.minus(c)]
}

/// Its transpose: gradients of factors to gradients of cells.
#[inline(always)]
fn spread_back<V: Lanes>([a, b, c]: [V; 3]) -> [V; 3] {
    [a, b.plus(c).minus(a), c.opposite()]
}

/// Products to outputs along one axis.
#[inline(always)]
fn gather<V: Lanes>([a, b, c]: [V; 3]) -> [V; 2] {
    [a.plus(b), b.minus(c)]
}

/// Its transpose: gradients of outputs to gradients of products.
#[inline(always)]
fn gather_back<V: Lanes>(a: V, b: V) -> [V; 3] {
    [a, a.plus(b), b.opposite()]
}

/// What lies at a place, or zero beyond an edge.
#[inline(always)]
fn value<V: Lanes>(proof: V::Proof, from: &[f32], place: Option<usize>, offset: usize) -> V {
    match place {
        Some(place) => V::at(proof, from, place + offset),
        None => V::zero(proof),
    }
}

/// Factors along one line of cells.
#[inline(always)]
fn cell_line<V: Lanes>(proof: V::Proof, places: &[Option<usize>; 3], input: &[f32], offset: usize) -> [V; 3] {
    let [a, b, c] = *places;
    spread(value(proof, input, a, offset), value(proof, input, b, offset), value(proof, input, c, offset))
}

/// Line `i` of the nine products or factors of a tile.
#[inline(always)]
fn product_line<V: Lanes>(proof: V::Proof, from: &[f32], plane: usize, i: usize, at: usize) -> [V; 3] {
    let product = |j: usize| V::at(proof, from, (3 * i + j) * plane + at);
    [product(0), product(1), product(2)]
}

/// The gradient where ReLU was open.
#[inline(always)]
fn open<V: Lanes>(proof: V::Proof, [output, gradient]: [&[f32]; 2], place: Option<usize>, offset: usize) -> V {
    value::<V>(proof, gradient, place, offset).where_open(value(proof, output, place, offset))
}

/// The factors of all tiles: nine matrices `[tiles, 4·channels]` in panels.
#[inline(always)]
pub(super) fn factors<V: Lanes>(proof: V::Proof, layer: &Layer, frames: usize, input: &[f32], factors: &mut [f32]) {
    let tiles = frames * layer.tiles();
    let plane = layer.cell_width() * tiles;
    let places: Vec<_> = (0..layer.tiles()).map(|tile| layer.cells(tile)).collect();
    for (frame, input) in input.chunks_exact(layer.input_len()).take(frames).enumerate() {
        for (tile, [top, middle, bottom]) in places.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for part in (0..layer.cell_width()).step_by(LANES) {
                let offset = layer.cell_offset(part);
                let top = cell_line::<V>(proof, top, input, offset);
                let middle = cell_line::<V>(proof, middle, input, offset);
                let bottom = cell_line::<V>(proof, bottom, input, offset);
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

#[inline(always)]
pub(super) fn outputs<V: Lanes>(
    proof: V::Proof,
    layer: &Layer,
    frames: usize,
    summed: &[f32],
    bias: &[f32],
    output: &mut [f32],
) {
    let tiles = frames * layer.tiles();
    let plane = tiles * layer.panelled_channels();
    let places: Vec<_> = (0..layer.tiles()).map(|tile| layer.spots(tile)).collect();
    for (frame, output) in output.chunks_exact_mut(layer.output_len()).take(frames).enumerate() {
        for (tile, spots) in places.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for part in (0..layer.output_stride()).step_by(LANES) {
                let bias = V::at(proof, bias, part);
                let at = (part / PANEL * tiles + row) * PANEL + part % PANEL;
                let top = gather(product_line::<V>(proof, summed, plane, 0, at));
                let middle = gather(product_line::<V>(proof, summed, plane, 1, at));
                let bottom = gather(product_line::<V>(proof, summed, plane, 2, at));
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

/// Gradients of the nine products; where ReLU was shut there is none. Adds the bias's.
#[inline(always)]
pub(super) fn output_gradients<V: Lanes>(
    proof: V::Proof,
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
                let pair = [output, gradient];
                let top = [open::<V>(proof, pair, spots[0][0], part), open(proof, pair, spots[0][1], part)];
                let bottom = [open::<V>(proof, pair, spots[1][0], part), open(proof, pair, spots[1][1], part)];
                let sum = top[0].plus(top[1]).plus(bottom[0].plus(bottom[1]));
                V::at(proof, bias, part).plus(sum).put(bias, part);
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
pub(super) fn input_gradients<V: Lanes>(
    proof: V::Proof,
    layer: &Layer,
    frames: usize,
    spread: &[f32],
    gradient: &mut [f32],
) {
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
                let top = spread_back(product_line::<V>(proof, spread, plane, 0, at));
                let middle = spread_back(product_line::<V>(proof, spread, plane, 1, at));
                let bottom = spread_back(product_line::<V>(proof, spread, plane, 2, at));
                for j in 0..3 {
                    let column = spread_back([top[j], middle[j], bottom[j]]);
                    for (i, value) in column.into_iter().enumerate() {
                        if let Some(cell) = cells[i][j] {
                            V::at(proof, gradient, cell + offset).plus(value).put(gradient, cell + offset);
                        }
                    }
                }
            }
        }
    }
}
