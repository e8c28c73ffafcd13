//! Learning curves with intervals over runs (Figure 3 of the paper).
//!
//! In: for each run its points `(x, y)`: environment steps or updates, and a return, a gap, any metric. Out: mean and 95% interval
//! (Student's t over runs) at common places.

use serde::Serialize;

use vibes_measure::Error;
use vibes_measure::intervals::{Interval, student};

/// One place on a mean curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Steps, updates, …
    pub x: f64,
    /// Mean over runs and its interval; no interval from a single run.
    pub y: Interval,
    /// Runs that reach this far.
    pub runs: usize,
}

/// The mean curve of several runs at `places` evenly spaced values of x, from the latest start to the furthest end; where the runs have no more places than that among them,
/// as with evaluations, at those.
///
/// Each run is averaged over a window of one spacing around each place, and read off linearly between points where the window is empty. Runs that
/// end early take part up to their end.
///
/// # Errors
/// No run with a finite point, or fewer than two places.
pub fn mean_curve(runs: &[Vec<(f64, f64)>], places: usize) -> Result<Vec<CurvePoint>, Error> {
    if places < 2 {
        return Err(Error::Option { option: "places", value: places.to_string(), must: "at least 2" });
    }
    let runs: Vec<Vec<(f64, f64)>> = runs.iter().map(|run| sorted(run)).filter(|run| !run.is_empty()).collect();
    let start = runs.iter().map(|run| run[0].0).fold(f64::NEG_INFINITY, f64::max);
    let end = runs.iter().map(|run| run[run.len() - 1].0).fold(f64::NEG_INFINITY, f64::max);
    if runs.is_empty() {
        return Err(Error::TooFewRows { what: "a learning curve: runs with points", needed: 1, found: 0 });
    }
    let spacing = ((end - start) / (places - 1) as f64).max(0.0);
    let count = if spacing > 0.0 { places } else { 1 };
    let point = |x: f64, width: f64| {
        let values: Vec<f64> = runs.iter().filter_map(|run| read(run, x, width)).collect();
        CurvePoint { x, y: student(&values), runs: values.len() }
    };
    let mut own: Vec<f64> = runs.iter().flatten().map(|point| point.0).filter(|x| *x >= start).collect();
    own.sort_by(f64::total_cmp);
    own.dedup();
    if own.len() <= places {
        return Ok(own.into_iter().map(|x| point(x, 0.0)).collect());
    }
    Ok((0..count).map(|place| point(start + spacing * place as f64, spacing)).collect())
}

/// Finite points by rising x.
fn sorted(run: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut run: Vec<(f64, f64)> = run.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    run.sort_by(|a, b| a.0.total_cmp(&b.0));
    run
}

/// A run's value at `x`: the mean over the window around it, or linear between the points beside it.
fn read(run: &[(f64, f64)], x: f64, width: f64) -> Option<f64> {
    let from = run.partition_point(|point| point.0 < x - width / 2.0);
    let to = run.partition_point(|point| point.0 <= x + width / 2.0);
    if to > from {
        return Some(run[from..to].iter().map(|point| point.1).sum::<f64>() / (to - from) as f64);
    }
    let (before, after) = (run.get(from.checked_sub(1)?)?, run.get(to)?);
    Some(before.1 + (after.1 - before.1) * (x - before.0) / (after.0 - before.0))
}

#[cfg(test)]
mod tests {
    use super::mean_curve;

    #[test]
    fn curves_are_averaged_where_runs_have_them() {
        // Two lines on different grids, and one that ends half way.
        let line = |slope: f64, every: f64, end: f64| -> Vec<(f64, f64)> {
            (0..).map(|i| f64::from(i) * every).take_while(|x| *x <= end).map(|x| (x, slope * x)).collect()
        };
        let runs = [line(1.0, 1.0, 100.0), line(3.0, 7.0, 98.0), line(2.0, 0.5, 50.0)];
        let curve = mean_curve(&runs, 11).unwrap();
        assert_eq!(curve.len(), 11);
        assert_eq!((curve[3].runs, curve[8].runs), (3, 2));
        let (third, eighth) = (curve[3], curve[8]);
        assert!((third.x - 30.0).abs() < 1e-9 && (third.y.estimate - 60.0).abs() < 3.0, "{third:?}");
        assert!((eighth.y.estimate - 160.0).abs() < 4.0, "{eighth:?}");
        // t(2) · s / √3 with s the deviation of 30, 60 and 90.
        assert!((third.y.high - third.y.estimate - 4.3027 * 30.0 / 3.0_f64.sqrt()).abs() < 10.0);
        assert!(mean_curve(&[vec![(0.0, f64::NAN)]], 5).is_err());
        // Few points stay where they are.
        let evaluations = [vec![(5.0, 1.0), (20.0, 3.0), (40.0, 2.0)], vec![(5.0, 2.0), (20.0, 5.0)]];
        let curve = mean_curve(&evaluations, 3).unwrap();
        let points: Vec<(f64, f64, usize)> =
            curve.iter().map(|point| (point.x, point.y.estimate, point.runs)).collect();
        assert_eq!(points, [(5.0, 1.5, 2), (20.0, 4.0, 2), (40.0, 2.0, 1)]);
        assert_eq!(mean_curve(&[vec![(5.0, 1.0)]], 5).unwrap().len(), 1);
    }
}
