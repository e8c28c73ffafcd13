//! Charts by Plotters inside a figure: an area with axes, ticks and light rules, drawn on by series and marks.

use std::convert::Infallible;

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::picture::color::{self, INK};
use crate::picture::font::{Weight, fit, width};
use crate::picture::number::{LABEL_SIZE, TICK_SIZE, tick};
use crate::picture::plot::{Canvas, UNITS, units, width_units};
use crate::picture::{Anchor, Picture, Rect, TextStyle};

/// A chart that series are drawn on.
pub(super) type Chart<'c, 'p> = ChartContext<'c, Canvas<'p>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
/// What drawing gives; a canvas of ours refuses nothing.
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<Infallible>>;

/// Room beneath an area for ticks and their labels, points.
const BELOW: f64 = 12.0;
/// Room left of an area for ticks and their labels, points.
const LEFT: f64 = 30.0;
/// Length of a tick, points.
const TICK: f64 = 2.5;

/// Which axes a chart has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes<'t> {
    /// Where series are drawn, points.
    pub(super) area: Rect,
    /// The range of x.
    pub(super) x: (f64, f64),
    /// The range of y, upwards.
    pub(super) y: (f64, f64),
    /// The title of the x axis; none draws no x axis.
    pub(super) x_title: Option<&'t str>,
    /// Whether there is a y axis with light rules across.
    pub(super) y_axis: bool,
    /// Whether there are light upright rules.
    pub(super) x_rules: bool,
}

/// Draws axes, and what `series` draws on them.
pub(super) fn chart(picture: &mut Picture, axes: Axes<'_>, series: impl FnOnce(&mut Chart<'_, '_>) -> Drawn) {
    if let Err(error) = drawn(picture, axes, series) {
        // Never seen: said in the picture itself, which is better than a missing chart without a word.
        picture.text((axes.area.x, axes.area.y), error.to_string(), TextStyle::new(TICK_SIZE));
    }
    if let Some(title) = axes.x_title {
        x_title(picture, axes.area, title);
    }
}

fn drawn(picture: &mut Picture, axes: Axes<'_>, series: impl FnOnce(&mut Chart<'_, '_>) -> Drawn) -> Drawn {
    let Axes { area, x_title, y_axis, .. } = axes;
    let (x, y) = (widened(axes.x), widened(axes.y));
    let left = if y_axis { area.x.min(LEFT) } else { 0.0 };
    let below = if x_title.is_some() { BELOW } else { 0.0 };
    let root = Canvas::new(picture).into_drawing_area();
    let size = (width_units(area.w + left), width_units(area.h + below));
    let part = root.shrink((units(area.x - left), units(area.y)), size);
    let mut chart = ChartBuilder::on(&part)
        .y_label_area_size(width_units(left))
        .x_label_area_size(width_units(below))
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    let (x_label, y_label) = (labels(x), labels(y));
    let ink = rgba(INK);
    let mut mesh = chart.configure_mesh();
    mesh.max_light_lines(1)
        .light_line_style(TRANSPARENT)
        .bold_line_style(rgba(color::RULE).stroke_width(width_units(0.4)))
        .axis_style(ink.stroke_width(width_units(0.6)))
        .label_style(("sans-serif", TICK_SIZE * UNITS).into_font().color(&ink))
        .set_all_tick_mark_size(units(TICK))
        .x_labels(((area.w / 30.0) as usize).clamp(2, 10))
        .y_labels(((area.h / 22.0) as usize).clamp(2, 8))
        .x_label_formatter(&x_label)
        .y_label_formatter(&y_label);
    if !axes.x_rules {
        mesh.disable_x_mesh();
    }
    if !y_axis {
        mesh.disable_y_mesh().disable_y_axis();
    }
    if x_title.is_none() {
        mesh.disable_x_axis();
    }
    mesh.draw()?;
    series(&mut chart)
}

/// Labels of the ticks of a range.
fn labels((lo, hi): (f64, f64)) -> impl Fn(&f64) -> String {
    let largest = lo.abs().max(hi.abs());
    move |value| tick(*value, largest)
}

/// An empty range is widened by one around its value, so that it can be drawn.
fn widened((lo, hi): (f64, f64)) -> (f64, f64) {
    let (lo, hi) = if lo.is_finite() && hi.is_finite() { (lo, hi) } else { (0.0, 1.0) };
    if hi > lo { (lo, hi) } else { (lo - 0.5, lo + 0.5) }
}

/// The title under an x axis: a long one stays inside the picture, even if it is then not centred under its axis.
fn x_title(picture: &mut Picture, area: Rect, title: &str) {
    let title = fit(title, LABEL_SIZE, Weight::Regular, picture.width - 8.0);
    let half = width(&title, LABEL_SIZE, Weight::Regular) / 2.0;
    let x = (area.x + area.w / 2.0).min(picture.width - 4.0 - half).max(4.0 + half);
    picture.text((x, area.bottom() + 18.5), title, TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle));
}

/// A colour of ours for Plotters.
pub(super) fn rgba(color: color::Color) -> RGBAColor {
    let [r, g, b] = color.rgb;
    RGBAColor(r, g, b, f64::from(color.alpha))
}

/// An interval along x with short ends, at height `y`.
pub(super) fn whisker(chart: &mut Chart<'_, '_>, y: f64, (lo, hi): (f64, f64), color: color::Color) -> Drawn {
    let style = rgba(color).stroke_width(width_units(0.8));
    let ends = width_units(3.2);
    chart.draw_series([PathElement::new(vec![(lo, y), (hi, y)], style)])?;
    let end = |x: f64| {
        EmptyElement::at((x, y)) + PathElement::new(vec![(0, -(ends as i32) / 2), (0, ends as i32 / 2)], style)
    };
    chart.draw_series([end(lo), end(hi)]).map(|_| ())
}

/// A reference mark across a row, such as chance: a dashed upright line.
pub(super) fn reference(chart: &mut Chart<'_, '_>, x: f64, (from, to): (f64, f64)) -> Drawn {
    let style = rgba(INK).stroke_width(width_units(0.8));
    chart
        .draw_series(DashedLineSeries::new([(x, from), (x, to)], width_units(2.0), width_units(1.6), style))
        .map(|_| ())
}
