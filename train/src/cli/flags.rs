//! The flags that lay over a preset, typed or from a configuration file, one for every entry of [`Options`].

use anyhow::{Context as _, Result};
use clap::builder::PossibleValuesParser;
use clap::{Arg, ArgMatches, Args, FromArgMatches};
use serde::Serialize;
use toml::{Table, Value};
use vibes_command::Given;
use vibes_train::TrainError;
use vibes_train::learners::declared;
use vibes_train::learners::objective::Objective;
use vibes_train::options::Options;
use vibes_train::options::presets::PRESETS;
use vibes_train::settings::own::Kind;

/// That none of these options was given, which would have no effect.
pub(crate) fn refuse<'a>(given: &Given, options: impl IntoIterator<Item = &'a str>, why: &str) -> Result<()> {
    match given.first_of(options) {
        Some(option) => anyhow::bail!(TrainError::Options(format!("{option} has no effect {why}; leave it out"))),
        None => Ok(()),
    }
}

/// What to start from, and what lies over it.
#[derive(Debug, Clone, Args)]
pub(crate) struct OptionArgs {
    #[arg(long, default_value = "small", help = presets())]
    preset: String,
    #[command(flatten)]
    flags: OptionFlags,
    #[command(flatten)]
    own: OwnFlags,
}

/// One flag for every option; the preset's value holds where none is given.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Options over the preset")]
struct OptionFlags {
    #[arg(long, value_name = "NAME", help = objectives())]
    objective: Option<String>,
    /// auto (pixels where there are any), pixels or vectors.
    #[arg(long)]
    observations: Option<String>,
    /// Seed of the first weights, the windows and the noise, at most 9223372036854775807.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
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
    /// First rows of a window that only warm up the hidden states, unless it begins with its episode.
    #[arg(long)]
    burn_in: Option<usize>,
    /// Step size of the world model.
    #[arg(long)]
    lr: Option<f64>,
    /// Updates over which the world model's step size rises from 0.
    #[arg(long)]
    lr_warmup: Option<u64>,
    /// Updates after which both step sizes fall as 1/√updates; 0 for never.
    #[arg(long)]
    lr_decay: Option<u64>,
    /// Step size of the adversary.
    #[arg(long)]
    adversary_lr: Option<f64>,
    /// Adam's ε, above 0.
    #[arg(long)]
    adam_epsilon: Option<f64>,
    /// Largest norm of a gradient.
    #[arg(long)]
    gradient_clip: Option<f64>,
    /// Share of the dynamics term's gradient that reaches the encoder (1 as the paper writes it).
    #[arg(long)]
    dynamics_weight: Option<f64>,
    /// Updates before which none of that gradient reaches the encoder (only with --objective vibes, or no-adversary --wait yes).
    #[arg(long)]
    dynamics_start: Option<u64>,
    /// Nats by which the reward must be predicted better than from past actions alone before any of that gradient reaches the encoder (only with --objective vibes, or no-adversary --wait yes).
    #[arg(long)]
    dynamics_after: Option<f64>,
    /// Updates, after that, over which its share rises from 0 to --dynamics-weight.
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
    /// Least standard deviation of a predicted reward, in units of --reward-scale.
    #[arg(long)]
    reward_floor: Option<f64>,
    /// Unit in which the reward model predicts; 0 for the standard deviation of the recordings' rewards, or 0.3 a control step of the action repeat where there are none (the paper lacks it).
    #[arg(long)]
    reward_scale: Option<f64>,
    /// Added to the first bias of the recurrent networks' update gates (the paper lacks it).
    #[arg(long)]
    gru_update_bias: Option<f64>,
    /// Updates between checkpoints.
    #[arg(long)]
    checkpoint_every: Option<u64>,
    /// Updates that one line of metrics is the mean of.
    #[arg(long)]
    log_every: Option<u64>,
    /// Checkpoints to keep.
    #[arg(long)]
    keep: Option<usize>,
}

impl OptionArgs {
    /// The preset's name, which may be that of a system without a world model.
    pub(crate) fn preset(&self) -> &str {
        &self.preset
    }

    /// The seed alone, whatever the preset is.
    pub(crate) fn seed(&self) -> Result<u64> {
        Ok(self.over(&Options::preset("small")?)?.seed)
    }

    /// The preset, and over it the flags, typed or from a file.
    pub(crate) fn resolve(&self) -> Result<Options> {
        let layers = self.layers()?;
        let objective = layers[0].1.iter().filter(|(key, _)| *key == "objective");
        let objective: Table = objective.map(|(key, value)| (key.clone(), value.clone())).collect();
        let base = Options::resolve(&self.preset, &[("the arguments", objective)])?;
        let options = Options::resolve(&self.preset, &by_name(&layers))?;
        options.check_effect(&base)?;
        Ok(options)
    }

    /// The same without the preset's recipe: the objective as it is written.
    pub(crate) fn resolve_plain(&self) -> Result<Options> {
        self.over(&Options::preset(&self.preset)?)
    }

    /// The flags, typed or from a file, over other options than a preset's.
    pub(crate) fn over(&self, options: &Options) -> Result<Options> {
        let layers = self.layers()?;
        let laid = options.with(&by_name(&layers))?;
        laid.check_effect(options)?;
        Ok(laid)
    }

    fn layers(&self) -> Result<Vec<(String, Table)>> {
        let mut typed = Table::try_from(&self.flags).context("the arguments cannot be written as TOML")?;
        typed.extend(self.own.0.clone());
        Ok(vec![("the arguments".to_owned(), typed)])
    }
}

fn by_name(layers: &[(String, Table)]) -> Vec<(&str, Table)> {
    layers.iter().map(|(name, table)| (name.as_str(), table.clone())).collect()
}

/// Flags of the options that objectives and auxiliary terms declare for themselves; holds those that were typed.
#[derive(Debug, Clone, Default)]
struct OwnFlags(Table);

impl Args for OwnFlags {
    fn augment_args(command: clap::Command) -> clap::Command {
        let heading = "Options of objectives and auxiliary terms";
        declared().fold(command.next_help_heading(heading), |command, option| {
            let arg = Arg::new(option.flag).long(option.flag).help(option.help);
            command.arg(match option.kind {
                Kind::Number { .. } => arg.value_name("NUMBER").value_parser(clap::value_parser!(f64)),
                Kind::Whole { .. } => arg.value_name("N").value_parser(clap::value_parser!(u32)),
                Kind::Choice { among, .. } => arg.value_parser(PossibleValuesParser::new(among)),
            })
        })
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for OwnFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let typed = declared().filter_map(|option| {
            let value = match option.kind {
                Kind::Number { .. } => Value::Float(*matches.get_one::<f64>(option.flag)?),
                Kind::Whole { .. } => Value::Integer((*matches.get_one::<u32>(option.flag)?).into()),
                Kind::Choice { .. } => Value::String(matches.get_one::<String>(option.flag)?.clone()),
            };
            Some((option.key(), value))
        });
        Ok(Self(typed.collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.0.extend(Self::from_arg_matches(matches)?.0);
        Ok(())
    }
}

/// The help of `--objective`: every one, and what it is.
fn objectives() -> String {
    let lines = Objective::all().map(|objective| format!("{objective}: {}", objective.about()));
    format!("What is maximised.\n{}", lines.collect::<Vec<_>>().join("\n"))
}

/// The help of `--preset`.
fn presets() -> String {
    let names = PRESETS.map(|(name, _)| name).join(", ");
    format!("Sizes and rates to start from: {names}; online also a system without a world model, such as sac-rad")
}
