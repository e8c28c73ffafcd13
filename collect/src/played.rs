//! Files of actions that are played: whether one is still what it was when the recording was begun.
//!
//! In: a mix of policies. Out: what the manifest keeps of its files ([`PlayedFile`]), and an error where a file has other actions by now, which would be another behaviour in the
//! same recording.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vibes_data::sha256_hex;
use vibes_env::{PolicyMix, PolicySpec};

use crate::{Error, Result};

/// Digits of a checksum that a message shows.
const SHOWN: usize = 12;

/// A file of actions as the manifest keeps it: the same recording made of other actions is another recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlayedFile {
    /// SHA-256 of the file in hexadecimal; none where it could not be read.
    pub sha256: Option<String>,
}

/// What the files of actions of a mix hold now, in its order. One that cannot be read is no fault yet: where nothing is left to simulate, nobody needs it.
pub fn played_by(mix: &PolicyMix) -> Vec<PlayedFile> {
    files_of(mix).map(|file| PlayedFile { sha256: std::fs::read(file).ok().map(|bytes| sha256_hex(&bytes)) }).collect()
}

/// The files of actions of a mix, in its order.
fn files_of(mix: &PolicyMix) -> impl Iterator<Item = &PathBuf> {
    mix.shares().iter().filter_map(|(policy, _)| match policy {
        PolicySpec::Actions { path } => Some(path),
        PolicySpec::Random { .. } | PolicySpec::Planner { .. } | PolicySpec::Run { .. } => None,
    })
}

/// That the files of a mix still hold what is known of them: what the recording at `place` was begun with. Of an older recording nothing is known.
///
/// # Errors
/// [`Error::Malformed`] names the first that has other actions, [`Error::Io`] one that is gone.
pub(crate) fn check_files(mix: &PolicyMix, known: &[PlayedFile], place: &Path) -> Result<()> {
    files_of(mix).zip(known).try_for_each(|(file, known)| check_file(file, known, place))
}

/// The same of one policy of the mix.
///
/// # Errors
/// As [`check_files`].
pub(crate) fn check_policy(policy: &PolicySpec, mix: &PolicyMix, known: &[PlayedFile], place: &Path) -> Result<()> {
    let PolicySpec::Actions { path } = policy else { return Ok(()) };
    let mut own = files_of(mix).zip(known).filter(|(file, _)| *file == path);
    own.try_for_each(|(file, known)| check_file(file, known, place))
}

/// That files which hold `now` are those that are known.
///
/// # Errors
/// [`Error::Malformed`] names the first that has other actions.
pub(crate) fn check_same(mix: &PolicyMix, now: &[PlayedFile], known: &[PlayedFile], place: &Path) -> Result<()> {
    let mut sums = files_of(mix).zip(now.iter().zip(known));
    sums.try_for_each(|(file, (now, known))| match (&now.sha256, &known.sha256) {
        (Some(now), Some(known)) if now != known => Err(changed(file, now, known, place)),
        _ => Ok(()),
    })
}

fn check_file(file: &Path, known: &PlayedFile, place: &Path) -> Result<()> {
    let Some(known) = &known.sha256 else { return Ok(()) };
    let now = sha256_hex(&std::fs::read(file).map_err(Error::io("read", file))?);
    if now == *known { Ok(()) } else { Err(changed(file, &now, known, place)) }
}

/// The error for a file that has other actions than those which the recording at `place` is of.
fn changed(file: &Path, now: &str, known: &str, place: &Path) -> Error {
    let short = |sum: &str| sum.chars().take(SHOWN).collect::<String>();
    let (file, now, known) = (file.display(), short(now), short(known));
    let fact =
        format!("{file} has other actions than this recording was begun with (its checksum is {now}, not {known})");
    Error::malformed(place, fact, "put the file back, or record into another folder (-o)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_mix_are_known_in_its_order_and_one_that_is_gone_is_no_fault_yet() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["one.json", "other.json"].map(|name| folder.path().join(name));
        std::fs::write(&one, "[[0]]").unwrap();
        let text = format!("actions:{}:1,random:2,actions:{}:1", other.display(), one.display());
        let mix = PolicyMix::written(&text).unwrap();
        let known = played_by(&mix);
        assert_eq!(known, [PlayedFile { sha256: None }, PlayedFile { sha256: Some(sha256_hex(b"[[0]]")) }]);
        check_files(&mix, &known, folder.path()).unwrap();
        std::fs::write(&one, "[[1]]").unwrap();
        let policy = PolicySpec::Actions { path: one };
        let faults = [
            check_files(&mix, &known, folder.path()),
            check_policy(&policy, &mix, &known, folder.path()),
            check_same(&mix, &played_by(&mix), &known, folder.path()),
        ];
        for fault in faults {
            let said = fault.unwrap_err().to_string();
            assert!(said.contains("one.json has other actions") && said.contains("put the file back"), "{said}");
        }
        check_files(&mix, &[], folder.path()).unwrap();
    }
}
