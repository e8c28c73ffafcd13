//! What can be read from the latent: one line a quantity, one mark a source (the latent, the action-only control, the shuffled control).

use plotters::prelude::{Circle, Color as _, EmptyElement, PathElement, Polygon};

use super::axes::{Axes, Chart, Drawn, chart, rgba, whisker};
use super::heading::Heading;
use super::legend::{self, Mark};
use crate::picture::color::{Color, FAINT, INK, WHITE, kind};
use crate::picture::font::{Weight, fit, width};
use crate::picture::number::LABEL_SIZE;
use crate::picture::plot::{units, width_units};
use crate::picture::{Anchor, COLUMN, Picture, Rect, TextStyle};

/// Height of one quantity, points.
const PITCH: f64 = 12.0;
/// Scores that are drawn: a little below nothing, to everything.
const RANGE: (f64, f64) = (-0.1, 1.0);

/// A score with its interval.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeMark {
    /// Index into the chart's sources.
    pub source: usize,
    /// The score.
    pub score: f64,
    /// Its 95% interval, if it has one.
    pub interval: Option<(f64, f64)>,
}

/// One quantity that probes try to read.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeRow {
    /// Its section, as in "task: high is good"; rows of a section stand together.
    pub section: String,
    /// Its name.
    pub quantity: String,
    /// One mark a source.
    pub marks: Vec<ProbeMark>,
}

/// The chart.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeChart {
    /// Title and note.
    pub heading: Heading,
    /// What the axis shows, as in "R² on held-out episodes".
    pub axis: String,
    /// The sources in the order of their colours.
    pub sources: Vec<String>,
    /// The quantities.
    pub rows: Vec<ProbeRow>,
}

impl ProbeChart {
    /// Draws the chart at column width. Scores below −0.1 are drawn at −0.1 with an arrow.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let key = legend::label_height(&self.sources, COLUMN - 12.0);
        let sections = self.sections();
        let body = self.rows.len() as f64 * PITCH + sections.len() as f64 * (PITCH + 2.0);
        let (mut picture, top) = self.heading.picture(COLUMN, key + 6.0 + body + 24.0);
        let colors: Vec<Color> = (0..self.sources.len()).map(kind).collect();
        legend::labels(&mut picture, (6.0, top), (&self.sources, &colors), Mark::Point, COLUMN - 12.0);
        let names = self.rows.iter().map(|r| width(&r.quantity, LABEL_SIZE, Weight::Regular));
        let left = names.fold(20.0, f64::max).min(0.45 * COLUMN) + 10.0;
        let area = Rect::new(left, top + key + 6.0, COLUMN - left - 10.0, body);
        let axes = Axes { area, x: RANGE, y: (0.0, area.h), x_title: Some(&self.axis), y_axis: false, x_rules: true };
        let mut y = 0.0;
        let mut placed: Vec<(&ProbeRow, f64)> = Vec::new();
        let mut titles: Vec<(String, f64)> = Vec::new();
        for section in sections {
            y += PITCH + 2.0;
            for row in self.rows.iter().filter(|r| r.section == section) {
                y += PITCH;
                placed.push((row, y - PITCH / 2.0));
            }
            titles
                .push((section.clone(), y - PITCH * self.rows.iter().filter(|r| r.section == section).count() as f64));
        }
        for (row, y) in &placed {
            row.write(&mut picture, left, area.y + y);
        }
        chart(&mut picture, axes, |chart| {
            let style = rgba(FAINT).stroke_width(width_units(0.4));
            chart.draw_series([PathElement::new(vec![(0.0, 0.0), (0.0, area.h)], style)])?;
            placed.iter().try_for_each(|(row, y)| row.draw(chart, area.h - y))
        });
        for (title, y) in titles {
            let (w, y) = (width(&title, LABEL_SIZE, Weight::Bold), area.y + y);
            picture.fill(Rect::new(4.0, y - 11.0, w + 4.0, 10.0), WHITE);
            picture.text((6.0, y - 3.5), title, TextStyle::new(LABEL_SIZE).bold());
        }
        picture
    }

    fn sections(&self) -> Vec<String> {
        let mut sections: Vec<String> = Vec::new();
        for row in &self.rows {
            if !sections.contains(&row.section) {
                sections.push(row.section.clone());
            }
        }
        sections
    }
}

impl ProbeRow {
    fn write(&self, picture: &mut Picture, left: f64, y: f64) {
        let name = fit(&self.quantity, LABEL_SIZE, Weight::Regular, left - 10.0);
        picture.text((left - 4.0, y + 2.5), name, TextStyle::new(LABEL_SIZE).anchor(Anchor::End).color(INK));
    }

    fn draw(&self, chart: &mut Chart<'_, '_>, y: f64) -> Drawn {
        let marks = self.marks.len().max(1) as f64;
        for (i, mark) in self.marks.iter().enumerate().filter(|(_, m)| m.score.is_finite()) {
            // Marks of one row are set a little below each other, so that equal scores stay visible.
            let y = y - (i as f64 - (marks - 1.0) / 2.0) * (PITCH - 4.0) / marks.max(2.0);
            let color = kind(mark.source);
            let inside = |v: f64| v.clamp(RANGE.0, RANGE.1);
            if let Some((lo, hi)) = mark.interval {
                whisker(chart, y, (inside(lo), inside(hi)), color)?;
            }
            let style = rgba(color).filled();
            if mark.score < RANGE.0 {
                // An arrow that points to what lies further left.
                let across = units(4.0);
                let arrow = Polygon::new(vec![(units(-1.0), 0), (across, units(-2.2)), (across, units(2.2))], style);
                chart.draw_series([EmptyElement::at((RANGE.0, y)) + arrow])?;
            } else {
                chart.draw_series([Circle::new((inside(mark.score), y), units(1.9), style)])?;
            }
        }
        Ok(())
    }
}
