//! New points on an old map: the old points stay where they are.
//!
//! In: the old table and its map, and the new table. Out: positions of the new points. Each starts at the mean of its nearest
//! old points, weighted by membership, and is then laid out against the old points alone.

use rand::Rng;

use super::{Curve, Descent, Position, UmapOptions, fuzzy};
use crate::neighbours::{Space, nearest_to};
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
    let rows = space.table().rows();
    if positions.len() != rows {
        return Err(Error::Length { what: "map", expected: rows, found: positions.len() });
    }
    let neighbours = nearest_to(space, new, options.neighbours.min(rows))?;
    let memberships = fuzzy::memberships(&neighbours);
    let k = neighbours.k();
    let start = |query: usize| {
        let weights = &memberships[query * k..(query + 1) * k];
        let total: f32 = weights.iter().sum();
        let near = neighbours.rows(query).iter().zip(weights);
        let add = |sum: Position, (&row, weight): (&u32, &f32)| {
            let at = positions[row as usize];
            [sum[0] + at[0] * weight / total, sum[1] + at[1] * weight / total]
        };
        near.fold([0.0; 2], add)
    };
    let mut placed: Vec<Position> = (0..new.rows()).map(start).collect();
    let descent = Descent {
        curve: Curve::fit(options.min_dist, options.spread),
        epochs: options.epochs(rows) / 3,
        rate: 0.25,
        negative_samples: options.negative_samples,
        seed: rng.random(),
    };
    descent.place(&neighbours, &memberships, positions, &mut placed);
    Ok(placed)
}
