//! The latents of a table as one block of numbers: from lists of any kind, from numbered columns, or from lists that a CSV file holds as text.
//!
//! Latents are single precision from here on. Where that would lose what tells them apart, because they lie close together far from the origin, their
//! mean leaves first, in double precision.

use std::path::Path;

use super::InputError;
use super::tables::column;
use polars::prelude::{DataType, PolarsError, Series};
use vibes_data::Latents;

const EXPECTED: &str = "a list of numbers of one length in every row";
/// A mean this many standard deviations from the origin leaves less than three digits to single precision.
const FAR: f64 = 1e4;

/// What was taken away from every row of a table of latents before they became single precision: nothing from most. Two tables are of one space only
/// about one origin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// `[dims]`, empty where nothing was taken away.
    mean: Vec<f64>,
}

impl Origin {
    /// Moves latents that lie about this origin to another, that of the latents they are compared with.
    pub fn move_to(&self, other: &Self, latents: &mut Latents) {
        if self == other {
            return;
        }
        let at = |origin: &Self, dim: usize| origin.mean.get(dim).copied().unwrap_or(0.0);
        let shift: Vec<f64> = (0..latents.dims).map(|dim| at(self, dim) - at(other, dim)).collect();
        for row in latents.latent.chunks_exact_mut(latents.dims.max(1)) {
            row.iter_mut().zip(&shift).for_each(|(v, by)| *v = (f64::from(*v) + by) as f32);
        }
    }
}

/// Latents in single precision.
#[derive(Debug)]
pub(super) struct Narrowed {
    pub(super) dims: usize,
    /// `[rows, dims]`.
    pub(super) latent: Vec<f32>,
    /// What was taken away from them.
    pub(super) origin: Origin,
    /// What must be said about it.
    pub(super) remark: Option<String>,
}

/// Numbers, `[rows, dims]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lists {
    dims: usize,
    values: Values,
}

#[derive(Clone, Debug, PartialEq)]
enum Values {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

impl Lists {
    /// From one column of lists, or from several columns of numbers.
    pub(super) fn read(columns: &[Series], path: &Path) -> Result<Self, InputError> {
        match columns {
            [lists] if lists.name().as_str() == "latent" => Self::of_lists(lists, path),
            columns => Self::of_columns(columns, path),
        }
    }

    fn of_columns(columns: &[Series], path: &Path) -> Result<Self, InputError> {
        let dims = columns.len();
        let rows = columns.first().map_or(0, |column| column.len());
        let mut values = vec![0.0; rows * dims];
        for (dim, series) in columns.iter().enumerate() {
            for (row, value) in doubles(series, series.name(), path)?.into_iter().enumerate() {
                values[row * dims + dim] = value;
            }
        }
        Ok(Self { dims, values: Values::Double(values) })
    }

    fn of_lists(lists: &Series, path: &Path) -> Result<Self, InputError> {
        let fault = |fact: String| column(path, "latent", fact, EXPECTED);
        let broken = |error: PolarsError| fault(error.to_string());
        if lists.null_count() > 0 && !lists.dtype().is_null() {
            return Err(fault(format!("nothing in {} rows", lists.null_count())));
        }
        let (dims, inner) = match lists.dtype() {
            DataType::Array(_, dims) => (*dims, lists.array().map_err(broken)?.get_inner()),
            DataType::List(_) => {
                let lists = lists.list().map_err(broken)?.rechunk();
                let array = lists.downcast_as_array();
                let offsets = array.offsets();
                let lengths: Vec<usize> = offsets.lengths().collect();
                let dims = lengths.first().copied().unwrap_or(0);
                if let Some(other) = lengths.iter().find(|&&length| length != dims) {
                    return Err(fault(format!("lists of {dims} and of {other} numbers")));
                }
                (dims, lists.get_inner().slice(*offsets.first(), dims * array.len()))
            }
            DataType::String => return Self::of_texts(lists, path),
            other => return Err(fault(format!("it holds {other}"))),
        };
        if !inner.dtype().is_primitive_numeric() {
            return Err(fault(format!("it holds lists of {}", inner.dtype())));
        }
        if inner.null_count() > 0 {
            return Err(fault(format!("{} missing numbers inside lists", inner.null_count())));
        }
        let narrow = matches!(inner.dtype(), DataType::Float32 | DataType::Int8 | DataType::Int16 | DataType::UInt8);
        let values = if narrow || inner.dtype() == &DataType::UInt16 {
            let single = inner.cast(&DataType::Float32).map_err(broken)?;
            Values::Single(single.f32().map_err(broken)?.into_no_null_iter().collect())
        } else {
            Values::Double(doubles(&inner, "latent", path)?)
        };
        Ok(Self { dims, values })
    }

    /// Lists as pandas writes them into CSV: `[0.5, 1.5]`, or with blanks between the numbers.
    fn of_texts(lists: &Series, path: &Path) -> Result<Self, InputError> {
        let fault = |fact: String| column(path, "latent", fact, EXPECTED);
        let (mut dims, mut values) = (None, Vec::new());
        for text in lists.str().map_err(|error| fault(error.to_string()))?.iter().flatten() {
            let inside = text.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')']);
            let numbers = inside.split([',', ' ', '\n', '\t', ';']).filter(|word| !word.is_empty());
            let before = values.len();
            for word in numbers {
                values.push(word.parse().map_err(|_e| fault(format!("{word:?} in a list is no number")))?);
            }
            let length = values.len() - before;
            if *dims.get_or_insert(length) != length {
                return Err(fault(format!("lists of {} and of {length} numbers", dims.unwrap_or(0))));
            }
        }
        Ok(Self { dims: dims.unwrap_or(0), values: Values::Double(values) })
    }

    /// The rows that are kept, in single precision.
    pub(super) fn narrow(self, kept: Option<&[u32]>) -> Narrowed {
        let dims = self.dims;
        match self.values {
            Values::Single(values) => {
                Narrowed { dims, latent: rows(values, dims, kept), origin: Origin::default(), remark: None }
            }
            Values::Double(values) => {
                let mut values = rows(values, dims, kept);
                let (mean, remark) = center(&mut values, dims).unzip();
                let origin = Origin { mean: mean.unwrap_or_default() };
                Narrowed { dims, latent: values.into_iter().map(|v| v as f32).collect(), origin, remark }
            }
        }
    }
}

fn rows<T: Copy>(values: Vec<T>, dims: usize, kept: Option<&[u32]>) -> Vec<T> {
    let Some(kept) = kept else { return values };
    kept.iter().flat_map(|&row| values[row as usize * dims..(row as usize + 1) * dims].iter().copied()).collect()
}

/// Takes the mean away where single precision would lose what tells the rows apart, and gives it with what must be said about it.
fn center(values: &mut [f64], dims: usize) -> Option<(Vec<f64>, String)> {
    let rows = values.len().checked_div(dims).filter(|&rows| rows > 1)?;
    let mut means = vec![0.0; dims];
    for row in values.chunks_exact(dims) {
        means.iter_mut().zip(row).for_each(|(mean, v)| *mean += v / rows as f64);
    }
    let mut squares = vec![0.0; dims];
    for row in values.chunks_exact(dims) {
        squares.iter_mut().zip(row).zip(&means).for_each(|((square, v), mean)| *square += (v - mean).powi(2));
    }
    // Rounding of the mean leaves a constant dimension a deviation just above zero, beside which everything is far.
    let varies = |dim: usize| values.chunks_exact(dims).any(|row| row[dim] != values[dim]);
    let is_far = |dim: &usize| means[*dim].abs() > FAR * (squares[*dim] / rows as f64).sqrt() && varies(*dim);
    let far = (0..dims).filter(is_far).count();
    if far == 0 || !means.iter().all(|mean| mean.is_finite()) {
        return None;
    }
    for row in values.chunks_exact_mut(dims) {
        row.iter_mut().zip(&means).for_each(|(v, mean)| *v -= mean);
    }
    let remark = format!(
        "{far} of the {dims} dimensions lie more than 10,000 standard deviations from the origin: the mean of all rows was taken away before the latents \
         became single precision (differences of latents are the same; cosines are now about the mean)"
    );
    Some((means, remark))
}

fn doubles(series: &Series, name: &str, path: &Path) -> Result<Vec<f64>, InputError> {
    let fault = |fact: String| column(path, name, fact, "a number in every row");
    if !series.dtype().is_primitive_numeric() {
        return Err(fault(format!("it holds {}", series.dtype())));
    }
    if series.null_count() > 0 {
        return Err(fault(format!("nothing in {} rows", series.null_count())));
    }
    let wide = series.cast(&DataType::Float64).map_err(|error| fault(error.to_string()))?;
    let wide = wide.f64().map_err(|error| fault(error.to_string()))?;
    Ok(wide.into_no_null_iter().collect())
}

/// Double precision made single.
#[cfg(test)]
fn of(values: Vec<f64>, dims: usize) -> Narrowed {
    Lists { dims, values: Values::Double(values) }.narrow(None)
}

/// From the least to the largest number of a dimension.
#[cfg(test)]
fn spread(values: &[f32], dims: usize, dim: usize) -> f32 {
    let column = values.iter().skip(dim).step_by(dims).copied();
    column.clone().fold(f32::NEG_INFINITY, f32::max) - column.fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_tells_rows_apart_survives_far_from_the_origin() {
        let near: Vec<f64> = (0..40).map(|i| f64::from(i * 37 % 41)).collect();
        let far: Vec<f64> = near.iter().map(|x| x * 1e-7 + 1000.0).collect();
        let Narrowed { latent: narrowed, remark: said, .. } = of(far, 2);
        assert!(said.is_some_and(|said| said.contains("2 of the 2 dimensions")));
        let scale = spread(&narrowed, 2, 0) / spread(&near.iter().map(|&x| x as f32).collect::<Vec<_>>(), 2, 0);
        for (a, b) in narrowed.chunks_exact(2).zip(near.chunks_exact(2)) {
            let (a0, b0) = (narrowed[0], near[0] as f32);
            assert!(((a[0] - a0) / scale - (b[0] as f32 - b0)).abs() < 1e-3, "{a:?} {b:?}");
        }
    }

    /// The mean of a constant, added up, is a rounding away from it.
    #[test]
    fn a_constant_dimension_is_not_far() {
        let values: Vec<f64> = (0..80).flat_map(|i| [f64::from(i * 37 % 41), 0.7]).collect();
        let Narrowed { latent: narrowed, remark: said, .. } = of(values.clone(), 2);
        assert_eq!(said, None);
        assert!(narrowed.iter().zip(&values).all(|(a, b)| *a == *b as f32));
    }

    #[test]
    fn latents_near_the_origin_stay_as_they_are() {
        let values: Vec<f64> = (0..20).map(|i| f64::from(i) / 8.0 + 3.0).collect();
        let Narrowed { latent: narrowed, remark: said, .. } = of(values.clone(), 4);
        assert_eq!(said, None);
        assert!(narrowed.iter().zip(&values).all(|(a, b)| f64::from(*a) == *b));
    }
}
