//! A plain array of numbers whose first axis is the rows, wherever it comes from: NumPy, HDF5 or Arrow.

/// The kinds of number that datasets are made of, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F16,
    F32,
    F64,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    /// A byte, 0 or 1.
    Bool,
}

impl Kind {
    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 | Self::Bool => 1,
            Self::F16 | Self::I16 | Self::U16 => 2,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }

    /// Its name in NumPy.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::F16 => "float16",
            Self::F32 => "float32",
            Self::F64 => "float64",
            Self::I8 => "int8",
            Self::I16 => "int16",
            Self::I32 => "int32",
            Self::I64 => "int64",
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::U64 => "uint64",
            Self::Bool => "bool",
        }
    }

    /// Whether it has a fraction.
    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }
}

/// An array in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    pub(super) kind: Kind,
    /// Rows first.
    pub(super) shape: Vec<usize>,
    pub(super) data: Vec<u8>,
}

impl Array {
    /// An array whose bytes are as many as its shape says; none otherwise.
    pub(super) fn new(kind: Kind, shape: Vec<usize>, data: Vec<u8>) -> Option<Self> {
        let bytes = shape.iter().try_fold(kind.size(), |bytes, &side| bytes.checked_mul(side))?;
        (bytes == data.len()).then_some(Self { kind, shape, data })
    }

    pub(super) fn rows(&self) -> usize {
        self.shape.first().copied().unwrap_or(1)
    }

    /// Numbers a row.
    pub(super) fn width(&self) -> usize {
        self.shape.iter().skip(1).product()
    }

    /// Rows `from..to` as bytes; `to` may not pass the last.
    pub(super) fn bytes(&self, from: usize, to: usize) -> &[u8] {
        let row = self.width() * self.kind.size();
        &self.data[from * row..to * row]
    }

    /// Rows `from..to` as float64: exact for float32 and integers below 2^53.
    pub(super) fn doubles(&self, from: usize, to: usize) -> Vec<f64> {
        self.bytes(from, to).chunks_exact(self.kind.size()).map(|bytes| number(self.kind, bytes)).collect()
    }

    /// Rows `from..to` as float32.
    pub(super) fn singles(&self, from: usize, to: usize) -> Vec<f32> {
        self.doubles(from, to).into_iter().map(|value| value as f32).collect()
    }

    /// Whether a row's first number is not zero.
    pub(super) fn is_set(&self, row: usize) -> bool {
        self.doubles(row, row + 1).first().is_some_and(|&value| value != 0.0)
    }
}

fn number(kind: Kind, bytes: &[u8]) -> f64 {
    let mut eight = [0; 8];
    eight[..bytes.len()].copy_from_slice(bytes);
    let whole = u64::from_le_bytes(eight);
    // Moved to the top and back, the sign fills the bits above.
    let signed = || {
        let shift = 64 - 8 * bytes.len() as u32;
        ((whole << shift) as i64 >> shift) as f64
    };
    match kind {
        Kind::F16 => half::f16::from_bits(whole as u16).to_f64(),
        Kind::F32 => f64::from(f32::from_bits(whole as u32)),
        Kind::F64 => f64::from_bits(whole),
        Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => signed(),
        Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 | Kind::Bool => whole as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_read() {
        let read = |kind: Kind, bytes: &[u8]| Array::new(kind, vec![1], bytes.to_vec()).unwrap().doubles(0, 1)[0];
        assert_eq!(read(Kind::F16, &half::f16::from_f32(0.1).to_le_bytes()), 0.0999755859375);
        assert_eq!(read(Kind::F32, &(-1.5_f32).to_le_bytes()), -1.5);
        assert_eq!(read(Kind::F64, &2.25_f64.to_le_bytes()), 2.25);
        assert_eq!(read(Kind::I16, &(-300_i16).to_le_bytes()), -300.0);
        assert_eq!(read(Kind::I64, &(-7_i64).to_le_bytes()), -7.0);
        assert_eq!(read(Kind::U8, &[255]), 255.0);
        assert!(Array::new(Kind::F32, vec![2, usize::MAX], vec![0; 8]).is_none(), "no such size");
    }
}
