//! A whole model: what the world model is made of, and the adversary beside it. They are two modules because they learn in separate steps at
//! separate rates.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::adversary::Adversary;
use crate::cnn::CnnConfig;
use crate::config::{ModelConfig, ObservationKind};
use crate::decoder::Decoder;
use crate::described::{Described, Matrix, bounds, perceptron, positive, product, sum};
use crate::dynamics::Dynamics;
use crate::encoder::Encoder;
use crate::error::ModelError;
use crate::heads::{Head, HeadConfig};
use crate::kernels::Instructions;
use crate::mlp::Mlp;
use crate::numbers::Number;
use crate::observe::Frames;
use crate::parameters::read_parameters;
use crate::reward::Reward;

/// Encoder (φ), dynamics and reward (θ), and the decoder of the reconstruction ablation.
#[derive(Module, Debug)]
pub struct World {
    /// History to latent.
    pub encoder: Encoder,
    /// Latent to next latent.
    pub dynamics: Dynamics,
    /// Latent and action to reward.
    pub reward: Reward,
    /// Latent to observation, for the reconstruction ablation only.
    pub decoder: Option<Decoder>,
    /// Whatever else an objective or an auxiliary term predicts.
    pub heads: Vec<Head>,
    /// Numbers that are learned like weights.
    pub numbers: Vec<Number>,
}

impl World {
    /// The world model with its head `name`, if it has one, replaced by what `change` makes of it.
    pub fn with_head(mut self, name: &str, change: impl FnOnce(&Reward, Mlp) -> Mlp) -> Self {
        if let Some(head) = self.heads.iter_mut().find(|head| head.name() == name) {
            head.mlp = change(&self.reward, head.mlp.clone());
        }
        self
    }

    /// The head `name`.
    ///
    /// # Errors
    /// The model was configured without it.
    pub fn head(&self, name: &str) -> Result<&Mlp, ModelError> {
        let found = self.heads.iter().find(|head| head.name() == name).map(|head| &head.mlp);
        found.ok_or_else(|| ModelError::MissingHead {
            name: name.to_owned(),
            known: self.heads.iter().map(|head| head.name().to_owned()).collect(),
        })
    }

    /// The number `name`: `[1]`
    ///
    /// # Errors
    /// The model was configured without it.
    pub fn number(&self, name: &str) -> Result<Tensor<1>, ModelError> {
        let found = self.numbers.iter().find(|number| number.name() == name).map(|number| number.value.val());
        found.ok_or_else(|| ModelError::MissingHead {
            name: name.to_owned(),
            known: self.numbers.iter().map(|number| number.name().to_owned()).collect(),
        })
    }
}

/// A model: its sizes, its world model and its adversary (ψ).
#[derive(Debug, Clone)]
pub struct Model {
    /// Sizes and constants.
    pub config: ModelConfig,
    /// Encoder, dynamics, reward.
    pub world: World,
    /// For the objective `vibes` only.
    pub adversary: Option<Adversary>,
}

impl Model {
    /// A new model with first values drawn from `rng`.
    ///
    /// # Errors
    /// The picture is too small, or the environment asks for instructions that there are not.
    pub fn init(config: ModelConfig, rng: &mut impl Rng, device: &Device) -> Result<Self, ModelError> {
        Instructions::asked()?;
        let encoder = Encoder::init(&config, rng, device)?;
        let dynamics = Dynamics::init(&config, rng, device);
        let reward = Reward::init(&config, rng, device);
        let decoder = config.decoder.then(|| Decoder::init(&config, rng, device)).transpose()?;
        let adversary = config.adversary.then(|| Adversary::init(&config, rng, device)).transpose()?;
        let head = |head: &HeadConfig, rng: &mut _| head.init(config.head, rng, device);
        let heads = config.heads.iter().map(|config| head(config, rng)).collect();
        let numbers = config.numbers.iter().map(|number| number.init(device)).collect();
        Ok(Self { world: World { encoder, dynamics, reward, decoder, heads, numbers }, adversary, config })
    }

    /// The model with the first scale of its features and latents set by data: what the encoder and the adversary make of a window has mean 0 and
    /// standard deviation 1 in every dimension, before normalisation; and the reward model begins with the rewards' own mean and standard deviation. Open
    /// in the paper.
    ///
    /// # Shapes
    /// - `frames`: `length·batch` observations
    /// - `previous_actions`: `[length, batch, A]`
    /// - `rewards`: `[length·batch]`
    ///
    /// # Errors
    /// The frames are of another kind than the model's.
    pub fn calibrated(
        mut self,
        frames: Frames,
        previous_actions: Tensor<3>,
        rewards: &[f32],
    ) -> Result<Self, ModelError> {
        self.world.reward = self.world.reward.calibrated(rewards);
        if let Some(mut adversary) = self.adversary.take() {
            adversary.observe = adversary.observe.calibrated(frames.clone())?;
            self.adversary = Some(adversary);
        }
        self.world.encoder = self.world.encoder.calibrated(frames, previous_actions)?;
        Ok(self)
    }

    /// The first weight that is no finite number, if there is one.
    pub fn first_not_finite(&self) -> Option<f32> {
        let mut tensors = read_parameters(&self.world, "world");
        if let Some(adversary) = &self.adversary {
            tensors.extend(read_parameters(adversary, "adversary"));
        }
        tensors.values().flat_map(|tensor| &tensor.values).copied().find(|weight| !weight.is_finite())
    }
}

impl Described for ModelConfig {
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_> {
        let (hidden, gates) = (self.hidden, product(&[3, self.hidden]));
        let own = [
            ("world.encoder.gru.w_hidden".to_owned(), vec![hidden, gates]),
            ("world.encoder.mean.weight".to_owned(), vec![hidden, self.latent]),
            ("world.dynamics.gru.w_input".to_owned(), vec![sum(&[self.latent, self.actions()]), gates]),
        ];
        let dynamics = perceptron("world.dynamics.head", [hidden, self.head, sum(&[self.latent, 1])]);
        let heads =
            self.heads.iter().enumerate().flat_map(|(at, head)| {
                perceptron(&format!("world.heads.{at}.mlp"), [head.input, self.head, head.output])
            });
        Box::new(own.into_iter().chain(dynamics).chain(of_observation(self)).chain(heads))
    }

    fn check_constants(&self) -> Result<(), String> {
        bounds(&self.action_min, &self.action_max)?;
        positive(&[
            ("latent_std", self.latent_std),
            ("prediction_floor", self.prediction_floor),
            ("reward_floor", self.reward_floor),
            ("reward_scale", self.reward_scale),
        ])
    }
}

/// The matrices that pictures or vectors go through, and come back through where there is a decoder.
fn of_observation(config: &ModelConfig) -> Vec<Matrix> {
    let (height, width) = match config.observation {
        ObservationKind::Pixels { height, width } => (height, width),
        ObservationKind::Vector { len } => {
            return perceptron("world.encoder.observe.mlp", [len, config.head, config.hidden]).into();
        }
    };
    // Pictures that are too small are refused when the network is built.
    let sizes = CnnConfig { height, width, depth: config.depth, output: config.hidden };
    let maps = sizes.maps().unwrap_or_default();
    let flat = maps.last().map_or(0, |map| product(map));
    let layers = maps.windows(2).enumerate().map(|(at, pair)| {
        let name = format!("world.encoder.observe.cnn.layers.{at}.weight");
        (name, vec![pair[1][2], pair[0][2], 4, 4])
    });
    let mut all: Vec<Matrix> = layers.collect();
    all.push(("world.encoder.observe.cnn.linear.weight".to_owned(), vec![flat, config.hidden]));
    if config.decoder {
        all.push(("world.decoder.picture.linear.weight".to_owned(), vec![config.latent, flat]));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::described::check;
    use crate::gaussian::LatentForm;
    use crate::guard::GuardConfig;
    use crate::parameters::HostTensors;

    /// Sizes that add up or multiply to more than any memory holds are no tensor's.
    #[test]
    fn a_description_of_more_than_the_file_holds_is_refused_before_anything_is_built() {
        let config = |hidden: usize| ModelConfig {
            task: "made-up".to_owned(),
            observation: ObservationKind::Pixels { height: usize::MAX, width: 20 },
            action_min: vec![-1.0],
            action_max: vec![1.0],
            depth: usize::MAX,
            hidden,
            head: 16,
            latent: usize::MAX,
            latent_std: 0.1,
            prediction_floor: 0.1,
            reward_floor: 0.1,
            reward_scale: 1.0,
            gru_update_bias: 0.0,
            adversary: true,
            decoder: true,
            heads: Vec::new(),
            numbers: Vec::new(),
            latents: LatentForm::UnitNorm,
            blind_to_actions: false,
        };
        for hidden in [0, 1 << 20, usize::MAX] {
            let error = check(&config(hidden), &HostTensors::new()).expect_err("a missing tensor");
            assert!(matches!(error, ModelError::MissingTensor { .. }), "{error}");
        }
        let members = GuardConfig { members: usize::MAX, shares: 0 };
        assert!(check(&members, &HostTensors::new()).is_err());
    }
}
