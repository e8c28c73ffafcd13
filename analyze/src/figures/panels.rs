//! Figure 4a of the paper for any n × m: rows share a state trajectory, columns a distractor trajectory, every panel shows all points in
//! grey and its own trajectory coloured by time, or by a column of the table.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::coloring::{Coloring, Scale};
use super::heading::Heading;
use super::legend::{self, BAR_ROOM, Mark};
use super::map::{aspect, fit_points};
use crate::picture::color::{CONTEXT, Color, FAINT, RULE, viridis};
use crate::picture::font::{Weight, fit};
use crate::picture::number::LABEL_SIZE;
use crate::picture::{Anchor, COLUMN, PAGE, Picture, Point, Rect, TextStyle};

/// The grey background never holds more points than this; more are thinned evenly.
const MOST: usize = 20_000;
/// Colours along a trajectory.
const LEVELS: i64 = 24;

/// One cell of the grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Panel {
    /// Row of the grid.
    pub state: u32,
    /// Column of the grid.
    pub distractor: u32,
    /// Indices into the points, in order of time; empty for a cell without rows.
    pub rows: Vec<usize>,
}

/// The figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Panels {
    /// Title and note.
    pub heading: Heading,
    /// All points of the map.
    pub points: Vec<[f64; 2]>,
    /// The rows of the grid that are shown.
    pub states: Vec<u32>,
    /// The columns that are shown.
    pub distractors: Vec<u32>,
    /// The cells.
    pub panels: Vec<Panel>,
    /// What is said in a cell that is absent or has no rows, as in "not recorded".
    pub absent: &'static str,
    /// The step of every point of the table, by which trajectories are coloured unless a colouring is given.
    pub steps: Vec<u32>,
    /// What the colours of trajectories say, one value a point of the table; none colours them by time.
    pub coloring: Option<Coloring>,
}

impl Panels {
    /// Draws the figure: up to five columns fill one column of a paper, more fill the page.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let (rows, columns) = (self.states.len().max(1), self.distractors.len().max(1));
        let width = if columns <= 5 { COLUMN } else { PAGE };
        let (left, gap) = (18.0, 2.5);
        let side = ((width - left - BAR_ROOM) / columns as f64 - gap).min(90.0);
        let high = side * aspect(&self.points);
        let shown = self.panels.iter().flat_map(|panel| panel.rows.iter().copied());
        let coloring = self.coloring.as_ref().map(|coloring| coloring.of_shown(shown));
        let names = coloring.as_ref().map_or_else(Vec::new, Coloring::names);
        let key = legend::label_height(&names, width - 12.0);
        let body = rows as f64 * (high + gap) + 4.0;
        let (mut picture, top) = self.heading.picture(width, 21.0 + body + key);
        let top = top + 21.0;
        let (centers, _) = fit_points(&self.points, side, high);
        let every = centers.len().div_ceil(MOST).max(1);
        let cloud: Arc<Vec<Point>> = Arc::new(centers.iter().step_by(every).copied().collect());
        let (time, scale) = (self.time(), coloring.as_ref().map(Coloring::scale));
        let colored = coloring.as_ref().zip(scale.as_ref());
        for (r, &state) in self.states.iter().enumerate() {
            for (c, &distractor) in self.distractors.iter().enumerate() {
                let area = Rect::new(left + c as f64 * (side + gap), top + r as f64 * (high + gap), side, high);
                picture.dots((area.x, area.y), cloud.clone(), dot(side, cloud.len()), CONTEXT);
                let panel = self.panels.iter().find(|p| p.state == state && p.distractor == distractor);
                let rows = panel.map_or(&[][..], |p| &p.rows);
                self.trajectory(&mut picture, area, &self.layers(rows, &centers, time, colored));
            }
        }
        self.labels(&mut picture, (left, top), (side, high), gap);
        let height = (rows as f64 * (high + gap) - gap).min(120.0);
        let bar = Rect::new(left + columns as f64 * (side + gap) + 4.0, top, 6.0, height);
        match &coloring {
            None => legend::color_bar(&mut picture, bar, f64::from(time.0), f64::from(time.1), "step"),
            Some(coloring @ Coloring::Quantity { name, .. }) => {
                let (lo, hi) = coloring.scale().range;
                legend::color_bar(&mut picture, bar, lo, hi, name);
            }
            Some(coloring) => {
                let at = (8.0, top + body);
                legend::labels(&mut picture, at, (&names, &coloring.colors()), Mark::Point, width - 12.0);
            }
        }
        picture
    }

    /// The first and the last step of all trajectories that are shown, which may begin late or end early.
    fn time(&self) -> (u32, u32) {
        let steps = || self.panels.iter().flat_map(|panel| &panel.rows).map(|&row| self.steps[row]);
        (steps().min().unwrap_or(0), steps().max().unwrap_or(0))
    }

    /// A trajectory's points by colour, among trajectories from one step to another; a colouring has one scale for all of them.
    fn layers(
        &self,
        rows: &[usize],
        centers: &[Point],
        (first, last): (u32, u32),
        colored: Option<(&Coloring, &Scale)>,
    ) -> Vec<(Vec<Point>, Color)> {
        let whole = i64::from(last - first).max(1);
        let level = |row: usize| match colored {
            Some((coloring, scale)) => coloring.level(row, scale),
            None => (i64::from(self.steps[row] - first) * LEVELS / whole).min(LEVELS - 1),
        };
        let mut layers: BTreeMap<i64, Vec<Point>> = BTreeMap::new();
        for &row in rows {
            layers.entry(level(row)).or_default().push(centers[row]);
        }
        let color = |level: i64| match colored {
            None => viridis((level as f64 + 0.5) / LEVELS as f64),
            // Grey would be lost before the grey of all points.
            Some(_) if level < 0 => FAINT,
            Some((coloring, _)) => coloring.color(level),
        };
        layers.into_iter().map(|(level, list)| (list, color(level))).collect()
    }

    /// A cell's own rows, a dot each, by colour; or why there are none.
    fn trajectory(&self, picture: &mut Picture, area: Rect, layers: &[(Vec<Point>, Color)]) {
        picture.frame(area, 0.4, RULE);
        if layers.is_empty() {
            let style = TextStyle::new(5.5).anchor(Anchor::Middle).color(FAINT);
            picture.text((area.x + area.w / 2.0, area.y + area.h / 2.0), self.absent, style);
        }
        for (list, color) in layers {
            picture.dots((area.x, area.y), Arc::new(list.clone()), 0.9, *color);
        }
    }

    fn labels(&self, picture: &mut Picture, at: Point, (side, high): (f64, f64), gap: f64) {
        let style = TextStyle::new(6.0).anchor(Anchor::Middle);
        let across = (side + gap) * self.distractors.len() as f64 - gap;
        let down = (high + gap) * self.states.len() as f64 - gap;
        let key = TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle).bold();
        let text = |long: &str, short: &str, room: f64| {
            if fit(long, LABEL_SIZE, Weight::Bold, room) == long { long.to_string() } else { short.to_string() }
        };
        picture.text(
            (at.0 + across / 2.0, at.1 - 12.0),
            text("same distractor in a column", "distractor", across),
            key,
        );
        picture.text((8.0, at.1 + down / 2.0), text("same state in a row", "state", down), key.upwards());
        for (c, d) in self.distractors.iter().enumerate() {
            let text = if side > 42.0 { format!("distractor {d}") } else { d.to_string() };
            picture.text((at.0 + c as f64 * (side + gap) + side / 2.0, at.1 - 3.0), text, style.color(FAINT));
        }
        for (r, s) in self.states.iter().enumerate() {
            let text = if high > 26.0 { format!("state {s}") } else { s.to_string() };
            picture.text((at.0 - 3.0, at.1 + r as f64 * (high + gap) + high / 2.0), text, style.color(FAINT).upwards());
        }
    }
}

/// The radius of a grey point in a panel, points.
fn dot(side: f64, count: usize) -> f64 {
    (0.35 * side / (count.max(1) as f64).sqrt()).clamp(0.25, 0.9)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As of a grid of which one cell ends early, from step 50 on.
    #[test]
    fn a_step_has_one_colour_in_cells_of_any_length() {
        let panel =
            |distractor: u32, rows: std::ops::Range<usize>| Panel { state: 0, distractor, rows: rows.collect() };
        let panels = Panels {
            heading: Heading::new("a test"),
            points: vec![[0.0, 0.0]; 58],
            states: vec![0],
            distractors: vec![0, 1],
            panels: vec![panel(0, 0..48), panel(1, 48..58)],
            absent: "not recorded",
            steps: (50..98).chain(50..60).collect(),
            coloring: None,
        };
        let color = |row: usize| panels.layers(&[row], &[(0.0, 0.0); 58], panels.time(), None)[0].1;
        assert_eq!(panels.time(), (50, 97));
        assert_eq!((color(0), color(9)), (color(48), color(57)));
        assert_ne!(color(57), color(47), "the last row of the short one is not the last step");
    }
}
