//! NumPy's `.npy` format, read by `npyz`, within limits: no header and no array may be larger than the file can hold. In: any reader. Out: an [`Array`].

use std::io::{Cursor, Read};

use npyz::{DType, Endianness, NpyHeader, Order, TypeChar};

use super::array::{Array, Kind};

/// A header may not be longer; NumPy's own are 128 bytes.
const LONGEST_HEADER: usize = 1 << 16;
/// Nor may its brackets lie deeper in each other than this, which keeps the parser from filling the stack.
const DEEPEST_HEADER: usize = 16;

/// Why an array is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It is sound, but of a type that holds no numbers, such as text or Python objects; without it the others can be read.
    OtherType(String),
    /// It is damaged.
    Damaged(String),
}

/// Reads an array of at most `most` bytes: floats of 16, 32 and 64 bits, integers and bools, of either byte order and either order of axes.
pub(super) fn read(mut from: impl Read, most: u64) -> Result<Array, Refusal> {
    let damaged = |error: std::io::Error| Refusal::Damaged(error.to_string());
    let header = read_header(&mut from).map_err(Refusal::Damaged)?;
    let header = NpyHeader::from_reader(Cursor::new(header)).map_err(damaged)?;
    let (kind, order) = kind_of(&header.dtype()).map_err(Refusal::OtherType)?;
    let sides: Option<Vec<usize>> = header.shape().iter().map(|&side| side.try_into().ok()).collect();
    let shape = sides.filter(|shape| shape.len() <= 8);
    let shape = shape.ok_or_else(|| Refusal::Damaged(format!("a shape of {:?}", header.shape())))?;
    let bytes = shape.iter().try_fold(kind.size() as u64, |bytes, &side| bytes.checked_mul(side as u64));
    let bytes = bytes
        .filter(|&bytes| bytes <= most)
        .ok_or_else(|| Refusal::Damaged(format!("an array of shape {shape:?} in so small a file")))?;
    let mut data = Vec::new();
    from.take(bytes).read_to_end(&mut data).map_err(damaged)?;
    if data.len() as u64 != bytes {
        return Err(Refusal::Damaged(format!("{} bytes of an array of {bytes}", data.len())));
    }
    if order == Endianness::Big {
        data.chunks_exact_mut(kind.size()).for_each(<[u8]>::reverse);
    }
    if header.order() == Order::Fortran {
        data = rows_first(&data, &shape, kind.size());
    }
    Array::new(kind, shape, data).ok_or_else(|| Refusal::Damaged("numbers that do not fill the shape".into()))
}

/// The header's bytes, magic and all, once their number is known to be sensible.
fn read_header(from: &mut impl Read) -> Result<Vec<u8>, String> {
    let text = |error: std::io::Error| error.to_string();
    let mut bytes = vec![0; 10];
    from.read_exact(&mut bytes).map_err(text)?;
    if &bytes[..6] != b"\x93NUMPY" {
        return Err("not an npy array".into());
    }
    let mut length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    if bytes[6] > 1 {
        let mut high = [0; 2];
        from.read_exact(&mut high).map_err(text)?;
        length += usize::from(u16::from_le_bytes(high)) << 16;
        bytes.extend(high);
    }
    if length > LONGEST_HEADER {
        return Err(format!("an npy header of {length} bytes"));
    }
    let start = bytes.len();
    bytes.resize(start + length, 0);
    from.read_exact(&mut bytes[start..]).map_err(text)?;
    check_header(&bytes[start..]).map_or(Ok(bytes), Err)
}

/// What the parser of the header must not be given: brackets without end, and a shape whose number of elements no integer holds.
fn check_header(text: &[u8]) -> Option<String> {
    let (mut depth, mut deepest) = (0_usize, 0);
    for byte in text {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    let text = String::from_utf8_lossy(text);
    let shape = text.split_once("'shape'").map_or("", |(_, rest)| rest.split(')').next().unwrap_or(""));
    let sides = shape.split(|c: char| !c.is_ascii_digit()).filter(|side| !side.is_empty());
    let elements = sides.map(str::parse).try_fold(1_u64, |all, side: Result<u64, _>| all.checked_mul(side.ok()?));
    match elements {
        _ if deepest > DEEPEST_HEADER => Some(format!("a header of {deepest} brackets in each other")),
        None => Some(format!("a shape that no file holds ({})", shape.trim())),
        Some(_) => None,
    }
}

/// The kind of a type of numbers and the order of its bytes, or what the type is.
fn kind_of(dtype: &DType) -> Result<(Kind, Endianness), String> {
    let DType::Plain(plain) = dtype else {
        return Err("a structured array; save its fields as arrays of their own".into());
    };
    let kind = match (plain.type_char(), plain.size_field()) {
        (TypeChar::Float, 2) => Kind::F16,
        (TypeChar::Float, 4) => Kind::F32,
        (TypeChar::Float, 8) => Kind::F64,
        (TypeChar::Int, 1) => Kind::I8,
        (TypeChar::Int, 2) => Kind::I16,
        (TypeChar::Int, 4) => Kind::I32,
        (TypeChar::Int, 8) => Kind::I64,
        (TypeChar::Uint, 1) => Kind::U8,
        (TypeChar::Uint, 2) => Kind::U16,
        (TypeChar::Uint, 4) => Kind::U32,
        (TypeChar::Uint, 8) => Kind::U64,
        (TypeChar::Bool, 1) => Kind::Bool,
        (TypeChar::Object, _) => {
            return Err("an array of Python objects; save numbers, as in np.asarray(array, dtype=np.float32)".into());
        }
        _ => {
            return Err(format!("an array of type {plain}; float16, float32, float64, integers and bool are read"));
        }
    };
    Ok((kind, plain.endianness()))
}

/// The elements of an array whose first axis varies fastest, in the order in which the last one does.
fn rows_first(data: &[u8], shape: &[usize], size: usize) -> Vec<u8> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for &side in shape {
        strides.push(stride);
        stride *= side;
    }
    let count = data.len() / size.max(1);
    let mut sorted = Vec::with_capacity(data.len());
    let mut place = vec![0_usize; shape.len()];
    for _ in 0..count {
        let from: usize = place.iter().zip(&strides).map(|(at, stride)| at * stride).sum();
        sorted.extend_from_slice(&data[from * size..(from + 1) * size]);
        for axis in (0..shape.len()).rev() {
            place[axis] += 1;
            if place[axis] < shape[axis] {
                break;
            }
            place[axis] = 0;
        }
    }
    sorted
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

    fn of(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Result<Array, Refusal> {
        let dict = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': ({shape}), }}\n");
        let found = read(Cursor::new(npy(1, &dict, data)), 1 << 20);
        assert_eq!(found, read(Cursor::new(npy(2, &dict, data)), 1 << 20), "both versions");
        found
    }

    #[test]
    fn every_type_order_and_layout_is_read() {
        let of_one = |descr: &str, data: &[u8]| of(descr, "False", "1,", data).unwrap().doubles(0, 1)[0];
        assert_eq!(of_one("'<f2'", &[0x00, 0xbe]), -1.5);
        assert_eq!(of_one("'>f2'", &[0xbe, 0x00]), -1.5);
        assert_eq!(of_one("'<f4'", &2.5_f32.to_le_bytes()), 2.5);
        assert_eq!(of_one("'>f8'", &2.25_f64.to_be_bytes()), 2.25);
        assert_eq!(of_one("'>i2'", &(-300_i16).to_be_bytes()), -300.0);
        assert_eq!(of_one("'|b1'", &[1]), 1.0);
        assert_eq!(of("'|u1'", "False", "", &[7]).unwrap().shape, Vec::<usize>::new());
        let rows = of("'|u1'", "False", "2, 3", &[0, 1, 2, 3, 4, 5]).unwrap();
        let columns = of("'|u1'", "True", "2, 3", &[0, 3, 1, 4, 2, 5]).unwrap();
        assert_eq!(rows, columns);
        let cube: Vec<u8> = (0..24).collect();
        let turned = of("'|u1'", "True", "2, 3, 4", &cube).unwrap();
        assert_eq!(turned.data[..5], [0, 6, 12, 18, 2]);
    }

    #[test]
    fn other_types_are_named_and_damage_is_damage() {
        let other = |descr: &str, said: &str| match of(descr, "False", "1,", &[0; 64]) {
            Err(Refusal::OtherType(fact)) => assert!(fact.contains(said), "{fact}"),
            found => panic!("{descr}: {found:?}"),
        };
        other("'|O'", "Python objects");
        other("'<U3'", "<U3");
        other("'<c8'", "float16");
        other("[('x', '<f4'), ('höhe', '<f4')]", "structured");
        let damaged = |descr: &str, shape: &str, data: &[u8]| match of(descr, "False", shape, data) {
            Err(Refusal::Damaged(fact)) => fact,
            found => panic!("{descr} ({shape}): {found:?}"),
        };
        assert!(damaged("'<f4'", "4611686018427387904, 64", &[0; 64]).contains("no file holds"));
        assert!(damaged("'<f4'", "1048576,", &[0; 64]).contains("in so small a file"));
        assert!(damaged("'<f4'", "20,", &[0; 64]).contains("64 bytes of an array of 80"));
        damaged("'<f4'", "-3,", &[0; 64]);
        assert!(damaged(&"(".repeat(5000), "1,", &[]).contains("brackets"));
        let long = [&b"\x93NUMPY\x02\x00"[..], &u32::MAX.to_le_bytes(), &[b' '; 64]].concat();
        assert!(matches!(read(Cursor::new(long), 1 << 20), Err(Refusal::Damaged(_))));
    }
}
