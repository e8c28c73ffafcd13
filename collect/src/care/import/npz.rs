//! NumPy's `.npz` format: a zip file of `.npy` arrays, stored or deflated. In: a file. Out: its arrays by name, read when asked for.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use super::array::Array;
use super::npy::{self, Refusal};
use crate::error::{Error, Result};

/// Deflate makes at most this many bytes of one; a larger array is a lie, whatever its header says.
const DEFLATE_AT_MOST: u64 = 1040;

/// An open file.
pub(super) struct Npz {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

impl Npz {
    /// Opens a file and reads its list of arrays.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let archive = ZipArchive::new(BufReader::new(file))
            .map_err(|error| Error::malformed(path, error.to_string(), "a whole .npz file"))?;
        Ok(Self { path: path.to_owned(), archive })
    }

    /// The arrays' names, sorted.
    pub(super) fn names(&self) -> Vec<String> {
        let names = self.archive.file_names().filter_map(std::result::Result::ok);
        let mut names: Vec<String> = names.filter_map(|name| Some(name.strip_suffix(".npy")?.to_owned())).collect();
        names.sort_unstable();
        names
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
        let Some(index) = self.archive.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
        let broken = |fact: String| Error::malformed(&*self.path, format!("{name}: {fact}"), "a whole .npz file");
        let member = self.archive.by_index(index).map_err(|error| broken(error.to_string()))?;
        let most = member.compressed_size().saturating_mul(DEFLATE_AT_MOST).min(member.size());
        match npy::read(member, most) {
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
