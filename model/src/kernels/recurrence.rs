//! A GRU over a whole sequence.
//!
//! In: the inputs' share of the gates, recurrent weights, an initial state. Out: every hidden state.

use burn::tensor::Tensor;

pub(super) use gates::{exp, logistic, tanh};

use super::instructions::Instructions;
use super::plain;

mod gates;
mod operation;
mod sequence;
#[cfg(test)]
mod tests;

/// Hidden states of a GRU, PyTorch's formula (the recurrent bias of the candidate lies inside the reset gate's product):
///
/// ```text
/// r = σ(x_r + h·W_r + b_r)    z = σ(x_z + h·W_z + b_z)    n = tanh(x_n + r ⊙ (h·W_n + b_n))    h' = (1 − z) ⊙ n + z ⊙ h
/// ```
///
/// * `gates` `[length, batch, 3·hidden]`: `x_r`, `x_z`, `x_n` side by side, the input's projection with its bias, made in one product.
/// * `weight` `[hidden, 3·hidden]`: `W_r`, `W_z`, `W_n` side by side (Burn's `Linear` orientation, PyTorch's `weight_hh` transposed).
/// * `bias` `[3·hidden]`: `b_r`, `b_z`, `b_n`.
/// * `initial` `[batch, hidden]`: the state before the first step.
/// * `keep` `[length, batch]`, optional: multiplies the state before step t, 0 where an episode starts (`is_first`), else 1. No gradient flows to it.
///
/// The result is `[length, batch, hidden]`, the state after each step; the last one is the state to go on from.
/// Differentiable in `gates`, `weight`, `bias` and `initial`.
///
/// # Panics
/// If the shapes do not agree.
pub fn gru(
    gates: Tensor<3>,
    weight: Tensor<2>,
    bias: Tensor<1>,
    initial: Tensor<2>,
    keep: Option<Tensor<2>>,
) -> Tensor<3> {
    let tensors = (gates.clone(), weight.clone(), bias.clone(), initial.clone());
    operation::gru(tensors, keep.clone(), Instructions::best())
        .unwrap_or_else(|| plain::gru(gates, weight, bias, initial, keep))
}
