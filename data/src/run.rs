//! A run folder as `vibes-train` writes it and others read it: what was trained, how its numbers went, and where its checkpoints lie.
//!
//! ```text
//! run.json                          what was trained on what: options, model, recordings, versions
//! metrics.jsonl                     one JSON object of numbers every few updates
//! evaluations.jsonl                 the same, measured on a held-out grid
//! checkpoints/000500/               a checkpoint after 500 updates, there whole or not at all
//!     model.safetensors
//! latents.arrow                     from `vibes-train encode`
//! ```
//!
//! A run without a world model has `model_free.json` in the place of `run.json`, and networks of its own in its checkpoints ([`RunFolder::open_info`] reads both).
//!
//! The metrics are open: every numeric field is a metric, whatever its name, so that a new learner needs no change here.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::{Error, Result, find_place, write_atomically};

/// The format's name in `run.json`.
pub const RUN_FORMAT: &str = "vibes-run/1";

/// The format's name in `model_free.json`.
pub const MODEL_FREE_FORMAT: &str = "vibes-model-free-run/1";

/// What `run.json` holds. The trainer writes its own types for the options and the model; a reader that knows neither leaves them open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunInfo<Options = Map<String, Value>, Model = Map<String, Value>> {
    /// Always [`RUN_FORMAT`].
    pub format: String,
    /// The resolved options.
    pub options: Options,
    /// The model.
    pub model: Model,
    /// The recordings it learned from, as [places](crate::relative_place) relative to the run folder.
    pub recordings: Vec<String>,
    /// The run whose newest weights this one began with, if it did not begin anew; a place like those of the recordings.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub from: Option<String>,
    /// What the runs before it had learned from, of a copy that `vibes-train keep` made of a run which went on from others: those seldom travel along.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub began_with: Option<HeadStart>,
    /// Episodes in the recordings when the run was last trained.
    pub episodes: usize,
    /// Steps of all those episodes.
    pub steps: u64,
    /// Versions of what the numbers depend on.
    pub versions: BTreeMap<String, String>,
}

/// How much others had lived through for a run when it began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeadStart {
    /// Control steps of it; none where there are none, or they are not known.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub given_control_steps: Option<u64>,
    /// What that number is known from.
    pub given_from: GivenFrom,
}

/// What the control steps that a run began with are known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum GivenFrom {
    /// The recordings: views of an episode count once.
    #[serde(rename = "recordings")]
    Recordings,
    /// In part what the files of a run say whose recordings, or the runs before it, are gone: there every view may count.
    #[serde(rename = "run.json")]
    RunFile,
    /// Nothing: with a run before this one it is gone what that one learned from.
    #[serde(rename = "unknown")]
    Unknown,
}

impl<Options, Model> RunInfo<Options, Model> {
    /// The recordings' folder names.
    pub fn recording_names(&self) -> Vec<String> {
        self.recordings.iter().map(|place| place_name(place)).collect()
    }

    /// The folder name of the run it went on from.
    pub fn from_name(&self) -> Option<String> {
        self.from.as_deref().map(place_name)
    }
}

impl RunInfo {
    /// An option that is a text, as in `objective`.
    pub fn option(&self, name: &str) -> Option<&str> {
        self.options.get(name)?.as_str()
    }

    /// What a run without a world model says, under the names that others have: its system is its objective, its world's task the model's, its replay its recording.
    fn of_model_free(options: Map<String, Value>) -> Self {
        let text = |value: &Value, key: &str| value.get(key).cloned().unwrap_or_default();
        let world = options.get("online").map_or(Value::Null, |online| text(online, "world"));
        let mut named = options.clone();
        named.insert("objective".to_owned(), options.get("system").cloned().unwrap_or_default());
        Self {
            format: MODEL_FREE_FORMAT.to_owned(),
            model: Map::from_iter([("task".to_owned(), text(&world, "task"))]),
            options: named,
            recordings: vec!["replay".to_owned()],
            from: None,
            began_with: None,
            episodes: 0,
            steps: 0,
            versions: BTreeMap::new(),
        }
    }

    /// The task of the recordings.
    pub fn task(&self) -> Option<&str> {
        self.model.get("task")?.as_str()
    }
}

/// The last part of a place: the folder's own name.
fn place_name(place: &str) -> String {
    Path::new(place).file_name().map_or_else(|| place.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// The places of a run folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// The run folder at `path`, whether it is there or not.
    pub fn at(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The folder's own name.
    pub fn name(&self) -> String {
        let whole = std::path::absolute(&self.path).unwrap_or_else(|_unknown| self.path.clone());
        whole.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned())
    }

    /// `run.json`.
    pub fn info_path(&self) -> PathBuf {
        self.path.join("run.json")
    }

    /// `model_free.json`, in the place of `run.json` where there is no world model.
    pub fn model_free_path(&self) -> PathBuf {
        self.path.join("model_free.json")
    }

    /// The numbers over training.
    pub fn metrics_path(&self) -> PathBuf {
        self.path.join("metrics.jsonl")
    }

    /// The numbers measured on a held-out grid while training.
    pub fn evaluations_path(&self) -> PathBuf {
        self.path.join("evaluations.jsonl")
    }

    /// Reads `run.json`.
    ///
    /// # Errors
    /// [`Error::NoRun`], or [`Error::Malformed`] for a damaged file or one of another format.
    pub fn info<O: DeserializeOwned, M: DeserializeOwned>(&self) -> Result<RunInfo<O, M>> {
        let file = self.info_path();
        let Some(text) = text_if_there(&file)? else {
            return Err(Error::NoRun { path: self.path.clone() });
        };
        let expected = "a run.json as vibes-train writes it";
        let malformed = |error: serde_json::Error| Error::malformed(&file, error.to_string(), expected);
        // The format first: another one's fields would only be called missing.
        let open: Value = serde_json::from_str(&text).map_err(malformed)?;
        match open["format"].as_str() {
            Some(RUN_FORMAT) => serde_json::from_str(&text).map_err(malformed),
            other => {
                let fact = format!("format {}", other.unwrap_or("missing"));
                Err(Error::malformed(&file, fact, format!("this version reads {RUN_FORMAT}")))
            }
        }
    }

    /// What a run of either kind says, for a reader that knows neither its options nor its model.
    ///
    /// # Errors
    /// As [`RunFolder::info`].
    pub fn open_info(&self) -> Result<RunInfo> {
        let file = self.model_free_path();
        let Some(text) = text_if_there(&file)? else { return self.info() };
        let expected = "a model_free.json as vibes-train writes it";
        let options: Map<String, Value> =
            serde_json::from_str(&text).map_err(|error| Error::malformed(&file, error.to_string(), expected))?;
        match options.get("format").and_then(Value::as_str) {
            Some(MODEL_FREE_FORMAT) => Ok(RunInfo::of_model_free(options)),
            other => {
                let fact = format!("format {}", other.unwrap_or("missing"));
                Err(Error::malformed(&file, fact, format!("this version reads {MODEL_FREE_FORMAT}")))
            }
        }
    }

    /// Every checkpoint's number of updates and its folder, ascending.
    pub fn checkpoint_folders(&self) -> Vec<(u64, PathBuf)> {
        let Ok(entries) = std::fs::read_dir(self.path.join("checkpoints")) else { return Vec::new() };
        let numbered = |entry: std::io::Result<std::fs::DirEntry>| {
            let entry = entry.ok()?;
            Some((entry.file_name().to_str()?.parse().ok()?, entry.path()))
        };
        let mut folders: Vec<(u64, PathBuf)> = entries.filter_map(numbered).collect();
        folders.sort_unstable();
        folders
    }

    /// Every checkpoint's number of updates, ascending.
    pub fn checkpoints(&self) -> Vec<u64> {
        self.checkpoint_folders().into_iter().map(|(update, _)| update).collect()
    }

    /// The folder of the newest checkpoint.
    ///
    /// # Errors
    /// [`Error::NoCheckpoint`].
    pub fn newest_checkpoint(&self) -> Result<PathBuf> {
        let newest = self.checkpoint_folders().pop();
        newest.map(|(_, path)| path).ok_or_else(|| Error::NoCheckpoint { path: self.path.clone() })
    }

    /// The folder of a checkpoint.
    pub fn checkpoint_path(&self, update: u64) -> PathBuf {
        self.path.join("checkpoints").join(format!("{update:06}"))
    }

    /// The model file of the newest checkpoint.
    ///
    /// # Errors
    /// [`Error::NoCheckpoint`].
    pub fn newest_model(&self) -> Result<PathBuf> {
        Ok(self.newest_checkpoint()?.join("model.safetensors"))
    }

    /// A recording that `run.json` names, if it is still where the run can find it.
    pub fn find_recording(&self, place: &str) -> Option<PathBuf> {
        find_place(place, &self.path, |path| path.join("manifest.json").is_file())
    }

    /// Another run that `run.json` names, if it is still where the run can find it.
    pub fn find_run(&self, place: &str) -> Option<PathBuf> {
        find_place(place, &self.path, |path| path.join("run.json").is_file())
    }
}

/// Lines of numbers, as in `metrics.jsonl`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Metrics {
    /// Every whole line, in the file's order.
    pub lines: Vec<Map<String, Value>>,
    /// Lines that are no JSON object; a run that was killed leaves at most one.
    pub broken: usize,
}

impl Metrics {
    /// Reads a file of numbers; a missing file holds none.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self::parse(&text_if_there(path)?.unwrap_or_default()))
    }

    fn parse(text: &str) -> Self {
        let mut metrics = Self::default();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            match serde_json::from_str(line) {
                Ok(line) => metrics.lines.push(renamed(line)),
                Err(_no_object) => metrics.broken += 1,
            }
        }
        metrics
    }

    /// The last value of a metric.
    pub fn last(&self, name: &str) -> Option<f64> {
        self.lines.iter().rev().find_map(|line| line.get(name)?.as_f64())
    }
}

/// What older runs called numbers of the training batches, by names that belong to numbers of a held-out grid, and what they are called now.
const RENAMED: [(&str, &str); 2] = [("gap", "adversary_minus_dynamics"), ("effective_rank", "batch_effective_rank")];

/// A line with today's names; metrics of other programs, which lack what every line of these runs has, keep theirs.
fn renamed(mut line: Map<String, Value>) -> Map<String, Value> {
    if !line.contains_key("dynamics_log_likelihood") {
        return line;
    }
    for (old, new) in RENAMED {
        if let Some(value) = line.remove(old) {
            line.insert(new.to_owned(), value);
        }
    }
    line
}

/// A line of at most so many updates as it stands, or under today's names; none of one beyond, or of no line of numbers.
fn kept(line: &str, update: u64) -> Option<String> {
    let numbers: Map<String, Value> = serde_json::from_str(line).ok()?;
    if numbers.get("update")?.as_u64()? > update {
        return None;
    }
    let today = renamed(numbers.clone());
    if today == numbers { Some(line.to_owned()) } else { serde_json::to_string(&today).ok() }
}

/// An open file of numbers that grows by one line at a time.
#[derive(Debug)]
pub struct MetricsFile {
    path: PathBuf,
    file: File,
}

impl MetricsFile {
    /// Opens the file to go on after `update`: lines beyond it, which a stopped run wrote after its last checkpoint, are dropped.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn open(path: &Path, update: u64) -> Result<Self> {
        let before = text_if_there(path)?.unwrap_or_default();
        let kept: String =
            before.lines().filter_map(|line| kept(line, update)).flat_map(|line| [line, "\n".into()]).collect();
        write_atomically(path, kept.as_bytes())?;
        let file = OpenOptions::new().append(true).open(path).map_err(Error::io("open", path))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Appends a line.
    ///
    /// # Errors
    /// [`Error::Malformed`] for what JSON cannot hold, [`Error::Io`].
    pub fn append(&mut self, line: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string(line)
            .map_err(|error| Error::malformed(&self.path, error.to_string(), "numbers that JSON can hold"))?;
        writeln!(self.file, "{text}").map_err(Error::io("write", &self.path))
    }
}

/// The text of a file; nothing where there is no such file.
fn text_if_there(path: &Path) -> Result<Option<String>> {
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::io("read", path)(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INFO: &str = r#"{"format":"vibes-run/1","options":{"objective":"vibes"},"model":{"task":"reacher-easy"},
        "recordings":["../../recordings/x"],"episodes":2,"steps":250,"versions":{}}"#;

    #[test]
    fn a_reader_that_knows_no_model_reads_what_was_trained() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::at(folder.path());
        assert!(matches!(run.info::<Value, Value>(), Err(Error::NoRun { .. })));
        std::fs::write(run.info_path(), INFO).unwrap();
        let info: RunInfo = run.info().unwrap();
        assert_eq!((info.option("objective"), info.task()), (Some("vibes"), Some("reacher-easy")));
        assert_eq!(info.recording_names(), ["x"]);
        std::fs::write(run.info_path(), INFO.replace("vibes-run/1", "vibes-run/9")).unwrap();
        let error = run.info::<Value, Value>().unwrap_err().to_string();
        assert!(error.contains("format vibes-run/9; this version reads vibes-run/1"), "{error}");
    }

    #[test]
    fn an_older_run_has_todays_names_also_once_it_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        for (old, new) in RENAMED {
            // What every line of these runs says, and no other program's does.
            let ours = "\"dynamics_log_likelihood\":2";
            let text = format!("{{\"update\":10,{ours},\"{old}\":0.5}}\n{{\"update\":20,{ours},\"{new}\":0.25}}\n");
            std::fs::write(&path, text.replace(ours, "\"loss\":2")).unwrap();
            assert_eq!(Metrics::read(&path).unwrap().lines[0][old], 0.5);
            std::fs::write(&path, text).unwrap();
            let metrics = Metrics::read(&path).unwrap();
            let found: Vec<Option<f64>> = metrics.lines.iter().map(|line| line[new].as_f64()).collect();
            assert_eq!(found, [Some(0.5), Some(0.25)]);
            MetricsFile::open(&path, 20).unwrap();
            assert!(!std::fs::read_to_string(&path).unwrap().contains(&format!("\"{old}\"")));
        }
    }

    #[test]
    fn a_run_without_a_world_model_is_read_by_the_same_names() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::at(folder.path());
        let text = r#"{"format":"vibes-model-free-run/1","system":"sac-drq","size":"small","online":{"world":{"task":"known-slide"}}}"#;
        std::fs::write(run.model_free_path(), text).unwrap();
        let info = run.open_info().unwrap();
        assert_eq!(
            (info.option("objective"), info.option("size"), info.task()),
            (Some("sac-drq"), Some("small"), Some("known-slide"))
        );
        assert_eq!(info.recording_names(), ["replay"]);
        std::fs::write(run.model_free_path(), text.replace("run/1", "run/9")).unwrap();
        let error = run.open_info().unwrap_err().to_string();
        assert!(error.contains("format vibes-model-free-run/9"), "{error}");
    }

    #[test]
    fn a_folder_without_checkpoints_says_so_and_the_newest_one_wins() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::at(folder.path());
        assert!(matches!(run.newest_model(), Err(Error::NoCheckpoint { .. })));
        for name in ["000500", "1000000", ".partial"] {
            std::fs::create_dir_all(folder.path().join("checkpoints").join(name)).unwrap();
        }
        assert_eq!(run.checkpoints(), [500, 1_000_000]);
        assert!(run.newest_model().unwrap().ends_with("checkpoints/1000000/model.safetensors"));
    }

    #[test]
    fn a_resumed_file_drops_what_came_after_the_checkpoint_and_half_a_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        std::fs::write(&path, "{\"update\":10,\"loss\":2.5}\n{\"update\":20,\"loss\":1.5}\n{\"update\":30,\"lo")
            .unwrap();
        assert_eq!(Metrics::read(&path).unwrap().broken, 1);
        let mut file = MetricsFile::open(&path, 10).unwrap();
        file.append(&serde_json::json!({"update": 20, "loss": 1.25})).unwrap();
        let metrics = Metrics::read(&path).unwrap();
        assert_eq!((metrics.lines.len(), metrics.broken, metrics.last("loss")), (2, 0, Some(1.25)));
    }
}
