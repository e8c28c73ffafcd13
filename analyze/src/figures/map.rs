//! The map: every row of the table as a point in the plane, coloured by a quantity or by kind.

use std::collections::BTreeMap;

use plotters::prelude::{Circle, Color as _};

use super::axes::{Axes, chart, rgba};
use super::heading::Heading;
use super::legend::{self, BAR_ROOM};
use crate::picture::color::{CONTEXT, Color, FAINT, RULE, viridis};
use crate::picture::font::{Weight, fit};
use crate::picture::number::LABEL_SIZE;
use crate::picture::plot::units;
use crate::picture::{COLUMN, Picture, Point, Rect, TextStyle};

/// More points than this are thinned evenly before drawing, and the figure says so.
const MOST: usize = 40_000;

/// Petroff's ten colours for kinds (colour-blind safe), for up to ten rows of a grid.
const TEN: [Color; 10] = [
    Color::new(63, 144, 218),
    Color::new(255, 169, 14),
    Color::new(189, 31, 1),
    Color::new(148, 164, 162),
    Color::new(131, 45, 182),
    Color::new(169, 107, 89),
    Color::new(231, 99, 0),
    Color::new(185, 172, 112),
    Color::new(113, 117, 129),
    Color::new(146, 218, 221),
];

/// What the colour of a point says.
#[derive(Clone, Debug, PartialEq)]
pub enum Coloring {
    /// A quantity; not-a-number is drawn grey.
    Quantity {
        /// Its name and unit, for the colour bar.
        name: String,
        /// One value a point.
        values: Vec<f64>,
    },
    /// A kind, by number; none is drawn grey.
    Kind {
        /// What the kinds are, as in "state trajectory".
        name: String,
        /// One kind a point.
        kinds: Vec<Option<u32>>,
        /// What the kinds are called, by number; empty where the number says it.
        names: Vec<String>,
    },
}

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
        let names = self.kind_names();
        let w = COLUMN - 16.0 - 10.0 - if names.is_empty() { BAR_ROOM } else { 0.0 };
        let all = [self.points.as_slice(), &self.backdrop].concat();
        let h = w * aspect(&all);
        let key = legend::swatch_height(&names, COLUMN - 12.0);
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
        if let Coloring::Quantity { name, values } = &self.coloring {
            let (lo, hi) = range(values);
            legend::color_bar(&mut picture, Rect::new(area.right() + 6.0, area.y, 7.0, area.h), lo, hi, name);
        } else {
            let colors: Vec<Color> = (0..names.len()).map(|i| self.legend_color(i)).collect();
            legend::swatches(&mut picture, (8.0, area.bottom() + 14.0), &names, &colors, COLUMN - 12.0);
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
        let (lo, hi) = match &self.coloring {
            Coloring::Quantity { values, .. } => range(values),
            Coloring::Kind { .. } => (0.0, 1.0),
        };
        let mut layers: BTreeMap<(usize, i64), Vec<Point>> = BTreeMap::new();
        for (i, &center) in centers.iter().enumerate().step_by(every) {
            // A fixed hash of the row spreads neighbours in time over the passes.
            let pass = (i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) % PASSES;
            layers.entry((pass, self.level(i, lo, hi))).or_default().push(center);
        }
        layers.into_iter().map(|((_, level), list)| (list, self.level_color(level))).collect()
    }

    /// The colour's number: a 64th of the range, or the kind; −1 for none.
    fn level(&self, i: usize, lo: f64, hi: f64) -> i64 {
        match &self.coloring {
            Coloring::Quantity { values, .. } if values[i].is_finite() => {
                ((values[i] - lo) / (hi - lo).max(1e-12) * 63.0).round() as i64
            }
            Coloring::Kind { kinds, .. } => kinds[i].map_or(-1, |k| i64::from(k) % TEN.len() as i64),
            Coloring::Quantity { .. } => -1,
        }
    }

    fn level_color(&self, level: i64) -> Color {
        match (&self.coloring, usize::try_from(level)) {
            (_, Err(_)) => CONTEXT,
            (Coloring::Quantity { .. }, Ok(level)) => viridis(level as f64 / 63.0),
            (Coloring::Kind { .. }, Ok(level)) => TEN[level % TEN.len()],
        }
    }

    fn legend_color(&self, i: usize) -> Color {
        self.level_color(self.kinds().get(i).map_or(-1, |&k| i64::from(k) % TEN.len() as i64))
    }

    fn kinds(&self) -> Vec<u32> {
        let Coloring::Kind { kinds, .. } = &self.coloring else { return Vec::new() };
        kinds.iter().flatten().copied().collect::<std::collections::BTreeSet<_>>().into_iter().take(TEN.len()).collect()
    }

    fn kind_names(&self) -> Vec<String> {
        let Coloring::Kind { name, kinds, names: called } = &self.coloring else { return Vec::new() };
        if !called.is_empty() {
            let of_kind = |&kind: &u32| called.get(kind as usize).map_or("", String::as_str);
            let short = |text: &str| fit(text, LABEL_SIZE, Weight::Regular, 90.0);
            let mut names: Vec<String> = self.kinds().iter().map(|kind| short(of_kind(kind))).collect();
            if let Some(last) = names.last_mut().filter(|_| called.len() > TEN.len()) {
                last.push_str(" (colours repeat)");
            }
            return names;
        }
        let largest = kinds.iter().flatten().max().copied().unwrap_or(0);
        let mut names: Vec<String> = self.kinds().iter().map(|k| format!("{name} {k}")).collect();
        for short in names.iter_mut().skip(1) {
            *short = short.trim_start_matches(name.as_str()).trim().to_string();
        }
        if let Some(last) = names.last_mut().filter(|_| largest as usize >= TEN.len()) {
            last.push_str(" (colours repeat)");
        }
        names
    }
}

/// The range of the finite values.
pub(super) fn range(values: &[f64]) -> (f64, f64) {
    let finite = values.iter().filter(|v| v.is_finite());
    let (lo, hi) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    if lo <= hi { (lo, hi) } else { (0.0, 1.0) }
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
