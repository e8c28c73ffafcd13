//! From the arrays of a foreign file to a polars column: half precision becomes single, a dictionary becomes its values, and what no number, text,
//! truth value or list of numbers is, is named.

use std::path::Path;

use polars::prelude::{ArrowDataType, PlSmallStr, PolarsResult, Series};
use polars_arrow::array::{
    Array, DictionaryArray, DictionaryKey, FixedSizeListArray, ListArray, PrimitiveArray, Utf8ViewArray,
};
use polars_arrow::datatypes::Field;
use polars_arrow::offset::Offset;
use polars_compute::cast::cast_default;
use polars_utils::float16::pf16;

use super::{InputError, column, damaged};

/// One column from its chunks.
pub(super) fn series(path: &Path, name: &str, chunks: Vec<Box<dyn Array>>) -> Result<Series, InputError> {
    if let Some(kind) = chunks.iter().map(|chunk| chunk.dtype()).find(|kind| !is_plain(kind)) {
        let expected = "numbers, texts, truth values or lists of numbers";
        return Err(column(path, name, format!("it holds {}", word(kind)), expected));
    }
    let fault = |error| damaged(path, &error);
    let chunks = chunks.iter().map(|chunk| plain(chunk.as_ref())).collect::<PolarsResult<Vec<_>>>().map_err(fault)?;
    if chunks.is_empty() {
        return Ok(Series::new_empty(PlSmallStr::from_str(name), &polars::prelude::DataType::Null));
    }
    Series::try_from((PlSmallStr::from_str(name), chunks)).map_err(fault)
}

/// What this program has a use for.
fn is_plain(kind: &ArrowDataType) -> bool {
    use ArrowDataType as A;
    match kind {
        A::Null | A::Boolean | A::Utf8 | A::LargeUtf8 | A::Utf8View => true,
        A::Int8 | A::Int16 | A::Int32 | A::Int64 | A::UInt8 | A::UInt16 | A::UInt32 | A::UInt64 => true,
        A::Float16 | A::Float32 | A::Float64 => true,
        A::Dictionary(_, values, _) => is_plain(values),
        A::List(item) | A::LargeList(item) | A::FixedSizeList(item, _) => is_plain(&item.dtype),
        _ => false,
    }
}

/// A type's name without its parameters.
fn word(kind: &ArrowDataType) -> String {
    format!("{kind:?}").split(['(', ' ', '{']).next().unwrap_or_default().to_string()
}

fn plain(array: &dyn Array) -> PolarsResult<Box<dyn Array>> {
    use ArrowDataType as A;
    Ok(match array.dtype() {
        A::Float16 => single(array),
        // Polars is built without its narrow integers.
        A::Int8 | A::Int16 => cast_default(array, &A::Int32)?,
        A::UInt8 | A::UInt16 => cast_default(array, &A::UInt32)?,
        A::Dictionary(..) => dictionary(array)?,
        A::List(_) => list::<i32>(array)?,
        A::LargeList(_) => list::<i64>(array)?,
        A::FixedSizeList(_, width) => match array.as_any().downcast_ref::<FixedSizeListArray>() {
            Some(lists) => {
                let values = plain(lists.values().as_ref())?;
                let kind = A::FixedSizeList(Box::new(item(values.as_ref())), *width);
                FixedSizeListArray::try_new(kind, lists.len(), values, lists.validity().cloned())?.boxed()
            }
            None => array.to_boxed(),
        },
        _ => array.to_boxed(),
    })
}

/// A dictionary's values in the order of its keys: texts, or numbers in double precision.
fn dictionary(array: &dyn Array) -> PolarsResult<Box<dyn Array>> {
    let keyed = keys_of::<u8>(array).or_else(|| keys_of::<i8>(array)).or_else(|| keys_of::<u16>(array));
    let keyed = keyed.or_else(|| keys_of::<i16>(array)).or_else(|| keys_of::<u32>(array));
    let keyed = keyed.or_else(|| keys_of::<i32>(array)).or_else(|| keys_of::<u64>(array));
    let Some((keys, values)) = keyed.or_else(|| keys_of::<i64>(array)) else { return Ok(array.to_boxed()) };
    let values = plain(values.as_ref())?;
    if is_text(values.dtype()) {
        let texts = cast_default(values.as_ref(), &ArrowDataType::Utf8View)?;
        let Some(texts) = texts.as_any().downcast_ref::<Utf8ViewArray>() else { return Ok(array.to_boxed()) };
        let chosen: Vec<Option<&str>> = keys.iter().map(|key| texts.get((*key)?)).collect();
        return Ok(Utf8ViewArray::from_slice(&chosen).boxed());
    }
    let numbers = cast_default(values.as_ref(), &ArrowDataType::Float64)?;
    let Some(numbers) = numbers.as_any().downcast_ref::<PrimitiveArray<f64>>() else { return Ok(array.to_boxed()) };
    let number = |key: usize| (key < numbers.len() && numbers.is_valid(key)).then(|| numbers.value(key));
    let chosen: Vec<Option<f64>> = keys.iter().map(|key| number((*key)?)).collect();
    Ok(PrimitiveArray::from(chosen).boxed())
}

/// Keys, and the values that they are of.
type Keyed = (Vec<Option<usize>>, Box<dyn Array>);

/// The keys of a dictionary, if they are of this type, with its values.
fn keys_of<K: DictionaryKey>(array: &dyn Array) -> Option<Keyed> {
    let dictionary = array.as_any().downcast_ref::<DictionaryArray<K>>()?;
    Some((dictionary.keys_iter().collect(), dictionary.values().clone()))
}

fn is_text(kind: &ArrowDataType) -> bool {
    matches!(kind, ArrowDataType::Utf8 | ArrowDataType::LargeUtf8 | ArrowDataType::Utf8View)
}

fn list<O: Offset>(array: &dyn Array) -> PolarsResult<Box<dyn Array>> {
    let Some(lists) = array.as_any().downcast_ref::<ListArray<O>>() else { return Ok(array.to_boxed()) };
    let values = plain(lists.values().as_ref())?;
    let kind = ListArray::<O>::default_datatype(values.dtype().clone());
    Ok(ListArray::try_new(kind, lists.offsets().clone(), values, lists.validity().cloned())?.boxed())
}

fn item(values: &dyn Array) -> Field {
    Field::new(PlSmallStr::from_static("item"), values.dtype().clone(), true)
}

fn single(array: &dyn Array) -> Box<dyn Array> {
    let Some(halves) = array.as_any().downcast_ref::<PrimitiveArray<pf16>>() else { return array.to_boxed() };
    let values: Vec<f32> = halves.values().iter().map(|half| half.0.to_f32()).collect();
    PrimitiveArray::from_vec(values).with_validity(halves.validity().cloned()).boxed()
}
