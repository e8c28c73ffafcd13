//! Curves over training (Figure 3 of the paper): one facet a metric, one line a group of runs, a band for its interval.

mod line;
#[cfg(test)]
mod tests;

pub use line::Curve;

use super::axes::{Axes, chart};
use super::colors;
use super::heading::Heading;
use super::legend::{self, Mark};
use crate::picture::color::{Color, FAINT, LINES, kind};
use crate::picture::font::{Weight, wrap};
use crate::picture::number::LABEL_SIZE;
use crate::picture::{COLUMN, PAGE, Picture, Rect, TextStyle};

/// From one line of a name to the next, points.
const LINE: f64 = LABEL_SIZE + 1.5;
/// Size of the foot, points.
const FOOT: f64 = 6.0;
/// From one line of the foot to the next, points.
const FOOT_LINE: f64 = 7.5;
/// An x axis begins at 0 where the first place is no further from it than this share of the last one: a corner without a label is taken for 0.
const NEAR: f64 = 0.05;

/// One metric, of one task if there are several.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Its name and unit.
    pub metric: String,
    /// Its lines; without any it is not drawn, and keeps its place.
    pub curves: Vec<Curve>,
}

/// The figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    /// Title and note.
    pub heading: Heading,
    /// What the x axis counts, as in "updates".
    pub axis: String,
    /// Names of the groups.
    pub groups: Vec<String>,
    /// How many facets stand side by side, where a column means something, as a task; none leaves it to the figure.
    pub columns: Option<usize>,
    /// The metrics, row by row.
    pub facets: Vec<Facet>,
    /// What must be known of the bands; nothing in most figures. What was cut or is drawn thinner is said behind it.
    pub foot: String,
}

impl Curves {
    /// Draws the figure: one facet at column width, more side by side, three to a page's width.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let columns = self.columns();
        let width = if columns == 1 { COLUMN } else { PAGE };
        let rows = self.facets.len().div_ceil(columns).max(1);
        let w = (width - 6.0) / columns as f64;
        // Room for the longest name, so that the plots stand in line.
        let lines = self.facets.iter().map(|facet| facet.title(w - 12.0).len()).max().unwrap_or(1).max(1);
        let above = 12.0 + (lines - 1) as f64 * LINE;
        let h = above + if columns == 1 { 138.0 } else { 116.0 };
        let numbers = colors::numbers(&self.groups);
        let (names, shades) = self.names(&numbers);
        let key = legend::label_height(&names, width - 12.0) + 4.0;
        let foot = wrap(&self.foot_text(), FOOT, Weight::Regular, width - 12.0);
        let below = if foot.is_empty() { 0.0 } else { foot.len() as f64 * FOOT_LINE + 3.0 };
        let (mut picture, top) = self.heading.picture(width, key + rows as f64 * h + below);
        legend::labels(&mut picture, (6.0, top), (&names, &shades), Mark::Line, width - 12.0);
        for (i, facet) in self.facets.iter().enumerate().filter(|(_, facet)| !facet.curves.is_empty()) {
            let (x, y) = ((i % columns) as f64 * w, top + key + (i / columns) as f64 * h);
            let area = Rect::new(x + 34.0, y + above, w - 42.0, h - above - 26.0);
            facet.draw(&mut picture, area, &self.axis, &numbers);
        }
        draw_foot(&mut picture, foot, top + key + rows as f64 * h);
        picture
    }

    /// How many facets stand side by side.
    fn columns(&self) -> usize {
        let usual = match self.facets.len() {
            0 | 1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        self.columns.unwrap_or(usual).max(1)
    }

    /// The groups' names in the legend with their colours, in the order of these, which is that of their dashes too; the last with a word where no line is left that looks like no other.
    fn names(&self, numbers: &[usize]) -> (Vec<String>, Vec<Color>) {
        let mut order: Vec<usize> = (0..self.groups.len()).collect();
        order.sort_by_key(|group| numbers[*group]);
        let mut names: Vec<String> = order.iter().map(|group| self.groups[*group].clone()).collect();
        if let Some(last) = names.last_mut().filter(|_| self.groups.len() > LINES) {
            last.push_str(" (colours repeat)");
        }
        (names, order.into_iter().map(|group| kind(numbers[group])).collect())
    }

    /// The foot with what was done to lines and bands.
    fn foot_text(&self) -> String {
        let foot = Some(&self.foot).filter(|foot| !foot.is_empty()).cloned();
        foot.into_iter().chain(self.facts()).collect::<Vec<_>>().join("; ")
    }

    /// What was done to lines and bands and must be known, a fact each: bands that are cut, and lines that are broken.
    #[must_use]
    pub fn facts(&self) -> Vec<String> {
        let mut facts = Vec::new();
        let cut: Vec<&str> = self.facets.iter().filter(|f| f.is_cut()).map(|f| f.metric.as_str()).collect();
        let shown = self.facets.iter().filter(|facet| !facet.curves.is_empty()).count();
        if !cut.is_empty() {
            let of = if cut.len() == shown { String::new() } else { format!(" ({})", cut.join(", ")) };
            facts.push(format!("a band that reaches the edge of its panel goes on beyond it{of}"));
        }
        if self.facets.iter().flat_map(|facet| &facet.curves).any(Curve::has_fewer) {
            facts.push("a line is broken, and drawn thinner, where fewer runs of its group reach".into());
        }
        facts
    }
}

impl Facet {
    /// Its name in lines that fit.
    fn title(&self, room: f64) -> Vec<String> {
        wrap(&self.metric, LABEL_SIZE, Weight::Bold, room)
    }

    /// The range of its x axis.
    fn x_range(&self) -> (f64, f64) {
        let (first, last) = range(self.curves.iter().flat_map(|curve| curve.x.iter().copied())).unwrap_or((0.0, 1.0));
        if first > 0.0 && first < NEAR * last { (0.0, last) } else { (first, last) }
    }

    /// The range of its y axis: that of the means, and of the bands as far as the means' spread reaches beyond them. The band of two runs reaches six times their difference to either side.
    fn y_range(&self) -> (f64, f64) {
        let means = self.curves.iter().flat_map(|curve| curve.mean.iter().copied());
        let (lo, hi) = range(means).unwrap_or((0.0, 1.0));
        let ends = self.curves.iter().flat_map(|curve| curve.band.iter().flatten().flat_map(|band| [band.0, band.1]));
        let (low, high) = range(ends).unwrap_or((lo, hi));
        let spread = hi - lo;
        // Means that do not differ leave the room to the bands.
        let margin = if spread > 1e-9 * lo.abs().max(hi.abs()) { spread } else { f64::INFINITY };
        let (lo, hi) = (low.max(lo - margin).min(lo), high.min(hi + margin).max(hi));
        let pad = 0.04 * (hi - lo);
        (lo - pad, hi + pad)
    }

    /// Whether a band leaves the panel.
    fn is_cut(&self) -> bool {
        let (lo, hi) = self.y_range();
        self.curves.iter().flat_map(|curve| curve.band.iter().flatten()).any(|(low, high)| *low < lo || *high > hi)
    }

    /// Draws it; `numbers` are those of the groups' colours. All bands lie beneath all lines.
    fn draw(&self, picture: &mut Picture, area: Rect, axis_title: &str, numbers: &[usize]) {
        for (up, line) in self.title(area.w + 30.0).into_iter().rev().enumerate() {
            picture.text((area.x - 26.0, area.y - 5.0 - up as f64 * LINE), line, TextStyle::new(LABEL_SIZE).bold());
        }
        let (x, y) = (self.x_range(), self.y_range());
        let axes = Axes { area, x, y, x_title: Some(axis_title), y_axis: true, x_rules: false };
        let number = |curve: &Curve| numbers.get(curve.group).copied().unwrap_or(curve.group);
        chart(picture, axes, |chart| {
            self.curves.iter().try_for_each(|curve| curve.draw_band(chart, number(curve), y))?;
            self.curves.iter().try_for_each(|curve| curve.draw_line(chart, number(curve)))
        });
    }
}

/// Draws the lines of the foot below a height.
fn draw_foot(picture: &mut Picture, lines: Vec<String>, under: f64) {
    for (at, line) in lines.into_iter().enumerate() {
        picture.text((6.0, under + 6.5 + at as f64 * FOOT_LINE), line, TextStyle::new(FOOT).color(FAINT));
    }
}

/// The ends of what is finite of some values, if anything is.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|value| value.is_finite()).fold(None, |ends: Option<(f64, f64)>, value| {
        let (lo, hi) = ends.unwrap_or((value, value));
        Some((f64::min(lo, value), f64::max(hi, value)))
    })
}
