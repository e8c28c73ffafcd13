//! A folder that appears whole or not at all: made beside its place and renamed into it.

use std::path::{Path, PathBuf};

use vibes_data::FolderLock;

use crate::error::{Error, Result};

/// A folder in the making. Dropped before it is finished, it is removed.
#[derive(Debug)]
pub(crate) struct NewFolder {
    partial: PathBuf,
    place: PathBuf,
    finished: bool,
    // Nobody else removes what is being made.
    _lock: FolderLock,
}

impl NewFolder {
    /// Begins `NAME.partial` beside `NAME`; what an earlier run left there is removed.
    pub(crate) fn begin(place: &Path) -> Result<Self> {
        let is_taken = match std::fs::read_dir(place) {
            Ok(mut listing) => listing.next().is_some(),
            Err(_) => place.symlink_metadata().is_ok(),
        };
        let name = place.file_name().filter(|_| !is_taken);
        let Some(mut name) = name.map(ToOwned::to_owned) else {
            return Err(Error::malformed(place, "something is here already", "name a new folder with -o"));
        };
        let lock = FolderLock::acquire_beside(place)?;
        name.push(".partial");
        let partial = place.with_file_name(name);
        if partial.is_dir() {
            std::fs::remove_dir_all(&partial).map_err(Error::io("remove", &partial))?;
        }
        std::fs::create_dir_all(&partial).map_err(Error::io("create", &partial))?;
        Ok(Self { partial, place: place.to_owned(), finished: false, _lock: lock })
    }

    /// Where to write until it is finished.
    pub(crate) fn path(&self) -> &Path {
        &self.partial
    }

    /// Puts the folder in its place.
    pub(crate) fn finish(mut self) -> Result<()> {
        std::fs::rename(&self.partial, &self.place).map_err(Error::io("write", &self.place))?;
        self.finished = true;
        Ok(())
    }
}

impl Drop for NewFolder {
    fn drop(&mut self) {
        if !self.finished {
            // Whatever went wrong is reported already; the next run removes what cannot be removed now.
            let _ = std::fs::remove_dir_all(&self.partial);
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
        let begun = NewFolder::begin(&place).unwrap();
        std::fs::write(begun.path().join("file"), "half").unwrap();
        drop(begun);
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0);
        let begun = NewFolder::begin(&place).unwrap();
        assert!(NewFolder::begin(&place).is_err(), "it is being made");
        std::fs::write(begun.path().join("file"), "whole").unwrap();
        begun.finish().unwrap();
        assert_eq!(std::fs::read_to_string(place.join("file")).unwrap(), "whole");
        assert!(NewFolder::begin(&place).is_err(), "it is taken now");
        assert!(NewFolder::begin(Path::new("..")).is_err());
    }
}
