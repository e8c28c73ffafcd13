//! Same-state retrieval: at one step, is a cell's nearest among all other cells one of the same state trajectory? Distances are standardised L2 over that step's
//! cells.

use super::GridTable;

/// Steps that are asked; spread evenly.
const STEPS: usize = 20;

/// Share of cells whose nearest other cell shows the same state, averaged over steps; and what blind drawing gives.
pub fn at_1(table: &GridTable) -> (f64, f64) {
    let count = table.steps.min(STEPS);
    let steps = (0..count).map(|at| (at * table.steps + table.steps / 2) / count);
    let found = steps.map(|step| at_step(table, step)).sum::<f64>() / count.max(1) as f64;
    let cells = (table.states * table.distractors) as f64;
    (found, (table.distractors as f64 - 1.0) / (cells - 1.0))
}

fn at_step(table: &GridTable, step: usize) -> f64 {
    let cells: Vec<(usize, usize)> =
        (0..table.states).flat_map(|i| (0..table.distractors).map(move |j| (i, j))).collect();
    let weights = inverse_variances(table, step);
    let distance = |a: (usize, usize), b: (usize, usize)| -> f64 {
        let (x, y) = (table.row(a.0, a.1, step), table.row(b.0, b.1, step));
        x.iter().zip(y).zip(&weights).map(|((x, y), weight)| weight * f64::from(x - y).powi(2)).sum()
    };
    let is_hit = |&cell: &(usize, usize)| {
        let others = cells.iter().filter(|&&other| other != cell);
        others.min_by(|&&a, &&b| distance(cell, a).total_cmp(&distance(cell, b))).is_some_and(|near| near.0 == cell.0)
    };
    cells.iter().filter(|cell| is_hit(cell)).count() as f64 / cells.len() as f64
}

fn inverse_variances(table: &GridTable, step: usize) -> Vec<f64> {
    let cells = (table.states * table.distractors) as f64;
    let over = |of: &dyn Fn(&[f32]) -> f64| -> f64 {
        (0..table.states)
            .flat_map(|i| (0..table.distractors).map(move |j| (i, j)))
            .map(|(i, j)| of(table.row(i, j, step)))
            .sum::<f64>()
            / cells
    };
    let weight = |dim: usize| {
        let mean = over(&|row| f64::from(row[dim]));
        let variance = over(&|row| (f64::from(row[dim]) - mean).powi(2));
        if variance > 1e-12 { 1.0 / variance } else { 0.0 }
    };
    (0..table.dims).map(weight).collect()
}
