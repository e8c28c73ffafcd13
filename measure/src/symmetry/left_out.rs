//! What a pair of rotations is compared with: of all rows that were drawn for it, and of those that are left without each trajectory of either kind.
//!
//! In: latent distances, and the rows that were drawn for each pair. Out: the numbers of the module above, with their intervals. A pair goes with a trajectory of its row or of its
//! twin. Of other pairs the rows of that trajectory are not compared with, and others that were drawn take the place of those that look about as different.

use std::collections::BTreeMap;

use super::{Match, alike};
use crate::intervals::{Interval, Range, Trajectories};
use crate::left_out::{Part, Trajectory, each, mean, of_row};
use crate::neighbours::Space;

/// How the twin of a pair lies among the rows it is compared with; not a number where there are none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Latent distance of the twin.
    pub(super) latent: f64,
    /// That of the row whose picture is as far away as the twin's.
    pub(super) matched: f64,
    /// Share of the rows that look about as different that are farther than the twin.
    pub(super) percentile: f64,
    /// The same of those whose target is as far, if there are any.
    pub(super) equal: Option<f64>,
}

/// The place of a pair's twin among the rows that are left.
fn place(space: &Space<'_>, found: &Match, count: usize, is_left: impl Fn(usize) -> bool) -> Place {
    let latent = space.distance(found.row, found.rotated);
    let distance = |other: usize| space.distance(found.row, other);
    let images = found.images.iter().copied().filter(|image| is_left(image.0)).collect();
    let alike = alike(images, found.image, count);
    let equal = found.equal.iter().copied().filter(|&other| is_left(other));
    Place {
        latent,
        matched: alike.first().map_or(f64::NAN, |other| distance(other.0)),
        percentile: farther(latent, alike.iter().map(|other| distance(other.0))).unwrap_or(f64::NAN),
        equal: farther(latent, equal.map(distance)),
    }
}

/// The share of distances that are farther than the twin's, ties counting half; none of none.
fn farther(twin: f64, others: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut share, mut count) = (0.0, 0.0);
    for distance in others {
        count += 1.0;
        share += if distance > twin {
            1.0
        } else if distance < twin {
            0.0
        } else {
            0.5
        };
    }
    (count > 0.0).then(|| share / count)
}

/// The place of a pair's twin, and what it is without each trajectory of a row that it is compared with; about `count` rows look as different.
pub(super) fn part(space: &Space<'_>, found: &Match, count: usize, trajectories: &Trajectories) -> Part<Place> {
    let own = [found.row, found.rotated].into_iter().flat_map(|row| of_row(trajectories, row)).collect::<Vec<_>>();
    let compared = found.alike.iter().map(|other| other.0).chain(found.equal.iter().copied());
    let mut without = BTreeMap::new();
    for (kind, number) in compared.flat_map(|row| of_row(trajectories, row)) {
        if !own.contains(&(kind, number)) {
            let is_left = |row: usize| trajectories.of_row(row)[kind] != Some(number);
            without.entry((kind, number)).or_insert_with(|| place(space, found, count, is_left));
        }
    }
    Part { own, whole: place(space, found, count, |_| true), without }
}

/// A number of all places, with its interval.
pub(super) fn interval(
    (parts, trajectories): (&[Part<Place>], &Trajectories),
    range: Range,
    number: impl Fn(&[Place]) -> f64,
) -> Interval {
    let all: Vec<Place> = parts.iter().map(|part| part.whole).collect();
    let left = |out: Trajectory| parts.iter().filter_map(|part| part.left(out)).collect::<Vec<_>>();
    trajectories.jackknife(number(&all), &each(trajectories, |out| number(&left(out))), range)
}

/// `symmetry_ratio`.
pub(super) fn ratio(places: &[Place]) -> f64 {
    let sum = |of: fn(&Place) -> f64| places.iter().map(of).sum::<f64>();
    sum(|place| place.latent) / sum(|place| place.matched)
}

/// `symmetry_percentile`.
pub(super) fn percentile(places: &[Place]) -> f64 {
    mean(&places.iter().map(|place| place.percentile).collect::<Vec<_>>())
}

/// `symmetry_percentile_equal_distance`.
pub(super) fn percentile_equal_distance(places: &[Place]) -> f64 {
    mean(&places.iter().filter_map(|place| place.equal).collect::<Vec<_>>())
}
