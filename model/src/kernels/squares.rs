//! The sum of a tensor's squares in one pass.
//!
//! In: a tensor without autodiff. Out: the sum, the same on every processor.

use burn::tensor::Tensor;

use super::flex;
use super::instructions::Instructions;

/// Numbers whose squares are added up in single precision before they are added to the others in double.
const PIECE: usize = 4096;
/// Sums that are kept side by side.
const SUMS: usize = 64;

/// Σ x² over all numbers.
pub fn sum_of_squares(tensor: &Tensor<1>) -> f64 {
    let Some(own) = flex::unfollowed(tensor.clone()) else {
        return f64::from(tensor.clone().square().sum().into_scalar::<f32>());
    };
    let instructions = Instructions::best();
    let of_piece = |piece: &[f32]| {
        let sum = instructions.run(
            #[inline(always)]
            || of_piece(piece),
        );
        f64::from(sum)
    };
    flex::numbers(&own).chunks(PIECE).map(of_piece).sum()
}

#[inline(always)]
fn of_piece(numbers: &[f32]) -> f32 {
    let (lines, rest) = numbers.as_chunks::<SUMS>();
    let mut sums = [0.0_f32; SUMS];
    for line in lines {
        for (sum, number) in sums.iter_mut().zip(line) {
            *sum += number * number;
        }
    }
    sums.iter().sum::<f32>() + rest.iter().map(|number| number * number).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;

    #[test]
    fn agrees_with_float64_at_any_length() {
        for count in [0, 1, 63, 64, 65, PIECE, 3 * PIECE + 129] {
            let numbers: Vec<f32> = (0..count).map(|i| (0.37 * i as f32).sin() * 3.0).collect();
            let exact: f64 = numbers.iter().map(|number| f64::from(*number).powi(2)).sum();
            let found = sum_of_squares(&Tensor::from_data(TensorData::new(numbers, [count]), &Device::flex()));
            assert!((found - exact).abs() <= 1e-6 * exact, "{count}: {found}, not {exact}");
        }
    }
}
