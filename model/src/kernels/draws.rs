//! Tensors of drawn numbers for the tests of the kernels. In: a seed. Out: the same numbers every time, so that a difference that is found once is found again.

use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::init::normal;

/// A generator of tensors.
pub(super) struct Draws(ChaCha8Rng);

impl Draws {
    pub(super) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Normal numbers of mean 0.
    pub(super) fn normal<const D: usize>(&mut self, shape: [usize; D], deviation: f32, device: &Device) -> Tensor<D> {
        let values = normal(shape.iter().product(), &mut self.0);
        Tensor::from_data(TensorData::new(values, shape), device) * deviation
    }

    /// Ones in that share, else zeros.
    pub(super) fn ones<const D: usize>(&mut self, shape: [usize; D], share: f64, device: &Device) -> Tensor<D> {
        let draws = (0..shape.iter().product::<usize>()).map(|_| f32::from(self.0.random_bool(share)));
        Tensor::from_data(TensorData::new(draws.collect::<Vec<f32>>(), shape), device)
    }
}
