//! Resizing a frame to the square face of the sky's texture, as the suite does: to 800×800, ignoring its aspect ratio, bilinear between
//! pixel centres; and from there by averaging to the side that is kept.
//!
//! In: an RGB picture of any size. Out: RGB, `[side, side, 3]`. Both steps are linear and separable, so they are done as one.

/// The side of the suite's sky texture.
pub(crate) const SUITE_SIDE: usize = 800;

/// The few source pixels one output pixel is a weighted mean of.
#[derive(Clone, Debug)]
struct Taps {
    first: usize,
    weights: Vec<f32>,
}

/// `side` divides [`SUITE_SIDE`].
fn taps(source: usize, side: usize) -> Vec<Taps> {
    let factor = SUITE_SIDE / side;
    (0..side).map(|out| mean_taps(source, out * factor, factor)).collect()
}

/// The mean of the suite's pixels `start..start + count`.
fn mean_taps(source: usize, start: usize, count: usize) -> Taps {
    let scale = source as f64 / SUITE_SIDE as f64;
    let corner = |pixel: usize| {
        let position = ((pixel as f64 + 0.5) * scale - 0.5).clamp(0.0, (source - 1) as f64);
        (position as usize, position.fract())
    };
    let first = corner(start).0;
    let last = (corner(start + count - 1).0 + 1).min(source - 1);
    let mut weights = vec![0.0; last - first + 1];
    for pixel in start..start + count {
        let (left, right_weight) = corner(pixel);
        weights[left - first] += ((1.0 - right_weight) / count as f64) as f32;
        if right_weight > 0.0 {
            weights[left + 1 - first] += (right_weight / count as f64) as f32;
        }
    }
    Taps { first, weights }
}

/// Resizes `rgb`, `[height, width, 3]`, to `[side, side, 3]`.
pub(crate) fn resample(rgb: &[u8], width: usize, height: usize, side: usize) -> Vec<u8> {
    let columns = taps(width, side);
    let narrow: Vec<f32> =
        rgb.chunks_exact(3 * width).flat_map(|row| columns.iter().flat_map(|taps| weigh(row, taps))).collect();
    let mut picture = Vec::with_capacity(3 * side * side);
    let mut sums = vec![0.0; 3 * side];
    for taps in taps(height, side) {
        sums.fill(0.0);
        for (row, weight) in narrow.chunks_exact(3 * side).skip(taps.first).zip(&taps.weights) {
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
        }
        picture.extend(sums.iter().map(|sum| (sum + 0.5) as u8));
    }
    picture
}

fn weigh(row: &[u8], taps: &Taps) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (pixel, weight) in row[3 * taps.first..].chunks_exact(3).zip(&taps.weights) {
        for (sum, &channel) in sum.iter_mut().zip(pixel) {
            *sum += weight * f32::from(channel);
        }
    }
    sum
}

/// Half the side, each pixel the mean of four: the next level of a mipmap.
pub(crate) fn halve(rgb: &[u8], side: usize) -> Vec<u8> {
    let half = side / 2;
    let mut picture = Vec::with_capacity(3 * half * half);
    for rows in rgb.chunks_exact(6 * side) {
        let (upper, lower) = rows.split_at(3 * side);
        for (upper, lower) in upper.chunks_exact(6).zip(lower.chunks_exact(6)) {
            for channel in 0..3 {
                let sum = [upper[channel], upper[channel + 3], lower[channel], lower[channel + 3]].map(u16::from);
                picture.push(((sum.iter().sum::<u16>() + 2) / 4) as u8);
            }
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one() {
        for source in [1, 2, 180, 480, 800, 854, 1920] {
            for side in [800, 400, 200, 100] {
                for taps in taps(source, side) {
                    assert!((taps.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                    assert!(taps.first + taps.weights.len() <= source);
                }
            }
        }
    }

    #[test]
    fn a_square_of_the_suites_size_is_kept() {
        let picture: Vec<u8> = (0..3 * 800 * 800).map(|i| (i * 7 % 251) as u8).collect();
        assert_eq!(resample(&picture, 800, 800, 800), picture);
    }

    #[test]
    fn averaging_is_halving() {
        let picture: Vec<u8> = (0..3 * 800 * 800).map(|i| (i * 7 % 251) as u8).collect();
        let (direct, halved) = (resample(&picture, 800, 800, 400), halve(&picture, 800));
        assert!(direct.iter().zip(&halved).all(|(a, b)| a.abs_diff(*b) <= 1));
    }
}
