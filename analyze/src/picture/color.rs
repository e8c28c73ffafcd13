//! Colours that survive print and colour blindness: Okabe and Ito's for lines, viridis for quantities.

#[cfg(test)]
pub(crate) mod blindness;

/// An RGB colour with opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Color {
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// 0 is transparent, 1 opaque.
    pub alpha: f32,
}

impl Color {
    /// An opaque colour.
    #[must_use]
    pub const fn new(r: u8, g: u8, b: u8) -> Self {
        Self { rgb: [r, g, b], alpha: 1.0 }
    }

    /// The same colour with another opacity.
    #[must_use]
    pub const fn alpha(self, alpha: f32) -> Self {
        Self { alpha, ..self }
    }

    /// `#rrggbb`.
    #[must_use]
    pub fn hex(self) -> String {
        let [r, g, b] = self.rgb;
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// Paper.
pub const WHITE: Color = Color::new(255, 255, 255);
/// Text and axes.
pub const INK: Color = Color::new(34, 34, 34);
/// Secondary text.
pub const FAINT: Color = Color::new(110, 110, 110);
/// Grid lines and frames.
pub const RULE: Color = Color::new(205, 205, 205);
/// Points that are only context.
pub const CONTEXT: Color = Color::new(212, 212, 212);

/// Okabe and Ito's colours for up to seven kinds, in an order in which the first four are told apart by everyone: green and pink are one grey without green
/// receptors, so pink comes late. Black is left for text, and their yellow is darker here, since a line of it is not seen on white.
pub const KINDS: [Color; 7] = [
    Color::new(0, 114, 178),
    Color::new(230, 159, 0),
    Color::new(0, 158, 115),
    Color::new(86, 180, 233),
    Color::new(213, 94, 0),
    Color::new(204, 121, 167),
    Color::new(180, 170, 80),
];

/// Dash and gap of lines, points, one for each round of the colours; none is a solid line.
const DASHES: [Option<(f64, f64)>; 3] = [None, Some((3.0, 1.6)), Some((1.1, 1.4))];

/// Lines that are told apart by colour and dash together.
pub const LINES: usize = KINDS.len() * DASHES.len();

/// The colour of the i-th kind; after seven the colours repeat.
#[must_use]
pub fn kind(i: usize) -> Color {
    KINDS[i % KINDS.len()]
}

/// Dash and gap of the i-th kind's line, points: where colours repeat, lines are dashed.
#[must_use]
pub fn dash(i: usize) -> Option<(f64, f64)> {
    DASHES[i / KINDS.len() % DASHES.len()]
}

/// Viridis at `t` in 0..=1, by a polynomial of degree six (largest error 3/255 against matplotlib's table).
#[must_use]
pub fn viridis(t: f64) -> Color {
    const C: [[f64; 3]; 7] = [
        [0.277_727_327, 0.005_407_345, 0.334_099_805],
        [0.105_093_043, 1.404_613_530, 1.384_590_163],
        [-0.330_861_829, 0.214_847_559, 0.095_095_163],
        [-4.634_230_499, -5.799_100_973, -19.332_440_956],
        [6.228_269_936, 14.179_933_367, 56.690_552_601],
        [4.776_384_998, -13.745_145_378, -65.353_032_633],
        [-5.435_455_856, 4.645_852_612, 26.312_435_250],
    ];
    let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 };
    let channel = |c: usize| {
        let v = C.iter().rev().fold(0.0, |sum, row| sum * t + row[c]);
        (v.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    Color::new(channel(0), channel(1), channel(2))
}

#[cfg(test)]
mod tests {
    use super::blindness::{contrast, nearest};
    use super::*;

    #[test]
    fn viridis_agrees_with_the_published_table_at_its_ends_and_middle() {
        for (t, want) in [(0.0, [68, 1, 84]), (0.5, [33, 145, 140]), (1.0, [253, 231, 37])] {
            let got = viridis(t).rgb;
            assert!(got.iter().zip(want).all(|(&g, w)| g.abs_diff(w) <= 4), "{t}: {got:?} vs {want:?}");
        }
    }

    /// Four is as many as most charts have; for more there are no colours that differ as much to everyone.
    #[test]
    fn lines_are_told_apart_by_those_who_see_two_colours_and_on_white() {
        assert!(nearest(&KINDS[..4]) > 22.0, "{}", nearest(&KINDS[..4]));
        assert!(nearest(&KINDS) > 15.0, "{}", nearest(&KINDS));
        for color in KINDS {
            assert!(contrast(color, WHITE) > 2.0, "{} is lost on white", color.hex());
        }
    }

    #[test]
    fn lines_of_one_colour_have_different_dashes() {
        for i in 0..LINES {
            assert!((0..i).all(|other| (kind(other), dash(other)) != (kind(i), dash(i))), "{i}");
        }
        assert_eq!((dash(0), dash(KINDS.len() - 1), dash(LINES)), (None, None, None));
    }

    #[test]
    fn viridis_grows_lighter_all_the_way() {
        let light = |t: f64| {
            viridis(t).rgb.iter().map(|&v| f64::from(v)).zip([0.2126, 0.7152, 0.0722]).map(|(v, w)| v * w).sum::<f64>()
        };
        for i in 0..64 {
            assert!(light(f64::from(i + 1) / 64.0) >= light(f64::from(i) / 64.0));
        }
    }
}
