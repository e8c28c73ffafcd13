//! The return of an episode, and its mean over episodes with an interval.

use crate::Error;
use crate::intervals::{Interval, student};

/// The mean of independent episodes' returns with the 95% interval of Student's t: `mean ± t_{n-1} s / √n`, s the sample standard deviation.
/// No interval of fewer than two.
///
/// # Errors
/// No returns, or one that is not finite.
pub fn mean_return(returns: &[f64]) -> Result<Interval, Error> {
    if returns.is_empty() {
        return Err(Error::TooFewRows { what: "a mean return: episodes", needed: 1, found: 0 });
    }
    match returns.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(Error::ReturnNotFinite { episode: at, value: returns[at] }),
        None => Ok(student(returns)),
    }
}

#[cfg(test)]
mod tests {
    use super::mean_return;

    #[test]
    fn the_mean_of_five_returns_has_the_textbook_interval_and_nan_is_refused() {
        let found = mean_return(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert!((found.estimate - 3.0).abs() < 1e-12 && (found.high - 4.9632).abs() < 1e-3, "{found:?}");
        assert!(mean_return(&[]).is_err() && mean_return(&[1.0, f64::NAN]).is_err());
        assert!(mean_return(&[2.0]).unwrap().low.is_nan());
    }
}
