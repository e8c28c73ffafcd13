//! Two critics `Q(o, a)` on one trunk: their smaller value is what the actor and the targets see, because the larger one tends to be an error.

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::Rng;

use super::config::SacConfig;
use super::features::{Convolutions, Trunk, orthogonal_mlp, relu_forward};
use crate::cross_entropy::CrossEntropy;
use crate::error::ModelError;
use crate::init::normal;
use crate::mlp::Mlp;

/// Convolutions, trunk, and two perceptrons over (features, action).
#[derive(Module, Debug)]
pub struct TwinCritic {
    /// Shared with the actor, which never moves them.
    pub convolutions: Convolutions,
    /// From maps to features.
    pub trunk: Trunk,
    /// One critic.
    pub first: Mlp,
    /// The other.
    pub second: Mlp,
}

impl TwinCritic {
    /// Orthogonal weights.
    ///
    /// # Errors
    /// The pictures are too small.
    pub fn init(config: &SacConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        let sizes = [config.feature + config.actions(), config.hidden, 1];
        Ok(Self {
            convolutions: Convolutions::init(config, rng, device),
            trunk: Trunk::init(config, rng, device)?,
            first: orthogonal_mlp(sizes, rng, device),
            second: orthogonal_mlp(sizes, rng, device),
        })
    }

    /// Features of stacks: `[rows, height, width, 3·stack]` to `[rows, feature]`.
    pub fn features(&self, pixels: Tensor<4, Int>) -> Tensor<2> {
        self.trunk.forward(self.convolutions.forward(pixels))
    }

    /// Both critics' values.
    ///
    /// # Shapes
    /// - `features`: `[rows, feature]`, of [`TwinCritic::features`]; `actions`: `[rows, A]`
    /// - output: `[rows]` each
    pub fn values(&self, features: Tensor<2>, actions: Tensor<2>) -> [Tensor<1>; 2] {
        twin_values([&self.first, &self.second], features, actions)
    }

    /// The action that the smaller value likes most in each row, as the search finds it.
    ///
    /// # Shapes
    /// - `features`: `[rows, feature]`
    /// - output: `[rows, A]`
    pub fn best_action(
        &self,
        features: Tensor<2>,
        search: CrossEntropy,
        [rows, width]: [usize; 2],
        rng: &mut impl Rng,
    ) -> Tensor<2> {
        let (drawn, feature) = (rows * search.samples, features.dims()[1]);
        let noise = normal(search.iterations * drawn * width, rng);
        let noise = TensorData::new(noise, [search.iterations, drawn, width]);
        let noise = Tensor::<3>::from_data(noise, &features.device());
        let repeated = features.unsqueeze_dim::<3>(1).repeat_dim(1, search.samples).reshape([drawn, feature]);
        search.search(noise, |actions| {
            let [first, second] = self.values(repeated.clone(), actions);
            first.min_pair(second)
        })
    }
}

/// The values of two critics, perceptrons over (features, action): `[rows, feature]`, `[rows, A]` to `[rows]` each.
pub fn twin_values(critics: [&Mlp; 2], features: Tensor<2>, actions: Tensor<2>) -> [Tensor<1>; 2] {
    let input = Tensor::cat(vec![features, actions], 1);
    critics.map(|mlp| relu_forward(mlp, input.clone()).squeeze_dim(1))
}
