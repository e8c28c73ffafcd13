//! Whether a query finds its state, and whether it still does where a state or a distractor trajectory is left out of the grid.
//!
//! What is left out asks nothing and is no candidate either: how often queries find their state depends on the candidates as much as on the queries. One of
//! the `k` nearest matches just where fewer than `k` candidates stand before the first match. Who is left out no longer stands there; and if the first
//! match itself goes with its distractor, the first one under another distractor counts in its stead. So two matches and a count of the candidates before
//! them, by state and by distractor, answer for whatever is left out, and nothing is sorted.

/// A candidate in the order of a query: by distance, and ties by row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) distance: f64,
    pub(super) row: usize,
}

impl Place {
    /// Behind every candidate.
    pub(super) const NOWHERE: Self = Self { distance: f64::INFINITY, row: usize::MAX };

    pub(super) fn is_before(self, other: Self) -> bool {
        self.distance.total_cmp(&other.distance).then(self.row.cmp(&other.row)).is_lt()
    }
}

/// A cell of the grid, by the places of its state and its distractor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub(super) state: usize,
    pub(super) distractor: usize,
}

/// What stands before the matches of one query.
#[derive(Debug)]
pub(super) struct Query {
    k: usize,
    cell: Cell,
    first: Place,
    of_first: usize,
    /// The first match under another distractor than the first one of all, if there is any.
    second: Option<Place>,
    before_first: usize,
    /// Those before the first match, `[states]`.
    by_state: Vec<usize>,
    /// Those before the first match, `[distractors]`.
    by_distractor: Vec<usize>,
    /// Those before the second match that are not under the first one's distractor.
    before_second: usize,
}

impl Query {
    /// A query of this cell of `[states, distractors]`, before any candidate is counted. `matches` are all candidates that match, each with its distractor.
    pub(super) fn new(k: usize, cell: Cell, [states, distractors]: [usize; 2], matches: &[(Place, usize)]) -> Self {
        let nearer = |a: (Place, usize), b: (Place, usize)| if b.0.is_before(a.0) { b } else { a };
        let (first, of_first) = matches.iter().copied().reduce(nearer).unwrap_or((Place::NOWHERE, distractors));
        let second = matches.iter().copied().filter(|other| other.1 != of_first).reduce(nearer).map(|other| other.0);
        let [by_state, by_distractor] = [states, distractors].map(|count| vec![0; count]);
        Self { k, cell, first, of_first, second, before_first: 0, by_state, by_distractor, before_second: 0 }
    }

    /// The cell that asks.
    pub(super) fn cell(&self) -> Cell {
        self.cell
    }

    /// The first match, and the first one under another distractor.
    pub(super) fn matches(&self) -> (Place, Option<Place>) {
        (self.first, self.second)
    }

    /// Counts a candidate; matches may be among them, since none stands before a match that it does not go with.
    pub(super) fn count(&mut self, place: Place, cell: Cell) {
        let is_before_second = self.second.is_some_and(|second| place.is_before(second));
        self.count_as(cell, place.is_before(self.first), is_before_second);
    }

    /// Counts a candidate of which it is known what it stands before.
    pub(super) fn count_as(&mut self, cell: Cell, is_before_first: bool, is_before_second: bool) {
        if is_before_first {
            self.before_first += 1;
            self.by_state[cell.state] += 1;
            self.by_distractor[cell.distractor] += 1;
        }
        if is_before_second && cell.distractor != self.of_first {
            self.before_second += 1;
        }
    }

    /// Whether one of the `k` nearest matches.
    pub(super) fn finds(&self) -> bool {
        self.before_first < self.k
    }

    /// Whether one does without a state that is not the query's own.
    pub(super) fn finds_without_state(&self, state: usize) -> bool {
        self.before_first - self.by_state[state] < self.k
    }

    /// Whether one does without a distractor that is not the query's own.
    pub(super) fn finds_without_distractor(&self, distractor: usize) -> bool {
        if distractor == self.of_first {
            return self.second.is_some() && self.before_second < self.k;
        }
        self.before_first - self.by_distractor[distractor] < self.k
    }

    /// Whether none does, whatever is left out and whatever candidates are still to be counted: these only come before a match.
    pub(super) fn is_lost(&self) -> bool {
        let with_state = |state: usize| state != self.cell.state && self.finds_without_state(state);
        let with_distractor = |other: usize| other != self.cell.distractor && self.finds_without_distractor(other);
        !self.finds()
            && !(0..self.by_state.len()).any(with_state)
            && !(0..self.by_distractor.len()).any(with_distractor)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{Cell, Place, Query};

    /// Candidates of a query of cell (0, 0) on a grid, with distances that tie often: those of its state match, but for some.
    fn candidates([states, distractors]: [usize; 2], rng: &mut ChaCha8Rng) -> Vec<(Place, Cell, bool)> {
        let cells = (0..states).flat_map(|state| (0..distractors).map(move |distractor| Cell { state, distractor }));
        let rows = cells.filter(|cell| cell.distractor != 0).flat_map(|cell| [cell; 3]).enumerate();
        rows.map(|(row, cell)| {
            let distance = f64::from(rng.random_range(0..6_u32));
            (Place { distance, row }, cell, cell.state == 0 && row % 3 != 0)
        })
        .collect()
    }

    /// The definition: the candidates that are left, sorted, and whether one of the first `k` matches.
    fn is_found(candidates: &[(Place, Cell, bool)], k: usize, is_left: impl Fn(Cell) -> bool) -> bool {
        let mut left: Vec<_> = candidates.iter().filter(|candidate| is_left(candidate.1)).collect();
        left.sort_by(|a, b| a.0.distance.total_cmp(&b.0.distance).then(a.0.row.cmp(&b.0.row)));
        left.iter().take(k).any(|candidate| candidate.2)
    }

    proptest! {
        #[test]
        fn counts_answer_as_sorting_what_is_left_does(
            seed in any::<u64>(), states in 2_usize..5, distractors in 2_usize..5, k in 1_usize..9,
        ) {
            let candidates = candidates([states, distractors], &mut ChaCha8Rng::seed_from_u64(seed));
            let matches: Vec<(Place, usize)> =
                candidates.iter().filter(|candidate| candidate.2).map(|c| (c.0, c.1.distractor)).collect();
            let mut query = Query::new(k, Cell { state: 0, distractor: 0 }, [states, distractors], &matches);
            let mut was_lost = false;
            for &(place, cell, _) in &candidates {
                query.count(place, cell);
                was_lost |= query.is_lost();
            }
            prop_assert_eq!(query.finds(), is_found(&candidates, k, |_| true));
            for out in 1..states {
                let left = is_found(&candidates, k, |cell| cell.state != out);
                prop_assert_eq!(query.finds_without_state(out), left);
                prop_assert!(!(was_lost && left));
            }
            for out in 1..distractors {
                let left = is_found(&candidates, k, |cell| cell.distractor != out);
                prop_assert_eq!(query.finds_without_distractor(out), left);
                prop_assert!(!(was_lost && left));
            }
        }
    }
}
