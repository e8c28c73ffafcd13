//! The pages of a Parquet file's columns, looked at before one is decoded. In: an open file. Out: an error where a page says that it has more values
//! than its bytes can hold.
//!
//! The decoders of dictionaries and of texts by differences make room for as many values as a page names.

use std::fs::File;
use std::sync::Arc;

use ::parquet::basic::Encoding;
use ::parquet::column::page::{Page, PageReader as _};
use ::parquet::errors::{ParquetError, Result};
use ::parquet::file::metadata::ParquetMetaData;
use ::parquet::file::serialized_reader::SerializedPageReader;
use ::parquet::schema::types::ColumnDescriptor;

use super::footer::{number, skip};

/// Values that a byte of differences stands for at most: blocks of equal lengths, the longest that a known writer makes being `DuckDB`'s, 2048 values
/// in nine bytes.
const TIGHTEST: usize = 1024;

/// Checks every page of a column, the one at this place of the schema's outermost level.
pub(super) fn check(file: &Arc<File>, metadata: &ParquetMetaData, place: usize) -> Result<()> {
    let schema = metadata.file_metadata().schema_descr();
    for leaf in (0..schema.num_columns()).filter(|leaf| schema.get_column_root_idx(*leaf) == place) {
        for group in metadata.row_groups() {
            let rows = usize::try_from(group.num_rows())?;
            let mut pages = SerializedPageReader::new(Arc::clone(file), group.column(leaf), rows, None)?;
            while let Some(page) = pages.get_next_page()? {
                is_sound(&page, schema.column(leaf).as_ref())
                    .ok_or_else(|| ParquetError::General("a page names more values than it has room for".into()))?;
            }
        }
    }
    Ok(())
}

fn is_sound(page: &Page, shape: &ColumnDescriptor) -> Option<()> {
    let named = page.num_values() as usize;
    match page.encoding() {
        Encoding::DELTA_LENGTH_BYTE_ARRAY => differences(&mut values(page, shape)?, named),
        Encoding::DELTA_BYTE_ARRAY => {
            let mut values = values(page, shape)?;
            differences(&mut values, named)?;
            differences(&mut values, named)
        }
        _ => (!page.is_dictionary_page() || named <= page.buffer().len()).then_some(()),
    }
}

/// A data page without its levels, which say where lists begin and values are missing.
fn values<'a>(page: &'a Page, shape: &ColumnDescriptor) -> Option<&'a [u8]> {
    let mut rest = page.buffer().as_ref();
    match page {
        Page::DataPageV2 { def_levels_byte_len, rep_levels_byte_len, .. } => {
            skip(&mut rest, *rep_levels_byte_len as usize)?;
            skip(&mut rest, *def_levels_byte_len as usize)?;
        }
        Page::DataPage { num_values, rep_level_encoding, def_level_encoding, .. } => {
            let levels = [(shape.max_rep_level(), rep_level_encoding), (shape.max_def_level(), def_level_encoding)];
            for (highest, encoding) in levels.into_iter().filter(|(highest, _)| *highest > 0) {
                let bits = (i16::BITS - highest.leading_zeros()) as usize;
                let length = match encoding {
                    Encoding::RLE => 4 + u32::from_le_bytes(rest.first_chunk().copied()?) as usize,
                    _ => (*num_values as usize * bits).div_ceil(8),
                };
                skip(&mut rest, length)?;
            }
        }
        Page::DictionaryPage { .. } => {}
    }
    Some(rest)
}

/// Reads over numbers that are stored by their differences (`DELTA_BINARY_PACKED` of Parquet's `Encodings.md`), at most `most` of them.
fn differences(rest: &mut &[u8], most: usize) -> Option<()> {
    let all = rest.len();
    let (block, parts, count) = (number(rest)?, number(rest)?, number(rest)?);
    let part = block.checked_div(parts)?;
    let fits = count <= most && count <= TIGHTEST.checked_mul(all)? && part > 0;
    number(rest).filter(|_| fits)?;
    let mut left = count.saturating_sub(1);
    while left > 0 {
        number(rest)?;
        let widths = rest.get(..parts)?;
        skip(rest, parts)?;
        for width in widths {
            if left > 0 {
                skip(rest, usize::from(*width).checked_mul(part)? / 8)?;
            }
            left = left.saturating_sub(part);
        }
    }
    Some(())
}
