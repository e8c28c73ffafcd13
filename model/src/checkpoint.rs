//! A model on disk: one safetensors file. Tensors carry the modules' own names (`world.encoder.gru.w_hidden`, `adversary.…`); the metadata entry
//! `config` holds the [`ModelConfig`] as JSON, so that the file alone is enough to build the model. Python reads it with
//! `safetensors.numpy.load_file`.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use burn::tensor::Device;
use rand::SeedableRng;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::config::ModelConfig;
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
        let config = serde_json::to_string(&self.config).map_err(|error| not_a_checkpoint(path, error))?;
        save_tensors(path, &tensors, HashMap::from([("config".to_owned(), config)]))
    }

    /// Builds the model a file describes and reads its weights.
    ///
    /// # Errors
    /// The file is missing, is not a checkpoint, or its tensors do not fit its own description.
    pub fn load(path: &Path, device: &Device) -> Result<Self, ModelError> {
        let (tensors, metadata) = load_tensors(path)?;
        let config =
            metadata.get("config").ok_or_else(|| not_a_checkpoint(path, "it has no metadata entry `config`"))?;
        let config: ModelConfig = serde_json::from_str(config).map_err(|error| not_a_checkpoint(path, error))?;
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
    let bytes = safetensors::serialize(views, Some(metadata)).map_err(|error| not_a_checkpoint(path, error))?;
    fs::write(path, bytes).map_err(|source| ModelError::Io { path: path.to_owned(), action: "write", source })
}

/// Reads a safetensors file of float32 tensors, and its metadata.
///
/// # Errors
/// The file is missing, truncated, or holds other types.
pub fn load_tensors(path: &Path) -> Result<(HostTensors, HashMap<String, String>), ModelError> {
    let bytes = fs::read(path).map_err(|source| ModelError::Io { path: path.to_owned(), action: "read", source })?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| not_a_checkpoint(path, error))?;
    let file = SafeTensors::deserialize(&bytes).map_err(|error| not_a_checkpoint(path, error))?;
    let mut tensors = HostTensors::new();
    for (name, view) in file.iter() {
        if view.dtype() != Dtype::F32 {
            return Err(not_a_checkpoint(path, format!("tensor `{name}` is {:?}, not F32", view.dtype())));
        }
        let values = bytemuck::pod_collect_to_vec(view.data());
        tensors.insert(name.to_owned(), HostTensor { shape: view.shape().to_vec(), values });
    }
    Ok((tensors, header.metadata().clone().unwrap_or_default()))
}

pub(crate) fn not_a_checkpoint(path: &Path, why: impl std::fmt::Display) -> ModelError {
    ModelError::NotACheckpoint { path: path.to_owned(), why: why.to_string() }
}
