//! Reacher's symmetry: does the latent know that turning arm and goal together about the origin changes nothing that matters?
//!
//! In: the state of each row (joint angles, goal), the table, and how far apart two rows' pictures are. Out: pairs of rows that are rotations
//! of each other with their latent distance, beside pairs whose pictures are as far apart but whose states are not so
//! related. If the latent is symmetric, the first are much closer.

use rand::Rng;
use rand::seq::index::sample;
use rayon::prelude::*;
use serde::Serialize;

use crate::intervals::{Interval, bootstrap};
use crate::neighbours::{Metric, Space};
use crate::{Error, Table};

/// Length of Reacher's upper and lower arm, metres.
const ARM: f64 = 0.12;

/// The state of a row of Reacher's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReacherState {
    /// Angles of shoulder and wrist, radians: `qpos`.
    pub joints: [f64; 2],
    /// Position of the goal, metres.
    pub target: [f64; 2],
}

impl ReacherState {
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
    /// Random rows among which the one as far in the picture is looked for.
    pub candidates: usize,
    /// The measure of latent distance.
    pub metric: Metric,
}

impl Default for SymmetryOptions {
    fn default() -> Self {
        Self {
            tolerance: 0.02,
            turn: std::f64::consts::FRAC_PI_4,
            pairs: 500,
            candidates: 64,
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
}

/// How symmetric the latents are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Symmetry {
    /// Mean latent distance of rotated pairs over that of matched pairs: 0 is symmetric, 1 is not. Interval over trajectories.
    pub ratio: Interval,
    /// Share of rows that are closer to their rotation than to the matched row; 0.5 if rotation means nothing.
    pub closer: Interval,
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
    let tried = sample(rng, rows, rows.min(4 * options.pairs)).into_vec();
    let mut pairs: Vec<(usize, usize)> = tried.par_iter().filter_map(partner).collect();
    pairs.truncate(options.pairs);
    if pairs.is_empty() {
        return Err(Error::NoRotations { tolerance: options.tolerance });
    }
    Ok(pairs)
}

/// Latent distances of `pairs` against rows as far apart in the picture. `image_distance` compares two rows' pictures (any
/// measure; it is called `options.candidates + 1` times a pair).
///
/// # Errors
/// No pairs, a row past the table, latents that do not vary, or a table of one trajectory.
pub fn symmetry(
    table: &Table<'_>,
    pairs: &[(usize, usize)],
    image_distance: impl Fn(usize, usize) -> f64 + Sync,
    options: SymmetryOptions,
    rng: &mut impl Rng,
) -> Result<Symmetry, Error> {
    let rows = table.rows();
    if pairs.is_empty() {
        return Err(Error::NoRotations { tolerance: options.tolerance });
    }
    if let Some(&(a, b)) = pairs.iter().find(|&&(a, b)| a.max(b) >= rows) {
        return Err(Error::NoSuchRow { row: a.max(b), rows });
    }
    let space = Space::new(*table, options.metric)?;
    let drawn: Vec<Vec<usize>> = pairs.iter().map(|&pair| candidates(table, pair, options.candidates, rng)).collect();
    if let Some(at) = drawn.iter().position(Vec::is_empty) {
        let (episode, step) = (table.episode()[pairs[at].0], table.step()[pairs[at].0]);
        let excluded = "rows of its own trajectory do not count";
        return Err(Error::TooFewNeighbours { episode, step, needed: 1, found: 0, excluded });
    }
    let compare = |(&(row, rotated), drawn): (&(usize, usize), &Vec<usize>)| {
        let image = image_distance(row, rotated);
        let images = drawn.iter().map(|&other| (other, image_distance(row, other)));
        let better = |best: (usize, f64), next: (usize, f64)| {
            if (next.1 - image).abs() < (best.1 - image).abs() { next } else { best }
        };
        let (matched, matched_image) = images.fold((row, f64::INFINITY), better);
        let (latent, matched_latent) = (space.distance(row, rotated), space.distance(row, matched));
        SymmetricPair { row, rotated, latent, image, matched, matched_latent, matched_image }
    };
    let pairs: Vec<SymmetricPair> = pairs.par_iter().zip(&drawn).map(compare).collect();
    let trajectory = table.trajectories();
    let mut drawn: Vec<u32> = pairs.iter().map(|pair| trajectory[pair.row]).collect();
    drawn.sort_unstable();
    drawn.dedup();
    let group = |pair: &SymmetricPair| drawn.partition_point(|&one| one < trajectory[pair.row]);
    let groups: Vec<usize> = pairs.iter().map(group).collect();
    let total = |counts: &[f64], part: &dyn Fn(&SymmetricPair) -> f64| -> f64 {
        pairs.iter().zip(&groups).map(|(pair, &group)| counts[group] * part(pair)).sum()
    };
    let ratio = |counts: &[f64]| total(counts, &|pair| pair.latent) / total(counts, &|pair| pair.matched_latent);
    let nearer = |pair: &SymmetricPair| f64::from(u8::from(pair.latent < pair.matched_latent));
    let closer = |counts: &[f64]| total(counts, &nearer) / total(counts, &|_| 1.0);
    let (ratio, closer) = (bootstrap(drawn.len(), rng, ratio), bootstrap(drawn.len(), rng, closer));
    Ok(Symmetry { ratio, closer, pairs })
}

/// Random rows of other trajectories, the rotation itself left out; a row may be drawn twice.
fn candidates(table: &Table<'_>, (row, rotated): (usize, usize), count: usize, rng: &mut impl Rng) -> Vec<usize> {
    let drawn = (0..count.max(1)).map(|_| rng.random_range(0..table.rows()));
    drawn.filter(|&other| other != rotated && table.episode()[other] != table.episode()[row]).collect()
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{ReacherState, SymmetryOptions, rotated_pairs, symmetry};
    use crate::{Error, Table};

    /// Episodes 0 to 19 hold random states, 20 to 39 the same turned by 2 radians.
    fn states() -> Vec<ReacherState> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut random = |_| {
            let mut draw = |scale: f64| rng.random_range(-scale..scale);
            ReacherState { joints: [draw(3.0), draw(2.0)], target: [draw(0.2), draw(0.2)] }
        };
        let plain: Vec<ReacherState> = (0..400).map(&mut random).collect();
        let (sin, cos) = 2.0_f64.sin_cos();
        let turn = |state: &ReacherState| {
            let [x, y] = state.target;
            ReacherState {
                joints: [state.joints[0] + 2.0, state.joints[1]],
                target: [cos * x - sin * y, sin * x + cos * y],
            }
        };
        let turned: Vec<ReacherState> = plain.iter().map(turn).collect();
        [plain, turned].concat()
    }

    #[test]
    fn an_invariant_latent_is_symmetric_and_an_absolute_one_is_not() {
        let states = states();
        let episode: Vec<u32> = (0..800).map(|row| row / 20).collect();
        let step: Vec<u32> = (0..800).map(|row| row % 20).collect();
        let invariant: Vec<f32> = states.iter().flat_map(|state| state.in_arm_frame()).collect();
        let absolute: Vec<f32> = states
            .iter()
            .flat_map(|state| {
                [
                    state.joints[0].cos() as f32,
                    state.joints[0].sin() as f32,
                    state.target[0] as f32,
                    state.target[1] as f32,
                ]
            })
            .collect();
        let options = SymmetryOptions { tolerance: 1e-6, ..SymmetryOptions::default() };
        let picture = |a: usize, b: usize| {
            (0..4).map(|dim| f64::from(absolute[a * 4 + dim] - absolute[b * 4 + dim]).powi(2)).sum::<f64>().sqrt()
        };
        let run = |values: &[f32]| {
            let table = Table::new(4, values, &episode, &step).unwrap();
            let rng = &mut ChaCha8Rng::seed_from_u64(1);
            let pairs = rotated_pairs(&table, &states, options, rng).unwrap();
            assert_eq!(pairs.len(), 500);
            assert!(pairs.iter().all(|&(a, b)| a.abs_diff(b) == 400));
            symmetry(&table, &pairs, picture, options, rng).unwrap()
        };
        let symmetric = run(&invariant);
        assert!(symmetric.ratio.high < 1e-5 && symmetric.closer.estimate == 1.0, "{:?}", symmetric.ratio);
        let absolute = run(&absolute);
        assert!((absolute.ratio.estimate - 1.0).abs() < 0.1, "{:?}", absolute.ratio);
        let table = Table::new(4, &invariant, &episode, &step).unwrap();
        let none = SymmetryOptions { turn: 4.0, ..options };
        let refused = rotated_pairs(&table, &states, none, &mut ChaCha8Rng::seed_from_u64(1));
        assert!(matches!(refused, Err(Error::NoRotations { .. })));
    }
}
