//! Who is judged by a probe fitted on whom: other trajectories of the same table, or another table.

use rand::Rng;

use super::deal::{Deal, count, groups};
use super::quantity::{Predictions, Targets};
use super::score::Judge;
use super::{Fitting, HoldOut, Probe, ProbeOptions, ProbeScore, Sample, Values, knn, logistic, ridge};
use crate::{Error, Table};

/// Linear and kNN scores of each quantity (all numbers or all classes), every row judged by a probe fitted on the folds it is not in.
pub(super) fn within(
    judged: Sample<'_>,
    hold_out: HoldOut,
    options: ProbeOptions,
    rng: &mut impl Rng,
) -> Result<Vec<[ProbeScore; 2]>, Error> {
    let table = &judged.table;
    let groups = groups(table, hold_out)?;
    let count = count(&groups);
    if count < 2 {
        return Err(Error::TooFewRows { what: "a probe: trajectories", needed: 2, found: count });
    }
    let deal = Deal::new(&groups, count, options.folds, rng);
    let targets = Targets::new(table, judged.quantities)?;
    let means = targets.means();
    let targets = targets.less(&means);
    let classes = matches!(judged.quantities[0].values, Values::Classes(_));
    // The cells of two states lie in the same order: given another state's, every cell would keep what is its own distractor's.
    let shuffled = if classes || hold_out == HoldOut::StateOfUnknown {
        let (cells, count) = cells(table);
        targets.shuffled(&cells, count, rng)
    } else {
        targets.shuffled(&groups, count, rng)
    };
    let linear = |targets: &Targets, rng: &mut _| {
        if classes {
            logistic::predict(table, targets, &deal.fold, options.logistic_rows, rng)
        } else {
            Ok(Predictions { rows: (0..table.rows()).collect(), values: ridge::predict(table, targets, &deal)? })
        }
    };
    let near = knn::Neighbourhoods::held_out(table, &deal.fold, options, rng)?;
    let found = [
        (Probe::Linear, linear(&targets, rng)?, linear(&shuffled, rng)?),
        (Probe::Knn, near.predict(&targets), near.predict(&shuffled)),
    ];
    // A shuffled probe is judged on shuffled quantities: every trajectory has another's, the held-out one too.
    let judges = [Judge::new(&targets, table), Judge::new(&shuffled, table)];
    Ok(scores(judged, &targets, Fitting::CrossValidation, &found, &judges, count, rng))
}

/// Linear and kNN scores of each quantity (all numbers), every row judged by a probe fitted on the other table.
pub(super) fn fitted_elsewhere(
    judged: Sample<'_>,
    fitted: Sample<'_>,
    options: ProbeOptions,
    rng: &mut impl Rng,
) -> Result<Vec<[ProbeScore; 2]>, Error> {
    let groups = fitted.table.state_trajectories();
    let count = count(&groups);
    let deal = Deal::new(&groups, count, options.folds, rng);
    let theirs = Targets::new(&fitted.table, fitted.quantities)?;
    let means = theirs.means();
    let (targets, theirs) = (Targets::new(&judged.table, judged.quantities)?.less(&means), theirs.less(&means));
    let by_state = theirs.shuffled(&groups, count, rng);
    let (of_fitted, fitted_cells) = cells(&fitted.table);
    let by_cell = theirs.shuffled(&of_fitted, fitted_cells, rng);
    // What is the distractor's, or may be, differs between the cells of a state, and is the same in those of one distractor.
    let shuffled = by_state.with_from(&by_cell, |at| fitted.quantities[at].hold_out != HoldOut::State || count < 2);
    let linear = |theirs: &Targets| {
        let values = ridge::predict_elsewhere(&fitted.table, theirs, &deal, &judged.table)?;
        Ok::<_, Error>(Predictions { rows: (0..judged.table.rows()).collect(), values })
    };
    let near = knn::Neighbourhoods::elsewhere(&fitted.table, &judged.table, options, rng)?;
    let found = [
        (Probe::Linear, linear(&theirs)?, linear(&shuffled)?),
        (Probe::Knn, near.predict(&theirs), near.predict(&shuffled)),
    ];
    let judge = Judge::new(&targets, &judged.table);
    let cells = judged.table.trajectories().units();
    Ok(scores(judged, &targets, Fitting::OtherRecordings, &found, &[judge.clone(), judge], cells, rng))
}

/// The cell or episode of each row, and how many there are.
fn cells(table: &Table<'_>) -> (Vec<u32>, usize) {
    let trajectories = table.trajectories();
    ((0..table.rows()).map(|row| trajectories.unit(row) as u32).collect(), trajectories.units())
}

fn scores(
    judged: Sample<'_>,
    targets: &Targets,
    fitting: Fitting,
    found: &[(Probe, Predictions, Predictions); 2],
    judges: &[Judge<'_>; 2],
    groups: usize,
    rng: &mut impl Rng,
) -> Vec<[ProbeScore; 2]> {
    let mut scores = Vec::new();
    for (at, quantity) in judged.quantities.iter().enumerate() {
        let (measure, chance) = targets.measure(at);
        let mut pair = found.iter().map(|(probe, predicted, control)| ProbeScore {
            quantity: quantity.name.clone(),
            probe: *probe,
            fitting,
            measure,
            score: judges[0].score(at, predicted, rng),
            shuffled: judges[1].score(at, control, rng),
            chance,
            groups,
        });
        if let (Some(linear), Some(knn)) = (pair.next(), pair.next()) {
            scores.push([linear, knn]);
        }
    }
    scores
}
