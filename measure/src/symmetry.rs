//! Reacher's symmetry: does the latent know that turning arm and goal together about the origin changes nothing that matters?
//!
//! In: the state of each row (joint angles, goal), the table, and how far apart two rows' pictures are. Out: pairs of rows that are rotations
//! of each other with their latent distance, beside pairs whose pictures are as far apart but whose states are not so
//! related. If the latent is symmetric, the first are much closer.
//!
//! | name | is | symmetric | says nothing |
//! |---|---|---|---|
//! | `symmetry_ratio` | mean latent distance of rotated pairs over that of rows whose pictures are as far apart | 0 | 1 |
//! | `symmetry_percentile` | of the rows whose pictures are about as far away, the share that the latent puts farther away than the rotated twin (ties count half) | 1, on a grid less | 0.5 |
//! | `symmetry_percentile_equal_distance` | the same among rows whose target is as far from the fingertip as the twin's, to the centimetre | 1, on a grid less | 0.5 |
//!
//! On a grid latents of the state alone reach 1 in neither share, however good they are: rows that show the row's own state at the same step under other distractors, and made rotations of it, stay among those
//! that it is compared with, and such latents put none of these farther away than the twin. Where they are a share `q` of the rows compared with, the largest
//! value that such latents can have is `1 − q/2` if rotations were made, since the twin is then as near as they are and ties count half, and `1 − q` if a found twin lies off by
//! anything. The number is the mean of that over the pairs.
//!
//! Two controls belong beside them, the same numbers of other tables. Features of past actions: a recording that was turned and drawn again keeps its actions, so
//! that an encoder that sees only those has a ratio of 0. The distance to the target alone ([`ReacherState::distance_table`]): it is the same after
//! any turn, so its ratio is 0 too where rotations were made (a twin that was found in the data is a rotation within the tolerance, and may be a centimetre or two
//! nearer or farther). Either way it does not tell the twin from rows whose target is as far as the twin's, so that its percentile among those is 0.5.

mod left_out;

use std::collections::BTreeMap;

use rand::Rng;
use rand::seq::index::sample;
use rayon::prelude::*;
use serde::Serialize;

use self::left_out::Place;
use crate::intervals::{Interval, Range};
use crate::left_out::Part;
use crate::neighbours::{Metric, Space};
use crate::{Error, Table};

/// Length of Reacher's upper and lower arm, metres.
const ARM: f64 = 0.12;

/// Where the fingertip is, metres.
fn fingertip([shoulder, wrist]: [f64; 2]) -> [f64; 2] {
    [ARM * (shoulder.cos() + (shoulder + wrist).cos()), ARM * (shoulder.sin() + (shoulder + wrist).sin())]
}

/// The state of a row of Reacher's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReacherState {
    /// Angles of shoulder and wrist, radians: `qpos`.
    pub joints: [f64; 2],
    /// Position of the goal, metres.
    pub target: [f64; 2],
}

impl ReacherState {
    /// The state of an arm whose fingertip has the goal `to_target` metres away.
    #[must_use]
    pub fn seen_from_the_finger(joints: [f64; 2], to_target: [f64; 2]) -> Self {
        let [x, y] = fingertip(joints);
        Self { joints, target: [x + to_target[0], y + to_target[1]] }
    }

    /// Wrist joint's and goal's position in the frame of the upper arm, metres: equal for rotated states, and only for them.
    fn in_arm_frame(self) -> [f32; 4] {
        let (sin, cos) = self.joints[0].sin_cos();
        let [x, y] = self.target;
        let finger = [ARM * self.joints[1].cos(), ARM * self.joints[1].sin()];
        [finger[0], finger[1], cos * x + sin * y, cos * y - sin * x].map(|x| x as f32)
    }

    /// Whether the two are one state turned about the origin, within the options' tolerance and by at least their angle.
    #[must_use]
    pub fn is_rotation_of(self, other: Self, options: SymmetryOptions) -> bool {
        let (a, b) = (self.in_arm_frame(), other.in_arm_frame());
        let apart = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt();
        apart <= options.tolerance && self.turn(other) >= options.turn
    }

    /// How far the fingertip is from the target, in whole centimetres.
    fn distance(self) -> u32 {
        let tip = fingertip(self.joints);
        (100.0 * (self.target[0] - tip[0]).hypot(self.target[1] - tip[1])).round() as u32
    }

    /// The latents of an encoder that knows nothing but the distance to the target, to the centimetre: `[rows, 1]`.
    #[must_use]
    pub fn distance_table(states: &[Self]) -> Vec<f32> {
        states.iter().map(|state| state.distance() as f32).collect()
    }

    /// The angle between two upper arms, 0 to π.
    fn turn(self, other: Self) -> f64 {
        let turn = (self.joints[0] - other.joints[0]).rem_euclid(std::f64::consts::TAU);
        turn.min(std::f64::consts::TAU - turn)
    }
}

/// Which pairs count as rotations of each other.
#[derive(Debug, Clone, Copy)]
pub struct SymmetryOptions {
    /// Most they may differ in the frame of the arm, metres.
    pub tolerance: f64,
    /// Least angle between them, radians.
    pub turn: f64,
    /// Most pairs to compare; more are drawn from.
    pub pairs: usize,
    /// Random rows among which those as far in the picture are looked for.
    pub candidates: usize,
    /// How many of them count as about as far in the picture: the nearest by picture distance, as many a little farther as a little nearer.
    pub matched: usize,
    /// The measure of latent distance.
    pub metric: Metric,
}

impl Default for SymmetryOptions {
    fn default() -> Self {
        Self {
            tolerance: 0.02,
            turn: std::f64::consts::FRAC_PI_4,
            pairs: 500,
            candidates: 256,
            matched: 16,
            metric: Metric::Standardized,
        }
    }
}

/// A row, its rotation, and a row that looks as different.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SymmetricPair {
    /// The row.
    pub row: usize,
    /// The row whose state is its rotation.
    pub rotated: usize,
    /// Latent distance between the two.
    pub latent: f64,
    /// Distance between their pictures.
    pub image: f64,
    /// The random row whose picture is about as far away.
    pub matched: usize,
    /// Its latent distance.
    pub matched_latent: f64,
    /// Its picture's distance.
    pub matched_image: f64,
    /// Share of the rows that look about as different whose latent is farther away than the rotation's. Latents of the state alone reach `1 − q/2` at most, where a share `q` of these rows shows the
    /// row's own state under another distractor, or a made rotation of it.
    pub percentile: f64,
    /// The same among rows whose target is as far from the fingertip as the rotation's; none if there are none.
    pub percentile_equal_distance: Option<f64>,
}

/// How symmetric the latents are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Symmetry {
    /// `symmetry_ratio`. Intervals are over state and distractor trajectories, each left out in turn.
    pub ratio: Interval,
    /// `symmetry_percentile`; on a grid below 1 even for latents that ignore distractors and rotation, as the module's head says.
    pub percentile: Interval,
    /// `symmetry_percentile_equal_distance`, of which the same holds; NaN if no twin has equals.
    pub percentile_equal_distance: Interval,
    /// The pairs.
    pub pairs: Vec<SymmetricPair>,
}

/// Pairs of rows of different trajectories whose states are rotations of each other, at most `options.pairs` of them: random rows, each with
/// the row that fits best among those turned far enough.
///
/// # Errors
/// States of another length than the table, or no such pair.
pub fn rotated_pairs(
    table: &Table<'_>,
    states: &[ReacherState],
    options: SymmetryOptions,
    rng: &mut impl Rng,
) -> Result<Vec<(usize, usize)>, Error> {
    let rows = table.rows();
    if states.len() != rows {
        return Err(Error::Length { what: "reacher states", expected: rows, found: states.len() });
    }
    if !(options.tolerance.is_finite() && options.tolerance >= 0.0) {
        let value = options.tolerance.to_string();
        return Err(Error::Option { option: "tolerance", value, must: "a finite number of at least 0" });
    }
    let frames: Vec<[f32; 4]> = states.iter().map(|state| state.in_arm_frame()).collect();
    let apart = |a: usize, b: usize| (0..4).map(|dim| (frames[a][dim] - frames[b][dim]).powi(2)).sum::<f32>();
    let partner = |&row: &usize| {
        let mut best = (options.tolerance.powi(2) as f32, None);
        for other in 0..rows {
            let apart = apart(row, other);
            let fits = apart <= best.0 && (apart < best.0 || best.1.is_none());
            if fits && table.episode()[other] != table.episode()[row] && states[row].turn(states[other]) >= options.turn
            {
                best = (apart, Some(other));
            }
        }
        Some((row, best.1?))
    };
    // Not every row has a rotation in the data, so more are tried than pairs are wanted.
    let tried = sample(rng, rows, rows.min(options.pairs.saturating_mul(4))).into_vec();
    let mut pairs: Vec<(usize, usize)> = tried.par_iter().filter_map(partner).collect();
    pairs.truncate(options.pairs);
    if pairs.is_empty() {
        return Err(Error::NoRotations { tolerance: options.tolerance });
    }
    Ok(pairs)
}

/// What `pairs` are compared with: drawn once, so that controls are compared with the same rows.
#[derive(Debug, Clone)]
pub struct Matches {
    pairs: Vec<Match>,
}

#[derive(Debug, Clone)]
struct Match {
    row: usize,
    rotated: usize,
    image: f64,
    /// All rows that were drawn, with their pictures' distances.
    images: Vec<(usize, f64)>,
    /// Rows whose pictures are about as far away, the nearest to the pair's picture distance first, with that distance.
    alike: Vec<(usize, f64)>,
    /// Rows whose target is as far from the fingertip as the twin's.
    equal: Vec<usize>,
}

/// Draws the rows that `pairs` are compared with. `image_distance` compares two rows' pictures (any measure; it is called `options.candidates + 1` times
/// a pair).
///
/// # Errors
/// No pairs, a row past the table, or a table of one trajectory.
pub fn matches(
    table: &Table<'_>,
    states: &[ReacherState],
    pairs: &[(usize, usize)],
    image_distance: impl Fn(usize, usize) -> f64 + Sync,
    options: SymmetryOptions,
    rng: &mut impl Rng,
) -> Result<Matches, Error> {
    let rows = table.rows();
    if pairs.is_empty() {
        return Err(Error::NoRotations { tolerance: options.tolerance });
    }
    if states.len() != rows {
        return Err(Error::Length { what: "reacher states", expected: rows, found: states.len() });
    }
    if let Some(&(a, b)) = pairs.iter().find(|&&(a, b)| a.max(b) >= rows) {
        return Err(Error::NoSuchRow { row: a.max(b), rows });
    }
    let mut by_distance: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    states.iter().enumerate().for_each(|(row, state)| by_distance.entry(state.distance()).or_default().push(row));
    let mut drawn = Vec::new();
    for &(row, rotated) in pairs {
        let other = |&other: &usize| other != rotated && table.episode()[other] != table.episode()[row];
        let random: Vec<usize> =
            (0..options.candidates.max(1)).map(|_| rng.random_range(0..rows)).filter(other).collect();
        // The twin's distance, which differs from the row's by up to the tolerance: what knows the distance alone tells no twin from rows of the same.
        let bin = &by_distance[&states[rotated].distance()];
        let equal = sample(rng, bin.len(), bin.len().min(options.candidates)).into_iter().map(|at| bin[at]);
        let equal: Vec<usize> = equal.filter(other).collect();
        drawn.push((row, rotated, random, equal));
    }
    if let Some((row, ..)) = drawn.iter().find(|(_, _, random, _)| random.is_empty()) {
        let (episode, step) = (table.episode()[*row], table.step()[*row]);
        let excluded = "rows of its own trajectory do not count";
        return Err(Error::TooFewNeighbours { episode, step, needed: 1, found: 0, excluded });
    }
    let compare = |(row, rotated, random, equal): (usize, usize, Vec<usize>, Vec<usize>)| {
        let image = image_distance(row, rotated);
        let images: Vec<(usize, f64)> = random.iter().map(|&other| (other, image_distance(row, other))).collect();
        Match { row, rotated, image, alike: alike(images.clone(), image, options.matched), images, equal }
    };
    Ok(Matches { pairs: drawn.into_par_iter().map(compare).collect() })
}

/// The rows about as far as `image`, the nearest to it first: equally many on either side where there are some on both, about `count` in all.
fn alike(mut images: Vec<(usize, f64)>, image: f64, count: usize) -> Vec<(usize, f64)> {
    let off = |(_, distance): &(usize, f64)| (distance - image).abs();
    images.sort_by(|a, b| off(a).total_cmp(&off(b)).then(a.0.cmp(&b.0)));
    let (mut farther, mut nearer): (Vec<_>, Vec<_>) = images.iter().copied().partition(|found| found.1 >= image);
    let half = farther.len().min(nearer.len()).min((count / 2).max(1));
    if half == 0 {
        images.truncate(count.max(1));
        return images;
    }
    farther.truncate(half);
    nearer.truncate(half);
    farther.extend(nearer);
    farther.sort_by(|a, b| off(a).total_cmp(&off(b)).then(a.0.cmp(&b.0)));
    farther
}

/// Latent distances of rotated pairs against those of the rows they are matched with. Intervals leave each trajectory out in turn, with its pairs and as what others are compared with
/// ([`crate::intervals::jackknife`]): they need three of every kind that there are several of, and three without which the number is another, if there are any. Views of one episode ([`Table::with_origin`]) go together.
///
/// # Errors
/// Latents that do not vary.
pub fn symmetry(table: &Table<'_>, matches: &Matches, options: SymmetryOptions) -> Result<Symmetry, Error> {
    let space = Space::new(*table, options.metric)?;
    let trajectories = table.trajectories();
    let part = |found: &Match| left_out::part(&space, found, options.matched, &trajectories);
    let parts: Vec<Part<Place>> = matches.pairs.par_iter().map(part).collect();
    let pair = |(found, part): (&Match, &Part<Place>)| {
        let (Match { row, rotated, image, alike, .. }, place) = (found, part.whole);
        let (matched, matched_image) = alike[0];
        SymmetricPair {
            row: *row,
            rotated: *rotated,
            latent: place.latent,
            image: *image,
            matched,
            matched_latent: place.matched,
            matched_image,
            percentile: place.percentile,
            percentile_equal_distance: place.equal,
        }
    };
    let all = (parts.as_slice(), &trajectories);
    Ok(Symmetry {
        ratio: left_out::interval(all, Range::Distance, left_out::ratio),
        percentile: left_out::interval(all, Range::Counted, left_out::percentile),
        percentile_equal_distance: left_out::interval(all, Range::Counted, left_out::percentile_equal_distance),
        pairs: matches.pairs.iter().zip(&parts).map(pair).collect(),
    })
}

#[cfg(test)]
mod tests;
