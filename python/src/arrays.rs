//! Numbers on their way to numpy: whole columns of a mapped file as they lie there, and vectors handed over without a copy. And on their way from there:
//! copied, because Python may write to its arrays while the interpreter's lock is given away.
//!
//! A [`Column`] shows itself by numpy's `__array_interface__`, read-only, and holds the file's pages as long as an array looks at them.

use arrow::array::{ArrayRef, AsArray};
use arrow::buffer::Buffer;
use arrow::datatypes::{Float32Type, Float64Type};
use numpy::ndarray::Dimension;
use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// A read-only block of numbers in memory that somebody else owns.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct Column {
    buffer: Buffer,
    shape: Vec<usize>,
    typestr: &'static str,
}

#[pymethods]
impl Column {
    /// What numpy asks for: <https://numpy.org/doc/stable/reference/arrays.interface.html>.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("typestr", self.typestr)?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        interface.set_item("data", (self.buffer.as_ptr() as usize, true))?;
        Ok(interface)
    }
}

/// The first rows of a column of numbers, lists of numbers or bytes as an array `shape` over its own memory. None for a column of another type or
/// fewer numbers.
pub(crate) fn shared<'py>(
    py: Python<'py>,
    column: &ArrayRef,
    shape: Vec<usize>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let list = column.as_fixed_size_list_opt();
    let numbers = list.map_or(column, |list| list.values());
    let found = if let Some(bytes) = numbers.as_fixed_size_binary_opt() {
        Some((bytes.values().clone(), "|u1", 1))
    } else if let Some(singles) = numbers.as_primitive_opt::<Float32Type>() {
        Some((singles.values().inner().clone(), "<f4", 4))
    } else {
        numbers.as_primitive_opt::<Float64Type>().map(|doubles| (doubles.values().inner().clone(), "<f8", 8))
    };
    let Some((buffer, typestr, width)) = found else { return Ok(None) };
    if buffer.len() < shape.iter().product::<usize>() * width {
        return Ok(None);
    }
    let column = Bound::new(py, Column { buffer, shape, typestr })?;
    py.import("numpy")?.call_method1("asarray", (column,)).map(Some)
}

/// The numbers of an array, row after row whatever its strides, as a copy of ours. The interpreter's lock is held meanwhile, so that callers in Python lay
/// their numbers out in this order first, which makes it one move of memory.
pub(crate) fn owned<T: Element + Copy, D: Dimension>(array: &PyReadonlyArray<'_, T, D>) -> Vec<T> {
    let view = array.as_array();
    // A slice only of rows one after the other: numpy counts columns one after the other as contiguous, too.
    match view.as_slice() {
        Some(numbers) => numbers.to_vec(),
        None => view.iter().copied().collect(),
    }
}

/// A vector as an array of this shape.
pub(crate) fn shaped<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, values).reshape(shape)
}
