//! The table every measure works on: one latent per row, with the row's key and, on a grid, its cell.
//!
//! Checked once, here; the measures trust it. It borrows its columns, so a million latents are held once.

use crate::Error;
use crate::intervals::{Label, Trajectories, label};

/// Latents `[rows, dims]` with their keys. All columns have `rows` values; every latent is finite.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    dims: usize,
    values: &'a [f32],
    episode: &'a [u32],
    step: &'a [u32],
    state: Option<&'a [Option<u32>]>,
    distractor: Option<&'a [Option<u32>]>,
    origin: Option<&'a [u32]>,
}

impl<'a> Table<'a> {
    /// A table of latents `values` `[rows, dims]` (row major) keyed by `episode` and `step` `[rows]`.
    ///
    /// # Errors
    /// No rows, columns of unequal length, or a value that is not finite.
    pub fn new(dims: usize, values: &'a [f32], episode: &'a [u32], step: &'a [u32]) -> Result<Self, Error> {
        let rows = episode.len();
        if rows == 0 || dims == 0 {
            return Err(Error::TooFewRows { what: "a table of latents", needed: 1, found: 0 });
        }
        check_length("step", step.len(), rows)?;
        check_length("latent", values.len(), rows * dims)?;
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let (row, dim) = (at / dims, at % dims);
            return Err(Error::NotFinite { episode: episode[row], step: step[row], dim, value: values[at] });
        }
        Ok(Self { dims, values, episode, step, state: None, distractor: None, origin: None })
    }

    /// The same table with each row's cell of the grid: `state` trajectory and `distractor` trajectory `[rows]`.
    ///
    /// # Errors
    /// Columns of another length.
    pub fn with_grid(mut self, state: &'a [Option<u32>], distractor: &'a [Option<u32>]) -> Result<Self, Error> {
        check_length("state", state.len(), self.rows())?;
        check_length("distractor", distractor.len(), self.rows())?;
        self.state = Some(state);
        self.distractor = Some(distractor);
        Ok(self)
    }

    /// The same table of views that were made of others: `origin` `[rows]` names the episode that each row's was made of, its own where it was not made. A view is no trajectory of
    /// its own, and goes with its origin where trajectories are drawn again or left out.
    ///
    /// # Errors
    /// A column of another length.
    pub fn with_origin(mut self, origin: &'a [u32]) -> Result<Self, Error> {
        check_length("origin", origin.len(), self.rows())?;
        self.origin = Some(origin);
        Ok(self)
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.episode.len()
    }

    /// Number of latent dimensions.
    #[must_use]
    pub fn dims(&self) -> usize {
        self.dims
    }

    /// All latents, `[rows, dims]`, row major.
    #[must_use]
    pub fn values(&self) -> &'a [f32] {
        self.values
    }

    /// One latent, `[dims]`.
    #[must_use]
    pub fn row(&self, row: usize) -> &'a [f32] {
        &self.values[row * self.dims..(row + 1) * self.dims]
    }

    /// The episode of each row.
    #[must_use]
    pub fn episode(&self) -> &'a [u32] {
        self.episode
    }

    /// The step of each row within its episode.
    #[must_use]
    pub fn step(&self) -> &'a [u32] {
        self.step
    }

    /// The grid cell of a row: `(state, distractor)`, if the row has one.
    #[must_use]
    pub fn cell(&self, row: usize) -> Option<(u32, u32)> {
        Some((self.state?[row]?, self.distractor?[row]?))
    }

    /// What each row's trajectory is, numbered from 0: what probes hold out. Rows on a grid go by their state trajectory (cells of one state are not
    /// independent), others by their episode.
    #[must_use]
    pub fn state_trajectories(&self) -> Vec<u32> {
        let of = |row: usize| self.label(row).0;
        number(&(0..self.rows()).map(of).collect::<Vec<(u8, u32)>>())
    }

    /// What is drawn again for intervals: the cells of a grid by state and by distractor, episodes of other rows.
    #[must_use]
    pub fn trajectories(&self) -> Trajectories {
        Trajectories::new(&(0..self.rows()).map(|row| self.label(row)).collect::<Vec<_>>())
    }

    /// What a row is of: its cell, else the episode that it or its origin is in.
    fn label(&self, row: usize) -> Label {
        label(self.origin.unwrap_or(self.episode)[row], self.cell(row))
    }

    /// The row with this key.
    #[must_use]
    pub fn find(&self, episode: u32, step: u32) -> Option<usize> {
        (0..self.rows()).find(|&row| self.episode[row] == episode && self.step[row] == step)
    }
}

/// Labels numbered from 0 in their order.
pub(crate) fn number<T: Ord + Clone>(labels: &[T]) -> Vec<u32> {
    let mut names = labels.to_vec();
    names.sort_unstable();
    names.dedup();
    labels.iter().map(|label| names.partition_point(|name| name < label) as u32).collect()
}

fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected { Ok(()) } else { Err(Error::Length { what, expected, found }) }
}
