//! Imagination in a toy world against `tests/golden/behaviour.json`, and in a learned one against finite differences: gradients reach the actor through the
//! world, and only the actor.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::actions::ActionDistribution;
use crate::config::BehaviourConfig;
use crate::gaussian::unit_norm;
use crate::golden::{Case, assert_close, small_model};
use crate::parameters::to_values;
use crate::returns::lambda_returns;
use crate::values::ValueDistribution;

/// `h' = tanh([h, s, a] W_h)`, `s' = unit norm of h' W_s`, `r = [s, a] W_r`.
struct Toy {
    states: Tensor<2>,
    latents: Tensor<2>,
    rewards: Tensor<2>,
}

fn product(x: Tensor<3>, weight: &Tensor<2>) -> Tensor<3> {
    x.matmul(weight.clone().unsqueeze_dim(0))
}

impl LatentWorld for Toy {
    fn reward(&self, latents: Tensor<3>, actions: Tensor<3>) -> Tensor<3> {
        product(Tensor::cat(vec![latents, actions], 2), &self.rewards)
    }

    fn step(&self, states: Tensor<3>, latents: Tensor<3>, actions: Tensor<3>, _: Tensor<3>) -> (Tensor<3>, Tensor<3>) {
        let states = product(Tensor::cat(vec![states, latents, actions], 2), &self.states).tanh();
        (states.clone(), unit_norm(product(states, &self.latents)))
    }
}

#[test]
fn imagination_in_the_toy_world_is_the_golden_one_with_the_actors_gradient() {
    let case = Case::named("imagination");
    let constant = |name| case.input::<2>(name).inner();
    let (policy, critic): (Tensor<2>, _) = (case.input("Wp"), constant("Wv"));
    let world = Toy { states: constant("Wh"), latents: constant("Ws"), rewards: constant("Wr") };
    let starts = Starts { states: constant("h0"), latents: constant("s0") };
    let act = |_, features: Tensor<3>| {
        let normal = product(features, &policy);
        ActionSample { action: normal.clone().tanh(), normal }
    };
    let imagined = imagine_with(&world, act, starts, &Tensor::zeros([5, 4, 3], &Device::flex()));
    let values = product(imagined.features, &critic).squeeze_dim::<2>(2);
    let (discount, lambda) = (case.scalar("gamma"), case.scalar("lam"));
    let returns = lambda_returns(imagined.rewards.clone(), values.clone(), discount, lambda);
    for (name, tensor) in [("rewards", &imagined.rewards), ("values", &values), ("returns", &returns)] {
        assert_close(&to_values(tensor.clone()), &case.out(name), name);
    }
    let weights: Vec<f32> = (0..5).flat_map(|k| [discount.powi(k) as f32; 4]).collect();
    let weights = Tensor::<1>::from_data(weights.as_slice(), &Device::flex()).reshape([5, 4]);
    let loss = (returns * weights).mean().neg();
    assert_close(&to_values(loss.clone()), &case.out("loss"), "loss");
    let gradient = policy.grad(&loss.backward()).unwrap();
    assert_close(&to_values(gradient), &case.gradient("Wp"), "Wp");
}

struct Learnt {
    dynamics: Dynamics,
    reward: Reward,
    actor: Actor,
    starts: Starts,
    noise: ImaginationNoise,
}

const ROWS: usize = 5;
const HORIZON: usize = 4;

fn learnt(kind: ActionDistribution) -> Learnt {
    let config = small_model(2);
    let (mut rng, device) = (ChaCha8Rng::seed_from_u64(7), Device::flex());
    let behaviour = BehaviourConfig { actions: kind, values: ValueDistribution::Gaussian, hidden: 10 };
    let mut actor = Actor::init(&config, behaviour, &mut rng, &device);
    // A last layer of full size, so that the actor has something to say.
    actor.mlp = actor.mlp.last_scaled(30.0);
    Learnt {
        dynamics: Dynamics::init(&config, &mut rng, &device),
        reward: Reward::init(&config, &mut rng, &device),
        actor,
        starts: Starts {
            states: noise([ROWS, 12], &mut rng, &device).tanh(),
            latents: unit_norm(noise([ROWS, 5], &mut rng, &device)),
        },
        noise: small(ImaginationNoise::draw([HORIZON, ROWS], [2, 5], &mut rng, &device)),
    }
}

/// So little that no action is cut: differences would not see the gradient that flows through the cut.
fn small(noise: ImaginationNoise) -> ImaginationNoise {
    ImaginationNoise { actions: noise.actions * 0.05, ..noise }
}

/// The mean of rewards and of a function of the later rows, so that both ways back to the actor count.
fn objective(imagined: &Imagination) -> Tensor<1> {
    imagined.rewards.clone().mean() + imagined.features.clone().square().mean() * 3.0
}

/// The gradient of the actor's weights is that of the objective when an action's own input is held fixed: checked by moving the action of one step
/// at a time, through a bias that is added to the actor's output there.
#[test]
fn gradients_reach_the_actions_through_the_world_and_agree_with_finite_differences() {
    for kind in [ActionDistribution::BoundedNormal, ActionDistribution::TanhNormal] {
        let Learnt { dynamics, reward, actor, starts, noise } = learnt(kind);
        let world = Learned { dynamics: &dynamics, reward: &reward };
        let (fixed, _) = imagine(&world, &actor, starts.clone(), &noise);
        let moved = |shift: &Tensor<3>| {
            let act = |k: usize, _: Tensor<3>| {
                let seen = fixed.features.clone().narrow(0, k, 1);
                let output = actor.mlp.forward(seen) + shift.clone().narrow(0, k, 1).expand([1, ROWS, 4]);
                kind.of(output).sample(noise.actions.clone().narrow(0, k, 1))
            };
            imagine_with(&world, act, starts.clone(), &noise.latents)
        };
        let shift = Tensor::<3>::zeros([HORIZON, 1, 4], &Device::flex().autodiff()).require_grad();
        let gradient = to_values(shift.grad(&objective(&moved(&shift)).backward()).unwrap());
        // A step at a time adds up to the gradient of the last layer's bias.
        let tracked = actor.clone().train();
        let (imagined, _) = imagine(&world, &tracked, starts.clone(), &noise);
        let whole = tracked.mlp.last.bias.grad(&objective(&imagined).backward()).unwrap();
        let sums: Vec<f32> = (0..4).map(|i| gradient.iter().skip(i).step_by(4).sum()).collect();
        assert_close(&to_values(whole), &sums, "the actor's bias");
        for place in 0..HORIZON * 4 {
            let at = |step: f32| {
                let mut values = vec![0.0; HORIZON * 4];
                values[place] = step;
                let shift = Tensor::<1>::from_data(values.as_slice(), &Device::flex()).reshape([HORIZON, 1, 4]);
                f64::from(objective(&moved(&shift)).into_scalar::<f32>())
            };
            let slope = (at(1e-2) - at(-1e-2)) / 2e-2;
            let found = f64::from(gradient[place]);
            assert!((found - slope).abs() < 2e-2 * slope.abs().max(0.05), "{kind:?} {place}: {found} {slope}");
        }
    }
}

/// The state an actor sees has not consumed the action that is being chosen: another first action leaves the first row as it is and changes the second.
#[test]
fn an_action_is_not_seen_by_the_row_that_chooses_it() {
    let Learnt { dynamics, reward, starts, noise, .. } = learnt(ActionDistribution::BoundedNormal);
    let world = Learned { dynamics: &dynamics, reward: &reward };
    let with = |action: f32| {
        let act = |_, _: Tensor<3>| {
            let action = Tensor::<3>::full([1, ROWS, 2], action, &Device::flex());
            ActionSample { normal: action.clone(), action }
        };
        let imagined = imagine_with(&world, act, starts.clone(), &noise.latents);
        (to_values(imagined.features), to_values(imagined.rewards))
    };
    let ((left, left_rewards), (right, right_rewards)) = (with(-0.5), with(0.5));
    let row = ROWS * 17;
    assert_eq!(left[..row], right[..row]);
    assert_ne!(left[row..2 * row], right[row..2 * row]);
    assert_ne!(left_rewards[..ROWS], right_rewards[..ROWS], "the first reward is of the first action");
}

/// The kernel's numbers, and its gradients of every weight of the actor, are those of the ordinary operations: at more rows than two lanes have, the third of them short, and sizes that fill no
/// panel. That all sets of instructions make these numbers is tested beside the kernel.
#[test]
fn all_steps_in_one_kernel_are_the_steps_one_by_one() {
    for kind in [ActionDistribution::BoundedNormal, ActionDistribution::TanhNormal] {
        let Learnt { dynamics, reward, actor, .. } = learnt(kind);
        let (rows, device, mut rng) = (2 * Beginning::LANE + 5, Device::flex(), ChaCha8Rng::seed_from_u64(8));
        let starts = Starts {
            states: noise::<2>([rows, 12], &mut rng, &device).tanh(),
            latents: unit_norm(noise::<2>([rows, 5], &mut rng, &device)),
        };
        let noise = ImaginationNoise::draw([HORIZON, rows], [2, 5], &mut rng, &device);
        let (world, actor) = (Learned { dynamics: &dynamics, reward: &reward }, actor.train());
        let run = |of: (Imagination, Tensor<2>)| {
            let (imagined, entropy) = of;
            let numbers = [
                to_values(imagined.features.clone()),
                to_values(imagined.rewards.clone()),
                to_values(imagined.actions.action.clone()),
                to_values(entropy.clone()),
            ];
            let mut gradients = (objective(&imagined) + entropy.mean() * 0.3).backward();
            let gradients: Vec<Vec<f32>> = actor
                .mlp
                .weights()
                .into_iter()
                .flat_map(|(weight, bias)| {
                    let weight = weight.grad_remove(&mut gradients).unwrap();
                    [to_values(weight), to_values(bias.grad_remove(&mut gradients).unwrap())]
                })
                .collect();
            (numbers, gradients)
        };
        let (numbers, gradients) = run(fused(&world, &actor, &starts, &noise).expect("flex"));
        let (wanted, wanted_gradients) = run(stepwise(&world, &actor, starts, &noise));
        for (found, wanted) in numbers.iter().zip(&wanted) {
            assert_close(found, wanted, "numbers");
        }
        for (layer, (found, wanted)) in gradients.iter().zip(&wanted_gradients).enumerate() {
            let largest = wanted.iter().fold(1e-6_f32, |largest, x| largest.max(x.abs()));
            let scaled = |values: &[f32]| values.iter().map(|x| x / largest).collect::<Vec<f32>>();
            assert_close(&scaled(found), &scaled(wanted), &format!("{kind:?}, gradient {layer}"));
        }
    }
}
