//! Datasets of others as recordings. In: a folder in one of the [`ImportFormat`]s. Out: a recording whose rows are aligned as ours are; what is lost,
//! and what is filled in, stands in the package's `CARE.md`.

mod array;
mod dreamer;
mod minari;
mod npy;
mod npz;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::Serialize;
use serde_json::json;
use vibes_data::{
    ActionSpec, CameraPose, Episode, EpisodeInfo, Error as DataError, FORMAT, Manifest, Recording, RecordingWriter,
    Spec,
};

use super::{NEVER, NewFolder, go_on};
use crate::error::{Error, Result};

pub use dreamer::read_dreamer_file;
pub use minari::read_minari_folder;

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ImportFormat {
    /// A folder of `.npz` files as Dreamer, DreamerV2 and V-D4RL write them.
    Dreamer,
    /// A Minari dataset in its HDF5 or Arrow storage.
    Minari,
}

/// What a dataset does not say of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// The task's name; the dataset's own name without one.
    pub task: Option<String>,
    /// Seconds of a control step; 1 without one.
    pub control_timestep: Option<f64>,
    /// Control steps a row; 1 without one.
    pub action_repeat: Option<u32>,
    /// Whether MCAP logs are written too.
    pub with_mcap: bool,
}

/// What an import found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ImportReport {
    /// Episodes.
    pub episodes: usize,
    /// Rows of all of them.
    pub rows: u64,
    /// What the dataset holds and a recording has no place for.
    pub ignored: BTreeSet<String>,
}

/// Reads a dataset into a new recording.
///
/// # Errors
/// When the folder is taken, or a file of the dataset is damaged or does not fit the others; the message names it.
pub fn import(
    format: ImportFormat,
    source: &Path,
    options: &ImportOptions,
    out: &Path,
) -> Result<(Recording, ImportReport)> {
    import_until(format, source, options, out, &NEVER)
}

/// The same, until `stop` is raised.
///
/// # Errors
/// As [`import`]; [`Error::Stopped`].
pub fn import_until(
    format: ImportFormat,
    source: &Path,
    options: &ImportOptions,
    out: &Path,
    stop: &AtomicBool,
) -> Result<(Recording, ImportReport)> {
    let folder = NewFolder::begin(out, [source])?;
    let report = match format {
        ImportFormat::Dreamer => dreamer::read(source, options, folder.path(), stop)?,
        ImportFormat::Minari => minari::read(source, options, folder.path(), stop)?,
    };
    folder.finish()?;
    Ok((Recording::open(out)?, report))
}

impl ImportOptions {
    /// That nothing was asked for that a dataset made from a recording says itself.
    fn check_settled(&self, dataset: &Path) -> Result<()> {
        let asked = [
            ("--task", self.task.is_some()),
            ("--control-timestep", self.control_timestep.is_some()),
            ("--action-repeat", self.action_repeat.is_some()),
        ];
        asked.into_iter().find(|(_, is_asked)| *is_asked).map_or(Ok(()), |(option, _)| {
            let fact = format!("{option} has no effect: {} was made from a recording and says it", dataset.display());
            Err(Error::Selection { fact, expected: "leave it out".to_owned() })
        })
    }

    /// A spec of a dataset that says nothing of physics: no state, no distractors.
    fn spec(&self, name: &str, action: ActionSpec) -> Spec {
        Spec {
            task: self.task.clone().unwrap_or_else(|| name.to_owned()),
            action,
            observation: Vec::new(),
            qpos: 0,
            qvel: 0,
            pixels: None,
            materials: Vec::new(),
            control_timestep: self.control_timestep.unwrap_or(1.0),
            action_repeat: self.action_repeat.unwrap_or(1),
            quantities: Vec::new(),
        }
    }
}

/// Begins the recording of a dataset.
fn begin(spec: Spec, format: ImportFormat, name: &str, out: &Path, with_mcap: bool) -> Result<RecordingWriter> {
    let manifest = Manifest {
        format: FORMAT.into(),
        spec,
        options: json!({ "imported": { "format": format, "name": name } }),
        seed: 0,
        versions: [("vibes".to_owned(), env!("CARGO_PKG_VERSION").to_owned())].into(),
        grid: None,
        videos: Vec::new(),
        episodes: Vec::new(),
    };
    Ok(RecordingWriter::create_or_resume(out, manifest, with_mcap)?)
}

/// That there is something to be seen: pictures, or a vector observation. Without either there is nothing to learn from.
fn check_observed(spec: &Spec, ignored: &BTreeSet<String>, dataset: &Path) -> Result<()> {
    if spec.pixels.is_some() || !spec.observation.is_empty() {
        return Ok(());
    }
    let left_out = ignored.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
    let left_out = if left_out.is_empty() { left_out } else { format!(" (left out: {left_out})") };
    let fact = format!("no observation that a recording holds{left_out}");
    Err(Error::malformed(dataset, fact, "uint8 pictures of three colours, or vectors of numbers"))
}

/// Pictures `[rows, 3, plane]` as `[rows, plane, 3]`.
fn channels_last(pictures: &[u8], plane: usize) -> Vec<u8> {
    let turned = |picture: &[u8]| -> Vec<u8> {
        (0..plane).flat_map(|pixel| [picture[pixel], picture[plane + pixel], picture[2 * plane + pixel]]).collect()
    };
    pictures.chunks_exact(3 * plane).flat_map(turned).collect()
}

/// Fills in what a dataset without distractors does not have: a camera at rest, no background.
fn without_distractors(episode: &mut Episode) {
    let rows = episode.rows();
    episode.cameras = vec![CameraPose::default(); rows];
    episode.backgrounds = vec![None; rows];
}

/// The lowest and highest value of each of `dims` columns, or -1 and 1 where all lie between.
fn bounds_of(actions: &[f32], dims: usize, bounds: &mut Option<ActionSpec>) {
    let whole = bounds.get_or_insert_with(|| ActionSpec { min: vec![-1.0; dims], max: vec![1.0; dims] });
    for (place, &value) in actions.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let dim = place % dims.max(1);
        if let (Some(min), Some(max)) = (whole.min.get_mut(dim), whole.max.get_mut(dim)) {
            *min = min.min(f64::from(value));
            *max = max.max(f64::from(value));
        }
    }
}

/// Writes an episode whose numbers are numbers, every one of those that are learned from.
///
/// # Errors
/// Names the file, the episode and the step.
fn write_checked(
    writer: &RecordingWriter,
    spec: &Spec,
    episode: &Episode,
    info: EpisodeInfo,
    path: &Path,
) -> Result<()> {
    let named =
        |fact: String, expected: String| Error::malformed(path, format!("episode {}: {fact}", episode.index), expected);
    if let Some(fact) = episode.observation_fault(spec) {
        return Err(named(fact, "finite numbers".to_owned()));
    }
    writer.write(episode, info).map_err(|error| match error {
        DataError::Episode { fact, expected, .. } => named(fact, expected),
        other => Error::Data(other),
    })
}

/// Names the episode in an error about one of its columns.
fn in_episode(index: u32) -> impl Fn(Error) -> Error {
    move |error| match error {
        Error::Malformed { fact, expected, path } => {
            Error::Malformed { fact: format!("episode {index}: {fact}"), expected, path }
        }
        other => other,
    }
}
