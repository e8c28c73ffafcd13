//! The foot of a map: what must be known of points that are not there, or are drawn in another way.

use crate::picture::color::FAINT;
use crate::picture::font::{Weight, wrap};
use crate::picture::{Picture, Point, TextStyle};

/// Size of its text, points.
const SIZE: f64 = 6.0;
/// From one line to the next, points.
const LINE: f64 = 8.0;

/// Its lines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) struct Foot {
    lines: Vec<String>,
}

impl Foot {
    /// Facts, each if there is something to be said, in lines of this width.
    pub(in super::super) fn of(facts: impl IntoIterator<Item = Option<String>>, width: f64) -> Self {
        let facts: Vec<String> = facts.into_iter().flatten().collect();
        Self { lines: wrap(&facts.join("; "), SIZE, Weight::Regular, width) }
    }

    /// The height that it takes, points.
    pub(in super::super) fn height(&self) -> f64 {
        if self.lines.is_empty() { 0.0 } else { 1.0 + LINE * self.lines.len() as f64 }
    }

    /// Writes it, its upper left corner at a place.
    pub(in super::super) fn write(self, picture: &mut Picture, at: Point) {
        for (i, line) in self.lines.into_iter().enumerate() {
            picture.text((at.0, at.1 + SIZE + LINE * i as f64), line, TextStyle::new(SIZE).color(FAINT));
        }
    }
}

/// That not all points are drawn; nothing if they are.
pub(in super::super) fn said_thinned(count: usize, every: usize) -> Option<String> {
    (every > 1).then(|| format!("one in {every} of {count} points is drawn"))
}

/// That points lie outside; nothing if none do.
pub(in super::super) fn said_outside(count: usize) -> Option<String> {
    match count {
        0 => None,
        1 => Some("1 point lies outside: a triangle at the frame".into()),
        _ => Some(format!("{count} points lie outside: triangles at the frame")),
    }
}

/// That points of no trajectory lie outside of panels; nothing if none do.
pub(in super::super) fn said_left_out(count: usize) -> Option<String> {
    match count {
        0 => None,
        1 => Some("1 of the grey points lies outside and is not drawn".into()),
        _ => Some(format!("{count} of the grey points lie outside and are not drawn")),
    }
}
