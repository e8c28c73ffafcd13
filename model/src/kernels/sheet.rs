//! Matrices in panels, and dense layers between them: what the kernels of perceptrons and of imagination are made of.
//!
//! In: row-major numbers and weights. Out: the same in panels of [`PANEL`] columns, products of them, and row-major numbers again. A matrix's columns may come in
//! parts (a state beside a latent beside an action); each part is padded with zeros to whole panels by itself, so that parts can be read and
//! written alone.

use super::instructions::Instructions;
use super::memory::Buffer;
use super::product::{Left, PANEL};
use super::recurrence::exp;

/// Panels that so many columns fill.
pub(super) fn panels(width: usize) -> usize {
    width.div_ceil(PANEL)
}

/// Panels of columns in parts.
pub(super) fn panels_of(parts: &[usize]) -> usize {
    parts.iter().map(|&part| panels(part)).sum()
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

    /// As the left side of a product: `count` panels from `first` on, rows from `at` on.
    fn left(&self, first: usize, count: usize, at: usize) -> Left<'_, PANEL, 1> {
        Left { data: &self.data[self.start(first, at)..], outer: count, outer_step: self.rows * PANEL, inner: PANEL }
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
    ins: Vec<usize>,
    outs: Vec<usize>,
    /// `[output panels][padded inputs, PANEL]`
    forward: Buffer,
    /// `[input panels][padded outputs, PANEL]`
    backward: Buffer,
    /// `[padded outputs]`
    bias: Buffer,
}

/// Where each column of a matrix in parts lies once every part is padded.
fn places(parts: &[usize]) -> Vec<usize> {
    let mut places = Vec::with_capacity(parts.iter().sum());
    let mut first = 0;
    for &part in parts {
        places.extend(first..first + part);
        first += panels(part) * PANEL;
    }
    places
}

impl Dense {
    /// Packs `weight` `[inputs, outputs]` and `bias` `[outputs]`, both of whose columns come in parts. The pass back is packed only if it will be needed.
    pub(super) fn pack(weight: &[f32], bias: &[f32], ins: &[usize], outs: &[usize], with_backward: bool) -> Self {
        let (rows, columns) = (places(ins), places(outs));
        let (in_panels, out_panels) = (panels_of(ins), panels_of(outs));
        let mut forward = Buffer::zeros(in_panels * out_panels * PANEL * PANEL);
        let mut backward = Buffer::zeros(if with_backward { forward.len() } else { 0 });
        for (&row, numbers) in rows.iter().zip(weight.chunks_exact(columns.len())) {
            for (&column, &number) in columns.iter().zip(numbers) {
                forward[((column / PANEL) * in_panels * PANEL + row) * PANEL + column % PANEL] = number;
            }
        }
        if with_backward {
            for (&row, numbers) in rows.iter().zip(weight.chunks_exact(columns.len())) {
                for (&column, &number) in columns.iter().zip(numbers) {
                    backward[((row / PANEL) * out_panels * PANEL + column) * PANEL + row % PANEL] = number;
                }
            }
        }
        let mut padded = Buffer::zeros(out_panels * PANEL);
        for (&column, &number) in columns.iter().zip(bias) {
            padded[column] = number;
        }
        Self { ins: ins.to_vec(), outs: outs.to_vec(), forward, backward, bias: padded }
    }

    pub(super) fn out_panels(&self) -> usize {
        panels_of(&self.outs)
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
        let inner = panels_of(&self.ins);
        for (panel, weights) in self.forward.chunks_exact(inner * PANEL * PANEL).enumerate() {
            let place = out.part_mut(panel, out_at, count);
            x.left(first, inner, x_at).times(weights, count, place, false, instructions);
            let bias = &self.bias[panel * PANEL..(panel + 1) * PANEL];
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
        let inner = self.out_panels();
        for (panel, weights) in self.backward.chunks_exact(inner * PANEL * PANEL).enumerate() {
            let place = into.part_mut(first + panel, into_at, count);
            gradient.left(0, inner, at).times(weights, count, place, add, instructions);
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
        let (rows, columns) = (places(&self.ins), places(&self.outs));
        let mut square = [0.0_f32; PANEL * PANEL];
        for j in 0..self.out_panels() {
            let right = gradient.part(j, 0, count);
            let mine: Vec<(usize, usize)> = columns
                .iter()
                .enumerate()
                .filter(|(_, place)| *place / PANEL == j)
                .map(|(c, p)| (c, p % PANEL))
                .collect();
            for i in 0..panels_of(&self.ins) {
                Left::turned(x.part(first + i, 0, count), count).times(right, PANEL, &mut square, false, instructions);
                for (row, place) in rows.iter().enumerate().filter(|(_, place)| *place / PANEL == i) {
                    for &(column, lane) in &mine {
                        weight[row * columns.len() + column] += square[(place % PANEL) * PANEL + lane];
                    }
                }
            }
            for numbers in right.chunks_exact(PANEL) {
                for &(column, lane) in &mine {
                    bias[column] += numbers[lane];
                }
            }
        }
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
