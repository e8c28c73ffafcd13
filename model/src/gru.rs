//! A gated recurrent unit over a whole window. The input's part of the gates is one product over all time steps; only the hidden state's
//! part is a loop.
//!
//! ```text
//! r = σ(x W_r + b_r + h U_r + c_r)        z = σ(x W_z + b_z + h U_z + c_z)
//! n = tanh(x W_n + b_n + r ⊙ (h U_n + c_n))      h' = (1 − z) ⊙ n + z ⊙ h
//! ```

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

use crate::init::recurrent_uniform;
use crate::kernels;

/// Sizes of a [`Gru`].
#[derive(Debug, Clone, Copy)]
pub struct GruConfig {
    /// Width of the input.
    pub input: usize,
    /// Width of the hidden state.
    pub hidden: usize,
}

/// A gated recurrent unit; gates lie side by side in the order reset, update, new.
#[derive(Module, Debug)]
pub struct Gru {
    /// `W`: `[input, 3·hidden]`
    pub w_input: Param<Tensor<2>>,
    /// `b`: `[3·hidden]`
    pub b_input: Param<Tensor<1>>,
    /// `U`: `[hidden, 3·hidden]`
    pub w_hidden: Param<Tensor<2>>,
    /// `c`: `[3·hidden]`
    pub b_hidden: Param<Tensor<1>>,
}

impl GruConfig {
    /// Weights and biases uniform within ±1/√hidden.
    pub fn init(&self, rng: &mut impl Rng, device: &Device) -> Gru {
        let (input, hidden) = (self.input, self.hidden);
        Gru {
            w_input: recurrent_uniform([input, 3 * hidden], hidden, rng, device),
            b_input: recurrent_uniform([3 * hidden], hidden, rng, device),
            w_hidden: recurrent_uniform([hidden, 3 * hidden], hidden, rng, device),
            b_hidden: recurrent_uniform([3 * hidden], hidden, rng, device),
        }
    }
}

impl Gru {
    /// The unit with `bias` added to its update gate's: above 0 it begins by keeping more of its state from step to step.
    pub fn with_update_bias(mut self, bias: f32) -> Self {
        if bias == 0.0 {
            return self;
        }
        let width = self.hidden();
        self.b_hidden = self.b_hidden.map(|values| {
            let step: Vec<f32> = (0..3 * width).map(|gate| if gate / width == 1 { bias } else { 0.0 }).collect();
            let device = values.device();
            values + Tensor::from_data(TensorData::new(step, [3 * width]), &device)
        });
        self
    }

    /// Width of the hidden state.
    pub fn hidden(&self) -> usize {
        self.w_hidden.val().dims()[0]
    }

    /// Runs over a window from the hidden state `start`, or from zeros.
    ///
    /// # Shapes
    /// - `x`: `[length, batch, input]`
    /// - `start`: `[batch, hidden]`
    /// - output: `[length, batch, hidden]`, the hidden state after every step
    pub fn forward(&self, x: Tensor<3>, start: Option<Tensor<2>>) -> Tensor<3> {
        let [length, batch, input] = x.dims();
        let start = start.unwrap_or_else(|| Tensor::zeros([batch, self.hidden()], &x.device()));
        let gates = kernels::linear(x.reshape([length * batch, input]), self.w_input.val(), self.b_input.val());
        let gates = gates.reshape([length, batch, 3 * self.hidden()]);
        kernels::gru(gates, self.w_hidden.val(), self.b_hidden.val(), start, None)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::parameters::to_values;

    /// The states after some steps without input from one state.
    fn kept(bias: f32) -> f32 {
        let device = Device::flex();
        let unit =
            GruConfig { input: 2, hidden: 16 }.init(&mut ChaCha8Rng::seed_from_u64(3), &device).with_update_bias(bias);
        let start = Tensor::<2>::ones([1, 16], &device);
        let states = to_values(unit.forward(Tensor::zeros([4, 1, 2], &device), Some(start)).narrow(0, 3, 1));
        states.iter().sum::<f32>() / 16.0
    }

    #[test]
    fn the_update_bias_makes_a_state_last() {
        let states = [0.0, 1.0, 2.0, 20.0].map(kept);
        assert!(states.is_sorted(), "{states:?}");
        assert!(states[0] < 0.2 && states[2] > 0.5, "{states:?}");
        assert!((states[3] - 1.0).abs() < 1e-3, "a gate that is shut keeps all of it: {states:?}");
    }
}
