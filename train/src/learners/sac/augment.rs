//! Random views of a picture: RAD's crop and DrQ's shift. In: a picture's size, a generator. Out: where a view of it begins,
//! for [`cut`](vibes_model::sac::cut::cut), which cuts a whole stack at one place.
//!
//! Both are one operation, a cut at a place that may reach over the border. A window of pictures shares its place by being given the same one.

use std::fmt;
use std::str::FromStr;

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::error::TrainError;

/// Pixels a shifted picture moves at most, in every direction (denisyarats/drq).
const SHIFT: i32 = 4;
/// Share of a picture's side that a crop keeps: 84 of 100 pixels (`MishaLaskin/rad`).
const KEPT: (usize, usize) = (84, 100);

/// How pictures are varied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Augment {
    /// Not at all.
    None,
    /// A smaller picture cut at a random place; evaluation cuts the middle.
    Crop,
    /// The picture moved by up to four pixels, its border repeated; evaluation does not move it.
    Shift,
}

impl Augment {
    /// Every way.
    pub const ALL: [Self; 3] = [Self::None, Self::Crop, Self::Shift];

    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Crop => "crop",
            Self::Shift => "shift",
        }
    }

    /// Height and width of the views of pictures of this size.
    pub fn size(self, [height, width]: [usize; 2]) -> [usize; 2] {
        match self {
            Self::Crop => [height * KEPT.0 / KEPT.1, width * KEPT.0 / KEPT.1],
            Self::None | Self::Shift => [height, width],
        }
    }

    /// Where a random view begins in a picture of this size: row and column, every place equally likely.
    pub fn draw(self, size: [usize; 2], rng: &mut impl Rng) -> [i32; 2] {
        match self {
            Self::None => [0, 0],
            Self::Shift => [rng.random_range(-SHIFT..=SHIFT), rng.random_range(-SHIFT..=SHIFT)],
            Self::Crop => self.room(size).map(|room| rng.random_range(0..=room)),
        }
    }

    /// Where the view for evaluation begins.
    pub fn middle(self, size: [usize; 2]) -> [i32; 2] {
        self.room(size).map(|room| room / 2)
    }

    fn room(self, size: [usize; 2]) -> [i32; 2] {
        let view = self.size(size);
        [0, 1].map(|axis| (size[axis] - view[axis]) as i32)
    }
}

impl fmt::Display for Augment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Augment {
    type Err = TrainError;

    fn from_str(text: &str) -> Result<Self, TrainError> {
        Self::ALL.into_iter().find(|augment| augment.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            TrainError::Options(format!("no augmentation `{text}`; there are {names}"))
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use vibes_model::sac::cut::{Border, cut};

    use super::*;

    /// χ² of counts against equal ones, for `cells` cells; far beyond its mean (the cells less one) only if draws are not uniform.
    fn chi_squared(counts: &[u32]) -> f64 {
        let expected = f64::from(counts.iter().sum::<u32>()) / counts.len() as f64;
        counts.iter().map(|&count| (f64::from(count) - expected).powi(2) / expected).sum()
    }

    #[test]
    fn every_place_is_equally_likely_in_both_directions() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for (augment, size, low) in [(Augment::Shift, [64, 64], -4), (Augment::Crop, [50, 50], 0)] {
            let side = 9;
            let mut counts = vec![0; side * side];
            for _ in 0..81_000 {
                let [row, column] = augment.draw(size, &mut rng).map(|at| usize::try_from(at - low).unwrap());
                counts[row * side + column] += 1;
            }
            // 80 degrees of freedom: mean 80, standard deviation 12.6.
            let found = chi_squared(&counts);
            assert!(found < 80.0 + 5.0 * 12.6, "{augment}: {found}");
        }
    }

    #[test]
    fn a_stack_is_cut_at_one_place_and_evaluation_in_the_middle() {
        // Three frames whose pixels say where they are: every frame of the view must say the same.
        let (side, frames) = (20_usize, 3);
        let stack: Vec<u8> = (0..side * side).flat_map(|at| vec![at as u8; frames]).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for augment in Augment::ALL {
            let size = augment.size([side, side]);
            for place in [augment.draw([side, side], &mut rng), augment.middle([side, side])] {
                let mut out = Vec::new();
                cut(&stack, [side, side, frames], place, size, Border::Repeated, &mut out);
                assert_eq!(out.len(), size[0] * size[1] * frames);
                assert!(out.chunks_exact(frames).all(|pixel| pixel.iter().all(|byte| *byte == pixel[0])), "{augment}");
            }
        }
        assert_eq!(Augment::Crop.middle([100, 100]), [8, 8]);
        assert_eq!(Augment::Crop.size([100, 100]), [84, 84]);
        assert_eq!(Augment::Shift.middle([64, 64]), [0, 0]);
    }

    #[test]
    fn an_unknown_augmentation_lists_the_known_ones() {
        let error = "blur".parse::<Augment>().expect_err("unknown").to_string();
        assert!(error.contains("none, crop, shift"), "{error}");
    }
}
