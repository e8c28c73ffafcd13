//! What the colour of a point says: a quantity on a scale, or one of several kinds.

mod names;
mod span;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use crate::picture::color::{CONTEXT, Color, viridis};
pub(super) use span::{Span, bulk};

/// Colours of a quantity, from the lowest to the highest.
const LEVELS: f64 = 64.0;

/// Ten colours for kinds, for up to ten rows of a grid: Petroff's, which the colour-blind tell apart too, but for three in place of his greys and of his
/// palest blue, which are those of points without a kind.
const TEN: [Color; 10] = [
    Color::new(63, 144, 218),
    Color::new(255, 169, 14),
    Color::new(189, 31, 1),
    Color::new(0, 75, 45),
    Color::new(131, 45, 182),
    Color::new(169, 107, 89),
    Color::new(231, 99, 0),
    Color::new(185, 172, 112),
    Color::new(25, 25, 60),
    Color::new(15, 195, 225),
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

/// What the values of all points are told apart by: the range of a quantity, or the kinds that occur.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scale {
    /// The range of a quantity; none where no point has a value.
    pub(super) span: Option<Span>,
    /// The place of each kind among those that occur.
    places: BTreeMap<u32, usize>,
}

impl Coloring {
    /// The colouring of a figure that shows these points alone: where there are more kinds than colours, kinds of no such point are none, and take no
    /// colour from those that are shown. Where there are not, every figure of a table has the same colours.
    pub(super) fn of_shown(&self, points: impl Iterator<Item = usize>) -> Self {
        match self {
            Self::Kind { name, kinds, names } if self.kinds().len() > TEN.len() => {
                let mut shown = vec![None; kinds.len()];
                points.for_each(|point| shown[point] = kinds[point]);
                Self::Kind { name: name.clone(), kinds: shown, names: names.clone() }
            }
            _ => self.clone(),
        }
    }

    /// The scale of all points, by which every part of a figure is coloured.
    pub(super) fn scale(&self) -> Scale {
        let span = match self {
            Self::Quantity { values, .. } => Span::of(values),
            Self::Kind { .. } => None,
        };
        Scale { span, places: self.kinds().into_iter().enumerate().map(|(place, kind)| (kind, place)).collect() }
    }

    /// The number of a point's colour: a 64th of the range, or the kind's place among those that occur, so that ten kinds have ten colours whatever
    /// their numbers; −1 for none.
    pub(super) fn level(&self, i: usize, scale: &Scale) -> i64 {
        match (self, &scale.span) {
            (Self::Quantity { values, .. }, Some(span)) if values[i].is_finite() => {
                (span.share(values[i]) * (LEVELS - 1.0)).round() as i64
            }
            (Self::Quantity { .. }, _) => -1,
            (Self::Kind { kinds, .. }, _) => {
                let place = kinds[i].and_then(|kind| scale.places.get(&kind));
                place.map_or(-1, |place| (place % TEN.len()) as i64)
            }
        }
    }

    /// The colour of that number, or the grey of points that have none.
    pub(super) fn color(&self, level: i64, none: Color) -> Color {
        match (self, usize::try_from(level)) {
            (_, Err(_)) => none,
            (Self::Quantity { .. }, Ok(level)) => viridis(level as f64 / (LEVELS - 1.0)),
            (Self::Kind { .. }, Ok(level)) => TEN[level % TEN.len()],
        }
    }

    /// The colour of every point; none of one that has no quantity or kind.
    pub fn of_points(&self) -> Vec<Option<Color>> {
        let points = match self {
            Self::Quantity { values, .. } => values.len(),
            Self::Kind { kinds, .. } => kinds.len(),
        };
        let scale = self.scale();
        let levels = (0..points).map(|i| self.level(i, &scale));
        levels.map(|level| (level >= 0).then(|| self.color(level, CONTEXT))).collect()
    }
}
