//! One line of a chart of curves with its band: broken where it is of other runs than before, its band held inside the panel.

use plotters::prelude::{Circle, Color as _, DashedLineSeries, LineSeries, PathElement, Polygon};

use super::super::axes::{Chart, Drawn, rgba};
use crate::picture::color::{dash, kind};
use crate::picture::plot::{units, width_units};

/// Width of a line, points.
const WIDTH: f64 = 1.1;
/// Width of a part that fewer runs reach, points.
const THIN: f64 = 0.5;
/// Width of the interval of a place that stands alone, points.
const ALONE: f64 = 3.0;
/// How much of a band is seen.
const SHADE: f32 = 0.22;

/// One line with its band.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Index into the figure's groups.
    pub group: usize,
    /// Positions on the x axis, rising.
    pub x: Vec<f64>,
    /// The mean over the group's runs.
    pub mean: Vec<f64>,
    /// The interval at each x, none where there is none; empty without any.
    pub band: Vec<Option<(f64, f64)>>,
    /// How many runs of the group reach each x; empty where all reach as far.
    pub runs: Vec<usize>,
}

/// One place on a curve.
#[derive(Clone, Copy)]
struct Place {
    x: f64,
    mean: f64,
    band: Option<(f64, f64)>,
    runs: Option<usize>,
}

impl Curve {
    /// Whether fewer runs reach some places than others.
    pub(super) fn has_fewer(&self) -> bool {
        self.runs.iter().min() != self.runs.iter().max()
    }

    fn places(&self) -> Vec<Place> {
        let place = |(at, (&x, &mean)): (usize, (&f64, &f64))| {
            let band = self.band.get(at).copied().flatten();
            Place { x, mean, band, runs: self.runs.get(at).copied() }
        };
        self.x.iter().zip(&self.mean).enumerate().map(place).collect()
    }

    /// Draws the band, as far as it lies in this range of heights.
    pub(super) fn draw_band(&self, chart: &mut Chart<'_, '_>, number: usize, range: (f64, f64)) -> Drawn {
        let color = rgba(kind(number).alpha(SHADE));
        // Where a run ends both mean and interval jump: nothing leads from one to the other.
        for of_runs in self.places().chunk_by(|a, b| a.runs == b.runs) {
            for part in of_runs.split(|place| place.band.is_none()) {
                let ends = || part.iter().filter_map(|place| place.band.map(|(low, high)| (place.x, low, high)));
                let upper: Vec<(f64, f64)> = ends().map(|(x, _, high)| (x, high)).collect();
                let lower: Vec<(f64, f64)> = ends().map(|(x, low, _)| (x, low)).collect();
                let outline: Vec<(f64, f64)> =
                    held(&upper, range).into_iter().chain(held(&lower, range).into_iter().rev()).collect();
                match part.len() {
                    0 => {}
                    1 => {
                        chart.draw_series([PathElement::new(outline, color.stroke_width(width_units(ALONE)))])?;
                    }
                    _ => {
                        chart.draw_series([Polygon::new(outline, color)])?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Draws the line, broken where other runs reach and where a value is not a number, which would else join its neighbours.
    pub(super) fn draw_line(&self, chart: &mut Chart<'_, '_>, number: usize) -> Drawn {
        let most = self.runs.iter().max().copied();
        for of_runs in self.places().chunk_by(|a, b| a.runs == b.runs) {
            let width = if of_runs[0].runs < most { THIN } else { WIDTH };
            for part in of_runs.split(|place| !place.mean.is_finite()) {
                let points: Vec<(f64, f64)> = part.iter().map(|place| (place.x, place.mean)).collect();
                draw_part(chart, number, points, width)?;
            }
        }
        Ok(())
    }
}

/// Draws an unbroken part of a line: a dot where it is one place.
fn draw_part(chart: &mut Chart<'_, '_>, number: usize, points: Vec<(f64, f64)>, width: f64) -> Drawn {
    let color = rgba(kind(number));
    let style = color.stroke_width(width_units(width));
    match (points.as_slice(), dash(number)) {
        ([], _) => {}
        ([one], _) => {
            chart.draw_series([Circle::new(*one, units(1.5 * width / WIDTH), color.filled())])?;
        }
        (_, None) => {
            chart.draw_series(LineSeries::new(points, style))?;
        }
        (_, Some((dash, gap))) => {
            let (dash, gap) = (width_units(dash), width_units(gap));
            chart.draw_series(DashedLineSeries::new(points, dash, gap, style))?;
        }
    }
    Ok(())
}

/// A line through points held inside a range of heights: where it would leave it, it goes along the edge.
pub(super) fn held(points: &[(f64, f64)], (lo, hi): (f64, f64)) -> Vec<(f64, f64)> {
    let mut held = Vec::new();
    for (at, &(x, v)) in points.iter().enumerate() {
        if let Some(&(x0, v0)) = at.checked_sub(1).and_then(|before| points.get(before)) {
            let edges = if v0 < v { [lo, hi] } else { [hi, lo] };
            let crossed = edges.into_iter().filter(|edge| (v0 < *edge) != (v < *edge));
            held.extend(crossed.map(|edge| (x0 + (x - x0) * (edge - v0) / (v - v0), edge)));
        }
        held.push((x, v.max(lo).min(hi)));
    }
    held
}
