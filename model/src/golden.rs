//! For tests: the cases of `tests/golden/behaviour.json` as tensors, and a small model.

use burn::tensor::{Device, Tensor, TensorData};
use serde_json::{Value as Json, json};

use crate::config::ModelConfig;

/// One case.
pub(crate) struct Case(Json);

impl Case {
    pub(crate) fn named(name: &str) -> Self {
        let file: Json = serde_json::from_str(include_str!("../tests/golden/behaviour.json")).expect("golden file");
        Self(file["cases"][name].clone())
    }

    /// An input as a tensor whose gradient is kept.
    pub(crate) fn input<const D: usize>(&self, name: &str) -> Tensor<D> {
        leaf(&self.0["in"][name])
    }

    pub(crate) fn scalar(&self, name: &str) -> f64 {
        self.0["in"][name].as_f64().expect("a number")
    }

    pub(crate) fn rows(&self, name: &str) -> Vec<Vec<f32>> {
        self.0["in"][name].as_array().expect("rows").iter().map(numbers).collect()
    }

    pub(crate) fn out(&self, name: &str) -> Vec<f32> {
        numbers(&self.0["out"][name])
    }

    pub(crate) fn gradient(&self, name: &str) -> Vec<f32> {
        numbers(&self.0["grad"][name])
    }
}

fn leaf<const D: usize>(json: &Json) -> Tensor<D> {
    let mut shape = Vec::new();
    let mut inside = json;
    while let Json::Array(items) = inside {
        shape.push(items.len());
        inside = &items[0];
    }
    Tensor::from_data(TensorData::new(numbers(json), shape), &Device::flex().autodiff()).require_grad()
}

fn numbers(json: &Json) -> Vec<f32> {
    match json {
        Json::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().expect("a number") as f32],
    }
}

pub(crate) fn assert_close(found: &[f32], wanted: &[f32], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        let error = (found - wanted).abs() / wanted.abs().max(1.0);
        assert!(error <= 1e-4, "{what}[{index}]: {found} against {wanted}");
    }
}

/// A model of vectors with hidden states of 12, latents of 5 and this many actions; whatever else there is has its default.
pub(crate) fn small_model(actions: usize) -> ModelConfig {
    let sizes = json!({
        "task": "made-up", "observation": { "kind": "vector", "len": 3 },
        "action_min": vec![-1.0; actions], "action_max": vec![1.0; actions],
        "depth": 4, "hidden": 12, "head": 9, "latent": 5,
        "latent_std": 0.1, "prediction_floor": 0.1, "reward_floor": 0.1, "adversary": false, "decoder": false,
    });
    serde_json::from_value(sizes).expect("a configuration")
}
