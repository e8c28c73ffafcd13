//! The map: every row of the table as a point in the plane, coloured by a quantity or by kind.

mod foot;
mod place;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use plotters::prelude::{Circle, Color as _};

pub(super) use foot::{Foot, said_left_out, said_outside};
pub(super) use place::{Placed, Window};

use super::axes::{Axes, chart, rgba};
use super::coloring::{Coloring, Scale};
use super::heading::Heading;
use super::legend::{self, Mark};
use crate::picture::color::{CONTEXT, Color, FAINT, RULE};
use crate::picture::number::LABEL_SIZE;
use crate::picture::plot::units;
use crate::picture::{COLUMN, Picture, Point, Rect, TextStyle};
use foot::said_thinned;

/// More points than this are thinned evenly before drawing, and the figure says so.
const MOST: usize = 40_000;
/// Left and right of the area, points.
const BESIDE: (f64, f64) = (16.0, 10.0);
/// Beneath the area, where the name of the first axis stands, points.
const BELOW: f64 = 14.0;

/// The map.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Title and note.
    pub heading: Heading,
    /// What the axes are, as in "UMAP".
    pub axes: String,
    /// One point a row.
    pub points: Vec<[f64; 2]>,
    /// Points that are drawn grey beneath them: those of an old map that these were placed on.
    pub backdrop: Vec<[f64; 2]>,
    /// What the colours say.
    pub coloring: Coloring,
}

impl Map {
    /// Draws the map at column width.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let scale = self.coloring.scale();
        let (names, colors) = self.coloring.entries(0..self.points.len(), CONTEXT);
        let key = legend::label_height(&names, COLUMN - 12.0);
        let w = COLUMN - BESIDE.0 - BESIDE.1 - self.bar_room(&scale);
        let all = [self.points.as_slice(), &self.backdrop].concat();
        let window = Window::of(&all);
        let h = w * window.aspect();
        let placed = window.place(&all, (w, h));
        let foot = self.foot(&placed);
        let (mut picture, top) = self.heading.picture(COLUMN, h + BELOW + key + foot.height());
        let area = Rect::new(BESIDE.0, top, w, h);
        self.draw_points(&mut picture, area, &placed, &scale);
        frame(&mut picture, area, &self.axes);
        self.draw_bar(&mut picture, area, &scale);
        let at = (8.0, area.bottom() + BELOW);
        legend::labels(&mut picture, at, (&names, &colors), Mark::Point, COLUMN - 12.0);
        foot.write(&mut picture, (BESIDE.0, at.1 + key));
        picture
    }

    fn draw_bar(&self, picture: &mut Picture, area: Rect, scale: &Scale) {
        if let Coloring::Quantity { name, .. } = &self.coloring {
            let bar = Rect::new(area.right() + 6.0, area.y, 7.0, area.h);
            legend::color_bar(picture, bar, scale.span.as_ref(), name);
        }
    }

    /// The room of a colour bar, if there is one.
    fn bar_room(&self, scale: &Scale) -> f64 {
        match &self.coloring {
            Coloring::Quantity { .. } => legend::bar_room(scale.span.as_ref()),
            Coloring::Kind { .. } => 0.0,
        }
    }

    fn foot(&self, placed: &Placed) -> Foot {
        let count = placed.count();
        let lacking = self.coloring.lacking(0..self.points.len(), "grey");
        let facts = [lacking, said_thinned(count, every(placed)), said_outside(placed.outside(0..count))];
        Foot::of(facts, COLUMN - BESIDE.0 - BESIDE.1)
    }

    /// Draws the points, and beyond them the triangles of those outside.
    fn draw_points(&self, picture: &mut Picture, area: Rect, placed: &Placed, scale: &Scale) {
        let (w, h, every) = (area.w, area.h, every(placed));
        let radius = radius(placed.count());
        let axes = Axes { area, x: (0.0, w), y: (0.0, h), x_title: None, y_axis: false, x_rules: false };
        let layers = self.layers(placed, every, scale);
        chart(picture, axes, |chart| {
            for (list, color) in layers {
                let style = rgba(color).filled();
                chart.draw_series(list.iter().map(|&(x, y)| Circle::new((x, h - y), units(radius), style)))?;
            }
            Ok(())
        });
        for point in drawn(placed.count(), self.points.len(), every).filter(|&point| placed.center(point).is_none()) {
            picture.polygon(&placed.triangle(point, (area.x, area.y)), self.color(point, scale));
        }
    }

    /// A point's colour; those of the backdrop come behind the own ones.
    fn color(&self, point: usize, scale: &Scale) -> Color {
        let level = if point < self.points.len() { self.coloring.level(point, scale) } else { -1 };
        self.coloring.color(level, CONTEXT)
    }

    /// Points by colour, those of the backdrop first and the own ones in eight passes over the table, so that no colour always lies on top.
    fn layers(&self, placed: &Placed, every: usize, scale: &Scale) -> Vec<(Vec<Point>, Color)> {
        const PASSES: usize = 8;
        let mut layers: BTreeMap<(usize, i64), Vec<Point>> = BTreeMap::new();
        for point in drawn(placed.count(), self.points.len(), every) {
            let Some(center) = placed.center(point) else { continue };
            let key = if point < self.points.len() {
                // A fixed hash of the row spreads neighbours in time over the passes.
                let pass = (point.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) % PASSES;
                (1 + pass, self.coloring.level(point, scale))
            } else {
                (0, -1)
            };
            layers.entry(key).or_default().push(center);
        }
        layers.into_iter().map(|((_, level), list)| (list, self.coloring.color(level, CONTEXT))).collect()
    }
}

/// One of so many points is drawn.
fn every(placed: &Placed) -> usize {
    placed.count().div_ceil(MOST).max(1)
}

/// The points that are drawn, of which the first are the map's own.
fn drawn(count: usize, own: usize, every: usize) -> impl Iterator<Item = usize> {
    (0..own).step_by(every).chain((own..count).step_by(every))
}

/// A radius at which this many points neither vanish nor melt together, points.
fn radius(count: usize) -> f64 {
    (28.0 / (count.max(1) as f64).sqrt()).clamp(0.35, 1.5)
}

/// The frame of a map: its axes have no unit, so they carry names and no ticks.
fn frame(picture: &mut Picture, area: Rect, axes: &str) {
    picture.frame(area, 0.5, RULE);
    let style = TextStyle::new(LABEL_SIZE).color(FAINT);
    picture.text((area.x, area.bottom() + 9.0), format!("{axes} 1 →"), style);
    picture.text((area.x - 4.0, area.bottom()), format!("{axes} 2 →"), style.upwards());
}
