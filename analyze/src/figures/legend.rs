//! Keys to colours: a bar for quantities, swatches for kinds.

use crate::picture::axis::{LABEL_SIZE, Scale, TICK_SIZE, labels};
use crate::picture::color::{Color, INK, viridis};
use crate::picture::font::{Weight, width};
use crate::picture::{Anchor, Picture, Rect, TextStyle};

/// Room that a colour bar's ticks and title take right of the bar, points.
pub(super) const BAR_ROOM: f64 = 40.0;

/// Draws an upright viridis bar with ticks on its right and its title reading upwards.
pub(super) fn color_bar(picture: &mut Picture, area: Rect, lo: f64, hi: f64, title: &str) {
    let parts = 64;
    let h = area.h / f64::from(parts);
    for i in 0..parts {
        let y = area.bottom() - f64::from(i + 1) * h;
        // A little overlap hides the seams between neighbouring pieces.
        let overlap = if i == 0 { 0.0 } else { 0.3 };
        picture.fill(Rect::new(area.x, y, area.w, h + overlap), viridis((f64::from(i) + 0.5) / f64::from(parts)));
    }
    picture.frame(area, 0.4, INK);
    let scale = Scale::new(lo, hi, area.bottom(), area.y);
    let ticks = scale.ticks(((area.h / 28.0) as usize).clamp(1, 6));
    let texts = labels(&ticks);
    let widest = texts.iter().map(|t| width(t, TICK_SIZE, Weight::Regular)).fold(0.0, f64::max);
    for (tick, text) in ticks.iter().zip(texts) {
        let y = scale.at(*tick);
        picture.line(&[(area.right(), y), (area.right() + 2.0, y)], 0.5, INK);
        picture.text((area.right() + 3.5, y + 0.36 * TICK_SIZE), text, TextStyle::new(TICK_SIZE));
    }
    let at = (area.right() + 3.5 + widest + LABEL_SIZE + 1.0, area.y + area.h / 2.0);
    picture.text(at, title, TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle).upwards());
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
