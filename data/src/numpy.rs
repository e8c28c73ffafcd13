//! NumPy's `.npy` arrays and the `.npz` archives of them, read within limits, since a file may come from anybody: a header is no longer and no deeper than NumPy
//! writes any, and no array is larger than its file can hold.
//!
//! In: any reader, or an archive. Out: a header in the words of `npyz`, and the bytes of the elements that it describes, for the programs to make columns of.

use std::fs::File;
use std::io::{BufReader, Cursor, Read};

pub use npyz::{DType, Endianness, NpyHeader, Order, TypeChar, TypeStr};
use zip::ZipArchive;
use zip::read::ZipFile;

/// A header may not be longer; NumPy's own are 128 bytes, those of wide structures a few thousand.
const LONGEST_HEADER: usize = 1 << 16;
/// Nor may its brackets lie deeper in each other than this, which keeps the parser from filling the stack.
const DEEPEST_HEADER: usize = 16;
/// Deflate makes at most this many bytes of one; a larger array is a lie, whatever its header says.
const DEFLATE_AT_MOST: u64 = 1040;

/// What is wrong with an array or an archive; who reads it knows the file's name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Damage(String);

impl Damage {
    fn of(error: impl std::fmt::Display) -> Self {
        Self(error.to_string())
    }
}

/// Reads the header of an array and leaves the reader at its first element.
///
/// # Errors
/// No array, or a header that is damaged or beyond the limits.
pub fn read_npy_header(from: &mut impl Read) -> Result<NpyHeader, Damage> {
    NpyHeader::from_reader(Cursor::new(header_bytes(from)?)).map_err(Damage::of)
}

/// Reads all elements of the array with this header, which may not have more than `most` bytes: as they are stored, one after the other.
///
/// # Errors
/// Elements that are not plain bytes (Python objects), more of them than `most` bytes hold, or another number than the header says.
pub fn read_npy_elements(header: &NpyHeader, from: impl Read, most: u64) -> Result<Vec<u8>, Damage> {
    let size = header.dtype().num_bytes().filter(|&bytes| bytes > 0 && !header.uses_pickled_array());
    let size = size.ok_or_else(|| Damage("an array of Python objects".into()))?;
    let bytes = header.shape().iter().try_fold(size as u64, |bytes, &side| bytes.checked_mul(side));
    let bytes = bytes
        .filter(|&bytes| bytes <= most)
        .ok_or_else(|| Damage(format!("an array of shape {:?} in so small a file", header.shape())))?;
    let mut data = Vec::new();
    from.take(bytes.saturating_add(1)).read_to_end(&mut data).map_err(Damage::of)?;
    match data.len() as u64 {
        found if found == bytes => Ok(data),
        found if found < bytes => Err(Damage(format!("{found} bytes of an array of {bytes}"))),
        _ => Err(Damage(format!("more bytes than the {bytes} of its array"))),
    }
}

/// The header's bytes, magic and all, once their number is known to be sensible.
fn header_bytes(from: &mut impl Read) -> Result<Vec<u8>, Damage> {
    let mut bytes = vec![0; 10];
    from.read_exact(&mut bytes).map_err(Damage::of)?;
    if &bytes[..6] != b"\x93NUMPY" {
        return Err(Damage("not an npy array".into()));
    }
    let mut length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    if bytes[6] > 1 {
        let mut high = [0; 2];
        from.read_exact(&mut high).map_err(Damage::of)?;
        length += usize::from(u16::from_le_bytes(high)) << 16;
        bytes.extend(high);
    }
    if length > LONGEST_HEADER {
        return Err(Damage(format!("an npy header of {length} bytes")));
    }
    let start = bytes.len();
    bytes.resize(start + length, 0);
    from.read_exact(&mut bytes[start..]).map_err(Damage::of)?;
    check_header(&bytes[start..])?;
    Ok(bytes)
}

/// What the parser of the header must not be given: brackets without end, and a shape whose number of elements no integer holds.
fn check_header(text: &[u8]) -> Result<(), Damage> {
    let (mut depth, mut deepest) = (0_usize, 0);
    for byte in text {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    if deepest > DEEPEST_HEADER {
        return Err(Damage(format!("a header of {deepest} brackets in each other")));
    }
    // A field may be called shape too, and the key may stand in either kind of quotes.
    let text = String::from_utf8_lossy(text);
    for behind in text.split("shape").skip(1) {
        let shape = behind.split(')').next().unwrap_or("");
        let sides = shape.split(|c: char| !c.is_ascii_digit()).filter(|side| !side.is_empty());
        let elements = sides.map(str::parse).try_fold(1_u64, |all, side: Result<u64, _>| all.checked_mul(side.ok()?));
        if elements.is_none() {
            let shape = shape.trim_start_matches(['\'', '"', ':', ' ', '(']);
            return Err(Damage(format!("a shape that no file holds ({})", shape.trim())));
        }
    }
    Ok(())
}

/// An open `.npz` file: a zip file of arrays, stored or deflated.
pub struct NpzFile(ZipArchive<BufReader<File>>);

impl std::fmt::Debug for NpzFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NpzFile").field("names", &self.names()).finish()
    }
}

impl NpzFile {
    /// Reads the list of arrays.
    ///
    /// # Errors
    /// No whole zip file.
    pub fn new(file: File) -> Result<Self, Damage> {
        ZipArchive::new(BufReader::new(file)).map(Self).map_err(Damage::of)
    }

    /// The arrays' names, sorted.
    pub fn names(&self) -> Vec<String> {
        let names = self.0.file_names().filter_map(Result::ok);
        let mut names: Vec<String> = names.filter_map(|name| Some(name.strip_suffix(".npy")?.to_owned())).collect();
        names.sort_unstable();
        names
    }

    /// One array, to be read; none when the file does not have it.
    ///
    /// # Errors
    /// A damaged entry, or one that is packed in a way NumPy does not use.
    pub fn array(&mut self, name: &str) -> Result<Option<NpzArray<'_>>, Damage> {
        let Some(index) = self.0.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
        self.0.by_index(index).map(|member| Some(NpzArray(member))).map_err(Damage::of)
    }
}

/// An array of an archive, unpacked as it is read.
pub struct NpzArray<'a>(ZipFile<'a, BufReader<File>>);

impl NpzArray<'_> {
    /// The most bytes that it can have.
    pub fn most(&self) -> u64 {
        self.0.compressed_size().saturating_mul(DEFLATE_AT_MOST).min(self.0.size())
    }
}

impl Read for NpzArray<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(into)
    }
}

impl std::fmt::Debug for NpzArray<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("NpzArray").field(&self.0.name()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(version: u8, dict: &str, data: &[u8]) -> Vec<u8> {
        let length = match version {
            1 => (dict.len() as u16).to_le_bytes().to_vec(),
            _ => (dict.len() as u32).to_le_bytes().to_vec(),
        };
        [&b"\x93NUMPY"[..], &[version, 0], &length, dict.as_bytes(), data].concat()
    }

    fn dict(descr: &str, shape: &str) -> String {
        format!("{{'descr': {descr}, 'fortran_order': False, 'shape': ({shape}), }}\n")
    }

    fn read(bytes: &[u8], most: u64) -> Result<Vec<u8>, String> {
        let mut from = Cursor::new(bytes);
        let header = read_npy_header(&mut from).map_err(|damage| damage.to_string())?;
        read_npy_elements(&header, from, most).map_err(|damage| damage.to_string())
    }

    #[test]
    fn headers_of_both_lengths_lead_to_the_same_elements() {
        for version in [1, 2, 3] {
            let bytes = npy(version, &dict("[('x', '<f4', (2,)), ('shape', '<i2')]", "2,"), &[7; 20]);
            assert_eq!(read(&bytes, 20), Ok(vec![7; 20]), "{version}");
        }
    }

    #[test]
    fn what_no_file_holds_is_refused_before_anything_is_asked_for() {
        let refused = |bytes: &[u8], says: &str| {
            let found = read(bytes, 1 << 20).expect_err(says);
            assert!(found.contains(says), "{found}");
        };
        for deep in ["(", "[", "{"] {
            refused(&npy(2, &dict(&deep.repeat(20_000), "1,"), &[]), "20002 brackets in each other");
        }
        let huge = [&b"\x93NUMPY\x02\x00"[..], &u32::MAX.to_le_bytes(), &[b' '; 64]].concat();
        refused(&huge, "an npy header of 4294967295 bytes");
        refused(&npy(1, &dict("'<f4'", "4611686018427387904, 64"), &[0; 64]), "a shape that no file holds (461");
        let quoted = dict("'<f4'", "4611686018427387904, 64").replace("'shape'", "\"shape\"");
        refused(&npy(1, &quoted, &[0; 64]), "a shape that no file holds (461");
        refused(&npy(1, &dict("'<f4'", "1048576,"), &[0; 64]), "in so small a file");
        refused(&npy(1, &dict("'<f4'", "20,"), &[0; 64]), "64 bytes of an array of 80");
        refused(&npy(1, &dict("'<f4'", "4,"), &[0; 64]), "more bytes than the 16 of its array");
        refused(&npy(1, &dict("'|O'", "4,"), &[0; 64]), "Python objects");
        refused(b"\x93NUMPX\x01\x00\x01\x00 ", "not an npy array");
    }

    /// A member claims in its header far more than its packed bytes can become.
    #[test]
    fn an_array_of_an_archive_is_no_larger_than_its_packed_bytes_allow() {
        let dir = tempfile::tempdir().expect("folder");
        let path = dir.path().join("a.npz");
        let mut writer = zip::ZipWriter::new(File::create(&path).expect("file"));
        let packed = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
        for (name, shape) in [("sound", "3, 4"), ("lie", "3, 4000")] {
            writer.start_file(format!("{name}.npy"), packed).expect("member");
            std::io::Write::write_all(&mut writer, &npy(1, &dict("'|u1'", shape), &[1; 12])).expect("bytes");
        }
        writer.finish().expect("zip");
        let mut file = NpzFile::new(File::open(&path).expect("file")).expect("archive");
        assert_eq!(file.names(), ["lie", "sound"]);
        let mut elements = |name: &str| {
            let mut array = file.array(name).expect("whole").expect("there");
            let (most, header) = (array.most(), read_npy_header(&mut array).expect("header"));
            read_npy_elements(&header, array, most)
        };
        assert_eq!(elements("sound"), Ok(vec![1; 12]));
        assert!(elements("lie").expect_err("too large").to_string().contains("in so small a file"));
        assert!(file.array("other").expect("whole").is_none());
        std::fs::write(&path, b"PK\x03\x04 and no more").expect("file");
        assert!(NpzFile::new(File::open(&path).expect("file")).is_err());
    }
}
