//! Figure 4a of the paper for any n × m: rows share a state trajectory, columns a distractor trajectory, every panel shows all points in
//! grey and its own trajectory coloured by time, or by a column of the table.

mod layout;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::coloring::{Coloring, Scale, Span};
use super::heading::Heading;
use super::legend::{self, BAR_ROOM, Mark};
use super::map::{Foot, Placed, Window, said_left_out, said_outside};
use crate::picture::color::{CONTEXT, Color, FAINT, RULE, viridis};
use crate::picture::font::{Weight, fit};
use crate::picture::number::LABEL_SIZE;
use crate::picture::{Anchor, Picture, Point, Rect, TextStyle};
use layout::{Layout, dot, own_dot};

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

/// The rows of a trajectory that have one colour.
type Layer = (Color, Vec<usize>);

impl Panels {
    /// Draws the figure: up to five columns fill one column of a paper, more fill the page.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let coloring = self.coloring.as_ref().map(|coloring| coloring.of_shown(self.shown()));
        let entries = coloring.as_ref().map(|coloring| coloring.entries(self.shown(), FAINT));
        let (names, colors) = entries.unwrap_or_default();
        let bar = self.bar();
        let room = bar.as_ref().map_or(BAR_ROOM, |(span, _)| legend::bar_room(span.as_ref()));
        let window = Window::of(&self.points);
        let layout = Layout::new((self.states.len(), self.distractors.len()), window.aspect(), room);
        let placed = window.place(&self.points, (layout.side, layout.high));
        let (key, foot) = (legend::label_height(&names, layout.width - 12.0), self.foot(&placed, layout.width));
        let (mut picture, top) = self.heading.picture(layout.width, layout.body() + key + foot.height());
        let layout = layout.below(top);
        self.draw_cells(&mut picture, &layout, &placed, coloring.as_ref());
        self.labels(&mut picture, &layout);
        if let Some((span, title)) = &bar {
            legend::color_bar(&mut picture, layout.bar(), span.as_ref(), title);
        }
        let under = top + layout.body();
        legend::labels(&mut picture, (8.0, under), (&names, &colors), Mark::Point, layout.width - 12.0);
        foot.write(&mut picture, (8.0, under + key));
        picture
    }

    /// The points of all trajectories that are shown.
    fn shown(&self) -> impl Iterator<Item = usize> {
        self.panels.iter().flat_map(|panel| panel.rows.iter().copied())
    }

    /// The first and the last step of all trajectories that are shown, which may begin late or end early.
    fn time(&self) -> (u32, u32) {
        let steps = || self.shown().map(|row| self.steps[row]);
        (steps().min().unwrap_or(0), steps().max().unwrap_or(0))
    }

    /// What the colour bar shows, and its title; none of kinds.
    fn bar(&self) -> Option<(Option<Span>, &str)> {
        let (first, last) = self.time();
        match &self.coloring {
            None => Some((Some(Span::of_counts(first, last)), "step")),
            Some(coloring @ Coloring::Quantity { name, .. }) => Some((coloring.scale().span, name.as_str())),
            Some(Coloring::Kind { .. }) => None,
        }
    }

    /// What must be known of points that are not there, or are drawn in another way.
    fn foot(&self, placed: &Placed, width: f64) -> Foot {
        let lacking = self.coloring.as_ref().and_then(|coloring| coloring.lacking(self.shown(), "dark grey"));
        let own = placed.outside(self.shown());
        let others = placed.outside(0..placed.count()).saturating_sub(own);
        Foot::of([lacking, said_outside(own), said_left_out(others)], width - 16.0)
    }

    fn draw_cells(&self, picture: &mut Picture, layout: &Layout, placed: &Placed, coloring: Option<&Coloring>) {
        let inside: Vec<Point> = (0..placed.count()).filter_map(|point| placed.center(point)).collect();
        let every = inside.len().div_ceil(MOST).max(1);
        let cloud: Arc<Vec<Point>> = Arc::new(inside.into_iter().step_by(every).collect());
        let (time, scale) = (self.time(), coloring.map(Coloring::scale));
        let colored = coloring.zip(scale.as_ref());
        let most = self.panels.iter().map(|panel| panel.rows.len()).max().unwrap_or(0);
        let radius = own_dot(layout.side, most);
        for (r, &state) in self.states.iter().enumerate() {
            for (c, &distractor) in self.distractors.iter().enumerate() {
                let area = layout.cell(r, c);
                picture.dots((area.x, area.y), cloud.clone(), dot(layout.side, cloud.len()), CONTEXT);
                let panel = self.panels.iter().find(|p| p.state == state && p.distractor == distractor);
                let rows = panel.map_or(&[][..], |p| &p.rows);
                self.trajectory(picture, area, &self.layers(rows, time, colored), (placed, radius));
            }
        }
    }

    /// A trajectory's rows by colour, among trajectories from one step to another; a colouring has one scale for all of them.
    fn layers(&self, rows: &[usize], (first, last): (u32, u32), colored: Option<(&Coloring, &Scale)>) -> Vec<Layer> {
        let whole = i64::from(last - first).max(1);
        let level = |row: usize| match colored {
            Some((coloring, scale)) => coloring.level(row, scale),
            None => (i64::from(self.steps[row] - first) * LEVELS / whole).min(LEVELS - 1),
        };
        let mut layers: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
        for &row in rows {
            layers.entry(level(row)).or_default().push(row);
        }
        let color = |level: i64| match colored {
            None => viridis((level as f64 + 0.5) / LEVELS as f64),
            // The grey of all points would be lost before them.
            Some((coloring, _)) => coloring.color(level, FAINT),
        };
        layers.into_iter().map(|(level, list)| (color(level), list)).collect()
    }

    /// A cell's own rows, a dot each, or a triangle outside, by colour; or why there are none.
    fn trajectory(&self, picture: &mut Picture, area: Rect, layers: &[Layer], (placed, radius): (&Placed, f64)) {
        picture.frame(area, 0.4, RULE);
        if layers.is_empty() {
            let style = TextStyle::new(5.5).anchor(Anchor::Middle).color(FAINT);
            picture.text((area.x + area.w / 2.0, area.y + area.h / 2.0), self.absent, style);
        }
        for (color, rows) in layers {
            let inside: Vec<Point> = rows.iter().filter_map(|&row| placed.center(row)).collect();
            if !inside.is_empty() {
                picture.dots((area.x, area.y), Arc::new(inside), radius, *color);
            }
            for &row in rows.iter().filter(|row| placed.center(**row).is_none()) {
                picture.polygon(&placed.triangle(row, (area.x, area.y)), *color);
            }
        }
    }

    fn labels(&self, picture: &mut Picture, layout: &Layout) {
        let (at, across, down) = (layout.corner(), layout.across(), layout.down());
        let key = TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle).bold();
        let text = |long: &str, short: &str, room: f64| {
            if fit(long, LABEL_SIZE, Weight::Bold, room) == long { long.to_string() } else { short.to_string() }
        };
        let over = text("same distractor in a column", "distractor", across);
        picture.text((at.0 + across / 2.0, at.1 - 12.0), over, key);
        picture.text((8.0, at.1 + down / 2.0), text("same state in a row", "state", down), key.upwards());
        let style = TextStyle::new(6.0).anchor(Anchor::Middle).color(FAINT);
        for (c, d) in self.distractors.iter().enumerate() {
            let text = if layout.side > 42.0 { format!("distractor {d}") } else { d.to_string() };
            picture.text((layout.cell(0, c).x + layout.side / 2.0, at.1 - 3.0), text, style);
        }
        for (r, s) in self.states.iter().enumerate() {
            let text = if layout.high > 26.0 { format!("state {s}") } else { s.to_string() };
            picture.text((at.0 - 3.0, layout.cell(r, 0).y + layout.high / 2.0), text, style.upwards());
        }
    }
}
