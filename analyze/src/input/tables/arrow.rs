//! Arrow IPC files and streams (Feather, polars, pandas, `DuckDB`), with LZ4 or zstd compression.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use polars::prelude::{PolarsResult, Series};
use polars_arrow::array::Array;
use polars_arrow::datatypes::{ArrowSchema, Metadata};
use polars_arrow::io::ipc::read::{FileReader, StreamReader, StreamState, read_file_metadata, read_stream_metadata};

use super::lengths::check;
use super::plain::series;
use super::{InputError, damaged};

type Names = (Vec<String>, BTreeMap<String, String>);

pub(super) fn schema(path: &Path, stream: bool) -> Result<Names, InputError> {
    check(path, stream)?;
    let mut file = open(path)?;
    let fault = |error| damaged(path, &error);
    let (schema, metadata) = if stream {
        let read = read_stream_metadata(&mut file).map_err(fault)?;
        (read.schema, read.custom_schema_metadata.map(|m| texts(&m)))
    } else {
        let read = read_file_metadata(&mut file).map_err(fault)?;
        (read.schema.as_ref().clone(), read.custom_schema_metadata.map(|m| texts(&m)))
    };
    Ok((schema.iter_names().map(|name| name.to_string()).collect(), metadata.unwrap_or_default()))
}

fn texts(metadata: &Metadata) -> BTreeMap<String, String> {
    metadata.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect()
}

fn open(path: &Path) -> Result<BufReader<File>, InputError> {
    File::open(path).map(BufReader::new).map_err(InputError::io(path))
}

pub(super) fn read(path: &Path, stream: bool, names: &[String]) -> Result<Vec<Series>, InputError> {
    let mut file = open(path)?;
    let fault = |error| damaged(path, &error);
    let mut chunks: Vec<Vec<Box<dyn Array>>> = vec![Vec::new(); names.len()];
    let mut take = |order: &[usize], arrays: &[Box<dyn Array>]| {
        for (&at, array) in order.iter().zip(arrays) {
            chunks[at].push(array.clone());
        }
    };
    if stream {
        let metadata = read_stream_metadata(&mut file).map_err(fault)?;
        let (projection, order) = projection(&metadata.schema, names);
        stream_batches(StreamReader::new(file, metadata, Some(projection)), |arrays| take(&order, arrays))
            .map_err(fault)?;
    } else {
        let metadata = read_file_metadata(&mut file).map_err(fault)?;
        let (projection, order) = projection(&metadata.schema, names);
        for batch in FileReader::new(file, metadata, Some(projection), None) {
            take(&order, batch.map_err(fault)?.arrays());
        }
    }
    names.iter().zip(chunks).map(|(name, chunks)| series(path, name, chunks)).collect()
}

/// The arrays of the only column of a stream in memory.
pub(super) fn only_column(path: &Path, stream: &[u8]) -> Result<Vec<Box<dyn Array>>, InputError> {
    let fault = |error| damaged(path, &error);
    let mut stream = Cursor::new(stream);
    let metadata = read_stream_metadata(&mut stream).map_err(fault)?;
    let mut chunks = Vec::new();
    let take = |arrays: &[Box<dyn Array>]| chunks.extend(arrays.iter().cloned());
    stream_batches(StreamReader::new(stream, metadata, None), take).map_err(fault)?;
    Ok(chunks)
}

/// Hands on the columns of batch after batch.
fn stream_batches(stream: StreamReader<impl Read + Seek>, mut take: impl FnMut(&[Box<dyn Array>])) -> PolarsResult<()> {
    for state in stream {
        match state? {
            StreamState::Some(batch) => take(batch.arrays()),
            // The file ends without a mark of the stream's end, as it may. The reader would wait for more of it for ever.
            StreamState::Waiting => break,
        }
    }
    Ok(())
}

/// The columns' places in the file, rising, and for each which of the names it is.
fn projection(schema: &ArrowSchema, names: &[String]) -> (Vec<usize>, Vec<usize>) {
    let mut places: Vec<(usize, usize)> =
        names.iter().enumerate().filter_map(|(at, name)| Some((schema.index_of(name)?, at))).collect();
    places.sort_unstable();
    places.into_iter().unzip()
}
