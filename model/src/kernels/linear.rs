//! A linear layer `x W + b` on wide rows: what stands before every recurrent network and behind every picture network.
//!
//! In: rows of numbers, weights. Out: rows of numbers; differentiable in everything. Panels of the output are shared among the cores, so that a single window's
//! few rows keep all of them busy.

use burn::tensor::{Tensor, module};

use super::instructions::Instructions;

mod operation;
#[cfg(test)]
mod tests;

/// Rows from which on the custom path is faster than putting the weights into panels.
const LEAST_ROWS: usize = 16;

/// `x W + b`
///
/// * `x` `[rows, input]`, `weight` `[input, output]`, `bias` `[output]`
/// * the result is `[rows, output]`
pub fn linear(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    if x.dims()[0] < LEAST_ROWS {
        return module::linear(x, weight, Some(bias));
    }
    operation::linear(x.clone(), weight.clone(), bias.clone(), Instructions::best())
        .unwrap_or_else(|| module::linear(x, weight, Some(bias)))
}
