//! What a Parquet file's footer says about lengths, held beside the footer. In: the file. Out: nothing, where a list or a text is longer than what is
//! left, a column has more parts than the schema has elements, or the footer lies outside the file.
//!
//! The footer is a structure in Thrift's compact protocol (`doc/specs/thrift-compact-protocol.md` of Apache Thrift; `FileMetaData` and `SchemaElement` of
//! `parquet.thrift`). Its reader makes room for a list before it reads the first entry, and goes down into what lies in each other.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// The footer's length and the file's last word.
const TRAILER: u64 = 8;
/// Structures and lists in each other, and columns in columns; Parquet's own metadata has seven.
const DEEPEST: usize = 64;
/// The schema's field of the metadata, and the number of parts among the fields of one of its elements.
const SCHEMA: usize = 2;
const PARTS: usize = 5;

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
    let mut schema = Some(());
    structure(&mut footer.as_slice(), DEEPEST, &mut |field, value| {
        if field == SCHEMA {
            schema = schema.and(tree(value));
        }
    })?;
    schema
}

/// The schema's elements, each followed by its parts: all there, and not too deep in each other.
fn tree(mut list: &[u8]) -> Option<()> {
    let count = entries(&mut list)?.1;
    // How many parts are still to come, from the outermost column in.
    let mut open: Vec<usize> = Vec::new();
    for left in (0..count).rev() {
        let mut parts = 0;
        structure(&mut list, DEEPEST, &mut |field, mut value| {
            if field == PARTS {
                parts = number(&mut value).map_or(usize::MAX, |zigzag| zigzag / 2);
            }
        })?;
        if let Some(last) = open.last_mut() {
            *last -= 1;
        }
        if parts > 0 {
            open.push(parts);
        }
        if parts > left || open.len() > DEEPEST {
            return None;
        }
        while open.last() == Some(&0) {
            open.pop();
        }
    }
    Some(())
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

/// Fields until the mark of the end, each with its kind in the low half of its first byte; `seen` is shown each field's number and what begins with its value.
fn structure(rest: &mut &[u8], deep: usize, seen: &mut dyn FnMut(usize, &[u8])) -> Option<()> {
    let deep = deep.checked_sub(1)?;
    let mut field = 0;
    loop {
        let head = byte(rest)?;
        match (head & 0x0F, head >> 4) {
            (0, _) => return Some(()),
            (_, 0) => field = number(rest)? / 2,
            (_, further) => field += usize::from(further),
        }
        seen(field, rest);
        // A truth value is its kind.
        if !matches!(head & 0x0F, kind::TRUE | kind::FALSE) {
            value(rest, head & 0x0F, deep)?;
        }
    }
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
            let deep = deep.checked_sub(1)?;
            let (kind, count) = entries(rest)?;
            (0..count).try_for_each(|_| value(rest, kind, deep))
        }
        kind::STRUCT => structure(rest, deep, &mut |_, _| ()),
        _ => None,
    }
}

/// The kind and number of a list's entries, each of which takes a byte at least.
fn entries(rest: &mut &[u8]) -> Option<(u8, usize)> {
    let head = byte(rest)?;
    let count = if head >> 4 == 15 { number(rest)? } else { usize::from(head >> 4) };
    (count <= rest.len()).then_some((head & 0x0F, count))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of this footer.
    fn file(footer: &[u8]) -> File {
        let mut file = tempfile::tempfile().expect("file");
        let bytes = [b"PAR1", footer, &(footer.len() as u32).to_le_bytes(), b"PAR1"].concat();
        std::io::Write::write_all(&mut file, &bytes).expect("bytes");
        file
    }

    /// Metadata with a schema of elements that have these many parts, in zigzag.
    fn schema(parts: &[u8]) -> Vec<u8> {
        let mut footer = vec![0x29, (parts.len() as u8) << 4 | 12];
        for parts in parts {
            footer.extend([0x55, *parts, 0]);
        }
        footer.push(0);
        footer
    }

    #[test]
    fn a_schema_whose_parts_are_there_is_sound() {
        for parts in [&[0][..], &[4, 0, 0], &[4, 2, 0, 0], &[2, 2, 2, 0]] {
            assert_eq!(check(&mut file(&schema(parts))), Some(()), "{parts:?}");
        }
    }

    #[test]
    fn what_lies_too_deep_or_has_parts_that_are_not_there_is_refused() {
        let lists_of_lists = vec![0x19; 1 << 20];
        let chain = schema(&[vec![2; 12], vec![0]].concat());
        assert_eq!(check(&mut file(&chain)), Some(()));
        let count = 200_u8;
        let mut deep = vec![0x29, 0xFC, count | 0x80, 0x01];
        (0..count).for_each(|at| deep.extend([0x55, if at + 1 < count { 2 } else { 0 }, 0]));
        deep.push(0);
        for footer in [lists_of_lists, deep, schema(&[4, 0]), schema(&[0x7F]), vec![0x29, 0xFC, 0xFF, 0xFF, 0x7F]] {
            assert_eq!(check(&mut file(&footer)), None, "{:?}", &footer[..footer.len().min(12)]);
        }
    }
}
