//! The numbers of an evaluation on tables whose answer is known.

use super::*;

/// `[4 states, 3 distractors, 6 steps, 2]` made by a function of state, distractor and step.
fn table(of: impl Fn(usize, usize, usize) -> [f32; 2]) -> GridTable {
    let (states, distractors, steps) = (4, 3, 6);
    let mut values = Vec::new();
    for i in 0..states {
        for j in 0..distractors {
            (0..steps).for_each(|t| values.extend(of(i, j, t)));
        }
    }
    GridTable { states, distractors, steps, dims: 2, values }
}

/// A number of no pattern.
fn hash(i: usize, j: usize, t: usize) -> f32 {
    ((i * 7919 + j * 104_729 + t * 1_299_709 + 17) % 1009) as f32 / 1009.0
}

#[test]
fn shares_of_latents_that_follow_the_state_the_distractor_or_both() {
    let state = shares::shares(&table(|i, _, t| [i as f32 * t as f32, -(i as f32)]));
    assert!((state.state - 1.0).abs() < 1e-9 && state.within_state.abs() < 1e-9, "{state:?}");
    let distractor = shares::shares(&table(|_, j, t| [j as f32, j as f32 * t as f32]));
    assert!((distractor.distractor - 1.0).abs() < 1e-9, "{distractor:?}");
    // Independent sums: the states' variance is 1.25 = (0, 1, 2, 3), the distractors' ⅔ = (0, 1, 2).
    let both = shares::shares(&table(|i, j, _| [i as f32, j as f32]));
    assert!((both.state - 1.25 / (1.25 + 2.0 / 3.0)).abs() < 1e-6 && both.interaction.abs() < 1e-9, "{both:?}");
    let product = shares::shares(&table(|i, j, _| [(i as f32 - 1.5) * (j as f32 - 1.0), 0.0]));
    assert!((product.interaction - 1.0).abs() < 1e-6, "{product:?}");
}

#[test]
fn retrieval_is_certain_for_latents_of_the_state_and_blind_for_those_of_the_distractor() {
    let (found, chance) = retrieval::at_1(&table(|i, j, t| [i as f32 + 0.01 * hash(i, j, t), hash(i, 0, t)]));
    assert_eq!(found, 1.0);
    assert!((chance - 2.0 / 11.0).abs() < 1e-9);
    let (found, _) = retrieval::at_1(&table(|i, j, _| [j as f32, 0.001 * i as f32]));
    assert_eq!(found, 0.0);
}

#[test]
fn ridge_reads_what_is_there_and_nothing_else() {
    let rows = 400;
    let features: Vec<f32> = (0..rows * 3).map(|i| hash(i, i / 3, i % 3)).collect();
    let blocks: Vec<usize> = (0..rows).map(|row| row / 100).collect();
    let linear: Vec<f32> = features.chunks(3).flat_map(|x| [2.0 * x[0] - x[2] + 5.0, 3.0]).collect();
    let found = probe::held_out(&features, 3, &linear, 2, &blocks, 4);
    let r2 = probe::r_squared(&found, &linear, 2);
    assert!(r2[0] > 0.99 && r2[1].is_nan(), "{r2:?}");
    // A target that only tells the blocks apart cannot be carried over to a block that was held out.
    let by_block: Vec<f32> = blocks.iter().map(|&block| block as f32).collect();
    let r2 = probe::r_squared(&probe::held_out(&features, 3, &by_block, 1, &blocks, 4), &by_block, 1);
    assert!(r2[0] < 0.1, "{r2:?}");
}
