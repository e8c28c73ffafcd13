//! Where the cells of a table go: how wide its columns are, and how many of them find room beside each other.

use std::ops::Range;

use super::{FOOT, FOOT_LINE, GAP, HEAD_LINE, PITCH, Table};
use crate::picture::PAGE;
use crate::picture::font::{Weight, fit_ends, width, wrap};
use crate::picture::number::LABEL_SIZE;

/// Heads are broken into lines of this width where the numbers below are no wider, points.
const HEAD: f64 = 60.0;
/// The widest word of a head, points; a longer one is cut.
const WORD: f64 = 110.0;
/// The widest name of a row, points; a longer one is cut.
const NAME: f64 = 220.0;
/// The narrowest table, points.
const NARROWEST: f64 = 200.0;

/// A column: its head in lines, and its width with what lies between it and the one before.
pub(super) struct Column {
    pub(super) head: Vec<String>,
    pub(super) width: f64,
}

/// Columns that stand beside each other.
pub(super) struct Part {
    pub(super) columns: Range<usize>,
    /// Height of their heads.
    pub(super) head: f64,
    /// Height of the whole.
    pub(super) height: f64,
}

/// A table's measures, points.
pub(super) struct Layout {
    /// The corner in lines.
    pub(super) corner: Vec<String>,
    /// Names of the rows.
    pub(super) names: Vec<String>,
    /// Width of the names.
    pub(super) first: f64,
    pub(super) columns: Vec<Column>,
    pub(super) parts: Vec<Part>,
    /// The foot in lines.
    pub(super) foot: Vec<String>,
    /// Width of the whole.
    pub(super) width: f64,
    /// Height of the whole without its heading.
    pub(super) height: f64,
}

impl Layout {
    /// The measures of a table with these texts in its cells.
    pub(super) fn of(table: &Table, texts: &[Vec<Option<String>>]) -> Self {
        let names: Vec<String> =
            table.rows.iter().map(|row| fit_ends(&row.0, LABEL_SIZE, Weight::Regular, NAME)).collect();
        let widest = names.iter().map(|name| width(name, LABEL_SIZE, Weight::Regular)).fold(0.0, f64::max);
        let corner = lines(&table.corner, widest.max(HEAD));
        let first = widest.max(bold_width(&corner)) + 12.0;
        let columns: Vec<Column> =
            (0..table.columns.len()).map(|column| column_of(&table.columns[column], column, texts)).collect();
        let parts = parts(&columns, first, corner.len(), names.len());
        let used = |part: &Part| first + columns[part.columns.clone()].iter().map(|c| c.width).sum::<f64>() + 2.0;
        let width = parts.iter().map(used).fold(NARROWEST, f64::max);
        let foot = wrap(&table.foot_text(), FOOT, Weight::Regular, width - 12.0);
        let height = parts.iter().map(|part| part.height + GAP).sum::<f64>() + foot.len() as f64 * FOOT_LINE;
        Self { corner, names, first, columns, parts, foot, width, height }
    }
}

/// A head in lines, none wider than a word may be.
fn lines(head: &str, room: f64) -> Vec<String> {
    let lines = wrap(head, LABEL_SIZE, Weight::Bold, room);
    lines.iter().map(|line| fit_ends(line, LABEL_SIZE, Weight::Bold, room.max(WORD))).collect()
}

fn bold_width(lines: &[String]) -> f64 {
    lines.iter().map(|line| width(line, LABEL_SIZE, Weight::Bold)).fold(0.0, f64::max)
}

fn column_of(head: &str, column: usize, texts: &[Vec<Option<String>>]) -> Column {
    let cells = texts.iter().filter_map(|row| row[column].as_deref());
    let widest = cells.map(|text| width(text, LABEL_SIZE, Weight::Bold)).fold(0.0, f64::max);
    let head = lines(head, widest.max(HEAD));
    let width = widest.max(bold_width(&head)) + 14.0;
    Column { head, width }
}

/// As many columns beside each other as a page has room for, and at least one.
fn parts(columns: &[Column], first: f64, corner: usize, rows: usize) -> Vec<Part> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    let mut x = 0.0;
    for (at, column) in columns.iter().enumerate() {
        match ranges.last_mut().filter(|_| x + column.width + 2.0 <= PAGE) {
            Some(range) => range.end = at + 1,
            None => {
                ranges.push(at..at + 1);
                x = first;
            }
        }
        x += column.width;
    }
    let part = |range: Range<usize>| {
        let lines = columns[range.clone()].iter().map(|column| column.head.len()).fold(corner.max(1), usize::max);
        let head = PITCH + (lines - 1) as f64 * HEAD_LINE;
        Part { columns: range, head, height: head + rows as f64 * PITCH + 1.0 }
    };
    ranges.into_iter().map(part).collect()
}
