//! A folder that appears whole or not at all: made beside its place, under a name that nobody else uses, and renamed into it.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use vibes_data::{FolderLock, followed};

use crate::error::{Error, Result};

/// A folder in the making. Dropped before it is finished, it is removed.
#[derive(Debug)]
pub(crate) struct NewFolder {
    making: PathBuf,
    place: PathBuf,
    finished: bool,
    // Nobody else removes what is being made.
    _lock: FolderLock,
}

impl NewFolder {
    /// Begins `.NAME.making` beside `NAME`; what an earlier run left there is removed. `inputs` are what it is made from: none of them is removed, whatever
    /// its name.
    pub(crate) fn begin<'p>(place: &Path, inputs: impl IntoIterator<Item = &'p Path>) -> Result<Self> {
        let taken = || Error::malformed(place, "something is here already", "name a new folder with -o");
        let name = place.file_name().filter(|_| !is_taken(place)).ok_or_else(taken)?;
        let mut hidden = OsString::from(".");
        hidden.push(name);
        hidden.push(".making");
        let making = place.with_file_name(hidden);
        if let Some(input) = inputs.into_iter().find(|input| followed(input).starts_with(followed(&making))) {
            let fact = "the new folder would be made where this lies";
            return Err(Error::malformed(input, fact, "name another folder with -o"));
        }
        let lock = FolderLock::acquire_beside(place)?;
        // Whoever made it until now may have finished since.
        if is_taken(place) {
            return Err(taken());
        }
        if making.is_dir() {
            std::fs::remove_dir_all(&making).map_err(Error::io("remove", &making))?;
        }
        std::fs::create_dir_all(&making).map_err(Error::io("create", &making))?;
        Ok(Self { making, place: place.to_owned(), finished: false, _lock: lock })
    }

    /// Where to write until it is finished.
    pub(crate) fn path(&self) -> &Path {
        &self.making
    }

    /// Puts the folder in its place.
    pub(crate) fn finish(mut self) -> Result<()> {
        std::fs::rename(&self.making, &self.place).map_err(Error::io("write", &self.place))?;
        self.finished = true;
        Ok(())
    }
}

/// Whether something is there, other than an empty folder.
fn is_taken(place: &Path) -> bool {
    match std::fs::read_dir(place) {
        Ok(mut listing) => listing.next().is_some(),
        Err(_) => place.symlink_metadata().is_ok(),
    }
}

impl Drop for NewFolder {
    fn drop(&mut self) {
        if !self.finished {
            // Whatever went wrong is reported already; the next run removes what cannot be removed now.
            let _ = std::fs::remove_dir_all(&self.making);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_appears_when_finished_and_leaves_nothing_otherwise() {
        let parent = tempfile::tempdir().unwrap();
        let place = parent.path().join("new");
        let begun = NewFolder::begin(&place, []).unwrap();
        std::fs::write(begun.path().join("file"), "half").unwrap();
        drop(begun);
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0);
        let begun = NewFolder::begin(&place, []).unwrap();
        assert!(NewFolder::begin(&place, []).is_err(), "it is being made");
        std::fs::write(begun.path().join("file"), "whole").unwrap();
        begun.finish().unwrap();
        assert_eq!(std::fs::read_to_string(place.join("file")).unwrap(), "whole");
        assert!(NewFolder::begin(&place, []).is_err(), "it is taken now");
        assert!(NewFolder::begin(Path::new(".."), []).is_err());
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_nothing_of_anybody_else() {
        let parent = tempfile::tempdir().unwrap();
        let place = parent.path().join("new");
        let file = |folder: &str| parent.path().join(folder).join("file");
        for folder in ["new.partial", ".new.making"] {
            std::fs::create_dir(parent.path().join(folder)).unwrap();
            std::fs::write(file(folder), folder).unwrap();
        }
        let input = parent.path().join(".new.making");
        let error = NewFolder::begin(&place, [input.as_path()]).unwrap_err().to_string();
        assert!(error.contains("where this lies") && file(".new.making").is_file(), "{error}");
        drop(NewFolder::begin(&place, [parent.path()]).unwrap());
        assert!(!input.exists() && file("new.partial").is_file());
    }
}
