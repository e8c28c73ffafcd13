//! Keys to colours: a bar for quantities, swatches for kinds.

use plotters::prelude::{ChartBuilder, Color as _, IntoDrawingArea as _, IntoFont as _, Rectangle};
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axes::{Drawn, rgba};
use crate::picture::color::{Color, INK, viridis};
use crate::picture::font::{Weight, width};
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

/// Where swatches of these names go in a row of this width: lines of (name index, x), points.
pub(super) fn swatch_lines(names: &[String], room: f64) -> Vec<Vec<(usize, f64)>> {
    let mut lines: Vec<Vec<(usize, f64)>> = vec![Vec::new()];
    let mut x = 0.0;
    for (i, name) in names.iter().enumerate() {
        let w = 9.0 + width(name, LABEL_SIZE, Weight::Regular) + 8.0;
        if x + w > room + 8.0 && x > 0.0 {
            lines.push(Vec::new());
            x = 0.0;
        }
        if let Some(line) = lines.last_mut() {
            line.push((i, x));
        }
        x += w;
    }
    lines
}

/// The height of the swatches of these names, points.
pub(super) fn swatch_height(names: &[String], room: f64) -> f64 {
    if names.is_empty() { 0.0 } else { swatch_lines(names, room).len() as f64 * 10.5 }
}

/// Draws swatches with names from left to right, on as many lines as they need.
pub(super) fn swatches(picture: &mut Picture, at: (f64, f64), names: &[String], colors: &[Color], room: f64) {
    for (row, line) in swatch_lines(names, room).iter().enumerate() {
        let y = at.1 + row as f64 * 10.5;
        for &(i, x) in line {
            picture.fill(Rect::new(at.0 + x, y + 1.5, 6.0, 6.0), colors[i]);
            picture.text((at.0 + x + 9.0, y + 7.0), names[i].clone(), TextStyle::new(LABEL_SIZE));
        }
    }
}
