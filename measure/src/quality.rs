//! How much of the latent space's neighbourhoods a map keeps: trustworthiness and the share of neighbours kept.
//!
//! In: the space, the map `[rows, 2]`, `k`. Out: both numbers. Neighbours on the map come from a k-d tree (kiddo), neighbours and ranks in the space from
//! matrix products. Above `QualityOptions::rows` rows (above 100,000 rows still fewer, see
//! [`bounded_queries`]) they are taken over that many rows drawn from the generator, each still ranked against the whole table.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;

use crate::Error;
use crate::neighbours::{Exclude, Space, bounded_queries, nearest};

/// The two numbers every map comes with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// 1 when no point is a neighbour on the map that is far in the space (Venna and Kaski; scikit-learn's definition):
    /// `1 - 2 / (n k (2n - 3k - 1)) Σ_i Σ_j max(0, r(i, j) - k)`, `j` over the `k` nearest on the map, `r` the rank in the space.
    pub trustworthiness: f64,
    /// Share of the `k` nearest in the space that are among the `k` nearest on the map.
    pub kept: f64,
    /// Neighbours looked at.
    pub k: usize,
    /// Rows the numbers were taken over.
    pub rows: usize,
}

/// What to measure.
#[derive(Debug, Clone, Copy)]
pub struct QualityOptions {
    /// Neighbours to look at.
    pub k: usize,
    /// Most rows to take the numbers over.
    pub rows: usize,
}

impl Default for QualityOptions {
    fn default() -> Self {
        Self { k: 15, rows: 5000 }
    }
}

/// The quality of a map of the space's rows.
///
/// # Errors
/// A map of another length, or no more than `2k` rows (trustworthiness is defined for `k` below half of them).
pub fn quality(
    space: &Space<'_>,
    map: &[[f32; 2]],
    options: QualityOptions,
    rng: &mut impl Rng,
) -> Result<Quality, Error> {
    let (n, k) = (space.table().rows(), options.k);
    if map.len() != n {
        return Err(Error::Length { what: "map", expected: n, found: map.len() });
    }
    if n <= 2 * k {
        return Err(Error::TooFewRows { what: "trustworthiness", needed: 2 * k + 1, found: n });
    }
    let most = bounded_queries(options.rows, n);
    let mut queries: Vec<usize> = if n > most { index::sample(rng, n, most).into_vec() } else { (0..n).collect() };
    queries.sort_unstable();
    let near = nearest(space, &queries, k, Exclude::Itself)?;
    let near_on_map = nearest_on_map(map, &queries, k);
    let both = |at: usize| near_on_map[at].iter().filter(|row| near.rows(at).contains(row)).count();
    let kept: usize = (0..queries.len()).map(both).sum();
    let intruders = |at: usize| -> Vec<u32> {
        near_on_map[at].iter().filter(|row| !near.rows(at).contains(row)).copied().collect()
    };
    let intruders: Vec<Vec<u32>> = (0..queries.len()).map(intruders).collect();
    let ranks = space.ranks(&queries, &intruders);
    let excess: u64 = ranks.iter().flatten().map(|rank| rank.saturating_sub(k as u64)).sum();
    let (n, k, count) = (n as f64, k as f64, queries.len() as f64);
    let trustworthiness = 1.0 - 2.0 / (count * k * (2.0 * n - 3.0 * k - 1.0)) * excess as f64;
    Ok(Quality { trustworthiness, kept: kept as f64 / (count * k), k: options.k, rows: queries.len() })
}

/// The `k` rows nearest to each query on the map, ties by row.
fn nearest_on_map(map: &[[f32; 2]], queries: &[usize], k: usize) -> Vec<Vec<u32>> {
    /// Asked for beyond `k` and the query itself, so that few queries end within a tie.
    const SPARE: usize = 8;
    let points: Vec<[f64; 2]> = map.iter().map(|at| at.map(f64::from)).collect();
    let tree = ImmutableKdTree::<f64, 2>::new_from_slice(&points);
    let most = NonZero::new(k + 1 + SPARE).unwrap_or(NonZero::<usize>::MIN);
    let near = |&query: &usize| {
        let found = tree.nearest_n::<SquaredEuclidean>(&points[query], most);
        let mut near: Vec<(f64, u32)> = found.iter().map(|near| (near.distance, near.item as u32)).collect();
        let farthest = near.last().map_or(0.0, |last| last.0);
        near.retain(|&(_, row)| row as usize != query);
        if near.len() < k || near[k - 1].0 >= farthest && near.len() + 1 < points.len() {
            // The tree ended within a tie: all rows at that distance count, the first of them by row.
            let squared = |at: &[f64; 2]| (0..2).map(|axis| (at[axis] - points[query][axis]).powi(2)).sum::<f64>();
            let all = points.iter().enumerate().filter(|(row, _)| *row != query);
            near = all.map(|(row, at)| (squared(at), row as u32)).filter(|near| near.0 <= farthest).collect();
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.iter().take(k).map(|&(_, row)| row).collect()
    };
    queries.par_iter().map(near).collect()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{QualityOptions, nearest_on_map, quality};
    use crate::neighbours::{Metric, Space};
    use crate::{Error, Table};

    /// 200 points in 5 dimensions, and a map that keeps two of them and adds noise.
    fn points() -> (Vec<f32>, Vec<[f32; 2]>) {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let values: Vec<f32> = (0..1000).map(|_| rng.random_range(-1.0..1.0)).collect();
        let map = values.chunks_exact(5).map(|x| [x[0] + rng.random_range(-0.3..0.3), x[1]]).collect();
        (values, map)
    }

    /// All others by rising distance.
    fn ranking(points: &[&[f32]], of: usize) -> Vec<usize> {
        let squared = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        let mut others: Vec<usize> = (0..points.len()).filter(|&other| other != of).collect();
        others.sort_by(|&a, &b| squared(points[of], points[a]).total_cmp(&squared(points[of], points[b])));
        others
    }

    #[test]
    fn both_numbers_are_their_definitions() {
        let (values, map) = points();
        let keys = vec![0; 200];
        let space = Space::new(Table::new(5, &values, &keys, &keys).unwrap(), Metric::Euclidean).unwrap();
        let options = QualityOptions { k: 7, rows: 1000 };
        let found = quality(&space, &map, options, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
        let high: Vec<&[f32]> = values.chunks_exact(5).collect();
        let low: Vec<&[f32]> = map.iter().map(|at| at.as_slice()).collect();
        let (mut excess, mut kept) = (0, 0);
        for row in 0..200 {
            let (near, near_on_map) = (ranking(&high, row), ranking(&low, row));
            for other in &near_on_map[..7] {
                let rank = 1 + near.iter().position(|candidate| candidate == other).unwrap();
                excess += rank.saturating_sub(7);
                kept += usize::from(rank <= 7);
            }
        }
        let scale = 2.0 / (200.0 * 7.0 * (2.0 * 200.0 - 3.0 * 7.0 - 1.0));
        assert!((found.trustworthiness - (1.0 - scale * excess as f64)).abs() < 1e-12, "{found:?}");
        assert!((found.kept - kept as f64 / 1400.0).abs() < 1e-12, "{found:?}");
        let sampled =
            quality(&space, &map, QualityOptions { k: 7, rows: 120 }, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        assert_eq!(sampled.rows, 120);
        assert!(
            (sampled.trustworthiness - found.trustworthiness).abs() < 0.03 && (sampled.kept - found.kept).abs() < 0.06
        );
    }

    /// Points on a coarse lattice, half of them in one place: more equal points than a leaf of the tree holds, and ties everywhere.
    #[test]
    fn neighbours_on_a_map_with_many_equal_points_are_the_first_by_row() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let map: Vec<[f32; 2]> = (0..600)
            .map(|row| if row % 2 == 0 { [1.0, 1.0] } else { [(); 2].map(|()| rng.random_range(-8..8) as f32 / 4.0) })
            .collect();
        let queries: Vec<usize> = (0..600).collect();
        let found = nearest_on_map(&map, &queries, 7);
        for query in queries {
            let squared = |row: usize| (0..2).map(|axis| (map[row][axis] - map[query][axis]).powi(2)).sum::<f32>();
            let mut all: Vec<u32> = (0..600).filter(|&row| row as usize != query).collect();
            all.sort_by(|&a, &b| squared(a as usize).total_cmp(&squared(b as usize)).then(a.cmp(&b)));
            assert_eq!(found[query], all[..7], "query {query}");
        }
    }

    /// Prints the times; run with `--ignored --nocapture`.
    #[test]
    #[ignore = "a benchmark"]
    fn bench() {
        use crate::neighbours::{Exclude, nearest};
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let values: Vec<f32> = (0..100_000 * 32).map(|_| rng.random_range(-1.0..1.0)).collect();
        let keys = vec![0; 100_000];
        let space = Space::new(Table::new(32, &values, &keys, &keys).unwrap(), Metric::Euclidean).unwrap();
        let bad: Vec<[f32; 2]> = values.chunks_exact(32).map(|x| [x[0], x[1]]).collect();
        let queries: Vec<usize> = (0..5000).map(|i| 20 * i).collect();
        let seconds = |work: &dyn Fn()| {
            let start = std::time::Instant::now();
            work();
            start.elapsed().as_secs_f64()
        };
        let neighbours = seconds(&|| drop(nearest(&space, &queries, 15, Exclude::Itself).unwrap()));
        let on_map = seconds(&|| drop(nearest_on_map(&bad, &queries, 15)));
        let options = QualityOptions::default();
        let judged = || quality(&space, &bad, options, &mut ChaCha8Rng::seed_from_u64(0)).is_ok();
        let all = seconds(&|| assert!(judged()));
        println!("neighbours in the space {neighbours:.2} s, on the map {on_map:.2} s, quality {all:.2} s");
    }

    #[test]
    fn a_map_that_is_the_space_is_perfect() {
        let (_, map) = points();
        let keys = vec![0; 200];
        let space = Space::new(Table::new(2, map.as_flattened(), &keys, &keys).unwrap(), Metric::Euclidean).unwrap();
        let found = quality(&space, &map, QualityOptions::default(), &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
        assert_eq!((found.trustworthiness, found.kept), (1.0, 1.0));
        let short = quality(&space, &map[1..], QualityOptions::default(), &mut ChaCha8Rng::seed_from_u64(0));
        assert!(matches!(short, Err(Error::Length { expected: 200, found: 199, .. })));
        let wide = QualityOptions { k: 100, rows: 1000 };
        assert!(matches!(
            quality(&space, &map, wide, &mut ChaCha8Rng::seed_from_u64(0)),
            Err(Error::TooFewRows { needed: 201, .. })
        ));
    }
}
