//! How long an update of a model-free agent takes, on made-up stacks. In: options, sizes. Out: milliseconds.

use std::time::Instant;

use burn::tensor::Device;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_model::sac::SacNetworks;

use super::options::SacOptions;
use super::transitions::{Ahead, Transitions};
use super::update::SacLearner;
use crate::error::Result;

/// The median time of `repeats` updates, milliseconds, each with a step of the actor; one more before them is not counted.
///
/// # Errors
/// The pictures are too small.
pub fn bench(options: &SacOptions, picture: usize, actions: usize, repeats: usize, device: &Device) -> Result<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let options = SacOptions { actor_every: 1, ..options.clone() };
    let bounds = (vec![-1.0; actions], vec![1.0; actions]);
    let config = options.networks("made-up", [picture, picture], bounds);
    let stack = picture * picture * config.channels();
    let mut stacks = || (0..options.batch * stack).map(|_| rng.random()).collect::<Vec<u8>>();
    let batch = Transitions {
        rows: options.batch,
        shape: [picture, picture, config.channels()],
        stacks: stacks(),
        next_stacks: stacks(),
        actions: (0..options.batch * actions).map(|_| rng.random_range(-1.0..1.0)).collect(),
        rewards: (0..options.batch).map(|_| rng.random()).collect(),
        ahead: None,
    };
    let ahead = (config.sequence > 0).then(|| Ahead {
        steps: config.sequence,
        stacks: batch.stacks.repeat(config.sequence),
        rewards: (0..options.batch * config.sequence).map(|_| rng.random()).collect(),
    });
    let batch = Transitions { ahead, ..batch };
    let mut learner = SacLearner::new(SacNetworks::init(config, &mut rng, device)?, device);
    let mut times = Vec::with_capacity(repeats);
    for made in 0..=repeats as u64 {
        let begun = Instant::now();
        (learner, _) = learner.update(&batch, &options, made, &mut rng)?;
        times.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    let times = &mut times[1..];
    times.sort_by(f64::total_cmp);
    Ok(times.get(times.len() / 2).copied().unwrap_or(f64::NAN))
}
