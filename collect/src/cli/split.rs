//! `vibes-collect split REC --parts 0.8,0.2 -o PREFIX`: divides a recording by share.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::{Args, ValueEnum};
use serde_json::json;
use vibes_data::{Recording, whole};

use super::merge::transfer;
use super::{Outcome, OutputArgs};
use crate::Error;
use crate::care::select::{Part, write_subsets};
use crate::care::split::{SplitBy, shared_trajectories, split};

/// Divide a recording into parts, such that no part has seen the held-out trajectories of another.
///
/// The parts keep the episodes' numbers, cells and files; `merge` puts them together again. By state trajectory or by column of the grid, no part
/// sees a state or distractor trajectory of another. State trajectories are a grid's rows; elsewhere views of one (one seed, the same actions) stay together.
#[derive(Debug, Args)]
pub(super) struct SplitArgs {
    /// The recording's folder.
    path: PathBuf,
    /// The parts' shares; episodes that they leave over are in no part.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0.8,0.2")]
    parts: Vec<f64>,
    /// What is never divided between two parts [default: state on a grid and where there are views of one, else episode].
    #[arg(long, value_enum)]
    by: Option<By>,
    /// The parts' names [default: train,val or train,val,test; from four on, 1,2,...].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    names: Option<Vec<String>>,
    /// The new recordings' folders are PREFIX-NAME [default: the recording's own].
    #[arg(short, long, value_name = "PREFIX")]
    output: Option<PathBuf>,
    /// The seed of the choice.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Copy files instead of linking them.
    #[arg(long)]
    copy: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum By {
    /// Episodes; parts may then share state trajectories, and it is said how many.
    Episode,
    /// State trajectories, the rows of a grid.
    State,
    /// Columns of the grid, the distractor trajectories.
    Distractor,
    /// Rows and columns; cells whose row and column fall into different parts are left out.
    Both,
}

impl SplitArgs {
    fn by(&self, recording: &Recording) -> crate::Result<SplitBy> {
        Ok(match self.by {
            Some(By::Episode) => SplitBy::Episode,
            Some(By::State) => SplitBy::State,
            Some(By::Distractor) => SplitBy::Distractor,
            Some(By::Both) => SplitBy::Both,
            None => SplitBy::usual(recording)?,
        })
    }

    fn names(&self) -> Result<Vec<String>> {
        let count = self.parts.len();
        let names = self.names.clone().unwrap_or_else(|| match count {
            0..=3 => ["train", "val", "test"][..count].iter().map(|&name| name.to_owned()).collect(),
            _ => (1..=count).map(|number| number.to_string()).collect(),
        });
        let distinct: std::collections::BTreeSet<&String> = names.iter().collect();
        let is_name = |name: &String| !name.is_empty() && !name.contains(['/', '\\']);
        if names.len() != count || distinct.len() != count || !names.iter().all(is_name) {
            let fact = format!("{count} parts and the names {names:?}");
            let expected = "a different name for each part, without slashes and not empty".into();
            return Err(Error::Selection { fact, expected }.into());
        }
        Ok(names)
    }

    fn folder(&self, recording: &Recording, name: &str) -> PathBuf {
        let prefix: &Path = self.output.as_deref().unwrap_or(recording.path());
        // `.` and `..` have no name of their own, and beside them is elsewhere.
        let named = if prefix.file_name().is_some() { prefix.to_owned() } else { whole(prefix) };
        let stem = named.file_name().map_or_else(|| "recording".into(), std::ffi::OsStr::to_string_lossy);
        named.with_file_name(format!("{stem}-{name}"))
    }

    /// How the episodes of a part were chosen, for the manifest.
    fn note(&self, by: SplitBy, part: usize) -> serde_json::Value {
        json!({ "verb": "split", "by": by, "parts": self.parts, "seed": self.seed, "part": part })
    }
}

#[allow(clippy::print_stdout, reason = "the command line says what it did")]
pub(super) fn run(args: &SplitArgs, output: OutputArgs) -> Result<Outcome> {
    let recording = Recording::open(&args.path)?;
    let (by, names) = (args.by(&recording)?, args.names()?);
    let parts = split(&recording, by, &args.parts, args.seed)?;
    // By columns that is what was asked for, and by states there are none.
    let shared = if by == SplitBy::Episode { shared_trajectories(&recording, &parts)? } else { 0 };
    let notes: Vec<_> = (0..parts.len()).map(|part| args.note(by, part)).collect();
    let folders: Vec<PathBuf> = names.iter().map(|name| args.folder(&recording, name)).collect();
    let planned = parts.iter().zip(&notes).zip(&folders).map(|((kept, note), out)| Part { kept, note, out });
    let planned: Vec<Part<'_>> = planned.collect();
    write_subsets(&recording, &planned, transfer(args.copy), vibes_command::stop_on_signals()?)?;
    if !output.json && !output.quiet {
        planned.iter().for_each(|part| println!("{}: {} episodes", part.out.display(), part.kept.len()));
    }
    let made = planned.iter().map(|part| json!({ "recording": part.out, "episodes": part.kept.len() }));
    let made: Vec<_> = made.collect();
    let left: usize = recording.episodes().len() - parts.iter().map(Vec::len).sum::<usize>();
    if output.json {
        println!("{}", json!({ "parts": made, "left_out": left, "shared_trajectories": shared }));
        return Ok(Outcome::Done);
    }
    if !output.quiet && left > 0 {
        println!("{left} episodes are in no part");
    }
    if !output.quiet && shared > 0 {
        println!("{shared} state trajectories are in more than one part; --by state keeps each in one");
    }
    Ok(Outcome::Done)
}
