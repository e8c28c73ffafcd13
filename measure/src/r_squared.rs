//! R², the share of a quantity's variance that predictions explain: of probes, of rewards predicted open loop, and of pictures drawn from latents.
//!
//! ```text
//! R² = 1 − Σ (y − ŷ)² / Σ (y − mean y)²
//! ```
//!
//! In: values with their predictions, summed by cell or episode so that these can be drawn again for an interval. Out: R².

/// A spread below this share of the values' squares is rounding.
const FLAT: f64 = 1e-10;

/// Sums over some values and their predictions.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Squares {
    count: f64,
    sum: f64,
    squares: f64,
    error: f64,
}

impl Squares {
    /// Adds a value and what was predicted.
    pub fn add(&mut self, value: f64, predicted: f64) {
        self.count += 1.0;
        self.sum += value;
        self.squares += value * value;
        self.error += (value - predicted).powi(2);
    }

    /// The sums of several parts, each as often as its weight says.
    fn total(parts: &[Self], weights: &[f64]) -> Self {
        parts.iter().zip(weights).fold(Self::default(), |all, (part, weight)| Self {
            count: all.count + weight * part.count,
            sum: all.sum + weight * part.sum,
            squares: all.squares + weight * part.squares,
            error: all.error + weight * part.error,
        })
    }

    /// `Σ (y − mean y)²`; 0 where the values differ by rounding alone.
    fn spread(&self) -> f64 {
        let spread = self.squares - self.sum * self.sum / self.count;
        if spread > FLAT * self.squares { spread } else { 0.0 }
    }
}

/// R² of one quantity over parts that count with their weights, `[parts]`. NaN where the quantity does not vary.
#[must_use]
pub fn r_squared(parts: &[Squares], weights: &[f64]) -> f64 {
    together(&[Squares::total(parts, weights)])
}

/// R² of several quantities together, each about its own mean, such as the pixels of pictures: the errors of all over the spreads of all. NaN where none varies.
#[must_use]
pub fn together(quantities: &[Squares]) -> f64 {
    let total = |of: fn(&Squares) -> f64| quantities.iter().map(of).sum::<f64>();
    let spread = total(Squares::spread);
    if spread > 0.0 { 1.0 - total(|squares| squares.error) / spread } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn squares(pairs: &[(f64, f64)]) -> Squares {
        pairs.iter().fold(Squares::default(), |mut squares, &(value, predicted)| {
            squares.add(value, predicted);
            squares
        })
    }

    #[test]
    fn it_is_1_of_perfect_predictions_0_of_the_mean_and_weights_count() {
        let of = |pairs: &[(f64, f64)]| r_squared(&[squares(pairs)], &[1.0]);
        assert_eq!(of(&[(1.0, 1.0), (3.0, 3.0)]), 1.0);
        assert_eq!(of(&[(1.0, 2.0), (3.0, 2.0)]), 0.0);
        assert_eq!(of(&[(1.0, 3.0), (3.0, 1.0)]), -3.0);
        let (first, second) = (squares(&[(1.0, 2.0), (3.0, 3.0)]), squares(&[(7.0, 6.0)]));
        let twice = squares(&[(1.0, 2.0), (3.0, 3.0), (7.0, 6.0), (7.0, 6.0)]);
        assert!((r_squared(&[first, second], &[1.0, 2.0]) - r_squared(&[twice], &[1.0])).abs() < 1e-12);
    }

    #[test]
    fn what_does_not_vary_has_none_however_large_it_is() {
        assert!(r_squared(&[squares(&[(0.1, 0.0); 3])], &[1.0]).is_nan());
        assert!(r_squared(&[squares(&[(1e9, 0.0); 3])], &[1.0]).is_nan());
        assert!(r_squared(&[], &[]).is_nan());
        let small = squares(&[(1e-8, 1e-8), (-1e-8, -1e-8)]);
        assert_eq!(r_squared(&[small], &[1.0]), 1.0);
    }

    #[test]
    fn several_quantities_have_means_of_their_own() {
        let (dark, bright) = (squares(&[(0.0, 0.0), (2.0, 1.0)]), squares(&[(100.0, 100.0), (102.0, 103.0)]));
        assert!((together(&[dark, bright]) - 0.5).abs() < 1e-12);
    }
}
