//! What a checkpoint says about its networks, held beside what it holds. In: a description, and the tensors of its file. Out: an error where a matrix that the
//! description asks for is not there in that shape, or a constant is none that it can have. A few bytes of JSON could otherwise ask for terabytes before the first tensor is looked at.
//!
//! Each description lists its matrices beside the networks that it describes.

use std::fmt::Debug;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::ModelError;
use crate::parameters::HostTensors;

/// Rows and columns of the largest picture.
const MOST_SIDE: usize = 1 << 14;

/// A matrix by its name in the file, and its shape.
pub(crate) type Matrix = (String, Vec<usize>);

/// A description of networks, as it is written into the file of their weights.
pub(crate) trait Described: Serialize + DeserializeOwned {
    /// The matrices that decide how much memory the networks take. One after the other: the description may say that there are more than anyone can list.
    fn matrices(&self) -> Box<dyn Iterator<Item = Matrix> + '_>;

    /// What is wrong with the numbers that no tensor depends on, where something is.
    fn check_constants(&self) -> Result<(), String> {
        Ok(())
    }
}

/// That a constant is what it must be, with what it is.
pub(crate) fn must(holds: bool, name: &str, found: impl Debug, must: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(format!("its {name} is {found:?}, which must {must}")) }
}

/// That constants are finite numbers above 0.
pub(crate) fn positive(constants: &[(&str, f32)]) -> Result<(), String> {
    let mut all = constants.iter();
    all.try_for_each(|(name, value)| must(value.is_finite() && *value > 0.0, name, value, "be a finite number above 0"))
}

/// That every action has two finite bounds, the lower one first; an axis without extent has the same twice.
pub(crate) fn bounds(min: &[f32], max: &[f32]) -> Result<(), String> {
    must(
        min.len() == max.len(),
        "action_max",
        max,
        &format!("have a bound for each of the {} of action_min", min.len()),
    )?;
    let ordered = |(low, high): (&f32, &f32)| low.is_finite() && high.is_finite() && low <= high;
    must(
        min.iter().zip(max).all(ordered),
        "action_min",
        min,
        &format!("be finite and not above action_max, {max:?}, which must be finite too"),
    )
}

/// That what is seen lies within a picture that memory holds.
pub(crate) fn view(view: [usize; 2], picture: [usize; 2]) -> Result<(), String> {
    must(picture.iter().all(|side| *side <= MOST_SIDE), "picture", picture, &format!("have sides up to {MOST_SIDE}"))?;
    let within = view.iter().zip(&picture).all(|(seen, side)| seen <= side);
    must(within, "view", view, &format!("lie within the picture of {picture:?}"))
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;
    use crate::cross_entropy::CrossEntropy;
    use crate::golden::small_model;
    use crate::guard::GuardConfig;
    use crate::recurrent::RecurrentConfig;
    use crate::sac::SacConfig;

    /// What is said of a description that is sound but for this entry.
    fn refusal<C: Described>(sound: &C, place: &str, wrong: serde_json::Value) -> String {
        sound.check_constants().unwrap();
        let mut described = serde_json::to_value(sound).unwrap();
        *described.pointer_mut(place).unwrap() = wrong;
        let described: C = serde_json::from_value(described).unwrap();
        described.check_constants().expect_err(place)
    }

    fn stacks() -> SacConfig {
        let sizes = serde_json::json!({
            "task": "made-up", "picture": [20, 22], "view": [16, 22], "stack": 3, "action_min": [-1.0, 0.0], "action_max": [1.0, 2.0],
            "feature": 8, "hidden": 8, "squash": true, "search": CrossEntropy::default(), "random_share": 0.2,
        });
        serde_json::from_value(sizes).unwrap()
    }

    #[test]
    fn constants_that_cannot_be_are_refused_by_name() {
        for (place, wrong) in [
            ("/action_max", "[]"),
            ("/action_min", "[3.0, 0.0]"),
            ("/view", "[21, 22]"),
            ("/picture", "[18446744073709551615, 22]"),
            ("/random_share", "1.5"),
            ("/log_std_min", "2.0"),
            ("/search/samples", "0"),
            ("/search/elites", "0"),
            ("/search/elites", "33"),
            ("/search/iterations", "18446744073709551615"),
        ] {
            let found =
                refusal(&SacConfig { log_std_min: -9.0, ..stacks() }, place, serde_json::from_str(wrong).unwrap());
            assert!(found.contains(place.rsplit('/').next().unwrap()), "{place}: {found}");
        }
        for (place, wrong) in [
            ("/latent_std", "-1.0"),
            ("/prediction_floor", "-5.0"),
            ("/reward_floor", "-0.1"),
            ("/reward_scale", "0.0"),
            ("/action_max", "[]"),
        ] {
            let found = refusal(&small_model(2), place, serde_json::from_str(wrong).unwrap());
            assert!(found.contains(&place[1..]), "{place}: {found}");
            let recurrent = RecurrentConfig { model: small_model(2), picture: [64, 64], hidden: 8 };
            refusal(&recurrent, &format!("/model{place}"), serde_json::from_str(wrong).unwrap());
        }
        let guard = GuardConfig { members: 2, shares: 0 };
        assert!(refusal(&guard, "/members", 1.into()).contains("members"));
    }
}
