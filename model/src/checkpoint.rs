//! A model on disk: one safetensors file. Tensors carry the modules' own names (`world.encoder.gru.w_hidden`, `adversary.…`); the metadata entry
//! `config` holds the [`ModelConfig`] as JSON, so that the file alone is enough to build the model. Python reads it with
//! `safetensors.numpy.load_file`.

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use burn::tensor::Device;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rand::SeedableRng;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Serialize;

use crate::config::ModelConfig;
use crate::described::{Described, check};
use crate::error::ModelError;
use crate::model::Model;
use crate::parameters::{HostTensor, HostTensors, read_parameters, write_parameters};

impl Model {
    /// Writes the model to a new file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ModelError> {
        let mut tensors = read_parameters(&self.world, "world");
        if let Some(adversary) = &self.adversary {
            tensors.extend(read_parameters(adversary, "adversary"));
        }
        save_described(path, &tensors, ("config", &self.config))
    }

    /// Builds the model a file describes and reads its weights.
    ///
    /// # Errors
    /// The file is missing, is not a checkpoint, or its tensors do not fit its own description.
    pub fn load(path: &Path, device: &Device) -> Result<Self, ModelError> {
        let (tensors, config): (_, ModelConfig) = load_described(path, "config")?;
        // The first values are overwritten, so any generator does.
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
        Self::init(config, &mut rng, device)?.with_parameters(&tensors)
    }

    /// This model with other weights, by name.
    ///
    /// # Errors
    /// A tensor is missing or has another shape.
    pub fn with_parameters(self, tensors: &HostTensors) -> Result<Self, ModelError> {
        let world = write_parameters(self.world, "world", tensors)?;
        let adversary =
            self.adversary.map(|adversary| write_parameters(adversary, "adversary", tensors)).transpose()?;
        Ok(Self { config: self.config, world, adversary })
    }
}

/// Writes tensors and what is needed to build their module, as JSON in a metadata entry of this name.
pub(crate) fn save_described(
    path: &Path,
    tensors: &HostTensors,
    (entry, config): (&str, &impl Serialize),
) -> Result<(), ModelError> {
    let config = serde_json::to_string(config).map_err(|error| not_a_checkpoint(path, error))?;
    save_tensors(path, tensors, HashMap::from([(entry.to_owned(), config)]))
}

/// Reads a file of [`save_described`], whose description asks for no more than the file holds.
pub(crate) fn load_described<C: Described>(path: &Path, entry: &str) -> Result<(HostTensors, C), ModelError> {
    let (tensors, metadata) = load_weights(path)?;
    let config = metadata.get(entry);
    let config = config.ok_or_else(|| not_a_checkpoint(path, format!("it has no metadata entry `{entry}`")))?;
    let config: C = serde_json::from_str(config).map_err(|error| not_a_checkpoint(path, error))?;
    check(&config, &tensors)?;
    config.check_constants().map_err(|why| not_a_checkpoint(path, why))?;
    Ok((tensors, config))
}

/// Reads a file as [`load_tensors`], all of whose numbers must be finite: weights that are none make nothing but numbers that are none.
///
/// # Errors
/// As there, or a number is infinite or none.
pub fn load_weights(path: &Path) -> Result<(HostTensors, HashMap<String, String>), ModelError> {
    let (tensors, metadata) = load_tensors(path)?;
    for (name, tensor) in &tensors {
        if let Some(&value) = tensor.values.iter().find(|value| !value.is_finite()) {
            return Err(ModelError::NotFinite { name: name.clone(), value, path: path.to_owned() });
        }
    }
    Ok((tensors, metadata))
}

/// Writes tensors and text metadata as one safetensors file.
///
/// # Errors
/// The file cannot be written.
pub fn save_tensors(path: &Path, tensors: &HostTensors, metadata: HashMap<String, String>) -> Result<(), ModelError> {
    let mut views = Vec::with_capacity(tensors.len());
    for (name, tensor) in tensors {
        let bytes = bytemuck::cast_slice(&tensor.values);
        let view =
            TensorView::new(Dtype::F32, tensor.shape.clone(), bytes).map_err(|error| not_a_checkpoint(path, error))?;
        views.push((name.as_str(), view));
    }
    // A header without any entry is written in a way that cannot be read again.
    let metadata = (!metadata.is_empty()).then_some(metadata);
    let bytes = safetensors::serialize(views, metadata).map_err(|error| not_a_checkpoint(path, error))?;
    // On the disk, before a rename makes it the newest checkpoint.
    let write = || fs::File::create(path).and_then(|mut file| file.write_all(&bytes).and_then(|()| file.sync_data()));
    write().map_err(|cause| ModelError::Io { path: path.to_owned(), action: "write", cause })
}

/// Writes a copy of a safetensors file in half precision, metadata and all: half the bytes, for weights that are kept and not trained on every day. A tensor with a number
/// that half precision would make infinite stays in single precision.
///
/// # Errors
/// The file cannot be read, or the copy cannot be written.
pub fn copy_in_half(from: &Path, to: &Path) -> Result<(), ModelError> {
    let (tensors, metadata) = load_tensors(from)?;
    let packed: Vec<(&String, &HostTensor, Option<Vec<f16>>)> =
        tensors.iter().map(|(name, tensor)| (name, tensor, halves(&tensor.values))).collect();
    let mut views = Vec::with_capacity(packed.len());
    for (name, tensor, halves) in &packed {
        // Numbers as they lie in memory: safetensors is little-endian, as every machine that MuJoCo runs on.
        let (kind, bytes): (Dtype, &[u8]) = match halves {
            Some(halves) => {
                let bits: &[u16] = HalfFloatSliceExt::reinterpret_cast(halves.as_slice());
                (Dtype::F16, bytemuck::cast_slice(bits))
            }
            None => (Dtype::F32, bytemuck::cast_slice(&tensor.values)),
        };
        let view = TensorView::new(kind, tensor.shape.clone(), bytes).map_err(|error| not_a_checkpoint(to, error))?;
        views.push((name.as_str(), view));
    }
    let bytes = safetensors::serialize(views, Some(metadata)).map_err(|error| not_a_checkpoint(to, error))?;
    fs::write(to, bytes).map_err(|cause| ModelError::Io { path: to.to_owned(), action: "write", cause })
}

/// The numbers in half precision; none where that would make a finite one infinite.
fn halves(values: &[f32]) -> Option<Vec<f16>> {
    let halves: Vec<f16> = values.iter().copied().map(f16::from_f32).collect();
    let overflows = values.iter().zip(&halves).any(|(value, half)| value.is_finite() && half.is_infinite());
    (!overflows).then_some(halves)
}

/// Reads a safetensors file of tensors in single or half precision, and its metadata.
///
/// # Errors
/// The file is missing, truncated, or holds other types.
pub fn load_tensors(path: &Path) -> Result<(HostTensors, HashMap<String, String>), ModelError> {
    let bytes = fs::read(path).map_err(|cause| ModelError::Io { path: path.to_owned(), action: "read", cause })?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| not_a_checkpoint(path, error))?;
    let file = SafeTensors::deserialize(&bytes).map_err(|error| not_a_checkpoint(path, error))?;
    let mut tensors = HostTensors::new();
    for (name, view) in file.iter() {
        let values = match view.dtype() {
            Dtype::F32 => bytemuck::pod_collect_to_vec(view.data()),
            Dtype::F16 => widened(&bytemuck::pod_collect_to_vec(view.data())),
            other => return Err(not_a_checkpoint(path, format!("tensor `{name}` is {other:?}, not F32 or F16"))),
        };
        tensors.insert(name.to_owned(), HostTensor { shape: view.shape().to_vec(), values });
    }
    Ok((tensors, header.metadata().clone().unwrap_or_default()))
}

/// Half-precision numbers, as their bits, in single precision.
fn widened(bits: &[u16]) -> Vec<f32> {
    bits.iter().map(|bits| f16::from_bits(*bits).to_f32()).collect()
}

pub(crate) fn not_a_checkpoint(path: &Path, why: impl std::fmt::Display) -> ModelError {
    ModelError::NotACheckpoint { path: path.to_owned(), why: why.to_string() }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_file_without_tensors_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("moments.safetensors");
        for metadata in [HashMap::new(), HashMap::from([("steps".to_owned(), "0".to_owned())])] {
            save_tensors(&path, &HostTensors::new(), metadata.clone()).unwrap();
            assert_eq!(load_tensors(&path).unwrap(), (HostTensors::new(), metadata));
        }
    }

    /// 65504 is the largest finite number in half precision.
    #[test]
    fn a_copy_in_half_precision_keeps_every_finite_number_finite() {
        let folder = tempfile::tempdir().unwrap();
        let [from, to] = ["from", "to"].map(|name| folder.path().join(name));
        let tensor = |values: &[f32]| HostTensor { shape: vec![values.len()], values: values.to_vec() };
        let tensors = HostTensors::from([
            ("large".to_owned(), tensor(&[1.0, -70_000.0])),
            ("largest".to_owned(), tensor(&[65_504.0, -0.5])),
            ("odd".to_owned(), tensor(&[f32::INFINITY, 0.25])),
        ]);
        save_tensors(&from, &tensors, HashMap::from([("config".to_owned(), "{}".to_owned())])).unwrap();
        copy_in_half(&from, &to).unwrap();
        assert_eq!(load_tensors(&to).unwrap().0, tensors);
        let bytes = fs::read(&to).unwrap();
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let kinds = ["large", "largest", "odd"].map(|name| file.tensor(name).unwrap().dtype());
        assert_eq!(kinds, [Dtype::F32, Dtype::F16, Dtype::F16]);
    }

    #[test]
    fn weights_that_are_no_numbers_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.safetensors");
        for value in [f32::NAN, f32::NEG_INFINITY] {
            let tensor = HostTensor { shape: vec![2], values: vec![0.5, value] };
            save_tensors(&path, &HostTensors::from([("world.bias".to_owned(), tensor)]), HashMap::new()).unwrap();
            let error = load_weights(&path).unwrap_err().to_string();
            assert!(error.contains("`world.bias`") && error.ends_with("model.safetensors"), "{error}");
            assert!(load_tensors(&path).is_ok());
        }
    }
}
