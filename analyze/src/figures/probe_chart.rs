//! What can be read from the latent: one line a quantity, one mark a source (the latent, the action-only control, the shuffled control).

use super::axes::whisker_x;
use super::heading::Heading;
use super::legend;
use crate::picture::axis::{self, LABEL_SIZE, Scale};
use crate::picture::color::{Color, FAINT, INK, RULE, WHITE, kind};
use crate::picture::font::{Weight, fit, width};
use crate::picture::{Anchor, COLUMN, Picture, Rect, TextStyle};

/// Height of one quantity, points.
const PITCH: f64 = 12.0;

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
        let key = legend::swatch_height(&self.sources, COLUMN - 12.0);
        let sections = self.sections();
        let body = self.rows.len() as f64 * PITCH + sections.len() as f64 * (PITCH + 2.0);
        let (mut picture, top) = self.heading.picture(COLUMN, key + 6.0 + body + 24.0);
        let colors: Vec<Color> = (0..self.sources.len()).map(kind).collect();
        legend::swatches(&mut picture, (6.0, top), &self.sources, &colors, COLUMN - 12.0);
        let names = self.rows.iter().map(|r| width(&r.quantity, LABEL_SIZE, Weight::Regular));
        let left = names.fold(20.0, f64::max).min(0.45 * COLUMN) + 10.0;
        let area = Rect::new(left, top + key + 6.0, COLUMN - left - 10.0, body);
        let scale = Scale::new(-0.1, 1.0, area.x, area.right());
        for tick in scale.ticks(((area.w / 45.0) as usize).clamp(2, 8)) {
            let x = scale.at(tick);
            picture.line(&[(x, area.y), (x, area.bottom())], 0.4, if tick.abs() < 1e-9 { FAINT } else { RULE });
        }
        axis::draw_x(&mut picture, area, &scale, &self.axis);
        let mut y = area.y;
        for section in sections {
            y += PITCH + 2.0;
            let w = width(&section, LABEL_SIZE, Weight::Bold);
            picture.fill(Rect::new(4.0, y - 11.0, w + 4.0, 10.0), WHITE);
            picture.text((6.0, y - 3.5), section.clone(), TextStyle::new(LABEL_SIZE).bold());
            for row in self.rows.iter().filter(|r| r.section == section) {
                y += PITCH;
                row.draw(&mut picture, &scale, y - PITCH / 2.0, left);
            }
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
    fn draw(&self, picture: &mut Picture, scale: &Scale, y: f64, left: f64) {
        let name = fit(&self.quantity, LABEL_SIZE, Weight::Regular, left - 10.0);
        picture.text((left - 4.0, y + 2.5), name, TextStyle::new(LABEL_SIZE).anchor(Anchor::End).color(INK));
        let marks = self.marks.len().max(1) as f64;
        for (i, mark) in self.marks.iter().enumerate().filter(|(_, m)| m.score.is_finite()) {
            // Marks of one row are set a little below each other, so that equal scores stay visible.
            let y = y + (i as f64 - (marks - 1.0) / 2.0) * (PITCH - 4.0) / marks.max(2.0);
            let color = kind(mark.source);
            let x = |v: f64| scale.at(v.clamp(scale.lo, scale.hi));
            if let Some((lo, hi)) = mark.interval {
                whisker_x(picture, y, x(lo), x(hi), color);
            }
            if mark.score < scale.lo {
                let tip = x(scale.lo);
                picture.polygon(&[(tip - 1.0, y), (tip + 4.0, y - 2.2), (tip + 4.0, y + 2.2)], color);
            } else {
                picture.dot((x(mark.score), y), 1.9, color);
            }
        }
    }
}
