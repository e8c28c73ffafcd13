//! Which files follow each other. A file of Dreamer or DreamerV2 (`TIME-ID-LENGTH.npz`, or any other name) stands for itself; a replay chunk of `DreamerV3`
//! (`TIME-ID-NEXT-LENGTH.npz`, `embodied/replay/chunk.py`) names the chunk that goes on where it ends.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::rows::Convention;
use crate::error::{Error, Result};

/// Files that follow each other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    pub(super) files: Vec<PathBuf>,
    pub(super) convention: Convention,
}

/// The four parts of a chunk's name.
struct ChunkName<'a> {
    id: &'a str,
    next: &'a str,
    length: usize,
}

impl<'a> ChunkName<'a> {
    /// None for a file of another kind.
    fn of(path: &'a Path) -> Option<Self> {
        let parts: Vec<&str> = path.file_stem()?.to_str()?.split('-').collect();
        let [time, id, next, length] = parts.as_slice() else { return None };
        let is_time = time.len() >= 15 && time.starts_with(|c: char| c.is_ascii_digit()) && time.contains('T');
        let is_id = |id: &str| !id.is_empty() && id.chars().all(|c| c.is_ascii_alphanumeric());
        (is_time && is_id(id) && is_id(next)).then_some(())?;
        Some(Self { id, next, length: length.parse().ok()? })
    }
}

/// The files as chains, in the order of the files they begin with.
pub(super) fn chains(files: &[PathBuf]) -> Result<Vec<Chain>> {
    let chunks: Vec<ChunkName<'_>> = files.iter().filter_map(|file| ChunkName::of(file)).collect();
    if chunks.is_empty() {
        let alone = |file: &PathBuf| Chain { files: vec![file.clone()], convention: Convention::ActionBefore };
        return Ok(files.iter().map(alone).collect());
    }
    if let Some(other) = files.iter().find(|file| ChunkName::of(file).is_none()) {
        let fact = "an episode file beside replay chunks of DreamerV3, whose actions stand in other rows";
        return Err(Error::malformed(other, fact, "a folder of one kind"));
    }
    let by_id: BTreeMap<&str, usize> = chunks.iter().enumerate().map(|(place, chunk)| (chunk.id, place)).collect();
    let followers: BTreeSet<usize> = chunks
        .iter()
        .filter(|chunk| chunk.id != chunk.next)
        .filter_map(|chunk| by_id.get(chunk.next).copied())
        .collect();
    let mut taken = BTreeSet::new();
    let mut chains = Vec::new();
    // Chunks that nothing leads to begin a chain; what is left after those runs in a circle and is taken as it comes.
    let heads = (0..files.len()).filter(|place| !followers.contains(place));
    for head in heads.chain(0..files.len()) {
        let mut chain = Vec::new();
        let mut place = Some(head);
        while let Some(next) = place.filter(|&place| taken.insert(place)) {
            chain.push(files[next].clone());
            place = by_id.get(chunks[next].next).copied();
        }
        if !chain.is_empty() {
            chains.push(Chain { files: chain, convention: Convention::ActionAfter });
        }
    }
    Ok(chains)
}

/// Checks what a chunk's name says of it.
pub(super) fn check_chunk(path: &Path, rows: usize, has_flags: bool) -> Result<()> {
    if !has_flags {
        let fact = "no array is_first in a replay chunk of DreamerV3";
        return Err(Error::malformed(path, fact, "it says where episodes begin"));
    }
    match ChunkName::of(path) {
        Some(name) if name.length != rows => {
            Err(Error::malformed(path, format!("{rows} rows, its name says {}", name.length), "a whole chunk"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn chunks_follow_the_names_they_give() {
        let first = "20240101T000000F000001-aa-bb-10.npz";
        let second = "20240101T000005F000001-bb-cc-10.npz";
        let alone = "20240101T000001F000001-xx-0000-6.npz";
        let chained = chains(&files(&[first, alone, second])).unwrap();
        assert_eq!(
            chained.iter().map(|chain| chain.files.clone()).collect::<Vec<_>>(),
            [files(&[first, second]), files(&[alone])]
        );
        let circle =
            ["20240101T000000F0-aa-bb-1.npz", "20240101T000000F0-bb-aa-1.npz", "20240101T000000F0-cc-cc-1.npz"];
        let chained = chains(&files(&circle)).unwrap();
        assert_eq!(chained.iter().map(|chain| chain.files.len()).sum::<usize>(), 3, "every file once");
    }

    #[test]
    fn other_names_are_episodes_of_the_older_kind_and_the_two_are_not_mixed() {
        for name in ["a.npz", "20200101T000000-abc-501.npz", "my-run-of-today.npz", "a-b-c-5.npz"] {
            let chained = chains(&files(&[name])).unwrap();
            assert_eq!(chained[0].convention, Convention::ActionBefore, "{name}");
        }
        let mixed = files(&["20200101T000000-abc-501.npz", "20240101T000000F000001-aa-bb-10.npz"]);
        assert!(chains(&mixed).unwrap_err().to_string().contains("one kind"));
    }
}
