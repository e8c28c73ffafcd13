//! CSV with a header, separated by commas, semicolons or tabs, plain or compressed by gzip or zstd.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::sync::Arc;

use polars::prelude::{NamedFrom, PlSmallStr, Series};
use polars_io::SerReader;
use polars_io::csv::read::{CsvParseOptions, CsvReadOptions};
use polars_io::utils::compression::{ByteSourceReader, SupportedCompression};

use super::{InputError, damaged, not_a_table};

/// The bytes of a header line that are looked at for its separator.
const HEADER: usize = 1 << 16;

pub(super) fn schema(path: &Path) -> Result<(Vec<String>, BTreeMap<String, String>), InputError> {
    // Only names are asked for. Taken as texts, since polars parses a few rows more than it infers types from.
    let frame = options(path, None)?.with_n_rows(Some(1)).with_infer_schema_length(Some(0));
    let reader = frame.try_into_reader_with_file_path(Some(path.into())).map_err(|error| damaged(path, &error))?;
    let frame = reader.finish().map_err(|error| damaged(path, &error))?;
    let names: Vec<String> = frame.get_column_names().iter().map(ToString::to_string).collect();
    if names.len() < 2 || names.iter().any(|name| name.contains(['\0', '\u{fffd}'])) {
        return Err(not_a_table(path, "a file of another kind"));
    }
    Ok((names, BTreeMap::new()))
}

pub(super) fn read(path: &Path, names: &[String]) -> Result<Vec<Series>, InputError> {
    let fault = |error| damaged(path, &error);
    let columns: Arc<[PlSmallStr]> = names.iter().map(|name| PlSmallStr::from_str(name)).collect();
    // All rows decide a column's type: one fraction after a thousand whole numbers makes a column of floats.
    let options = options(path, Some(columns))?.with_infer_schema_length(None);
    let frame = options.try_into_reader_with_file_path(Some(path.into())).map_err(fault)?.finish().map_err(fault)?;
    let column = |name: &String| {
        let series = frame.column(name).map_err(fault)?.as_materialized_series();
        Ok(numbers(series).unwrap_or_else(|| series.clone()))
    };
    names.iter().map(column).collect()
}

/// A column of texts that are all numbers, `nan` as Python writes it, or empty, as numbers; none of another one. Polars takes a column for texts where nothing is in it, or one
/// `nan` is.
fn numbers(series: &Series) -> Option<Series> {
    let number = |text: Option<&str>| match text.map(str::trim) {
        None | Some("") => Some(None),
        Some(text) => text.parse::<f64>().ok().map(Some),
    };
    let values: Option<Vec<Option<f64>>> = series.str().ok()?.iter().map(number).collect();
    Some(Series::new(series.name().clone(), values?))
}

fn options(path: &Path, columns: Option<Arc<[PlSmallStr]>>) -> Result<CsvReadOptions, InputError> {
    let parse = CsvParseOptions::default().with_separator(separator(path)?);
    Ok(CsvReadOptions::default().with_has_header(true).with_columns(columns).with_parse_options(parse))
}

/// The separator that the header line has most of.
fn separator(path: &Path) -> Result<u8, InputError> {
    let head = head(path)?;
    let line = head.split(|&b| b == b'\n').next().unwrap_or_default();
    if line.contains(&0) {
        return Err(not_a_table(path, "a file of another kind"));
    }
    let count = |separator: u8| line.iter().filter(|&&b| b == separator).count();
    Ok([b'\t', b';', b','].into_iter().max_by_key(|&s| count(s)).unwrap_or(b','))
}

/// The beginning of a file, unpacked.
fn head(path: &Path) -> Result<Vec<u8>, InputError> {
    let mut file = BufReader::new(File::open(path).map_err(InputError::io(path))?);
    let packing = SupportedCompression::check(file.fill_buf().map_err(InputError::io(path))?);
    // What begins as zlib does may be a text: the first column of a table may be called x^2.
    let packing = packing.filter(|packing| *packing != SupportedCompression::ZLIB);
    let mut reader = ByteSourceReader::try_new(file, packing).map_err(|error| damaged(path, &error))?;
    let head = reader.read_next_slice(&Default::default(), HEADER, Some(HEADER));
    Ok(head.map_err(|error| damaged(path, &error))?.0.to_vec())
}
