//! Numbers with intervals as horizontal bars, in groups that each have their own axis: variance shares, retrieval, symmetry, errors.

use plotters::prelude::{Color as _, Rectangle};

use super::axes::{Axes, Chart, Drawn, chart, reference, rgba, whisker};
use super::heading::Heading;
use crate::picture::color::{FAINT, INK, kind};
use crate::picture::font::{Weight, fit_ends, width};
use crate::picture::number::{LABEL_SIZE, TICK_SIZE, minus};
use crate::picture::{Anchor, COLUMN, Picture, Rect, TextStyle};

/// Height of one bar with its gap, points.
const PITCH: f64 = 13.0;

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
        let height = |g: &BarGroup| g.bars.len() as f64 * PITCH + 30.0;
        let chance = self.groups.iter().flat_map(|g| &g.bars).any(|b| b.chance.is_some());
        let foot = if chance { 9.0 } else { 0.0 };
        let (mut picture, mut y) = self.heading.picture(COLUMN, self.groups.iter().map(height).sum::<f64>() + foot);
        let labels = self.groups.iter().flat_map(|g| &g.bars).map(|b| width(&b.label, LABEL_SIZE, Weight::Regular));
        let left = labels.fold(20.0, f64::max).min(0.42 * COLUMN) + 12.0;
        for group in &self.groups {
            group.draw(&mut picture, left, y);
            y += height(group);
        }
        if chance {
            picture.text((left, y + 3.0), "dashed: chance", TextStyle::new(6.0).color(FAINT));
        }
        picture
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

    fn draw(&self, picture: &mut Picture, left: f64, top: f64) {
        // The number stands right of the axis, where no interval can run into it.
        let area = Rect::new(left, top, COLUMN - left - 34.0, self.bars.len() as f64 * PITCH);
        let x = self.range();
        let axes = Axes { area, x, y: (0.0, area.h), x_title: Some(&self.axis), y_axis: false, x_rules: false };
        // Shares all have three decimals, so that they can be compared at a glance.
        let shares = self.range == Some((0.0, 1.0));
        for (i, bar) in self.bars.iter().enumerate() {
            let y = top + (i as f64 + 0.5) * PITCH;
            let text = if shares { format!("{:.3}", bar.value) } else { number(bar.value) };
            bar.write(picture, area, y, &text);
        }
        chart(picture, axes, |chart| {
            let middle = |i: usize| area.h - (i as f64 + 0.5) * PITCH;
            self.bars.iter().enumerate().try_for_each(|(i, bar)| bar.draw(chart, x, middle(i), i))
        });
    }
}

impl Bar {
    /// Its name on the left, its number on the right.
    fn write(&self, picture: &mut Picture, area: Rect, y: f64, number: &str) {
        let label = fit_ends(&self.label, LABEL_SIZE, Weight::Regular, area.x - 10.0);
        picture.text((area.x - 4.0, y + 2.5), label, TextStyle::new(LABEL_SIZE).anchor(Anchor::End));
        let number = if self.value.is_finite() { minus(number) } else { "no value".to_string() };
        picture.text((area.right() + 5.0, y + 2.3), number, TextStyle::new(TICK_SIZE + 0.5));
    }

    fn draw(&self, chart: &mut Chart<'_, '_>, (lo, hi): (f64, f64), y: f64, i: usize) -> Drawn {
        if !self.value.is_finite() {
            return Ok(());
        }
        let inside = |v: f64| v.clamp(lo, hi);
        let corners = [(inside(0.0), y - 4.0), (inside(self.value), y + 4.0)];
        chart.draw_series([Rectangle::new(corners, rgba(kind(i)).filled())])?;
        if let Some((low, high)) = self.interval {
            whisker(chart, y, (inside(low), inside(high)), INK)?;
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
