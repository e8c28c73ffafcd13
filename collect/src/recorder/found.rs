//! What a recording that is gone on with says in other words than its command would say by now, because an earlier version wrote it, because a file of actions is gone, or because a run is reached
//! by another name.
//!
//! In: the manifest that is there, and the one that is asked for. Out: the latter in the words of the former where both mean the same, so that the same command still opens what it made.

use std::path::Path;

use serde_json::Value;
use vibes_data::Manifest;
use vibes_env::PolicyMix;

use crate::Result;
use crate::plan::RecordOptions;
use crate::played::{PlayedFile, check_same};
use crate::trained::ActedBy;

/// Puts what the recording at `path` says into the place of what is asked for by `options`, where both mean the same.
///
/// # Errors
/// [`crate::Error::Malformed`] names a file of actions that has others by now.
pub(super) fn in_its_words(path: &Path, asked: &mut Manifest, options: &RecordOptions) -> Result<()> {
    let Ok(found) = Manifest::read(&path.join("manifest.json")) else { return Ok(()) };
    if keep_shares(&found.options, &mut asked.options) {
        keep_names(&found.options, &mut asked.options);
        return keep_files(&found.options, &mut asked.options, (options, path));
    }
    Ok(())
}

/// Keeps shares that were rounded another number of times; says whether the policies are the same.
fn keep_shares(found: &Value, asked: &mut Value) -> bool {
    let text = |options: &Value| options.get("policy").and_then(Value::as_str).map(str::to_owned);
    let (Some(found), Some(own)) = (text(found), text(asked)) else { return false };
    let mix = |text: &str| PolicyMix::written(text).ok();
    let is_same = found == own || mix(&found).zip(mix(&own)).is_some_and(|(found, own)| found.is_same(&own));
    if is_same {
        asked["policy"] = found.into();
    }
    is_same
}

/// Keeps the names of runs that are the same actors.
fn keep_names(found: &Value, asked: &mut Value) {
    let read = |options: &Value| serde_json::from_value::<Vec<ActedBy>>(options.get("acting")?.clone()).ok();
    let (Some(known), Some(own)) = (read(found), read(asked)) else { return };
    if known.len() == own.len() && known.iter().zip(&own).all(|(known, own)| known.is_same(own)) {
        asked["acting"] = found["acting"].clone();
    }
}

/// Keeps what is known of files of actions: nothing of an older recording, and of a file that is gone what it was.
fn keep_files(found: &Value, asked: &mut Value, (options, path): (&RecordOptions, &Path)) -> Result<()> {
    let known = found.get("actions").cloned();
    let files: Vec<PlayedFile> = known.clone().and_then(|known| serde_json::from_value(known).ok()).unwrap_or_default();
    if let Ok(mix) = options.mix() {
        check_same(&mix, &options.actions, &files, path)?;
    }
    let Some(asked) = asked.as_object_mut() else { return Ok(()) };
    match known {
        Some(known) => asked.insert("actions".to_owned(), known),
        None => asked.remove("actions"),
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_mix_of_the_same_shares_stays_as_it_is_written_and_another_does_not() {
        let typed: PolicyMix = "random:6,planner:3,random:hold=2:1".parse().unwrap();
        let before = typed.to_string().parse::<PolicyMix>().unwrap().to_string();
        let mut asked = json!({ "policy": typed.to_string() });
        assert!(keep_shares(&json!({ "policy": before }), &mut asked));
        assert_eq!(asked["policy"], before);
        assert!(!keep_shares(&json!({ "policy": "random:0.6,planner:0.4" }), &mut asked));
        assert_eq!(asked["policy"], before);
        let mut online = json!({ "policy": "random" });
        assert!(keep_shares(&json!({ "policy": "random" }), &mut online), "what is no mix is compared as it stands");
        assert!(!keep_shares(&json!({ "policy": "python" }), &mut online));
    }

    #[test]
    fn a_run_by_another_name_keeps_the_one_it_was_recorded_under_and_another_checkpoint_does_not() {
        let by = |run: &str, checkpoint: &str| json!({ "acting": [{ "run": run, "checkpoint": checkpoint, "pictures": null }] });
        let mut asked = by("link", "000020, ab");
        keep_names(&by("run", "000020, ab"), &mut asked);
        assert_eq!(asked, by("run", "000020, ab"));
        keep_names(&by("run", "000040, cd"), &mut asked);
        assert_eq!(asked, by("run", "000020, ab"));
    }
}
