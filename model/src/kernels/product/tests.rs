//! Every set of instructions makes the same product, and the wider ones make it sooner.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::time::{Duration, Instant};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

fn available() -> impl Iterator<Item = Instructions> {
    [Instructions::Portable, Instructions::Avx2, Instructions::Avx512].into_iter().filter(|set| set.available())
}

fn numbers(count: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// One panel of the product of panels, number by number in double precision.
fn plain(left: &[f32], right: &[f32], rows: usize, k: usize, before: Option<&[f32]>) -> Vec<f64> {
    let x = |row: usize, at: usize| f64::from(left[(at / PANEL) * rows * PANEL + row * PANEL + at % PANEL]);
    let places = (0..rows).flat_map(|row| (0..PANEL).map(move |column| (row, column)));
    places
        .map(|(row, column)| {
            let sum: f64 = (0..k).map(|at| x(row, at) * f64::from(right[at * PANEL + column])).sum();
            sum + before.map_or(0.0, |before| f64::from(before[row * PANEL + column]))
        })
        .collect()
}

#[test]
fn every_set_of_instructions_makes_the_product_for_every_number_of_rows() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for rows in (1..=27).chain([47, 48, 49, 101]) {
        for k in [PANEL, 3 * PANEL] {
            let (left, right) = (numbers(rows * k, &mut rng), numbers(k * PANEL, &mut rng));
            let before = numbers(rows * PANEL, &mut rng);
            for (add, instructions) in [false, true].into_iter().flat_map(|add| available().map(move |set| (add, set)))
            {
                let mut out = before.clone();
                Left::panels(&left, rows, k).times(&right, rows, &mut out, add, instructions);
                for (found, wanted) in out.iter().zip(plain(&left, &right, rows, k, add.then_some(&before))) {
                    assert!((f64::from(*found) - wanted).abs() < 1e-4, "{instructions:?}, {rows} rows, add: {add}");
                }
            }
        }
    }
}

/// A kernel that is not compiled for the instructions that it asks for calls a function for every fused sum, and takes a hundred times as long as portable code.
#[test]
fn wider_instructions_are_no_slower() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (rows, k) = (96, 8 * PANEL);
    let (left, right) = (numbers(rows * k, &mut rng), numbers(k * PANEL, &mut rng));
    let mut out = vec![0.0; rows * PANEL];
    let mut shortest = |instructions| -> Duration {
        let mut once = || {
            let begun = Instant::now();
            for _ in 0..20 {
                Left::panels(&left, rows, k).times(&right, rows, &mut out, true, instructions);
            }
            begun.elapsed()
        };
        (0..9).map(|_| once()).min().unwrap()
    };
    let times: Vec<(Instructions, Duration)> = available().map(|set| (set, shortest(set))).collect();
    for pair in times.windows(2) {
        // Half as much again is room for a busy machine; the fault was a hundredfold.
        assert!(pair[1].1 < pair[0].1 * 3 / 2, "{times:?}");
    }
}
