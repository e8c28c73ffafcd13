//! What may stand beside the critics' loss. In: the features of one view with gradient, the batch, the networks. Out: a loss to add by its weight, or none.

use burn::module::Module;
use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::Rng;
use vibes_model::actions::noise;
use vibes_model::sac::SacNetworks;
use vibes_model::sac::networks::Transition;

use super::options::{Auxiliary, FREQUENCIES, SacOptions};
use super::transitions::{Transitions, partners};
use crate::error::{Result, TrainError};
use crate::learners::losses::dbc::NextLatent;
use crate::learners::losses::{characteristic, contrast, dbc, mico, simsr, transition};

/// Least and most standard deviation of predicted features (`facebookresearch/deep_bisim4control`).
const STD: [f32; 2] = [1e-4, 10.0];

/// What a loss is made of.
#[derive(Debug)]
pub struct Moment<'a> {
    /// Of one view of the stacks, by the critics in training: `[rows, feature]`
    pub features: Tensor<2>,
    /// What the convolutions show of every view: `[rows, maps]`
    pub maps: Vec<Tensor<2>>,
    /// `[rows, A]`
    pub actions: Tensor<2>,
    /// The batch.
    pub batch: &'a Transitions,
    /// The options.
    pub options: &'a SacOptions,
}

/// The loss the options ask for: `[1]`.
///
/// # Errors
/// The networks lack what it needs.
pub fn auxiliary_loss(
    networks: &SacNetworks,
    moment: &Moment<'_>,
    device: &Device,
    rng: &mut impl Rng,
) -> Result<Option<Tensor<1>>> {
    let (options, batch) = (moment.options, moment.batch);
    let rewards: Tensor<1> = Tensor::from_inner(batch.rewards(device));
    let discount = options.discount as f32;
    Ok(Some(match options.auxiliary {
        Auxiliary::None => return Ok(None),
        Auxiliary::Curl => {
            let form = networks.further.bilinear.as_ref().ok_or_else(|| missing("a bilinear form"))?;
            let keys = networks.slow.features(batch.view(options.augment, rng, device));
            contrast::bilinear(moment.features.clone(), Tensor::from_inner(keys), form.weight.val())
        }
        Auxiliary::Mico => {
            let now = networks.slow.features(batch.view(options.augment, rng, device));
            let next = networks.slow.features(batch.next_view(options.augment, rng, device));
            let (now, next) = (Tensor::from_inner(now), Tensor::from_inner(next));
            mico::loss(&moment.features, now, next, &rewards, discount)
        }
        Auxiliary::Sar => sar(networks, moment, device, rng)?,
        Auxiliary::DeepMdp | Auxiliary::Dbc | Auxiliary::SimSr => {
            let model = networks.further.transition.as_ref().ok_or_else(|| missing("a transition model"))?;
            let next = networks.critic.valid().features(batch.next_view(options.augment, rng, device));
            let prediction = predict(model, moment);
            let reward = model_reward(model, prediction.mean.clone());
            let models =
                transition::latent(&prediction, Tensor::from_inner(next)) + transition::reward(reward, rewards.clone());
            match options.auxiliary {
                Auxiliary::Dbc => {
                    let partners = TensorData::new(partners(batch.rows, rng), [batch.rows]);
                    let partners = Tensor::<1, Int>::from_data(partners, &moment.features.device());
                    models + dbc::loss(moment.features.clone(), &rewards, &prediction, &partners, discount)
                }
                Auxiliary::SimSr => {
                    let spread: Tensor<2> = Tensor::from_inner(noise(prediction.mean.dims(), rng, device));
                    let next = prediction.mean.detach() + prediction.std.detach() * spread;
                    models + simsr::loss(&moment.features, next, &rewards, discount)
                }
                _ => models,
            }
        }
    }))
}

/// Factor of each further step's reward in what SAR's heads see.
const REWARD_DISCOUNT: f32 = 0.8;
/// Heads whose errors count, the smallest.
const BEST_HEADS: usize = 5;

/// SAR's: the characteristic function of the actions that the policy of now would take at the recorded next steps. Gradients reach the convolutions through the actor's trunk.
fn sar(networks: &SacNetworks, moment: &Moment<'_>, device: &Device, rng: &mut impl Rng) -> Result<Tensor<1>> {
    let (options, batch) = (moment.options, moment.batch);
    let head = networks.further.characteristic.as_ref().ok_or_else(|| missing("a characteristic function"))?;
    let actor = networks.actor.as_ref().ok_or_else(|| missing("an actor"))?;
    let ahead = batch.ahead.as_ref().ok_or_else(|| missing("steps ahead"))?;
    let views = moment.maps.len();
    let wide = |x: Tensor<2>| Tensor::from_inner(x.repeat_dim(0, views));

    let maps = networks.critic.valid().convolutions.forward(ahead.plain(batch.shape, options.augment, device));
    let width = networks.config.actions();
    let drawn = noise([ahead.steps * batch.rows, width], rng, device);
    let actions = actor.valid().forward(maps).sample(drawn).action;
    // [steps · rows, A] to [rows, steps · A].
    let actions = actions.reshape([ahead.steps, batch.rows, width]).swap_dims(0, 1);
    let actions = wide(actions.reshape([batch.rows, ahead.steps * width]));

    let samples = options.frequencies.unwrap_or(FREQUENCIES);
    let frequencies = head.frequencies(Tensor::from_inner(noise([samples, ahead.steps], rng, device)));
    let features = Tensor::cat(moment.maps.iter().map(|maps| actor.trunk.forward(maps.clone())).collect(), 0);
    let expected = head.expected(features, wide(ahead.rewards(REWARD_DISCOUNT, device)), frequencies.clone());
    Ok(characteristic::loss(expected, head.own(frequencies, actions), views, BEST_HEADS))
}

/// The next features' Gaussian.
fn predict(model: &Transition, moment: &Moment<'_>) -> NextLatent {
    let input = Tensor::cat(vec![moment.features.clone(), moment.actions.clone()], 1);
    let output = model.next.forward(input);
    let width = output.dims()[1] / 2;
    let [low, high] = STD;
    NextLatent {
        mean: output.clone().narrow(1, 0, width),
        std: sigmoid(output.narrow(1, width, width)) * (high - low) + low,
    }
}

fn model_reward(model: &Transition, next: Tensor<2>) -> Tensor<1> {
    model.reward.forward(next).squeeze_dim(1)
}

fn missing(what: &str) -> TrainError {
    TrainError::Options(format!("the networks were made without {what}, which this auxiliary loss needs"))
}
