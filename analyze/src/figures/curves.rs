//! Curves over training (Figure 3 of the paper): one facet a metric, one line a group of runs, a band for the interval over its runs.

use plotters::prelude::{Circle, Color as _, DashedLineSeries, LineSeries, Polygon};

use super::axes::{Axes, Chart, Drawn, chart, rgba};
use super::heading::Heading;
use super::legend::{self, Mark};
use crate::picture::color::{Color, LINES, dash, kind};
use crate::picture::font::{Weight, wrap};
use crate::picture::number::LABEL_SIZE;
use crate::picture::plot::{units, width_units};
use crate::picture::{COLUMN, PAGE, Picture, Rect, TextStyle};

/// From one line of a name to the next, points.
const LINE: f64 = LABEL_SIZE + 1.5;

/// One line with its band.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Index into the figure's groups.
    pub group: usize,
    /// Positions on the x axis, rising.
    pub x: Vec<f64>,
    /// The mean over the group's runs.
    pub mean: Vec<f64>,
    /// The interval at each x, none where a single run reaches; empty for a single run.
    pub band: Vec<Option<(f64, f64)>>,
}

/// One metric.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Its name and unit.
    pub metric: String,
    /// Its lines.
    pub curves: Vec<Curve>,
}

/// The figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    /// Title and note.
    pub heading: Heading,
    /// What the x axis counts, as in "updates".
    pub axis: String,
    /// Names of the groups, in the order of their colours.
    pub groups: Vec<String>,
    /// The metrics.
    pub facets: Vec<Facet>,
}

impl Curves {
    /// Draws the figure: one facet at column width, more side by side, three to a page's width.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let columns = match self.facets.len() {
            0 | 1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        let width = if columns == 1 { COLUMN } else { PAGE };
        let rows = self.facets.len().div_ceil(columns).max(1);
        let w = (width - 6.0) / columns as f64;
        // Room for the longest name, so that the plots stand in line.
        let lines = self.facets.iter().map(|facet| facet.title(w - 12.0).len()).max().unwrap_or(1).max(1);
        let above = 12.0 + (lines - 1) as f64 * LINE;
        let h = above + if columns == 1 { 138.0 } else { 116.0 };
        let names = self.names();
        let key = legend::label_height(&names, width - 12.0);
        let (mut picture, top) = self.heading.picture(width, key + 4.0 + rows as f64 * h);
        let colors: Vec<Color> = (0..names.len()).map(kind).collect();
        legend::labels(&mut picture, (6.0, top), (&names, &colors), Mark::Line, width - 12.0);
        for (i, facet) in self.facets.iter().enumerate() {
            let (x, y) = ((i % columns) as f64 * w, top + key + 4.0 + (i / columns) as f64 * h);
            facet.draw(&mut picture, Rect::new(x + 34.0, y + above, w - 42.0, h - above - 26.0), &self.axis);
        }
        picture
    }

    /// The groups' names in the legend, the last with a word where no line is left that looks like no other.
    fn names(&self) -> Vec<String> {
        let mut names = self.groups.clone();
        if let Some(last) = names.last_mut().filter(|_| self.groups.len() > LINES) {
            last.push_str(" (colours repeat)");
        }
        names
    }
}

impl Facet {
    /// Its name in lines that fit.
    fn title(&self, room: f64) -> Vec<String> {
        wrap(&self.metric, LABEL_SIZE, Weight::Bold, room)
    }

    fn draw(&self, picture: &mut Picture, area: Rect, axis_title: &str) {
        let finite = |values: &mut dyn Iterator<Item = f64>| {
            let (lo, hi) = values
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            if lo <= hi { (lo, hi) } else { (0.0, 1.0) }
        };
        let x = finite(&mut self.curves.iter().flat_map(|c| c.x.iter().copied()));
        let bands = self.curves.iter().flat_map(|c| c.band.iter().flatten().flat_map(|b| [b.0, b.1]));
        let (y0, y1) = finite(&mut self.curves.iter().flat_map(|c| c.mean.iter().copied()).chain(bands));
        let pad = 0.04 * (y1 - y0);
        let y = (y0 - pad, y1 + pad);
        for (up, line) in self.title(area.w + 30.0).into_iter().rev().enumerate() {
            picture.text((area.x - 26.0, area.y - 5.0 - up as f64 * LINE), line, TextStyle::new(LABEL_SIZE).bold());
        }
        let axes = Axes { area, x, y, x_title: Some(axis_title), y_axis: true, x_rules: false };
        chart(picture, axes, |chart| self.curves.iter().try_for_each(|curve| curve.draw(chart)));
    }
}

impl Curve {
    fn draw(&self, chart: &mut Chart<'_, '_>) -> Drawn {
        let color = kind(self.group);
        let band: Vec<(f64, Option<(f64, f64)>)> = self.x.iter().copied().zip(self.band.iter().copied()).collect();
        for part in band.split(|(_, interval)| interval.is_none()).filter(|part| part.len() > 1) {
            let ends = || part.iter().filter_map(|&(x, interval)| interval.map(|(low, high)| (x, low, high)));
            let upper = ends().map(|(x, _, high)| (x, high));
            let area: Vec<(f64, f64)> = upper.chain(ends().rev().map(|(x, low, _)| (x, low))).collect();
            chart.draw_series([Polygon::new(area, rgba(color.alpha(0.22)))])?;
        }
        // A value that is not a number breaks the line instead of joining its neighbours.
        let points: Vec<(f64, f64)> = self.x.iter().copied().zip(self.mean.iter().copied()).collect();
        for part in points.split(|(_, v)| !v.is_finite()) {
            match part {
                [] => {}
                [one] => {
                    chart.draw_series([Circle::new(*one, units(1.5), rgba(color).filled())])?;
                }
                many => {
                    let style = rgba(color).stroke_width(width_units(1.1));
                    match dash(self.group) {
                        None => chart.draw_series(LineSeries::new(many.iter().copied(), style))?,
                        Some((dash, gap)) => {
                            let (dash, gap) = (width_units(dash), width_units(gap));
                            chart.draw_series(DashedLineSeries::new(many.to_vec(), dash, gap, style))?
                        }
                    };
                }
            }
        }
        Ok(())
    }
}
