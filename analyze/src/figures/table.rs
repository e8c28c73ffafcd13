//! A table in the form of the paper's Table 1: the best of each column bold, those whose interval overlaps with it underlined.

use super::heading::Heading;
use crate::picture::color::{FAINT, INK};
use crate::picture::font::{Weight, width};
use crate::picture::number::LABEL_SIZE;
use crate::picture::{Anchor, Picture, TextStyle};
use crate::scores::mean_text;

/// Height of a line, points.
const PITCH: f64 = 12.0;

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
    /// What stands under the table.
    pub foot: String,
}

impl Table {
    /// Draws the table, as wide as it needs to be.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let text = |t: &str| width(t, LABEL_SIZE, Weight::Bold);
        let first = self.rows.iter().map(|r| text(&r.0)).fold(text(&self.corner), f64::max) + 12.0;
        let widths: Vec<f64> = (0..self.columns.len()).map(|c| self.column_width(c)).collect();
        let total =
            (first + widths.iter().sum::<f64>() + 2.0).max(200.0).max(width(&self.foot, 6.0, Weight::Regular) + 14.0);
        let (mut picture, top) = self.heading.picture(total, (self.rows.len() + 1) as f64 * PITCH + 20.0);
        let rule = |picture: &mut Picture, y: f64, w: f64| picture.line(&[(6.0, y), (total - 6.0, y)], w, INK);
        rule(&mut picture, top, 0.9);
        self.line(&mut picture, top, first, &widths);
        rule(&mut picture, top + PITCH, 0.5);
        for (i, (name, entries)) in self.rows.iter().enumerate() {
            let y = top + (i + 1) as f64 * PITCH;
            picture.text((6.0, y + 8.5), name.clone(), TextStyle::new(LABEL_SIZE));
            let mut x = first;
            for (entry, w) in entries.iter().zip(&widths) {
                x += w;
                draw_entry(&mut picture, *entry, (x - 4.0, y + 8.5));
            }
        }
        let bottom = top + (self.rows.len() + 1) as f64 * PITCH + 1.0;
        rule(&mut picture, bottom, 0.9);
        picture.text((6.0, bottom + 9.0), self.foot.clone(), TextStyle::new(6.0).color(FAINT));
        picture
    }

    fn line(&self, picture: &mut Picture, top: f64, first: f64, widths: &[f64]) {
        picture.text((6.0, top + 8.5), self.corner.clone(), TextStyle::new(LABEL_SIZE).bold());
        let mut x = first;
        for (name, w) in self.columns.iter().zip(widths) {
            x += w;
            picture.text((x - 4.0, top + 8.5), name.clone(), TextStyle::new(LABEL_SIZE).bold().anchor(Anchor::End));
        }
    }

    fn column_width(&self, c: usize) -> f64 {
        let entries = self.rows.iter().filter_map(|r| r.1.get(c).copied().flatten());
        let widest = entries.map(|e| width(&e.text(), LABEL_SIZE, Weight::Bold)).fold(0.0, f64::max);
        widest.max(width(&self.columns[c], LABEL_SIZE, Weight::Bold)) + 14.0
    }
}

impl Entry {
    /// `mean ± half`, as many digits as the size asks for.
    #[must_use]
    pub fn text(&self) -> String {
        mean_text(self.mean, self.half)
    }
}

fn draw_entry(picture: &mut Picture, entry: Option<Entry>, at: (f64, f64)) {
    let style = TextStyle::new(LABEL_SIZE).anchor(Anchor::End);
    let Some(entry) = entry else {
        picture.text(at, "–", style.color(FAINT));
        return;
    };
    let text = entry.text();
    if entry.tied && !entry.best {
        let w = width(&text, LABEL_SIZE, Weight::Regular);
        picture.line(&[(at.0 - w, at.1 + 1.5), (at.0, at.1 + 1.5)], 0.5, INK);
    }
    picture.text(at, text, if entry.best { style.bold() } else { style });
}
