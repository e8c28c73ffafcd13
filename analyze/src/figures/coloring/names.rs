//! The words of a legend: what kinds are called, in an order that people would give them.

use std::collections::BTreeSet;

use super::{Coloring, TEN};
use crate::natural::pieces;
use crate::picture::color::Color;

impl Coloring {
    /// The kinds that occur, in the order of their names, or of their numbers where they have none; nothing of a quantity.
    pub(super) fn kinds(&self) -> Vec<u32> {
        let Self::Kind { kinds, names, .. } = self else { return Vec::new() };
        let mut occurring: Vec<u32> = kinds.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect();
        occurring.sort_by_cached_key(|kind| pieces(names.get(*kind as usize).map_or("", String::as_str)));
        occurring
    }

    /// The entries of a legend about some points: the names of the kinds with their colours, and what those of no kind are, which are drawn in `none`. Of a
    /// quantity there are none.
    pub(in super::super) fn entries(
        &self,
        mut points: impl Iterator<Item = usize>,
        none: Color,
    ) -> (Vec<String>, Vec<Color>) {
        let Self::Kind { name, kinds, .. } = self else { return (Vec::new(), Vec::new()) };
        let mut names = self.names();
        let mut colors = TEN[..names.len()].to_vec();
        if points.any(|point| kinds[point].is_none()) {
            names.push(of_none(name));
            colors.push(none);
        }
        (names, colors)
    }

    /// What is to be said of points that have no value of a quantity, and are drawn in a shade of grey; nothing where all have one, and of kinds, whose legend
    /// says it.
    pub(in super::super) fn lacking(&self, mut points: impl Iterator<Item = usize>, grey: &str) -> Option<String> {
        let Self::Quantity { name, values } = self else { return None };
        points.any(|point| !values[point].is_finite()).then(|| format!("{grey}: no {name}"))
    }

    /// The names of the kinds in a legend, as many as there are colours, the last with a word where there are more kinds. They are as long as they are: what
    /// tells them apart may be anywhere.
    pub(super) fn names(&self) -> Vec<String> {
        let Self::Kind { name, names: called, .. } = self else { return Vec::new() };
        let occurring = self.kinds();
        let of_kind = |(at, kind): (usize, &u32)| match called.get(*kind as usize) {
            Some(called) => called.clone(),
            None if at == 0 => format!("{name} {kind}"),
            None => kind.to_string(),
        };
        let mut names: Vec<String> = occurring.iter().take(TEN.len()).enumerate().map(of_kind).collect();
        let more = occurring.len() - names.len();
        if let Some(last) = names.last_mut().filter(|_| more > 0) {
            *last = format!("{last} (and {more} more: colours repeat)");
        }
        names
    }
}

/// What points of no kind are called.
fn of_none(kinds: &str) -> String {
    // A cluster is a group that rows are in; all else is something that they have.
    if kinds == "cluster" { "in no group".into() } else { format!("no {kinds}") }
}
