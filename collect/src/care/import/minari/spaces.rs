//! Gymnasium's spaces as Minari writes them down: JSON in a string (`minari/serialization.py`), with Python's `Infinity` where there is no bound.
//!
//! In: the text. Out: the leaves of the tree, each with the path of its column and what it becomes in a recording.

use serde_json::Value;
use vibes_data::{ActionSpec, ImageSize};

use super::super::array::Array;

/// A space.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Space {
    Box { dtype: String, shape: Vec<usize>, low: Vec<f64>, high: Vec<f64> },
    Discrete { start: i64, n: usize },
    Dict(Vec<(String, Self)>),
    Other(String),
}

/// A space that has a column of its own.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Leaf {
    /// The names from the episode's columns down.
    pub(super) path: Vec<String>,
    pub(super) kind: LeafKind,
}

/// What a column becomes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum LeafKind {
    /// The picture, `[height, width, 3]` or `[3, height, width]`.
    Picture { size: ImageSize, channels_first: bool },
    /// Numbers of the vector observation, or an action.
    Numbers { len: usize, low: Vec<f64>, high: Vec<f64> },
    /// One of `n` choices, as zeros and a one.
    OneHot { start: i64, n: usize },
    /// Nothing; says what it is.
    Other(String),
}

/// No space has more numbers than this.
const LARGEST: usize = 1 << 20;

impl Space {
    /// Reads a space from its text.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        // JSON proper has no infinities; a bound that is not there is none.
        let text = text.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null");
        let value: Value = serde_json::from_str(&text).map_err(|error| error.to_string())?;
        Self::of(&value)
    }

    fn of(value: &Value) -> Result<Self, String> {
        let kind = value["type"].as_str().ok_or("a space without a type")?;
        match kind {
            "Box" => {
                let sides = value["shape"].as_array().ok_or("a Box without a shape")?.iter();
                let shape: Option<Vec<usize>> =
                    sides.map(|side| side.as_u64().and_then(|side| usize::try_from(side).ok())).collect();
                let shape = shape.ok_or("a Box whose shape is none")?;
                let bounds = |key: &str| {
                    let mut found = Vec::new();
                    flatten(&value[key], &mut found);
                    found
                };
                Ok(Self::Box {
                    dtype: value["dtype"].as_str().unwrap_or("").into(),
                    shape,
                    low: bounds("low"),
                    high: bounds("high"),
                })
            }
            "Discrete" => {
                let n = value["n"].as_u64().and_then(|n| usize::try_from(n).ok()).filter(|n| (1..=LARGEST).contains(n));
                Ok(Self::Discrete {
                    start: value["start"].as_i64().unwrap_or(0),
                    n: n.ok_or("a Discrete of no choices")?,
                })
            }
            "Dict" => {
                let parts = value["subspaces"].as_object().ok_or("a Dict without subspaces")?;
                let parts = parts.iter().map(|(name, part)| Ok((name.clone(), Self::of(part)?)));
                Ok(Self::Dict(parts.collect::<Result<_, String>>()?))
            }
            other => Ok(Self::Other(other.into())),
        }
    }

    /// The leaves below a column.
    pub(super) fn leaves(self, column: &str) -> Vec<Leaf> {
        let mut leaves = Vec::new();
        self.collect(vec![column.to_owned()], &mut leaves);
        leaves
    }

    fn collect(self, path: Vec<String>, leaves: &mut Vec<Leaf>) {
        let kind = match self {
            Self::Dict(parts) => {
                for (name, part) in parts {
                    part.collect(path.iter().cloned().chain([name]).collect(), leaves);
                }
                return;
            }
            Self::Discrete { start, n } => LeafKind::OneHot { start, n },
            Self::Other(what) => LeafKind::Other(what),
            Self::Box { dtype, shape, low, high } => box_kind(&dtype, &shape, low, high),
        };
        leaves.push(Leaf { path, kind });
    }
}

fn box_kind(dtype: &str, shape: &[usize], low: Vec<f64>, high: Vec<f64>) -> LeafKind {
    let len =
        shape.iter().try_fold(1_usize, |len, &side| len.checked_mul(side)).filter(|&len| (1..=LARGEST).contains(&len));
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    match (dtype, shape, len) {
        ("uint8", &[height, width, 3], Some(_)) => {
            LeafKind::Picture { size: ImageSize { height: side(height), width: side(width) }, channels_first: false }
        }
        ("uint8", &[3, height, width], Some(_)) => {
            LeafKind::Picture { size: ImageSize { height: side(height), width: side(width) }, channels_first: true }
        }
        ("uint8", &[_, _, _], _) => LeafKind::Other(format!("a picture of shape {shape:?}")),
        (_, _, Some(len)) => LeafKind::Numbers { len, low, high },
        (_, _, None) => LeafKind::Other(format!("a Box of shape {shape:?}")),
    }
}

/// Nested lists of numbers, one after another; what is no number is none.
fn flatten(value: &Value, into: &mut Vec<f64>) {
    match value {
        Value::Array(parts) => parts.iter().for_each(|part| flatten(part, into)),
        value => into.push(value.as_f64().unwrap_or(f64::NAN)),
    }
}

impl Leaf {
    /// The name of the vector observation's part.
    pub(super) fn name(&self) -> String {
        match self.path.as_slice() {
            [column] => column.clone(),
            [_, below @ ..] => below.join("/"),
            [] => String::new(),
        }
    }

    /// Numbers a row.
    pub(super) fn len(&self) -> usize {
        match &self.kind {
            LeafKind::Numbers { len, .. } => *len,
            LeafKind::OneHot { n, .. } => *n,
            LeafKind::Picture { size, .. } => size.bytes(),
            LeafKind::Other(_) => 0,
        }
    }

    /// The picture's size.
    pub(super) fn size(&self) -> Option<ImageSize> {
        match self.kind {
            LeafKind::Picture { size, .. } => Some(size),
            _ => None,
        }
    }

    /// The bounds of an action, where the space has them all.
    pub(super) fn bounds(&self) -> Option<ActionSpec> {
        match &self.kind {
            LeafKind::OneHot { n, .. } => Some(ActionSpec { min: vec![0.0; *n], max: vec![1.0; *n] }),
            LeafKind::Numbers { len, low, high } => {
                let finite =
                    low.len() == *len && high.len() == *len && low.iter().chain(high).all(|bound| bound.is_finite());
                finite.then(|| ActionSpec { min: low.clone(), max: high.clone() })
            }
            _ => None,
        }
    }

    /// The first `rows` rows of a column as numbers, `[rows, len]`; says what is wrong with its shape.
    pub(super) fn numbers(&self, array: &Array, rows: usize) -> Result<Vec<f32>, String> {
        let (width, name) =
            (if matches!(self.kind, LeafKind::OneHot { .. }) { 1 } else { self.len() }, self.path.join("/"));
        if array.rows() < rows || array.width() != width || array.shape.is_empty() {
            return Err(format!("{name} of shape {:?}, where {rows} rows of {width} are needed", array.shape));
        }
        let LeafKind::OneHot { start, n } = self.kind else { return Ok(array.singles(0, rows)) };
        if rows.checked_mul(n).is_none_or(|numbers| numbers > LARGEST << 8) {
            return Err(format!("{name} of {rows} rows of {n} choices"));
        }
        let mut hot = vec![0.0; rows * n];
        for (row, choice) in array.doubles(0, rows).into_iter().enumerate() {
            let place = choice - start as f64;
            if !(0.0..n as f64).contains(&place) {
                return Err(format!(
                    "{name} holds {choice} of the choices {start} to {}",
                    start.saturating_add(n as i64 - 1)
                ));
            }
            hot[row * n + place as usize] = 1.0;
        }
        Ok(hot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spaces_become_leaves() {
        let text = r#"{"type": "Dict", "subspaces": {
            "eye": {"type": "Box", "dtype": "uint8", "shape": [2, 2, 3], "low": 0, "high": 255},
            "arm": {"type": "Dict", "subspaces": {"angle": {"type": "Box", "dtype": "float64", "shape": [1], "low": [-Infinity], "high": [Infinity]}}},
            "word": {"type": "Text", "max_length": 3}, "mode": {"type": "Discrete", "start": 1, "n": 2}}}"#;
        let leaves = Space::parse(text).unwrap().leaves("observations");
        let names: Vec<String> = leaves.iter().map(Leaf::name).collect();
        assert_eq!(names, ["arm/angle", "eye", "mode", "word"]);
        assert_eq!(leaves[1].size(), Some(ImageSize { height: 2, width: 2 }));
        assert_eq!(leaves[0].bounds(), None, "no bounds");
        assert!(matches!(leaves[3].kind, LeafKind::Other(_)));
        let choices = Array::new(
            super::super::super::array::Kind::I64,
            vec![2],
            [2_i64.to_le_bytes(), 1_i64.to_le_bytes()].concat(),
        )
        .unwrap();
        assert_eq!(leaves[2].numbers(&choices, 2).unwrap(), [0.0, 1.0, 1.0, 0.0]);
        assert!(Space::parse("{}").is_err());
    }
}
