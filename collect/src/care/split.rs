//! Dividing a recording by share, so that what is held out is clean: whole episodes, whole state trajectories (rows of a grid; without cells whatever has one seed and the same
//! actions), whole columns (distractor trajectories), or both at once. In: the list of episodes, shares, a seed. Out: the episode numbers of each part.

use std::collections::{BTreeMap, BTreeSet};

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_data::Recording;

use crate::error::{Error, Result};
use crate::trajectories::{trajectories, with_views};

/// What is dealt out whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SplitBy {
    /// Episodes; parts then share the state trajectories that have several, as on a grid, and its distractor trajectories.
    Episode,
    /// State trajectories, which are the rows of a grid: no part sees another's.
    State,
    /// Columns of the grid: no part sees another's distractor trajectories.
    Distractor,
    /// Rows and columns; a cell whose row and column fall into different parts is in none.
    Both,
}

impl SplitBy {
    /// What keeps the parts of a recording clean: its state trajectories, which are its episodes where no two are of one.
    ///
    /// # Errors
    /// When an episode that has to be looked into is damaged.
    pub fn usual(recording: &Recording) -> Result<Self> {
        let has_views = recording.manifest().grid.is_some() || with_views(recording)? > 0;
        Ok(if has_views { Self::State } else { Self::Episode })
    }
}

/// The episode numbers of each part, rising.
///
/// # Errors
/// [`Error::Selection`] for shares that cannot be, more parts than there is to deal out, or columns of a grid that is not there; damage of an episode that has to be looked into.
pub fn split(recording: &Recording, by: SplitBy, shares: &[f64], seed: u64) -> Result<Vec<Vec<u32>>> {
    check_shares(shares)?;
    let entries = recording.episodes();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut inside: Vec<Vec<bool>> = vec![vec![true; entries.len()]; shares.len()];
    let rows = (by == SplitBy::Both).then_some(SplitBy::State);
    for by in rows.into_iter().chain([by]) {
        let (keys, noun) = keys(recording, by)?;
        let mut dealt: Vec<u32> = keys.iter().copied().collect::<BTreeSet<u32>>().into_iter().collect();
        dealt.shuffle(&mut rng);
        for (part, kept) in inside.iter_mut().zip(deal_out(&dealt, shares, noun)?) {
            part.iter_mut().zip(&keys).for_each(|(is_in, key)| *is_in &= kept.contains(key));
        }
    }
    let numbers = |part: &Vec<bool>| -> Vec<u32> {
        entries.iter().zip(part).filter(|(_, is_in)| **is_in).map(|(entry, _)| entry.index).collect()
    };
    let parts: Vec<Vec<u32>> = inside.iter().map(numbers).collect();
    if parts.iter().any(Vec::is_empty) {
        let fact = "a part has no episode, since its cells were never recorded".to_owned();
        return Err(Error::Selection { fact, expected: "another seed or other shares".into() });
    }
    Ok(parts)
}

/// For every episode what it is dealt out by, and what that is called.
fn keys(recording: &Recording, by: SplitBy) -> Result<(Vec<u32>, &'static str)> {
    let entries = recording.episodes();
    let is_grid = entries.iter().all(|entry| entry.cell.is_some());
    Ok(match by {
        SplitBy::Episode => (entries.iter().map(|entry| entry.index).collect(), "episodes"),
        SplitBy::State => (trajectories(recording)?, if is_grid { "rows of states" } else { "state trajectories" }),
        SplitBy::Distractor | SplitBy::Both if is_grid => {
            let column = entries.iter().map(|entry| entry.cell.map_or(0, |cell| cell.distractor));
            (column.collect(), "columns of distractors")
        }
        SplitBy::Distractor | SplitBy::Both => {
            let expected = "--by state or --by episode, or a recording made with --grid".to_owned();
            return Err(Error::Selection { fact: "the recording is no grid".to_owned(), expected });
        }
    })
}

/// How many state trajectories are in more than one part.
///
/// # Errors
/// When an episode that has to be looked into is damaged.
pub fn shared_trajectories(recording: &Recording, parts: &[Vec<u32>]) -> Result<usize> {
    let mut holders: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    for (entry, trajectory) in recording.episodes().iter().zip(trajectories(recording)?) {
        let part = parts.iter().position(|part| part.binary_search(&entry.index).is_ok());
        holders.entry(trajectory).or_default().extend(part);
    }
    Ok(holders.values().filter(|parts| parts.len() > 1).count())
}

fn check_shares(shares: &[f64]) -> Result<()> {
    let total: f64 = shares.iter().sum();
    let sound = shares.len() >= 2 && shares.iter().all(|&share| share > 0.0 && share < 1.0) && total <= 1.0 + 1e-9;
    let fact = format!("shares {shares:?}");
    let expected = || "two or more numbers between 0 and 1 that sum to at most 1, as in 0.8,0.2".into();
    if sound { Ok(()) } else { Err(Error::Selection { fact, expected: expected() }) }
}

/// Cuts a shuffled list where the running sum of the shares, rounded, says; what is past the last share is left out.
fn deal_out(keys: &[u32], shares: &[f64], noun: &str) -> Result<Vec<BTreeSet<u32>>> {
    let mut parts = Vec::new();
    let (mut from, mut total) = (0, 0.0);
    for share in shares {
        total += share;
        let to = ((total * keys.len() as f64).round() as usize).min(keys.len());
        parts.push(keys[from..to].iter().copied().collect::<BTreeSet<u32>>());
        from = to;
    }
    if parts.iter().any(BTreeSet::is_empty) {
        let fact = format!("{} {noun} in shares {shares:?} leave a part empty", keys.len());
        return Err(Error::Selection { fact, expected: "fewer parts, or larger shares".into() });
    }
    Ok(parts)
}
