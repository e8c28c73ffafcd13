//! What an episode says, in one number, so that one which two recordings hold under two numbers is known. In: an episode. Out: a SHA-256 of all but its number.

use sha2::{Digest, Sha256};

use crate::{BackgroundFrame, Episode};

impl Episode {
    /// SHA-256 in hexadecimal of everything but [`Episode::index`], to the bit: what was recorded once has the same wherever it is numbered otherwise.
    pub fn digest(&self) -> String {
        let mut sum = Sha256::new();
        let head = format!("{:?} {:?} {}", self.cell, self.acting_distractor, self.is_terminal);
        add(&mut sum, head.bytes().map(|byte| [byte]));
        for column in [&self.actions, &self.rewards, &self.discounts, &self.observations, &self.colors] {
            add(&mut sum, column.iter().map(|number| number.to_le_bytes()));
        }
        for column in [&self.qpos, &self.qvel] {
            add(&mut sum, column.iter().map(|number| number.to_le_bytes()));
        }
        let cameras: Vec<f64> =
            self.cameras.iter().flat_map(|camera| [camera.r, camera.h, camera.v, camera.roll]).collect();
        add(&mut sum, cameras.iter().map(|number| number.to_le_bytes()));
        let parts: [fn(BackgroundFrame) -> u32; 2] = [|shown| shown.video, |shown| shown.frame];
        for pick in parts {
            // A row without a background has a number that no video has.
            add(&mut sum, self.backgrounds.iter().map(|shown| shown.map_or(u32::MAX, pick).to_le_bytes()));
        }
        sum.update((self.pixels.len() as u64).to_le_bytes());
        sum.update(&self.pixels);
        sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// Adds a column behind its length, so that a number cannot pass from one column into the next unseen.
fn add<const N: usize>(sum: &mut Sha256, column: impl ExactSizeIterator<Item = [u8; N]>) {
    sum.update((column.len() as u64).to_le_bytes());
    column.for_each(|number| sum.update(number));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CameraPose;

    #[test]
    fn only_the_number_may_differ() {
        let episode = Episode {
            actions: vec![1.0, 2.0],
            rewards: vec![0.5],
            discounts: vec![1.0],
            qpos: vec![0.0, 1.0],
            pixels: vec![1, 2, 3],
            cameras: vec![CameraPose::default(); 2],
            backgrounds: vec![None, Some(BackgroundFrame { video: 0, frame: 1 })],
            ..Episode::default()
        };
        assert_eq!(episode.digest(), Episode { index: 9, ..episode.clone() }.digest());
        type Change = fn(&mut Episode);
        let changes: [Change; 8] = [
            |other| other.is_terminal = true,
            |other| other.acting_distractor = Some(0),
            |other| other.actions.swap(0, 1),
            |other| other.rewards[0] = -0.5,
            |other| other.qpos[0] = -0.0,
            |other| other.pixels[2] = 4,
            |other| other.cameras[1].roll = 1.0,
            |other| other.backgrounds.swap(0, 1),
        ];
        for (place, change) in changes.into_iter().enumerate() {
            let mut other = episode.clone();
            change(&mut other);
            assert_ne!(other.digest(), episode.digest(), "{place}");
        }
        let moved = Episode { actions: vec![1.0], rewards: vec![2.0, 0.5], ..episode.clone() };
        assert_ne!(moved.digest(), episode.digest(), "a number that passed into the next column");
    }
}
