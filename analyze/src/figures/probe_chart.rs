//! What can be read from the latent: one line a quantity, one mark a source (the latent, the action-only control, the shuffled control).

#[cfg(test)]
mod tests;

use plotters::prelude::{Circle, Color as _, EmptyElement, PathElement, Polygon};

use super::axes::{Axes, Chart, Drawn, chart, rgba, whisker};
use super::heading::Heading;
use super::legend::{self, Mark};
use crate::picture::color::{Color, FAINT, INK, WHITE, kind};
use crate::picture::font::{Weight, fit, width, wrap};
use crate::picture::number::LABEL_SIZE;
use crate::picture::plot::{units, width_units};
use crate::picture::{Anchor, COLUMN, Picture, Rect, TextStyle};

/// Height of one quantity, points: four marks have room below each other.
const PITCH: f64 = 18.0;
/// Height of the name of a section, points.
const SECTION: f64 = 14.0;
/// From one line of what the axis shows to the next, points.
const LINE: f64 = LABEL_SIZE + 1.5;
/// Radius of a mark, points.
const RADIUS: f64 = 1.9;
/// From one mark of a quantity to the next, points: a little more than their height, so that marks with one score hide nothing of each other.
const APART: f64 = 2.0 * RADIUS + 0.4;
/// Scores that are drawn: a little below nothing, to everything.
const RANGE: (f64, f64) = (-0.1, 1.0);
/// What is said where a score lies below; the arrow is the font's.
const BELOW: &str = "← below −0.1";

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

/// What stands in the chart, and at which heights below its upper edge.
struct Places<'c> {
    /// The quantities, by their middles.
    rows: Vec<(&'c ProbeRow, f64)>,
    /// The names of sections, by their upper edges.
    sections: Vec<(&'c str, f64)>,
    /// The height of all.
    height: f64,
}

impl ProbeChart {
    /// Draws the chart at column width. Scores below −0.1 are drawn at −0.1 with an arrow.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let key = legend::label_height(&self.sources, COLUMN - 12.0);
        // Over the whole figure: the axis is narrower than its title.
        let title = wrap(&self.axis, LABEL_SIZE, Weight::Regular, COLUMN - 8.0);
        let above = key + LINE * title.len() as f64 + 5.0;
        let places = self.places();
        let foot = if self.has_lower() { 9.0 } else { 0.0 };
        let (mut picture, top) = self.heading.picture(COLUMN, above + places.height + 15.0 + foot);
        let colors: Vec<Color> = (0..self.sources.len()).map(kind).collect();
        legend::labels(&mut picture, (6.0, top), (&self.sources, &colors), Mark::Point, COLUMN - 12.0);
        for (i, line) in title.into_iter().enumerate() {
            picture.text((6.0, top + key + LABEL_SIZE + LINE * i as f64), line, TextStyle::new(LABEL_SIZE));
        }
        let names = self.rows.iter().map(|r| width(&r.quantity, LABEL_SIZE, Weight::Regular));
        let left = names.fold(20.0, f64::max).min(0.45 * COLUMN) + 10.0;
        let area = Rect::new(left, top + above, COLUMN - left - 10.0, places.height);
        draw_places(&mut picture, area, &places);
        if self.has_lower() {
            picture.text((left, area.bottom() + 20.0), BELOW, TextStyle::new(6.0).color(FAINT));
        }
        picture
    }

    /// Whether a score lies below those that are drawn.
    fn has_lower(&self) -> bool {
        self.rows.iter().flat_map(|row| &row.marks).any(ProbeMark::is_lower)
    }

    /// The rows of each section under its name.
    fn places(&self) -> Places<'_> {
        let mut places = Places { rows: Vec::new(), sections: Vec::new(), height: 0.0 };
        for section in self.sections() {
            places.sections.push((section, places.height));
            places.height += SECTION;
            for row in self.rows.iter().filter(|row| row.section == section) {
                places.rows.push((row, places.height + PITCH / 2.0));
                places.height += PITCH;
            }
        }
        places
    }

    fn sections(&self) -> Vec<&str> {
        let mut sections: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !sections.contains(&row.section.as_str()) {
                sections.push(&row.section);
            }
        }
        sections
    }
}

/// Draws the axis with all that stands in it, and the names beside it.
fn draw_places(picture: &mut Picture, area: Rect, places: &Places<'_>) {
    for (row, y) in &places.rows {
        row.write(picture, area.x, area.y + y);
    }
    let axes = Axes { area, x: RANGE, y: (0.0, area.h), x_title: Some(""), y_axis: false, x_rules: true };
    chart(picture, axes, |chart| {
        let style = rgba(FAINT).stroke_width(width_units(0.4));
        chart.draw_series([PathElement::new(vec![(0.0, 0.0), (0.0, area.h)], style)])?;
        places.rows.iter().try_for_each(|(row, y)| row.draw(chart, area.h - y))
    });
    for (name, y) in &places.sections {
        let (w, y) = (width(name, LABEL_SIZE, Weight::Bold), area.y + y);
        picture.fill(Rect::new(4.0, y + 3.0, w + 4.0, 10.0), WHITE);
        picture.text((6.0, y + 10.5), *name, TextStyle::new(LABEL_SIZE).bold());
    }
}

impl ProbeMark {
    /// Whether it lies below what is drawn.
    fn is_lower(&self) -> bool {
        self.score < RANGE.0
    }
}

impl ProbeRow {
    fn write(&self, picture: &mut Picture, left: f64, y: f64) {
        let name = fit(&self.quantity, LABEL_SIZE, Weight::Regular, left - 10.0);
        picture.text((left - 4.0, y + 2.5), name, TextStyle::new(LABEL_SIZE).anchor(Anchor::End).color(INK));
    }

    fn draw(&self, chart: &mut Chart<'_, '_>, y: f64) -> Drawn {
        let marks = self.marks.len().max(1) as f64;
        // Marks of one row are set below each other, so that equal scores stay visible.
        let apart = APART.min((PITCH - 1.0) / marks);
        for (i, mark) in self.marks.iter().enumerate().filter(|(_, m)| m.score.is_finite()) {
            let y = y - (i as f64 - (marks - 1.0) / 2.0) * apart;
            let color = kind(mark.source);
            if let Some(interval) = mark.interval {
                whisker(chart, y, interval, RANGE, color)?;
            }
            let style = rgba(color).filled();
            if mark.is_lower() {
                // An arrow that points to what lies further left.
                let (tip, back, half) = (units(-1.0), units(4.0), units(RADIUS));
                let arrow = Polygon::new(vec![(tip, 0), (back, -half), (back, half)], style);
                chart.draw_series([EmptyElement::at((RANGE.0, y)) + arrow])?;
            } else {
                let x = mark.score.min(RANGE.1);
                chart.draw_series([Circle::new((x, y), units(RADIUS), style)])?;
            }
        }
        Ok(())
    }
}
