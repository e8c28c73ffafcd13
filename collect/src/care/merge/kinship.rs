//! Whether recordings can be joined, and whether they are parts of one. In: recordings. Out: an error that names what differs, or the header of the whole.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use vibes_data::{Manifest, Recording, Spec};

use super::merged_parts;
use crate::error::{Error, Result};
use crate::keys::{SUBSET, WHOLE};
use crate::paths::{places, rebase, without_places};
use crate::stored::takes_torques;

/// That there are two recordings or more, of one spec, and that their actions mean the same.
///
/// # Errors
/// [`Error::Selection`] names what differs.
pub(super) fn check_specs(parts: &[Recording]) -> Result<()> {
    let refused = |fact: String, expected: &str| Err(Error::Selection { fact, expected: expected.into() });
    let [first, others @ ..] = parts else { return refused("nothing to merge".into(), "two or more recordings") };
    if others.is_empty() {
        return refused("one recording".into(), "two or more recordings");
    }
    let differ = |one: &Recording, other: &Recording, key: &str| {
        let fact = format!("{} and {} have another {key}", one.path().display(), other.path().display());
        refused(fact, "recordings of one spec")
    };
    for other in others {
        if let Some(key) = differing_key(&first.manifest().spec, &other.manifest().spec) {
            return differ(first, other, &key);
        }
    }
    // Four torques of a swimmer look like the four parameters of its wave.
    let torques: Vec<(bool, &Recording)> =
        parts.iter().flat_map(|part| torques_of(part).map(move |is| (is, part))).collect();
    match torques.iter().find(|(is, _)| *is != torques[0].0) {
        Some(&(_, other)) => differ(torques[0].1, other, "raw_torques"),
        None => Ok(()),
    }
}

fn differing_key(one: &Spec, other: &Spec) -> Option<String> {
    let map = |spec| serde_json::to_value(spec).ok().and_then(|value| value.as_object().cloned()).unwrap_or_default();
    let (one, other) = (map(one), map(other));
    one.keys().chain(other.keys()).find(|key| one.get(*key) != other.get(*key)).cloned()
}

/// Whether actions are torques, of each part that says so.
fn torques_of(part: &Recording) -> impl Iterator<Item = bool> + use<> {
    let options: Vec<Value> = match merged_parts(part.manifest()) {
        Some(parts) => parts.into_iter().map(|part| part.options).collect(),
        None => vec![part.manifest().options.clone()],
    };
    options.into_iter().filter_map(|options| takes_torques(&options))
}

/// The header of the recording that all are parts of, if they are, and no episode is in two parts with different contents. Parts that were made on different
/// machines name their videos and policies by different paths; the header is that of the first part whose own are there.
pub(super) fn same_recording(parts: &[Recording], out: &Path) -> Option<Manifest> {
    let header = |part: &Recording| -> Manifest {
        let mut options = part.manifest().options.clone();
        if let Some(map) = options.as_object_mut() {
            map.remove(SUBSET);
        }
        Manifest { options, episodes: Vec::new(), ..part.manifest().clone() }
    };
    let compared = |part: &Recording| -> Manifest {
        let mut header = header(part);
        without_places(&mut header.options, part.path());
        header
    };
    let first = compared(&parts[0]);
    let named: Vec<Vec<PathBuf>> = parts.iter().map(|part| places(&part.manifest().options, part.path())).collect();
    if !parts.iter().all(|part| compared(part) == first) || name_others(&named) {
        return None;
    }
    let mut seen: BTreeMap<u32, &str> = BTreeMap::new();
    let mut entries = parts.iter().flat_map(Recording::episodes);
    let agree = entries.all(|entry| *seen.entry(entry.index).or_insert(&entry.arrow.sha256) == entry.arrow.sha256);
    agree.then(|| {
        let is_here = |named: &Vec<PathBuf>| named.iter().all(|place| place.exists());
        let kept = &parts[named.iter().position(is_here).unwrap_or(0)];
        let mut whole = header(kept);
        rebase(&mut whole.options, Some(kept.path()), Some(out));
        whole
    })
}

/// Whether two parts name different videos or policies: what lies at two places that are both there need not be the same, whatever it is called.
fn name_others(named: &[Vec<PathBuf>]) -> bool {
    let differ = |one: &PathBuf, other: &PathBuf| one != other && one.exists() && other.exists();
    let mut pairs =
        named.iter().enumerate().flat_map(|(at, one)| named[at + 1..].iter().map(move |other| (one, other)));
    pairs.any(|(one, other)| one.iter().zip(other).any(|(one, other)| differ(one, other)))
}

/// How many episodes the recording has whose part this is, or which it is itself; none for a part that does not say.
pub(super) fn whole_of(part: &Recording) -> Option<u64> {
    let options = &part.manifest().options;
    let subset = options.get(SUBSET);
    let noted = subset.and_then(|note| note.get(WHOLE)).and_then(Value::as_u64);
    let asked = || options.get("episodes").and_then(Value::as_u64).filter(|&count| count > 0);
    let own = || subset.is_none().then_some(part.episodes().len() as u64);
    noted.or_else(asked).or_else(own)
}
