//! Everything a training run can be asked for, its presets, and how the final values come about: the preset, then a TOML file, then flags, each laid over
//! what came before. Saved as `config.toml` in the run folder, which `--config` reads again.

use std::ops::{Deref, DerefMut};
use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Table;
use vibes_model::{ModelConfig, ObservationKind};

use crate::error::{Result, TrainError, io, malformed, refuse};
use crate::learners::auxiliary::{Auxiliary, asked};
use crate::learners::declared;
use crate::learners::objective::Objective;
use crate::settings::Settings;
use crate::settings::own::Own;

mod effect;
pub mod presets;

use presets::PRESETS;

/// Sizes at most, far above what trains: products of more would not fit into any memory.
const MOST: usize = 65_536;

/// The resolved options of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Which objective.
    pub objective: Objective,
    /// Everything else.
    #[serde(flatten)]
    pub settings: Settings,
}

impl Deref for Options {
    type Target = Settings;

    fn deref(&self) -> &Settings {
        &self.settings
    }
}

impl DerefMut for Options {
    fn deref_mut(&mut self) -> &mut Settings {
        &mut self.settings
    }
}

impl Options {
    /// What a learner is given: the objective, and everything else.
    pub fn parts(&self) -> (Objective, &Settings) {
        (self.objective, &self.settings)
    }

    /// The preset `name` with the recipe of its objective, and over them the entries of `layers`, one after the other; each is a path for messages and a table.
    ///
    /// # Errors
    /// An unknown preset or option, or a value that cannot be; the message lists what there is.
    pub fn resolve(name: &str, layers: &[(&str, Table)]) -> Result<Self> {
        let plain = Self::preset(name)?;
        let asked = layers.iter().rev().find_map(|(_, layer)| layer.get("objective")).and_then(toml::Value::as_str);
        let objective = asked.and_then(|name| name.parse().ok()).unwrap_or(plain.objective);
        let recipe = ("the recipe", presets::recipe(name, objective));
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
        Ok(Self { objective: Objective::default(), settings: (preset.1)() })
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
        let own = options.settings.own.checked(declared())?;
        let options = Self { objective: options.objective, settings: Settings { own, ..options.settings } };
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
        if let Some((name, value)) = self.not_finite() {
            let text = format!("--{name} is {value}; it must be a finite number that single precision has too");
            return Err(TrainError::Options(text));
        }
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
            ("adam-epsilon", self.adam_epsilon),
            ("gradient-clip", self.gradient_clip),
            ("latent-std", self.latent_std),
            ("prediction-floor", self.prediction_floor),
            ("reward-floor", self.reward_floor),
        ];
        let sizes = [
            ("batch", self.batch),
            ("length", self.length),
            ("depth", self.depth),
            ("hidden", self.hidden),
            ("head", self.head),
            ("latent", self.latent),
        ];
        refuse(&sizes, |value| value > MOST, format_args!("be at most {MOST}"))?;
        refuse(&positive, |value| value <= 0.0, "be above 0")?;
        if self.length < self.burn_in.saturating_add(2) {
            let (length, burn_in) = (self.length, self.burn_in);
            return Err(TrainError::Options(format!(
                "--length is {length}; with --burn-in {burn_in} it must be at least {}",
                burn_in.saturating_add(2)
            )));
        }
        self.check_steps()?;
        let negative = [
            ("reward-scale", self.reward_scale),
            ("gru-update-bias", self.gru_update_bias),
            ("minutes", self.minutes),
            ("dynamics-weight", self.dynamics_weight),
            ("reward-weight", self.reward_weight),
        ];
        refuse(&negative, |value| value < 0.0, "be 0 or above")
    }

    /// That every window has rows which count and have as many rows after them as whatever looks at later rows needs: burn-in rows do not count.
    fn check_steps(&self) -> Result<()> {
        let room = (self.length - 1 - self.burn_in) as u64;
        let steps = asked(self).filter_map(Auxiliary::steps).chain(self.objective.steps());
        let found = steps.map(|option| (option.flag, self.own.whole(option)));
        match found.into_iter().find(|(_, steps)| !(1..=room).contains(steps)) {
            None => Ok(()),
            Some((flag, steps)) => Err(TrainError::Options(format!(
                "--{flag} is {steps}; with --length {} and --burn-in {} it must be 1 to {room}",
                self.length, self.burn_in
            ))),
        }
    }

    /// The first option that is no finite number, or none in single precision, in which models hold theirs: no file of a run could hold it.
    fn not_finite(&self) -> Option<(String, f64)> {
        let table = Table::try_from(self).ok()?;
        let is_single = |value: f64| (value as f32).is_finite() && (value == 0.0 || value as f32 != 0.0);
        let value = |value: &toml::Value| value.as_float().filter(|&value| !is_single(value));
        table.iter().find_map(|(key, found)| Some((key.replace('_', "-"), value(found)?)))
    }

    /// The model these options ask for, for a task and its observations, and rewards that vary by a standard deviation of `reward_std`.
    pub fn model(&self, spec: &vibes_data::Spec, observation: ObservationKind, reward_std: f64) -> ModelConfig {
        let actions = spec.action.min.len();
        let networks = self.objective.networks(self, actions);
        let of_terms = asked(self).filter_map(|term| term.head(self, actions));
        // Rewards that do not vary say nothing of their unit.
        let of_rewards = if reward_std > 1e-6 { reward_std } else { 1.0 };
        let scale = if self.reward_scale > 0.0 { self.reward_scale } else { of_rewards };
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
    /// change from one call to the next, and what nothing of the run looks at. An option that was declared after the run was begun had its default there.
    pub fn first_difference(&self, asked: &Self) -> Option<(String, String, String)> {
        let mut free = vec!["updates", "minutes", "checkpoint_every", "keep"];
        free.extend(self.unread());
        let mut mine = Table::try_from(Own::defaults(declared())).ok()?;
        mine.extend(Table::try_from(self).ok()?);
        let theirs = Table::try_from(asked).ok()?;
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
