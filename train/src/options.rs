//! Everything a training run can be asked for, its presets, and how the final values come about: the preset, then a TOML file, then flags, each laid over
//! what came before. Saved as `config.toml` in the run folder, which `--config` reads again.

use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Table;
use vibes_model::{ModelConfig, ObservationKind};

use crate::error::{Result, TrainError, io, malformed};
use crate::learners::auxiliary::{asked, steps_ahead};
use crate::learners::objective::Objective;

mod effect;
pub mod own;
pub mod presets;

use own::Own;
use presets::PRESETS;

/// What the model looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Observations {
    /// Pixels where the recording has them, otherwise vectors.
    Auto,
    /// Pictures.
    Pixels,
    /// The task's vector observation.
    Vectors,
}

/// The resolved options of a run. The paper leaves all of these open but `latent_std`; every choice is explained at its field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Which objective.
    pub objective: Objective,
    /// What the model looks at.
    pub observations: Observations,
    /// Seed of the first weights, the windows and the noise.
    pub seed: u64,
    /// Windows a batch.
    pub batch: usize,
    /// Rows a window. Short windows got further per hour than long ones.
    pub length: usize,
    /// First rows of a window that begins in mid-episode which only warm up the hidden states: they start from zeros with the true previous action, see
    /// all observations, and carry no term of the objective. Windows that begin with their episode count whole.
    pub burn_in: usize,
    /// Adam's step size for the world model (`η_θ = η_φ`).
    pub lr: f64,
    /// Updates over which the world model's step size rises from zero to `lr`. Adam's first steps are as large as any, in whatever direction the first few
    /// gradients have in common; at full size a handful of them undo the calibration.
    pub lr_warmup: u64,
    /// Updates after which both step sizes fall as one over the square root of the updates; 0 for never. What is found early at full size is later drowned by
    /// the noise of small batches. Falling so depends on no end, so a run can go on for longer than was meant.
    #[serde(default)]
    pub lr_decay: u64,
    /// Adam's step size for the adversary (`η_ψ`, above `η_φ`).
    pub adversary_lr: f64,
    /// Adam's ε.
    pub adam_epsilon: f64,
    /// Largest global norm of the world model's, and of the adversary's, gradient.
    pub gradient_clip: f64,
    /// Share of the dynamics term's gradient that reaches the encoder; the dynamics model itself always learns from all of it. At 1 from the start, as the
    /// objective is written, the latent soon ignores the picture and stays so.
    pub dynamics_weight: f64,
    /// Updates before which nothing of it does, for an objective that waits ([`Definition::gate`](crate::learners::objective::Definition::gate)): the encoder
    /// learns from the reward alone.
    pub dynamics_start: u64,
    /// How many nats better than past actions alone predict the rewards the reward model must be before anything does (see [`gate`](crate::gate)); 0 for no
    /// such condition.
    pub dynamics_after: f64,
    /// Updates after that over which the weight rises from zero to its value.
    pub dynamics_warmup: u64,
    /// Weight of the reward term.
    pub reward_weight: f64,
    /// Whether the first scale of features and latents is set by the data (see `Model::calibrated`), so that training begins with latents that differ. With
    /// ordinary first weights all latents begin within the noise of one another, where the reward model learns nothing and ignoring the picture is an
    /// optimum.
    pub calibrate: bool,
    /// Channels after the first convolution.
    pub depth: usize,
    /// Width of features and hidden states.
    pub hidden: usize,
    /// Width of the heads' hidden layers.
    pub head: usize,
    /// Dimensions of the latent.
    pub latent: usize,
    /// Standard deviation of the encoder; the paper's 0.1.
    pub latent_std: f64,
    /// Least standard deviation of a prediction of a latent. A latent carries noise of `latent_std`, so nothing can be surer than that.
    pub prediction_floor: f64,
    /// Least standard deviation of the predicted reward, in units of [`reward_scale`](Self::reward_scale). One miss costs up to half its square over this: a
    /// floor far below what the rewards vary by lets a few rows outweigh all others.
    pub reward_floor: f64,
    /// One unit of the reward model, in units of reward; 0 for the standard deviation of the recordings' rewards. Rewards are summed over the
    /// action repeat, so their size differs between tasks. The paper lacks it: 1.
    #[serde(default = "one")]
    pub reward_scale: f64,
    /// Added to the first bias of the recurrent networks' update gates; above 0 they begin with a longer memory. The paper lacks it: 0.
    #[serde(default)]
    pub gru_update_bias: f64,
    /// Updates to make in all.
    pub updates: u64,
    /// Minutes to train in all, over every time the run was continued; 0 for no limit.
    pub minutes: f64,
    /// Updates between checkpoints.
    pub checkpoint_every: u64,
    /// Updates a line of metrics covers.
    pub log_every: u64,
    /// Checkpoints to keep.
    pub keep: usize,
    /// What objectives and auxiliary terms declare for themselves, by name.
    #[serde(flatten)]
    pub own: Own,
}

fn one() -> f64 {
    1.0
}

/// The options that change with the updates, at one of them. The paper gives the terms no weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Share of the dynamics term's gradient that [reaches](crate::learners::scene::gated) the encoder.
    pub dynamics_weight: f32,
    /// How far that share has risen, from 0 to 1; terms that look ahead [wait](crate::learners::auxiliary::Auxiliary::waits) with it.
    pub risen: f32,
    /// Weight of the reward's log-likelihood.
    pub reward_weight: f32,
    /// Adam's step size for the world model.
    pub lr: f64,
    /// Adam's step size for the adversary.
    pub adversary_lr: f64,
}

impl Options {
    /// The preset `name` with the recipe of its objective, and over them the entries of `layers`, one after the other; each is a path for messages and a table.
    ///
    /// # Errors
    /// An unknown preset or option, or a value that cannot be; the message lists what there is.
    pub fn resolve(name: &str, layers: &[(&str, Table)]) -> Result<Self> {
        let plain = Self::preset(name)?;
        let asked = layers.iter().rev().find_map(|(_, layer)| layer.get("objective")).and_then(toml::Value::as_str);
        let objective = asked.and_then(|name| name.parse().ok()).unwrap_or(plain.objective);
        let recipe = ("the recipe", presets::recipe(name, objective)?);
        plain.with(&[&[recipe], layers].concat())
    }

    /// The preset `name` by itself.
    ///
    /// # Errors
    /// There is none of this name; the message lists what there is.
    pub fn preset(name: &str) -> Result<Self> {
        let preset = PRESETS.iter().find(|(preset, _)| *preset == name).ok_or_else(|| {
            let names = PRESETS.map(|(name, _)| name).join(", ");
            TrainError::Options(format!("no preset `{name}`; there are {names}"))
        })?;
        Ok((preset.1)())
    }

    /// These options with the entries of `layers` laid over them.
    ///
    /// # Errors
    /// An unknown option, or a value that cannot be.
    pub fn with(&self, layers: &[(&str, Table)]) -> Result<Self> {
        let mut table = Table::try_from(self).map_err(|error| TrainError::Options(error.to_string()))?;
        for (place, layer) in layers {
            for (key, value) in layer {
                known(key, &table, place)?;
                table.insert(key.clone(), widen(value, table.get(key)));
            }
            let checked: std::result::Result<Self, _> = table.clone().try_into();
            checked.map_err(|error| TrainError::Options(format!("{}; in {place}", error.message())))?;
        }
        let options: Self =
            table.try_into().map_err(|error: toml::de::Error| TrainError::Options(error.message().to_owned()))?;
        let options = Self { own: options.own.checked()?, ..options };
        options.check()?;
        Ok(options)
    }

    /// Reads a table of options.
    ///
    /// # Errors
    /// The file is missing or not TOML.
    pub fn read_table(path: &Path) -> Result<Table> {
        let text = std::fs::read_to_string(path).map_err(io("read", path))?;
        text.parse().map_err(|error: toml::de::Error| {
            malformed(path, error.message(), "a TOML table of options like a run's config.toml")
        })
    }

    fn check(&self) -> Result<()> {
        let positive = [
            ("batch", self.batch as f64),
            ("log-every", self.log_every as f64),
            ("checkpoint-every", self.checkpoint_every as f64),
            ("keep", self.keep as f64),
            ("depth", self.depth as f64),
            ("hidden", self.hidden as f64),
            ("head", self.head as f64),
            ("latent", self.latent as f64),
            ("lr", self.lr),
            ("adversary-lr", self.adversary_lr),
            ("gradient-clip", self.gradient_clip),
            ("latent-std", self.latent_std),
            ("prediction-floor", self.prediction_floor),
            ("reward-floor", self.reward_floor),
        ];
        let small = positive.iter().find(|(_, value)| value.is_nan() || *value <= 0.0);
        if let Some((name, value)) = small {
            return Err(TrainError::Options(format!("--{name} is {value}; it must be above 0")));
        }
        if self.length < self.burn_in + 2 {
            let (length, burn_in) = (self.length, self.burn_in);
            return Err(TrainError::Options(format!(
                "--length is {length}; with --burn-in {burn_in} it must be at least {}",
                burn_in + 2
            )));
        }
        let ahead = steps_ahead(self);
        if ahead >= self.length {
            return Err(TrainError::Options(format!(
                "a term looks {ahead} steps ahead; with --length {} it can be at most {}",
                self.length,
                self.length - 1
            )));
        }
        let negative = [("reward-scale", self.reward_scale), ("gru-update-bias", self.gru_update_bias)];
        match negative.iter().find(|(_, value)| value.is_nan() || *value < 0.0) {
            Some((name, value)) => Err(TrainError::Options(format!("--{name} is {value}; it must be 0 or above"))),
            None => Ok(()),
        }
    }

    /// What holds at one update, if the [gate](crate::gate) opened at update `opened`.
    pub fn schedule(&self, update: u64, opened: Option<u64>) -> Schedule {
        let risen = match opened.and_then(|since| update.checked_sub(since)) {
            None => 0.0,
            Some(since) if since >= self.dynamics_warmup => 1.0,
            Some(since) => since as f64 / self.dynamics_warmup as f64,
        };
        let warmed = (update.saturating_add(1) as f64 / self.lr_warmup.max(1) as f64).min(1.0);
        let fallen = match self.lr_decay {
            0 => 1.0,
            after => (after as f64 / update.saturating_add(1) as f64).sqrt().min(1.0),
        };
        Schedule {
            dynamics_weight: (self.dynamics_weight * risen) as f32,
            risen: risen as f32,
            reward_weight: self.reward_weight as f32,
            lr: self.lr * warmed * fallen,
            adversary_lr: self.adversary_lr * fallen,
        }
    }

    /// The model these options ask for, for a task and its observations, and rewards that vary by a standard deviation of `reward_std`.
    pub fn model(&self, spec: &vibes_data::Spec, observation: ObservationKind, reward_std: f64) -> ModelConfig {
        let actions = spec.action.min.len();
        let networks = self.objective.networks(self, actions);
        let of_terms = asked(self).filter_map(|term| term.head(self, actions));
        let scale = if self.reward_scale > 0.0 { self.reward_scale } else { reward_std.max(1e-6) };
        ModelConfig {
            task: spec.task.clone(),
            observation,
            action_min: spec.action.min.iter().map(|&bound| bound as f32).collect(),
            action_max: spec.action.max.iter().map(|&bound| bound as f32).collect(),
            depth: self.depth,
            hidden: self.hidden,
            head: self.head,
            latent: self.latent,
            latent_std: self.latent_std as f32,
            prediction_floor: self.prediction_floor as f32,
            reward_floor: (self.reward_floor * scale) as f32,
            reward_scale: scale as f32,
            gru_update_bias: self.gru_update_bias as f32,
            adversary: networks.adversary,
            decoder: networks.decoder,
            heads: networks.heads.into_iter().chain(of_terms).collect(),
            numbers: networks.numbers,
            latents: networks.latents,
            blind_to_actions: networks.blind_to_actions,
        }
    }

    /// The first option in which a run's options and the asked ones differ, as (name, in the run, asked). How long to train and how often to save may
    /// change from one call to the next.
    pub fn first_difference(&self, asked: &Self) -> Option<(String, String, String)> {
        let free = ["updates", "minutes", "checkpoint_every", "keep"];
        let (mine, theirs) = (Table::try_from(self).ok()?, Table::try_from(asked).ok()?);
        let differs = |(key, value): (&String, &toml::Value)| {
            let other = theirs.get(key)?;
            (!free.contains(&key.as_str()) && other != value)
                .then(|| (key.replace('_', "-"), value.to_string(), other.to_string()))
        };
        mine.iter().find_map(differs)
    }
}

/// That an option is known.
fn known(key: &str, table: &Table, place: &str) -> Result<()> {
    if table.contains_key(key) {
        return Ok(());
    }
    let names = table.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
    Err(TrainError::Options(format!("no option `{key}`; there are {names}; in {place}")))
}

/// A whole number where a broken one is expected is meant as one.
fn widen(value: &toml::Value, like: Option<&toml::Value>) -> toml::Value {
    match (value, like) {
        (toml::Value::Integer(whole), Some(toml::Value::Float(_))) => toml::Value::Float(*whole as f64),
        _ => value.clone(),
    }
}

#[cfg(test)]
mod tests;
