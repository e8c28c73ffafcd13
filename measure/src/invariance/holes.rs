//! Which part of a grid with holes is complete: lines (states or distractors) are left out one after the other until none lacks a cell.
//!
//! In: the cells that there are. Out: the lines that are left. Every line knows how many cells it has, so that leaving one out takes as long as its cells are many.

use std::collections::BTreeSet;

/// The states and the distractors that are left, rising, of those given, rising. As long as a cell is missing, the line that lacks the largest share of its cells is
/// left out: a state before a distractor that lacks as large a share, and a lower number before a higher.
pub(super) fn complete_part(
    cells: impl Iterator<Item = (u32, u32)>,
    states: &[u32],
    distractors: &[u32],
) -> [Vec<u32>; 2] {
    let (mut of_state, mut of_distractor) = (vec![Vec::new(); states.len()], vec![Vec::new(); distractors.len()]);
    for (state, distractor) in cells {
        let (state, distractor) = (place(states, state), place(distractors, distractor));
        of_state[state].push(distractor);
        of_distractor[distractor].push(state);
    }
    let (mut of_state, mut of_distractor) = (Lines::new(of_state), Lines::new(of_distractor));
    loop {
        let (state, distractor) = (of_state.lacking(&of_distractor), of_distractor.lacking(&of_state));
        if state == 0 && distractor == 0 {
            return [of_state.named(states), of_distractor.named(distractors)];
        }
        // The shares, each multiplied by the lengths of both lines: whole numbers are compared without rounding.
        if state * of_state.left.len() >= distractor * of_distractor.left.len() {
            of_state.leave_out(&mut of_distractor);
        } else {
            of_distractor.leave_out(&mut of_state);
        }
    }
}

/// Where a line stands among all of its kind, rising.
fn place(lines: &[u32], line: u32) -> usize {
    lines.partition_point(|&other| other < line)
}

/// All lines of one kind, by their places.
struct Lines {
    /// The lines of the other kind that each has a cell with, `[lines]`.
    crossing: Vec<Vec<usize>>,
    /// How many of these are left, `[lines]`.
    cells: Vec<usize>,
    /// The lines that are left, each behind the number of its cells: the first lacks most, and is the lowest of several that do.
    left: BTreeSet<(usize, usize)>,
}

impl Lines {
    fn new(crossing: Vec<Vec<usize>>) -> Self {
        let cells: Vec<usize> = crossing.iter().map(Vec::len).collect();
        let left = cells.iter().enumerate().map(|(line, &cells)| (cells, line)).collect();
        Self { crossing, cells, left }
    }

    /// The most cells that a line lacks.
    fn lacking(&self, other: &Self) -> usize {
        self.left.first().map_or(0, |&(cells, _)| other.left.len() - cells)
    }

    /// Leaves out the line that lacks most, and its cells from the lines of the other kind.
    fn leave_out(&mut self, other: &mut Self) {
        let Some((_, line)) = self.left.pop_first() else { return };
        for &crossed in &self.crossing[line] {
            let cells = &mut other.cells[crossed];
            if other.left.remove(&(*cells, crossed)) {
                *cells -= 1;
                other.left.insert((*cells, crossed));
            }
        }
    }

    /// The lines that are left, by their names.
    fn named(&self, names: &[u32]) -> Vec<u32> {
        let mut named: Vec<u32> = self.left.iter().map(|&(_, line)| names[line]).collect();
        named.sort_unstable();
        named
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::complete_part;

    /// Cells of a grid with holes, some states and distractors of which have more of them than others, and the lines that have any cell.
    fn sparse(size: [u32; 2], filled: f64, seed: u64) -> (BTreeSet<(u32, u32)>, [Vec<u32>; 2]) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [states, distractors] =
            size.map(|count| (0..count).map(|_| rng.random_range(0.0..0.3)).collect::<Vec<f64>>());
        let all = (0..size[0]).flat_map(|i| (0..size[1]).map(move |j| (i, j)));
        let cells: BTreeSet<(u32, u32)> = all
            .filter(|&(i, j)| rng.random::<f64>() < filled - states[i as usize] - distractors[j as usize])
            .map(|(i, j)| (3 * i + 1, 7 * j))
            .collect();
        let states: BTreeSet<u32> = cells.iter().map(|cell| cell.0).collect();
        let distractors: BTreeSet<u32> = cells.iter().map(|cell| cell.1).collect();
        (cells, [states, distractors].map(|lines| lines.into_iter().collect()))
    }

    /// The rule as it is written down, with the missing cells counted anew for every line.
    fn slowly(cells: &BTreeSet<(u32, u32)>, [mut states, mut distractors]: [Vec<u32>; 2]) -> [Vec<u32>; 2] {
        loop {
            let all = states.iter().flat_map(|&state| distractors.iter().map(move |&distractor| (state, distractor)));
            let missing: Vec<(u32, u32)> = all.filter(|cell| !cells.contains(cell)).collect();
            if missing.is_empty() {
                return [states, distractors];
            }
            let worst = |lines: &[u32], length: usize, of: fn(&(u32, u32)) -> u32| {
                let count = |line: u32| missing.iter().filter(|cell| of(cell) == line).count();
                let shares = lines.iter().map(|&line| (count(line) as f64 / length as f64, line));
                shares.fold((0.0, 0), |worst, next| if next.0 > worst.0 { next } else { worst })
            };
            let state = worst(&states, distractors.len(), |cell| cell.0);
            let distractor = worst(&distractors, states.len(), |cell| cell.1);
            if state.0 >= distractor.0 {
                states.retain(|&other| other != state.1);
            } else {
                distractors.retain(|&other| other != distractor.1);
            }
        }
    }

    proptest! {
        #[test]
        fn the_same_lines_are_left_as_by_the_rule(seed in any::<u64>(), i in 1_u32..13, j in 1_u32..13, filled in 0.1..1.4) {
            let (cells, lines) = sparse([i, j], filled, seed);
            let found = complete_part(cells.iter().copied(), &lines[0], &lines[1]);
            prop_assert_eq!(found, slowly(&cells, lines));
        }
    }

    /// Counted anew for every line that is left out, the holes of this one take hours.
    #[test]
    fn a_large_grid_with_holes_everywhere_has_a_complete_part() {
        let (cells, lines) = sparse([700, 600], 1.0, 3);
        let [states, distractors] = complete_part(cells.iter().copied(), &lines[0], &lines[1]);
        assert!(states.len() > 1 && distractors.len() > 1, "{states:?} {distractors:?}");
        assert!(states.iter().all(|&state| distractors.iter().all(|&distractor| cells.contains(&(state, distractor)))));
    }
}
