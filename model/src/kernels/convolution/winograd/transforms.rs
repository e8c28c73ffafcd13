//! The sums and differences around the nine products.
//!
//! In: activations, products, or gradients of either. Out: factors of the products, activations, or their gradients. Each transform goes
//! through the tiles in order, sixteen channels at a time.

use crate::kernels::convolution::geometry::Layer;
use crate::kernels::lanes::{LANES, Lanes, vectors, vectors_mut};
use crate::kernels::product::PANEL;

/// Sixteen numbers in memory.
type Vector = [f32; LANES];

/// Cells to factors along one axis.
#[inline(always)]
fn spread<V: Lanes>([a, b, c]: [V; 3]) -> [V; 3] {
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

/// The vectors from `place` on, as many as there are in `beyond`, or these where there is no place.
#[inline(always)]
fn found<'a>(numbers: &'a [f32], place: Option<usize>, beyond: &'a [Vector]) -> &'a [Vector] {
    match place {
        Some(place) => &vectors(&numbers[place..])[..beyond.len()],
        None => beyond,
    }
}

/// One line of three neighbouring cells, `skip` numbers after their starts.
#[inline(always)]
fn cell_line<'a>(
    input: &'a [f32],
    [a, b, c]: [Option<usize>; 3],
    skip: usize,
    beyond: &'a [Vector],
) -> [&'a [Vector]; 3] {
    let input = input.get(skip..).unwrap_or(&[]);
    [found(input, a, beyond), found(input, b, beyond), found(input, c, beyond)]
}

/// Two neighbouring outputs, and their gradients.
#[inline(always)]
fn spot_line<'a>(
    [output, gradient]: [&'a [f32]; 2],
    [left, right]: [Option<usize>; 2],
    beyond: &'a [Vector],
) -> [[&'a [Vector]; 2]; 2] {
    [
        [found(output, left, beyond), found(output, right, beyond)],
        [found(gradient, left, beyond), found(gradient, right, beyond)],
    ]
}

/// Number `at` of three rows of vectors.
#[inline(always)]
fn three<V: Lanes>(proof: V::Proof, [a, b, c]: [&[Vector]; 3], at: usize) -> [V; 3] {
    [V::load(proof, &a[at]), V::load(proof, &b[at]), V::load(proof, &c[at])]
}

/// The gradient where ReLU was open, of two neighbours.
#[inline(always)]
fn open<V: Lanes>(proof: V::Proof, [output, gradient]: [[&[Vector]; 2]; 2], at: usize) -> [V; 2] {
    let one =
        |output: &[Vector], gradient: &[Vector]| V::load(proof, &gradient[at]).where_open(V::load(proof, &output[at]));
    [one(output[0], gradient[0]), one(output[1], gradient[1])]
}

/// Where the vectors of a tile lie in every one of the nine planes.
#[derive(Clone, Copy)]
struct Places {
    tiles: usize,
    /// Vectors of a plane.
    plane: usize,
}

impl Places {
    #[inline(always)]
    fn of(tiles: usize, columns: usize) -> Self {
        Self { tiles, plane: tiles * columns / LANES }
    }

    /// Vector `part` of row `row`, in panels.
    #[inline(always)]
    fn at(self, row: usize, part: usize) -> usize {
        const PARTS: usize = PANEL / LANES;
        (part / PARTS * self.tiles + row) * PARTS + part % PARTS
    }

    /// The nine planes, three to a line. All have the same length for the compiler too, so that one check of a place holds for all.
    #[inline(always)]
    fn planes(self, numbers: &[f32]) -> [[&[Vector]; 3]; 3] {
        let numbers = vectors(numbers);
        let plane = |index: usize| &numbers[index * self.plane..][..self.plane];
        [[plane(0), plane(1), plane(2)], [plane(3), plane(4), plane(5)], [plane(6), plane(7), plane(8)]]
    }

    #[inline(always)]
    fn planes_mut(self, numbers: &mut [f32]) -> [[&mut [Vector]; 3]; 3] {
        let mut rest = vectors_mut(numbers);
        let mut plane = || {
            let (plane, others) = std::mem::take(&mut rest).split_at_mut(self.plane);
            rest = others;
            plane
        };
        [[plane(), plane(), plane()], [plane(), plane(), plane()], [plane(), plane(), plane()]]
    }
}

/// The factors of all tiles: nine matrices `[tiles, 4·channels]` in panels.
#[inline(always)]
pub(super) fn factors<V: Lanes>(proof: V::Proof, layer: &Layer, frames: usize, input: &[f32], factors: &mut [f32]) {
    let places = Places::of(frames * layer.tiles(), layer.cell_width());
    let planes = places.planes_mut(factors);
    let tiles: Vec<_> = (0..layer.tiles()).map(|tile| layer.cells(tile)).collect();
    let parts = layer.cell_line_len() / LANES;
    let beyond = vec![[0.0; LANES]; parts];
    for (frame, input) in input.chunks_exact(layer.input_len()).take(frames).enumerate() {
        for (tile, cells) in tiles.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for line in 0..2 {
                let skip = line * layer.input_line();
                let top = cell_line(input, cells[0], skip, &beyond);
                let middle = cell_line(input, cells[1], skip, &beyond);
                let bottom = cell_line(input, cells[2], skip, &beyond);
                for part in 0..parts {
                    let top = spread(three::<V>(proof, top, part));
                    let middle = spread(three::<V>(proof, middle, part));
                    let bottom = spread(three::<V>(proof, bottom, part));
                    let at = places.at(row, line * parts + part);
                    for j in 0..3 {
                        let column = spread([top[j], middle[j], bottom[j]]);
                        for i in 0..3 {
                            column[i].store(&mut planes[i][j][at]);
                        }
                    }
                }
            }
        }
    }
}

/// Outputs of all tiles from their nine products: bias and ReLU.
#[inline(always)]
pub(super) fn outputs<V: Lanes>(
    proof: V::Proof,
    layer: &Layer,
    frames: usize,
    summed: &[f32],
    bias: &[f32],
    output: &mut [f32],
) {
    let places = Places::of(frames * layer.tiles(), layer.panelled_channels());
    let planes = places.planes(summed);
    let tiles: Vec<_> = (0..layer.tiles()).map(|tile| layer.spots(tile)).collect();
    let bias = &vectors(bias)[..layer.output_stride() / LANES];
    for (frame, output) in output.chunks_exact_mut(layer.output_len()).take(frames).enumerate() {
        let output = vectors_mut(output);
        for (tile, spots) in tiles.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for (part, bias) in bias.iter().enumerate() {
                let bias = V::load(proof, bias);
                let at = places.at(row, part);
                let top = gather(three::<V>(proof, planes[0], at));
                let middle = gather(three::<V>(proof, planes[1], at));
                let bottom = gather(three::<V>(proof, planes[2], at));
                for j in 0..2 {
                    let column = gather([top[j], middle[j], bottom[j]]);
                    for i in 0..2 {
                        if let Some(spot) = spots[i][j] {
                            column[i].plus(bias).positive().store(&mut output[spot / LANES + part]);
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
    let places = Places::of(frames * layer.tiles(), layer.panelled_channels());
    let planes = places.planes_mut(summed);
    let tiles: Vec<_> = (0..layer.tiles()).map(|tile| layer.spots(tile)).collect();
    let parts = layer.output_stride() / LANES;
    let beyond = vec![[0.0; LANES]; parts];
    let bias = &mut vectors_mut(bias)[..parts];
    let pairs = output.chunks_exact(layer.output_len()).zip(gradient.chunks_exact(layer.output_len()));
    for (frame, (output, gradient)) in pairs.take(frames).enumerate() {
        for (tile, spots) in tiles.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            let pair = [output, gradient];
            let (top, bottom) = (spot_line(pair, spots[0], &beyond), spot_line(pair, spots[1], &beyond));
            for (part, bias) in bias.iter_mut().enumerate() {
                let (top, bottom) = (open::<V>(proof, top, part), open::<V>(proof, bottom, part));
                let sum = top[0].plus(top[1]).plus(bottom[0].plus(bottom[1]));
                V::load(proof, bias).plus(sum).store(bias);
                let at = places.at(row, part);
                let (top, bottom) = (gather_back(top[0], top[1]), gather_back(bottom[0], bottom[1]));
                for j in 0..3 {
                    let column = gather_back(top[j], bottom[j]);
                    for i in 0..3 {
                        column[i].store(&mut planes[i][j][at]);
                    }
                }
            }
        }
    }
}

/// Gradients of the factors to gradients of the layer's input. Tiles share the cells at their edges: who comes first sets them, and who comes later adds.
#[inline(always)]
pub(super) fn input_gradients<V: Lanes>(
    proof: V::Proof,
    layer: &Layer,
    frames: usize,
    spread: &[f32],
    gradient: &mut [f32],
) {
    let places = Places::of(frames * layer.tiles(), layer.cell_width());
    let planes = places.planes(spread);
    let tiles: Vec<_> = (0..layer.tiles()).map(|tile| (layer.cells(tile), layer.is_begun(tile))).collect();
    let parts = layer.cell_line_len() / LANES;
    for (frame, gradient) in gradient.chunks_exact_mut(layer.input_len()).take(frames).enumerate() {
        let gradient = vectors_mut(gradient);
        for (tile, (cells, [above, left])) in tiles.iter().enumerate() {
            let row = frame * layer.tiles() + tile;
            for line in 0..2 {
                for part in 0..parts {
                    let at = places.at(row, line * parts + part);
                    let top = spread_back(three::<V>(proof, planes[0], at));
                    let middle = spread_back(three::<V>(proof, planes[1], at));
                    let bottom = spread_back(three::<V>(proof, planes[2], at));
                    let offset = line * layer.input_line() / LANES + part;
                    for j in 0..3 {
                        let column = spread_back([top[j], middle[j], bottom[j]]);
                        for i in 0..3 {
                            if let Some(cell) = cells[i][j] {
                                let to = &mut gradient[cell / LANES + offset];
                                let begun = i == 0 && *above || j == 0 && *left;
                                let sum = if begun { V::load(proof, to).plus(column[i]) } else { column[i] };
                                sum.store(to);
                            }
                        }
                    }
                }
            }
        }
    }
}
