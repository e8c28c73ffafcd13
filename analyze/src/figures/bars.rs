//! Numbers with intervals as horizontal bars, in groups that each have their own axis: variance shares, retrieval, symmetry, errors.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use plotters::prelude::{Color as _, Rectangle};

use super::axes::{Axes, Chart, Drawn, chart, reference, rgba, whisker};
use super::colors;
use super::heading::Heading;
use crate::picture::color::{Color, FAINT, INK, kind};
use crate::picture::font::{Weight, fit_ends, width, wrap};
use crate::picture::number::{LABEL_SIZE, TICK_SIZE, fixed, minus};
use crate::picture::{Anchor, COLUMN, Picture, Rect, TextStyle};

/// Height of one bar with its gap, points.
const PITCH: f64 = 13.0;
/// From one line of a group's title to the next, points.
const LINE: f64 = LABEL_SIZE + 1.5;
/// Between a title and its bars, points.
const GAP: f64 = 4.0;
/// Beneath the bars of a group, where the numbers of its axis stand, points.
const BELOW: f64 = 18.0;

/// One number.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// What it is.
    pub label: String,
    /// The number.
    pub value: f64,
    /// Its 95% interval, if it has one.
    pub interval: Option<(f64, f64)>,
    /// What pure chance would give, if that is known.
    pub chance: Option<f64>,
}

/// Bars on one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct BarGroup {
    /// What the axis shows, with its unit.
    pub axis: String,
    /// The axis's range; none takes it from the bars, from 0.
    pub range: Option<(f64, f64)>,
    /// The bars from top to bottom.
    pub bars: Vec<Bar>,
}

/// The chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Title and note.
    pub heading: Heading,
    /// The groups from top to bottom.
    pub groups: Vec<BarGroup>,
}

impl Bars {
    /// Draws the chart at column width.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let chance = self.groups.iter().flat_map(|g| &g.bars).any(|b| b.chance.is_some());
        let foot = if chance { 9.0 } else { 0.0 };
        let body: f64 = self.groups.iter().map(BarGroup::height).sum();
        let (mut picture, mut y) = self.heading.picture(COLUMN, body + foot);
        let labels = self.groups.iter().flat_map(|g| &g.bars).map(|b| width(&b.label, LABEL_SIZE, Weight::Regular));
        let left = labels.fold(20.0, f64::max).min(0.42 * COLUMN) + 12.0;
        let colors = self.colors();
        for group in &self.groups {
            group.draw(&mut picture, (left, y), &colors);
            y += group.height();
        }
        if chance {
            picture.text((left, y + 3.0), "dashed: chance", TextStyle::new(6.0).color(FAINT));
        }
        picture
    }

    /// The colour of everything that bars are of: one that stands in several groups, or several times in one, has one colour, and a method that is known by name the
    /// one that it has in other figures.
    fn colors(&self) -> BTreeMap<String, Color> {
        let mut sources: Vec<String> = Vec::new();
        for source in self.groups.iter().flat_map(|group| &group.bars).map(Bar::source) {
            if !sources.iter().any(|known| known == source) {
                sources.push(source.to_owned());
            }
        }
        let numbers = colors::numbers(&sources);
        sources.into_iter().zip(numbers).map(|(source, number)| (source, kind(number))).collect()
    }
}

impl BarGroup {
    fn range(&self) -> (f64, f64) {
        let ends = self.bars.iter().flat_map(|b| {
            let (lo, hi) = b.interval.unwrap_or((b.value, b.value));
            [b.value, lo, hi, b.chance.unwrap_or(b.value)]
        });
        let (lo, hi) = ends.filter(|v| v.is_finite()).fold((0.0f64, 0.0f64), |(lo, hi), v| (lo.min(v), hi.max(v)));
        self.range.unwrap_or((lo, if hi > lo { hi } else { lo + 1.0 }))
    }

    /// What the axis shows, in lines over the whole figure: an axis is narrower than most titles.
    fn title(&self) -> Vec<String> {
        wrap(&self.axis, LABEL_SIZE, Weight::Regular, COLUMN - 8.0)
    }

    fn height(&self) -> f64 {
        LINE * self.title().len() as f64 + GAP + PITCH * self.bars.len() as f64 + BELOW
    }

    fn draw(&self, picture: &mut Picture, (left, top): (f64, f64), colors: &BTreeMap<String, Color>) {
        let title = self.title();
        let above = LINE * title.len() as f64 + GAP;
        for (i, line) in title.into_iter().enumerate() {
            picture.text((6.0, top + LABEL_SIZE + LINE * i as f64), line, TextStyle::new(LABEL_SIZE));
        }
        // The number stands right of the axis, where no interval can run into it.
        let area = Rect::new(left, top + above, COLUMN - left - 34.0, self.bars.len() as f64 * PITCH);
        let x = self.range();
        let axes = Axes { area, x, y: (0.0, area.h), x_title: Some(""), y_axis: false, x_rules: false };
        // Shares all have three decimals, so that they can be compared at a glance.
        let shares = self.range == Some((0.0, 1.0));
        for (i, bar) in self.bars.iter().enumerate() {
            let text = if shares { fixed(bar.value, 3) } else { number(bar.value) };
            bar.write(picture, area, area.y + (i as f64 + 0.5) * PITCH, &text);
        }
        chart(picture, axes, |chart| {
            self.bars.iter().enumerate().try_for_each(|(i, bar)| {
                let color = colors.get(bar.source()).copied().unwrap_or(INK);
                bar.draw(chart, x, area.h - (i as f64 + 0.5) * PITCH, color)
            })
        });
    }
}

impl Bar {
    /// What it is of: its name, up to what is said of it, as in "latent, 5 nearest".
    fn source(&self) -> &str {
        self.label.split_once(", ").map_or(self.label.as_str(), |(source, _)| source)
    }

    /// Its name on the left, its number on the right.
    fn write(&self, picture: &mut Picture, area: Rect, y: f64, number: &str) {
        let label = fit_ends(&self.label, LABEL_SIZE, Weight::Regular, area.x - 10.0);
        picture.text((area.x - 4.0, y + 2.5), label, TextStyle::new(LABEL_SIZE).anchor(Anchor::End));
        let number = if self.value.is_finite() { minus(number) } else { "no value".to_string() };
        picture.text((area.right() + 5.0, y + 2.3), number, TextStyle::new(TICK_SIZE + 0.5));
    }

    fn draw(&self, chart: &mut Chart<'_, '_>, (lo, hi): (f64, f64), y: f64, color: Color) -> Drawn {
        if !self.value.is_finite() {
            return Ok(());
        }
        let inside = |v: f64| v.clamp(lo, hi);
        let corners = [(inside(0.0), y - 4.0), (inside(self.value), y + 4.0)];
        chart.draw_series([Rectangle::new(corners, rgba(color).filled())])?;
        if let Some(interval) = self.interval {
            whisker(chart, y, interval, (lo, hi), INK)?;
        }
        match self.chance.filter(|chance| chance.is_finite()) {
            Some(chance) => reference(chart, inside(chance), (y - 6.0, y + 6.0)),
            None => Ok(()),
        }
    }
}

/// Three significant digits, without an exponent for ordinary sizes.
pub(super) fn number(v: f64) -> String {
    match v.abs() {
        0.0 => "0".to_string(),
        a if !(1e-4..1e6).contains(&a) => format!("{v:.1e}"),
        a if a < 0.01 => format!("{v:.4}"),
        a if a < 10.0 => format!("{v:.2}"),
        a if a < 100.0 => format!("{v:.1}"),
        _ => format!("{v:.0}"),
    }
}
