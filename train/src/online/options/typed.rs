//! What of a run's options may not change on the way, in the words in which it is typed. In: the options of a run that is there and those asked for now. Out: the first that differs.

use serde_json::{Map, Value};

use super::OnlineOptions;

/// How long to go on and how often to look may change from one call to the next, but under a protocol.
const FREE: [&str; 4] = ["control_steps", "evaluate_every", "evaluation_episodes", "final_episodes"];
/// A folder whose videos have changed is told by itself, older runs do not say theirs, and what a run began with is settled once.
const SETTLED: [&str; 4] = ["held_out_videos", "given_control_steps", "given_from", "held_out_seen"];

impl OnlineOptions {
    /// The first option that may not change and differs: as it is typed, what this has, what was asked for.
    pub(super) fn first_difference(&self, asked: &Self) -> Option<(String, String, String)> {
        let is_published = self.protocol.is_some();
        difference("", &self.fixed(is_published), &asked.fixed(is_published))
    }

    /// What may not change, its values as they are typed.
    pub(in crate::online) fn fixed(&self, is_published: bool) -> Value {
        let all = serde_json::to_value(self).unwrap_or_default();
        // Without pictures there are no distractors either: what was asked for is the former, and stands first.
        let mut fixed = Map::from_iter([("no_pixels".to_owned(), self.world.size.is_none().into())]);
        let is_kept = |key: &str| !SETTLED.contains(&key) && (is_published || !FREE.contains(&key));
        fixed.extend(all.as_object().cloned().unwrap_or_default().into_iter().filter(|(key, _)| is_kept(key)));
        fixed.remove("evaluate_mode");
        fixed.insert("evaluate_samples".to_owned(), (!self.evaluate_mode).into());
        let mut fixed = Value::Object(fixed);
        // What is left out of the file at its default has a value all the same.
        fixed["behaviour"]["guard"] = self.behaviour.guard.into();
        fixed["behaviour"]["guard_members"] = self.behaviour.guard_members.into();
        let distractors = self.world.distractors;
        fixed["world"]["distractors"] = serde_json::json!({
            "distract": distractors.axes.to_string(),
            "difficulty": distractors.difficulty,
            "static": !distractors.dynamic,
        });
        fixed
    }
}

/// An option as it is typed, from its path in a file.
pub(in crate::online) fn flag(path: &str) -> String {
    let path = path.strip_prefix("online.").unwrap_or(path);
    let typed = match path {
        "world.look" => "render",
        "behaviour.actions" | "behaviour.values" => "recipe",
        _ if path.starts_with("world.videos") => "videos",
        _ => path.rsplit('.').next().unwrap_or(path),
    };
    typed.replace('_', "-")
}

/// The first entry in which two JSON values differ, by its path.
pub(in crate::online) fn difference(at: &str, left: &Value, right: &Value) -> Option<(String, String, String)> {
    use Value::Object;
    match (left, right) {
        (Object(left), Object(right)) => {
            let keys = left.keys().chain(right.keys().filter(|key| !left.contains_key(*key)));
            keys.into_iter().find_map(|key| {
                let path = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
                let none = Value::Null;
                difference(&path, left.get(key).unwrap_or(&none), right.get(key).unwrap_or(&none))
            })
        }
        _ if left == right => None,
        _ => Some((at.to_owned(), left.to_string(), right.to_string())),
    }
}
