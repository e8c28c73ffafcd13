//! Files among a recording's episodes that its manifest does not list. In: the folder, the manifest. Out: finished episodes that are of the recording, put into the manifest's
//! list, and what is wrong with the others.
//!
//! A folder may hold the files of another recording under the same names. A table is taken for an episode of this one only if it says itself that it is the one of its number, has
//! the columns of the spec, and lies in the cell of that number; whether its seed is the planned one, only the program knows that plans.

use std::collections::BTreeSet;
use std::path::Path;

use super::{EPISODES, MANIFEST, episode_path};
use crate::arrow_table::read_episode_entry;
use crate::{Cell, EpisodeEntry, EpisodeView, Error, FileEntry, Finding, Grid, Manifest, Result};

/// Adds finished episodes that the manifest does not list; returns the files that are none.
pub(super) fn adopt(path: &Path, manifest: &mut Manifest) -> Result<Vec<Finding>> {
    let mut strays = Vec::new();
    for index in numbered(&path.join(EPISODES), "arrow")? {
        let Err(place) = manifest.episodes.binary_search_by_key(&index, |entry| entry.index) else { continue };
        let fault = match found(path, index, manifest) {
            Ok(entry) => {
                manifest.episodes.insert(place, entry);
                let checked = manifest.check(&path.join(MANIFEST));
                if checked.is_err() {
                    manifest.episodes.remove(place);
                }
                checked.err()
            }
            Err(error) => Some(error),
        };
        let file = path.join(episode_path(index, "arrow"));
        strays.extend(fault.map(|error| Finding { path: file, fault: format!("not in the manifest: {error}") }));
    }
    Ok(strays)
}

/// The entry of a finished episode, from its own files.
fn found(path: &Path, index: u32, manifest: &Manifest) -> Result<EpisodeEntry> {
    let file = |ending: &str| -> Result<FileEntry> {
        let name = episode_path(index, ending);
        let contents = std::fs::read(path.join(&name)).map_err(Error::io("read", path.join(&name)))?;
        Ok(FileEntry::of(name, &contents))
    };
    let table = path.join(episode_path(index, "arrow"));
    let mut entry = read_episode_entry(&table)?;
    check(&entry, index, manifest, &table)?;
    let has_mcap = path.join(episode_path(index, "mcap")).is_file();
    entry.arrow = file("arrow")?;
    entry.mcap = if has_mcap { Some(file("mcap")?) } else { None };
    Ok(entry)
}

/// That a table is the episode of its number in this recording.
fn check(entry: &EpisodeEntry, index: u32, manifest: &Manifest, table: &Path) -> Result<()> {
    let view = EpisodeView::open(table, &manifest.spec)?;
    let cell = manifest.grid.map_or(entry.cell, |grid| Some(cell_of(grid, index)));
    let own = (entry.index, entry.cell, entry.steps as usize);
    if own == (index, cell, view.steps()) && own.0 == view.index() && own.1 == view.cell() {
        return Ok(());
    }
    let named = |index: u32, cell: Option<Cell>| {
        let place = cell.map_or_else(String::new, |cell| format!(" in cell {},{}", cell.state, cell.distractor));
        format!("episode {index}{place}")
    };
    let fact = format!("it holds {}", named(view.index(), view.cell()));
    Err(Error::malformed(table, fact, format!("this is the place of {}", named(index, cell))))
}

/// The cell of the episode of this number: grids are numbered row by row.
fn cell_of(grid: Grid, index: u32) -> Cell {
    let columns = grid.distractors.max(1);
    Cell { state: index / columns, distractor: index % columns }
}

/// The logs that the manifest does not list; those of episodes that are not there only if `is_whole`.
pub(super) fn logs(path: &Path, manifest: &Manifest, is_whole: bool) -> Vec<Finding> {
    let listed: BTreeSet<&str> =
        manifest.episodes.iter().filter_map(|entry| entry.mcap.as_ref()).map(|file| file.path.as_str()).collect();
    let finding = |index: u32| {
        let name = episode_path(index, "mcap");
        let is_there = manifest.episodes.binary_search_by_key(&index, |entry| entry.index).is_ok();
        let of = if is_there { "has none" } else { "is not there" };
        let fault = format!("not in the manifest: the log of an episode that {of}");
        (!listed.contains(name.as_str()) && (is_there || is_whole)).then(|| Finding { path: path.join(name), fault })
    };
    // A folder that cannot be listed has no episode either, which is said of each.
    numbered(&path.join(EPISODES), "mcap").unwrap_or_default().into_iter().filter_map(finding).collect()
}

/// The numbers of the files in place that end so, rising; partial files have another ending.
pub(crate) fn numbered(folder: &Path, ending: &str) -> Result<Vec<u32>> {
    let Ok(listing) = std::fs::read_dir(folder) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for file in listing {
        let name = file.map_err(Error::io("list", folder))?.file_name();
        let stem = name.to_str().and_then(|name| name.strip_suffix(ending)?.strip_suffix('.'));
        found.extend(stem.filter(|stem| stem.len() == 6).and_then(|stem| stem.parse::<u32>().ok()));
    }
    found.sort_unstable();
    Ok(found)
}
