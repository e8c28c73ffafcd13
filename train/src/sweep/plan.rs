//! The plan file and its expansion. In: TOML. Out: the elements, in an order that follows from the settings alone and not from the order of the
//! file's keys.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Table, Value};

use super::Element;
use crate::error::{Result, TrainError, io};

/// Longest value in a folder's name; longer ones are named by their checksum.
const LONGEST: usize = 32;
/// The most runs that a plan may stand for: a slip of the keyboard in `seeds` must not fill the memory.
const MOST_RUNS: usize = 100_000;

type Settings = BTreeMap<String, String>;

/// A plan, as the file says it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Where the runs' folders lie.
    pub output: PathBuf,
    /// The command lines of every run.
    pub stages: Vec<String>,
    #[serde(default)]
    seeds: Option<Seeds>,
    #[serde(default)]
    grid: Table,
    #[serde(default)]
    zip: Table,
    #[serde(default)]
    list: Vec<Table>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Seeds {
    Count(u64),
    These(Vec<u64>),
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// The file is missing, not TOML, or no plan.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(io("read", path))?;
        toml::from_str(&text).map_err(|error| {
            let known = "a plan has output, stages, and seeds, [grid], [zip] or [[list]]";
            TrainError::Options(format!("{}; {known}: {}", error.to_string().trim_end(), path.display()))
        })
    }

    /// Every run.
    ///
    /// # Errors
    /// More runs than anyone makes, lists of different lengths under `[zip]`, a setting in two places, a setting that no stage uses, a placeholder that is no
    /// setting, two runs of one name.
    pub fn expand(&self) -> Result<Vec<Element>> {
        self.check_once()?;
        let mut all = vec![Settings::new()];
        for (key, values) in sorted(&self.grid) {
            let values = texts(key, values)?;
            all = product(&all, &values.iter().map(|value| one(key, value)).collect::<Vec<_>>())?;
        }
        if !self.zip.is_empty() {
            all = product(&all, &self.zipped()?)?;
        }
        if !self.list.is_empty() {
            let entries = self.list.iter().map(|table| {
                sorted(table).map(|(key, value)| Ok((key.clone(), text(key, value)?))).collect::<Result<Settings>>()
            });
            all = product(&all, &entries.collect::<Result<Vec<_>>>()?)?;
        }
        if let Some(seeds) = &self.seeds {
            let seeds: Vec<u64> = match seeds {
                Seeds::Count(count) if *count > MOST_RUNS as u64 => return Err(too_many()),
                Seeds::Count(count) => (0..*count).collect(),
                Seeds::These(seeds) => seeds.clone(),
            };
            all = product(&all, &seeds.iter().map(|seed| one("seed", &seed.to_string())).collect::<Vec<_>>())?;
        }
        self.elements(all)
    }

    /// That no setting varies in two places, of which one would win unseen.
    fn check_once(&self) -> Result<()> {
        let of_lists: BTreeSet<&str> = self.list.iter().flat_map(Table::keys).map(String::as_str).collect();
        let seeds = self.seeds.as_ref().map(|_| "seed");
        let places = [
            ("[grid]", self.grid.keys().map(String::as_str).collect::<Vec<_>>()),
            ("[zip]", self.zip.keys().map(String::as_str).collect()),
            ("[[list]]", of_lists.into_iter().collect()),
            ("seeds", seeds.into_iter().collect()),
        ];
        let mut seen = BTreeMap::new();
        for (place, keys) in places {
            for key in keys {
                if let Some(before) = seen.insert(key.to_owned(), place) {
                    return Err(wrong(format!("{key} is set by {before} and by {place}; leave it to one of them")));
                }
            }
        }
        Ok(())
    }

    fn zipped(&self) -> Result<Vec<Settings>> {
        let columns: Vec<(&String, Vec<String>)> =
            sorted(&self.zip).map(|(key, values)| Ok((key, texts(key, values)?))).collect::<Result<_>>()?;
        let lengths: BTreeSet<usize> = columns.iter().map(|(_, values)| values.len()).collect();
        if lengths.len() > 1 {
            let named: Vec<String> = columns.iter().map(|(key, values)| format!("{key} {}", values.len())).collect();
            return Err(wrong(format!(
                "lists of different lengths under [zip] ({}); they belong together",
                named.join(", ")
            )));
        }
        let count = lengths.first().copied().unwrap_or(0);
        Ok((0..count)
            .map(|row| columns.iter().map(|(key, values)| ((*key).clone(), values[row].clone())).collect())
            .collect())
    }

    fn elements(&self, all: Vec<Settings>) -> Result<Vec<Element>> {
        let stages = self.stages.iter().map(|stage| split(stage)).collect::<Result<Vec<_>>>()?;
        if all.is_empty() || stages.is_empty() {
            return Err(wrong("the plan has no run; a list of values or of stages is empty".to_owned()));
        }
        let keys: BTreeSet<&String> = all.iter().flat_map(Settings::keys).collect();
        for key in &keys {
            let placeholder = format!("{{{key}}}");
            if key.as_str() == "run" || !self.stages.iter().any(|stage| stage.contains(&placeholder)) {
                return Err(wrong(format!(
                    "no stage uses the setting {key}; write {placeholder} where it belongs, or leave it out"
                )));
            }
        }
        let varies = |key: &String| all.iter().map(|settings| settings.get(key)).collect::<BTreeSet<_>>().len() > 1;
        let varying: Vec<&String> = keys.into_iter().filter(|key| varies(key)).collect();
        let mut names = BTreeSet::new();
        all.iter()
            .enumerate()
            .map(|(index, settings)| {
                let name = name(settings, &varying);
                if !names.insert(name.clone()) {
                    return Err(wrong(format!("two runs have the settings {name}; leave one of them out")));
                }
                let folder = self.output.join(&name);
                let fill = |words: &Vec<String>| words.iter().map(|word| filled(word, settings, &folder)).collect();
                let stages = stages.iter().map(fill).collect::<Result<_>>()?;
                Ok(Element { index, name, folder, settings: settings.clone(), stages })
            })
            .collect()
    }
}

/// A table's entries by key, in whatever order the file has them.
fn sorted(table: &Table) -> impl Iterator<Item = (&String, &Value)> {
    table.iter().collect::<BTreeMap<_, _>>().into_iter()
}

fn one(key: &str, value: &str) -> Settings {
    Settings::from([(key.to_owned(), value.to_owned())])
}

/// Every one of `all` with every one of `more`, the latter changing faster.
fn product(all: &[Settings], more: &[Settings]) -> Result<Vec<Settings>> {
    if all.len().saturating_mul(more.len()) > MOST_RUNS {
        return Err(too_many());
    }
    let join = |left: &Settings, right: &Settings| left.clone().into_iter().chain(right.clone()).collect();
    Ok(all.iter().flat_map(|left| more.iter().map(move |right| join(left, right))).collect())
}

fn too_many() -> TrainError {
    wrong(format!("the plan stands for more than {MOST_RUNS} runs; take fewer seeds or values"))
}

fn texts(key: &str, values: &Value) -> Result<Vec<String>> {
    let list = values.as_array().ok_or_else(|| wrong(format!("{key} = {values}; a list of values is wanted")))?;
    list.iter().map(|value| text(key, value)).collect()
}

fn text(key: &str, value: &Value) -> Result<String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Ok(value.to_string()),
        _ => Err(wrong(format!("{key} = {value}; a text, a number, true or false is wanted"))),
    }
}

/// `key=value,…` of the settings that vary, the seed last; a file system and a shell take it as it is.
fn name(settings: &Settings, varying: &[&String]) -> String {
    let mut parts: Vec<(bool, String)> = varying
        .iter()
        .filter_map(|key| settings.get(*key).map(|value| (key.as_str() == "seed", format!("{key}={}", short(value)))))
        .collect();
    parts.sort();
    if parts.is_empty() { "run".to_owned() } else { parts.into_iter().map(|part| part.1).collect::<Vec<_>>().join(",") }
}

fn short(value: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.+".contains(c);
    if value.len() <= LONGEST && !value.is_empty() && value.chars().all(is_plain) {
        return value.to_owned();
    }
    super::digest(value)
}

/// A word with its placeholders filled in.
fn filled(word: &str, settings: &Settings, folder: &Path) -> Result<String> {
    let (mut all, mut rest) = (String::new(), word);
    while let Some((before, after)) = rest.split_once('{') {
        let (key, after) =
            after.split_once('}').ok_or_else(|| wrong(format!("a {{ without its }} in the stage: {word}")))?;
        all += before;
        match (key, settings.get(key)) {
            ("run", _) => all += &folder.to_string_lossy(),
            (_, Some(value)) => all += value,
            (_, None) => {
                let known: Vec<String> = settings.keys().map(|key| format!("{{{key}}}")).collect();
                return Err(wrong(format!("no setting {{{key}}}; there are {{run}} {}", known.join(" "))));
            }
        }
        rest = after;
    }
    Ok(all + rest)
}

/// The words of a command line; quotes of either kind keep a word together.
fn split(line: &str) -> Result<Vec<String>> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for c in line.chars() {
        match (c, quote) {
            (c, Some(end)) if c == end => quote = None,
            ('\'' | '"', None) => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (c, None) if c.is_whitespace() => words.extend(word.take()),
            (c, _) => word.get_or_insert_default().push(c),
        }
    }
    if quote.is_some() {
        return Err(wrong(format!("a quote is not closed in the stage: {line}")));
    }
    words.extend(word);
    match words.first().map(String::as_str) {
        Some("vibes-train" | "vibes-collect" | "vibes-analyze") => Ok(words),
        _ => Err(wrong(format!("a stage begins with vibes-collect, vibes-train or vibes-analyze, not: {line}"))),
    }
}

fn wrong(text: String) -> TrainError {
    TrainError::Options(text)
}

#[cfg(test)]
#[path = "plan/tests.rs"]
mod tests;
