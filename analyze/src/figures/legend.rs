//! Keys to colours: a bar for quantities, labels for series and kinds.

mod bar;

use plotters::element::{DashedPathElement, IntoDynElement as _};
use plotters::prelude::{
    ChartBuilder, Circle, Color as _, IntoDrawingArea as _, IntoFont as _, PathElement, Rectangle, SeriesLabelPosition,
};

pub(super) use bar::{bar_room, color_bar};

use super::axes::{Drawn, rgba};
use crate::picture::color::{Color, INK, dash};
use crate::picture::font::{Weight, fit_ends, width};
use crate::picture::number::{LABEL_SIZE, TICK_SIZE};
use crate::picture::plot::{Canvas, UNITS, units, width_units};
use crate::picture::{Picture, TextStyle};

/// Least room that a colour bar takes with its gap, its ticks and its title, points.
pub(super) const BAR_ROOM: f64 = 40.0;

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
