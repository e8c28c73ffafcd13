//! Forward through imagined time.
//!
//! In: packed weights, starts, noise. Out: each lane's rows, and what the pass back needs.

use super::super::instructions::Instructions;
use super::super::product::PANEL;
use super::super::recurrence::{exp, logistic, tanh};
use super::super::sheet::{Activation, Dense, Sheet, panels};
use crate::actions::ActionDistribution;

/// Rows of a lane: enough for every weight that is read to be used often, and the same on any number of cores.
pub(super) const ROWS: usize = 64;

/// Sizes of one call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sizes {
    pub(super) horizon: usize,
    pub(super) rows: usize,
    pub(super) hidden: usize,
    pub(super) latent: usize,
    pub(super) actions: usize,
    /// Width of the hidden layers of actor, reward model and head.
    pub(super) actor: usize,
    pub(super) reward: usize,
    pub(super) head: usize,
    pub(super) floor: f32,
    pub(super) reward_scale: f32,
    pub(super) distribution: ActionDistribution,
}

impl Sizes {
    pub(super) fn h(self) -> usize {
        panels(self.hidden)
    }
    pub(super) fn s(self) -> usize {
        panels(self.latent)
    }
    pub(super) fn a(self) -> usize {
        panels(self.actions)
    }
    /// Numbers of the features, of the rewards and of the actor's outputs, in the order in which they lie in the output.
    pub(super) fn parts(self) -> [usize; 3] {
        let imagined = self.horizon * self.rows;
        [(imagined + self.rows) * (self.hidden + self.latent), imagined, imagined * 2 * self.actions]
    }

    /// The output, or its gradient, cut into these.
    pub(super) fn cut(self, numbers: &[f32]) -> [&[f32]; 3] {
        let [features, rewards, _] = self.parts();
        let (features, small) = numbers.split_at(features);
        let (rewards, outputs) = small.split_at(rewards);
        [features, rewards, outputs]
    }

    /// The same, to be written.
    pub(super) fn cut_mut(self, numbers: &mut [f32]) -> [&mut [f32]; 3] {
        let [features, rewards, _] = self.parts();
        let (features, small) = numbers.split_at_mut(features);
        let (rewards, outputs) = small.split_at_mut(rewards);
        [features, rewards, outputs]
    }
}

/// All weights as both passes read them.
#[derive(Debug)]
pub(super) struct Packed {
    pub(super) actor: [Dense; 3],
    pub(super) reward: [Dense; 3],
    pub(super) input: Dense,
    pub(super) hidden: Dense,
    pub(super) head: [Dense; 3],
}

/// Starts and noise, row-major.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given<'a> {
    pub(super) states: &'a [f32],
    pub(super) latents: &'a [f32],
    pub(super) action_noise: &'a [f32],
    pub(super) latent_noise: &'a [f32],
}

/// What one lane computed; row `k·count + row` is step `k` of the lane's row.
#[derive(Debug)]
pub(super) struct Lane {
    pub(super) at: usize,
    pub(super) count: usize,
    /// `[h | s | a]`, horizon + 1 steps.
    pub(super) x: Sheet,
    pub(super) actor: [Sheet; 3],
    pub(super) reward: [Sheet; 2],
    pub(super) rewards: Sheet,
    /// Reset, update, candidate and the recurrent share of the candidate, one after another.
    pub(super) gates: Sheet,
    pub(super) head: [Sheet; 3],
}

/// What noise and drawn number an action's dimension has: the number of the normal and, squashed or cut, the action.
pub(super) fn draw(distribution: ActionDistribution, mean: f32, spread: f32, noise: f32) -> (f32, f32) {
    let (mean, std) = moments(distribution, mean, spread);
    let normal = mean + std * noise;
    match distribution {
        ActionDistribution::BoundedNormal => (normal, normal.clamp(-1.0, 1.0)),
        ActionDistribution::TanhNormal => (normal, tanh(normal)),
    }
}

/// Mean and standard deviation of the normal, as [`ActionDistribution::of`] has them.
pub(super) fn moments(distribution: ActionDistribution, mean: f32, spread: f32) -> (f32, f32) {
    match distribution {
        ActionDistribution::BoundedNormal => (tanh(mean), 0.9 * logistic(spread + 2.0) + 0.1),
        ActionDistribution::TanhNormal => (5.0 * tanh(mean / 5.0), softplus(spread + crate::actions::RAW_FIVE) + 0.1),
    }
}

/// ln(1 + eˣ), stable at both ends.
pub(super) fn softplus(x: f32) -> f32 {
    x.max(0.0) + exp(-x.abs()).ln_1p()
}

/// Mean of unit norm and the norm's inverse, of the latent's numbers before it.
pub(super) fn unit(numbers: &mut [f32]) -> f32 {
    let inverse = 1.0 / (numbers.iter().map(|x| x * x).sum::<f32>() + 1e-12).sqrt();
    numbers.iter_mut().for_each(|x| *x *= inverse);
    inverse
}

impl Lane {
    pub(super) fn run(
        sizes: Sizes,
        packed: &Packed,
        given: Given<'_>,
        at: usize,
        count: usize,
        instructions: Instructions,
    ) -> Self {
        let rows = sizes.horizon * count;
        let sheet = |width: usize| Sheet::stale(panels(width), rows);
        let mut lane = Self {
            at,
            count,
            x: Sheet::zeros(sizes.h() + sizes.s() + sizes.a(), rows + count),
            actor: [sheet(sizes.actor), sheet(sizes.actor), Sheet::stale(2 * sizes.a(), rows)],
            reward: [sheet(sizes.reward), sheet(sizes.reward)],
            rewards: Sheet::stale(1, rows),
            gates: Sheet::stale(4 * sizes.h(), rows),
            head: [sheet(sizes.head), sheet(sizes.head), Sheet::stale(sizes.s() + 1, rows)],
        };
        let place = |width: usize, row: usize| (at + row) * width..(at + row + 1) * width;
        lane.x.fill((0, 0, count), sizes.hidden, |row| &given.states[place(sizes.hidden, row)]);
        lane.x.fill((sizes.h(), 0, count), sizes.latent, |row| &given.latents[place(sizes.latent, row)]);
        let mut scratch =
            Scratch { input: Sheet::stale(3 * sizes.h(), count), hidden: Sheet::stale(3 * sizes.h(), count) };
        for k in 0..sizes.horizon {
            lane.act(sizes, packed, given, k, instructions);
            lane.earn(sizes, packed, k, instructions);
            lane.advance(sizes, packed, &mut scratch, k, instructions);
            lane.arrive(sizes, packed, given, k, instructions);
        }
        lane
    }

    /// The actor's output at step `k`, and the action.
    fn act(&mut self, sizes: Sizes, packed: &Packed, given: Given<'_>, k: usize, instructions: Instructions) {
        let (from, count) = (k * self.count, self.count);
        let [one, two, out] = &mut self.actor;
        packed.actor[0].forward((&self.x, 0, from), (one, from), count, Activation::Elu, instructions);
        packed.actor[1].forward((one, 0, from), (two, from), count, Activation::Elu, instructions);
        packed.actor[2].forward((two, 0, from), (out, from), count, Activation::None, instructions);
        for row in 0..count {
            let noise = (k * sizes.rows + self.at + row) * sizes.actions;
            for dimension in 0..sizes.actions {
                let (panel, lane) = (dimension / PANEL, dimension % PANEL);
                let mean = out.part(panel, from + row, 1)[lane];
                let spread = out.part(sizes.a() + panel, from + row, 1)[lane];
                let noise = given.action_noise[noise + dimension];
                let (_, action) = draw(sizes.distribution, mean, spread, noise);
                self.x.part_mut(sizes.h() + sizes.s() + panel, from + row, 1)[lane] = action;
            }
        }
    }

    /// The expected reward of the action.
    fn earn(&mut self, sizes: Sizes, packed: &Packed, k: usize, instructions: Instructions) {
        let (from, count) = (k * self.count, self.count);
        let [one, two] = &mut self.reward;
        packed.reward[0].forward((&self.x, sizes.h(), from), (one, from), count, Activation::Elu, instructions);
        packed.reward[1].forward((one, 0, from), (two, from), count, Activation::Elu, instructions);
        packed.reward[2].forward((two, 0, from), (&mut self.rewards, from), count, Activation::None, instructions);
    }

    /// The next hidden state.
    fn advance(&mut self, sizes: Sizes, packed: &Packed, scratch: &mut Scratch, k: usize, instructions: Instructions) {
        let (from, count, h) = (k * self.count, self.count, sizes.h());
        let Scratch { input, hidden } = scratch;
        packed.input.forward((&self.x, h, from), (input, 0), count, Activation::None, instructions);
        packed.hidden.forward((&self.x, 0, from), (hidden, 0), count, Activation::None, instructions);
        for panel in 0..h {
            let given = [0, 1, 2].map(|gate| input.part(gate * h + panel, 0, count));
            let share = [0, 1, 2].map(|gate| hidden.part(gate * h + panel, 0, count));
            let made = self.gates.parts_mut([0, 1, 2, 3].map(|kind| (kind * h + panel, from)), count);
            let [before, after] = self.x.parts_mut([(panel, from), (panel, from + count)], count);
            instructions.run(
                #[inline(always)]
                || gates(given, share, before, made, after),
            );
        }
    }

    /// The next latent.
    fn arrive(&mut self, sizes: Sizes, packed: &Packed, given: Given<'_>, k: usize, instructions: Instructions) {
        let (from, count, h) = (k * self.count, self.count, sizes.h());
        let [one, two, out] = &mut self.head;
        packed.head[0].forward((&self.x, 0, from + count), (one, from), count, Activation::Elu, instructions);
        packed.head[1].forward((one, 0, from), (two, from), count, Activation::Elu, instructions);
        packed.head[2].forward((two, 0, from), (out, from), count, Activation::None, instructions);
        let mut mean = vec![0.0; sizes.latent];
        for row in 0..count {
            out.read(0, from + row, sizes.latent, &mut mean);
            unit(&mut mean);
            let std = softplus(out.part(sizes.s(), from + row, 1)[0]) + sizes.floor;
            let noise = &given.latent_noise[(k * sizes.rows + self.at + row) * sizes.latent..][..sizes.latent];
            for (number, noise) in mean.iter_mut().zip(noise) {
                *number += std * noise;
            }
            self.x.fill((h, from + count + row, 1), sizes.latent, |_| &mean);
        }
    }
}

struct Scratch {
    input: Sheet,
    hidden: Sheet,
}

#[inline(always)]
fn gates(given: [&[f32]; 3], share: [&[f32]; 3], before: &[f32], made: [&mut [f32]; 4], after: &mut [f32]) {
    let [resets, updates, candidates, inners] = made;
    let count = after.len();
    let [g0, g1, g2] = given.map(|given| &given[..count]);
    let [s0, s1, s2] = share.map(|share| &share[..count]);
    let before = &before[..count];
    let (resets, updates) = (&mut resets[..count], &mut updates[..count]);
    let (candidates, inners) = (&mut candidates[..count], &mut inners[..count]);
    for i in 0..count {
        let reset = logistic(g0[i] + s0[i]);
        let update = logistic(g1[i] + s1[i]);
        let inner = s2[i];
        let candidate = tanh(g2[i] + reset * inner);
        resets[i] = reset;
        updates[i] = update;
        candidates[i] = candidate;
        inners[i] = inner;
        after[i] = candidate + update * (before[i] - candidate);
    }
}
