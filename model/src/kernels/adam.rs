//! Adam (Kingma and Ba, 2015, algorithm 1) in one pass over a parameter, its gradient and its moments.
//!
//! In: a parameter, its gradient, the moments so far. Out: the updated parameter and moments.

use burn::backend::Flex;
use burn::tensor::{DType, Tensor};
use burn_flex::FlexTensor;
use rayon::prelude::*;

use super::flex;
use super::instructions::Instructions;

#[cfg(test)]
mod tests;

/// Numbers of one piece of work.
const PIECE: usize = 1 << 14;

/// Adam's constants. The defaults are PyTorch's: rates 0.9 and 0.999, ε 1e-8 (added to the root), no weight decay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adam {
    /// Decay of the gradient's running mean.
    pub beta1: f32,
    /// Decay of the squared gradient's running mean.
    pub beta2: f32,
    /// Added to the root of the second moment.
    pub epsilon: f32,
}

impl Default for Adam {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8 }
    }
}

/// Running means of one parameter's gradient and squared gradient, of the parameter's shape.
#[derive(Clone, Debug)]
pub struct Moments<const D: usize> {
    /// Running mean of the gradient, not corrected for its start at zero.
    pub first: Tensor<D>,
    /// Running mean of the squared gradient, not corrected for its start at zero.
    pub second: Tensor<D>,
}

impl Adam {
    /// The parameter and its moments after update number `step` (the first is 1).
    ///
    /// `scale` multiplies the gradient first: the factor of a global norm clip, or 1. All tensors are on the inner device, without
    /// autodiff; pass them by value and keep no clones, then on `flex` nothing is copied. `moments` is `None` before the first update.
    ///
    /// # Panics
    /// The tensors are not of one shape.
    pub fn update<const D: usize>(
        &self,
        parameter: Tensor<D>,
        gradient: Tensor<D>,
        moments: Option<Moments<D>>,
        learning_rate: f64,
        scale: f32,
        step: u64,
    ) -> (Tensor<D>, Moments<D>) {
        let (first, second) = match moments {
            Some(Moments { first, second }) => (first, second),
            None => (parameter.zeros_like(), parameter.zeros_like()),
        };
        let tensors = [parameter, gradient, first, second];
        let shapes = tensors.each_ref().map(|tensor| tensor.dims());
        assert!(
            shapes.iter().all(|shape| *shape == shapes[0]),
            "parameter, gradient and moments of one shape: {shapes:?}"
        );
        let corrections = self.corrections(learning_rate, step);
        let fast = |tensor: &Tensor<D>| {
            let device = tensor.device();
            tensor.dtype() == DType::F32 && !device.is_autodiff() && flex::runs_on_flex(&device)
        };
        let tensors = if tensors.iter().all(fast) {
            self.update_on_flex(tensors, scale, corrections)
        } else {
            self.update_plainly(tensors, scale, corrections)
        };
        let [parameter, first, second] = tensors;
        (parameter, Moments { first, second })
    }

    fn update_plainly<const D: usize>(
        &self,
        [parameter, gradient, first, second]: [Tensor<D>; 4],
        scale: f32,
        (rate, root): (f32, f32),
    ) -> [Tensor<D>; 3] {
        let gradient = gradient * scale;
        let first = first * self.beta1 + gradient.clone() * (1.0 - self.beta1);
        let second = second * self.beta2 + gradient.clone() * gradient * (1.0 - self.beta2);
        let change = first.clone() / (second.clone().sqrt() / root + self.epsilon) * rate;
        [parameter - change, first, second]
    }

    fn update_on_flex<const D: usize>(
        &self,
        tensors: [Tensor<D>; 4],
        scale: f32,
        corrections: (f32, f32),
    ) -> [Tensor<D>; 3] {
        let [mut parameter, gradient, mut first, mut second] =
            tensors.map(|tensor| flex::unfollowed(tensor).expect("a float32 tensor on flex"));
        let work = whole(&mut parameter)
            .par_chunks_mut(PIECE)
            .zip(flex::numbers(&gradient).par_chunks(PIECE))
            .zip(whole(&mut first).par_chunks_mut(PIECE))
            .zip(whole(&mut second).par_chunks_mut(PIECE));
        work.for_each(|(((parameter, gradient), first), second)| {
            Instructions::best().run(
                #[inline(always)]
                || self.update_numbers(parameter, gradient, [first, second], scale, corrections),
            );
        });
        [parameter, first, second].map(Tensor::from_primitive::<Flex>)
    }

    #[inline(always)]
    fn update_numbers(
        &self,
        parameter: &mut [f32],
        gradient: &[f32],
        [first, second]: [&mut [f32]; 2],
        scale: f32,
        (rate, root): (f32, f32),
    ) {
        let root = 1.0 / root;
        let moments = first.iter_mut().zip(second);
        for ((parameter, gradient), (first, second)) in parameter.iter_mut().zip(gradient).zip(moments) {
            let gradient = gradient * scale;
            *first = *first * self.beta1 + gradient * (1.0 - self.beta1);
            *second = *second * self.beta2 + gradient * gradient * (1.0 - self.beta2);
            *parameter -= rate * *first / (second.sqrt() * root + self.epsilon);
        }
    }

    /// Step size and root of the second moment's correction: `lr / (1 − β₁ᵗ)` and `√(1 − β₂ᵗ)`.
    fn corrections(&self, learning_rate: f64, step: u64) -> (f32, f32) {
        let step = step as f64;
        let rate = learning_rate / (1.0 - f64::from(self.beta1).powf(step));
        (rate as f32, (1.0 - f64::from(self.beta2).powf(step)).sqrt() as f32)
    }
}

/// All numbers of a tensor in one piece; copied first if another tensor shares them.
fn whole(tensor: &mut FlexTensor) -> &mut [f32] {
    let (start, end) = tensor.layout().contiguous_offsets().expect("a tensor in one piece");
    &mut tensor.storage_mut::<f32>()[start..end]
}
