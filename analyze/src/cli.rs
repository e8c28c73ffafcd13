//! The command line: what was typed, one verb each, and what is printed. The only module that knows clap or prints.
//!
//! A verb opens its inputs through `session`, calls the measures, and returns an `Outcome`: one line of result, the files it wrote, and
//! the same as JSON.

mod bench;
mod clusters;
mod compare;
mod curves;
mod decode;
mod gaps;
mod grid;
mod invariance;
mod maps;
mod nn;
mod probe;
mod report;
mod scene;
mod session;
mod symmetry;
mod table;
mod umap;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use vibes_command::{Ending, Output as Globals};

use crate::figures::{Figure, FigureError};
use crate::input::InputError;

/// Look into a latent space: neighbours, maps, and numbers that say how invariant it is.
///
/// Every verb reads a table of latents (the newest below the current folder unless one is named) and writes figures as PNG and SVG and numbers
/// as JSON and Arrow into the folder `figures` beside it. It prints one line of result.
#[derive(Debug, Parser)]
#[command(name = "vibes-analyze", version, propagate_version = true)]
struct Cli {
    #[command(flatten)]
    globals: Globals,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Nn(nn::Options),
    Umap(umap::Options),
    Grid(grid::Options),
    Clusters(clusters::Options),
    Invariance(invariance::Options),
    Probe(probe::Options),
    Symmetry(symmetry::Options),
    Curves(curves::Options),
    Table(table::Options),
    Decode(decode::Options),
    Compare(compare::Options),
    Scene(scene::Options),
    Report(report::Options),
    Bench(bench::Options),
}

/// What a verb has done.
#[derive(Debug, Default)]
struct Outcome {
    /// One line of result.
    line: String,
    /// What the reader must know: fallbacks taken, rows left out.
    remarks: Vec<String>,
    /// The files it wrote.
    files: Vec<PathBuf>,
    /// The result as JSON.
    json: serde_json::Value,
}

impl Outcome {
    /// Writes a figure and lists its files. One that is too large for an image is left out: the numbers do not depend on it.
    fn save(&mut self, figure: &Figure, folder: &Path, stem: &str) -> anyhow::Result<()> {
        match figure.save(folder, stem) {
            Ok(files) => self.files.extend(files),
            Err(FigureError::Size { width, height, .. }) => {
                let fact = format!("it would be {width:.0} by {height:.0} inches large (show less in one figure)");
                self.leave_out(folder, stem, &fact);
            }
            Err(other) => return Err(other.into()),
        }
        Ok(())
    }

    /// Says why a figure is not drawn, and takes away one of this name from before, which would be taken for it.
    fn leave_out(&mut self, folder: &Path, stem: &str, fact: &str) {
        for ending in ["png", "svg"] {
            let _ = std::fs::remove_file(folder.join(format!("{stem}.{ending}")));
        }
        self.remarks.push(format!("the figure {stem} is not drawn: {fact}; all numbers are in the other files"));
    }
}

/// Arguments that do not fit the input.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct WrongArguments(String);

/// Makes the error for arguments that do not fit the input.
fn wrong(text: impl Into<String>) -> anyhow::Error {
    WrongArguments(text.into()).into()
}

/// That no two of these paths lead to one place: a run that counts twice makes intervals narrower than they are.
fn distinct_places(paths: &[PathBuf]) -> anyhow::Result<()> {
    for (at, path) in paths.iter().enumerate() {
        if let Some(same) = paths[..at].iter().find(|same| vibes_data::is_same_place(same, path)) {
            return Err(wrong(format!(
                "these are one and the same and would count twice; leave one of them out: {} and {}",
                same.display(),
                path.display()
            )));
        }
    }
    Ok(())
}

/// Runs the program on this process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    vibes_command::run(
        |cli: Cli| {
            let outcome = dispatch(&cli)?;
            print(&outcome, &cli.globals);
            Ok(Ending::Done)
        },
        |error| if is_wrong(error) { Ending::Wrong } else { Ending::Failed },
    )
}

/// Whether an error is that of arguments that do not fit the input.
fn is_wrong(error: &anyhow::Error) -> bool {
    use vibes_measure::Error::{NoSuchRow, Option, UnknownName};
    error.chain().any(|e| {
        e.is::<WrongArguments>()
            || e.downcast_ref::<InputError>().is_some_and(|e| {
                use InputError::{AmbiguousResult, IdleJoin, NoSuchColumn, NoSuchResult, Rows};
                matches!(
                    e,
                    AmbiguousResult { .. } | IdleJoin { .. } | NoSuchColumn { .. } | NoSuchResult { .. } | Rows { .. }
                )
            })
            || e.downcast_ref::<vibes_measure::Error>()
                .is_some_and(|e| matches!(e, NoSuchRow { .. } | Option { .. } | UnknownName { .. }))
    })
}

/// Runs the verb.
fn dispatch(cli: &Cli) -> anyhow::Result<Outcome> {
    let globals = &cli.globals;
    match &cli.verb {
        Verb::Nn(options) => nn::run(options, globals),
        Verb::Umap(options) => umap::run(options, globals),
        Verb::Grid(options) => grid::run(options, globals),
        Verb::Clusters(options) => clusters::run(options, globals),
        Verb::Invariance(options) => invariance::run(options, globals),
        Verb::Probe(options) => probe::run(options, globals),
        Verb::Symmetry(options) => symmetry::run(options, globals),
        Verb::Curves(options) => curves::run(options, globals),
        Verb::Table(options) => table::run(options, globals),
        Verb::Decode(options) => decode::run(options, globals),
        Verb::Compare(options) => compare::run(options, globals),
        Verb::Scene(options) => scene::run(options, globals),
        Verb::Report(options) => report::run(options, globals),
        Verb::Bench(options) => bench::run(options, globals),
    }
}

#[allow(clippy::print_stdout, clippy::print_stderr, reason = "the one place that prints results")]
fn print(outcome: &Outcome, globals: &Globals) {
    for remark in outcome.remarks.iter().filter(|_| !globals.quiet) {
        eprintln!("note: {remark}");
    }
    if globals.json {
        println!("{:#}", outcome.json);
        return;
    }
    println!("{}", outcome.line);
    if !globals.quiet {
        for file in &outcome.files {
            println!("  {}", file.display());
        }
    }
}

/// Says on standard error what is going on.
#[allow(clippy::print_stderr, reason = "progress is said where the verbs are assembled")]
fn say(globals: &Globals, text: impl std::fmt::Display) {
    if !globals.quiet {
        eprintln!("{text}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_place_under_two_names_is_refused_with_both() {
        let home = tempfile::tempdir().expect("folder");
        let [one, two] = ["one", "two"].map(|name| home.path().join(name));
        for folder in [&one, &two] {
            std::fs::create_dir(folder).expect("folder");
        }
        assert!(distinct_places(&[one.clone(), two.clone()]).is_ok() && distinct_places(&[]).is_ok());
        let fault = distinct_places(&[one.clone(), two.clone(), two.join("../one")]).expect_err("twice");
        assert!(is_wrong(&fault));
        let named = format!("{} and {}", one.display(), two.join("../one").display());
        assert!(fault.to_string().ends_with(&named), "{fault}");
    }
}
