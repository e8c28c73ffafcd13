//! Back through imagined time, to the actor's weights.
//!
//! In: a lane of the forward pass, and the gradient of its rows. Out: the gradient of the actor's weights and biases.

use super::super::instructions::Instructions;
use super::super::product::PANEL;
use super::super::recurrence::{logistic, tanh};
use super::super::sheet::{LayerGradients, Sheet, panels, through_elu};
use super::forward::{Given, Lane, Packed, Sizes, draw, moments, unit};
use crate::actions::{ActionDistribution, RAW_FIVE};

/// Gradients that are carried from a step to the one before.
struct Carried {
    /// Of `[h | s]` at the step after.
    state: Sheet,
    /// Of `h` before the step.
    before: Sheet,
    /// Of `[s | a]`.
    input: Sheet,
    gates: [Sheet; 2],
    head: [Sheet; 3],
    reward: [Sheet; 3],
}

/// `output` is the gradient of the output, in its parts.
pub(super) fn lane_backward(
    sizes: Sizes,
    packed: &Packed,
    given: Given<'_>,
    lane: &Lane,
    output: &[f32],
    instructions: Instructions,
) -> LayerGradients {
    let (count, horizon) = (lane.count, sizes.horizon);
    let sheet = |panels: usize| Sheet::zeros(panels, count);
    let mut carried = Carried {
        state: sheet(sizes.h() + sizes.s()),
        before: sheet(sizes.h()),
        input: sheet(sizes.s() + sizes.a()),
        gates: [sheet(3 * sizes.h()), sheet(3 * sizes.h())],
        head: [panels(sizes.head), panels(sizes.head), sizes.s() + 1].map(sheet),
        reward: [panels(sizes.reward), panels(sizes.reward), 1].map(sheet),
    };
    let mut outputs = Sheet::zeros(2 * sizes.a(), horizon * count);
    let ([features, rewards, drawn], width) = (sizes.cut(output), sizes.hidden + sizes.latent);
    let place = |k: usize, row: usize| k * sizes.rows + lane.at + row;
    let seen = |k: usize, row: usize| &features[place(k, row) * width..][..width];
    add_features(sizes, &mut carried.state, count, |row| seen(horizon, row));
    for k in (0..horizon).rev() {
        carried.leave(sizes, packed, given, lane, k, instructions);
        carried.withdraw(sizes, packed, lane, k, instructions);
        carried.repay(sizes, packed, lane, k, |row| rewards[place(k, row)], instructions);
        carried.choose(sizes, given, lane, k, &mut outputs, |row| &drawn[place(k, row) * 2 * sizes.actions..]);
        carried.turn(sizes, count);
        add_features(sizes, &mut carried.state, count, |row| seen(k, row));
    }
    learn(sizes, packed, lane, outputs, instructions)
}

/// Adds the gradient of the features themselves to that of `[h | s]`.
fn add_features<'a>(sizes: Sizes, state: &mut Sheet, count: usize, row_of: impl Fn(usize) -> &'a [f32]) {
    for row in 0..count {
        let numbers = row_of(row);
        let (hidden, latent) = (&numbers[..sizes.hidden], &numbers[sizes.hidden..sizes.hidden + sizes.latent]);
        for (first, numbers) in [(0, hidden), (sizes.h(), latent)] {
            for (panel, numbers) in numbers.chunks(PANEL).enumerate() {
                let place = state.part_mut(first + panel, row, 1);
                place.iter_mut().zip(numbers).for_each(|(sum, more)| *sum += more);
            }
        }
    }
}

impl Carried {
    /// From the latent of step `k + 1` through the head to the hidden state there.
    fn leave(
        &mut self,
        sizes: Sizes,
        packed: &Packed,
        given: Given<'_>,
        lane: &Lane,
        k: usize,
        instructions: Instructions,
    ) {
        let (from, count) = (k * lane.count, lane.count);
        let [one, two, out] = &mut self.head;
        let (mut mean, mut gradient) = (vec![0.0; sizes.latent], vec![0.0; sizes.latent]);
        for row in 0..count {
            lane.head[2].read(0, from + row, sizes.latent, &mut mean);
            let inverse = unit(&mut mean);
            for panel in 0..sizes.s() {
                let place = panel * PANEL..sizes.latent.min((panel + 1) * PANEL);
                let numbers = self.state.part(sizes.h() + panel, row, 1);
                gradient[place.clone()].copy_from_slice(&numbers[..place.len()]);
            }
            let noise = &given.latent_noise[(k * sizes.rows + lane.at + row) * sizes.latent..][..sizes.latent];
            let spread: f32 = gradient.iter().zip(noise).map(|(gradient, noise)| gradient * noise).sum();
            let along: f32 = gradient.iter().zip(&mean).map(|(gradient, mean)| gradient * mean).sum();
            // Only what is tangential to the sphere passes, and the longer the vector was the less of it.
            for (gradient, mean) in gradient.iter_mut().zip(&mean) {
                *gradient = (*gradient - mean * along) * inverse;
            }
            out.fill((0, row, 1), sizes.latent, |_| &gradient);
            let raw = lane.head[2].part(sizes.s(), from + row, 1)[0];
            out.part_mut(sizes.s(), row, 1)[0] = spread * logistic(raw);
        }
        packed.head[2].backward((out, 0), (two, 0, 0), count, false, instructions);
        through_elu(two, (&lane.head[1], from), panels(sizes.head), count, instructions);
        packed.head[1].backward((two, 0), (one, 0, 0), count, false, instructions);
        through_elu(one, (&lane.head[0], from), panels(sizes.head), count, instructions);
        packed.head[0].backward((one, 0), (&mut self.state, 0, 0), count, true, instructions);
    }

    /// From the hidden state of step `k + 1` through the GRU to the state, latent and action of step `k`.
    fn withdraw(&mut self, sizes: Sizes, packed: &Packed, lane: &Lane, k: usize, instructions: Instructions) {
        let (from, count, h) = (k * lane.count, lane.count, sizes.h());
        let [input, hidden] = &mut self.gates;
        for panel in 0..h {
            let after = self.state.part(panel, 0, count);
            let [reset, update, candidate, inner] =
                [0, 1, 2, 3].map(|kind| lane.gates.part(kind * h + panel, from, count));
            let before = lane.x.part(panel, from, count);
            let places = [0, 1, 2].map(|gate| (gate * h + panel, 0));
            let (to_input, to_hidden) = (input.parts_mut(places, count), hidden.parts_mut(places, count));
            let through = self.before.part_mut(panel, 0, count);
            instructions.run(
                #[inline(always)]
                || gates(after, [reset, update, candidate, inner], before, to_input, to_hidden, through),
            );
        }
        packed.hidden.backward((hidden, 0), (&mut self.before, 0, 0), count, true, instructions);
        packed.input.backward((input, 0), (&mut self.input, 0, 0), count, false, instructions);
    }

    /// From the reward of step `k` to its latent and action.
    fn repay(
        &mut self,
        sizes: Sizes,
        packed: &Packed,
        lane: &Lane,
        k: usize,
        of_reward: impl Fn(usize) -> f32,
        instructions: Instructions,
    ) {
        let (from, count) = (k * lane.count, lane.count);
        let [one, two, out] = &mut self.reward;
        for row in 0..count {
            out.part_mut(0, row, 1)[0] = of_reward(row) * sizes.reward_scale;
        }
        packed.reward[2].backward((out, 0), (two, 0, 0), count, false, instructions);
        through_elu(two, (&lane.reward[1], from), panels(sizes.reward), count, instructions);
        packed.reward[1].backward((two, 0), (one, 0, 0), count, false, instructions);
        through_elu(one, (&lane.reward[0], from), panels(sizes.reward), count, instructions);
        packed.reward[0].backward((one, 0), (&mut self.input, 0, 0), count, true, instructions);
    }

    /// From the action of step `k` to the actor's output, to whose own gradient it is added.
    fn choose<'a>(
        &self,
        sizes: Sizes,
        given: Given<'_>,
        lane: &Lane,
        k: usize,
        outputs: &mut Sheet,
        own: impl Fn(usize) -> &'a [f32],
    ) {
        let (from, actions) = (k * lane.count, sizes.actions);
        for row in 0..lane.count {
            let own = own(row);
            for dimension in 0..actions {
                let (panel, place) = (dimension / PANEL, dimension % PANEL);
                let mean = lane.actor[2].part(panel, from + row, 1)[place];
                let spread = lane.actor[2].part(sizes.a() + panel, from + row, 1)[place];
                let noise = given.action_noise[(k * sizes.rows + lane.at + row) * actions + dimension];
                let of_action = self.input.part(sizes.s() + panel, row, 1)[place];
                let (of_mean, of_spread) = through_draw(sizes.distribution, mean, spread, noise, of_action);
                outputs.part_mut(panel, from + row, 1)[place] = own[dimension] + of_mean;
                outputs.part_mut(sizes.a() + panel, from + row, 1)[place] = own[actions + dimension] + of_spread;
            }
        }
    }

    /// What was of step `k` is now of the step after the next one to come.
    fn turn(&mut self, sizes: Sizes, count: usize) {
        for panel in 0..sizes.h() {
            self.state.part_mut(panel, 0, count).copy_from_slice(self.before.part(panel, 0, count));
        }
        for panel in 0..sizes.s() {
            let latent = self.input.part(panel, 0, count);
            self.state.part_mut(sizes.h() + panel, 0, count).copy_from_slice(latent);
        }
    }
}

/// Gradients of an actor's two outputs from that of the action drawn with them; through a cut as if there were none.
fn through_draw(distribution: ActionDistribution, mean: f32, spread: f32, noise: f32, of_action: f32) -> (f32, f32) {
    match distribution {
        ActionDistribution::BoundedNormal => {
            let (center, _) = moments(distribution, mean, spread);
            let share = logistic(spread + 2.0);
            (of_action * (1.0 - center * center), of_action * noise * 0.9 * share * (1.0 - share))
        }
        ActionDistribution::TanhNormal => {
            let (_, action) = draw(distribution, mean, spread, noise);
            let of_normal = of_action * (1.0 - action * action);
            let bent = tanh(mean / 5.0);
            (of_normal * (1.0 - bent * bent), of_normal * noise * logistic(spread + RAW_FIVE))
        }
    }
}

#[inline(always)]
fn gates(
    after: &[f32],
    [resets, updates, candidates, inners]: [&[f32]; 4],
    before: &[f32],
    [to_reset, to_update, to_candidate]: [&mut [f32]; 3],
    [of_reset, of_update, to_inner]: [&mut [f32]; 3],
    through: &mut [f32],
) {
    let count = after.len();
    let (resets, updates, candidates) = (&resets[..count], &updates[..count], &candidates[..count]);
    let (inners, before) = (&inners[..count], &before[..count]);
    let (to_reset, to_update, to_candidate) =
        (&mut to_reset[..count], &mut to_update[..count], &mut to_candidate[..count]);
    let (of_reset, of_update) = (&mut of_reset[..count], &mut of_update[..count]);
    let (to_inner, through) = (&mut to_inner[..count], &mut through[..count]);
    for i in 0..count {
        let (reset, update, candidate) = (resets[i], updates[i], candidates[i]);
        let of_candidate = after[i] * (1.0 - update) * (1.0 - candidate * candidate);
        to_candidate[i] = of_candidate;
        to_inner[i] = of_candidate * reset;
        to_reset[i] = of_candidate * inners[i] * reset * (1.0 - reset);
        of_reset[i] = to_reset[i];
        to_update[i] = after[i] * (before[i] - candidate) * update * (1.0 - update);
        of_update[i] = to_update[i];
        through[i] = after[i] * update;
    }
}

/// All steps at once: from the actor's outputs to its weights.
fn learn(sizes: Sizes, packed: &Packed, lane: &Lane, outputs: Sheet, instructions: Instructions) -> LayerGradients {
    let (count, width) = (outputs.rows(), panels(sizes.actor));
    let mut two = Sheet::stale(width, count);
    packed.actor[2].backward((&outputs, 0), (&mut two, 0, 0), count, false, instructions);
    through_elu(&mut two, (&lane.actor[1], 0), width, count, instructions);
    let mut one = Sheet::stale(width, count);
    packed.actor[1].backward((&two, 0), (&mut one, 0, 0), count, false, instructions);
    through_elu(&mut one, (&lane.actor[0], 0), width, count, instructions);
    let inputs = [(&lane.x, sizes.hidden + sizes.latent), (&lane.actor[0], sizes.actor), (&lane.actor[1], sizes.actor)];
    let gradients = [(&one, sizes.actor), (&two, sizes.actor), (&outputs, 2 * sizes.actions)];
    let mut found = [const { (Vec::new(), Vec::new()) }; 3];
    for (layer, ((x, input), (gradient, output))) in inputs.into_iter().zip(gradients).enumerate() {
        let (mut weight, mut bias) = (vec![0.0; input * output], vec![0.0; output]);
        packed.actor[layer].learn((x, 0), gradient, count, (&mut weight, &mut bias), instructions);
        found[layer] = (weight, bias);
    }
    found
}
