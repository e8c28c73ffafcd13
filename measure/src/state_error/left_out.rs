//! What is left of the error of neighbours, and of random rows, without each trajectory of either kind.
//!
//! In: the queries, their neighbours and the random rows, with what the states of two rows differ by. Out: the means without each state trajectory (or episode) and without each
//! distractor trajectory. What is left out asks nothing and is nobody's neighbour: the next nearest row takes its place, since other trajectories would have brought other
//! neighbours. A query of whose neighbours none is left out has the same ones as before.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::intervals::Trajectories;
use crate::left_out::{Part, each, mean, of_row};
use crate::neighbours::{Neighbours, Space};

/// How far two rows' states are apart.
pub(super) type Apart<'a> = &'a (dyn Fn(usize, usize) -> f64 + Sync);

/// The mean over queries and neighbours without each trajectory; not a number where no query is left, or one has too few rows left that may be its neighbours. `label` bars
/// rows from being a query's neighbours.
pub(super) fn neighbours(
    space: &Space<'_>,
    (queries, found): (&[usize], &Neighbours),
    (trajectories, label): (&Trajectories, &[u32]),
    apart: Apart<'_>,
) -> [Vec<f64>; 2] {
    let part = |(at, &row): (usize, &usize)| {
        let (own, near) = (of_row(trajectories, row), found.rows(at));
        let over =
            |rows: &mut dyn Iterator<Item = usize>| mean(&rows.map(|other| apart(row, other)).collect::<Vec<_>>());
        let allowed = (0..label.len()).filter(|&other| label[other] != label[row]);
        let ranked = Ranked::of(allowed.map(|other| (space.distance(row, other), other)).collect(), found.k());
        let mut without = BTreeMap::new();
        for (kind, number) in near.iter().flat_map(|&other| of_row(trajectories, other as usize)) {
            if own.contains(&(kind, number)) || without.contains_key(&(kind, number)) {
                continue;
            }
            let is_left = |other: usize| trajectories.of_row(other)[kind] != Some(number);
            let left = ranked.left(found.k(), is_left);
            without.insert((kind, number), left.map_or(f64::NAN, |left| over(&mut left.into_iter())));
        }
        Part { own, whole: over(&mut near.iter().map(|&other| other as usize)), without }
    };
    let parts: Vec<Part<f64>> = queries.par_iter().enumerate().map(part).collect();
    each(trajectories, |out| mean(&parts.iter().filter_map(|part| part.left(out)).collect::<Vec<_>>()))
}

/// A row with its distance from a query.
type Candidate = (f64, usize);

/// The nearer first, equals by their row.
fn by_distance(a: &Candidate, b: &Candidate) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// Nearest rows that are sorted beside the neighbours: what takes the place of those that are left out is nearly always among them.
const SPARE: usize = 300;

/// The rows that may be a query's neighbours, the nearest of them in order.
struct Ranked {
    first: Vec<Candidate>,
    /// The others, in any order.
    rest: Vec<Candidate>,
}

impl Ranked {
    fn of(mut candidates: Vec<Candidate>, k: usize) -> Self {
        let sorted = candidates.len().min(k + SPARE);
        if sorted < candidates.len() {
            candidates.select_nth_unstable_by(sorted, by_distance);
        }
        let rest = candidates.split_off(sorted);
        candidates.sort_unstable_by(by_distance);
        Self { first: candidates, rest }
    }

    /// The `k` nearest of those that are left, in any order; none if there are fewer.
    fn left(&self, k: usize, is_left: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
        let near = self.first.iter().map(|near| near.1).filter(|&row| is_left(row)).take(k).collect::<Vec<usize>>();
        if near.len() == k {
            return Some(near);
        }
        nearest(self.first.iter().chain(&self.rest).copied().filter(|other| is_left(other.1)), k)
    }
}

/// The `k` nearest of some rows, in any order; none if there are fewer.
fn nearest(candidates: impl Iterator<Item = Candidate>, k: usize) -> Option<Vec<usize>> {
    let mut left: Vec<Candidate> = candidates.collect();
    if k == 0 || left.len() < k {
        return None;
    }
    left.select_nth_unstable_by(k - 1, by_distance);
    Some(left[..k].iter().map(|near| near.1).collect())
}

/// The mean over pairs of a query and a random row without each trajectory.
pub(super) fn random(pairs: &[(usize, usize)], trajectories: &Trajectories, apart: Apart<'_>) -> [Vec<f64>; 2] {
    let part = |&(row, other): &(usize, usize)| {
        let own = [row, other].into_iter().flat_map(|row| of_row(trajectories, row)).collect();
        Part { own, whole: apart(row, other), without: BTreeMap::new() }
    };
    let parts: Vec<Part<f64>> = pairs.iter().map(part).collect();
    each(trajectories, |out| mean(&parts.iter().filter_map(|part| part.left(out)).collect::<Vec<_>>()))
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::Table;
    use crate::neighbours::{self, Exclude, Metric};

    /// Rows of 4 states under 3 distractors, 5 steps each.
    const ROWS: usize = 60;

    /// The state and the distractor of a row.
    fn cell(row: usize) -> [usize; 2] {
        [row / 15, row / 5 % 3]
    }

    /// Some of the rows with every third one's neighbours.
    struct Chosen {
        latents: Vec<f32>,
        episode: Vec<u32>,
        step: Vec<u32>,
        queries: Vec<usize>,
    }

    impl Chosen {
        fn of(latents: &[f32], rows: &[usize]) -> Self {
            Self {
                latents: rows.iter().flat_map(|&row| latents[2 * row..2 * row + 2].to_vec()).collect(),
                episode: rows.iter().map(|row| (row / 5) as u32).collect(),
                step: rows.iter().map(|row| (row % 5) as u32).collect(),
                queries: (0..rows.len()).filter(|&at| rows[at].is_multiple_of(3)).collect(),
            }
        }

        fn space(&self) -> Space<'_> {
            let table = Table::new(2, &self.latents, &self.episode, &self.step).unwrap();
            Space::new(table, Metric::Euclidean).unwrap()
        }

        fn found(&self) -> Neighbours {
            neighbours::nearest(&self.space(), &self.queries, 3, Exclude::Trajectory).unwrap()
        }
    }

    #[test]
    fn without_a_trajectory_are_the_neighbours_of_a_table_without_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let latents: Vec<f32> = (0..2 * ROWS).map(|_| rng.random_range(-1.0..1.0_f32)).collect();
        let height: Vec<f64> = (0..ROWS).map(|_| rng.random_range(-1.0..1.0_f64)).collect();
        let whole = Chosen::of(&latents, &(0..ROWS).collect::<Vec<_>>());
        let labels: Vec<_> = (0..ROWS).map(|row| ((0, cell(row)[0] as u32), Some(cell(row)[1] as u32))).collect();
        let (trajectories, apart) = (Trajectories::new(&labels), |a: usize, b: usize| (height[a] - height[b]).abs());
        let (queries, found) = (whole.queries.as_slice(), whole.found());
        let left = neighbours(&whole.space(), (queries, &found), (&trajectories, whole.episode.as_slice()), &apart);
        assert_eq!((left[0].len(), left[1].len()), (4, 3));
        for (kind, values) in left.iter().enumerate() {
            for (out, value) in values.iter().enumerate() {
                let kept: Vec<usize> = (0..ROWS).filter(|&row| cell(row)[kind] != out).collect();
                let some = Chosen::of(&latents, &kept);
                let found = some.found();
                let near = |(at, &row): (usize, &usize)| {
                    let distances = found.rows(at).iter().map(|&other| apart(kept[row], kept[other as usize]));
                    distances.sum::<f64>() / 3.0
                };
                let wanted = mean(&some.queries.iter().enumerate().map(near).collect::<Vec<_>>());
                assert!((value - wanted).abs() < 1e-12, "{value} and {wanted} without {out} of kind {kind}");
            }
        }
    }

    /// Rows as far as their number, in falling order, with two that are equally far: beyond those that are sorted too.
    #[test]
    fn the_nearest_that_are_left_are_found_among_all_rows() {
        let last = 3 * SPARE;
        let ranked = Ranked::of((0..=last).rev().map(|row| (row.max(1) as f64, row)).collect(), 3);
        assert_eq!((ranked.first.len(), ranked.rest.len()), (SPARE + 3, 2 * SPARE - 2));
        let left = |is_left: &dyn Fn(usize) -> bool| {
            ranked.left(3, is_left).map(|mut rows| {
                rows.sort_unstable();
                rows
            })
        };
        assert_eq!(left(&|_| true), Some(vec![0, 1, 2]));
        assert_eq!(left(&|row| row != 1), Some(vec![0, 2, 3]));
        assert_eq!(left(&|row| row == 0 || row > 2 * SPARE), Some(vec![0, 2 * SPARE + 1, 2 * SPARE + 2]));
        assert_eq!(left(&|row| row + 2 >= last), Some(vec![last - 2, last - 1, last]));
        assert_eq!(left(&|row| row + 1 >= last), None);
    }

    #[test]
    fn a_random_pair_goes_with_either_of_its_rows() {
        let labels: Vec<_> = (0..ROWS).map(|row| ((0, cell(row)[0] as u32), Some(cell(row)[1] as u32))).collect();
        let left = random(&[(0, 20), (35, 50)], &Trajectories::new(&labels), &|a: usize, b: usize| (b - a) as f64);
        // Pairs of cells (0, 0) and (1, 1), and of (2, 1) and (3, 1), which are 20 and 15 apart.
        assert_eq!(left[0], [15.0, 15.0, 20.0, 20.0]);
        assert!(left[1][0] == 15.0 && left[1][1].is_nan() && left[1][2] == 17.5, "{left:?}");
    }
}
