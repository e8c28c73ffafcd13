//! How sure a number is: bootstrap intervals over trajectories, Student intervals over runs, and a jackknife for shares of a grid's variance.
//!
//! Rows of one trajectory are not independent, so trajectories are what is drawn again or left out, never rows.

use rand::Rng;
use rayon::prelude::*;
use serde::Serialize;

/// A number and the ends of its 95% interval. The ends are NaN when there was only one trajectory or run to go by.
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
    let draws: Vec<Vec<f64>> = (0..RESAMPLES)
        .map(|_| {
            let mut counts = vec![0.0; groups];
            (0..groups).for_each(|_| counts[rng.random_range(0..groups)] += 1.0);
            counts
        })
        .collect();
    let mut values: Vec<f64> =
        draws.par_iter().map(|counts| statistic(counts)).filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    Interval { estimate, low: percentile(&values, 0.025), high: percentile(&values, 0.975) }
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

/// The 95% interval of a share of variance between 0 and 1 that depends on two crossed kinds of trajectories, from its values `without` each
/// trajectory of either kind: the jackknife, on the scale `ln(p / (1 - p))` so that the ends stay between 0 and 1.
///
/// Both kinds are taken as drawn at random, so their variances add up; degrees of freedom after Satterthwaite. A bootstrap will not do here: a grid
/// that holds a trajectory twice varies less, and its shares lie beside the estimate. No interval with fewer than three of a kind.
#[must_use]
pub fn crossed_share(estimate: f64, without: [&[f64]; 2]) -> Interval {
    const EDGE: f64 = 1e-12;
    let logit = |share: f64| {
        let share = share.clamp(EDGE, 1.0 - EDGE);
        (share / (1.0 - share)).ln()
    };
    if without.iter().any(|values| values.len() < 3) || !estimate.is_finite() {
        return Interval { estimate, low: f64::NAN, high: f64::NAN };
    }
    let variance = without.map(|values| {
        let (count, values) = (values.len() as f64, values.iter().map(|&share| logit(share)).collect::<Vec<_>>());
        let mean = values.iter().sum::<f64>() / count;
        (count - 1.0) / count * values.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
    });
    let total = variance[0] + variance[1];
    let doubt: f64 = variance.iter().zip(without).map(|(v, values)| v * v / (values.len() as f64 - 1.0)).sum();
    let freedom = if doubt > 0.0 { (total * total / doubt).floor().max(1.0) } else { 1.0 };
    let half = if total > 0.0 { t_quantile(freedom as usize) * total.sqrt() } else { 0.0 };
    let share = |logit: f64| 1.0 / (1.0 + (-logit).exp());
    Interval {
        estimate,
        low: share(logit(estimate) - half).min(estimate),
        high: share(logit(estimate) + half).max(estimate),
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

    use super::{bootstrap, percentile, student};

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
}
