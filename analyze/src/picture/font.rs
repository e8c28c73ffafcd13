//! The embedded font: how wide a text is, and the outlines of its letters.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, GlyphId, OutlineCurve};

/// Regular or bold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Weight {
    /// `DejaVu` Sans.
    Regular,
    /// `DejaVu` Sans Bold.
    Bold,
}

/// A step along a glyph's outline, in ems, y down, relative to the glyph's origin on the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Segment {
    /// Begin a contour.
    Move(f64, f64),
    /// A straight line.
    Line(f64, f64),
    /// A quadratic curve: control point, end.
    Quad(f64, f64, f64, f64),
    /// A cubic curve: two control points, end.
    Cubic(f64, f64, f64, f64, f64, f64),
    /// Close the contour.
    Close,
}

/// A letter of a laid-out text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Letter {
    /// Which glyph of the font.
    pub glyph: u16,
    /// Its origin, ems from the start of the text.
    pub x: f64,
}

static REGULAR: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::try_from_slice(include_bytes!("../../assets/DejaVuSans.ttf")).ok());
static BOLD: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::try_from_slice(include_bytes!("../../assets/DejaVuSans-Bold.ttf")).ok());

/// The font of a weight; absent only if the embedded file were broken, which a test rules out.
fn font(weight: Weight) -> Option<&'static FontRef<'static>> {
    match weight {
        Weight::Regular => REGULAR.as_ref(),
        Weight::Bold => BOLD.as_ref(),
    }
}

/// Places the letters of a text side by side and returns them with the text's width, in ems. A character that the font lacks shows as `?`.
#[must_use]
pub fn lay_out(text: &str, weight: Weight) -> (Vec<Letter>, f64) {
    let Some(font) = font(weight) else { return (Vec::new(), 0.0) };
    let em = f64::from(font.units_per_em().unwrap_or(2048.0));
    let mut x = 0.0;
    let mut letters = Vec::new();
    for c in text.chars() {
        let mut glyph = font.glyph_id(c);
        if glyph == GlyphId(0) {
            glyph = font.glyph_id('?');
        }
        letters.push(Letter { glyph: glyph.0, x });
        x += f64::from(font.h_advance_unscaled(glyph)) / em;
    }
    (letters, x)
}

/// The width of a text, points.
#[must_use]
pub fn width(text: &str, size: f64, weight: Weight) -> f64 {
    lay_out(text, weight).1 * size
}

/// The text cut to a width (points), with an ellipsis if anything was cut.
#[must_use]
pub fn fit(text: &str, size: f64, weight: Weight, room: f64) -> String {
    if width(text, size, weight) <= room {
        return text.to_string();
    }
    let mut cut: Vec<char> = text.chars().collect();
    while cut.pop().is_some() {
        let shorter: String = cut.iter().collect::<String>().trim_end().to_string() + "…";
        if width(&shorter, size, weight) <= room {
            return shorter;
        }
    }
    String::new()
}

/// The text cut to a width (points) in its middle, with an ellipsis if anything was cut: names of runs and of what is shown of them mostly differ at their
/// ends.
#[must_use]
pub fn fit_ends(text: &str, size: f64, weight: Weight, room: f64) -> String {
    if width(text, size, weight) <= room {
        return text.to_string();
    }
    let signs: Vec<char> = text.chars().collect();
    for kept in (2..signs.len()).rev() {
        // Most is the end's, where a number of a run stands before what is shown of it.
        let (head, tail) = (&signs[..kept / 4], &signs[signs.len() - (kept - kept / 4)..]);
        let (head, tail): (String, String) = (head.iter().collect(), tail.iter().collect());
        let shorter = format!("{}…{}", head.trim_end(), tail.trim_start());
        if width(&shorter, size, weight) <= room {
            return shorter;
        }
    }
    fit(text, size, weight, room)
}

/// The text broken at spaces into lines no wider than `room` points (a longer word stands alone).
#[must_use]
pub fn wrap(text: &str, size: f64, weight: Weight, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}"), size, weight) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines
}

/// The outline of a glyph; empty for a space.
#[must_use]
pub fn outline(glyph: u16, weight: Weight) -> Vec<Segment> {
    let Some(font) = font(weight) else { return Vec::new() };
    let Some(outline) = font.outline(GlyphId(glyph)) else { return Vec::new() };
    let em = f64::from(font.units_per_em().unwrap_or(2048.0));
    let p = |p: ab_glyph::Point| (f64::from(p.x) / em, -f64::from(p.y) / em);
    let mut path = Vec::new();
    let mut pen: Option<ab_glyph::Point> = None;
    for curve in outline.curves {
        let (from, to) = match curve {
            OutlineCurve::Line(a, b) => (a, b),
            OutlineCurve::Quad(a, _, b) => (a, b),
            OutlineCurve::Cubic(a, _, _, b) => (a, b),
        };
        if pen != Some(from) {
            if pen.is_some() {
                path.push(Segment::Close);
            }
            path.push(Segment::Move(p(from).0, p(from).1));
        }
        path.push(match curve {
            OutlineCurve::Line(_, b) => Segment::Line(p(b).0, p(b).1),
            OutlineCurve::Quad(_, c, b) => Segment::Quad(p(c).0, p(c).1, p(b).0, p(b).1),
            OutlineCurve::Cubic(_, c, d, b) => Segment::Cubic(p(c).0, p(c).1, p(d).0, p(d).1, p(b).0, p(b).1),
        });
        pen = Some(to);
    }
    if pen.is_some() {
        path.push(Segment::Close);
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_fonts_are_whole_and_know_the_signs_that_figures_use() {
        for weight in [Weight::Regular, Weight::Bold] {
            let font = font(weight).expect("embedded font");
            for c in "Aa0?−±×·°²…≤≥ηθµσ←→–".chars() {
                assert_ne!(font.glyph_id(c), GlyphId(0), "{c} is missing in {weight:?}");
            }
            assert!(!outline(font.glyph_id('A').0, weight).is_empty());
        }
    }

    #[test]
    fn a_cut_text_fits_and_says_that_it_was_cut() {
        let cut = fit("latent dimension seventeen", 7.0, Weight::Regular, 50.0);
        assert!(cut.ends_with('…') && width(&cut, 7.0, Weight::Regular) <= 50.0, "{cut}");
        assert_eq!(fit("short", 7.0, Weight::Regular, 50.0), "short");
    }

    #[test]
    fn names_that_differ_at_the_end_stay_different_when_they_are_cut() {
        let cut = |text: &str| fit_ends(text, 6.5, Weight::Regular, 68.0);
        let names = [
            "cartpole-no-adversary-1: shown",
            "cartpole-no-adversary-1: predicted",
            "cartpole-no-adversary-2: predicted",
            "cartpole-swingup-vibes-seed-1",
            "cartpole-swingup-vibes-seed-2",
        ];
        let cuts = names.map(cut);
        for (i, one) in cuts.iter().enumerate() {
            assert!(one.contains('…') && width(one, 6.5, Weight::Regular) <= 68.0, "{one}");
            assert!(cuts[i + 1..].iter().all(|other| other != one), "{cuts:?}");
        }
        assert_eq!((cut("vibes: shown").as_str(), cut("").as_str()), ("vibes: shown", ""));
        assert_eq!(fit_ends("vibes", 6.5, Weight::Regular, 0.0), "");
    }

    #[test]
    fn wrapped_lines_fit_and_lose_no_word() {
        let text = "after 300 updates the model is barely trained, so read nothing into this picture";
        let lines = wrap(text, 7.0, Weight::Regular, 90.0);
        assert!(lines.iter().all(|l| width(l, 7.0, Weight::Regular) <= 90.0));
        assert_eq!(lines.join(" "), text);
    }
}
