//! Where the cells of the grid of panels stand.

use crate::picture::{COLUMN, PAGE, Point, Rect};

/// Left of the cells, points.
const LEFT: f64 = 18.0;
/// Above the cells, points.
const ABOVE: f64 = 21.0;
/// Between one cell and the next, points.
const GAP: f64 = 2.5;
/// The largest side of a cell, points.
const LARGEST: f64 = 90.0;
/// Least and most height of the colour bar, points: its two ends have numbers.
const BAR: (f64, f64) = (24.0, 120.0);

/// Measures of the figure, points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    /// Width of the figure.
    pub(super) width: f64,
    /// Width of a cell.
    pub(super) side: f64,
    /// Height of a cell.
    pub(super) high: f64,
    rows: f64,
    columns: f64,
    top: f64,
}

impl Layout {
    /// The layout of a grid of cells of a shape, with room for a colour bar: up to five columns fill one column of a paper, more fill the page.
    pub(super) fn new((rows, columns): (usize, usize), aspect: f64, room: f64) -> Self {
        let (rows, columns) = (rows.max(1), columns.max(1));
        let width = if columns <= 5 { COLUMN } else { PAGE };
        let side = ((width - LEFT - room) / columns as f64 - GAP).min(LARGEST);
        Self { width, side, high: side * aspect, rows: rows as f64, columns: columns as f64, top: 0.0 }
    }

    /// The same, beginning at a height.
    pub(super) fn below(self, top: f64) -> Self {
        Self { top, ..self }
    }

    /// The height of all of it.
    pub(super) fn body(&self) -> f64 {
        ABOVE + self.down().max(BAR.0) + GAP + 4.0
    }

    /// The width of all cells.
    pub(super) fn across(&self) -> f64 {
        (self.side + GAP) * self.columns - GAP
    }

    /// The height of all cells.
    pub(super) fn down(&self) -> f64 {
        (self.high + GAP) * self.rows - GAP
    }

    /// The upper left corner of the first cell.
    pub(super) fn corner(&self) -> Point {
        (LEFT, self.top + ABOVE)
    }

    /// A cell.
    pub(super) fn cell(&self, row: usize, column: usize) -> Rect {
        let (x, y) = self.corner();
        Rect::new(x + column as f64 * (self.side + GAP), y + row as f64 * (self.high + GAP), self.side, self.high)
    }

    /// The colour bar.
    pub(super) fn bar(&self) -> Rect {
        let (x, y) = self.corner();
        Rect::new(x + self.across() + GAP + 4.0, y, 6.0, self.down().clamp(BAR.0, BAR.1))
    }
}

/// The radius of a grey point in a panel, points.
pub(super) fn dot(side: f64, count: usize) -> f64 {
    (0.35 * side / (count.max(1) as f64).sqrt()).clamp(0.25, 0.9)
}

/// The radius of a trajectory's point in a panel, points: smaller in small panels, and where trajectories are long, so that their colours are seen.
pub(super) fn own_dot(side: f64, rows: usize) -> f64 {
    (0.34 * side / (rows.max(1) as f64).sqrt()).clamp(0.3, 0.9)
}
