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

/// Columns beyond a half are not read, and what is beyond the last column of the left side is not summed.
#[test]
fn half_a_panel_and_a_sum_that_ends_within_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for (rows, k) in [1, 6, 13, 48].into_iter().flat_map(|rows| [1, 7, PANEL + 1, 2 * PANEL].map(|k| (rows, k))) {
        let (mut left, mut right) =
            (numbers(rows * k.next_multiple_of(PANEL), &mut rng), numbers(k.next_multiple_of(PANEL) * PANEL, &mut rng));
        let wanted = plain(&left, &right, rows, k, None);
        right.chunks_exact_mut(PANEL).for_each(|row| row[HALF..].fill(f32::NAN));
        right[k * PANEL..].fill(f32::NAN);
        for place in (k..k.next_multiple_of(PANEL)).flat_map(|at| (0..rows).map(move |row| (at, row))) {
            left[(place.0 / PANEL) * rows * PANEL + place.1 * PANEL + place.0 % PANEL] = f32::NAN;
        }
        for (instructions, columns) in available().flat_map(|set| [1, HALF].map(|columns| (set, columns))) {
            let mut out = vec![7.0; rows * PANEL];
            let left = Left::panels(&left, rows, k);
            left.times_columns(columns, &right, rows, &mut out, false, instructions);
            for (at, (found, wanted)) in out.iter().zip(&wanted).enumerate() {
                let wanted = if at % PANEL < HALF { *wanted } else { 0.0 };
                assert!((f64::from(*found) - wanted).abs() < 1e-4, "{instructions:?}, {rows} rows over {k}");
            }
            left.times_columns(columns, &right, rows, &mut out, true, instructions);
            assert!(out.chunks_exact(PANEL).all(|row| row[HALF..] == [0.0; HALF]), "the other half stays as it is");
            assert!((f64::from(out[0]) - 2.0 * wanted[0]).abs() < 1e-4, "added: {instructions:?}");
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
