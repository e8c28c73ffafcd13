//! How a run that is there differs from the plan's. In: the mark of each. Out: every option that differs, with both of its values.

use std::collections::{BTreeMap, BTreeSet};

use super::Mark;

impl Mark {
    /// What differs from the plan's mark, as `key: value there, value in the plan`.
    pub(super) fn differences(&self, plan: &Self) -> Vec<String> {
        let (found, asked) = (self.options(), plan.options());
        let keys: BTreeSet<&String> = found.keys().chain(asked.keys()).collect();
        let shown = |value: Option<&String>| value.map_or("nothing", String::as_str).to_owned();
        keys.into_iter()
            .filter(|key| found.get(*key) != asked.get(*key))
            .map(|key| format!("{key} is {}, in the plan {}", shown(found.get(key)), shown(asked.get(key))))
            .collect()
    }

    /// Settings and the options of every stage, by name; one that is given again, by its name and which time it is, so that none hides another.
    fn options(&self) -> BTreeMap<String, String> {
        let mut all = self.settings.clone();
        for (number, words) in self.stages.iter().enumerate() {
            let stage = number + 1;
            let mut last = None::<String>;
            for (place, word) in words.iter().enumerate() {
                let (key, value) = match (word.strip_prefix('-'), last.take()) {
                    (None, Some(option)) => (option, word.clone()),
                    (None, None) => (format!("stage {stage} word {place}"), word.clone()),
                    (Some(_), _) => match word.split_once('=') {
                        Some((option, value)) => (unused(&all, format!("stage {stage} {option}")), value.to_owned()),
                        None => {
                            let option = unused(&all, format!("stage {stage} {word}"));
                            (last.insert(option).clone(), "given".to_owned())
                        }
                    },
                };
                all.insert(key, value);
            }
        }
        all
    }
}

/// The key, or the key with the number of times that it is there already, this one included.
fn unused(all: &BTreeMap<String, String>, key: String) -> String {
    if !all.contains_key(&key) {
        return key;
    }
    let mut time = 2;
    while all.contains_key(&format!("{key} #{time}")) {
        time += 1;
    }
    format!("{key} #{time}")
}
