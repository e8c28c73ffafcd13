//! Sweeps: many runs from one plan. In: a plan file with settings to vary and the command lines to give for each choice of them. Out: a list of
//! [`Element`]s with stable folders, each of which anything that can start a program can run: this program itself, xargs, Slurm, Ray.
//!
//! ```toml
//! output = "runs/table1"                 # one folder a run below it
//! seeds = 3                              # or a list; `{seed}` in the stages
//! [grid]                                 # every combination
//! objective = ["vibes", "reconstruction"]
//! [zip]                                  # lists of one length, whose entries belong together
//! depth = [8, 16]
//! hidden = [64, 128]
//! ```
//!
//! with `stages`, the command lines in their order, in which `{key}` stands for a setting and `{run}` for the run's folder.
//!
//! No scheduler, no database: the state of a sweep is what lies in its folders. The same command goes on. Whoever does a run by its number says which run that
//! was when it was counted ([`Element::digest`], [`names_digest`]), so that a plan which has changed since is refused.

mod mark;
mod outputs;
mod plan;
mod script;
mod status;

use std::collections::BTreeMap;
use std::path::PathBuf;

pub use mark::{Mark, StageEnd, run_element};
pub use plan::Plan;
pub use script::{Engine, script};
pub use status::{State, Status, status};

/// One run of a sweep.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// Its place in the plan, from 0.
    pub index: usize,
    /// The settings that vary, as in `objective=vibes,seed=0`; also the folder's own name.
    pub name: String,
    /// Its folder, `{run}` in the stages.
    pub folder: PathBuf,
    /// Every setting, also those with one value only.
    pub settings: BTreeMap<String, String>,
    /// The words of every command line, the program's name first.
    pub stages: Vec<Vec<String>>,
}

impl Element {
    /// What tells it from every other run, also from what a changed plan has in its place.
    pub fn digest(&self) -> String {
        let folder = self.folder.to_string_lossy();
        digest(&serde_json::json!([self.name, folder, self.settings, self.stages]).to_string())
    }
}

/// What tells a plan from one whose numbers mean other runs: of all names, in their order.
pub fn names_digest(elements: &[Element]) -> String {
    digest(&elements.iter().map(|element| element.name.as_str()).collect::<Vec<_>>().join("\n"))
}

/// Enough of a checksum to tell texts apart that nobody has made alike on purpose.
fn digest(text: &str) -> String {
    vibes_data::sha256_hex(text.as_bytes())[..12].to_owned()
}

/// A command line as it can be typed.
pub fn line(words: &[String]) -> String {
    let is_plain =
        |word: &str| !word.is_empty() && word.chars().all(|c| c.is_alphanumeric() || "-_./=:,+@%".contains(c));
    let typed = |word: &String| {
        if is_plain(word) { word.clone() } else { format!("'{}'", word.replace('\'', r"'\''")) }
    };
    words.iter().map(typed).collect::<Vec<_>>().join(" ")
}
