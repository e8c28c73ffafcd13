//! Keys to colours: a bar for quantities, labels for series and kinds.

use plotters::element::{DashedPathElement, IntoDynElement as _};
use plotters::prelude::{
    ChartBuilder, Circle, Color as _, IntoDrawingArea as _, IntoFont as _, PathElement, Rectangle, SeriesLabelPosition,
};
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axes::{Drawn, rgba};
use crate::picture::color::{Color, INK, dash, viridis};
use crate::picture::font::{Weight, fit_ends, width};
use crate::picture::number::{LABEL_SIZE, TICK_SIZE, tick};
use crate::picture::plot::{Canvas, UNITS, units, width_units};
use crate::picture::{Picture, Rect, TextStyle};

/// Room that a colour bar's ticks and title take right of the bar, points.
pub(super) const BAR_ROOM: f64 = 40.0;

/// Draws an upright viridis bar with ticks on its right and its title reading upwards.
pub(super) fn color_bar(picture: &mut Picture, area: Rect, lo: f64, hi: f64, title: &str) {
    if let Err(error) = bar(picture, area, (lo, if hi > lo { hi } else { lo + 1.0 }), title) {
        picture.text((area.x, area.y), error.to_string(), TextStyle::new(TICK_SIZE));
    }
    picture.frame(area, 0.4, INK);
}

fn bar(picture: &mut Picture, area: Rect, (lo, hi): (f64, f64), title: &str) -> Drawn {
    let root = Canvas::new(picture).into_drawing_area();
    let size = (width_units(area.w + BAR_ROOM - 6.0), width_units(area.h));
    let part = root.shrink((units(area.x), units(area.y)), size);
    let mut chart = ChartBuilder::on(&part)
        .right_y_label_area_size(width_units(BAR_ROOM - 6.0))
        .build_cartesian_2d(0.0..1.0, lo..hi)?;
    let parts = 64;
    let piece = |i: i32| {
        let at = |i: f64| lo + (hi - lo) * i / f64::from(parts);
        // A little overlap hides the seams between neighbouring pieces.
        let to = (f64::from(i) + if i + 1 < parts { 1.3 } else { 1.0 }).min(f64::from(parts));
        let color = rgba(viridis((f64::from(i) + 0.5) / f64::from(parts)));
        Rectangle::new([(0.0, at(f64::from(i))), (1.0, at(to))], color.filled())
    };
    chart.draw_series((0..parts).map(piece))?;
    let largest = lo.abs().max(hi.abs());
    let ink = rgba(INK);
    chart
        .configure_mesh()
        .disable_mesh()
        .disable_x_axis()
        .axis_style(ink.stroke_width(width_units(0.5)))
        .set_all_tick_mark_size(units(2.0))
        .label_style(("sans-serif", TICK_SIZE * UNITS).into_font().color(&ink))
        .y_labels(((area.h / 28.0) as usize).clamp(2, 6))
        .y_label_formatter(&|value| tick(*value, largest))
        .draw()?;
    let style = ("sans-serif", LABEL_SIZE * UNITS).into_font().color(&ink).transform(FontTransform::Rotate270);
    let style = style.pos(Pos::new(HPos::Center, VPos::Bottom));
    let at = (units(area.w + BAR_ROOM - 12.0), units(area.h / 2.0));
    part.draw_text(title, &style, at)
}

/// How a series is marked in a legend: as it is drawn in its chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// A short piece of the line, dashed where colours repeat.
    Line,
    /// One of the points.
    Point,
}

/// Height of a line of labels, points.
const LINE: f64 = 10.5;
/// Room that a mark takes left of its name, points.
const MARK: f64 = 9.0;
/// Room between one label and the next, points.
const BETWEEN: f64 = 8.0;

/// A label in its line.
struct Label {
    /// Which of the names it is.
    of: usize,
    /// Its left end, points.
    x: f64,
    /// The name, cut in the middle where a whole line is too short for it.
    name: String,
}

/// Where labels of these names go in a row of this width.
fn label_lines(names: &[String], room: f64) -> Vec<Vec<Label>> {
    let mut lines: Vec<Vec<Label>> = vec![Vec::new()];
    let mut x = 0.0;
    for (of, name) in names.iter().enumerate() {
        let name = fit_ends(name, LABEL_SIZE, Weight::Regular, room - MARK);
        let w = MARK + width(&name, LABEL_SIZE, Weight::Regular) + BETWEEN;
        if x + w > room + BETWEEN && x > 0.0 {
            lines.push(Vec::new());
            x = 0.0;
        }
        if let Some(line) = lines.last_mut() {
            line.push(Label { of, x, name });
        }
        x += w;
    }
    lines
}

/// The height of the labels of these names, points.
pub(super) fn label_height(names: &[String], room: f64) -> f64 {
    if names.is_empty() { 0.0 } else { label_lines(names, room).len() as f64 * LINE }
}

/// Draws the labels of series from left to right, on as many lines as they need.
///
/// Each is a series label of Plotters. Only its place is decided here: Plotters puts every label of a chart on a line of its own, inside the chart, and
/// measures them by fonts that it looks for on the machine, while a figure has one legend for several charts, beside them, as low as it can be.
pub(super) fn labels(
    picture: &mut Picture,
    at: (f64, f64),
    (names, colors): (&[String], &[Color]),
    mark: Mark,
    room: f64,
) {
    for (row, line) in label_lines(names, room).iter().enumerate() {
        for Label { of, x, name } in line {
            let at = (at.0 + x, at.1 + row as f64 * LINE + 2.0);
            let dash = dash(*of).filter(|_| mark == Mark::Line);
            if let Err(error) = label(picture, at, name, colors[*of], (mark, dash)) {
                picture.text(at, error.to_string(), TextStyle::new(TICK_SIZE));
            }
        }
    }
}

/// One series label with its upper left corner at a place.
fn label(
    picture: &mut Picture,
    at: (f64, f64),
    name: &str,
    color: Color,
    (mark, dash): (Mark, Option<(f64, f64)>),
) -> Drawn {
    let root = Canvas::new(picture).into_drawing_area();
    let part = root.shrink((units(at.0), units(at.1)), (width_units(MARK), width_units(LINE)));
    let mut chart = ChartBuilder::on(&part).build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
    let color = rgba(color);
    let series = chart.draw_series(std::iter::empty::<Rectangle<(f64, f64)>>())?;
    series.label(name).legend(move |(x, y)| {
        let (ends, style) = (vec![(x, y), (x + units(MARK - 2.5), y)], color.stroke_width(width_units(1.6)));
        match (mark, dash) {
            (Mark::Line, None) => PathElement::new(ends, style).into_dyn(),
            (Mark::Line, Some((dash, gap))) => {
                DashedPathElement::new(ends, width_units(dash), width_units(gap), style).into_dyn()
            }
            (Mark::Point, _) => Circle::new((x + units(3.0), y), units(2.4), color.filled()).into_dyn(),
        }
    });
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::Coordinate(0, 0))
        .margin(0)
        .legend_area_size(width_units(MARK))
        .label_font(("sans-serif", LABEL_SIZE * UNITS).into_font().color(&rgba(INK)))
        .draw()
}
