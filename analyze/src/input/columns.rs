//! A user's own column of a table: numbers, or kinds with names.

use std::collections::BTreeMap;
use std::path::Path;

use polars::prelude::{DataType, PolarsError, Series};

use super::InputError;
use super::tables::column;

/// One value a row.
#[derive(Clone, Debug, PartialEq)]
pub enum UserColumn {
    /// Numbers; NaN where there is none.
    Numbers(Vec<f64>),
    /// Texts and truth values.
    Kinds {
        /// The kind of every row; none where there is none.
        of_row: Vec<Option<u32>>,
        /// What the kinds are called.
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

    /// Kinds are numbered in the order of their names.
    fn kinds(texts: impl Iterator<Item = Option<String>>) -> Self {
        let texts: Vec<Option<String>> = texts.collect();
        let mut numbers: BTreeMap<&str, u32> = texts.iter().flatten().map(|text| (text.as_str(), 0)).collect();
        numbers.values_mut().enumerate().for_each(|(i, number)| *number = i as u32);
        let of_row = texts.iter().map(|text| text.as_deref().and_then(|text| numbers.get(text).copied())).collect();
        let names = numbers.keys().map(ToString::to_string).collect();
        Self::Kinds { of_row, names }
    }
}
