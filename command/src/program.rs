//! One run of a program: arguments in, exit code out.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Instant;

use clap::parser::ValueSource;
use clap::{ArgMatches, Command, CommandFactory, FromArgMatches};

use crate::config::{self, Expanded};
use crate::printing::end_without_output;
use crate::signals::end_with_the_reader;
use crate::{Ending, error_text};

/// Reads the process's arguments, does the work, and turns its outcome into the exit code; `judge` says how an error ends the program.
pub fn run<P: CommandFactory + FromArgMatches>(
    work: impl FnOnce(P) -> anyhow::Result<Ending>,
    judge: impl FnOnce(&anyhow::Error) -> Ending,
) -> ExitCode {
    let begun = Instant::now();
    // Where the system refuses, a closed pipe stays what it is without: a panic at the next line.
    let _ = end_with_the_reader();
    let command = config::with_option(P::command());
    let name = command.get_name().to_owned();
    end_without_output(name.clone());
    let (program, verbose) = match read::<P>(command, std::env::args_os().collect()) {
        Ok(read) => read,
        Err(code) => return code,
    };
    let outcome = work(program);
    if verbose {
        say(&format!("{name}: took {:.1} s", begun.elapsed().as_secs_f64()));
    }
    match outcome {
        Ok(ending) => ending.into(),
        Err(error) => {
            say(&format!("{name}: {}", error_text(&error)));
            judge(&error).into()
        }
    }
}

/// The program's own form of the arguments, and whether it was asked to say more; or the exit code.
fn read<P: FromArgMatches>(mut command: Command, arguments: Vec<OsString>) -> Result<(P, bool), ExitCode> {
    let wrong = |text: String| {
        say(&text);
        Ending::Wrong.into()
    };
    let name = command.get_name().to_owned();
    let expanded = config::expand(&mut command, arguments).map_err(|error| wrong(format!("{name}: {error:#}")))?;
    let (program, matches) = matched(&mut command, &expanded.arguments).map_err(|error| {
        // Help and the version are asked for, not wrong.
        let _ = error.print();
        if !error.use_stderr() {
            return ExitCode::SUCCESS;
        }
        match &expanded.file {
            Some(file) => wrong(format!("note: options were also read from {}", file.display())),
            None => Ending::Wrong.into(),
        }
    })?;
    let verbose = matches.try_get_one::<bool>("verbose").ok().flatten().is_some_and(|&verbose| verbose);
    if verbose {
        say_options(&command, &matches, &expanded);
    }
    Ok((program, verbose))
}

/// A program's own form of words that are not the process's, the options of a `--config` file among them: a command line within a command line.
///
/// # Errors
/// The file of options cannot be read or names what there is not, or clap refuses the words.
pub fn parse<P: CommandFactory + FromArgMatches>(words: &[String]) -> anyhow::Result<P> {
    let mut command = config::with_option(P::command());
    let expanded = config::expand(&mut command, words.iter().map(OsString::from).collect())?;
    Ok(matched(&mut command, &expanded.arguments)?.0)
}

/// The same of what was typed alone, where the file is not there yet.
///
/// # Errors
/// Clap refuses the words, also for an option that the file may yet bring.
pub fn parse_typed<P: CommandFactory + FromArgMatches>(words: &[String]) -> anyhow::Result<P> {
    let mut command = config::with_option(P::command());
    let typed = config::without_file(&mut command, words.iter().map(OsString::from).collect())?;
    Ok(matched(&mut command, &typed)?.0)
}

/// The program's own form of words without a file, and what clap makes of them.
fn matched<P: FromArgMatches>(command: &mut Command, words: &[OsString]) -> clap::error::Result<(P, ArgMatches)> {
    let matches = command.try_get_matches_from_mut(words)?;
    let program = P::from_arg_matches(&matches).map_err(|error| error.format(command))?;
    Ok((program, matches))
}

/// Every option of the verb with its value and where it comes from.
fn say_options(command: &Command, matches: &ArgMatches, expanded: &Expanded) {
    let (mut command, mut matches, mut name) = (command, matches, command.get_name().to_owned());
    while let Some((verb, inner)) = matches.subcommand() {
        let Some(found) = command.find_subcommand(verb) else { break };
        (command, matches) = (found, inner);
        name = format!("{name} {verb}");
    }
    say(&name);
    for argument in command.get_arguments() {
        let id = argument.get_id().as_str();
        let Ok(Some(values)) = matches.try_get_raw(id) else { continue };
        let values: Vec<_> = values.map(|value| value.to_string_lossy()).collect();
        let source = match (matches.value_source(id), &expanded.file) {
            (Some(ValueSource::DefaultValue), _) => "default".into(),
            (_, Some(file)) if expanded.from_file.contains(id) => file.display().to_string(),
            _ => "typed".to_owned(),
        };
        let shown = argument.get_long().map_or_else(|| id.to_uppercase(), |long| format!("--{long}"));
        say(&format!("  {shown} {} ({source})", values.join(" ")));
    }
}

#[allow(clippy::print_stderr, reason = "the one place where a program's errors are said")]
fn say(text: &str) {
    eprintln!("{text}");
}
