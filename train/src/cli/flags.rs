//! The flags that lay over a preset and a configuration file, one for every entry of [`Options`](vibes_train::options::Options).

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use clap::Args;
use serde::Serialize;
use toml::Table;
use vibes_train::options::Options;

/// What to start from, and what lies over it.
#[derive(Debug, Clone, Args)]
pub(crate) struct OptionArgs {
    /// Sizes and rates to start from: tiny, small, base or paper.
    #[arg(long, default_value = "small")]
    preset: String,
    /// A TOML file of options laid over the preset, such as a run's config.toml.
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    #[command(flatten)]
    flags: OptionFlags,
}

/// One flag for every option; the preset's value holds where none is given.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Options over the preset")]
struct OptionFlags {
    /// vibes, no-adversary or reconstruction.
    #[arg(long)]
    objective: Option<String>,
    /// auto (pixels where there are any), pixels or vectors.
    #[arg(long)]
    observations: Option<String>,
    /// Of the first weights, the windows and the noise.
    #[arg(long)]
    seed: Option<u64>,
    /// Updates to make in all.
    #[arg(long)]
    updates: Option<u64>,
    /// Minutes to train in all, over every time the run was continued; 0 for no limit.
    #[arg(long)]
    minutes: Option<f64>,
    /// Windows a batch.
    #[arg(long)]
    batch: Option<usize>,
    /// Rows a window.
    #[arg(long)]
    length: Option<usize>,
    /// First rows of a mid-episode window that only warm up the hidden states.
    #[arg(long)]
    burn_in: Option<usize>,
    /// Step size of the world model.
    #[arg(long)]
    lr: Option<f64>,
    /// Updates over which it rises from 0.
    #[arg(long)]
    lr_warmup: Option<u64>,
    /// Updates after which both step sizes fall as 1/√updates; 0 for never.
    #[arg(long)]
    lr_decay: Option<u64>,
    /// Step size of the adversary.
    #[arg(long)]
    adversary_lr: Option<f64>,
    /// Adam's ε.
    #[arg(long)]
    adam_epsilon: Option<f64>,
    /// Largest norm of a gradient.
    #[arg(long)]
    gradient_clip: Option<f64>,
    /// Weight with which the encoder hears the dynamics term (1 as the paper writes it).
    #[arg(long)]
    dynamics_weight: Option<f64>,
    /// Updates before which it does not.
    #[arg(long)]
    dynamics_start: Option<u64>,
    /// Nats by which the reward must be predicted better than by the rewards' own distribution before it does.
    #[arg(long)]
    dynamics_after: Option<f64>,
    /// Updates after that over which the weight rises from 0.
    #[arg(long)]
    dynamics_warmup: Option<u64>,
    /// Weight of the reward term.
    #[arg(long)]
    reward_weight: Option<f64>,
    /// Whether the first scale of features and latents is set by the data.
    #[arg(long, value_name = "true|false")]
    calibrate: Option<bool>,
    /// Channels after the first convolution.
    #[arg(long)]
    depth: Option<usize>,
    /// Width of features and hidden states.
    #[arg(long)]
    hidden: Option<usize>,
    /// Width of the heads' hidden layers.
    #[arg(long)]
    head: Option<usize>,
    /// Dimensions of the latent.
    #[arg(long)]
    latent: Option<usize>,
    /// Standard deviation of the encoder.
    #[arg(long)]
    latent_std: Option<f64>,
    /// Least standard deviation of a predicted latent.
    #[arg(long)]
    prediction_floor: Option<f64>,
    /// Least standard deviation of a predicted reward.
    #[arg(long)]
    reward_floor: Option<f64>,
    /// Updates between checkpoints.
    #[arg(long)]
    checkpoint_every: Option<u64>,
    /// Updates a line of metrics covers.
    #[arg(long)]
    log_every: Option<u64>,
    /// Checkpoints to keep.
    #[arg(long)]
    keep: Option<usize>,
}

impl OptionArgs {
    /// The preset, the file, the flags: each over what came before.
    pub(crate) fn resolve(&self) -> Result<Options> {
        let mut layers = Vec::new();
        let name = self.config.as_ref().map(|path| path.display().to_string()).unwrap_or_default();
        if let Some(path) = &self.config {
            layers.push((name.as_str(), Options::read_table(path)?));
        }
        layers
            .push(("the arguments", Table::try_from(&self.flags).context("the arguments cannot be written as TOML")?));
        Ok(Options::resolve(&self.preset, &layers)?)
    }
}
