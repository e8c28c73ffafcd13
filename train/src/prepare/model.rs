//! Whether the model of a run is the one that another is to begin with. In: the run, and the model that is wanted. Out: nothing, or what differs, in words.

use std::path::Path;

use vibes_model::ModelConfig;

use crate::error::{Result, TrainError};
use crate::learners::objective::Objective;
use crate::run::{Run, differences};

/// That the run `from` has weights for this model of an objective; further heads may differ, and so may the objective where both have the same networks.
///
/// # Errors
/// It has none, or for another model.
pub(crate) fn same_model(from: &Path, objective: Objective, wanted: &ModelConfig) -> Result<()> {
    let run = Run::open(from)?;
    run.newest_model()?;
    let found = &run.info().model;
    let wanted = ModelConfig { heads: found.heads.clone(), ..wanted.clone() };
    if *found == wanted {
        return Ok(());
    }
    if let Some(error) = run.lacks_adversary().filter(|_| wanted.adversary) {
        return Err(error);
    }
    let (found, wanted) = differences(found, &wanted);
    let before = run.info().options.objective;
    // Networks that an objective asks for were not typed: what was is said with them.
    let of =
        |text: String, own: Objective| if before == objective { text } else { format!("{text} (objective {own})") };
    Err(TrainError::OtherModel { found: of(found, before), wanted: of(wanted, objective), path: from.to_owned() })
}
