//! Matrices in panels, and dense layers between them: what the kernels of perceptrons and of imagination are made of.
//!
//! In: row-major numbers and weights. Out: the same in panels of [`PANEL`] columns, products of them, and row-major numbers again. A matrix's columns may come in
//! parts (a state beside a latent beside an action); each part is padded with zeros to whole panels by itself, so that parts can be read and
//! written alone.

use rayon::prelude::*;

use super::instructions::Instructions;
use super::memory::Buffer;
use super::product::{Left, PANEL};
use super::recurrence::exp;

/// Panels that so many columns fill.
pub(super) fn panels(width: usize) -> usize {
    width.div_ceil(PANEL)
}

/// A matrix `[rows, columns]` in panels: `[panels][rows, PANEL]`.
#[derive(Debug)]
pub(super) struct Sheet {
    rows: usize,
    data: Buffer,
}

impl Sheet {
    /// Numbers are whatever they were: write before reading.
    pub(super) fn stale(panels: usize, rows: usize) -> Self {
        Self { rows, data: Buffer::stale(panels * rows * PANEL) }
    }

    /// All zeros.
    pub(super) fn zeros(panels: usize, rows: usize) -> Self {
        Self { rows, data: Buffer::zeros(panels * rows * PANEL) }
    }

    /// Row-major numbers `[rows, width]` in panels.
    pub(super) fn of(numbers: &[f32], rows: usize, width: usize) -> Self {
        let mut sheet = Self::stale(panels(width), rows);
        sheet.fill((0, 0, rows), width, |row| &numbers[row * width..(row + 1) * width]);
        sheet
    }

    /// The `width` numbers of every row, row-major, from the first panel on.
    pub(super) fn numbers(&self, width: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.rows * width];
        out.chunks_exact_mut(width).enumerate().for_each(|(row, out)| self.read(0, row, width, out));
        out
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    fn start(&self, panel: usize, row: usize) -> usize {
        (panel * self.rows + row) * PANEL
    }

    /// `count` rows of a panel from row `at` on.
    #[inline(always)]
    pub(super) fn part(&self, panel: usize, at: usize, count: usize) -> &[f32] {
        let start = self.start(panel, at);
        &self.data[start..start + count * PANEL]
    }

    /// The same, to be written.
    #[inline(always)]
    pub(super) fn part_mut(&mut self, panel: usize, at: usize, count: usize) -> &mut [f32] {
        let start = self.start(panel, at);
        &mut self.data[start..start + count * PANEL]
    }

    /// `count` rows of several panels that do not overlap, each from a row of its own on, to be written.
    ///
    /// # Panics
    /// If two of them overlap.
    #[inline(always)]
    pub(super) fn parts_mut<const N: usize>(&mut self, places: [(usize, usize); N], count: usize) -> [&mut [f32]; N] {
        let ranges = places.map(|(panel, at)| self.start(panel, at)..self.start(panel, at) + count * PANEL);
        match self.data.get_disjoint_mut(ranges) {
            Ok(parts) => parts,
            Err(error) => panic!("parts of {count} rows at {places:?}: {error}"),
        }
    }

    /// As the left side of a product: `k` columns from panel `first` on, rows from `at` on.
    fn left(&self, first: usize, k: usize, at: usize) -> Left<'_, PANEL, 1> {
        Left::panels(&self.data[self.start(first, at)..], self.rows, k)
    }

    /// Puts row-major numbers `[count, width]` into whole panels from `first` on; `source` gives the row's numbers.
    pub(super) fn fill<'a>(
        &mut self,
        (first, at, count): (usize, usize, usize),
        width: usize,
        source: impl Fn(usize) -> &'a [f32],
    ) {
        for row in 0..count {
            let numbers = source(row);
            for panel in 0..panels(width) {
                let start = self.start(first + panel, at + row);
                let piece = &numbers[panel * PANEL..width.min((panel + 1) * PANEL)];
                self.data[start..start + piece.len()].copy_from_slice(piece);
                self.data[start + piece.len()..start + PANEL].fill(0.0);
            }
        }
    }

    /// The other way round: the `width` numbers of a row, from panel `first` on.
    pub(super) fn read(&self, first: usize, row: usize, width: usize, out: &mut [f32]) {
        for panel in 0..panels(width) {
            let start = self.start(first + panel, row);
            let piece = &mut out[panel * PANEL..width.min((panel + 1) * PANEL)];
            piece.copy_from_slice(&self.data[start..start + piece.len()]);
        }
    }
}

/// What follows the product and the bias.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Activation {
    None,
    Elu,
}

/// A layer `y = x W + b` with its weights as both passes read them.
#[derive(Debug)]
pub(super) struct Dense {
    ins: Vec<Piece>,
    outs: Vec<Piece>,
    /// Number of outputs.
    width: usize,
    /// `[output panels][padded inputs, PANEL]`
    forward: Buffer,
    /// `[input panels][padded outputs, PANEL]`
    backward: Buffer,
    /// `[padded outputs]`
    bias: Buffer,
}

/// Columns of a matrix in parts that lie side by side in one panel, from its first column on.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// The panel.
    panel: usize,
    /// The first of the columns.
    column: usize,
    /// How many.
    len: usize,
}

/// Columns up to the last one in panels of parts, those included that fill a part's last panel.
fn reach(pieces: &[Piece]) -> usize {
    pieces.last().map_or(0, |piece| piece.panel * PANEL + piece.len)
}

fn pieces(parts: &[usize]) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut column = 0;
    for &part in parts {
        for start in (0..part).step_by(PANEL) {
            let len = PANEL.min(part - start);
            pieces.push(Piece { panel: pieces.len(), column: column + start, len });
        }
        column += part;
    }
    pieces
}

impl Dense {
    /// Packs `weight` `[inputs, outputs]` and `bias` `[outputs]`, both of whose columns come in parts. The pass back is packed only if it will be needed.
    pub(super) fn pack(weight: &[f32], bias: &[f32], ins: &[usize], outs: &[usize], with_backward: bool) -> Self {
        let (rows, columns) = (pieces(ins), pieces(outs));
        let (in_panels, out_panels, width) = (rows.len(), columns.len(), outs.iter().sum::<usize>());
        // Only what fills up panels has to be zero.
        let is_full = |pieces: &[Piece]| pieces.iter().all(|piece| piece.len == PANEL);
        let fresh = |len: usize| {
            if is_full(&rows) && is_full(&columns) { Buffer::stale(len) } else { Buffer::zeros(len) }
        };
        let mut forward = fresh(in_panels * out_panels * PANEL * PANEL);
        for (input, row) in rows.iter().flat_map(|input| (0..input.len).map(move |row| (input, row))) {
            let numbers = &weight[(input.column + row) * width..][..width];
            for output in &columns {
                let place = ((output.panel * in_panels + input.panel) * PANEL + row) * PANEL;
                forward[place..place + output.len].copy_from_slice(&numbers[output.column..][..output.len]);
            }
        }
        let mut backward = fresh(if with_backward { forward.len() } else { 0 });
        if with_backward {
            for (input, output) in rows.iter().flat_map(|input| columns.iter().map(move |output| (input, output))) {
                let place = (input.panel * out_panels + output.panel) * PANEL * PANEL;
                let block = &mut backward[place..place + PANEL * PANEL];
                for row in 0..input.len {
                    let numbers = &weight[(input.column + row) * width + output.column..][..output.len];
                    numbers.iter().enumerate().for_each(|(column, number)| block[column * PANEL + row] = *number);
                }
            }
        }
        let mut padded = Buffer::zeros(out_panels * PANEL);
        for output in &columns {
            padded[output.panel * PANEL..][..output.len].copy_from_slice(&bias[output.column..][..output.len]);
        }
        Self { ins: rows, outs: columns, width, forward, backward, bias: padded }
    }

    pub(super) fn out_panels(&self) -> usize {
        self.outs.len()
    }

    /// `out` rows `at..at + count` from those of `x`, whose panels begin at `first`.
    pub(super) fn forward(
        &self,
        (x, first, x_at): (&Sheet, usize, usize),
        (out, out_at): (&mut Sheet, usize),
        count: usize,
        activation: Activation,
        instructions: Instructions,
    ) {
        let x = x.left(first, reach(&self.ins), x_at);
        for (output, weights) in self.outs.iter().zip(self.forward.chunks_exact(self.ins.len() * PANEL * PANEL)) {
            let place = out.part_mut(output.panel, out_at, count);
            x.times_columns(output.len, weights, count, place, false, instructions);
            let bias = &self.bias[output.panel * PANEL..][..PANEL];
            instructions.run(
                #[inline(always)]
                || finish(place, bias, activation),
            );
        }
    }

    /// Adds to, or sets, the gradient of the inputs in panels from `first` on, from that of the outputs.
    pub(super) fn backward(
        &self,
        (gradient, at): (&Sheet, usize),
        (into, first, into_at): (&mut Sheet, usize, usize),
        count: usize,
        add: bool,
        instructions: Instructions,
    ) {
        let gradient = gradient.left(0, reach(&self.outs), at);
        for (input, weights) in self.ins.iter().zip(self.backward.chunks_exact(self.outs.len() * PANEL * PANEL)) {
            let place = into.part_mut(first + input.panel, into_at, count);
            gradient.times_columns(input.len, weights, count, place, add, instructions);
        }
    }

    /// Adds the gradients of weight `[inputs, outputs]` and bias `[outputs]` over `count` rows from the first.
    pub(super) fn learn(
        &self,
        (x, first): (&Sheet, usize),
        gradient: &Sheet,
        count: usize,
        (weight, bias): (&mut [f32], &mut [f32]),
        instructions: Instructions,
    ) {
        let (width, columns) = (self.width, &self.outs);
        let mut square = [0.0_f32; PANEL * PANEL];
        for input in &self.ins {
            let x = Left::turned(x.part(first + input.panel, 0, count), count);
            for output in columns {
                let right = gradient.part(output.panel, 0, count);
                x.times_columns(output.len, right, input.len, &mut square, false, instructions);
                for (row, numbers) in square.chunks_exact(PANEL).enumerate().take(input.len) {
                    let weight = &mut weight[(input.column + row) * width + output.column..][..output.len];
                    weight.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
                }
            }
        }
        for output in columns {
            let bias = &mut bias[output.column..][..output.len];
            for numbers in gradient.part(output.panel, 0, count).chunks_exact(PANEL) {
                bias.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
            }
        }
    }

    /// All rows of `x`, panels of the outputs shared among the cores.
    pub(super) fn forward_everywhere(&self, x: &Sheet, instructions: Instructions) -> Sheet {
        let (count, x) = (x.rows, x.left(0, reach(&self.ins), 0));
        let mut out = Sheet::stale(self.out_panels(), count);
        let weights = self.forward.par_chunks_exact(self.ins.len() * PANEL * PANEL);
        let layer = self.outs.par_iter().zip(weights).zip(self.bias.par_chunks_exact(PANEL));
        out.data.par_chunks_exact_mut(count * PANEL).zip(layer).for_each(|(place, ((output, weights), bias))| {
            x.times_columns(output.len, weights, count, place, false, instructions);
            instructions.run(
                #[inline(always)]
                || finish(place, bias, Activation::None),
            );
        });
        out
    }

    /// The gradient of all rows of the inputs, its panels shared among the cores.
    pub(super) fn backward_everywhere(&self, gradient: &Sheet, instructions: Instructions) -> Sheet {
        let (count, gradient) = (gradient.rows, gradient.left(0, reach(&self.outs), 0));
        let mut into = Sheet::stale(self.ins.len(), count);
        let weights = self.backward.par_chunks_exact(self.outs.len() * PANEL * PANEL);
        let layer = self.ins.par_iter().zip(weights);
        into.data.par_chunks_exact_mut(count * PANEL).zip(layer).for_each(|(place, (input, weights))| {
            gradient.times_columns(input.len, weights, count, place, false, instructions);
        });
        into
    }

    /// The gradients of weight `[inputs, outputs]` and bias `[outputs]` over all rows, for a layer whose inputs come in one part; rows of weights are shared among
    /// the cores.
    pub(super) fn learn_everywhere(
        &self,
        x: &Sheet,
        gradient: &Sheet,
        instructions: Instructions,
    ) -> (Vec<f32>, Vec<f32>) {
        let (count, width, columns) = (x.rows, self.width, &self.outs);
        let inputs = self.ins.iter().map(|input| input.len).sum::<usize>();
        let mut weight = vec![0.0; inputs * width];
        weight.par_chunks_mut(PANEL * width).enumerate().for_each(|(panel, weight)| {
            let mut square = [0.0_f32; PANEL * PANEL];
            let x = Left::turned(x.part(panel, 0, count), count);
            for output in columns {
                let right = gradient.part(output.panel, 0, count);
                x.times_columns(output.len, right, weight.len() / width, &mut square, false, instructions);
                for (weight, numbers) in weight.chunks_exact_mut(width).zip(square.chunks_exact(PANEL)) {
                    weight[output.column..][..output.len].copy_from_slice(&numbers[..output.len]);
                }
            }
        });
        let mut bias = vec![0.0; width];
        for output in columns {
            let bias = &mut bias[output.column..][..output.len];
            for numbers in gradient.part(output.panel, 0, count).chunks_exact(PANEL) {
                bias.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
            }
        }
        (weight, bias)
    }
}

#[inline(always)]
fn finish(out: &mut [f32], bias: &[f32], activation: Activation) {
    for row in out.chunks_exact_mut(PANEL) {
        for (number, bias) in row.iter_mut().zip(bias) {
            let x = *number + bias;
            *number = match activation {
                Activation::None => x,
                Activation::Elu if x > 0.0 => x,
                Activation::Elu => exp(x) - 1.0,
            };
        }
    }
}

/// Gradients of weight and bias of three layers.
pub(super) type LayerGradients = [(Vec<f32>, Vec<f32>); 3];

/// Adds what another lane found. Lanes are added in their order, so that sums do not depend on the number of threads.
pub(super) fn add(all: &mut LayerGradients, more: &LayerGradients) {
    for ((weight, bias), (more_weight, more_bias)) in all.iter_mut().zip(more) {
        weight.iter_mut().zip(more_weight).for_each(|(sum, more)| *sum += more);
        bias.iter_mut().zip(more_bias).for_each(|(sum, more)| *sum += more);
    }
}

/// Through an ELU whose outputs are known: multiplies the gradient by 1 where the output is positive and by output + 1 elsewhere.
pub(super) fn through_elu(
    gradient: &mut Sheet,
    (outputs, at): (&Sheet, usize),
    panels: usize,
    count: usize,
    instructions: Instructions,
) {
    for panel in 0..panels {
        let outputs = outputs.part(panel, at, count);
        let gradient = gradient.part_mut(panel, 0, count);
        instructions.run(
            #[inline(always)]
            || {
                for (gradient, output) in gradient.iter_mut().zip(outputs) {
                    *gradient *= if *output > 0.0 { 1.0 } else { *output + 1.0 };
                }
            },
        );
    }
}
