//! Imagination as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: Burn tensors that are parts of one packed tensor `[horizon + 1, rows, hidden + latent + 1 + 2A]` (features, reward, the actor's
//! output), whose backward pass is [`lane_backward`].

use std::sync::Arc;

use burn::backend::autodiff::{
    checkpoint::{base::Checkpointer, strategy::NoCheckpointing},
    grads,
    ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Autodiff, Flex};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;
use rayon::prelude::*;

use super::backward::{ActorGradients, lane_backward};
use super::forward::{Given, Lane, Packed, ROWS, Sizes};
use super::{ActorWeights, Beginning, Imagined, WorldWeights};
use crate::kernels::flex::{self, Followed};
use crate::kernels::instructions::Instructions;
use crate::kernels::perceptron::LayerWeights;
use crate::kernels::sheet::Dense;

/// Everything but the actor's weights.
#[derive(Clone, Debug)]
struct Input {
    sizes: Sizes,
    /// states, latents, noise of actions, noise of latents
    given: [FlexTensor; 4],
    instructions: Instructions,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
struct Kept {
    input: Input,
    /// Weight and bias of the actor's layers, for their shapes.
    actor: [FlexTensor; 6],
    packed: Arc<Packed>,
    lanes: Arc<Vec<Lane>>,
}

/// See [`imagination`](super::imagination()); with given instructions.
pub(super) fn imagination(
    world: &WorldWeights,
    actor: &ActorWeights,
    beginning: Beginning,
    instructions: Instructions,
) -> Option<Imagined> {
    let Beginning { states, latents, action_noise, latent_noise } = beginning;
    let ([rows, hidden], [_, latent], [horizon, _, actions]) = (states.dims(), latents.dims(), action_noise.dims());
    let width = |layers: &[LayerWeights; 3]| layers[0].0.dims()[1];
    let is_even = |layers: &[LayerWeights; 3]| layers[1].0.dims() == [width(layers); 2];
    if ![&actor.layers, &world.reward, &world.head].into_iter().all(is_even) || rows == 0 || horizon == 0 {
        return None;
    }
    let sizes = Sizes {
        horizon,
        rows,
        hidden,
        latent,
        actions,
        actor: width(&actor.layers),
        reward: width(&world.reward),
        head: width(&world.head),
        floor: world.floor,
        reward_scale: world.reward_scale,
        distribution: actor.distribution,
    };
    let given = [
        flex::unfollowed(states.inner())?,
        flex::unfollowed(latents.inner())?,
        flex::unfollowed(action_noise.inner())?,
        flex::unfollowed(latent_noise.inner())?,
    ];
    let input = Input { sizes, given, instructions };
    let [(w1, b1), (w2, b2), (w3, b3)] = actor.layers.clone();
    let devices = [w1.device(), b1.device(), w2.device(), b2.device(), w3.device(), b3.device()];
    let packed = if devices.iter().any(burn::tensor::Device::is_autodiff) {
        let tensors = [
            flex::followed(w1)?,
            flex::followed(b1)?,
            flex::followed(w2)?,
            flex::followed(b2)?,
            flex::followed(w3)?,
            flex::followed(b3)?,
        ];
        Tensor::<3>::from_primitive::<Autodiff<Flex>>(record(input, world, tensors)?)
    } else {
        let tensors = [
            flex::unfollowed(w1)?,
            flex::unfollowed(b1)?,
            flex::unfollowed(w2)?,
            flex::unfollowed(b2)?,
            flex::unfollowed(w3)?,
            flex::unfollowed(b3)?,
        ];
        let packed = pack(sizes, world, &tensors, false)?;
        let (out, _) = input.forward(&packed);
        Tensor::<3>::from_primitive::<Flex>(out)
    };
    let seen = hidden + latent;
    Some(Imagined {
        features: packed.clone().narrow(2, 0, seen),
        rewards: packed.clone().narrow(2, seen, 1).narrow(0, 0, horizon).squeeze_dim(2),
        outputs: packed.narrow(2, seen + 1, 2 * actions).narrow(0, 0, horizon),
    })
}

/// Runs forward and records the backward step.
fn record(input: Input, world: &WorldWeights, tensors: [Followed; 6]) -> Option<Followed> {
    let nodes = tensors.each_ref().map(Followed::node);
    let actor = tensors.map(|tensor| tensor.into_primitive().to_contiguous());
    let packed = pack(input.sizes, world, &actor, true)?;
    let (out, lanes) = input.forward(&packed);
    Some(match Imagination.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let (packed, lanes) = (Arc::new(packed), Arc::new(lanes));
            prepared.finish(Kept { input, actor, packed, lanes }, out)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(out),
    })
}

fn pack(sizes: Sizes, world: &WorldWeights, actor: &[FlexTensor; 6], with_backward: bool) -> Option<Packed> {
    let Sizes { hidden, latent, actions, .. } = sizes;
    let dense = |(weight, bias): &LayerWeights, ins: &[usize], outs: &[usize]| {
        let weight = flex::unfollowed(weight.clone().inner())?;
        let bias = flex::unfollowed(bias.clone().inner())?;
        Some(Dense::pack(flex::numbers(&weight), flex::numbers(&bias), ins, outs, with_backward))
    };
    let perceptron = |layers: &[LayerWeights; 3], ins: &[usize], width: usize, outs: &[usize]| {
        let [one, two, three] = layers;
        Some([dense(one, ins, &[width])?, dense(two, &[width], &[width])?, dense(three, &[width], outs)?])
    };
    let own = |layer: usize, ins: &[usize], outs: &[usize]| {
        let [weight, bias] = [0, 1].map(|offset| flex::numbers(&actor[2 * layer + offset]));
        Dense::pack(weight, bias, ins, outs, with_backward)
    };
    let (width, gates) = (sizes.actor, [hidden; 3]);
    Some(Packed {
        actor: [own(0, &[hidden, latent], &[width]), own(1, &[width], &[width]), own(2, &[width], &[actions, actions])],
        reward: perceptron(&world.reward, &[latent, actions], sizes.reward, &[2])?,
        input: dense(&world.gru[0], &[latent, actions], &gates)?,
        hidden: dense(&world.gru[1], &[hidden], &gates)?,
        head: perceptron(&world.head, &[hidden], sizes.head, &[latent, 1])?,
    })
}

impl Input {
    fn given(&self) -> Given<'_> {
        let [states, latents, action_noise, latent_noise] = self.given.each_ref().map(flex::numbers);
        Given { states, latents, action_noise, latent_noise }
    }

    fn forward(&self, packed: &Packed) -> (FlexTensor, Vec<Lane>) {
        let (sizes, given) = (self.sizes, self.given());
        let starts: Vec<usize> = (0..sizes.rows).step_by(ROWS).collect();
        let lanes: Vec<Lane> = starts
            .into_par_iter()
            .map(|at| Lane::run(sizes, packed, given, at, ROWS.min(sizes.rows - at), self.instructions))
            .collect();
        let Sizes { horizon, rows, hidden, latent, actions, .. } = sizes;
        let (width, seen) = (sizes.width(), hidden + latent);
        let mut out = vec![0.0; (horizon + 1) * rows * width];
        for lane in &lanes {
            for k in 0..=horizon {
                for row in 0..lane.count {
                    let place = k * lane.count + row;
                    let out = &mut out[(k * rows + lane.at + row) * width..][..width];
                    lane.x.read(0, place, hidden, &mut out[..hidden]);
                    lane.x.read(sizes.h(), place, latent, &mut out[hidden..seen]);
                    if k < horizon {
                        out[seen] = lane.rewards.part(0, place, 1)[0] * sizes.reward_scale;
                        lane.actor[2].read(0, place, actions, &mut out[seen + 1..seen + 1 + actions]);
                        lane.actor[2].read(sizes.a(), place, actions, &mut out[seen + 1 + actions..]);
                    }
                }
            }
        }
        (flex::tensor(out, [horizon + 1, rows, width]), lanes)
    }
}

/// The backward step.
#[derive(Debug)]
struct Imagination;

impl Backward<Flex, 6> for Imagination {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 6>, gradients: &mut grads::Gradients, _: &mut Checkpointer) {
        let Kept { input, actor, packed, lanes } = ops.state;
        let rows = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let (rows, given) = (flex::numbers(&rows), input.given());
        let found: Vec<ActorGradients> = lanes
            .par_iter()
            .map(|lane| lane_backward(input.sizes, &packed, given, lane, rows, input.instructions))
            .collect();
        let mut lanes = found.into_iter();
        let Some(mut all) = lanes.next() else { return };
        for lane in lanes {
            for ((weight, bias), (more_weight, more_bias)) in all.iter_mut().zip(lane) {
                weight.iter_mut().zip(more_weight).for_each(|(sum, more)| *sum += more);
                bias.iter_mut().zip(more_bias).for_each(|(sum, more)| *sum += more);
            }
        }
        let parents = ops.parents.iter().map(|parent| parent.as_ref().map(|parent| parent.id));
        let [one, two, three] = all;
        flex::register(gradients, parents, &actor, [one.0, one.1, two.0, two.1, three.0, three.1]);
    }
}
