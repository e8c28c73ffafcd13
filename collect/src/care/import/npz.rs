//! NumPy's `.npz` format as a set of named arrays. In: a file. Out: its arrays by name, read when asked for.

use std::fs::File;
use std::path::{Path, PathBuf};

use vibes_data::numpy::NpzFile;

use super::array::Array;
use super::npy::{self, Refusal};
use crate::error::{Error, Result};

/// An open file.
pub(super) struct Npz {
    path: PathBuf,
    file: NpzFile,
}

impl Npz {
    /// Opens a file and reads its list of arrays.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let whole = |damage: vibes_data::numpy::Damage| Error::malformed(path, damage.to_string(), "a whole .npz file");
        Ok(Self { path: path.to_owned(), file: NpzFile::new(file).map_err(whole)? })
    }

    /// The arrays' names, sorted.
    pub(super) fn names(&self) -> Vec<String> {
        self.file.names()
    }

    /// One array; none when the file does not have it.
    pub(super) fn array(&mut self, name: &str) -> Result<Option<Array>> {
        match self.read(name)? {
            None => Ok(None),
            Some(Ok(array)) => Ok(Some(array)),
            Some(Err(fact)) => {
                Err(Error::malformed(&*self.path, format!("{name}: {fact}"), "an array of numbers for each of these"))
            }
        }
    }

    /// One array that can be done without; none when the file does not have it or it holds no numbers.
    pub(super) fn optional(&mut self, name: &str) -> Result<Option<Array>> {
        Ok(self.read(name)?.and_then(std::result::Result::ok))
    }

    /// One array, or of what other type it is.
    fn read(&mut self, name: &str) -> Result<Option<std::result::Result<Array, String>>> {
        let broken = |fact: String| Error::malformed(&*self.path, format!("{name}: {fact}"), "a whole .npz file");
        let Some(array) = self.file.array(name).map_err(|damage| broken(damage.to_string()))? else { return Ok(None) };
        let most = array.most();
        match npy::read(array, most) {
            Ok(array) => Ok(Some(Ok(array))),
            Err(Refusal::OtherType(fact)) => Ok(Some(Err(fact))),
            Err(Refusal::Damaged(fact)) => Err(broken(fact)),
        }
    }

    /// One array that must be there.
    pub(super) fn needed(&mut self, name: &str) -> Result<Array> {
        let found = self.names().join(", ");
        let path = self.path.clone();
        self.array(name)?
            .ok_or_else(|| Error::malformed(path, format!("no array {name}, only {found}"), "image, action and reward"))
    }
}
