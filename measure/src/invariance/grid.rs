//! Which row of the table is cell (state, distractor) at a step.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::holes::complete_part;
use crate::{Error, Table};

/// A complete grid: every state trajectory under every distractor trajectory, over the steps all cells have.
#[derive(Debug, Clone)]
pub struct Grid<'a> {
    table: Table<'a>,
    states: Vec<u32>,
    distractors: Vec<u32>,
    steps: Vec<u32>,
    /// `[states, distractors, steps]`.
    pub(super) rows: Vec<usize>,
    dropped: Dropped,
}

/// What is left out of a grid that is not whole.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// State trajectories that lack a cell, rising.
    pub states: Vec<u32>,
    /// Distractor trajectories that lack a cell, rising.
    pub distractors: Vec<u32>,
    /// How many steps some cell lacks.
    pub steps: usize,
}

impl Dropped {
    /// What was left out, in words, one sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let lines = [("state", &self.states), ("distractor", &self.distractors)];
        let of_lines = lines.into_iter().filter(|(_, dropped)| !dropped.is_empty());
        let of_lines = of_lines.map(|(kind, dropped)| {
            format!("the grid has holes: {kind} trajectories {dropped:?} lack a cell and were left out")
        });
        let of_steps = (self.steps > 0).then(|| {
            format!("the grid's cells are not equally long: {} steps that some cell lacks were left out", self.steps)
        });
        of_lines.chain(of_steps).collect()
    }
}

impl<'a> Grid<'a> {
    /// The grid of a table. Rows outside any cell are passed over; steps that some cell lacks are left out.
    ///
    /// # Errors
    /// No grid columns, fewer than two states or distractors, a cell that is missing, a step that occurs twice in a cell, or no common step.
    pub fn new(table: Table<'a>) -> Result<Self, Error> {
        let (cells, states, distractors) = cells(&table)?;
        let missing = missing(&cells, &states, &distractors);
        if let Some(&(state, distractor)) = missing.first() {
            let cells = states.len() * distractors.len();
            return Err(Error::GridHoles { state, distractor, missing: missing.len(), cells });
        }
        Self::of_cells(table, &cells, states, distractors, Dropped::default())
    }

    /// As [`Grid::new`], but of a grid with holes a complete part is taken: as long as a cell is missing, the state or distractor trajectory that
    /// lacks the largest share of its cells is left out. [`Grid::dropped`] names them.
    ///
    /// # Errors
    /// As [`Grid::new`], if fewer than two states or distractors remain.
    pub fn of_complete_part(table: Table<'a>) -> Result<Self, Error> {
        let (cells, states, distractors) = cells(&table)?;
        // As of views, each under a distractor of its own: nothing complete has two states, and to name the thousands that were left out would say less.
        if states.len() > 1 && cells.len() == distractors.len() {
            let what = "the invariance split: states under one distractor";
            return Err(Error::TooFewRows { what, needed: 2, found: 1 });
        }
        let [kept_states, kept_distractors] = complete_part(cells.keys().copied(), &states, &distractors);
        let others = |lines: &[u32], kept: &[u32]| -> Vec<u32> {
            lines.iter().copied().filter(|line| kept.binary_search(line).is_err()).collect()
        };
        let dropped = Dropped {
            states: others(&states, &kept_states),
            distractors: others(&distractors, &kept_distractors),
            steps: 0,
        };
        Self::of_cells(table, &cells, kept_states, kept_distractors, dropped)
    }

    fn of_cells(
        table: Table<'a>,
        cells: &Cells,
        states: Vec<u32>,
        distractors: Vec<u32>,
        mut dropped: Dropped,
    ) -> Result<Self, Error> {
        check_lines(&states, &distractors, &dropped)?;
        let kept = || states.iter().flat_map(|&state| distractors.iter().map(move |&distractor| (state, distractor)));
        let mut count: BTreeMap<u32, usize> = BTreeMap::new();
        for cell in kept() {
            cells[&cell].keys().for_each(|&step| *count.entry(step).or_default() += 1);
        }
        let all = states.len() * distractors.len();
        let found = count.len();
        let steps: Vec<u32> = count.into_iter().filter(|&(_, cells)| cells == all).map(|(step, _)| step).collect();
        if steps.is_empty() {
            return Err(Error::TooFewRows { what: "the invariance split: steps every cell has", needed: 1, found: 0 });
        }
        dropped.steps = found - steps.len();
        let rows = kept().flat_map(|cell| steps.iter().map(move |step| cells[&cell][step])).collect();
        Ok(Self { table, states, distractors, steps, rows, dropped })
    }

    /// The table.
    #[must_use]
    pub fn table(&self) -> &Table<'a> {
        &self.table
    }

    /// State trajectories, rising.
    #[must_use]
    pub fn states(&self) -> &[u32] {
        &self.states
    }

    /// Distractor trajectories, rising.
    #[must_use]
    pub fn distractors(&self) -> &[u32] {
        &self.distractors
    }

    /// Steps every cell has, rising.
    #[must_use]
    pub fn steps(&self) -> &[u32] {
        &self.steps
    }

    /// What was left out: trajectories that lack a cell, and steps that a cell lacks.
    #[must_use]
    pub fn dropped(&self) -> &Dropped {
        &self.dropped
    }

    /// The table's row of a cell at a step; all three are positions in the lists above.
    #[must_use]
    pub fn row(&self, state: usize, distractor: usize, step: usize) -> usize {
        self.rows[(state * self.distractors.len() + distractor) * self.steps.len() + step]
    }
}

/// The row of each step, for each cell.
type Cells = BTreeMap<(u32, u32), BTreeMap<u32, usize>>;

fn cells(table: &Table<'_>) -> Result<(Cells, Vec<u32>, Vec<u32>), Error> {
    let mut cells = Cells::new();
    for row in 0..table.rows() {
        let Some((state, distractor)) = table.cell(row) else {
            continue;
        };
        let step = table.step()[row];
        if cells.entry((state, distractor)).or_default().insert(step, row).is_some() {
            return Err(Error::RepeatedStep { state, distractor, step });
        }
    }
    if cells.is_empty() {
        return Err(Error::NoGrid);
    }
    let states: BTreeSet<u32> = cells.keys().map(|&(state, _)| state).collect();
    let distractors: BTreeSet<u32> = cells.keys().map(|&(_, distractor)| distractor).collect();
    Ok((cells, states.into_iter().collect(), distractors.into_iter().collect()))
}

/// That there are two lines of each kind; if not, whether they were left out of a grid with holes.
fn check_lines(states: &[u32], distractors: &[u32], dropped: &Dropped) -> Result<(), Error> {
    let is_whole = dropped.states.is_empty() && dropped.distractors.is_empty();
    let [of_states, of_distractors] = if is_whole {
        ["the invariance split: states", "the invariance split: distractors"]
    } else {
        [
            "the invariance split of a grid with holes: states that are left once none lacks a cell",
            "the invariance split of a grid with holes: distractors that are left once none lacks a cell",
        ]
    };
    for (what, found) in [(of_states, states.len()), (of_distractors, distractors.len())] {
        if found < 2 {
            return Err(Error::TooFewRows { what, needed: 2, found });
        }
    }
    Ok(())
}

fn missing(cells: &Cells, states: &[u32], distractors: &[u32]) -> Vec<(u32, u32)> {
    let all = states.iter().flat_map(|&state| distractors.iter().map(move |&distractor| (state, distractor)));
    all.filter(|cell| !cells.contains_key(cell)).collect()
}
