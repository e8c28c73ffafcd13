//! The sums around the products: inputs and gradients to factors, products to outputs.
//!
//! In: maps of one frame, or products of a band of tiles. Out: `[36][tiles, 32]` factors, or a map. All work is on vectors of channels.

#![allow(
    clippy::needless_range_loop,
    reason = "an iterator over vector registers is a call that hands them over in memory"
)]

use super::{Band, FACTORS, Finish, Map, OUTPUTS, Tiles};
use crate::kernels::conv3::geometry::FILTERS;
use crate::kernels::lanes::{LANES, Lanes};

/// Six inputs to six factors along one axis.
#[inline(always)]
fn spread<V: Lanes>([a, b, c, d, e, f]: [V; FACTORS]) -> [V; FACTORS] {
    let (even, odd) = (e.plus_times(-4.0, c), d.plus_times(-4.0, b));
    let (near, far) = (e.minus(c), d.minus(b));
    [
        e.plus_times(-5.0, c).plus_times(4.0, a),
        even.plus(odd),
        even.minus(odd),
        near.plus_times(2.0, far),
        near.plus_times(-2.0, far),
        f.plus_times(-5.0, d).plus_times(4.0, b),
    ]
}

/// Six products to four outputs along one axis.
#[inline(always)]
fn gather<V: Lanes>([a, b, c, d, e, f]: [V; FACTORS]) -> [V; OUTPUTS] {
    let (ones, one) = (b.plus(c), b.minus(c));
    let (twos, two) = (d.plus(e), d.minus(e));
    [a.plus(ones).plus(twos), one.plus_times(2.0, two), ones.plus_times(4.0, twos), f.plus(one).plus_times(8.0, two)]
}

/// Its transpose.
#[inline(always)]
fn gather_back<V: Lanes>([a, b, c, d]: [V; OUTPUTS]) -> [V; FACTORS] {
    let (even, odd) = (a.plus(c), b.plus(d));
    let (wide, far) = (a.plus_times(4.0, c), b.plus_times(4.0, d));
    [a, even.plus(odd), even.minus(odd), wide.plus_times(2.0, far), wide.plus_times(-2.0, far), d]
}

/// A square of a map from `top`, `left` on, zeros beyond its edge; `inside` says that there is none.
#[inline(always)]
fn square<V: Lanes, const SIDE: usize>(
    proof: V::Proof,
    map: Map<'_>,
    [top, left]: [usize; 2],
    part: usize,
    inside: bool,
) -> [[V; SIDE]; SIDE] {
    let [height, width] = map.size;
    let mut square = [[V::zero(proof); SIDE]; SIDE];
    for i in 0..SIDE {
        for j in 0..SIDE {
            if inside || (top + i < height && left + j < width) {
                square[i][j] = V::at(proof, map.numbers, ((top + i) * width + left + j) * FILTERS + part);
            }
        }
    }
    square
}

/// A column of a square.
#[inline(always)]
fn column<V: Lanes, const WIDTH: usize, const HEIGHT: usize>(lines: &[[V; WIDTH]; HEIGHT], j: usize) -> [V; HEIGHT] {
    let mut column = [lines[0][j]; HEIGHT];
    for i in 0..HEIGHT {
        column[i] = lines[i][j];
    }
    column
}

/// Puts the factors of a tile, given line by line, where they belong: `[36][tiles, 32]`.
#[inline(always)]
fn put<V: Lanes>(factors: &mut [f32], plane: usize, at: usize, j: usize, values: [V; FACTORS]) {
    for i in 0..FACTORS {
        values[i].put(factors, (FACTORS * i + j) * plane + at);
    }
}

/// Factors of all tiles of a band.
#[inline(always)]
pub(super) fn spread_inputs<V: Lanes>(proof: V::Proof, input: Map<'_>, tiles: Tiles, band: Band, factors: &mut [f32]) {
    let plane = tiles.count(band) * FILTERS;
    for tile in 0..tiles.count(band) {
        let corner = tiles.corner(band, tile);
        let inside = corner[0] + FACTORS <= input.size[0] && corner[1] + FACTORS <= input.size[1];
        for part in (0..FILTERS).step_by(LANES) {
            let mut lines = if inside {
                square::<V, FACTORS>(proof, input, corner, part, true)
            } else {
                square::<V, FACTORS>(proof, input, corner, part, false)
            };
            for i in 0..FACTORS {
                lines[i] = spread(lines[i]);
            }
            for j in 0..FACTORS {
                put(factors, plane, tile * FILTERS + part, j, spread(column(&lines, j)));
            }
        }
    }
}

/// Gradients of the products of all tiles of a band, from the gradient of the outputs.
#[inline(always)]
pub(super) fn spread_gradients<V: Lanes>(
    proof: V::Proof,
    gradient: &[f32],
    tiles: Tiles,
    band: Band,
    products: &mut [f32],
) {
    let plane = tiles.count(band) * FILTERS;
    let gradient = Map { size: tiles.output, numbers: gradient };
    for tile in 0..tiles.count(band) {
        let corner = tiles.corner(band, tile);
        let inside = tiles.is_whole(corner);
        for part in (0..FILTERS).step_by(LANES) {
            let outputs = if inside {
                square::<V, OUTPUTS>(proof, gradient, corner, part, true)
            } else {
                square::<V, OUTPUTS>(proof, gradient, corner, part, false)
            };
            let mut lines = [[V::zero(proof); FACTORS]; OUTPUTS];
            for i in 0..OUTPUTS {
                lines[i] = gather_back(outputs[i]);
            }
            for j in 0..FACTORS {
                put(products, plane, tile * FILTERS + part, j, gather_back(column(&lines, j)));
            }
        }
    }
}

/// Outputs of all tiles of a band from their products.
#[inline(always)]
pub(super) fn gather_outputs<V: Lanes>(
    proof: V::Proof,
    products: &[f32],
    tiles: Tiles,
    band: Band,
    finish: Finish<'_>,
    output: &mut [f32],
) {
    let plane = tiles.count(band) * FILTERS;
    let [height, width] = tiles.output;
    for tile in 0..tiles.count(band) {
        let [top, left] = tiles.corner(band, tile);
        let whole = tiles.is_whole([top, left]);
        for part in (0..FILTERS).step_by(LANES) {
            let mut lines = [[V::zero(proof); OUTPUTS]; FACTORS];
            for i in 0..FACTORS {
                let mut line = [V::zero(proof); FACTORS];
                for j in 0..FACTORS {
                    line[j] = V::at(proof, products, (FACTORS * i + j) * plane + tile * FILTERS + part);
                }
                lines[i] = gather(line);
            }
            for j in 0..OUTPUTS {
                let values = gather(column(&lines, j));
                for i in 0..OUTPUTS {
                    if whole || (top + i < height && left + j < width) {
                        let value = match finish {
                            Finish::Relu(bias) => values[i].plus(V::at(proof, bias, part)).positive(),
                            Finish::Plain => values[i],
                        };
                        value.put(output, ((top + i) * width + left + j) * FILTERS + part);
                    }
                }
            }
        }
    }
}
