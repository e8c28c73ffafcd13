//! Dividing a recording by share, so that what is held out is clean: whole episodes, whole rows of the grid (state trajectories), whole columns
//! (distractor trajectories), or both at once. In: the list of episodes, shares, a seed. Out: the episode numbers of each part.

use std::collections::BTreeSet;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::{EpisodeEntry, Recording};

use crate::error::{Error, Result};

/// What is dealt out whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SplitBy {
    /// Episodes; on a grid, parts then share state and distractor trajectories.
    Episode,
    /// Rows of the grid: no part sees another's state trajectories.
    State,
    /// Columns of the grid: no part sees another's distractor trajectories.
    Distractor,
    /// Rows and columns; a cell whose row and column fall into different parts is in none.
    Both,
}

impl SplitBy {
    fn noun(self) -> &'static str {
        match self {
            Self::Episode => "episodes",
            Self::State => "rows of states",
            Self::Distractor | Self::Both => "columns of distractors",
        }
    }
}

/// The episode numbers of each part, rising.
///
/// # Errors
/// [`Error::Selection`] for shares that cannot be, more parts than there is to deal out, or a grid that is not there.
pub fn split(recording: &Recording, by: SplitBy, shares: &[f64], seed: u64) -> Result<Vec<Vec<u32>>> {
    check_shares(shares)?;
    let entries = recording.episodes();
    if by != SplitBy::Episode && entries.iter().any(|entry| entry.cell.is_none()) {
        let fact = "the recording is no grid".to_owned();
        return Err(Error::Selection { fact, expected: "--by episode, or a recording made with --grid".into() });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut deal = |by: SplitBy, key: fn(&EpisodeEntry) -> u32| -> Result<Vec<BTreeSet<u32>>> {
        let keys: BTreeSet<u32> = entries.iter().map(key).collect();
        let mut keys: Vec<u32> = keys.into_iter().collect();
        keys.shuffle(&mut rng);
        deal_out(&keys, shares, by)
    };
    let state: fn(&EpisodeEntry) -> u32 = |entry| entry.cell.map_or(0, |cell| cell.state);
    let distractor: fn(&EpisodeEntry) -> u32 = |entry| entry.cell.map_or(0, |cell| cell.distractor);
    let (rows, columns) = match by {
        SplitBy::Episode => (Some(deal(by, |entry| entry.index)?), None),
        SplitBy::State => (Some(deal(by, state)?), None),
        SplitBy::Distractor => (None, Some(deal(by, distractor)?)),
        SplitBy::Both => (Some(deal(SplitBy::State, state)?), Some(deal(by, distractor)?)),
    };
    let row_of = |entry: &EpisodeEntry| if by == SplitBy::Episode { entry.index } else { state(entry) };
    let part = |place: usize| -> Vec<u32> {
        let inside = |entry: &&EpisodeEntry| {
            rows.as_ref().is_none_or(|rows| rows[place].contains(&row_of(entry)))
                && columns.as_ref().is_none_or(|columns| columns[place].contains(&distractor(entry)))
        };
        entries.iter().filter(inside).map(|entry| entry.index).collect()
    };
    let parts: Vec<Vec<u32>> = (0..shares.len()).map(part).collect();
    if parts.iter().any(Vec::is_empty) {
        let fact = "a part has no episode, since its cells were never recorded".to_owned();
        return Err(Error::Selection { fact, expected: "another seed or other shares".into() });
    }
    Ok(parts)
}

fn check_shares(shares: &[f64]) -> Result<()> {
    let total: f64 = shares.iter().sum();
    let sound = shares.len() >= 2 && shares.iter().all(|&share| share > 0.0 && share < 1.0) && total <= 1.0 + 1e-9;
    let fact = format!("shares {shares:?}");
    let expected = || "two or more numbers between 0 and 1 that sum to at most 1, as in 0.8,0.2".into();
    if sound { Ok(()) } else { Err(Error::Selection { fact, expected: expected() }) }
}

/// Cuts a shuffled list where the running sum of the shares, rounded, says; what is past the last share is left out.
fn deal_out(keys: &[u32], shares: &[f64], by: SplitBy) -> Result<Vec<BTreeSet<u32>>> {
    let mut parts = Vec::new();
    let (mut from, mut total) = (0, 0.0);
    for share in shares {
        total += share;
        let to = ((total * keys.len() as f64).round() as usize).min(keys.len());
        parts.push(keys[from..to].iter().copied().collect::<BTreeSet<u32>>());
        from = to;
    }
    if parts.iter().any(BTreeSet::is_empty) {
        let fact = format!("{} {} in shares {shares:?} leave a part empty", keys.len(), by.noun());
        return Err(Error::Selection { fact, expected: "fewer parts, or larger shares".into() });
    }
    Ok(parts)
}
