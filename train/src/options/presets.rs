//! The presets: sizes and rates to start from, by name.

use toml::Table;

use crate::learners::declared;
use crate::learners::objective::Objective;
use crate::settings::own::Own;
use crate::settings::{Observations, Settings};

/// Makes a preset's settings.
pub type Preset = fn() -> Settings;

/// The presets, by name.
pub const PRESETS: [(&str, Preset); 5] =
    [("tiny", tiny), ("small", small), ("base", base), ("paper", paper), ("paper-small", paper_small)];

/// What is laid over the preset `small` for the paper's objective, with and without the adversary, chosen by measurement (docs/results.md). The paper has none of these terms; without them the latents
/// know the state of a cartpole only up to its mirror image, which no policy can steer by. The systems that the paper compares with stay as they were published.
/// Nothing for the other presets and objectives.
pub fn recipe(preset: &str, objective: Objective) -> Table {
    if preset != "small" || !objective.takes_recipe() {
        return Table::new();
    }
    toml::toml! {
        dynamics_weight = 0.03
        dynamics_warmup = 2000
        inverse_weight = 1.0
        latent_steps = 5
        reward_steps = 5
    }
}

/// For a CPU: what learned fastest per hour in the first trials.
pub fn small() -> Settings {
    Settings {
        observations: Observations::Auto,
        seed: 0,
        batch: 8,
        length: 16,
        burn_in: 2,
        lr: 1e-3,
        lr_warmup: 1000,
        lr_decay: 0,
        adversary_lr: 2e-3,
        adam_epsilon: 1e-8,
        gradient_clip: 100.0,
        dynamics_weight: 0.3,
        dynamics_start: 1000,
        dynamics_after: 0.25,
        dynamics_warmup: 10_000,
        reward_weight: 1.0,
        calibrate: true,
        depth: 16,
        hidden: 256,
        head: 256,
        latent: 32,
        latent_std: 0.1,
        prediction_floor: 0.1,
        reward_floor: 0.1,
        reward_scale: 0.0,
        gru_update_bias: 0.0,
        updates: 50_000,
        minutes: 0.0,
        checkpoint_every: 500,
        log_every: 20,
        keep: 3,
        own: Own::defaults(declared()),
    }
}

/// For tests: seconds, not minutes.
fn tiny() -> Settings {
    Settings {
        batch: 4,
        length: 8,
        depth: 4,
        hidden: 32,
        head: 32,
        latent: 8,
        lr_warmup: 0,
        dynamics_weight: 0.03,
        dynamics_start: 0,
        dynamics_after: 0.0,
        dynamics_warmup: 0,
        updates: 200,
        checkpoint_every: 50,
        log_every: 5,
        ..small()
    }
}

/// The size of the networks most often used with such pictures; a machine with many cores or a GPU.
fn base() -> Settings {
    Settings {
        batch: 16,
        length: 32,
        burn_in: 4,
        depth: 32,
        lr: 3e-4,
        adversary_lr: 6e-4,
        updates: 100_000,
        checkpoint_every: 1000,
        ..small()
    }
}

/// The objective with the weights it is written with, at Dreamer's sizes (which the paper replaces the model learning of). The paper gives no rates and no floors; the
/// adversary's rate is above the model's as it asks, and the floors are low enough never to matter to a latent that carries noise of 0.1.
fn paper() -> Settings {
    Settings {
        batch: 50,
        length: 50,
        burn_in: 0,
        depth: 32,
        hidden: 200,
        head: 200,
        latent: 30,
        dynamics_weight: 1.0,
        dynamics_start: 0,
        dynamics_after: 0.0,
        dynamics_warmup: 0,
        lr_warmup: 0,
        calibrate: false,
        lr: 3e-4,
        adversary_lr: 6e-4,
        prediction_floor: 0.01,
        reward_floor: 0.01,
        reward_scale: 1.0,
        updates: 100_000,
        ..small()
    }
}

/// The same at sizes that a CPU trains in hours: windows as long as those, fewer of them, smaller networks.
fn paper_small() -> Settings {
    Settings { batch: 16, depth: 16, updates: 20_000, checkpoint_every: 500, ..paper() }
}
