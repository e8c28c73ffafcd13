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

/// What the values of all points are told apart by: the range of a quantity, or the kinds that occur, in order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scale {
    /// The range of a quantity.
    pub(super) range: (f64, f64),
    kinds: Vec<u32>,
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
        let range = match self {
            Self::Quantity { values, .. } => range(values),
            Self::Kind { .. } => (0.0, 1.0),
        };
        Scale { range, kinds: self.kinds() }
    }

    /// The number of a point's colour: a 64th of the range, or the kind's place among those that occur, so that ten kinds have ten colours whatever
    /// their numbers; −1 for none.
    pub(super) fn level(&self, i: usize, Scale { range: (lo, hi), kinds: occurring }: &Scale) -> i64 {
        match self {
            Self::Quantity { values, .. } if values[i].is_finite() => {
                ((values[i] - lo) / (hi - lo).max(1e-12) * (LEVELS - 1.0)).round() as i64
            }
            Self::Kind { kinds, .. } => {
                let place = kinds[i].and_then(|kind| occurring.binary_search(&kind).ok());
                place.map_or(-1, |place| (place % TEN.len()) as i64)
            }
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

    /// The colour of every point; none of one that has no quantity or kind.
    pub fn of_points(&self) -> Vec<Option<Color>> {
        let points = match self {
            Self::Quantity { values, .. } => values.len(),
            Self::Kind { kinds, .. } => kinds.len(),
        };
        let scale = self.scale();
        let levels = (0..points).map(|i| self.level(i, &scale));
        levels.map(|level| (level >= 0).then(|| self.color(level))).collect()
    }

    /// The colours of the kinds in a legend, in the order of their names.
    pub(super) fn colors(&self) -> Vec<Color> {
        TEN.into_iter().take(self.kinds().len()).collect()
    }

    /// The kinds that occur, in order; none of a quantity.
    fn kinds(&self) -> Vec<u32> {
        let Self::Kind { kinds, .. } = self else { return Vec::new() };
        kinds.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The names of the kinds in a legend, as many as there are colours; none of a quantity.
    pub(super) fn names(&self) -> Vec<String> {
        let Self::Kind { name, names: called, .. } = self else { return Vec::new() };
        let occurring = self.kinds();
        let shown = occurring.iter().take(TEN.len());
        let mut names: Vec<String> = if called.is_empty() {
            let short = |(at, kind): (usize, &u32)| if at == 0 { format!("{name} {kind}") } else { kind.to_string() };
            shown.enumerate().map(short).collect()
        } else {
            let of_kind = |&kind: &u32| called.get(kind as usize).map_or("", String::as_str);
            shown.map(|kind| fit(of_kind(kind), LABEL_SIZE, Weight::Regular, 90.0)).collect()
        };
        if let Some(last) = names.last_mut().filter(|_| occurring.len() > TEN.len()) {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn states(kinds: &[Option<u32>]) -> Coloring {
        Coloring::Kind { name: "state".into(), kinds: kinds.to_vec(), names: Vec::new() }
    }

    fn levels(coloring: &Coloring, points: usize) -> Vec<i64> {
        let scale = coloring.scale();
        (0..points).map(|i| coloring.level(i, &scale)).collect()
    }

    #[test]
    fn two_kinds_have_two_colours_whatever_their_numbers() {
        let two = states(&[Some(13), Some(3), None, Some(13)]);
        assert_eq!(levels(&two, 4), [1, 0, -1, 1]);
        assert_eq!(two.of_points(), [Some(TEN[1]), Some(TEN[0]), None, Some(TEN[1])]);
        assert_eq!((two.colors(), two.names()), (TEN[..2].to_vec(), vec!["state 3".to_owned(), "13".to_owned()]));
        let called = Coloring::Kind {
            name: "weather".into(),
            kinds: vec![Some(12), Some(2)],
            names: (0..13).map(|kind| format!("kind {kind}")).collect(),
        };
        assert_eq!((levels(&called, 2), called.names()), (vec![1, 0], vec!["kind 2".to_owned(), "kind 12".to_owned()]));
    }

    #[test]
    fn kinds_that_are_not_shown_take_no_colour_from_those_that_are() {
        let many: Vec<Option<u32>> = (0..12).map(Some).collect();
        let two = states(&many).of_shown([0, 10].into_iter());
        let levels = levels(&two, 12);
        assert_eq!((levels[0], levels[10], two.names().len()), (0, 1, 2));
        let few = states(&many[..4]);
        assert_eq!(few.of_shown([1, 3].into_iter()), few, "colours as in the other figures");
    }

    #[test]
    fn kinds_beyond_the_colours_repeat_them_and_the_legend_says_so() {
        let many: Vec<Option<u32>> = (0..12).map(|kind| Some(kind * 5)).collect();
        let many = states(&many);
        assert_eq!(levels(&many, 12)[9..], [9, 0, 1]);
        assert_eq!((many.colors().len(), many.names().len()), (10, 10));
        assert_eq!(many.names()[9], "45 (colours repeat)");
    }
}
