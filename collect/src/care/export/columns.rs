//! Arrow arrays from plain numbers, as the exported tables need them, and the errors of writing them.

use std::path::Path;
use std::sync::Arc;

use ::parquet::errors::ParquetError;
use arrow::array::{Array, ArrayRef, ArrowPrimitiveType, FixedSizeListArray, PrimitiveArray};
use arrow::datatypes::{DataType, Field};
use arrow::error::ArrowError;

use crate::error::Error;

/// A column of `len` numbers a row: a list of fixed size, or plain numbers where there is one a row and `flat` is asked for.
pub(super) fn numbers<T: ArrowPrimitiveType>(
    values: Vec<T::Native>,
    len: usize,
    flat: bool,
) -> Result<ArrayRef, ArrowError> {
    let values: ArrayRef = Arc::new(PrimitiveArray::<T>::from_iter_values(values));
    if flat && len == 1 { Ok(values) } else { list(values, len) }
}

/// A column of lists of one size.
pub(super) fn list(values: ArrayRef, len: usize) -> Result<ArrayRef, ArrowError> {
    let item = Arc::new(Field::new("item", values.data_type().clone(), true));
    let len = i32::try_from(len).map_err(|_e| ArrowError::InvalidArgumentError(format!("{len} numbers a row")))?;
    Ok(Arc::new(FixedSizeListArray::try_new(item, len, values, None)?))
}

/// A field of the name and type of a column.
pub(super) fn field(name: &str, column: &ArrayRef) -> Field {
    Field::new(
        name,
        column.data_type().clone(),
        column.null_count() > 0 || !matches!(column.data_type(), DataType::Boolean),
    )
}

/// An error of Arrow while a file is written.
pub(super) fn arrow_error(path: &Path) -> impl Fn(ArrowError) -> Error {
    let path = path.to_owned();
    move |error| {
        Error::malformed(path.clone(), error.to_string(), "columns that the format can hold, and a disk with room")
    }
}

/// An error of Parquet while a file is written.
pub(super) fn parquet_error(path: &Path) -> impl Fn(ParquetError) -> Error {
    let path = path.to_owned();
    move |error| {
        Error::malformed(path.clone(), error.to_string(), "columns that the format can hold, and a disk with room")
    }
}
