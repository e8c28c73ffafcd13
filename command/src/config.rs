//! `--config FILE.toml`: the file's keys become options right behind the verb, in front of those that were typed.
//!
//! In: a program's clap command and the arguments as typed. Out: the arguments with the file's options among them, which clap then checks all
//! alike.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Arg, ArgAction, Command};
use toml::Value;

/// The option's name.
const CONFIG: &str = "config";

/// The arguments with the file's options among them.
#[derive(Debug, Default)]
pub(crate) struct Expanded {
    pub(crate) arguments: Vec<OsString>,
    pub(crate) file: Option<PathBuf>,
    /// The names of the arguments that the file gave.
    pub(crate) from_file: BTreeSet<String>,
}

/// The command with `--config` among its options.
pub(crate) fn with_option(command: Command) -> Command {
    let help = "Take options from a TOML file: `key = value` as in `--key value`, for the verb at hand or under `[VERB]`, which wins over the file's top; options on the command line win over it";
    command.arg(Arg::new(CONFIG).long(CONFIG).global(true).value_name("FILE.toml").help(help))
}

/// Replaces `--config FILE` by the file's options.
pub(crate) fn expand(command: &mut Command, arguments: Vec<OsString>) -> Result<Expanded> {
    command.build();
    let typed = Typed::scan(command, &arguments)?;
    let Some(file) = typed.file else { return Ok(Expanded { arguments, ..Expanded::default() }) };
    let text =
        std::fs::read_to_string(&file).with_context(|| format!("cannot read the options: {}", file.display()))?;
    let table: toml::Table = text.parse().with_context(|| format!("the options are not TOML: {}", file.display()))?;
    // The verb's own table wins over the file's top, as what was typed wins over both.
    let mut given = typed.ids;
    let mut from_file: BTreeSet<String> = BTreeSet::new();
    let mut options: Vec<OsString> = Vec::new();
    let (top, own) = entries(command, typed.verb, &table, &file)?;
    for level in [own, top] {
        let mut keys: BTreeMap<&str, &str> = BTreeMap::new();
        let mut here = Vec::new();
        for (key, value) in level {
            let argument = argument_of(typed.verb, key, &file)?;
            let id = argument.get_id().as_str();
            if let Some(before) = keys.insert(id, key) {
                bail!("{before} and {key} are one option; name it once: {}", file.display());
            }
            if from_file.contains(id) || given.iter().any(|other| id == other || conflict(typed.verb, argument, other))
            {
                continue;
            }
            here.push((id, words(argument, key, value).with_context(|| file.display().to_string())?));
        }
        // What is set to false is said by no word, and stands beside everything.
        given.extend(here.iter().filter(|(_, words)| !words.is_empty()).map(|(id, _)| (*id).to_owned()));
        from_file.extend(here.iter().map(|(id, _)| (*id).to_owned()));
        let mut level: Vec<OsString> = here.into_iter().flat_map(|(_, words)| words).collect();
        level.append(&mut options);
        options = level;
    }
    let mut all = Vec::new();
    for (place, word) in arguments.into_iter().enumerate() {
        if !typed.config_words.contains(&place) {
            all.push(word);
        }
        if place == typed.verb_place {
            all.append(&mut options);
        }
    }
    Ok(Expanded { arguments: all, file: Some(file), from_file })
}

/// The arguments without `--config FILE`: what was typed, where the file is not there yet.
pub(crate) fn without_file(command: &mut Command, arguments: Vec<OsString>) -> Result<Vec<OsString>> {
    command.build();
    let typed = Typed::scan(command, &arguments)?;
    let is_typed = |(place, word)| (!typed.config_words.contains(&place)).then_some(word);
    Ok(arguments.into_iter().enumerate().filter_map(is_typed).collect())
}

/// What was typed, as far as the file's options depend on it.
struct Typed<'a> {
    /// The verb's command, or the program's own.
    verb: &'a Command,
    verb_place: usize,
    /// The names of the options typed.
    ids: BTreeSet<String>,
    file: Option<PathBuf>,
    /// Where `--config` and its value stand.
    config_words: BTreeSet<usize>,
}

impl<'a> Typed<'a> {
    /// Walks over the words as clap will: an option that takes a value takes the next word, unless it brings its own behind `=`, or may stand alone and an option follows.
    fn scan(program: &'a Command, arguments: &[OsString]) -> Result<Self> {
        let mut typed =
            Self { verb: program, verb_place: 0, ids: BTreeSet::new(), file: None, config_words: BTreeSet::new() };
        let mut place = 1;
        while let Some(word) = arguments.get(place).map(|word| word.to_string_lossy()) {
            if word == "--" {
                break;
            }
            let (argument, value) = typed.option(&word);
            if let Some(argument) = argument {
                let takes_next = value.is_none() && takes_next(argument, arguments.get(place + 1));
                if argument.get_id() == CONFIG {
                    let file = value.map(OsString::from).or_else(|| arguments.get(place + 1).cloned());
                    typed.config_words.insert(place);
                    if takes_next {
                        typed.config_words.insert(place + 1);
                    }
                    let Some(file) = file else { bail!("--config needs a file") };
                    if typed.file.replace(file.into()).is_some() {
                        bail!("--config is there twice; name one file");
                    }
                }
                typed.ids.insert(argument.get_id().to_string());
                place += usize::from(takes_next);
            } else if typed.verb_place == 0
                && let Some(verb) = program.find_subcommand(word.as_ref())
            {
                (typed.verb, typed.verb_place) = (verb, place);
            }
            place += 1;
        }
        Ok(typed)
    }

    /// The option that a word names, and the value it brings with it. Of short options in one word, the last; the others take no value.
    fn option(&mut self, word: &str) -> (Option<&'a Arg>, Option<String>) {
        if let Some(long) = word.strip_prefix("--") {
            let (name, value) = long.split_once('=').map_or((long, None), |(name, value)| (name, Some(value)));
            let found = self.verb.get_arguments().find(|argument| argument.get_long() == Some(name));
            return (found, value.map(str::to_owned));
        }
        let Some(shorts) = word.strip_prefix('-') else { return (None, None) };
        let mut last = None;
        for (place, short) in shorts.char_indices() {
            let found = self.verb.get_arguments().find(|argument| argument.get_short() == Some(short));
            let Some(argument) = found else { break };
            self.ids.insert(argument.get_id().to_string());
            last = Some(argument);
            let rest = &shorts[place + short.len_utf8()..];
            if argument.get_action().takes_values() && !rest.is_empty() {
                return (last, Some(rest.to_owned()));
            }
        }
        (last, None)
    }
}

/// Whether an option without a value of its own takes the next word.
fn takes_next(argument: &Arg, next: Option<&OsString>) -> bool {
    let may_stand_alone = argument.get_num_args().is_some_and(|count| count.min_values() == 0);
    let is_option = next.is_some_and(|word| word.to_string_lossy().starts_with('-'));
    argument.get_action().takes_values() && !(may_stand_alone && is_option)
}

/// Keys of a file with their values.
type Entries<'a> = Vec<(&'a str, &'a Value)>;

/// The file's entries for the verb: those at its top, and those of the verb's own table.
fn entries<'a>(
    program: &Command,
    verb: &Command,
    table: &'a toml::Table,
    file: &Path,
) -> Result<(Entries<'a>, Entries<'a>)> {
    let (mut top, mut own) = (Vec::new(), Vec::new());
    for (key, value) in table {
        match value {
            Value::Table(inner) if program.find_subcommand(key).is_some() => {
                if verb.get_name() == key {
                    own.extend(inner.iter().map(|(key, value)| (key.as_str(), value)));
                }
            }
            Value::Table(_) => {
                let verbs: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
                bail!("no verb {key}; the verbs are {}: {}", verbs.join(", "), file.display());
            }
            value => top.push((key.as_str(), value)),
        }
    }
    Ok((top, own))
}

/// The verb's option of that name.
fn argument_of<'a>(verb: &'a Command, key: &str, file: &Path) -> Result<&'a Arg> {
    let name = key.replace('_', "-");
    let is_option = |argument: &&Arg| {
        !matches!(argument.get_id().as_str(), CONFIG | "help" | "version") && argument.get_long().is_some()
    };
    let mut options = verb.get_arguments().filter(is_option);
    if let Some(found) = options.find(|argument| argument.get_long() == Some(name.as_str())) {
        return Ok(found);
    }
    let known: Vec<&str> = verb.get_arguments().filter(is_option).filter_map(Arg::get_long).collect();
    bail!("no option {key} of {}; its options are {}: {}", verb.get_name(), known.join(", "), file.display())
}

/// Whether the argument cannot stand beside the one of name `other`.
fn conflict(verb: &Command, argument: &Arg, other: &str) -> bool {
    let names = |of: &Arg, name: &str| verb.get_arg_conflicts_with(of).iter().any(|found| found.get_id() == name);
    names(argument, other)
        || verb
            .get_arguments()
            .find(|found| found.get_id() == other)
            .is_some_and(|other| names(other, argument.get_id().as_str()))
}

/// The words that stand for one entry.
fn words(argument: &Arg, key: &str, value: &Value) -> Result<Vec<OsString>> {
    let option = format!("--{}", argument.get_long().unwrap_or(key));
    let with = |text: &str| OsString::from(format!("{option}={text}"));
    if !argument.get_action().takes_values() {
        return match value {
            Value::Boolean(true) => Ok(vec![option.into()]),
            Value::Boolean(false) => Ok(Vec::new()),
            _ => bail!("{key} = {value}; it is true or false"),
        };
    }
    let Value::Array(parts) = value else { return Ok(vec![with(&plain(key, value)?)]) };
    let parts = parts.iter().map(|part| plain(key, part)).collect::<Result<Vec<String>>>()?;
    match (argument.get_action(), argument.get_value_delimiter()) {
        (ArgAction::Append, None) => Ok(parts.iter().map(|part| with(part)).collect()),
        (_, delimiter) => {
            let between = delimiter.unwrap_or(',').to_string();
            Ok(vec![with(&parts.join(&between))])
        }
    }
}

/// A value as it would be typed.
fn plain(key: &str, value: &Value) -> Result<String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Ok(value.to_string()),
        _ => bail!("{key} = {value}; a text, a number, true, false, or a list of them is right"),
    }
}

#[cfg(test)]
#[path = "config/tests.rs"]
mod tests;
