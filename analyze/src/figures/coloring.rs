//! What the colour of a point says: a quantity on a scale, or one of several kinds.

use std::collections::BTreeSet;

use crate::picture::color::{CONTEXT, Color, viridis};
use crate::picture::font::{Weight, fit};
use crate::picture::number::LABEL_SIZE;

/// Colours of a quantity, from the lowest to the highest.
const LEVELS: f64 = 64.0;

/// Petroff's ten colours for kinds (colour-blind safe), for up to ten rows of a grid.
const TEN: [Color; 10] = [
    Color::new(63, 144, 218),
    Color::new(255, 169, 14),
    Color::new(189, 31, 1),
    Color::new(148, 164, 162),
    Color::new(131, 45, 182),
    Color::new(169, 107, 89),
    Color::new(231, 99, 0),
    Color::new(185, 172, 112),
    Color::new(113, 117, 129),
    Color::new(146, 218, 221),
];

/// What the colour of a point says.
#[derive(Clone, Debug, PartialEq)]
pub enum Coloring {
    /// A quantity; not-a-number is drawn grey.
    Quantity {
        /// Its name and unit, for the colour bar.
        name: String,
        /// One value a point.
        values: Vec<f64>,
    },
    /// A kind, by number; none is drawn grey.
    Kind {
        /// What the kinds are, as in "state trajectory".
        name: String,
        /// One kind a point.
        kinds: Vec<Option<u32>>,
        /// What the kinds are called, by number; empty where the number says it.
        names: Vec<String>,
    },
}

impl Coloring {
    /// The range of a quantity.
    pub(super) fn range(&self) -> (f64, f64) {
        match self {
            Self::Quantity { values, .. } => range(values),
            Self::Kind { .. } => (0.0, 1.0),
        }
    }

    /// The number of a point's colour: a 64th of the range, or the kind; −1 for none.
    pub(super) fn level(&self, i: usize, (lo, hi): (f64, f64)) -> i64 {
        match self {
            Self::Quantity { values, .. } if values[i].is_finite() => {
                ((values[i] - lo) / (hi - lo).max(1e-12) * (LEVELS - 1.0)).round() as i64
            }
            Self::Kind { kinds, .. } => kinds[i].map_or(-1, |k| i64::from(k) % TEN.len() as i64),
            Self::Quantity { .. } => -1,
        }
    }

    /// The colour of that number.
    pub(super) fn color(&self, level: i64) -> Color {
        match (self, usize::try_from(level)) {
            (_, Err(_)) => CONTEXT,
            (Self::Quantity { .. }, Ok(level)) => viridis(level as f64 / (LEVELS - 1.0)),
            (Self::Kind { .. }, Ok(level)) => TEN[level % TEN.len()],
        }
    }

    /// The colours of the kinds in a legend, in the order of their names.
    pub(super) fn colors(&self) -> Vec<Color> {
        self.kinds().iter().map(|&k| self.color(i64::from(k) % TEN.len() as i64)).collect()
    }

    fn kinds(&self) -> Vec<u32> {
        let Self::Kind { kinds, .. } = self else { return Vec::new() };
        kinds.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().take(TEN.len()).collect()
    }

    /// The names of the kinds in a legend; none of a quantity.
    pub(super) fn names(&self) -> Vec<String> {
        let Self::Kind { name, kinds, names: called } = self else { return Vec::new() };
        if !called.is_empty() {
            let of_kind = |&kind: &u32| called.get(kind as usize).map_or("", String::as_str);
            let short = |text: &str| fit(text, LABEL_SIZE, Weight::Regular, 90.0);
            let mut names: Vec<String> = self.kinds().iter().map(|kind| short(of_kind(kind))).collect();
            if let Some(last) = names.last_mut().filter(|_| called.len() > TEN.len()) {
                last.push_str(" (colours repeat)");
            }
            return names;
        }
        let largest = kinds.iter().flatten().max().copied().unwrap_or(0);
        let mut names: Vec<String> = self.kinds().iter().map(|k| format!("{name} {k}")).collect();
        for short in names.iter_mut().skip(1) {
            *short = short.trim_start_matches(name.as_str()).trim().to_string();
        }
        if let Some(last) = names.last_mut().filter(|_| largest as usize >= TEN.len()) {
            last.push_str(" (colours repeat)");
        }
        names
    }
}

/// The range of the finite values.
pub(super) fn range(values: &[f64]) -> (f64, f64) {
    let finite = values.iter().filter(|v| v.is_finite());
    let (lo, hi) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    if lo <= hi { (lo, hi) } else { (0.0, 1.0) }
}
