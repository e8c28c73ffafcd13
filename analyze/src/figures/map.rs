//! The map: every row of the table as a point in the plane, coloured by a quantity or by kind.

use std::collections::BTreeMap;

use plotters::prelude::{Circle, Color as _};

use super::axes::{Axes, chart, rgba};
use super::coloring::{Coloring, range};
use super::heading::Heading;
use super::legend::{self, BAR_ROOM, Mark};
use crate::picture::color::{CONTEXT, Color, FAINT, RULE};
use crate::picture::number::LABEL_SIZE;
use crate::picture::plot::units;
use crate::picture::{COLUMN, Picture, Point, Rect, TextStyle};

/// More points than this are thinned evenly before drawing, and the figure says so.
const MOST: usize = 40_000;

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
        let names = self.coloring.names();
        let w = COLUMN - 16.0 - 10.0 - if names.is_empty() { BAR_ROOM } else { 0.0 };
        let all = [self.points.as_slice(), &self.backdrop].concat();
        let h = w * aspect(&all);
        let key = legend::label_height(&names, COLUMN - 12.0);
        let every = all.len().div_ceil(MOST).max(1);
        let foot = if every > 1 { 9.0 } else { 0.0 };
        let (mut picture, top) = self.heading.picture(COLUMN, h + 14.0 + key + foot);
        let area = Rect::new(16.0, top, w, h);
        let radius = radius(all.len());
        let (centers, _) = fit_points(&all, area.w, area.h);
        let (centers, beneath) = centers.split_at(self.points.len());
        let beneath: Vec<Point> = beneath.iter().step_by(every).copied().collect();
        let layers = [(beneath, CONTEXT)].into_iter().chain(self.layers(centers, every));
        let axes = Axes { area, x: (0.0, w), y: (0.0, h), x_title: None, y_axis: false, x_rules: false };
        chart(&mut picture, axes, |chart| {
            for (list, color) in layers {
                let style = rgba(color).filled();
                chart.draw_series(list.iter().map(|&(x, y)| Circle::new((x, h - y), units(radius), style)))?;
            }
            Ok(())
        });
        frame(&mut picture, area, &self.axes);
        if let Coloring::Quantity { name, .. } = &self.coloring {
            let (lo, hi) = self.coloring.scale().range;
            legend::color_bar(&mut picture, Rect::new(area.right() + 6.0, area.y, 7.0, area.h), lo, hi, name);
        } else {
            let at = (8.0, area.bottom() + 14.0);
            legend::labels(&mut picture, at, (&names, &self.coloring.colors()), Mark::Point, COLUMN - 12.0);
        }
        if every > 1 {
            let text = format!("every {every}th of {} points is drawn", all.len());
            let at = (16.0, picture.height - 3.0);
            picture.text(at, text, TextStyle::new(6.0).color(FAINT));
        }
        picture
    }

    /// Points by colour, in eight passes over the table, so that no colour always lies on top.
    fn layers(&self, centers: &[Point], every: usize) -> Vec<(Vec<Point>, Color)> {
        const PASSES: usize = 8;
        let scale = self.coloring.scale();
        let mut layers: BTreeMap<(usize, i64), Vec<Point>> = BTreeMap::new();
        for (i, &center) in centers.iter().enumerate().step_by(every) {
            // A fixed hash of the row spreads neighbours in time over the passes.
            let pass = (i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) % PASSES;
            layers.entry((pass, self.coloring.level(i, &scale))).or_default().push(center);
        }
        layers.into_iter().map(|((_, level), list)| (list, self.coloring.color(level))).collect()
    }
}

/// A radius at which this many points neither vanish nor melt together, points.
pub(super) fn radius(count: usize) -> f64 {
    (28.0 / (count.max(1) as f64).sqrt()).clamp(0.35, 1.5)
}

/// Height over width of the points' box, kept between half and 1.
pub(super) fn aspect(points: &[[f64; 2]]) -> f64 {
    let extent = |d: usize| {
        let (lo, hi) = range(&points.iter().map(|p| p[d]).collect::<Vec<_>>());
        hi - lo
    };
    (extent(1) / extent(0).max(1e-9)).clamp(0.5, 1.0)
}

/// Points placed in a box of `w × h` with a margin, both axes to the same scale and y upwards; also returns the scale.
pub(super) fn fit_points(points: &[[f64; 2]], w: f64, h: f64) -> (Vec<Point>, f64) {
    let axis = |d: usize| range(&points.iter().map(|p| p[d]).collect::<Vec<_>>());
    let ((x0, x1), (y0, y1)) = (axis(0), axis(1));
    let margin = 0.04 * w.min(h);
    let scale = ((w - 2.0 * margin) / (x1 - x0).max(1e-9)).min((h - 2.0 * margin) / (y1 - y0).max(1e-9));
    let (cx, cy) = ((x0 + x1) / 2.0, (y0 + y1) / 2.0);
    (points.iter().map(|p| (w / 2.0 + (p[0] - cx) * scale, h / 2.0 - (p[1] - cy) * scale)).collect(), scale)
}

/// The frame of a map: its axes have no unit, so they carry names and no ticks.
fn frame(picture: &mut Picture, area: Rect, axes: &str) {
    picture.frame(area, 0.5, RULE);
    let style = TextStyle::new(LABEL_SIZE).color(FAINT);
    picture.text((area.x, area.bottom() + 9.0), format!("{axes} 1 →"), style);
    picture.text((area.x - 4.0, area.bottom()), format!("{axes} 2 →"), style.upwards());
}
