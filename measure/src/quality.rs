//! How much of the latent space's neighbourhoods a map keeps: trustworthiness and the share of neighbours kept.
//!
//! In: the space, the map `[rows, 2]`, `k`. Out: both numbers. Above `QualityOptions::rows` rows (above 100,000 rows still fewer, see
//! [`bounded_queries`]) they are taken over that many rows drawn from the generator, each still ranked against the whole table.

use rand::Rng;
use rand::seq::index;
use rayon::prelude::*;

use crate::neighbours::{Exclude, Metric, Neighbours, Space, bounded_queries, nearest};
use crate::{Error, Table};

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
    let (table, k) = (space.table(), options.k);
    let n = table.rows();
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
    let near_on_map = nearest_on_map(table, map, &queries, k)?;
    let both = |query: usize| near_on_map.rows(query).iter().filter(|row| near.rows(query).contains(row)).count();
    let kept: usize = (0..queries.len()).map(both).sum();
    let intruders = |(at, &query): (usize, &usize)| excess_rank(space, query, near_on_map.rows(at), near.rows(at));
    let excess: u64 = queries.par_iter().enumerate().map(intruders).sum();
    let (n, k, count) = (n as f64, k as f64, queries.len() as f64);
    let trustworthiness = 1.0 - 2.0 / (count * k * (2.0 * n - 3.0 * k - 1.0)) * excess as f64;
    Ok(Quality { trustworthiness, kept: kept as f64 / (count * k), k: options.k, rows: queries.len() })
}

/// The `k` nearest rows on the map.
fn nearest_on_map(table: &Table<'_>, map: &[[f32; 2]], queries: &[usize], k: usize) -> Result<Neighbours, Error> {
    let flat = Table::new(2, map.as_flattened(), table.episode(), table.step())?;
    nearest(&Space::new(flat, Metric::Euclidean)?, queries, k, Exclude::Itself)
}

/// `Σ_j max(0, r(query, j) - k)` over the map's neighbours that are not the space's.
fn excess_rank(space: &Space<'_>, query: usize, on_map: &[u32], near: &[u32]) -> u64 {
    let mut intruders: Vec<f32> = on_map
        .iter()
        .filter(|row| !near.contains(row))
        .map(|&row| space.squared_prepared(query, row as usize))
        .collect();
    if intruders.is_empty() {
        return 0;
    }
    intruders.sort_unstable_by(f32::total_cmp);
    // closer[i]: rows nearer than the i-th intruder but not than the one before it.
    let mut closer = vec![0_u64; intruders.len()];
    for row in (0..space.table().rows()).filter(|&row| row != query) {
        let distance = space.squared_prepared(query, row);
        if distance < intruders[intruders.len() - 1] {
            closer[intruders.partition_point(|&intruder| intruder <= distance)] += 1;
        }
    }
    let ranks = closer.iter().scan(0, |rank, closer| {
        *rank += closer;
        Some(*rank + 1)
    });
    ranks.map(|rank| rank.saturating_sub(near.len() as u64)).sum()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{QualityOptions, quality};
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
