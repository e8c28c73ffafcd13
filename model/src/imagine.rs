//! Imagination: the actor acts in the learned dynamics, from states that the encoder and the dynamics reached in a recording. In: states `(h_0, s_0)`, an actor,
//! a world model and noise. Out: `horizon` actions and rewards, and `horizon + 1` rows of what the actor and the critic see.
//!
//! ```text
//! a_k ~ π(h_k, s_k)      r_k = E r(s_k, a_k)      h_{k+1} = f(h_k, s_k, a_k)      s_{k+1} ~ p(· | h_{k+1})
//! ```
//!
//! `h_k` has not consumed `a_k`. The world model's weights are constants here, but gradients flow through it: from rewards and later rows back to the actions,
//! and so to the actor. The actor's own input is cut off, as in Dreamer: an action is judged by what it leads to, given how the later ones are chosen.

use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::actions::{ActionSample, noise};
use crate::actor::{Actor, features};
use crate::dynamics::Dynamics;
use crate::gaussian::LatentForm;
use crate::kernels::{ActorWeights, Beginning, WorldWeights, imagination};
use crate::reward::Reward;

/// Where imagination starts.
#[derive(Debug, Clone)]
pub struct Starts {
    /// The dynamics' state before an action is consumed: `[rows, hidden]`
    pub states: Tensor<2>,
    /// Samples of the latent: `[rows, latent]`
    pub latents: Tensor<2>,
}

/// The standard normal numbers that one imagination draws on.
#[derive(Debug, Clone)]
pub struct ImaginationNoise {
    /// `[horizon, rows, A]`
    pub actions: Tensor<3>,
    /// `[horizon, rows, latent]`
    pub latents: Tensor<3>,
}

/// What was imagined.
#[derive(Debug, Clone)]
pub struct Imagination {
    /// `[horizon + 1, rows, hidden + latent]`
    pub features: Tensor<3>,
    /// `[horizon, rows]`
    pub rewards: Tensor<2>,
    /// What was drawn: `[horizon, rows, A]`
    pub actions: ActionSample<3>,
}

impl ImaginationNoise {
    /// Draws the noise of one imagination.
    pub fn draw(shape: [usize; 2], [actions, latent]: [usize; 2], rng: &mut impl Rng, device: &Device) -> Self {
        let [horizon, rows] = shape;
        Self {
            actions: noise([horizon, rows, actions], rng, device),
            latents: noise([horizon, rows, latent], rng, device),
        }
    }

    /// How many steps it is for.
    pub fn horizon(&self) -> usize {
        self.actions.dims()[0]
    }
}

/// What can be imagined in: the learned world, or a made-up one whose returns are known.
pub trait LatentWorld {
    /// Expected rewards of actions: `[1, rows, latent]` and `[1, rows, A]` to `[1, rows, 1]`.
    fn reward(&self, latents: Tensor<3>, actions: Tensor<3>) -> Tensor<3>;

    /// The states and latents after an action: `[1, rows, hidden]` and `[1, rows, latent]`; `noise` has the latents' shape.
    fn step(
        &self,
        states: Tensor<3>,
        latents: Tensor<3>,
        actions: Tensor<3>,
        noise: Tensor<3>,
    ) -> (Tensor<3>, Tensor<3>);
}

/// The learned world, without autodiff, so that its weights are constants.
#[derive(Debug)]
pub struct Learned<'a> {
    /// Next latents.
    pub dynamics: &'a Dynamics,
    /// Rewards.
    pub reward: &'a Reward,
}

impl LatentWorld for Learned<'_> {
    fn reward(&self, latents: Tensor<3>, actions: Tensor<3>) -> Tensor<3> {
        self.reward.forward(latents, actions).mean
    }

    fn step(
        &self,
        states: Tensor<3>,
        latents: Tensor<3>,
        actions: Tensor<3>,
        noise: Tensor<3>,
    ) -> (Tensor<3>, Tensor<3>) {
        let (next, states) = self.dynamics.forward(latents, actions, Some(states.squeeze_dim(0)));
        (states, next.mean + next.std * noise)
    }
}

/// Imagines with an actor; see the module. Also returns the entropy of what each action was drawn from: `[horizon, rows]`.
pub fn imagine(
    world: &Learned<'_>,
    actor: &Actor,
    starts: Starts,
    noise: &ImaginationNoise,
) -> (Imagination, Tensor<2>) {
    match fused(world, actor, &starts, noise) {
        Some(imagined) => imagined,
        None => stepwise(world, actor, starts, noise),
    }
}

/// By the kernel that holds all steps, where it applies.
fn fused(
    world: &Learned<'_>,
    actor: &Actor,
    starts: &Starts,
    noise: &ImaginationNoise,
) -> Option<(Imagination, Tensor<2>)> {
    let Learned { dynamics, reward } = world;
    // The kernel knows latents of unit norm alone.
    if dynamics.form() != LatentForm::UnitNorm {
        return None;
    }
    let gru = &dynamics.gru;
    let weights = WorldWeights {
        reward: reward.head.weights(),
        reward_scale: reward.scale(),
        gru: [(gru.w_input.val(), gru.b_input.val()), (gru.w_hidden.val(), gru.b_hidden.val())],
        head: dynamics.head.weights(),
        floor: dynamics.floor(),
    };
    let beginning = Beginning {
        states: starts.states.clone(),
        latents: starts.latents.clone(),
        action_noise: noise.actions.clone(),
        latent_noise: noise.latents.clone(),
    };
    let distribution = actor.distribution();
    let imagined = imagination(&weights, &ActorWeights { layers: actor.mlp.weights(), distribution }, beginning)?;
    let actions = distribution.of(imagined.outputs);
    let sample = actions.sample(noise.actions.clone());
    let entropy = actions.entropy(&sample).squeeze_dim(2);
    Some((Imagination { features: imagined.features, rewards: imagined.rewards, actions: sample }, entropy))
}

/// Step after step by ordinary operations.
fn stepwise(world: &Learned<'_>, actor: &Actor, starts: Starts, noise: &ImaginationNoise) -> (Imagination, Tensor<2>) {
    let mut entropies = Vec::with_capacity(noise.horizon());
    let act = |k: usize, features: Tensor<3>| {
        let actions = actor.forward(features.detach());
        let sample = actions.sample(noise.actions.clone().narrow(0, k, 1));
        entropies.push(actions.entropy(&sample));
        sample
    };
    let imagined = imagine_with(world, act, starts, &noise.latents);
    (imagined, Tensor::cat(entropies, 0).squeeze_dim(2))
}

/// Imagines with any choice of actions: `act` gets the step's number and the features `[1, rows, hidden + latent]`.
pub fn imagine_with(
    world: &impl LatentWorld,
    mut act: impl FnMut(usize, Tensor<3>) -> ActionSample<3>,
    starts: Starts,
    noise: &Tensor<3>,
) -> Imagination {
    let horizon = noise.dims()[0];
    let (mut states, mut latents) = (starts.states.unsqueeze_dim::<3>(0), starts.latents.unsqueeze_dim::<3>(0));
    let (mut seen, mut rewards) = (Vec::with_capacity(horizon + 1), Vec::with_capacity(horizon));
    let (mut drawn, mut actions) = (Vec::with_capacity(horizon), Vec::with_capacity(horizon));
    for k in 0..horizon {
        let here = features(states.clone(), latents.clone());
        let sample = act(k, here.clone());
        rewards.push(world.reward(latents.clone(), sample.action.clone()));
        (states, latents) = world.step(states, latents, sample.action.clone(), noise.clone().narrow(0, k, 1));
        seen.push(here);
        drawn.push(sample.normal);
        actions.push(sample.action);
    }
    seen.push(features(states, latents));
    Imagination {
        features: Tensor::cat(seen, 0),
        rewards: Tensor::cat(rewards, 0).squeeze_dim(2),
        actions: ActionSample { normal: Tensor::cat(drawn, 0), action: Tensor::cat(actions, 0) },
    }
}

#[cfg(test)]
mod tests;
