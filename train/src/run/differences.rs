//! What differs between two models, in words. In: two models. Out: what either has that the other has not.

use std::collections::BTreeSet;

use serde_json::Value;
use vibes_model::ModelConfig;

/// What differs between two models, on either side, as in `latent 32`.
pub(crate) fn differences(one: &ModelConfig, other: &ModelConfig) -> (String, String) {
    let [one, other] = [one, other].map(|model| serde_json::to_value(model).unwrap_or_default());
    let names: BTreeSet<&String> =
        [&one, &other].iter().filter_map(|model| model.as_object()).flat_map(|m| m.keys()).collect();
    let differing: Vec<&String> = names.into_iter().filter(|name| one[name.as_str()] != other[name.as_str()]).collect();
    let text = |model: &Value| {
        let named = |name: &&String| match (name.as_str(), &model[name.as_str()]) {
            ("numbers", Value::Array(numbers)) => learned(numbers),
            (name, Value::String(value)) => format!("{} {value}", name.replace('_', " ")),
            (name, Value::Null) => format!("{} none", name.replace('_', " ")),
            (name, value) => format!("{} {value}", name.replace('_', " ")),
        };
        differing.iter().map(named).collect::<Vec<_>>().join(", ")
    };
    (text(&one), text(&other))
}

/// The learned numbers of a model, by name.
fn learned(numbers: &[Value]) -> String {
    let names: Vec<&str> = numbers.iter().filter_map(|number| number["name"].as_str()).collect();
    if names.is_empty() { "no learned numbers".to_owned() } else { format!("the learned numbers {}", names.join(", ")) }
}
