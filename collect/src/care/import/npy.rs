//! NumPy's `.npy` format: magic, version, a Python dictionary as text, then the numbers. In: any reader. Out: an [`Array`].

use std::io::Read;

use super::array::{Array, Kind};

/// A header may not be longer; NumPy's own are 128 bytes.
const LONGEST_HEADER: usize = 1 << 16;

/// Reads an array of at most `most` bytes.
pub(super) fn read(mut from: impl Read, most: u64) -> Result<Array, String> {
    let mut head = [0; 10];
    from.read_exact(&mut head).map_err(|error| error.to_string())?;
    if &head[..6] != b"\x93NUMPY" {
        return Err("not an npy array".into());
    }
    let mut length = usize::from(u16::from_le_bytes([head[8], head[9]]));
    if head[6] > 1 {
        let mut high = [0; 2];
        from.read_exact(&mut high).map_err(|error| error.to_string())?;
        length += usize::from(u16::from_le_bytes(high)) << 16;
    }
    if length > LONGEST_HEADER {
        return Err(format!("an npy header of {length} bytes"));
    }
    let mut header = vec![0; length];
    from.read_exact(&mut header).map_err(|error| error.to_string())?;
    let header = std::str::from_utf8(&header).map_err(|error| error.to_string())?;
    let (kind, shape) = parse(header)?;
    let bytes = shape.iter().try_fold(kind.size() as u64, |bytes, &side| bytes.checked_mul(side as u64));
    let bytes = bytes
        .filter(|&bytes| bytes <= most)
        .ok_or_else(|| format!("an array of shape {shape:?} in so small a file"))?;
    let mut data = Vec::new();
    from.take(bytes).read_to_end(&mut data).map_err(|error| error.to_string())?;
    let found = data.len();
    Array::new(kind, shape, data).ok_or_else(|| format!("{found} bytes of an array of {bytes}"))
}

/// `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }`
fn parse(header: &str) -> Result<(Kind, Vec<usize>), String> {
    let after = |key: &str| header.split_once(key).map(|(_, rest)| rest.trim_start());
    let descr = after("'descr':").and_then(|rest| rest.strip_prefix('\'')).and_then(|rest| rest.split('\'').next());
    let descr = descr.ok_or("a structured array, or none")?;
    let kind = match descr.trim_start_matches(['<', '|', '=']) {
        "f4" => Kind::F32,
        "f8" => Kind::F64,
        "i1" => Kind::I8,
        "i2" => Kind::I16,
        "i4" => Kind::I32,
        "i8" => Kind::I64,
        "u1" => Kind::U8,
        "u2" => Kind::U16,
        "u4" => Kind::U32,
        "u8" => Kind::U64,
        "b1" => Kind::Bool,
        _ => {
            return Err(format!(
                "an array of type {descr}; float32, float64, integers and bool are read, little-endian"
            ));
        }
    };
    if after("'fortran_order':").is_some_and(|rest| rest.starts_with("True")) {
        return Err("an array in Fortran order; save np.ascontiguousarray(array)".into());
    }
    let sides = after("'shape':").and_then(|rest| rest.strip_prefix('(')).and_then(|rest| rest.split(')').next());
    let sides = sides.ok_or("no shape")?.split(',').map(str::trim).filter(|side| !side.is_empty());
    let shape: Option<Vec<usize>> = sides.map(|side| side.parse().ok()).collect();
    shape.filter(|shape| shape.len() <= 8).map(|shape| (kind, shape)).ok_or_else(|| "a shape that is none".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read() {
        let of = |text: &str| parse(text);
        assert_eq!(of("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }"), Ok((Kind::F32, vec![3, 2])));
        assert_eq!(of("{'descr': '|b1', 'fortran_order': False, 'shape': (5,), }"), Ok((Kind::Bool, vec![5])));
        assert_eq!(of("{'descr': '|u1', 'fortran_order': False, 'shape': (), }"), Ok((Kind::U8, vec![])));
        assert!(of("{'descr': '>f4', 'fortran_order': False, 'shape': (3,), }").is_err());
        assert!(of("{'descr': '<f4', 'fortran_order': True, 'shape': (3,), }").is_err());
        assert!(of("{'descr': '<f4', 'shape': (-3,), }").is_err());
    }
}
