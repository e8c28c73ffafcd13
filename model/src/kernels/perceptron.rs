//! A perceptron of three linear layers with ELU between them, as one operation.
//!
//! In: rows of numbers, weights. Out: rows of numbers; differentiable in everything. Of a perceptron that is held fixed only the gradient of its input is
//! computed.

use burn::tensor::Tensor;

use super::instructions::Instructions;
use super::{LayerWeights, plain};

mod operation;
#[cfg(test)]
mod tests;

/// Rows from which on the custom path is faster.
const LEAST_ROWS: usize = 16;

/// `elu(elu(x W₁ + b₁) W₂ + b₂) W₃ + b₃`
///
/// * `x` `[rows, input]`
/// * the result is `[rows, output]`
pub fn perceptron(x: Tensor<2>, layers: [LayerWeights; 3]) -> Tensor<2> {
    // For a handful of rows, putting the weights into panels costs more than the product.
    if x.dims()[0] < LEAST_ROWS {
        return plain::perceptron(x, layers);
    }
    operation::perceptron(x.clone(), &layers, Instructions::best()).unwrap_or_else(|| plain::perceptron(x, layers))
}
