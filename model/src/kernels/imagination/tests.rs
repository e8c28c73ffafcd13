//! Every set of instructions imagines the same, in both passes: at more rows than two lanes have, the third of them short, and sizes that fill no panel. That one of them is right is tested in
//! [`imagine`](crate::imagine), against ordinary operations.

use burn::tensor::Device;

use super::*;
use crate::golden::assert_close;
use crate::kernels::draws::Draws;
use crate::parameters::to_values;

const HORIZON: usize = 3;
const HIDDEN: usize = 40;
const LATENT: usize = 5;
const ACTIONS: usize = 2;

fn layer([input, output]: [usize; 2], draws: &mut Draws, device: &Device) -> LayerWeights {
    let weight = draws.normal([input, output], (input as f32).sqrt().recip(), device);
    (weight, draws.normal([output], 0.1, device))
}

fn perceptron([input, width, output]: [usize; 3], draws: &mut Draws, device: &Device) -> [LayerWeights; 3] {
    [[input, width], [width, width], [width, output]].map(|shape| layer(shape, draws, device))
}

/// What was imagined, and the gradient of every weight of the actor.
fn imagined(distribution: ActionDistribution, instructions: Instructions) -> Vec<Vec<f32>> {
    let (device, mut draws) = (Device::flex(), Draws::new(3));
    let rows = 2 * Beginning::LANE + 5;
    let world = WorldWeights {
        reward: perceptron([LATENT + ACTIONS, 9, 2], &mut draws, &device),
        reward_scale: 0.5,
        gru: [[LATENT + ACTIONS, 3 * HIDDEN], [HIDDEN, 3 * HIDDEN]].map(|shape| layer(shape, &mut draws, &device)),
        head: perceptron([HIDDEN, 33, LATENT + 1], &mut draws, &device),
        floor: 0.1,
    };
    let layers = perceptron([HIDDEN + LATENT, 10, 2 * ACTIONS], &mut draws, &device.clone().autodiff());
    let layers = layers.map(|(weight, bias)| (weight.require_grad(), bias.require_grad()));
    let beginning = Beginning {
        states: draws.normal([rows, HIDDEN], 0.5, &device),
        latents: draws.normal([rows, LATENT], 0.5, &device),
        action_noise: draws.normal([HORIZON, rows, ACTIONS], 1.0, &device),
        latent_noise: draws.normal([HORIZON, rows, LATENT], 1.0, &device),
    };
    let actor = ActorWeights { layers: layers.clone(), distribution };
    let Imagined { features, rewards, outputs } =
        operation::imagination(&world, &actor, beginning, instructions).expect("the custom path");
    let mut all = vec![to_values(features.clone()), to_values(rewards.clone()), to_values(outputs.clone())];
    let objective = features.square().mean() * 3.0 + rewards.mean() + outputs.square().mean();
    let mut gradients = objective.backward();
    for (weight, bias) in layers {
        all.push(to_values(weight.grad_remove(&mut gradients).expect("a gradient")));
        all.push(to_values(bias.grad_remove(&mut gradients).expect("a gradient")));
    }
    all
}

#[test]
fn every_set_of_instructions_imagines_the_same() {
    for distribution in [ActionDistribution::BoundedNormal, ActionDistribution::TanhNormal] {
        let wanted = imagined(distribution, Instructions::Portable);
        for instructions in [Instructions::Avx512, Instructions::Avx2] {
            if !instructions.available() {
                continue;
            }
            for (part, (found, wanted)) in imagined(distribution, instructions).iter().zip(&wanted).enumerate() {
                let largest = wanted.iter().fold(1e-6_f32, |largest, x| largest.max(x.abs()));
                let scaled = |values: &[f32]| values.iter().map(|x| x / largest).collect::<Vec<f32>>();
                assert_close(
                    &scaled(found),
                    &scaled(wanted),
                    &format!("{instructions:?}, {distribution:?}, part {part}"),
                );
            }
        }
    }
}
