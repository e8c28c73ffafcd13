//! NumPy arrays: an `.npz` of arrays, a structured `.npy` with fields, or a plain `[rows, dims]` array with `episode.npy` and `step.npy` beside it, or alone, where a
//! recording that is named has its keys.
//!
//! [`vibes_data::numpy`] reads headers and elements within limits; the numbers are taken from the elements' bytes, because an element may be a structure of any
//! width.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use half::f16;
use polars::prelude::{ArrowDataType, PlSmallStr, Series};
use polars_arrow::array::{FixedSizeListArray, PrimitiveArray};
use polars_arrow::datatypes::Field;
use vibes_data::numpy::{
    DType, Damage, Endianness, NpyHeader, NpzFile, Order, TypeChar, TypeStr, read_npy_elements, read_npy_header,
};

use super::{InputError, column, damaged, not_a_table};

/// What a plain array's columns are called.
const PLAIN: &str = "latent";
/// Arrays that are looked for beside a plain one.
const BESIDE: [&str; 5] = ["episode", "step", "state", "distractor", "reward"];

pub(super) fn schema(path: &Path) -> Result<(Vec<String>, BTreeMap<String, String>), InputError> {
    let names = if let Some(archive) = archive(path)? {
        let arrays = archive.names();
        if arrays.is_empty() {
            return Err(not_a_table(path, "a zip file without arrays"));
        }
        arrays
    } else {
        match read_npy_header(&mut open(path)?).map_err(damage(path, "npy"))?.dtype() {
            DType::Record(fields) => fields.into_iter().map(|field| field.name).collect(),
            _ => {
                let beside = BESIDE.iter().filter(|name| path.with_file_name(format!("{name}.npy")).is_file());
                std::iter::once(PLAIN).chain(beside.copied()).map(String::from).collect()
            }
        }
    };
    Ok((names, BTreeMap::new()))
}

pub(super) fn read(path: &Path, names: &[String]) -> Result<Vec<Series>, InputError> {
    if let Some(mut archive) = archive(path)? {
        let member = |name: &String| {
            let member = archive.array(name).map_err(damage(path, "npz"))?;
            let member = member.ok_or_else(|| not_a_table(path, format!("an npz file without an array {name}")))?;
            let most = member.most();
            Bytes::read(member, most, path)?.series(name, None, path)
        };
        return names.iter().map(member).collect();
    }
    let size = std::fs::metadata(path).map_err(InputError::io(path))?.len();
    let array = Bytes::read(open(path)?, size, path)?;
    let structured = matches!(array.header.dtype(), DType::Record(_));
    let one = |name: &String| {
        if structured {
            return array.series(name, Some(name), path);
        }
        if name == PLAIN {
            return array.series(name, None, path);
        }
        let beside = path.with_file_name(format!("{name}.npy"));
        let size = std::fs::metadata(&beside).map_err(InputError::io(&beside))?.len();
        Bytes::read(open(&beside)?, size, &beside)?.series(name, None, &beside)
    };
    names.iter().map(one).collect()
}

fn open(path: &Path) -> Result<BufReader<File>, InputError> {
    File::open(path).map(BufReader::new).map_err(InputError::io(path))
}

/// The archive, if it is one.
fn archive(path: &Path) -> Result<Option<NpzFile>, InputError> {
    let mut first = Vec::new();
    open(path)?.take(2).read_to_end(&mut first).map_err(InputError::io(path))?;
    if first != b"PK" {
        return Ok(None);
    }
    let file = File::open(path).map_err(InputError::io(path))?;
    NpzFile::new(file).map(Some).map_err(damage(path, "npz"))
}

fn damage(path: &Path, kind: &'static str) -> impl FnOnce(Damage) -> InputError {
    move |damage| not_a_table(path, format!("a damaged {kind} file ({damage})"))
}

/// An array as it is stored.
struct Bytes {
    header: NpyHeader,
    data: Vec<u8>,
}

/// Where a number lies within an element.
struct Part {
    offset: usize,
    kind: TypeStr,
    count: usize,
}

impl Bytes {
    /// Reads an array of at most `most` bytes.
    fn read(mut from: impl Read, most: u64, path: &Path) -> Result<Self, InputError> {
        let header = read_npy_header(&mut from).map_err(damage(path, "npy"))?;
        let data = read_npy_elements(&header, from, most).map_err(damage(path, "npy"))?;
        Ok(Self { header, data })
    }

    fn series(&self, name: &str, field: Option<&str>, path: &Path) -> Result<Series, InputError> {
        let expected = "numbers, one or one list of them a row";
        let dtype = self.header.dtype();
        let fault = || column(path, name, format!("it holds {}", dtype.descr()), expected);
        let part = part(&dtype, field).ok_or_else(fault)?;
        let element = dtype.num_bytes().ok_or_else(fault)?;
        let shape: Vec<usize> = self.header.shape().iter().map(|&n| n as usize).collect();
        let rows = shape.first().copied().unwrap_or(1);
        let width = part.count * shape.iter().skip(1).product::<usize>();
        if self.header.order() == Order::Fortran && (shape.len() > 2 || (shape.len() == 2 && part.count > 1)) {
            let fact = "an array of more than two dimensions in Fortran order (save np.ascontiguousarray of it)";
            return Err(column(path, name, fact, expected));
        }
        let columns_first = self.header.order() == Order::Fortran && shape.len() == 2;
        let flat = shape.len() < 2 && part.count == 1 && field.is_none_or(|_| !is_list(&dtype, field));
        let values = Values { bytes: self, part: &part, element };
        let at = |i: usize| if columns_first { i % width * rows + i / width } else { i };
        Ok(match (part.kind.type_char(), part.kind.size_field()) {
            (TypeChar::Float, 2 | 4) => values.series(name, flat, width, path, |b| float(b) as f32, at)?,
            (TypeChar::Float, 8) => values.series(name, flat, width, path, float, at)?,
            (TypeChar::Int | TypeChar::Bool, 1 | 2 | 4 | 8) => {
                values.series(name, flat, width, path, |b| signed(b, part.kind.type_char()), at)?
            }
            (TypeChar::Uint, 1 | 2 | 4 | 8) => values.series(name, flat, width, path, unsigned, at)?,
            _ => return Err(fault()),
        })
    }
}

/// The numbers of one column.
struct Values<'a> {
    bytes: &'a Bytes,
    part: &'a Part,
    element: usize,
}

impl Values<'_> {
    /// Every number by `number` from its bytes, lowest first, in the order of rows; lists of `width` unless `flat`.
    fn series<T: polars_arrow::types::NativeType>(
        &self,
        name: &str,
        flat: bool,
        width: usize,
        path: &Path,
        number: impl Fn(&[u8]) -> T,
        at: impl Fn(usize) -> usize,
    ) -> Result<Series, InputError> {
        let bytes = self.part.kind.size_field() as usize;
        let big = self.part.kind.endianness() == Endianness::Big;
        let of_element = self.part.count;
        let count = self.bytes.data.len() / self.element * of_element;
        let value = |i: usize| {
            let i = at(i);
            let from = i / of_element * self.element + self.part.offset + i % of_element * bytes;
            let mut lowest_first = [0; 8];
            lowest_first[..bytes].copy_from_slice(&self.bytes.data[from..from + bytes]);
            if big {
                lowest_first[..bytes].reverse();
            }
            number(&lowest_first[..bytes])
        };
        let values = PrimitiveArray::from_vec((0..count).map(value).collect::<Vec<T>>());
        let fault = |error| damaged(path, &error);
        let name = PlSmallStr::from_str(name);
        if flat {
            return Series::try_from((name, values.boxed())).map_err(fault);
        }
        let rows = count / width.max(1);
        let item = Field::new(PlSmallStr::from_static("item"), values.dtype().clone(), true);
        let kind = ArrowDataType::FixedSizeList(Box::new(item), width);
        let lists = FixedSizeListArray::try_new(kind, rows, values.boxed(), None).map_err(fault)?;
        Series::try_from((name, lists.boxed())).map_err(fault)
    }
}

fn is_list(dtype: &DType, field: Option<&str>) -> bool {
    match dtype {
        DType::Record(fields) => fields.iter().any(|f| Some(f.name.as_str()) == field && is_list(&f.dtype, None)),
        DType::Array(..) => true,
        DType::Plain(_) => false,
    }
}

/// Where the numbers of a plain array, or of one field of a structure, lie within an element.
fn part(dtype: &DType, field: Option<&str>) -> Option<Part> {
    match (dtype, field) {
        (DType::Plain(kind), None) => Some(Part { offset: 0, kind: kind.clone(), count: 1 }),
        (DType::Array(n, inner), None) => {
            let inner = part(inner, None)?;
            Some(Part { count: inner.count.checked_mul(usize::try_from(*n).ok()?)?, ..inner })
        }
        (DType::Record(fields), Some(name)) => {
            let mut offset = 0;
            for field in fields {
                if field.name == name {
                    return Some(Part { offset, ..part(&field.dtype, None)? });
                }
                offset += field.dtype.num_bytes()?;
            }
            None
        }
        _ => None,
    }
}

fn float(bytes: &[u8]) -> f64 {
    match *bytes {
        [a, b] => f16::from_le_bytes([a, b]).to_f64(),
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    }
}

fn unsigned(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte))
}

fn signed(bytes: &[u8], kind: TypeChar) -> i64 {
    let negative = kind == TypeChar::Int && bytes.last().is_some_and(|byte| byte & 0x80 != 0);
    bytes.iter().rev().fold(if negative { -1 } else { 0 }, |value, &byte| value << 8 | i64::from(byte))
}
