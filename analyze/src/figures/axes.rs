//! Marks that several charts share: a value with its interval, and a legend row.

use crate::picture::color::{Color, INK};
use crate::picture::{Picture, Point};

/// An interval as a line along x with short ends, at height `y`.
pub(super) fn whisker_x(picture: &mut Picture, y: f64, from: f64, to: f64, color: Color) {
    picture.line(&[(from, y), (to, y)], 0.8, color);
    for x in [from, to] {
        picture.line(&[(x, y - 1.6), (x, y + 1.6)], 0.8, color);
    }
}

/// A reference mark, such as chance: a dashed line between two points.
pub(super) fn reference(picture: &mut Picture, a: Point, b: Point) {
    picture.dashed(&[a, b], 0.8, INK, (2.0, 1.6));
}
