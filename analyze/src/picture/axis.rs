//! Axes: from data to points, round tick values, and their labels.

use super::color::{INK, RULE};
use super::font::{Weight, fit, width};
use super::{Anchor, Picture, Point, Rect, TextStyle};

/// Size of tick labels, points.
pub const TICK_SIZE: f64 = 6.0;
/// Size of axis titles and legends, points.
pub const LABEL_SIZE: f64 = 7.0;
/// Size of figure titles, points.
pub const TITLE_SIZE: f64 = 8.0;

/// A linear map from data `lo..hi` to points `from..to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Data at `from`.
    pub lo: f64,
    /// Data at `to`.
    pub hi: f64,
    /// Points at `lo`.
    pub from: f64,
    /// Points at `hi`.
    pub to: f64,
}

impl Scale {
    /// A scale; an empty range of data is widened by one around its value, so that it can be drawn.
    #[must_use]
    pub fn new(lo: f64, hi: f64, from: f64, to: f64) -> Self {
        let (lo, hi) = if lo.is_finite() && hi.is_finite() { (lo, hi) } else { (0.0, 1.0) };
        let (lo, hi) = if hi > lo { (lo, hi) } else { (lo - 0.5, lo + 0.5) };
        Self { lo, hi, from, to }
    }

    /// Where a value lies, points.
    #[must_use]
    pub fn at(&self, v: f64) -> f64 {
        self.from + (v - self.lo) / (self.hi - self.lo) * (self.to - self.from)
    }

    /// Round values inside the range, about `count` of them.
    #[must_use]
    pub fn ticks(&self, count: usize) -> Vec<f64> {
        let step = step(self.hi - self.lo, count);
        let (first, last) = ((self.lo / step - 1e-9).ceil() as i64, (self.hi / step + 1e-9).floor() as i64);
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// A step of 1, 2 or 5 times a power of ten that divides `range` into about `count` parts.
fn step(range: f64, count: usize) -> f64 {
    let rough = range / count.max(1) as f64;
    let power = 10f64.powf(rough.log10().floor());
    let times = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .min_by(|a, b| (a - rough / power).abs().total_cmp(&(b - rough / power).abs()));
    power * times.unwrap_or(1.0)
}

/// Labels of ticks: as many decimals as their spacing needs, thousands as `k`, millions as `M`, a true minus sign.
#[must_use]
pub fn labels(ticks: &[f64]) -> Vec<String> {
    let largest = ticks.iter().fold(0.0f64, |m, t| m.max(t.abs()));
    let (unit, suffix) = match largest {
        v if v >= 2e6 => (1e6, "M"),
        v if v >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let spacing = ticks.windows(2).map(|w| (w[1] - w[0]).abs()).fold(largest.max(1e-12), f64::min) / unit;
    let decimals = (0..=6)
        .find(|&d| ((spacing * 10f64.powi(d)).round() - spacing * 10f64.powi(d)).abs() < 1e-6)
        .unwrap_or(6) as usize;
    ticks
        .iter()
        .map(|&t| {
            let v = t / unit;
            if v.abs() < 1e-12 { "0".to_string() } else { minus(&format!("{v:.decimals$}{suffix}")) }
        })
        .collect()
}

/// A number's text with a minus sign in place of the hyphen.
#[must_use]
pub fn minus(text: &str) -> String {
    text.replace('-', "−")
}

/// Draws an x axis under `area`: ticks, labels that do not touch, title.
pub fn draw_x(picture: &mut Picture, area: Rect, scale: &Scale, title: &str) {
    let y = area.bottom();
    picture.line(&[(area.x, y), (area.right(), y)], 0.6, INK);
    let ticks = scale.ticks(((area.w / 45.0) as usize).clamp(2, 8));
    for (tick, label) in ticks.iter().zip(labels(&ticks)) {
        let x = scale.at(*tick);
        picture.line(&[(x, y), (x, y + 2.5)], 0.6, INK);
        picture.text((x, y + 9.0), label, TextStyle::new(TICK_SIZE).anchor(Anchor::Middle));
    }
    // A long title stays inside the picture, even if it is then not centred under its axis.
    let title = fit(title, LABEL_SIZE, Weight::Regular, picture.width - 8.0);
    let half = width(&title, LABEL_SIZE, Weight::Regular) / 2.0;
    let x = (area.x + area.w / 2.0).min(picture.width - 4.0 - half).max(4.0 + half);
    picture.text((x, y + 18.5), title, TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle));
}

/// Draws a y axis left of `area`: ticks, light rules across, labels, title reading upwards.
pub fn draw_y(picture: &mut Picture, area: Rect, scale: &Scale, title: &str) {
    let ticks = scale.ticks(((area.h / 22.0) as usize).clamp(2, 8));
    for (tick, label) in ticks.iter().zip(labels(&ticks)) {
        let y = scale.at(*tick);
        picture.line(&[(area.x, y), (area.right(), y)], 0.4, RULE);
        picture.line(&[(area.x - 2.5, y), (area.x, y)], 0.6, INK);
        picture.text((area.x - 4.0, y + 0.36 * TICK_SIZE), label, TextStyle::new(TICK_SIZE).anchor(Anchor::End));
    }
    picture.line(&[(area.x, area.y), (area.x, area.bottom())], 0.6, INK);
    let at: Point = (area.x - 25.0, area.y + area.h / 2.0);
    picture.text(at, title, TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle).upwards());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(Scale::new(0.0, 1.0, 0.0, 100.0).ticks(5), vec![0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(Scale::new(-3.0, 7.0, 0.0, 100.0).ticks(5), vec![-2.0, 0.0, 2.0, 4.0, 6.0]);
    }

    #[test]
    fn labels_have_the_decimals_they_need() {
        assert_eq!(labels(&[0.0, 0.25, 0.5]), ["0", "0.25", "0.50"]);
        assert_eq!(labels(&[-20.0, 0.0, 20.0]), ["−20", "0", "20"]);
        assert_eq!(labels(&[0.0, 50_000.0, 100_000.0]), ["0", "50k", "100k"]);
        assert_eq!(labels(&[0.0, 2e6, 4e6]), ["0", "2M", "4M"]);
    }

    #[test]
    fn an_empty_range_can_still_be_drawn() {
        let scale = Scale::new(2.0, 2.0, 0.0, 10.0);
        assert!((scale.at(2.0) - 5.0).abs() < 1e-12);
        assert!(Scale::new(f64::NAN, 1.0, 0.0, 1.0).at(0.5).is_finite());
    }
}
