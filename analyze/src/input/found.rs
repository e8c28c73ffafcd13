//! Finding inputs that were not named: the newest latents below a folder, and the recording that latents speak of.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use vibes_data::find_place;

use super::InputError;

/// How deep the search goes.
const DEPTH: usize = 8;

/// The newest `latents*.arrow` below `folder/runs`, or, if there is none, below `folder` itself.
///
/// # Errors
/// [`InputError::NoLatents`].
pub fn newest_latents(folder: &Path) -> Result<PathBuf, InputError> {
    let mut found = Vec::new();
    collect(&folder.join("runs"), DEPTH, &mut found);
    if found.is_empty() {
        collect(folder, DEPTH, &mut found);
    }
    found.sort();
    found.pop().map(|(_, path)| path).ok_or_else(|| InputError::NoLatents { path: folder.into() })
}

fn collect(folder: &Path, depth: usize, found: &mut Vec<(SystemTime, PathBuf)>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() && depth > 0 && !name.starts_with('.') && name != "target" {
            collect(&entry.path(), depth - 1, found);
        }
        if kind.is_file() && name.starts_with("latents") && name.ends_with(".arrow") {
            let time = entry.metadata().and_then(|m| m.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
            found.push((time, entry.path()));
        }
    }
}

/// The recording that latents name, relative to their folder, or below any folder above it.
#[must_use]
pub fn find_recording(named: &str, latents: &Path) -> Option<PathBuf> {
    find_place(named, latents.parent()?, |path| path.join("manifest.json").is_file())
}

/// The latents that a map names, relative to its folder, or below any folder above it.
#[must_use]
pub fn find_latents(named: &str, map: &Path) -> Option<PathBuf> {
    find_place(named, map.parent()?, Path::is_file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_latents_below_runs_win() {
        let dir = tempfile::tempdir().expect("folder");
        let place = |path: &str, age: u64| {
            let path = dir.path().join(path);
            std::fs::create_dir_all(path.parent().expect("parent")).expect("folder");
            let file = std::fs::File::create(&path).expect("file");
            let time = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000 - age);
            file.set_modified(time).expect("time");
            path
        };
        place("runs/old/latents.arrow", 900);
        let new = place("runs/group/new/latents-grid.arrow", 100);
        place("elsewhere/latents.arrow", 1);
        place("runs/other/map.arrow", 0);
        assert_eq!(newest_latents(dir.path()).expect("found"), new);
        let empty = dir.path().join("elsewhere/deeper");
        std::fs::create_dir_all(&empty).expect("folder");
        assert!(matches!(newest_latents(&empty), Err(InputError::NoLatents { .. })));
    }

    #[test]
    fn a_recording_is_found_beside_the_runs() {
        let dir = tempfile::tempdir().expect("folder");
        let recording = dir.path().join("recordings/x");
        std::fs::create_dir_all(&recording).expect("folder");
        std::fs::write(recording.join("manifest.json"), "{}").expect("file");
        let latents = dir.path().join("runs/a/latents.arrow");
        assert_eq!(find_recording("recordings/x", &latents), Some(recording));
        assert_eq!(find_recording("recordings/y", &latents), None);
    }
}
