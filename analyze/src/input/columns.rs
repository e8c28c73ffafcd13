//! A user's own column of a table: numbers, or kinds with names.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use polars::prelude::{DataType, PolarsError, Series};

use super::InputError;
use super::tables::column;
use crate::natural::pieces;

/// One value a row.
#[derive(Clone, Debug, PartialEq)]
pub enum UserColumn {
    /// Numbers; NaN where there is none.
    Numbers(Vec<f64>),
    /// Texts and truth values.
    Kinds {
        /// The kind of every row; none where there is none.
        of_row: Vec<Option<u32>>,
        /// What the kinds are called, in natural order: `kind2` before `kind10`.
        names: Vec<String>,
    },
}

impl UserColumn {
    /// Whether a row has a value.
    #[must_use]
    pub fn has(&self, row: usize) -> bool {
        match self {
            Self::Numbers(values) => values.get(row).is_some_and(|value| value.is_finite()),
            Self::Kinds { of_row, .. } => of_row.get(row).is_some_and(Option::is_some),
        }
    }

    pub(super) fn read(series: &Series, path: &Path) -> Result<Self, InputError> {
        let expected = "numbers, texts or truth values";
        let fault = |error: PolarsError| column(path, series.name(), error.to_string(), expected);
        match series.dtype() {
            DataType::String => {
                let texts = series.str().map_err(fault)?;
                Ok(Self::kinds(texts.iter().map(|text| text.map(String::from))))
            }
            DataType::Boolean => {
                let truths = series.bool().map_err(fault)?;
                Ok(Self::kinds(truths.iter().map(|truth| truth.map(|truth| truth.to_string()))))
            }
            kind if kind.is_primitive_numeric() || kind.is_null() => {
                let wide = series.cast(&DataType::Float64).map_err(fault)?;
                Ok(Self::Numbers(wide.f64().map_err(fault)?.iter().map(|v| v.unwrap_or(f64::NAN)).collect()))
            }
            kind => Err(column(path, series.name(), format!("it holds {kind}"), expected)),
        }
    }

    /// Kinds are numbered in the natural order of their names, as legends list them.
    fn kinds(texts: impl Iterator<Item = Option<String>>) -> Self {
        let texts: Vec<Option<String>> = texts.collect();
        // Names that differ in zeros alone, as `kind2` and `kind02`, are two kinds: the sort is stable.
        let different: BTreeSet<&str> = texts.iter().flatten().map(String::as_str).collect();
        let mut names: Vec<&str> = different.into_iter().collect();
        names.sort_by_cached_key(|&name| pieces(name));
        let numbers: BTreeMap<&str, u32> = names.iter().copied().zip(0..).collect();
        let of_row = texts.iter().map(|text| text.as_deref().and_then(|text| numbers.get(text).copied())).collect();
        Self::Kinds { of_row, names: names.into_iter().map(String::from).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::UserColumn;
    use crate::figures::Coloring;

    #[test]
    fn kinds_are_numbered_as_legends_list_them() {
        let texts = ["kind10", "kind2", "kind02", "kind10", "kind1"];
        let column = UserColumn::kinds(texts.iter().map(|text| Some((*text).to_owned())).chain([None]));
        let UserColumn::Kinds { of_row, names } = column else { panic!("kinds") };
        assert_eq!(names, ["kind1", "kind02", "kind2", "kind10"]);
        assert_eq!(of_row, [Some(3), Some(2), Some(1), Some(3), Some(0), None]);
        // The colours follow the numbers: a figure that sorted them otherwise would give other ones.
        let coloring = |kinds: &[Option<u32>], names: &[String]| {
            Coloring::Kind { name: "weather".into(), kinds: kinds.to_vec(), names: names.to_vec() }.of_points()
        };
        assert_eq!(coloring(&of_row, &names), coloring(&of_row, &[]));
    }
}
