//! What a checkpoint says about its networks, held beside what it holds. In: a description, and the tensors of its file. Out: an error where a matrix that the
//! description asks for is not there in that shape. A few bytes of JSON could otherwise ask for terabytes before the first tensor is looked at.
//!
//! Each description lists its matrices beside the networks that it describes.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::ModelError;
use crate::parameters::HostTensors;

/// A matrix by its name in the file, and its shape.
pub(crate) type Matrix = (String, Vec<usize>);

/// A description of networks, as it is written into the file of their weights.
pub(crate) trait Described: Serialize + DeserializeOwned {
    /// The matrices that decide how much memory the networks take. One after the other: the description may say that there are more than anyone can list.
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_>;
}

/// Holds a description beside the tensors of its file.
///
/// # Errors
/// One of its matrices is missing, or has another shape, or a side of 0.
pub(crate) fn check(described: &impl Described, tensors: &HostTensors) -> Result<(), ModelError> {
    for (name, wanted) in described.matrices() {
        let Some(found) = tensors.get(&name).map(|tensor| tensor.shape.clone()) else {
            return Err(ModelError::MissingTensor { name });
        };
        if found != wanted || wanted.contains(&0) {
            return Err(ModelError::TensorShape { name, found, wanted });
        }
    }
    Ok(())
}

/// The matrices of a perceptron.
pub(crate) fn perceptron(name: &str, [input, hidden, output]: [usize; 3]) -> [Matrix; 3] {
    [("first", [input, hidden]), ("second", [hidden, hidden]), ("last", [hidden, output])]
        .map(|(layer, shape)| (format!("{name}.{layer}.weight"), shape.to_vec()))
}

/// A sum of sizes; one that no memory holds is no tensor's.
pub(crate) fn sum(parts: &[usize]) -> usize {
    parts.iter().fold(0, |all, part| all.saturating_add(*part))
}

/// A product of sizes, as [`sum`].
pub(crate) fn product(parts: &[usize]) -> usize {
    parts.iter().fold(1, |all, part| all.saturating_mul(*part))
}
