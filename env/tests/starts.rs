//! Every task starts where `dm_control`'s does: the distribution of the first observation, number by number.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use vibes_env::{Environment, EnvironmentOptions};

#[derive(Deserialize)]
struct Golden {
    resets: usize,
    /// `[observation][9]`.
    deciles: Vec<Vec<f64>>,
}

const RESETS: usize = 1500;

/// Standard errors; there are some 900 comparisons, and a normal variable passes 5 once in two million.
const LARGEST: f64 = 5.0;

fn first_observations(task: &str) -> Vec<Vec<f64>> {
    let mut environment = Environment::new(task, EnvironmentOptions::default()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut draw = || {
        environment.reset(&mut rng).unwrap();
        let mut observation = Vec::new();
        environment.observe(&mut observation);
        observation
    };
    (0..RESETS).map(|_| draw()).collect()
}

#[test]
fn first_observations_are_distributed_as_in_dm_control() {
    let golden: BTreeMap<String, Golden> = serde_json::from_str(include_str!("golden/starts.json")).unwrap();
    assert_eq!(golden.len(), 7);
    for (task, golden) in golden {
        let rows = first_observations(&task);
        assert_eq!(rows[0].len(), golden.deciles.len(), "{task}");
        for (place, deciles) in golden.deciles.iter().enumerate() {
            if deciles[8] - deciles[0] < 1e-12 {
                let other =
                    rows.iter().map(|row| row[place]).find(|ours| (ours - deciles[0]).abs() >= 1e-9 || ours.is_nan());
                assert_eq!(other, None, "{task}: number {place} always starts at {}", deciles[0]);
                continue;
            }
            for (index, decile) in deciles.iter().enumerate() {
                let expected = (index as f64 + 1.0) / 10.0;
                let below = rows.iter().filter(|row| row[place] < *decile).count() as f64 / RESETS as f64;
                let variance = expected * (1.0 - expected) * (1.0 / RESETS as f64 + 1.0 / golden.resets as f64);
                let errors = (below - expected).abs() / variance.sqrt();
                assert!(
                    errors < LARGEST,
                    "{task}: {below} of number {place} are below dm_control's {expected} quantile"
                );
            }
        }
    }
}
