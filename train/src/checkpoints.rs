//! The checkpoints of a run on disk, of runs with a world model and without: there whole or not at all, whenever the process is killed. In: what writes a checkpoint's
//! files. Out: a folder under the number of its updates, and the oldest let go of; a damaged one is named together with the one that could take its place.

use std::fs;
use std::path::{Path, PathBuf};

use vibes_data::RunFolder;

use crate::error::{Result, TrainError, io};

/// Where a checkpoint is written before it is put in its place.
const PARTIAL: &str = ".partial";
/// Before the number of a checkpoint that makes room for a newer one of the same number.
const ASIDE: &str = ".before-";

/// Writes a checkpoint beside its place, puts it there, and lets go of the oldest beyond `keep`. One of the same number, made before more episodes but no more updates, is
/// put aside until the new one is there; [`recover`] brings it back where the process was killed in between.
///
/// # Errors
/// The folder cannot be written, or `write` fails.
pub fn put(folder: &RunFolder, update: u64, keep: usize, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let (partial, aside) = (beside(folder, PARTIAL), beside(folder, &format!("{ASIDE}{update}")));
    remove(&partial)?;
    fs::create_dir_all(&partial).map_err(io("create", &partial))?;
    write(&partial)?;
    let place = folder.checkpoint_path(update);
    if place.exists() {
        remove(&aside)?;
        rename(&place, &aside)?;
    }
    rename(&partial, &place)?;
    remove(&aside)?;
    let found = folder.checkpoint_folders();
    found[..found.len().saturating_sub(keep)].iter().try_for_each(|(_, oldest)| {
        // Not under its number, where a kill would leave half of it.
        rename(oldest, &partial)?;
        remove(&partial)
    })
}

/// Puts a checkpoint back that was aside when the process was killed, unless the newer one had come to its place. For the process that owns the folder.
///
/// # Errors
/// The folder cannot be written.
pub fn recover(folder: &RunFolder) -> Result<()> {
    let Ok(entries) = fs::read_dir(folder.path().join("checkpoints")) else { return Ok(()) };
    for entry in entries.flatten() {
        let update = entry.file_name().to_str().and_then(|name| name.strip_prefix(ASIDE)?.parse().ok());
        let Some(place) = update.map(|update| folder.checkpoint_path(update)) else { continue };
        if place.exists() { remove(&entry.path())? } else { rename(&entry.path(), &place)? }
    }
    Ok(())
}

/// What `open` makes of the newest checkpoint; none if nothing was saved yet.
///
/// # Errors
/// [`TrainError::DamagedCheckpoint`], or what `open` says of a checkpoint that is not damaged.
pub fn newest<T>(folder: &RunFolder, open: impl FnOnce(&Path) -> Result<T>) -> Result<Option<T>> {
    let mut found = folder.checkpoint_folders();
    let Some((_, path)) = found.pop() else { return Ok(None) };
    let before = found.pop().map(|(update, _)| update);
    open(&path).map(Some).map_err(|error| match error {
        TrainError::Io { .. } | TrainError::Malformed { .. } | TrainError::Model(_) => {
            TrainError::DamagedCheckpoint { cause: Box::new(error), before, path }
        }
        other => other,
    })
}

fn beside(folder: &RunFolder, name: &str) -> PathBuf {
    folder.path().join("checkpoints").join(name)
}

fn rename(from: &Path, to: &Path) -> Result<()> {
    fs::rename(from, to).map_err(io("rename", from))
}

fn remove(path: &Path) -> Result<()> {
    if path.exists() { fs::remove_dir_all(path).map_err(io("remove", path)) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_with(checkpoints: &[&str]) -> (tempfile::TempDir, RunFolder) {
        let folder = tempfile::tempdir().unwrap();
        for name in checkpoints {
            let place = folder.path().join("checkpoints").join(name);
            fs::create_dir_all(&place).unwrap();
            fs::write(place.join("state.json"), name).unwrap();
        }
        let run = RunFolder::at(folder.path());
        (folder, run)
    }

    fn content(run: &RunFolder, update: u64) -> String {
        fs::read_to_string(run.checkpoint_path(update).join("state.json")).unwrap()
    }

    fn write(text: &str) -> impl FnOnce(&Path) -> Result<()> {
        move |partial: &Path| fs::write(partial.join("state.json"), text).map_err(io("write", partial))
    }

    #[test]
    fn a_newer_checkpoint_of_the_same_number_takes_the_place() {
        let (kept, run) = run_with(&["000020", "000040"]);
        put(&run, 40, 2, write("newer")).unwrap();
        assert_eq!((content(&run, 20).as_str(), content(&run, 40).as_str()), ("000020", "newer"));
        assert_eq!(fs::read_dir(kept.path().join("checkpoints")).unwrap().count(), 2, "nothing else stays");
        put(&run, 60, 2, write("newest")).unwrap();
        assert_eq!(run.checkpoints(), [40, 60], "the oldest is let go of");
    }

    #[test]
    fn what_was_aside_at_a_kill_comes_back() {
        let (_kept, run) = run_with(&["000020", ".before-40", ".partial"]);
        recover(&run).unwrap();
        assert_eq!((run.checkpoints(), content(&run, 40).as_str()), (vec![20, 40], ".before-40"));
    }

    #[test]
    fn what_was_aside_goes_where_the_newer_one_had_come() {
        let (kept, run) = run_with(&["000040", ".before-40"]);
        recover(&run).unwrap();
        assert_eq!(content(&run, 40), "000040");
        assert!(!kept.path().join("checkpoints/.before-40").exists());
    }

    #[test]
    fn a_write_that_fails_leaves_the_checkpoint_that_was_there() {
        let (_kept, run) = run_with(&["000040"]);
        let full = |_: &Path| Err(TrainError::Options("the disk is full".to_owned()));
        assert!(put(&run, 40, 1, full).is_err());
        assert_eq!(content(&run, 40), "000040");
    }

    #[test]
    fn a_damaged_checkpoint_is_named_with_the_one_before() {
        let (_kept, run) = run_with(&["000020", "000040"]);
        let open = |path: &Path| -> Result<()> {
            Err(io("read", path)(std::io::Error::from(std::io::ErrorKind::UnexpectedEof)))
        };
        let error = newest(&run, open).unwrap_err().to_string();
        assert!(error.contains("update 20") && error.ends_with("000040"), "{error}");
    }
}
