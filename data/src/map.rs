//! A memory-mapped Arrow file. Every offset and length in it is checked against the file before Arrow follows them, since a
//! file may be truncated, damaged or hostile. Out: the schema and the record batches, whose buffers are the mapped pages.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow::buffer::Buffer;
use arrow::datatypes::{DataType, Fields, Schema, SchemaRef};
use arrow::ipc::convert::fb_to_schema;
use arrow::ipc::reader::{FileDecoder, read_footer_length};
use arrow::ipc::{Block, FieldNode, MetadataVersion, root_as_footer, root_as_message};
use arrow::record_batch::RecordBatch;
use memmap2::Mmap;
#[cfg(unix)]
use memmap2::UncheckedAdvice;

use crate::{Error, Result};

/// The record batches of any Arrow file of numbers, lists of fixed size, structs, texts and bytes, uncompressed, in its mapped
/// pages: for the files of other datasets.
///
/// # Errors
/// [`Error::Malformed`] for a damaged file, compression, or types that are none of these.
pub fn read_table(path: &Path) -> Result<Vec<RecordBatch>> {
    let table = MappedTable::open(path)?;
    (0..table.batches()).map(|index| table.batch(index)).collect()
}

/// The last bytes of an Arrow file: footer length and magic.
const TRAILER: usize = 10;

/// The mapped pages of a file, shared by everything that looks into them.
#[derive(Clone, Debug)]
pub(crate) struct Pages {
    map: Arc<Mmap>,
    path: Arc<Path>,
}

impl Pages {
    /// The file, for messages about what stands in it.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the memory of the pages back until they are looked at again. The system would do so itself once memory is short, but until then a program that
    /// has looked at all of a large recording seems to hold all of it.
    pub(crate) fn release(&self) {
        #[cfg(unix)]
        #[allow(unsafe_code, reason = "the advice could lose what was written to private pages")]
        // SAFETY: the pages are a shared, read-only map of a file; the next look finds the same bytes in it.
        let _only_a_wish = unsafe { self.map.unchecked_advise(UncheckedAdvice::DontNeed) };
    }
}

impl AsRef<[u8]> for Pages {
    fn as_ref(&self) -> &[u8] {
        &self.map
    }
}

/// An open Arrow file.
#[derive(Debug)]
pub(crate) struct MappedTable {
    pages: Pages,
    buffer: Buffer,
    schema: SchemaRef,
    version: MetadataVersion,
    blocks: Vec<Block>,
}

impl MappedTable {
    /// Maps a file and reads its footer.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        // Asked before it is opened: opening a pipe would wait for its writer for ever.
        let metadata = std::fs::metadata(path).map_err(Error::io("open", path))?;
        if !metadata.is_file() {
            return Err(Error::malformed(path, "not a file", "a whole Arrow file"));
        }
        let file = File::open(path).map_err(Error::io("open", path))?;
        let length = metadata.len();
        if length < 2 * TRAILER as u64 {
            return Err(Error::malformed(path, format!("{length} bytes"), "a whole Arrow file"));
        }
        #[allow(unsafe_code, reason = "mapping a file is unsafe because another process could change it")]
        // SAFETY: files of a recording are renamed into place when finished and never written again.
        let pages = unsafe { Mmap::map(&file) }.map_err(Error::io("map", path))?;
        let pages = Pages { map: Arc::new(pages), path: path.into() };
        let buffer = Buffer::from(bytes::Bytes::from_owner(pages.clone()));
        let broken = |fact: String| Error::malformed(path, fact, "a whole Arrow file");
        let start = buffer.len() - TRAILER;
        let mut trailer = [0; TRAILER];
        trailer.copy_from_slice(&buffer[start..]);
        let footer_length = read_footer_length(trailer).map_err(|error| broken(error.to_string()))?;
        let footer_start =
            start.checked_sub(footer_length).ok_or_else(|| broken("a footer longer than the file".into()))?;
        let footer = root_as_footer(&buffer[footer_start..start])
            .map_err(|error| broken(format!("a damaged footer ({error})")))?;
        let schema = footer.schema().ok_or_else(|| broken("no schema".into()))?;
        if schema.fields().is_none() || footer.dictionaries().is_some_and(|list| !list.is_empty()) {
            return Err(broken("a schema without fields, or dictionaries".into()));
        }
        let blocks: Vec<Block> = footer.recordBatches().iter().flatten().copied().collect();
        let version = footer.version();
        let schema = checked_schema(schema).ok_or_else(|| broken("a schema of unknown types".into()))?;
        Ok(Self { pages, buffer: buffer.clone(), schema: Arc::new(schema), version, blocks })
    }

    pub(crate) fn schema(&self) -> SchemaRef {
        self.schema.clone()
    }

    /// The pages that the record batches lie in.
    pub(crate) fn pages(&self) -> Pages {
        self.pages.clone()
    }

    pub(crate) fn batches(&self) -> usize {
        self.blocks.len()
    }

    /// One record batch, its buffers in the mapped pages.
    pub(crate) fn batch(&self, index: usize) -> Result<RecordBatch> {
        let broken = |fact: String| Error::malformed(self.pages.path(), fact, "a whole Arrow file");
        let block = self.blocks.get(index).ok_or_else(|| broken("no rows".into()))?;
        let slice = self.block_slice(block).ok_or_else(|| broken("a record batch outside the file".into()))?;
        if !message_is_sound(&slice, block, self.schema.fields()) {
            return Err(broken("a damaged record batch".into()));
        }
        FileDecoder::new(self.schema(), self.version)
            .read_record_batch(block, &slice)
            .map_err(|error| broken(error.to_string()))?
            .ok_or_else(|| broken("an empty record batch".into()))
    }

    fn block_slice(&self, block: &Block) -> Option<Buffer> {
        let offset = usize::try_from(block.offset()).ok()?;
        let length =
            usize::try_from(block.bodyLength()).ok()?.checked_add(usize::try_from(block.metaDataLength()).ok()?)?;
        let end = offset.checked_add(length)?;
        (end <= self.buffer.len() && length >= 8).then(|| self.buffer.slice_with_length(offset, length))
    }
}

/// Flatbuffers check offsets, not meaning: a type may lack its parameters, and the conversion panics on some of those.
fn checked_schema(schema: arrow::ipc::Schema<'_>) -> Option<Schema> {
    fn field_is_sound(field: arrow::ipc::Field<'_>, depth: usize) -> bool {
        use arrow::ipc::Type;
        let children: Vec<_> = field.children().iter().flatten().collect();
        let shape = match field.type_type() {
            Type::Int => field.type_as_int().is_some_and(|int| matches!(int.bitWidth(), 8 | 16 | 32 | 64)),
            Type::FloatingPoint => {
                field.type_as_floating_point().is_some_and(|float| (0..=2).contains(&float.precision().0))
            }
            Type::FixedSizeBinary => field.type_as_fixed_size_binary().is_some_and(|binary| binary.byteWidth() >= 0),
            Type::FixedSizeList => {
                field.type_as_fixed_size_list().is_some_and(|list| list.listSize() >= 0) && children.len() == 1
            }
            Type::Bool | Type::Struct_ | Type::Binary | Type::Utf8 => true,
            _ => false,
        };
        shape
            && field.dictionary().is_none()
            && depth < 8
            && children.into_iter().all(|child| field_is_sound(child, depth + 1))
    }
    let fields = schema.fields()?;
    fields.iter().all(|field| field_is_sound(field, 0)).then(|| fb_to_schema(schema))
}

/// Whether a record batch's header is where the block says, its buffers lie inside its body, and each is long enough for its
/// column: Arrow's decoder asserts what it does not check.
fn message_is_sound(slice: &[u8], block: &Block, fields: &Fields) -> bool {
    let continuation = slice[..4] == [0xff; 4];
    let start = if continuation { 8 } else { 4 };
    let metadata = usize::try_from(block.metaDataLength()).unwrap_or(0);
    let Some(header) = slice.get(start..metadata) else { return false };
    let Ok(message) = root_as_message(header) else { return false };
    let Some(batch) = message.header_as_record_batch() else { return false };
    let (Some(nodes), Some(buffers)) = (batch.nodes(), batch.buffers()) else { return false };
    let body = block.bodyLength();
    let lies_inside = |buffer: &arrow::ipc::Buffer| {
        let (offset, length) = (buffer.offset(), buffer.length());
        offset >= 0 && length >= 0 && offset.checked_add(length).is_some_and(|end| end <= body)
    };
    let mut columns = Columns { nodes: nodes.iter().copied(), buffers: buffers.iter().copied() };
    batch.compression().is_none()
        && buffers.iter().all(lies_inside)
        && fields.iter().all(|field| columns.fit(field.data_type(), batch.length()))
}

/// The nodes and buffers of a record batch, in the order of its columns.
struct Columns<N, B> {
    nodes: N,
    buffers: B,
}

impl<N: Iterator<Item = FieldNode>, B: Iterator<Item = arrow::ipc::Buffer>> Columns<N, B> {
    /// Whether the next column has `rows` rows and buffers that hold them.
    fn fit(&mut self, of: &DataType, rows: i64) -> bool {
        let (Some(node), Some(validity)) = (self.nodes.next(), self.buffers.next()) else { return false };
        let nulls = node.null_count();
        let whole = rows >= 0 && node.length() == rows && (0..=rows).contains(&nulls);
        if !whole || (nulls > 0 && validity.length().saturating_mul(8) < rows) {
            return false;
        }
        match of {
            DataType::Struct(children) => children.iter().all(|child| self.fit(child.data_type(), rows)),
            DataType::FixedSizeList(child, size) => {
                rows.checked_mul(i64::from(*size)).is_some_and(|rows| self.fit(child.data_type(), rows))
            }
            DataType::Boolean => self.next_holds(Some(rows.div_euclid(8) + i64::from(rows % 8 != 0))),
            DataType::FixedSizeBinary(size) => self.next_holds(rows.checked_mul(i64::from(*size))),
            // One offset of four bytes more than rows; the decoder checks the offsets against the bytes that follow, and asserts that
            // they are whole.
            DataType::Binary | DataType::Utf8 => {
                let needed =
                    if rows == 0 { Some(0) } else { rows.checked_add(1).and_then(|count| count.checked_mul(4)) };
                let offsets = self.buffers.next().map_or(-1, |buffer| buffer.length());
                offsets % 4 == 0 && needed.is_some_and(|needed| offsets >= needed) && self.next_holds(Some(0))
            }
            of => self.next_holds(of.primitive_width().and_then(|width| rows.checked_mul(width as i64))),
        }
    }

    fn next_holds(&mut self, bytes: Option<i64>) -> bool {
        self.buffers.next().zip(bytes).is_some_and(|(buffer, bytes)| buffer.length() >= bytes)
    }
}
