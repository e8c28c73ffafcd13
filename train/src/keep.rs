//! A small copy of a run, to be kept in a repository or sent to somebody. In: a run folder. Out: another run folder with the newest weights in half precision, the
//! run's options, its curves thinned to a few hundred lines, and a page about it.
//!
//! With [`Extent::Acting`] the adversary is left out too: enough to encode, to evaluate and to act, and not to train on.
//!
//! Adam's moments, twice the size of the weights, are left out: a run that goes on from the copy begins with new ones, and its step size rises anew. (The copy of an
//! online run acts, encodes and is evaluated; as its replay is left out too, it cannot be gone on with.) The recordings are named as `recordings/NAME`, which is looked for in the copy's folder and in every folder above it;
//! so is the run it went on from, as `runs/NAME`. How many control steps it began with stays known without that one.

use std::fs;
use std::path::{Path, PathBuf};

use burn::tensor::Device;
use serde_json::Value as Json;
use vibes_data::{FolderLock, RunFolder, followed, write_atomically};
use vibes_model::Model;
use vibes_model::checkpoint::copy_in_half;

use crate::error::{Result, TrainError, io};
use crate::json::write_json;
use crate::online::head_start;
use crate::run::{Run, RunInfo};
use crate::summary::write_summary;

/// Most lines that are kept of a curve.
const LINES: usize = 250;
/// Files of a run that are copied as they are, where there are any.
const WHOLE: [&str; 2] = ["config.toml", "online.json"];
/// Files of numbers, one line a row.
const CURVES: [&str; 2] = ["metrics.jsonl", "evaluations.jsonl"];

/// How much is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// What training goes on from.
    Training,
    /// What encoding and acting need.
    Acting,
}

/// What was kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kept {
    /// The checkpoint's number of updates.
    pub update: u64,
    /// Bytes of the copy.
    pub bytes: u64,
}

/// Writes the copy into the folder `to`, which must not exist yet and appears whole or not at all.
///
/// # Errors
/// There is something at `to`, another process is making it, the run has no checkpoint yet, or a file cannot be read or written.
pub fn keep(run: &Run, to: &Path, extent: Extent) -> Result<Kept> {
    let (hidden, making) = places(run, to)?;
    let _lock = FolderLock::acquire_beside(to)?;
    if to.exists() {
        return Err(wrong(format!("there is something at {}; name a folder that is not there yet", to.display())));
    }
    if hidden.is_dir() {
        fs::remove_dir_all(&hidden).map_err(io("remove", &hidden))?;
    }
    let kept = copy(run, &making, extent).and_then(|kept| {
        fs::rename(&making, to).map_err(io("write", to))?;
        Ok(kept)
    });
    // Half a copy is of no use to anybody; what cannot be removed now, the next copy removes.
    fs::remove_dir_all(&hidden).ok();
    kept
}

/// A hidden folder beside the copy's place, and in it, by the copy's own name, which its page says, where the copy is made.
fn places(run: &Run, to: &Path) -> Result<(PathBuf, PathBuf)> {
    let name = to.file_name().ok_or_else(|| {
        wrong(format!("a copy has a name of its own; name a folder that is not there yet: {}", to.display()))
    })?;
    let hidden = to.with_file_name(format!(".{}.making", name.to_string_lossy()));
    if followed(run.path()).starts_with(followed(&hidden)) {
        return Err(wrong(format!("the copy would be made where the run lies; name another folder: {}", to.display())));
    }
    let making = hidden.join(name);
    Ok((hidden, making))
}

fn wrong(text: String) -> TrainError {
    TrainError::Options(text)
}

fn copy(run: &Run, to: &Path, extent: Extent) -> Result<Kept> {
    let newest = run.newest_model()?;
    let from = newest.parent().unwrap_or_else(|| run.path());
    let update = run.checkpoints().last().copied().unwrap_or_default();
    let place = RunFolder::at(to).checkpoint_path(update);
    fs::create_dir_all(&place).map_err(io("create", &place))?;
    for file in files(from)? {
        copy_part(&file, &place)?;
    }
    let mut info = run.info().clone();
    if extent == Extent::Acting && info.model.adversary {
        info.model.adversary = false;
        without_adversary(&newest, &place.join("model.safetensors"))?;
    }
    for name in WHOLE.iter().filter(|name| run.path().join(name).is_file()) {
        let target = to.join(name);
        fs::copy(run.path().join(name), &target).map_err(io("write", &target))?;
    }
    for name in CURVES.iter().filter(|name| run.path().join(name).is_file()) {
        thin(&run.path().join(name), &to.join(name), update)?;
    }
    let recordings = info.recording_names().into_iter().map(|name| format!("recordings/{name}")).collect();
    let from = info.from_name().map(|name| format!("runs/{name}"));
    write_json(&to.join("run.json"), &RunInfo { recordings, from, began_with: head_start(run)?, ..info })?;
    // Its page says its own name.
    write_summary(&Run::open(to)?)?;
    Ok(Kept { update, bytes: size(to)? })
}

/// One file of a checkpoint: weights in half precision, moments and tables of latents that were written beside them not at all, the rest as it is.
fn copy_part(file: &Path, place: &Path) -> Result<()> {
    let name = file.file_name().unwrap_or_default();
    let target = place.join(name);
    let name = name.to_string_lossy();
    if name.ends_with("optimizer.safetensors") || name.ends_with(".arrow") {
        return Ok(());
    }
    if name.ends_with(".safetensors") {
        return Ok(copy_in_half(file, &target)?);
    }
    fs::copy(file, &target).map_err(io("write", &target))?;
    Ok(())
}

/// The model without its adversary, in half precision.
fn without_adversary(from: &Path, to: &Path) -> Result<()> {
    let mut model = Model::load(from, &Device::flex())?;
    model.adversary = None;
    model.config.adversary = false;
    model.save(to)?;
    Ok(copy_in_half(to, to)?)
}

/// Every so-manieth line of a curve, the last one always; of what came after the kept checkpoint, and of a line that was cut short, nothing.
fn thin(from: &Path, to: &Path, update: u64) -> Result<()> {
    let text = fs::read_to_string(from).map_err(io("read", from))?;
    let is_kept = |line: &&str| {
        let line: Option<Json> = serde_json::from_str(line).ok();
        line.is_some_and(|line| line["update"].as_u64().is_none_or(|number| number <= update))
    };
    let lines: Vec<&str> = text.lines().filter(is_kept).collect();
    let every = lines.len().div_ceil(LINES).max(1);
    let last = lines.len().saturating_sub(1);
    // Counted from the end, so that the last line is one of them and all lie equally far apart.
    let chosen = lines.iter().enumerate().filter(|(place, _)| (last - place).is_multiple_of(every));
    let kept: String = chosen.map(|(_, line)| format!("{line}\n")).collect();
    Ok(write_atomically(to, kept.as_bytes())?)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(io("read", folder))?;
    let paths: std::io::Result<Vec<PathBuf>> = entries.map(|entry| entry.map(|entry| entry.path())).collect();
    Ok(paths.map_err(io("read", folder))?.into_iter().filter(|path| path.is_file()).collect())
}

/// Bytes of everything below a folder.
fn size(folder: &Path) -> Result<u64> {
    let mut bytes = 0;
    for entry in fs::read_dir(folder).map_err(io("read", folder))? {
        let path = entry.map_err(io("read", folder))?.path();
        bytes += if path.is_dir() { size(&path)? } else { path.metadata().map_err(io("read", &path))?.len() };
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_curve_keeps_its_end_and_equal_distances() {
        let folder = tempfile::tempdir().unwrap();
        let (from, to) = (folder.path().join("from"), folder.path().join("to"));
        for count in [0, 1, 250, 251, 1003] {
            let line = |number: usize| format!("{{\"update\":{number}}}\n");
            let lines: String = (0..count).map(line).collect();
            // A run that was killed after its last checkpoint.
            fs::write(&from, lines + &line(2000) + "{\"update\":20").unwrap();
            thin(&from, &to, 1999).unwrap();
            let text = fs::read_to_string(&to).unwrap();
            let number = |line| serde_json::from_str::<Json>(line).unwrap()["update"].as_u64().unwrap() as usize;
            let kept: Vec<usize> = text.lines().map(number).collect();
            assert!(kept.len() <= LINES, "{count}");
            assert_eq!(kept.last().copied(), (count > 0).then(|| count - 1));
            let gaps: std::collections::BTreeSet<usize> = kept.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(gaps.len() <= 1, "{count}: {gaps:?}");
        }
    }
}
