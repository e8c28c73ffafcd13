//! How sure a number is: bootstrap intervals over trajectories, Student intervals over runs, and a jackknife for what compares rows with each other.
//!
//! Rows of one trajectory are not independent, so trajectories are what is drawn again or left out, never rows. On a grid there are two kinds of them, and
//! a number must hold for other states *and* for other distractors: both are drawn again, each with replacement, and a cell counts as often as its state
//! was drawn times as often as its distractor was ([`Trajectories`]; the pigeonhole bootstrap of Owen, 2007, which errs to the side of wide intervals).
//! That serves means and ratios of means over rows that have nothing to do with each other. A bootstrap will not do for shares of variance: a grid that holds
//! a trajectory twice varies less, so that its shares lie beside the estimate. Nor will it for distances and neighbours: the cell that a cell is compared
//! with was drawn as it was, and where only the first is drawn again the interval is too narrow; drawn twice it would be its own neighbour. For these each
//! trajectory of either kind is left out in turn ([`crossed`]; [`Trajectories::jackknife`] where there may be episodes alone).

use std::f64::consts::FRAC_PI_2;

use rand::Rng;
use rayon::prelude::*;
use serde::Serialize;

/// A number and the ends of its 95% interval. The ends are NaN when there was only one trajectory or run to go by, or when the number is none without one of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The number itself.
    pub estimate: f64,
    /// 2.5% end.
    pub low: f64,
    /// 97.5% end.
    pub high: f64,
}

/// Times the groups are drawn again.
pub const RESAMPLES: usize = 1000;

/// A percentile bootstrap: `statistic` gets how often each of `groups` groups was drawn, `[groups]` (all ones for the estimate itself).
pub fn bootstrap(groups: usize, rng: &mut impl Rng, statistic: impl Fn(&[f64]) -> f64 + Sync) -> Interval {
    let estimate = statistic(&vec![1.0; groups]);
    if groups < 2 {
        return Interval { estimate, low: f64::NAN, high: f64::NAN };
    }
    let draws: Vec<Vec<f64>> = (0..RESAMPLES).map(|_| drawn_again(groups, rng)).collect();
    percentiles(estimate, &draws, statistic)
}

/// How often each of `count` things was drawn in `count` draws with replacement.
fn drawn_again(count: usize, rng: &mut impl Rng) -> Vec<f64> {
    let mut counts = vec![0.0; count];
    (0..count).for_each(|_| counts[rng.random_range(0..count)] += 1.0);
    counts
}

fn percentiles(estimate: f64, draws: &[Vec<f64>], statistic: impl Fn(&[f64]) -> f64 + Sync) -> Interval {
    let mut values: Vec<f64> =
        draws.par_iter().map(|counts| statistic(counts)).filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    Interval { estimate, low: percentile(&values, 0.025), high: percentile(&values, 0.975) }
}

/// What a row is of: its state trajectory or, outside a grid, its episode; and its distractor trajectory.
pub type Label = ((u8, u32), Option<u32>);

/// The label of a row of an episode that lies in a cell, `(state, distractor)`, or in none.
#[must_use]
pub fn label(episode: u32, cell: Option<(u32, u32)>) -> Label {
    match cell {
        Some((state, distractor)) => ((0, state), Some(distractor)),
        None => ((1, episode), None),
    }
}

/// What is drawn again for an interval: the cells of a grid by state and by distractor, or episodes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trajectories {
    /// The cell or episode of each row, `[rows]`.
    unit: Vec<u32>,
    /// The state trajectory of each cell (an episode outside the grid is one of its own), `[units]`.
    state: Vec<u32>,
    /// The distractor trajectory of each cell, if it has one, `[units]`.
    distractor: Vec<Option<u32>>,
    states: usize,
    distractors: usize,
}

impl Trajectories {
    /// From the trajectories of every row, as [`label`] names them.
    #[must_use]
    pub fn new(rows: &[Label]) -> Self {
        let mut units = rows.to_vec();
        units.sort_unstable();
        units.dedup();
        let unit = rows.iter().map(|row| units.partition_point(|unit| unit < row) as u32).collect();
        let mut states: Vec<(u8, u32)> = units.iter().map(|unit| unit.0).collect();
        states.dedup();
        let mut distractors: Vec<u32> = units.iter().filter_map(|unit| unit.1).collect();
        distractors.sort_unstable();
        distractors.dedup();
        let state = |unit: &((u8, u32), _)| states.partition_point(|state| *state < unit.0) as u32;
        let distractor =
            |unit: &(_, Option<u32>)| unit.1.map(|own| distractors.partition_point(|other| *other < own) as u32);
        Self {
            unit,
            state: units.iter().map(state).collect(),
            distractor: units.iter().map(distractor).collect(),
            states: states.len(),
            distractors: distractors.len(),
        }
    }

    /// The cell or episode of a row, numbered from 0.
    #[must_use]
    pub fn unit(&self, row: usize) -> usize {
        self.unit[row] as usize
    }

    /// The trajectories of both kinds that a row is of, numbered from 0: its state trajectory (or episode), and its distractor trajectory if it has one.
    #[must_use]
    pub fn of_row(&self, row: usize) -> [Option<usize>; 2] {
        let unit = self.unit(row);
        [Some(self.state[unit] as usize), self.distractor[unit].map(|own| own as usize)]
    }

    /// How many state trajectories (or episodes) and how many distractor trajectories there are.
    #[must_use]
    pub fn counts(&self) -> [usize; 2] {
        [self.states, self.distractors]
    }

    /// The interval of a number that depends on how rows lie to each other, from its values `without` each trajectory of either kind ([`jackknife`]). A kind of which there is
    /// only one, or none, is not left out. The number may rest on few of the rows, as on those near a few queries: trajectories that change nothing say nothing of how sure it is,
    /// and are no degrees of freedom. No interval where one or two of a kind change it; a kind of which none does adds no doubt.
    #[must_use]
    pub fn jackknife(&self, estimate: f64, without: &[Vec<f64>; 2], range: Range) -> Interval {
        let several: Vec<&[f64]> = without.iter().filter(|values| values.len() > 1).map(Vec::as_slice).collect();
        let telling: Vec<usize> = several.iter().map(|values| telling(estimate, values)).collect();
        if telling.iter().any(|count| (1..3).contains(count)) {
            return Interval { estimate, low: f64::NAN, high: f64::NAN };
        }
        with_freedom(estimate, &several, &telling, range)
    }

    /// How many cells or episodes there are.
    #[must_use]
    pub fn units(&self) -> usize {
        self.state.len()
    }

    /// A percentile bootstrap over state and distractor trajectories: `statistic` gets how often each unit was drawn, `[units]` (all ones for the
    /// estimate itself). A kind of which there is only one is not drawn; no interval if there is only one of both.
    pub fn bootstrap(&self, rng: &mut impl Rng, statistic: impl Fn(&[f64]) -> f64 + Sync) -> Interval {
        let estimate = statistic(&vec![1.0; self.units()]);
        if self.states < 2 && self.distractors < 2 {
            return Interval { estimate, low: f64::NAN, high: f64::NAN };
        }
        let draws: Vec<Vec<f64>> = (0..RESAMPLES)
            .map(|_| {
                let [states, distractors] = [self.states, self.distractors]
                    .map(|count| if count < 2 { vec![1.0; count] } else { drawn_again(count, rng) });
                let weight = |(state, distractor): (&u32, &Option<u32>)| {
                    states[*state as usize] * distractor.map_or(1.0, |own| distractors[own as usize])
                };
                self.state.iter().zip(&self.distractor).map(weight).collect()
            })
            .collect();
        percentiles(estimate, &draws, statistic)
    }

    /// The interval of a mean over rows: `values` `[rows]` of these `rows`.
    pub fn mean(&self, rows: &[usize], values: &[f64], rng: &mut impl Rng) -> Interval {
        let ones = vec![1.0; values.len()];
        self.ratio(rows, values, &ones, rng)
    }

    /// The interval of a ratio of sums over rows, `Σ above / Σ below`.
    pub fn ratio(&self, rows: &[usize], above: &[f64], below: &[f64], rng: &mut impl Rng) -> Interval {
        let mut sums = vec![(0.0, 0.0); self.units()];
        for ((&row, above), below) in rows.iter().zip(above).zip(below) {
            let sum = &mut sums[self.unit(row)];
            *sum = (sum.0 + above, sum.1 + below);
        }
        self.bootstrap(rng, |weights| {
            let total = |of: fn(&(f64, f64)) -> f64| weights.iter().zip(&sums).map(|(w, sum)| w * of(sum)).sum::<f64>();
            total(|sum| sum.0) / total(|sum| sum.1)
        })
    }
}

/// A percentile of sorted values, linear between them; NaN of none.
#[must_use]
pub fn percentile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = share * last as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    below + (above - below) * at.fract()
}

/// Mean of independent runs with the 95% interval of Student's t.
#[must_use]
pub fn student(values: &[f64]) -> Interval {
    let count = values.len() as f64;
    let estimate = values.iter().sum::<f64>() / count;
    if values.len() < 2 {
        return Interval { estimate, low: f64::NAN, high: f64::NAN };
    }
    let variance = values.iter().map(|x| (x - estimate).powi(2)).sum::<f64>() / (count - 1.0);
    let half = t_quantile(values.len() - 1) * (variance / count).sqrt();
    Interval { estimate, low: estimate - half, high: estimate + half }
}

/// A number that is no mean: how it is spread out so that its interval stays within its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// A share between 0 and 1, on the scale `ln(p / (1 - p))`.
    Share,
    /// A number above 0, on the scale `ln x`.
    Positive,
    /// A number of at least 0, on the scale `√x`: a distance, which may be 0.
    Distance,
    /// A share of what was counted, on the scale `asin √p`. All or none is nothing unusual here, and a logarithm would set these endlessly far apart from the rest.
    Counted,
    /// A number between -1 and 1, on the scale `asin x`: either end may be reached.
    Signed,
}

impl Range {
    const EDGE: f64 = 1e-12;

    fn spread(self, value: f64) -> f64 {
        match self {
            Self::Share => {
                let share = value.clamp(Self::EDGE, 1.0 - Self::EDGE);
                (share / (1.0 - share)).ln()
            }
            Self::Positive => value.max(Self::EDGE).ln(),
            Self::Distance => value.max(0.0).sqrt(),
            Self::Counted => value.clamp(0.0, 1.0).sqrt().asin(),
            Self::Signed => value.clamp(-1.0, 1.0).asin(),
        }
    }

    fn back(self, spread: f64) -> f64 {
        match self {
            Self::Share => 1.0 / (1.0 + (-spread).exp()),
            Self::Positive => spread.exp(),
            Self::Distance => spread.max(0.0).powi(2),
            Self::Counted => spread.clamp(0.0, FRAC_PI_2).sin().powi(2),
            Self::Signed => spread.clamp(-FRAC_PI_2, FRAC_PI_2).sin(),
        }
    }
}

/// The 95% interval of a number that depends on two crossed kinds of trajectories, from its values `without` each trajectory of either kind: the jackknife,
/// on a scale that keeps the ends within the number's range.
///
/// Both kinds are taken as drawn at random, so their variances add up; degrees of freedom after Satterthwaite. A bootstrap will not do for shares of
/// variance and spectra: a grid that holds a trajectory twice varies less, and its numbers lie beside the estimate. Nor will it for what compares cells with
/// each other, as this module's head says. No interval with fewer than three of a kind, nor where the number is not finite without one of them: nobody knows what another would have brought.
#[must_use]
pub fn crossed(estimate: f64, without: [&[f64]; 2], range: Range) -> Interval {
    jackknife(estimate, &without, range)
}

/// The same of any number of crossed kinds of trajectories, as of episodes alone; no interval of none.
#[must_use]
pub fn jackknife(estimate: f64, without: &[&[f64]], range: Range) -> Interval {
    let all: Vec<usize> = without.iter().map(|values| values.len()).collect();
    with_freedom(estimate, without, &all, range)
}

/// What is less than this share of a number is rounding.
const ROUNDING: f64 = 1e-9;

/// Of how many trajectories a number is another without them, by more than rounding.
fn telling(estimate: f64, without: &[f64]) -> usize {
    let is_other = |value: &&f64| (**value - estimate).abs() > ROUNDING * value.abs().max(estimate.abs());
    without.iter().filter(is_other).count()
}

/// The jackknife of kinds of which so many trajectories each are `telling`: one less are its degrees of freedom.
fn with_freedom(estimate: f64, without: &[&[f64]], telling: &[usize], range: Range) -> Interval {
    let is_too_little = |values: &&[f64]| values.len() < 3 || values.iter().any(|value| !value.is_finite());
    if without.is_empty() || without.iter().any(is_too_little) || !estimate.is_finite() {
        return Interval { estimate, low: f64::NAN, high: f64::NAN };
    }
    let variance = |values: &&[f64]| {
        let (count, values) = (values.len() as f64, values.iter().map(|&x| range.spread(x)).collect::<Vec<_>>());
        let mean = values.iter().sum::<f64>() / count;
        (count - 1.0) / count * values.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
    };
    let variance: Vec<f64> = without.iter().map(variance).collect();
    let total: f64 = variance.iter().sum();
    let doubt: f64 = variance.iter().zip(telling).map(|(v, &count)| v * v / (count as f64 - 1.0).max(1.0)).sum();
    let freedom = if doubt > 0.0 { (total * total / doubt + ROUNDING).floor().max(1.0) } else { 1.0 };
    let half = if total > 0.0 { t_quantile(freedom as usize) * total.sqrt() } else { 0.0 };
    Interval {
        estimate,
        low: range.back(range.spread(estimate) - half).min(estimate),
        high: range.back(range.spread(estimate) + half).max(estimate),
    }
}

/// The 97.5% quantile of Student's t.
fn t_quantile(freedom: usize) -> f64 {
    const TABLE: [f64; 30] = [
        12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281, 2.2010, 2.1788, 2.1604,
        2.1448, 2.1314, 2.1199, 2.1098, 2.1009, 2.0930, 2.0860, 2.0796, 2.0739, 2.0687, 2.0639, 2.0595, 2.0555, 2.0518,
        2.0484, 2.0452, 2.0423,
    ];
    // Beyond the table, the first terms of its expansion around the normal quantile.
    let expansion = |n: f64| 1.959_964 + 2.372_27 / n + 2.822_5 / (n * n);
    TABLE.get(freedom - 1).copied().unwrap_or_else(|| expansion(freedom as f64))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use rand::Rng;

    use super::{Interval, Range, Trajectories, bootstrap, crossed, jackknife, percentile, student};

    #[test]
    fn student_intervals_are_the_textbook_ones() {
        let interval = student(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!((interval.estimate - 3.0).abs() < 1e-12);
        assert!((interval.high - (3.0 + 2.7764 * (2.5_f64 / 5.0).sqrt())).abs() < 1e-9);
        assert!(student(&[7.0]).low.is_nan());
        let many: Vec<f64> = (0..42).map(f64::from).collect();
        // t(41) = 2.01954
        let half = 2.019_54 * (150.5_f64 / 42.0).sqrt();
        assert!((student(&many).high - 20.5 - half).abs() < 1e-3);
    }

    #[test]
    fn percentiles_lie_between_values() {
        assert!((percentile(&[0.0, 1.0, 2.0, 3.0], 0.5) - 1.5).abs() < 1e-12);
        assert!(percentile(&[], 0.5).is_nan());
    }

    /// The bootstrap of a mean has the width theory gives: 2 · 1.96 σ / √n.
    #[test]
    fn bootstrap_of_a_mean_has_the_known_width() {
        let values: Vec<f64> = (0..200).map(|i| f64::from(i % 10)).collect();
        let mean = |counts: &[f64]| {
            counts.iter().zip(&values).map(|(count, x)| count * x).sum::<f64>() / counts.iter().sum::<f64>()
        };
        let interval = bootstrap(200, &mut ChaCha8Rng::seed_from_u64(1), mean);
        let expected = 2.0 * 1.96 * (8.25_f64 / 200.0).sqrt();
        assert!((interval.estimate - 4.5).abs() < 1e-12);
        assert!(((interval.high - interval.low) / expected - 1.0).abs() < 0.1, "{interval:?} {expected}");
    }

    fn grid(states: u32, distractors: u32) -> (Trajectories, Vec<usize>) {
        let cells: Vec<_> = (0..states).flat_map(|i| (0..distractors).map(move |j| ((0, i), Some(j)))).collect();
        (Trajectories::new(&cells), (0..cells.len()).collect())
    }

    /// A mean over a grid whose values are a state effect plus a distractor effect has the variance `σ_s² / n + σ_d² / m`; an interval over states
    /// alone would not hold it.
    #[test]
    fn intervals_over_states_and_distractors_hold_the_mean_about_as_often_as_they_say() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (trajectories, rows) = grid(12, 10);
        let (mut held, mut held_by_states) = (0, 0);
        for _ in 0..100 {
            let mut normal = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
            let (state, distractor): (Vec<f64>, Vec<f64>) =
                ((0..12).map(|_| normal()).collect(), (0..10).map(|_| normal()).collect());
            let values: Vec<f64> = (0..120).map(|at| state[at / 10] + distractor[at % 10]).collect();
            let found = trajectories.mean(&rows, &values, &mut rng);
            held += usize::from(found.low <= 0.0 && 0.0 <= found.high);
            let of_states = bootstrap(12, &mut rng, |counts| {
                values.iter().enumerate().map(|(at, x)| counts[at / 10] * x).sum::<f64>() / 120.0
            });
            held_by_states += usize::from(of_states.low <= 0.0 && 0.0 <= of_states.high);
        }
        assert!(held >= 84 && held_by_states < held, "{held} and {held_by_states} of 100");
    }

    #[test]
    fn one_of_a_kind_is_not_drawn_and_one_of_both_has_no_interval() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (column, rows) = grid(6, 1);
        let found = column.mean(&rows, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], &mut rng);
        assert!(found.low < 2.5 && found.high > 2.5);
        let (cell, rows) = grid(1, 1);
        assert!(cell.mean(&rows, &[1.0], &mut rng).low.is_nan());
        let episodes = Trajectories::new(&[((1, 7), None), ((1, 7), None), ((1, 9), None)]);
        assert_eq!((episodes.units(), episodes.unit(2)), (2, 1));
        assert_eq!(episodes.ratio(&[0, 1, 2], &[1.0, 2.0, 3.0], &[1.0, 1.0, 2.0], &mut rng).estimate, 1.5);
    }

    /// The jackknife of a mean is the textbook's interval, whatever the scale where it is as good as straight.
    #[test]
    fn the_jackknife_of_a_mean_over_one_kind_is_students_interval() {
        let values: Vec<f64> = (0..12).map(|i| 1000.0 + f64::from(i * i % 7)).collect();
        let mean = values.iter().sum::<f64>() / 12.0;
        let without: Vec<f64> = values.iter().map(|out| (12.0 * mean - out) / 11.0).collect();
        let (found, wanted) = (jackknife(mean, &[&without], Range::Distance), student(&values));
        assert!((found.low - wanted.low).abs() < 0.03 && (found.high - wanted.high).abs() < 0.03, "{found:?}");
        assert!(jackknife(mean, &[], Range::Distance).low.is_nan());
    }

    #[test]
    fn a_distance_of_0_stays_within_its_range() {
        let found = crossed(0.0, [&[0.0, 0.0, 0.01], &[0.0; 4]], Range::Distance);
        assert!(found.low == 0.0 && found.high > 0.0 && found.high < 2.0, "{found:?}");
        let (column, rows) = grid(3, 1);
        assert_eq!((column.counts(), column.of_row(rows[2])), ([3, 1], [Some(2), Some(0)]));
        let over_states = column.jackknife(2.0, &[vec![1.9, 2.01, 2.1], vec![f64::NAN]], Range::Distance);
        assert!(over_states.low < 2.0 && over_states.high > 2.0, "{over_states:?}");
    }

    /// Few queries in a table of many episodes: those that no query is of or near change nothing when they are left out.
    #[test]
    fn trajectories_that_change_nothing_are_no_degrees_of_freedom() {
        let (column, _) = grid(40, 1);
        let none = vec![f64::NAN];
        let left = |changed: &[f64]| [[changed, &vec![2.0 + 1e-15; 40 - changed.len()]].concat(), none.clone()];
        let of = |changed: &[f64]| column.jackknife(2.0, &left(changed), Range::Distance);
        assert!(of(&[1.5]).low.is_nan() && of(&[1.5, 2.5]).high.is_nan(), "one or two that tell are too few");
        let few = of(&[1.5, 2.5, 1.75, 2.25]);
        let by_all = jackknife(2.0, &[&left(&[1.5, 2.5, 1.75, 2.25])[0]], Range::Distance);
        // t(3) over t(39), on the scale of square roots.
        let half = |found: Interval| found.high.sqrt() - 2.0_f64.sqrt();
        assert!((half(few) / half(by_all) - 3.1824 / 2.0227).abs() < 1e-3, "{few:?} and {by_all:?}");
        let certain = of(&[]);
        assert!(certain.low > 2.0 - 1e-9 && certain.high < 2.0 + 1e-9, "what nothing changes is certain: {certain:?}");
    }

    #[test]
    fn where_all_trajectories_change_a_number_all_are_degrees_of_freedom() {
        let (both, _) = grid(4, 3);
        let left = [vec![1.5, 2.5, 1.75, 2.25], vec![1.9, 2.05, 2.2]];
        let (found, wanted) =
            (both.jackknife(2.0, &left, Range::Distance), crossed(2.0, [&left[0], &left[1]], Range::Distance));
        assert_eq!((found.low, found.high), (wanted.low, wanted.high));
        // Distractors that change nothing leave the doubt to the states.
        let (found, wanted) = (
            both.jackknife(2.0, &[left[0].clone(), vec![2.0; 3]], Range::Distance),
            jackknife(2.0, &[&left[0]], Range::Distance),
        );
        assert!((found.low - wanted.low).abs() < 1e-9 && (found.high - wanted.high).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_share_that_no_trajectory_changes_is_certain() {
        let found = crossed(0.25, [&[0.25; 5], &[0.25; 4]], Range::Share);
        assert!((found.low - 0.25).abs() < 1e-12 && (found.high - 0.25).abs() < 1e-12, "{found:?}");
    }

    /// On a logarithmic scale the one line whose absence makes the share whole would stretch its interval over everything.
    #[test]
    fn a_number_that_reaches_an_end_without_a_trajectory_stays_certain() {
        let mut almost = [0.998; 10];
        almost[3] = 1.0;
        let found = crossed(0.998, [&almost, &[0.998; 10]], Range::Counted);
        assert!(found.low > 0.97 && found.high == 1.0, "{found:?}");
        let found = crossed(0.998, [&almost, &[0.998; 10]], Range::Signed);
        assert!(found.low > 0.97 && found.high == 1.0, "{found:?}");
        let found = crossed(-0.998, [&almost.map(|x: f64| -x), &[-0.998; 10]], Range::Signed);
        assert!(found.low == -1.0 && found.high < -0.97, "{found:?}");
        for (range, end) in [(Range::Counted, 0.0), (Range::Counted, 1.0), (Range::Signed, -1.0), (Range::Signed, 1.0)]
        {
            let found = crossed(end, [&[end; 4], &[end; 5]], range);
            assert_eq!((found.low, found.high), (end, end), "{range:?}");
        }
    }

    #[test]
    fn a_share_that_is_none_without_a_trajectory_has_no_interval() {
        for none in [f64::NAN, f64::INFINITY] {
            let (broken, whole) = ([none, 1.0, 1.0], [1.0; 4]);
            for without in [[&broken[..], &whole[..]], [&whole[..], &broken[..]]] {
                let found = crossed(1.0, without, Range::Share);
                assert!(found.low.is_nan() && found.high.is_nan(), "{found:?}");
            }
        }
    }
}
