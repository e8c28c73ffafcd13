//! NumPy's `.npy` format as the arrays of a dataset: floats, integers and bools of any byte order and order of axes, read within the limits of
//! [`vibes_data::numpy`]. In: any reader. Out: an [`Array`].

use std::io::Read;

use vibes_data::numpy::{DType, Damage, Endianness, Order, TypeChar, read_npy_elements, read_npy_header};

use super::array::{Array, Kind};

/// Why an array is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It is sound, but of a type that holds no numbers, such as text or Python objects; without it the others can be read.
    OtherType(String),
    /// It is damaged.
    Damaged(String),
}

impl From<Damage> for Refusal {
    fn from(damage: Damage) -> Self {
        Self::Damaged(damage.to_string())
    }
}

/// Reads an array of at most `most` bytes: floats of 16, 32 and 64 bits, integers and bools, of either byte order and either order of axes.
pub(super) fn read(mut from: impl Read, most: u64) -> Result<Array, Refusal> {
    let header = read_npy_header(&mut from)?;
    let (kind, order) = kind_of(&header.dtype()).map_err(Refusal::OtherType)?;
    let sides: Option<Vec<usize>> = header.shape().iter().map(|&side| side.try_into().ok()).collect();
    let shape = sides.filter(|shape| shape.len() <= 8);
    let shape = shape.ok_or_else(|| Refusal::Damaged(format!("a shape of {:?}", header.shape())))?;
    let mut data = read_npy_elements(&header, from, most)?;
    if order == Endianness::Big {
        data.chunks_exact_mut(kind.size()).for_each(<[u8]>::reverse);
    }
    if header.order() == Order::Fortran {
        data = rows_first(&data, &shape, kind.size());
    }
    Array::new(kind, shape, data).ok_or_else(|| Refusal::Damaged("numbers that do not fill the shape".into()))
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
    use std::io::Cursor;

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
    }
}
