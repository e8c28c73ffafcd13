//! How many queries found their state: of the whole grid, and of what is left of it without each state and each distractor. That gives the share and its interval.

use rayon::prelude::*;

use super::without::Query;
use crate::intervals::{Interval, Range, crossed};

/// How many queries found their state, of how many that asked.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    found: usize,
    asked: usize,
}

impl Found {
    fn add(&mut self, is_found: bool) {
        self.found += usize::from(is_found);
        self.asked += 1;
    }

    fn merge(&mut self, other: &Self) {
        self.found += other.found;
        self.asked += other.asked;
    }

    fn share(&self) -> f64 {
        self.found as f64 / self.asked as f64
    }
}

/// How many queries found their state in the whole grid, without each state, and without each distractor.
#[derive(Debug)]
pub(super) struct Tally {
    whole: Found,
    /// `[states]`.
    states: Vec<Found>,
    /// `[distractors]`.
    distractors: Vec<Found>,
}

impl Tally {
    /// Of queries of a grid of `[states, distractors]`, in any order.
    pub(super) fn of(size: [usize; 2], queries: impl ParallelIterator<Item = Query>) -> Self {
        queries.fold(|| Self::zero(size), Self::with).reduce(|| Self::zero(size), Self::merged)
    }

    fn zero(size: [usize; 2]) -> Self {
        let [states, distractors] = size.map(|count| vec![Found::default(); count]);
        Self { whole: Found::default(), states, distractors }
    }

    fn with(mut self, query: Query) -> Self {
        self.whole.add(query.finds());
        for (state, found) in self.states.iter_mut().enumerate().filter(|(state, _)| *state != query.cell().state) {
            found.add(query.finds_without_state(state));
        }
        let others = self.distractors.iter_mut().enumerate().filter(|(other, _)| *other != query.cell().distractor);
        for (distractor, found) in others {
            found.add(query.finds_without_distractor(distractor));
        }
        self
    }

    fn merged(mut self, other: Self) -> Self {
        self.whole.merge(&other.whole);
        self.states.iter_mut().zip(&other.states).for_each(|(sum, more)| sum.merge(more));
        self.distractors.iter_mut().zip(&other.distractors).for_each(|(sum, more)| sum.merge(more));
        self
    }

    /// The share of the whole grid, with its interval. `left` is how many candidates are left without a state, and without a distractor: where the `k` nearest
    /// are all of them, every query finds its state, which says nothing of other grids.
    pub(super) fn interval(&self, k: usize, left: [usize; 2]) -> Interval {
        let shares = |without: &[Found], left: usize| -> Vec<f64> {
            without.iter().map(|found| if k < left { found.share() } else { f64::NAN }).collect()
        };
        let [of_states, of_distractors] = [shares(&self.states, left[0]), shares(&self.distractors, left[1])];
        crossed(self.whole.share(), [&of_states, &of_distractors], Range::Counted)
    }
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::super::without::{Cell, Place, Query};
    use super::Tally;

    /// Every cell of a grid of 4 × 3 asks. Its match under the next distractor is the nearest, and a cell of the next state stands before the one under the last:
    /// what asks without the next distractor misses.
    #[test]
    fn what_is_left_out_neither_asks_nor_is_found() {
        let query = |at: usize| {
            let cell = Cell { state: at / 3, distractor: at % 3 };
            let [next, last] = [1, 2].map(|by| (cell.distractor + by) % 3);
            let place = |row: usize| Place { distance: row as f64, row };
            let mut query = Query::new(1, cell, [4, 3], &[(place(0), next), (place(2), last)]);
            query.count(place(1), Cell { state: (cell.state + 1) % 4, distractor: last });
            query
        };
        let queries: Vec<usize> = (0..12).collect();
        let tally = Tally::of([4, 3], queries.par_iter().map(|&at| query(at)));
        assert_eq!((tally.whole.found, tally.whole.asked), (12, 12));
        assert!(tally.states.iter().all(|left| (left.found, left.asked) == (9, 9)), "{tally:?}");
        // Of eight queries, the four whose next distractor is left out.
        assert!(tally.distractors.iter().all(|left| (left.found, left.asked) == (4, 8)), "{tally:?}");
        let found = tally.interval(1, [5, 6]);
        assert!(found.estimate == 1.0 && found.low.is_finite(), "{found:?}");
        assert!(tally.interval(5, [5, 6]).low.is_nan(), "all that are left were asked for");
    }
}
