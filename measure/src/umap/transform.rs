//! New points on an old map: the old points stay where they are.
//!
//! In: the old table and its map, and the new table. Out: positions of the new points. Each starts at the mean of its nearest
//! old points, weighted by membership, and is then laid out against the old points alone.

use rand::Rng;

use super::{Curve, Descent, Position, UmapOptions, fuzzy};
use crate::neighbours::{Neighbours, Space, nearest_to};
use crate::{Error, Table};

/// Positions of `new` on the map `positions` of the space's rows.
///
/// # Errors
/// A map of another length than the table, tables of unequal dimensions, or fewer rows than neighbours.
pub fn transform(
    space: &Space<'_>,
    positions: &[Position],
    new: &Table<'_>,
    options: UmapOptions,
    rng: &mut impl Rng,
) -> Result<Vec<Position>, Error> {
    options.check()?;
    let (neighbours, memberships) = nearest_old(space, positions, new, options.neighbourhood(space.table().rows()))?;
    let mut placed = means(&neighbours, &memberships, positions);
    let descent = Descent {
        curve: Curve::fit(options.min_dist, options.spread),
        epochs: options.epochs(positions.len()) / 3,
        rate: 0.25,
        negative_samples: options.negative_samples,
        seed: rng.random(),
    };
    descent.place(&neighbours, &memberships, positions, &mut placed);
    Ok(placed)
}

/// Positions of `new` among their `k` nearest rows on any map of the space's rows: the mean of theirs, weighted by membership.
///
/// # Errors
/// As [`transform`].
pub fn among_neighbours(
    space: &Space<'_>,
    positions: &[Position],
    new: &Table<'_>,
    k: usize,
) -> Result<Vec<Position>, Error> {
    let (neighbours, memberships) = nearest_old(space, positions, new, k)?;
    Ok(means(&neighbours, &memberships, positions))
}

/// The old rows nearest to each new one, and how strongly each belongs to its neighbourhood, `[new, k]`.
fn nearest_old(
    space: &Space<'_>,
    positions: &[Position],
    new: &Table<'_>,
    k: usize,
) -> Result<(Neighbours, Vec<f32>), Error> {
    let rows = space.table().rows();
    if positions.len() != rows {
        return Err(Error::Length { what: "map", expected: rows, found: positions.len() });
    }
    let neighbours = nearest_to(space, new, k.min(rows))?;
    let memberships = fuzzy::memberships(&neighbours);
    Ok((neighbours, memberships))
}

/// The mean position of each query's neighbours, weighted by membership.
fn means(neighbours: &Neighbours, memberships: &[f32], positions: &[Position]) -> Vec<Position> {
    let k = neighbours.k();
    let mean = |query: usize| {
        let weights = &memberships[query * k..(query + 1) * k];
        let total: f32 = weights.iter().sum();
        let near = neighbours.rows(query).iter().zip(weights);
        let add = |sum: Position, (&row, weight): (&u32, &f32)| {
            let at = positions[row as usize];
            [sum[0] + at[0] * weight / total, sum[1] + at[1] * weight / total]
        };
        near.fold([0.0; 2], add)
    };
    (0..neighbours.queries()).map(mean).collect()
}
