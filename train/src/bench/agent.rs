//! How long an update of an agent without a world model takes, on made-up windows. In: options, sizes. Out: milliseconds.

use std::time::Instant;

use burn::tensor::Device;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Sizes, made_up_spec, made_up_windows_of, median, ms};
use crate::error::Result;
use crate::learners::model_free::AgentOptions;
use crate::learners::sac;

/// The median time of an update in which everything makes a step: of one that looks at stacks from the stacks on, of one that remembers from the windows on.
///
/// # Errors
/// The pictures are too small.
pub fn bench_agent(options: &AgentOptions, sizes: Sizes, device: &Device) -> Result<f64> {
    if let AgentOptions::Stacks(options) = options {
        return sac::bench::bench(options, sizes.picture, sizes.actions, sizes.repeats, device);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let windows = made_up_windows_of(options.windows(), sizes, &mut rng);
    let mut learner = options.learner(&made_up_spec(sizes), &mut rng, device)?;
    let mut times = Vec::with_capacity(sizes.repeats + 1);
    for made in 0..=sizes.repeats as u64 {
        let begun = Instant::now();
        (learner, _) = learner.update(&windows, options, made, &mut rng)?;
        times.push(ms(begun));
    }
    Ok(median(&times))
}
