//! How far apart colours are to those who see three of them, and to those without red or green receptors: what the tests of the palettes measure by.

use super::Color;

/// Machado, Oliveira and Fernandes (2009), severity 1: what is seen without red receptors (protanopia), and without green ones (deuteranopia), of linear RGB.
const SIGHTS: [[[f64; 3]; 3]; 3] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.152_286, 1.052_583, -0.204_868], [0.114_503, 0.786_281, 0.099_216], [-0.003_882, -0.048_116, 1.051_998]],
    [[0.367_322, 0.860_646, -0.227_968], [0.280_085, 0.672_501, 0.047_413], [-0.011_820, 0.042_940, 0.968_881]],
];
/// Linear RGB to XYZ over white, D65.
const TO_XYZ: [[f64; 3]; 3] = [
    [0.412_456_4 / 0.950_47, 0.357_576_1 / 0.950_47, 0.180_437_5 / 0.950_47],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9 / 1.088_83, 0.119_192_0 / 1.088_83, 0.950_304_1 / 1.088_83],
];

fn times(matrix: &[[f64; 3]; 3], of: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(of).map(|(a, b)| a * b).sum())
}

fn linear(color: Color) -> [f64; 3] {
    color.rgb.map(|channel| {
        let share = f64::from(channel) / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    })
}

/// CIE L*a*b* of linear RGB.
fn lab(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = times(&TO_XYZ, rgb)
        .map(|part| if part > 216.0 / 24_389.0 { part.cbrt() } else { (24_389.0 / 27.0 * part + 16.0) / 116.0 });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The difference of two colours (CIE 1976) to those who see it least.
pub(crate) fn difference(a: Color, b: Color) -> f64 {
    let seen = |color: Color, sight| lab(times(sight, linear(color)).map(|channel| channel.clamp(0.0, 1.0)));
    let of = |sight| {
        let squares = seen(a, sight).into_iter().zip(seen(b, sight)).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    SIGHTS.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// The difference of the two colours of a palette that are nearest to each other.
pub(crate) fn nearest(palette: &[Color]) -> f64 {
    let pairs = palette.iter().enumerate().flat_map(|(i, a)| palette[..i].iter().map(move |b| difference(*a, *b)));
    pairs.fold(f64::INFINITY, f64::min)
}

/// The contrast of a colour with another one, from 1 to 21, as web pages are judged by.
pub(crate) fn contrast(a: Color, b: Color) -> f64 {
    let light = |color: Color| times(&TO_XYZ, linear(color))[1] + 0.05;
    let (a, b) = (light(a), light(b));
    a.max(b) / a.min(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::color::{INK, WHITE};

    #[test]
    fn what_is_known_of_red_and_green_is_found() {
        let (red, green) = (Color::new(200, 60, 60), Color::new(90, 130, 60));
        let (full, least) = (difference(red, WHITE), difference(red, green));
        assert!(least < 45.0 && full > 45.0, "{least} {full}");
        assert!(difference(INK, INK) < 1e-9 && (contrast(WHITE, Color::new(0, 0, 0)) - 21.0).abs() < 0.01);
    }

    /// Okabe and Ito's green and pink, which stood side by side.
    #[test]
    fn green_and_pink_are_nearly_one_colour_without_green_receptors() {
        let apart = difference(Color::new(0, 158, 115), Color::new(204, 121, 167));
        assert!((17.0..19.0).contains(&apart), "{apart}");
    }
}
