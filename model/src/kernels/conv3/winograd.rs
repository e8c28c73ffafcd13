//! 3×3 convolutions of stride 1 from 32 to 32 channels as sixteen matrix products, with 4/9 of the multiplications.
//!
//! In: channels-last maps of one frame and transformed weights. Out: the next map, or the products of the weights' gradient. Two neighbouring outputs of a three-tap
//! filter need four products instead of six (Winograd's minimal filtering F(2, 3)):
//!
//! ```text
//! m0 = (d0 − d2)·g0    m1 = (d1 + d2)·(g0 + g1 + g2)/2    m2 = (d2 − d1)·(g0 − g1 + g2)/2    m3 = (d1 − d3)·g2
//! y0 = m0 + m1 + m2    y1 = m1 − m2 − m3
//! ```
//!
//! and in two dimensions sixteen instead of thirty-six for a tile of 2×2 outputs from 4×4 inputs. Tiles are worked on a band of rows at a time, which stays in cache. The
//! gradients are the transposed maps, with the same saving.

use super::geometry::FILTERS;
use crate::kernels::instructions::Instructions;
use crate::kernels::lanes::{LANES, Lanes, with_lanes};
use crate::kernels::memory::Buffer;
use crate::kernels::product::Left;

/// Products of a tile.
pub(super) const PRODUCTS: usize = 16;
/// Numbers of one transformed kernel plane.
const PLANE: usize = FILTERS * FILTERS;
/// Numbers of a layer's transformed weights.
pub(super) const WEIGHTS: usize = PRODUCTS * PLANE;
/// Tiles of a band, about: enough rows for full products, few enough to stay in cache.
const TILES: usize = 48;

/// What is done to the sums of an output.
#[derive(Clone, Copy)]
pub(super) enum Finish<'a> {
    /// Bias and ReLU.
    Relu(&'a [f32]),
    /// Nothing.
    Plain,
}

/// A map of 32 channels: `[height, width, 32]`.
#[derive(Clone, Copy)]
pub(super) struct Map<'a> {
    pub(super) size: [usize; 2],
    pub(super) numbers: &'a [f32],
}

/// Tiles over an output, in bands of rows.
#[derive(Clone, Copy)]
struct Tiles {
    output: [usize; 2],
    across: usize,
}

/// Rows of tiles.
#[derive(Clone, Copy)]
struct Band {
    from: usize,
    to: usize,
}

impl Tiles {
    fn over(output: [usize; 2]) -> Self {
        Self { output, across: output[1].div_ceil(2) }
    }

    fn bands(self) -> impl Iterator<Item = Band> {
        let (down, high) = (self.output[0].div_ceil(2), (TILES / self.across).max(1));
        (0..down).step_by(high).map(move |from| Band { from, to: down.min(from + high) })
    }

    /// Tiles of a band.
    fn count(self, band: Band) -> usize {
        (band.to - band.from) * self.across
    }
}

/// Room for the factors and the products of one band.
pub(super) struct Room {
    factors: Buffer,
    products: Buffer,
}

impl Room {
    /// Room for outputs up to this width.
    pub(super) fn new(width: usize) -> Self {
        let len = PRODUCTS * FILTERS * TILES.max(width.div_ceil(2));
        Self { factors: Buffer::stale(len), products: Buffer::stale(len) }
    }
}

/// The convolution of a map, two rows and columns smaller than it.
pub(super) fn convolve(
    input: Map<'_>,
    weights: &[f32],
    finish: Finish<'_>,
    output: &mut [f32],
    room: &mut Room,
    instructions: Instructions,
) {
    let tiles = Tiles::over(input.size.map(|size| size - 2));
    for band in tiles.bands() {
        let plane = tiles.count(band) * FILTERS;
        with_lanes!(instructions, spread_inputs(input, tiles, band, &mut room.factors[..PRODUCTS * plane]));
        let pairs = room.factors[..PRODUCTS * plane].chunks_exact(plane).zip(weights.chunks_exact(PLANE));
        for ((factors, weights), products) in pairs.zip(room.products.chunks_exact_mut(plane)) {
            let left = Left::<FILTERS, 1> { data: factors, outer: 1, outer_step: 0, inner: FILTERS };
            left.times(weights, plane / FILTERS, products, false, instructions);
        }
        with_lanes!(instructions, gather_outputs(&room.products[..PRODUCTS * plane], tiles, band, finish, output));
    }
}

/// Adds the products of the weights' gradient, `[16, 32, 32]`, from the input and the output's gradient.
pub(super) fn weight_products(
    input: Map<'_>,
    gradient: &[f32],
    sums: &mut [f32],
    room: &mut Room,
    instructions: Instructions,
) {
    let tiles = Tiles::over(input.size.map(|size| size - 2));
    for band in tiles.bands() {
        let count = tiles.count(band);
        let plane = count * FILTERS;
        with_lanes!(instructions, spread_inputs(input, tiles, band, &mut room.factors[..PRODUCTS * plane]));
        with_lanes!(instructions, spread_gradients(gradient, tiles, band, &mut room.products[..PRODUCTS * plane]));
        let pairs = room.factors.chunks_exact(plane).zip(room.products.chunks_exact(plane));
        for ((factors, products), sums) in pairs.zip(sums.chunks_exact_mut(PLANE)) {
            Left::turned(factors, count).times(products, FILTERS, sums, true, instructions);
        }
    }
}

/// Four inputs to four factors along one axis.
#[inline(always)]
fn spread<V: Lanes>([a, b, c, d]: [V; 4]) -> [V; 4] {
    [a.minus(c), b.plus(c), c.minus(b), b.minus(d)]
}

/// Four products to two outputs along one axis.
#[inline(always)]
fn gather<V: Lanes>([a, b, c, d]: [V; 4]) -> [V; 2] {
    [a.plus(b).plus(c), b.minus(c).minus(d)]
}

/// Its transpose.
#[inline(always)]
fn gather_back<V: Lanes>(a: V, b: V) -> [V; 4] {
    [a, a.plus(b), a.minus(b), V::zero().minus(b)]
}

/// The sixteen numbers at a position of a map, zeros beyond its edge.
#[inline(always)]
fn number<V: Lanes>(map: &[f32], [height, width]: [usize; 2], [row, column]: [usize; 2], part: usize) -> V {
    if row < height && column < width { V::at(map, (row * width + column) * FILTERS + part) } else { V::zero() }
}

/// Factors of all tiles of a band: sixteen matrices `[tiles, 32]`.
#[inline(always)]
fn spread_inputs<V: Lanes>(input: Map<'_>, tiles: Tiles, band: Band, factors: &mut [f32]) {
    let plane = tiles.count(band) * FILTERS;
    for tile in 0..tiles.count(band) {
        let (top, left) = (2 * (band.from + tile / tiles.across), 2 * (tile % tiles.across));
        for part in (0..FILTERS).step_by(LANES) {
            let mut lines = [[V::zero(); 4]; 4];
            for (i, line) in lines.iter_mut().enumerate() {
                let at = |j: usize| number::<V>(input.numbers, input.size, [top + i, left + j], part);
                *line = spread([at(0), at(1), at(2), at(3)]);
            }
            let [first, second, third, fourth] = lines;
            for (j, (((a, b), c), d)) in first.into_iter().zip(second).zip(third).zip(fourth).enumerate() {
                for (i, value) in spread([a, b, c, d]).into_iter().enumerate() {
                    value.put(factors, (4 * i + j) * plane + tile * FILTERS + part);
                }
            }
        }
    }
}

/// Gradients of the products of all tiles of a band, from the gradient of the outputs.
#[inline(always)]
fn spread_gradients<V: Lanes>(gradient: &[f32], tiles: Tiles, band: Band, products: &mut [f32]) {
    let plane = tiles.count(band) * FILTERS;
    for tile in 0..tiles.count(band) {
        let (top, left) = (2 * (band.from + tile / tiles.across), 2 * (tile % tiles.across));
        for part in (0..FILTERS).step_by(LANES) {
            let at = |i: usize, j: usize| number::<V>(gradient, tiles.output, [top + i, left + j], part);
            let (upper, lower) = (gather_back(at(0, 0), at(0, 1)), gather_back(at(1, 0), at(1, 1)));
            for j in 0..4 {
                for (i, value) in gather_back(upper[j], lower[j]).into_iter().enumerate() {
                    value.put(products, (4 * i + j) * plane + tile * FILTERS + part);
                }
            }
        }
    }
}

/// Outputs of all tiles of a band from their products.
#[inline(always)]
fn gather_outputs<V: Lanes>(products: &[f32], tiles: Tiles, band: Band, finish: Finish<'_>, output: &mut [f32]) {
    let plane = tiles.count(band) * FILTERS;
    let [height, width] = tiles.output;
    for tile in 0..tiles.count(band) {
        let (top, left) = (2 * (band.from + tile / tiles.across), 2 * (tile % tiles.across));
        for part in (0..FILTERS).step_by(LANES) {
            let at = |i: usize, j: usize| V::at(products, (4 * i + j) * plane + tile * FILTERS + part);
            let mut columns = [[V::zero(); 2]; 4];
            for (j, column) in columns.iter_mut().enumerate() {
                *column = gather([at(0, j), at(1, j), at(2, j), at(3, j)]);
            }
            let [first, second, third, fourth] = columns;
            for (i, (((a, b), c), d)) in first.into_iter().zip(second).zip(third).zip(fourth).enumerate() {
                for (j, value) in gather([a, b, c, d]).into_iter().enumerate() {
                    if top + i < height && left + j < width {
                        let value = match finish {
                            Finish::Relu(bias) => value.plus(V::at(bias, part)).positive(),
                            Finish::Plain => value,
                        };
                        value.put(output, ((top + i) * width + left + j) * FILTERS + part);
                    }
                }
            }
        }
    }
}

/// Transformed weights `[16, in, 32]` from Burn's `[32, 32, 3, 3]`; turned round, they are those of the input's gradient, `[16, filter, in]`.
pub(super) fn transformed(weight: &[f32], turned: bool) -> Buffer {
    let mut made = Buffer::stale(WEIGHTS);
    for (at, taps) in weight.chunks_exact(9).enumerate() {
        let (filter, channel) = (at / FILTERS, at % FILTERS);
        let tap = |row: usize, column: usize| if turned { taps[8 - 3 * row - column] } else { taps[3 * row + column] };
        let place = if turned { filter * FILTERS + channel } else { channel * FILTERS + filter };
        let lines = [0, 1, 2].map(|row| kernel([tap(row, 0), tap(row, 1), tap(row, 2)]));
        for j in 0..4 {
            for (i, value) in kernel([lines[0][j], lines[1][j], lines[2][j]]).into_iter().enumerate() {
                made[(4 * i + j) * PLANE + place] = value;
            }
        }
    }
    made
}

/// The weights' gradient in Burn's order, from the shares' sums of products, added in their order.
pub(super) fn gradient(shares: &[&Buffer]) -> Vec<f32> {
    let mut gradient = vec![0.0; FILTERS * FILTERS * 9];
    for (at, taps) in gradient.chunks_exact_mut(9).enumerate() {
        let place = at % FILTERS * FILTERS + at / FILTERS;
        let sum = |i: usize, j: usize| shares.iter().map(|share| share[(4 * i + j) * PLANE + place]).sum::<f32>();
        let columns = [0, 1, 2, 3].map(|j| kernel_back([sum(0, j), sum(1, j), sum(2, j), sum(3, j)]));
        for row in 0..3 {
            let line = kernel_back([columns[0][row], columns[1][row], columns[2][row], columns[3][row]]);
            taps[3 * row..3 * row + 3].copy_from_slice(&line);
        }
    }
    gradient
}

/// Three taps to four factors along one axis.
fn kernel([a, b, c]: [f32; 3]) -> [f32; 4] {
    [a, (a + b + c) * 0.5, (a - b + c) * 0.5, c]
}

/// Its transpose.
fn kernel_back([a, b, c, d]: [f32; 4]) -> [f32; 3] {
    [a + (b + c) * 0.5, (b - c) * 0.5, (b + c) * 0.5 + d]
}
