//! 3×3 convolutions of stride 1 from 32 to 32 channels as thirty-six matrix products, with a quarter of the multiplications.
//!
//! In: channels-last maps of one frame and transformed weights. Out: the next map, or the products of the weights' gradient. Four neighbouring outputs of a three-tap
//! filter need six products instead of twelve: they are the values of a product of polynomials at 0, ±1, ±2 and infinity (Winograd's minimal filtering F(4, 3); Lavin and
//! Gray, "Fast Algorithms for Convolutional Neural Networks"),
//!
//! ```text
//! y = Aᵀ [(G g) ∘ (Bᵀ d)]
//! ```
//!
//! and in two dimensions thirty-six instead of a hundred and forty-four for a tile of 4×4 outputs from 6×6 inputs. Tiles are worked on a band of rows at a time, which
//! stays in cache. The gradients are the transposed maps, with the same saving. Factors of up to 8 stand beside the sums, which costs some accuracy; the
//! tests hold four layers to 1e-5 of the plain float32 operations.

use super::geometry::FILTERS;
use crate::kernels::instructions::Instructions;
use crate::kernels::lanes::with_lanes;
use crate::kernels::memory::Buffer;
use crate::kernels::product::Left;

mod transforms;
use transforms::{gather_outputs, spread_gradients, spread_inputs};

/// Outputs along a tile's side.
const OUTPUTS: usize = 4;
/// Factors along a tile's side, and inputs that it sees.
const FACTORS: usize = 6;

/// Products of a tile.
pub(super) const PRODUCTS: usize = FACTORS * FACTORS;
/// Numbers of one transformed kernel plane.
const PLANE: usize = FILTERS * FILTERS;
/// Numbers of a layer's transformed weights.
pub(super) const WEIGHTS: usize = PRODUCTS * PLANE;
/// Tiles of a band, about: enough rows for full products, few enough to stay in cache.
const TILES: usize = 32;

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
        Self { output, across: output[1].div_ceil(OUTPUTS) }
    }

    fn bands(self) -> impl Iterator<Item = Band> {
        let (down, high) = (self.output[0].div_ceil(OUTPUTS), (TILES / self.across).max(1));
        (0..down).step_by(high).map(move |from| Band { from, to: down.min(from + high) })
    }

    /// Tiles of a band.
    #[inline(always)]
    fn count(self, band: Band) -> usize {
        (band.to - band.from) * self.across
    }

    /// Row and column where a tile of a band begins, in its outputs and in the inputs that it sees.
    #[inline(always)]
    fn corner(self, band: Band, tile: usize) -> [usize; 2] {
        [OUTPUTS * (band.from + tile / self.across), OUTPUTS * (tile % self.across)]
    }

    /// Whether a tile's outputs all lie on the map.
    #[inline(always)]
    fn is_whole(self, [top, left]: [usize; 2]) -> bool {
        top + OUTPUTS <= self.output[0] && left + OUTPUTS <= self.output[1]
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
        let len = PRODUCTS * FILTERS * TILES.max(width.div_ceil(OUTPUTS));
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
            let left = Left::<FILTERS, 1>::lines(factors, 1, 0, FILTERS);
            left.times(weights, plane / FILTERS, products, false, instructions);
        }
        with_lanes!(instructions, gather_outputs(&room.products[..PRODUCTS * plane], tiles, band, finish, output));
    }
}

/// Adds the products of the weights' gradient, `[36, 32, 32]`, from the input and the output's gradient.
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

/// Transformed weights `[36, in, 32]` from Burn's `[32, 32, 3, 3]`; turned round, they are those of the input's gradient, `[36, filter, in]`.
pub(super) fn transformed(weight: &[f32], turned: bool) -> Buffer {
    let mut made = Buffer::stale(WEIGHTS);
    for (at, taps) in weight.chunks_exact(9).enumerate() {
        let (filter, channel) = (at / FILTERS, at % FILTERS);
        let tap = |row: usize, column: usize| if turned { taps[8 - 3 * row - column] } else { taps[3 * row + column] };
        let place = if turned { filter * FILTERS + channel } else { channel * FILTERS + filter };
        let lines = [0, 1, 2].map(|row| kernel([tap(row, 0), tap(row, 1), tap(row, 2)]));
        for j in 0..FACTORS {
            for (i, value) in kernel([lines[0][j], lines[1][j], lines[2][j]]).into_iter().enumerate() {
                made[(FACTORS * i + j) * PLANE + place] = value;
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
        let sum = |i: usize, j: usize| shares.iter().map(|share| share[(FACTORS * i + j) * PLANE + place]).sum::<f32>();
        let column = |j: usize| kernel_back([0, 1, 2, 3, 4, 5].map(|i| sum(i, j)));
        let columns = [0, 1, 2, 3, 4, 5].map(column);
        for row in 0..3 {
            taps[3 * row..3 * row + 3].copy_from_slice(&kernel_back(columns.map(|column| column[row])));
        }
    }
    gradient
}

/// Three taps to six factors along one axis.
fn kernel([a, b, c]: [f32; 3]) -> [f32; FACTORS] {
    let (ones, twos) = ((a + c) / -6.0, a / 24.0 + c / 6.0);
    [a / 4.0, ones - b / 6.0, ones + b / 6.0, twos + b / 12.0, twos - b / 12.0, c]
}

/// Its transpose.
fn kernel_back([a, b, c, d, e, f]: [f32; FACTORS]) -> [f32; 3] {
    let (ones, twos) = ((b + c) / 6.0, d + e);
    [a / 4.0 - ones + twos / 24.0, (c - b) / 6.0 + (d - e) / 12.0, f - ones + twos / 6.0]
}
