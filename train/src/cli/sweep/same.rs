//! That a plan still has the runs that were meant. In: the plan's runs, and the digest of those that a script or `--jobs` has counted. Out: an error where they
//! are others, since a number would then stand for a run that nobody asked for.

use anyhow::{Result, bail};
use vibes_train::TrainError;
use vibes_train::sweep::{Element, names_digest};

use super::SweepArgs;

/// Refuses a plan whose runs have other names than the script that calls knew of.
pub(super) fn check_names(args: &SweepArgs, elements: &[Element]) -> Result<()> {
    if args.names_are.as_ref().is_none_or(|digest| *digest == names_digest(elements)) {
        return Ok(());
    }
    bail!(TrainError::Options(format!(
        "the plan has other runs than when this script was printed; print it again with --script: {}",
        args.plan.display()
    )))
}

/// Refuses runs by number that are not the one that was counted.
pub(super) fn check_runs(args: &SweepArgs, elements: &[Element], chosen: &[usize]) -> Result<()> {
    let is_other = |element: &&Element| args.run_is.as_ref().is_some_and(|digest| *digest != element.digest());
    match chosen.iter().filter_map(|&index| elements.get(index)).find(is_other) {
        None => Ok(()),
        Some(element) => bail!(TrainError::Options(format!(
            "run {} of the plan is {} now, and not as it was when the sweep began; give the sweep's own command again: {}",
            element.index,
            element.name,
            args.plan.display()
        ))),
    }
}
