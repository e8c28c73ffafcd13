//! Writing numbers: JSON documents that say where they come from, and Arrow tables.

mod graph_table;
mod map_table;
mod tables;

use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

pub use graph_table::GraphTable;
pub use map_table::MapTable;
pub use tables::{Column, write_csv, write_parquet, write_table};

/// `numbers` as a JSON object whose first field `about` says where they come from.
///
/// # Errors
/// Numbers that are no JSON object.
pub fn document(about: &Value, numbers: &impl Serialize) -> Result<Value, serde_json::Error> {
    let mut fields = Map::from_iter([("about".to_string(), about.clone())]);
    if let Value::Object(numbers) = serde_json::to_value(numbers)? {
        fields.extend(numbers);
    }
    Ok(Value::Object(fields))
}

/// Writes a JSON document whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write_json(path: &Path, document: &Value) -> Result<(), vibes_data::Error> {
    vibes_data::write_atomically(path, format!("{document:#}\n").as_bytes())
}
