//! Rows: what an agent step of all environments shows, in one array for each kind of number.
//!
//! In: the number of environments and the widths of a row. Out: a place for every environment to write its own row to, whatever thread it runs on.

/// One row of every environment.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// `[environments, size, size, 3]`, empty where nothing is drawn.
    pub pixels: Vec<u8>,
    /// `[environments, observation]`.
    pub observations: Vec<f32>,
    /// `[environments]`, 0 where an episode began.
    pub rewards: Vec<f64>,
    /// `[environments]`, whether this row ends its episode.
    pub is_last: Vec<bool>,
}

/// Where one environment writes its row.
#[derive(Debug)]
pub(super) struct Place<'a> {
    /// `[size, size, 3]`, empty where nothing is drawn.
    pub pixels: &'a mut [u8],
    /// `[observation]`.
    pub observation: &'a mut [f32],
    pub reward: &'a mut f64,
    pub is_last: &'a mut bool,
}

impl Rows {
    /// Room for `environments` rows of `pixels` bytes and `observation` numbers.
    pub(super) fn of(environments: usize, pixels: usize, observation: usize) -> Self {
        Self {
            pixels: vec![0; environments * pixels],
            observations: vec![0.0; environments * observation],
            rewards: vec![0.0; environments],
            is_last: vec![false; environments],
        }
    }

    /// The rows' places, one after the other.
    pub(super) fn places(&mut self) -> Vec<Place<'_>> {
        let environments = self.rewards.len();
        let pixels = shares(&mut self.pixels, environments);
        let observations = shares(&mut self.observations, environments);
        let numbers = self.rewards.iter_mut().zip(&mut self.is_last);
        let shares = pixels.into_iter().zip(observations).zip(numbers);
        shares
            .map(|((pixels, observation), (reward, is_last))| Place { pixels, observation, reward, is_last })
            .collect()
    }
}

/// `all` in `count` equal pieces, which may be empty.
fn shares<T>(mut all: &mut [T], count: usize) -> Vec<&mut [T]> {
    let width = all.len() / count.max(1);
    let piece = |_| {
        let (piece, rest) = std::mem::take(&mut all).split_at_mut(width);
        all = rest;
        piece
    };
    (0..count).map(piece).collect()
}
