//! A table in the form of the paper's Table 1: the best of each column bold, those whose interval overlaps with it underlined.
//!
//! It is never wider than a page: heads and foot are broken into lines, and columns that find no room stand in further parts below, each with the names of the rows.

mod layout;
#[cfg(test)]
mod tests;

use super::heading::Heading;
use crate::picture::color::{FAINT, INK};
use crate::picture::font::{Weight, width};
use crate::picture::number::LABEL_SIZE;
use crate::picture::{Anchor, Picture, TextStyle};
use crate::scores::{self, Mark, common_decimals, mean_text};
use layout::{Layout, Part};

/// Height of a line, points.
const PITCH: f64 = 12.0;
/// From one line of a head to the next, points.
const HEAD_LINE: f64 = LABEL_SIZE + 1.5;
/// Between a part and the next, points.
const GAP: f64 = 9.0;
/// Size of the foot, points.
const FOOT: f64 = 6.0;
/// From one line of the foot to the next, points.
const FOOT_LINE: f64 = 7.5;

/// One number of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The mean.
    pub mean: f64,
    /// Half the width of its 95% interval, if there is one.
    pub half: Option<f64>,
    /// Best of its column: bold.
    pub best: bool,
    /// Not distinguishable from the best: underlined.
    pub tied: bool,
}

impl From<&scores::Entry> for Entry {
    fn from(entry: &scores::Entry) -> Self {
        let (best, tied) = (entry.mark == Mark::Best, entry.mark == Mark::Tied);
        Self { mean: entry.score.estimate, half: entry.half(), best, tied }
    }
}

/// The table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Title and note.
    pub heading: Heading,
    /// What the rows are, as in "run".
    pub corner: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Name of each row, and its entries; none is an empty cell.
    pub rows: Vec<(String, Vec<Option<Entry>>)>,
    /// Whether the entries of a row are of one kind, not those of a column: they are marked against each other and have one number of decimals.
    pub by_row: bool,
    /// What stands under the table, before what its marks mean.
    pub foot: String,
}

impl Table {
    /// The same with rows as columns; the corner says what the rows are now.
    #[must_use]
    pub fn transposed(self, corner: &str) -> Self {
        let row = |(column, name): (usize, &String)| (name.clone(), self.rows.iter().map(|r| at(r, column)).collect());
        let rows = self.columns.iter().enumerate().map(row).collect();
        let columns = self.rows.iter().map(|row| row.0.clone()).collect();
        Self { corner: corner.into(), columns, rows, by_row: !self.by_row, ..self }
    }

    /// Draws the table, as wide as it needs to be, up to a page.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let texts = self.texts();
        let layout = Layout::of(self, &texts);
        let (mut picture, top) = self.heading.picture(layout.width, layout.height);
        let mut y = top;
        for part in &layout.parts {
            self.draw_part(&mut picture, y, &layout, part, &texts);
            y += part.height + GAP;
        }
        for (at, line) in layout.foot.iter().enumerate() {
            let baseline = y + at as f64 * FOOT_LINE;
            picture.text((6.0, baseline), line.clone(), TextStyle::new(FOOT).color(FAINT));
        }
        picture
    }

    /// What stands under it, with what its marks mean where it has any.
    fn foot_text(&self) -> String {
        let line = if self.by_row { "row" } else { "column" };
        let entries = || self.rows.iter().flat_map(|row| row.1.iter().flatten());
        let mut facts = vec![self.foot.clone()];
        if entries().any(|entry| entry.best) {
            facts.push(format!("bold: best of its {line}"));
        }
        if entries().any(|entry| entry.tied && !entry.best) {
            facts.push("underlined: its 95% interval overlaps with the best's".into());
        }
        facts.retain(|fact| !fact.is_empty());
        facts.join("; ")
    }

    /// The text of every cell, row by row; those of one kind with the same number of decimals.
    fn texts(&self) -> Vec<Vec<Option<String>>> {
        let common = |entries: &mut dyn Iterator<Item = Entry>| common_decimals(entries.map(|e| (e.mean, e.half)));
        let of_column = |column: usize| common(&mut self.rows.iter().filter_map(|row| at(row, column)));
        let of_columns: Vec<usize> = (0..self.columns.len()).map(of_column).collect();
        let row = |row: &(String, Vec<Option<Entry>>)| {
            let of_row = common(&mut row.1.iter().flatten().copied());
            let text = |column: usize| {
                let decimals = if self.by_row { of_row } else { of_columns[column] };
                at(row, column).map(|entry| mean_text(entry.mean, entry.half, decimals))
            };
            (0..self.columns.len()).map(text).collect()
        };
        self.rows.iter().map(row).collect()
    }

    /// Draws some of the columns, below the height `top`.
    fn draw_part(&self, picture: &mut Picture, top: f64, layout: &Layout, part: &Part, texts: &[Vec<Option<String>>]) {
        let right = picture.width - 6.0;
        let rule = |picture: &mut Picture, y: f64, w: f64| picture.line(&[(6.0, y), (right, y)], w, INK);
        rule(picture, top, 0.9);
        rule(picture, top + part.head, 0.5);
        rule(picture, top + part.height, 0.9);
        let bold = TextStyle::new(LABEL_SIZE).bold();
        draw_head(picture, &layout.corner, (6.0, top + part.head), bold);
        for (row, name) in layout.names.iter().enumerate() {
            let y = top + part.head + row as f64 * PITCH + 8.5;
            picture.text((6.0, y), name.clone(), TextStyle::new(LABEL_SIZE));
        }
        let mut x = layout.first;
        for column in part.columns.clone() {
            x += layout.columns[column].width;
            draw_head(picture, &layout.columns[column].head, (x - 4.0, top + part.head), bold.anchor(Anchor::End));
            for (row, cells) in texts.iter().enumerate() {
                let y = top + part.head + row as f64 * PITCH + 8.5;
                draw_entry(picture, at(&self.rows[row], column), cells[column].as_deref(), (x - 4.0, y));
            }
        }
    }
}

/// The entry of a row in a column.
fn at(row: &(String, Vec<Option<Entry>>), column: usize) -> Option<Entry> {
    row.1.get(column).copied().flatten()
}

/// Draws the lines of a head, the last of them above the rule at a place.
fn draw_head(picture: &mut Picture, lines: &[String], (x, rule): (f64, f64), style: TextStyle) {
    for (up, line) in lines.iter().rev().enumerate() {
        picture.text((x, rule - 3.5 - up as f64 * HEAD_LINE), line.clone(), style);
    }
}

fn draw_entry(picture: &mut Picture, entry: Option<Entry>, text: Option<&str>, at: (f64, f64)) {
    let style = TextStyle::new(LABEL_SIZE).anchor(Anchor::End);
    let Some((entry, text)) = entry.zip(text) else {
        picture.text(at, "–", style.color(FAINT));
        return;
    };
    if entry.tied && !entry.best {
        let w = width(text, LABEL_SIZE, Weight::Regular);
        picture.line(&[(at.0 - w, at.1 + 1.5), (at.0, at.1 + 1.5)], 0.5, INK);
    }
    picture.text(at, text, if entry.best { style.bold() } else { style });
}
