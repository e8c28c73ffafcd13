//! The neighbour sheet (Figures 4b and 5 of the paper): each column a query on top and its nearest neighbours beneath.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use super::heading::Heading;
use crate::picture::color::{Color, FAINT, INK, RULE, kind};
use crate::picture::font::{self, Weight, fit, wrap};
use crate::picture::{Anchor, COLUMN, PAGE, Picture, Pixels, Rect, TextStyle};

/// Size of the text under a picture, points.
const SMALL: f64 = 5.5;

/// One row of the table: which it is, and its picture if there is one.
#[derive(Clone, Debug)]
pub struct Thumb {
    /// `EPISODE:STEP`.
    pub name: String,
    /// The frame; none draws an empty frame.
    pub pixels: Option<Arc<Pixels>>,
}

/// A query and its neighbours, nearest first.
#[derive(Clone, Debug)]
pub struct SheetColumn {
    /// The query.
    pub query: Thumb,
    /// A remark over the query, as in "high reward"; may be empty.
    pub remark: String,
    /// The neighbours with their distances.
    pub neighbours: Vec<(Thumb, f64)>,
}

/// The sheet.
#[derive(Clone, Debug)]
pub struct NeighbourSheet {
    /// Title and note.
    pub heading: Heading,
    /// What the number under each neighbour is, as in "standardized L2 distance".
    pub distance: String,
    /// What the pictures from top to bottom are, the query first, where they are no neighbours; empty where they are.
    pub rows: Vec<String>,
    /// One column a query.
    pub columns: Vec<SheetColumn>,
}

/// Measures of a sheet, points.
struct Layout {
    per_band: usize,
    ranks: usize,
    cell: f64,
    image: (f64, f64),
    /// Row key and distance do not fit on one line under every picture, so each has its own.
    two_lines: bool,
}

impl Layout {
    /// Height of a neighbour with its text.
    fn row(&self) -> f64 {
        self.image.1 + SMALL + 4.0 + if self.two_lines { SMALL + 0.5 } else { 0.0 }
    }

    /// Where the picture of a neighbour begins, below the top of its band; the query has one line of text whatever they have.
    fn neighbour(&self, rank: usize) -> f64 {
        8.0 + self.image.1 + SMALL + 9.0 + self.row() * rank as f64
    }
}

impl NeighbourSheet {
    /// Draws the sheet: up to six queries fill one column of a paper, more fill the page, ten in a band.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let layout = self.layout();
        let width = if self.columns.len() <= 6 { COLUMN } else { PAGE };
        let bands = self.columns.len().div_ceil(layout.per_band).max(1);
        let band = layout.neighbour(layout.ranks) + 10.0;
        let foot = wrap(&self.foot(), 6.0, Weight::Regular, width - 12.0);
        let (mut picture, top) = self.heading.picture(width, bands as f64 * band + 2.0 + 8.0 * foot.len() as f64);
        for (i, columns) in self.columns.chunks(layout.per_band).enumerate() {
            self.band(&mut picture, &layout, columns, top + i as f64 * band);
        }
        let first = picture.height - 4.0 - 8.0 * (foot.len() as f64 - 1.0);
        for (i, line) in foot.into_iter().enumerate() {
            picture.text((6.0, first + 8.0 * i as f64), line, TextStyle::new(6.0).color(FAINT));
        }
        picture
    }

    /// What stands under the pictures.
    fn foot(&self) -> String {
        let (others, query) = match self.rows.first() {
            Some(first) => ("the others", first.as_str()),
            None => ("neighbours", "query"),
        };
        format!("Under each picture its episode:step; under {others} also the {} to the {query}.", self.distance)
    }

    fn layout(&self) -> Layout {
        let count = self.columns.len().max(1);
        let width = if count <= 6 { COLUMN } else { PAGE };
        let per_band = if count <= 6 { count } else { count.div_ceil(count.div_ceil(10)) };
        let cell = ((width - 16.0 - 6.0) / per_band as f64).min(72.0);
        let shown = |c: &SheetColumn| {
            c.query.pixels.iter().chain(c.neighbours.iter().filter_map(|n| n.0.pixels.as_ref())).next().cloned()
        };
        let aspect =
            self.columns.iter().find_map(shown).map_or(1.0, |p| f64::from(p.height) / f64::from(p.width.max(1)));
        let image = (cell - 4.0, (cell - 4.0) * aspect);
        let ranks = self.columns.iter().map(|c| c.neighbours.len()).max().unwrap_or(0);
        let labels =
            self.columns.iter().flat_map(|c| &c.neighbours).map(|(thumb, distance)| one_line(thumb, *distance));
        let two_lines = labels.into_iter().any(|l| width_of(&l) > cell - 1.0);
        Layout { per_band, ranks, cell, image, two_lines }
    }

    fn band(&self, picture: &mut Picture, layout: &Layout, columns: &[SheetColumn], top: f64) {
        let middle = |y: f64| y + layout.image.1 / 2.0;
        let query = self.rows.first().map_or("query", String::as_str);
        upwards(picture, query, (middle(top + 8.0), layout.image.1), INK);
        for rank in 0..layout.ranks {
            let y = middle(top + layout.neighbour(rank));
            let style = TextStyle::new(6.0).anchor(Anchor::Middle).color(FAINT);
            match self.rows.get(rank + 1) {
                Some(name) => upwards(picture, name, (y, layout.image.1), FAINT),
                None => picture.text((9.0, y + 2.0), (rank + 1).to_string(), style),
            }
        }
        for (i, column) in columns.iter().enumerate() {
            self.column(picture, layout, column, (16.0 + i as f64 * layout.cell, top));
        }
    }

    fn column(&self, picture: &mut Picture, layout: &Layout, column: &SheetColumn, at: (f64, f64)) {
        let (w, h) = layout.image;
        let small = TextStyle::new(SMALL).anchor(Anchor::Middle);
        let center = at.0 + 2.0 + w / 2.0;
        picture.text(
            (center, at.1 + 6.0),
            fit(&column.remark, SMALL, Weight::Regular, layout.cell - 1.0),
            small.color(FAINT),
        );
        let rect = Rect::new(at.0 + 2.0, at.1 + 8.0, w, h);
        thumb(picture, &column.query, rect, kind(0), 1.6);
        picture.text(
            (center, rect.bottom() + SMALL + 1.0),
            fit(&column.query.name, SMALL, Weight::Bold, w),
            small.bold(),
        );
        for (rank, (neighbour, distance)) in column.neighbours.iter().enumerate() {
            let rect = Rect::new(at.0 + 2.0, at.1 + layout.neighbour(rank), w, h);
            thumb(picture, neighbour, rect, RULE, 0.4);
            let below = rect.bottom() + SMALL + 0.5;
            if layout.two_lines {
                picture.text((center, below), fit(&neighbour.name, SMALL, Weight::Regular, w + 3.0), small);
                picture.text((center, below + SMALL + 0.5), format!("{distance:.2}"), small.color(FAINT));
            } else {
                picture.text((center, below), one_line(neighbour, *distance), small);
            }
        }
    }
}

/// What the pictures of a row are, reading upwards beside them, in two lines if one is too long for their height.
fn upwards(picture: &mut Picture, name: &str, (middle, room): (f64, f64), color: Color) {
    let style = TextStyle::new(6.0).anchor(Anchor::Middle).color(color).upwards();
    let lines = wrap(name, 6.0, Weight::Regular, room);
    for (before, line) in lines.iter().take(2).rev().enumerate() {
        picture.text((11.0 - 6.0 * before as f64, middle), fit(line, 6.0, Weight::Regular, room), style);
    }
}

/// Row key and distance side by side.
fn one_line(thumb: &Thumb, distance: f64) -> String {
    format!("{}  {distance:.2}", thumb.name)
}

fn width_of(label: &str) -> f64 {
    font::width(label, SMALL, Weight::Regular)
}

fn thumb(picture: &mut Picture, thumb: &Thumb, rect: Rect, frame: Color, width: f64) {
    match &thumb.pixels {
        Some(pixels) => picture.image(pixels.clone(), rect),
        None => {
            let style = TextStyle::new(5.0).anchor(Anchor::Middle).color(FAINT);
            picture.text((rect.x + rect.w / 2.0, rect.y + rect.h / 2.0 + 2.0), "no frame", style);
        }
    }
    picture.frame(rect, width, frame);
}
