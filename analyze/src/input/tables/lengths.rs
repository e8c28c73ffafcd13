//! What an Arrow file says about lengths, held beside the file. In: an Arrow file or stream. Out: an error where a length or a place leads out of it.
//!
//! Polars makes room for a length before it looks whether the file has that much; room for more than there is ends the process, which nothing can catch.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use arrow::ipc::{Message, RecordBatch, root_as_footer, root_as_message};

use super::{InputError, not_a_table};

/// Bytes behind the footer: its length, and the file's last word.
const TRAILER: u64 = 10;
/// Nothing here is packed tighter: zstd's runs of one byte.
const TIGHTEST: i64 = 1 << 15;

/// Checks every length of a file.
///
/// # Errors
/// [`InputError::NotATable`] where one leads out of it, [`InputError::Io`].
pub(super) fn check(path: &Path, stream: bool) -> Result<(), InputError> {
    let size = std::fs::metadata(path).map_err(InputError::io(path))?.len();
    let mut file = BufReader::new(File::open(path).map_err(InputError::io(path))?);
    let sound = if stream { stream_is_sound(&mut file, size) } else { file_is_sound(&mut file, size) };
    sound.ok_or_else(|| not_a_table(path, "a truncated or damaged Arrow file"))
}

/// Message after message until the mark of the end or the end itself.
fn stream_is_sound(file: &mut (impl Read + Seek), size: u64) -> Option<()> {
    let mut at = 0;
    while size - at >= 4 {
        let Some(end) = message_end(file, at, size)? else { return Some(()) };
        at = end;
    }
    Some(())
}

/// The messages that the footer names.
fn file_is_sound(file: &mut (impl Read + Seek), size: u64) -> Option<()> {
    let start = size.checked_sub(TRAILER)?;
    file.seek(SeekFrom::Start(start)).ok()?;
    let length = u64::try_from(number(file)?).ok()?;
    let footer = bytes(file, start.checked_sub(length)?, length)?;
    let footer = root_as_footer(&footer).ok()?;
    let blocks = footer.recordBatches().into_iter().chain(footer.dictionaries()).flatten();
    blocks.map(|block| u64::try_from(block.offset()).ok()).try_for_each(|at| {
        let at = at.filter(|at| *at <= size)?;
        message_end(file, at, size).map(drop)
    })
}

/// Where the message that begins here ends; none at the mark of a stream's end.
fn message_end(file: &mut (impl Read + Seek), at: u64, size: u64) -> Option<Option<u64>> {
    file.seek(SeekFrom::Start(at)).ok()?;
    let first = number(file)?;
    // Before the length of the message, which older files begin with.
    let (length, start) = if first == -1 { (number(file)?, at + 8) } else { (first, at + 4) };
    if length == 0 {
        return Some(None);
    }
    let length = u64::try_from(length).ok().filter(|&length| length <= size.saturating_sub(start))?;
    let header = bytes(file, start, length)?;
    let message = root_as_message(&header).ok()?;
    let (body, room) = (start + length, size - start - length);
    let end = u64::try_from(message.bodyLength()).ok().filter(|&length| length <= room)? + body;
    batch_of(message).is_none_or(|batch| batch_is_sound(file, batch, body, end).is_some()).then_some(Some(end))
}

/// The columns that a message holds; a schema holds none.
fn batch_of(message: Message<'_>) -> Option<RecordBatch<'_>> {
    message.header_as_record_batch().or_else(|| message.header_as_dictionary_batch()?.data())
}

/// Whether the buffers lie in the body, and columns have no more rows than bits.
fn batch_is_sound(file: &mut (impl Read + Seek), batch: RecordBatch<'_>, body: u64, end: u64) -> Option<()> {
    let mut bytes_unpacked = 0_i64;
    for buffer in batch.buffers().into_iter().flatten() {
        let (offset, length) = (u64::try_from(buffer.offset()).ok()?, u64::try_from(buffer.length()).ok()?);
        offset.checked_add(length).filter(|&last| last <= end - body)?;
        let mut unpacked = buffer.length();
        if batch.compression().is_some() && length >= 8 {
            file.seek(SeekFrom::Start(body + offset)).ok()?;
            let said = [number(file)?.to_le_bytes(), number(file)?.to_le_bytes()].concat();
            // -1 says that this buffer is not packed.
            unpacked = said.try_into().map(i64::from_le_bytes).ok().filter(|&said| said != -1).unwrap_or(unpacked);
            (0..=buffer.length().checked_mul(TIGHTEST)?).contains(&unpacked).then_some(())?;
        }
        bytes_unpacked = bytes_unpacked.checked_add(unpacked)?;
    }
    let most = bytes_unpacked.checked_mul(8)?;
    let mut rows = batch.nodes().into_iter().flatten().map(|node| node.length());
    rows.all(|rows| (0..=most).contains(&rows)).then_some(())
}

/// A number of four bytes.
fn number(file: &mut impl Read) -> Option<i32> {
    let mut bytes = [0; 4];
    file.read_exact(&mut bytes).ok()?;
    Some(i32::from_le_bytes(bytes))
}

/// That many bytes from a place on; the caller knows that the file has them.
fn bytes(file: &mut (impl Read + Seek), at: u64, length: u64) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(at)).ok()?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).ok()?;
    (bytes.len() as u64 == length).then_some(bytes)
}
