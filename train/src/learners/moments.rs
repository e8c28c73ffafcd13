//! Adam's moments of several groups of parameters on disk. In: optimisers by name. Out: a file of tensors and a file of steps in a checkpoint's folder, from which they go on
//! exactly where they stopped.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use burn::tensor::Device;
use vibes_model::checkpoint::{load_tensors, save_tensors};
use vibes_model::parameters::HostTensors;

use super::optimizer::{Counts, Optimizer};
use crate::error::{Result, TrainError, io, malformed};
use crate::json::write_json;

/// Names of the two files.
#[derive(Debug, Clone, Copy)]
pub struct Files {
    /// The moments.
    pub moments: &'static str,
    /// Adam's steps of each group.
    pub steps: &'static str,
}

/// Writes both files.
///
/// # Errors
/// The folder cannot be written.
pub fn save(folder: &Path, files: Files, optimizers: &mut [(&'static str, &mut Optimizer)]) -> Result<()> {
    let (mut moments, mut steps) = (BTreeMap::new(), BTreeMap::new());
    for (name, optimizer) in optimizers {
        moments.extend(optimizer.to_tensors(name));
        steps.insert(*name, optimizer.steps());
    }
    save_tensors(&folder.join(files.moments), &moments, HashMap::new())?;
    write_json(&folder.join(files.steps), &steps)
}

/// Reads both files; `counts` are those of the weights that the optimisers move, in the same order.
///
/// # Errors
/// One is missing or damaged, or of other weights.
pub fn load<const N: usize>(
    folder: &Path,
    files: Files,
    optimizers: [(&'static str, &mut Optimizer); N],
    counts: [Counts; N],
    device: &Device,
) -> Result<()> {
    let place = folder.join(files.moments);
    let (moments, _) = load_tensors(&place)?;
    let file = folder.join(files.steps);
    let text = std::fs::read_to_string(&file).map_err(io("read", &file))?;
    let steps: BTreeMap<String, u64> = serde_json::from_str(&text)
        .map_err(|error| malformed(&file, error, "Adam's steps of each group of parameters"))?;
    for ((name, optimizer), counts) in optimizers.into_iter().zip(&counts) {
        optimizer.restore(name, counts, (&moments, &place), steps.get(name).copied().unwrap_or(0), device)?;
    }
    Ok(())
}

/// That every weight is a number.
///
/// # Errors
/// One is none.
pub fn finite(weights: &HostTensors) -> Result<()> {
    match weights.values().flat_map(|tensor| &tensor.values).find(|value| !value.is_finite()) {
        Some(&value) => Err(TrainError::NotFinite { what: "a weight", value }),
        None => Ok(()),
    }
}
