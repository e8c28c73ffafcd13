//! `vibes-collect filter REC … -o OUT`: keeps some of a recording's episodes.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::json;
use vibes_data::Recording;

use super::merge::transfer;
use super::{Outcome, OutputArgs};
use crate::care::select::{Filter, Numbers, Part, write_subsets};

/// Keep some of a recording's episodes, by return, policy, or place in the grid.
///
/// An episode is kept if it passes every test that is asked for. It keeps its number, its cell and its files; the grid keeps its size, with the
/// other cells empty.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("tests").required(true).multiple(true))]
pub(super) struct FilterArgs {
    /// The recording's folder.
    path: PathBuf,
    /// Smallest return.
    #[arg(long, value_name = "X", group = "tests", allow_negative_numbers = true)]
    min_return: Option<f64>,
    /// Largest return.
    #[arg(long, value_name = "X", group = "tests", allow_negative_numbers = true)]
    max_return: Option<f64>,
    /// A behaviour policy as `info` lists it; may be given several times.
    #[arg(long, value_name = "POLICY", group = "tests")]
    policy: Vec<String>,
    /// Rows of the grid, as in 0-4,7.
    #[arg(long, value_name = "LIST", group = "tests")]
    states: Option<Numbers>,
    /// Columns of the grid.
    #[arg(long, value_name = "LIST", group = "tests")]
    distractors: Option<Numbers>,
    /// Episode numbers.
    #[arg(long, value_name = "LIST", group = "tests")]
    episodes: Option<Numbers>,
    /// The new recording's folder.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Copy files instead of linking them.
    #[arg(long)]
    copy: bool,
}

impl FilterArgs {
    fn filter(&self) -> Filter {
        Filter {
            min_return: self.min_return,
            max_return: self.max_return,
            policies: self.policy.clone(),
            states: self.states.clone(),
            distractors: self.distractors.clone(),
            episodes: self.episodes.clone(),
        }
    }

    /// How the episodes were chosen, for the manifest.
    fn note(&self) -> serde_json::Value {
        let text = |numbers: &Option<Numbers>| numbers.as_ref().map(ToString::to_string);
        let all = json!({
            "verb": "filter", "min_return": self.min_return, "max_return": self.max_return, "policies": self.policy,
            "states": text(&self.states), "distractors": text(&self.distractors), "episodes": text(&self.episodes),
        });
        let given = all.as_object().cloned().unwrap_or_default().into_iter();
        given.filter(|(_, value)| !value.is_null() && value.as_array().is_none_or(|list| !list.is_empty())).collect()
    }
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
pub(super) fn run(args: &FilterArgs, output: OutputArgs) -> Result<Outcome> {
    let recording = Recording::open(&args.path)?;
    let kept = args.filter().select(&recording)?;
    let part = Part { kept: &kept, note: &args.note(), out: &args.output };
    write_subsets(&recording, &[part], transfer(args.copy), vibes_command::stop_on_signals()?)?;
    let (kept, of) = (kept.len(), recording.episodes().len());
    if output.json {
        println!("{}", json!({ "recording": args.output, "episodes": kept, "of": of }));
    } else if !output.quiet {
        println!("{}: {kept} of {of} episodes", args.output.display());
    }
    Ok(Outcome::Done)
}
