//! What a stage makes that must not be there yet. In: a stage's words and the run's folder. Out: places below that folder; what an earlier attempt at the stage
//! has made there is cleared, so that a stage which was killed when its work was done can be given again.
//!
//! Verbs that go on where they were stopped, or that write over what they wrote, need none of this and have no such places. Neither has anything outside of the
//! run's folder: other runs may have made it, or read it.

use std::path::{Component, Path, PathBuf};

use vibes_data::followed;

use crate::error::{Result, io};

/// Clears those of the stage's places that are among `earlier`, which an attempt before has filled, and gives the places where nothing is then.
pub(super) fn make_room(words: &[String], run: &Path, earlier: &[String]) -> Result<Vec<String>> {
    let mut places = places(words, run);
    for place in places.iter().filter(|place| earlier.contains(place)) {
        clear(&run.join(place))?;
    }
    places.retain(|place| is_free(&run.join(place)));
    Ok(places)
}

/// Whether nothing is there, or an empty folder.
pub(super) fn is_free(place: &Path) -> bool {
    match std::fs::read_dir(place) {
        Ok(mut listing) => listing.next().is_none(),
        Err(_no_folder) => place.symlink_metadata().is_err(),
    }
}

/// Removes a folder, if it is one and no link to one.
fn clear(place: &Path) -> Result<()> {
    if place.symlink_metadata().is_ok_and(|found| found.is_dir()) {
        std::fs::remove_dir_all(place).map_err(io("remove", place))?;
    }
    Ok(())
}

/// Where the stage makes folders that must not be there yet, relative to the run's folder, of which all lie below it.
fn places(words: &[String], run: &Path) -> Vec<String> {
    outputs(words).iter().filter_map(|place| below(place, run)).collect()
}

/// A place's path below the run's folder, if it lies there, also when links are followed.
fn below(place: &Path, run: &Path) -> Option<String> {
    let rest = place.strip_prefix(run).ok()?;
    let is_below = rest.file_name().is_some() && rest.components().all(|part| matches!(part, Component::Normal(_)));
    let is_inside = followed(place.parent()?).starts_with(followed(run));
    (is_below && is_inside).then(|| rest.to_string_lossy().into_owned())
}

/// The folders that a stage makes, if its verb refuses one that is there.
fn outputs(words: &[String]) -> Vec<PathBuf> {
    let mut behind = words.iter().skip(1).skip_while(|word| word.starts_with('-')).map(String::as_str);
    let Some(verb) = behind.next() else { return Vec::new() };
    let named = values(words, &["-o", "--output"]);
    match (words[0].as_str(), verb) {
        ("vibes-train", "keep") | ("vibes-collect", "merge" | "filter" | "export" | "import") => {
            named.into_iter().map(PathBuf::from).collect()
        }
        // Without a prefix the recording's own place is one: it is among the words, and what else there is lies nowhere.
        ("vibes-collect", "split") if named.is_empty() => parts(words, behind),
        ("vibes-collect", "split") => parts(words, named.into_iter()),
        _ => Vec::new(),
    }
}

/// The folders of a split's parts: every prefix with every name that they may have.
fn parts<'w>(words: &[String], prefixes: impl Iterator<Item = &'w str>) -> Vec<PathBuf> {
    let listed = |option| values(words, &[option]).into_iter().flat_map(|list| list.split(','));
    let numbered = (1..=listed("--parts").count()).map(|number| number.to_string());
    let usual = ["train", "val", "test"].map(str::to_owned);
    let names: Vec<String> = listed("--names").map(str::to_owned).chain(usual).chain(numbered).collect();
    let of_prefix = |prefix: &Path| {
        let stem = prefix.file_name().map(|stem| stem.to_string_lossy().into_owned());
        stem.map(|stem| names.iter().map(|name| prefix.with_file_name(format!("{stem}-{name}"))).collect::<Vec<_>>())
    };
    prefixes.filter_map(|prefix| of_prefix(Path::new(prefix))).flatten().collect()
}

/// The values of an option by any of its names, as in `--name VALUE`, `--name=VALUE`, `-nVALUE`.
fn values<'w>(words: &'w [String], names: &[&str]) -> Vec<&'w str> {
    let mut found = Vec::new();
    for (place, word) in words.iter().enumerate() {
        for name in names {
            match word.strip_prefix(*name) {
                Some("") => found.extend(words.get(place + 1).map(String::as_str)),
                Some(rest) if name.starts_with("--") => found.extend(rest.strip_prefix('=')),
                Some(rest) => found.push(rest.strip_prefix('=').unwrap_or(rest)),
                None => {}
            }
        }
    }
    found
}

#[cfg(test)]
#[path = "outputs/tests.rs"]
mod tests;
