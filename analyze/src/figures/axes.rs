//! Charts by Plotters inside a figure: an area with axes, ticks and light rules, drawn on by series and marks.

mod ticked;

use std::convert::Infallible;

use plotters::prelude::*;

use crate::picture::color::{self, INK};
use crate::picture::font::{Weight, fit_ends};
use crate::picture::number::{LABEL_SIZE, TICK_SIZE, Ticks};
use crate::picture::plot::{Canvas, UNITS, units, width_units};
use crate::picture::{Anchor, Picture, Rect, TextStyle};
use ticked::{Ticked, across, upwards, widened};

/// A chart that series are drawn on.
pub(super) type Chart<'c, 'p> = ChartContext<'c, Canvas<'p>, Cartesian2d<Ticked, Ticked>>;
/// What drawing gives; a canvas of ours refuses nothing.
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<Infallible>>;

/// Room beneath an area for ticks and their labels, points.
const BELOW: f64 = 12.0;
/// Room left of an area for ticks and their labels, points; wider labels take some of the area.
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
    /// The title of the x axis, which may be empty; none draws no x axis.
    pub(super) x_title: Option<&'t str>,
    /// Whether there is a y axis with light rules across.
    pub(super) y_axis: bool,
    /// Whether there are light upright rules.
    pub(super) x_rules: bool,
}

/// Draws axes, and what `series` draws on them.
pub(super) fn chart(picture: &mut Picture, axes: Axes<'_>, series: impl FnOnce(&mut Chart<'_, '_>) -> Drawn) {
    let (x, y) = (widened(axes.x), widened(axes.y));
    let ticks = upwards(y, axes.area.h);
    let left = if axes.y_axis { LEFT.max(ticks.width() + 2.0 * TICK + 1.0) } else { 0.0 };
    let taken = (left - LEFT).min(axes.area.w / 2.0).max(0.0);
    let area = Rect::new(axes.area.x + taken, axes.area.y, axes.area.w - taken, axes.area.h);
    let axes = Axes { area, x, y, ..axes };
    if let Err(error) = drawn(picture, axes, (across(x, area.w), ticks), left, series) {
        // Never seen: said in the picture itself, which is better than a missing chart without a word.
        picture.text((area.x, area.y), error.to_string(), TextStyle::new(TICK_SIZE));
    }
    if let Some(title) = axes.x_title.filter(|title| !title.is_empty()) {
        x_title(picture, area, title);
    }
}

fn drawn(
    picture: &mut Picture,
    axes: Axes<'_>,
    (x_ticks, y_ticks): (Ticks, Ticks),
    left: f64,
    series: impl FnOnce(&mut Chart<'_, '_>) -> Drawn,
) -> Drawn {
    let Axes { area, x, y, x_title, y_axis, .. } = axes;
    let left = left.min(area.x);
    let below = if x_title.is_some() { BELOW } else { 0.0 };
    let root = Canvas::new(picture).into_drawing_area();
    let size = (width_units(area.w + left), width_units(area.h + below));
    let part = root.shrink((units(area.x - left), units(area.y)), size);
    let mut chart = ChartBuilder::on(&part)
        .y_label_area_size(width_units(left))
        .x_label_area_size(width_units(below))
        .build_cartesian_2d(Ticked::new(x, &x_ticks), Ticked::new(y, &y_ticks))?;
    let (x_label, y_label) = (|value: &f64| x_ticks.text(*value), |value: &f64| y_ticks.text(*value));
    let ink = rgba(INK);
    let mut mesh = chart.configure_mesh();
    mesh.max_light_lines(1)
        .light_line_style(TRANSPARENT)
        .bold_line_style(rgba(color::RULE).stroke_width(width_units(0.4)))
        .axis_style(ink.stroke_width(width_units(0.6)))
        .label_style(("sans-serif", TICK_SIZE * UNITS).into_font().color(&ink))
        .set_all_tick_mark_size(units(TICK))
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

/// The title in the middle under an x axis, no wider than it: what stands beside the axis has a title of its own there.
fn x_title(picture: &mut Picture, area: Rect, title: &str) {
    let title = fit_ends(title, LABEL_SIZE, Weight::Regular, area.w);
    let style = TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle);
    picture.text((area.x + area.w / 2.0, area.bottom() + 18.5), title, style);
}

/// A colour of ours for Plotters.
pub(super) fn rgba(color: color::Color) -> RGBAColor {
    let [r, g, b] = color.rgb;
    RGBAColor(r, g, b, f64::from(color.alpha))
}

/// An interval along x with short ends, at height `y`, as far as it lies in the range of the axis: where it is cut it has no end, since it does not end there.
pub(super) fn whisker(
    chart: &mut Chart<'_, '_>,
    y: f64,
    (lo, hi): (f64, f64),
    range: (f64, f64),
    color: color::Color,
) -> Drawn {
    let style = rgba(color).stroke_width(width_units(0.8));
    let (from, to) = (lo.clamp(range.0, range.1), hi.clamp(range.0, range.1));
    if to > from {
        chart.draw_series([PathElement::new(vec![(from, y), (to, y)], style)])?;
    }
    let half = units(1.6);
    let end = |x: f64| EmptyElement::at((x, y)) + PathElement::new(vec![(0, -half), (0, half)], style);
    let ends = [lo, hi].into_iter().filter(|end| (range.0..=range.1).contains(end));
    chart.draw_series(ends.map(end)).map(|_| ())
}

/// A reference mark across a row, such as chance: a dashed upright line.
pub(super) fn reference(chart: &mut Chart<'_, '_>, x: f64, (from, to): (f64, f64)) -> Drawn {
    let style = rgba(INK).stroke_width(width_units(0.8));
    chart
        .draw_series(DashedLineSeries::new([(x, from), (x, to)], width_units(2.0), width_units(1.6), style))
        .map(|_| ())
}
