//! How trajectories are dealt into folds. In: the table's trajectories, or a group for each row. Out: the fold and the part of each row.

use rand::Rng;
use rand::seq::SliceRandom;

use super::HoldOut;
use crate::table::number;
use crate::{Error, Table};

/// The group of each row, numbered from 0.
pub(super) fn groups(table: &Table<'_>, hold_out: HoldOut) -> Result<Vec<u32>, Error> {
    let cells: Option<Vec<(u32, u32)>> = (0..table.rows()).map(|row| table.cell(row)).collect();
    match (hold_out, cells) {
        (HoldOut::State | HoldOut::StateOfUnknown, _) => Ok(table.state_trajectories()),
        (HoldOut::Distractor, Some(cells)) => Ok(number(&cells.iter().map(|cell| cell.1).collect::<Vec<u32>>())),
        (HoldOut::Distractor, None) => Err(Error::NoGrid),
        (HoldOut::Episode, _) => Ok(number(table.episode())),
    }
}

/// How many groups there are.
pub(super) fn count(groups: &[u32]) -> usize {
    groups.iter().max().map_or(0, |&last| last as usize + 1)
}

/// Groups dealt into folds, and within each fold into five parts, over which a penalty is chosen.
pub(super) struct Deal {
    /// The fold of each row.
    pub fold: Vec<u32>,
    /// The part of each row.
    pub part: Vec<u32>,
    pub folds: usize,
}

/// Parts over which a penalty is chosen.
pub(super) const PARTS: usize = 5;

impl Deal {
    /// A shuffled deal of `count` groups.
    pub(super) fn new(groups: &[u32], count: usize, folds: usize, rng: &mut impl Rng) -> Self {
        let folds = folds.clamp(2, count.max(2));
        let mut order: Vec<usize> = (0..count).collect();
        order.shuffle(rng);
        let (mut fold, mut part) = (vec![0; count], vec![0; count]);
        for (place, &group) in order.iter().enumerate() {
            fold[group] = (place % folds) as u32;
            // Groups of one fold go to one part after the other, and each fold begins with another, so that few groups fill all parts too.
            part[group] = ((place / folds + place % folds) % PARTS) as u32;
        }
        let of = |deal: &[u32]| groups.iter().map(|&group| deal[group as usize]).collect();
        Self { fold: of(&fold), part: of(&part), folds }
    }
}
