//! Imagination as one differentiable Burn operation on `flex`.
//!
//! In: Burn tensors. Out: Burn tensors that are parts of one, whose backward pass is [`lane_backward`]: the features `[horizon + 1, rows, hidden + latent]`, behind them the rewards
//! `[horizon, rows]`, and then the actor's outputs `[horizon, rows, 2A]`, so that each lies in one piece and is read where it is.

use std::sync::Arc;

use burn::tensor::Tensor;
use burn_flex::FlexTensor;
use rayon::prelude::*;

use super::backward::lane_backward;
use super::forward::{Given, Lane, Packed, ROWS, Sizes};
use super::{ActorWeights, Beginning, Imagined, WorldWeights};
use crate::kernels::LayerWeights;
use crate::kernels::flex;
use crate::kernels::instructions::Instructions;
use crate::kernels::operation::{Operand, Operation, run};
use crate::kernels::sheet::{Dense, LayerGradients, add};

/// Weight and bias of a layer that is held fixed.
type Fixed = (FlexTensor, FlexTensor);

/// Everything but the actor's weights.
#[derive(Clone, Debug)]
struct Imagination {
    sizes: Sizes,
    /// states, latents, noise of actions, noise of latents
    given: [FlexTensor; 4],
    /// Of the reward's three layers, the dynamics' input and hidden state, and its head's three layers.
    world: [Fixed; 8],
    instructions: Instructions,
}

/// The weights as the kernels read them, and what each lane computed.
#[derive(Debug)]
struct Kept {
    packed: Packed,
    lanes: Vec<Lane>,
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
    let fixed = |(weight, bias): &LayerWeights| {
        Some((flex::unfollowed(weight.clone().inner())?, flex::unfollowed(bias.clone().inner())?))
    };
    let ([r1, r2, r3], [input, state], [h1, h2, h3]) = (&world.reward, &world.gru, &world.head);
    let world = [fixed(r1)?, fixed(r2)?, fixed(r3)?, fixed(input)?, fixed(state)?, fixed(h1)?, fixed(h2)?, fixed(h3)?];
    let [(w1, b1), (w2, b2), (w3, b3)] = actor.layers.clone();
    let actor =
        [Operand::of(w1)?, Operand::of(b1)?, Operand::of(w2)?, Operand::of(b2)?, Operand::of(w3)?, Operand::of(b3)?];
    let parts: Tensor<1> = run(Imagination { sizes, given, world, instructions }, actor)?;
    let [features, rewards, outputs] = sizes.parts();
    // What is small is cut off together, so that going back only one gradient beside the features' is as long as all of them.
    let small = parts.clone().narrow(0, features, rewards + outputs);
    Some(Imagined {
        features: parts.narrow(0, 0, features).reshape([horizon + 1, rows, hidden + latent]),
        rewards: small.clone().narrow(0, 0, rewards).reshape([horizon, rows]),
        outputs: small.narrow(0, rewards, outputs).reshape([horizon, rows, 2 * actions]),
    })
}

impl Imagination {
    fn pack(&self, actor: &[FlexTensor; 6], with_backward: bool) -> Packed {
        let Sizes { hidden, latent, actions, .. } = self.sizes;
        let (width, reward, head, gates) = (self.sizes.actor, self.sizes.reward, self.sizes.head, [hidden; 3]);
        let dense = |weight: &FlexTensor, bias: &FlexTensor, ins: &[usize], outs: &[usize]| {
            Dense::pack(flex::numbers(weight), flex::numbers(bias), ins, outs, with_backward)
        };
        let own =
            |layer: usize, ins: &[usize], outs: &[usize]| dense(&actor[2 * layer], &actor[2 * layer + 1], ins, outs);
        let fixed = |layer: usize, ins: &[usize], outs: &[usize]| {
            let (weight, bias) = &self.world[layer];
            dense(weight, bias, ins, outs)
        };
        Packed {
            actor: [
                own(0, &[hidden, latent], &[width]),
                own(1, &[width], &[width]),
                own(2, &[width], &[actions, actions]),
            ],
            reward: [
                fixed(0, &[latent, actions], &[reward]),
                fixed(1, &[reward], &[reward]),
                fixed(2, &[reward], &[2]),
            ],
            input: fixed(3, &[latent, actions], &gates),
            hidden: fixed(4, &[hidden], &gates),
            head: [fixed(5, &[hidden], &[head]), fixed(6, &[head], &[head]), fixed(7, &[head], &[latent, 1])],
        }
    }

    fn given(&self) -> Given<'_> {
        let [states, latents, action_noise, latent_noise] = self.given.each_ref().map(flex::numbers);
        Given { states, latents, action_noise, latent_noise }
    }

    fn imagined(&self, packed: &Packed) -> (FlexTensor, Vec<Lane>) {
        let (sizes, given) = (self.sizes, self.given());
        let starts: Vec<usize> = (0..sizes.rows).step_by(ROWS).collect();
        let lanes: Vec<Lane> = starts
            .into_par_iter()
            .map(|at| Lane::run(sizes, packed, given, at, ROWS.min(sizes.rows - at), self.instructions))
            .collect();
        let mut out = vec![0.0; sizes.parts().iter().sum()];
        let Sizes { horizon, hidden, latent, actions, .. } = sizes;
        let [features, rewards, outputs] = sizes.cut_mut(&mut out);
        for lane in &lanes {
            for k in 0..=horizon {
                for row in 0..lane.count {
                    let (from, to) = (k * lane.count + row, k * sizes.rows + lane.at + row);
                    let seen = &mut features[to * (hidden + latent)..][..hidden + latent];
                    lane.x.read(0, from, hidden, &mut seen[..hidden]);
                    lane.x.read(sizes.h(), from, latent, &mut seen[hidden..]);
                    if k < horizon {
                        rewards[to] = lane.rewards.part(0, from, 1)[0] * sizes.reward_scale;
                        let output = &mut outputs[to * 2 * actions..][..2 * actions];
                        lane.actor[2].read(0, from, actions, &mut output[..actions]);
                        lane.actor[2].read(sizes.a(), from, actions, &mut output[actions..]);
                    }
                }
            }
        }
        let len = out.len();
        (flex::tensor(out, [len]), lanes)
    }
}

impl Operation<6> for Imagination {
    type Kept = Arc<Kept>;

    /// Weight and bias of each of the actor's layers.
    fn forward(&self, actor: &[FlexTensor; 6], keep: bool) -> Option<(FlexTensor, Self::Kept)> {
        let packed = self.pack(actor, keep);
        let (out, lanes) = self.imagined(&packed);
        Some((out, Arc::new(Kept { packed, lanes })))
    }

    fn backward(&self, _: &[FlexTensor; 6], kept: &Self::Kept, output: &[f32], _: [bool; 6]) -> [Vec<f32>; 6] {
        let given = self.given();
        let of = |lane| lane_backward(self.sizes, &kept.packed, given, lane, output, self.instructions);
        let found: Vec<LayerGradients> = kept.lanes.par_iter().map(of).collect();
        let mut lanes = found.into_iter();
        let Some(mut all) = lanes.next() else { return Default::default() };
        lanes.for_each(|lane| add(&mut all, &lane));
        let [one, two, three] = all;
        [one.0, one.1, two.0, two.1, three.0, three.1]
    }
}
