//! How far two pictures are apart. In: the bytes of both. Out: two numbers that are usual for pictures.

/// Mean absolute error in levels of 255, and peak signal-to-noise ratio in dB (infinite for equal pictures).
pub fn picture_difference(a: &[u8], b: &[u8]) -> (f64, f64) {
    let differences = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)));
    let (sum, squares) = differences.fold((0.0, 0.0), |(sum, squares), d| (sum + d, squares + d * d));
    let count = a.len().max(1) as f64;
    (sum / count, 10.0 * (255.0 * 255.0 * count / squares).log10())
}
