//! What a Parquet file's footer says about lengths, held beside the footer. In: the file. Out: nothing, where a list or a text is longer than what is
//! left, or the footer lies outside the file.
//!
//! The footer is a structure in Thrift's compact protocol (`doc/specs/thrift-compact-protocol.md` of Apache Thrift). Its reader makes room for a list
//! before it reads the first entry.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// The footer's length and the file's last word.
const TRAILER: u64 = 8;
/// Structures in each other; Parquet's own metadata has seven.
const DEEPEST: usize = 32;

/// Checks every length of the footer.
pub(super) fn check(file: &mut File) -> Option<()> {
    let end = file.seek(SeekFrom::End(0)).ok()?.checked_sub(TRAILER)?;
    file.seek(SeekFrom::Start(end)).ok()?;
    let mut length = [0; 4];
    file.read_exact(&mut length).ok()?;
    let length = u64::from(u32::from_le_bytes(length));
    file.seek(SeekFrom::Start(end.checked_sub(length)?)).ok()?;
    let mut footer = Vec::new();
    file.take(length).read_to_end(&mut footer).ok()?;
    structure(&mut footer.as_slice(), DEEPEST)
}

/// Kinds of values in Thrift's compact protocol.
mod kind {
    pub(super) const TRUE: u8 = 1;
    pub(super) const FALSE: u8 = 2;
    pub(super) const BYTE: u8 = 3;
    pub(super) const I16: u8 = 4;
    pub(super) const I64: u8 = 6;
    pub(super) const DOUBLE: u8 = 7;
    pub(super) const TEXT: u8 = 8;
    pub(super) const LIST: u8 = 9;
    pub(super) const SET: u8 = 10;
    pub(super) const STRUCT: u8 = 12;
}

/// Fields until the mark of the end, each with its kind in the low half of its first byte.
fn structure(rest: &mut &[u8], deep: usize) -> Option<()> {
    let deep = deep.checked_sub(1)?;
    loop {
        let head = byte(rest)?;
        match (head & 0x0F, head >> 4) {
            (0, _) => return Some(()),
            (kind, 0) => {
                number(rest)?;
                field(rest, kind, deep)?;
            }
            (kind, _) => field(rest, kind, deep)?,
        }
    }
}

/// A field's value; a truth value is its kind.
fn field(rest: &mut &[u8], kind: u8, deep: usize) -> Option<()> {
    if matches!(kind, kind::TRUE | kind::FALSE) { Some(()) } else { value(rest, kind, deep) }
}

fn value(rest: &mut &[u8], kind: u8, deep: usize) -> Option<()> {
    match kind {
        kind::TRUE | kind::FALSE | kind::BYTE => byte(rest).map(drop),
        kind::I16..=kind::I64 => number(rest).map(drop),
        kind::DOUBLE => skip(rest, 8),
        kind::TEXT => {
            let length = number(rest)?;
            skip(rest, length)
        }
        kind::LIST | kind::SET => {
            let head = byte(rest)?;
            let count = if head >> 4 == 15 { number(rest)? } else { usize::from(head >> 4) };
            // An entry takes a byte at least.
            let count = Some(count).filter(|count| *count <= rest.len())?;
            (0..count).try_for_each(|_| value(rest, head & 0x0F, deep))
        }
        kind::STRUCT => structure(rest, deep),
        _ => None,
    }
}

/// Seven bits a byte, the lowest first; the high bit says that another follows.
pub(super) fn number(rest: &mut &[u8]) -> Option<usize> {
    let mut number: u64 = 0;
    for shift in (0..64).step_by(7) {
        let byte = byte(rest)?;
        number |= u64::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return usize::try_from(number).ok();
        }
    }
    None
}

fn byte(rest: &mut &[u8]) -> Option<u8> {
    let (first, others) = rest.split_first()?;
    *rest = others;
    Some(*first)
}

/// Leaves bytes out.
pub(super) fn skip(rest: &mut &[u8], count: usize) -> Option<()> {
    *rest = rest.get(count..)?;
    Some(())
}
