//! Paths in a manifest: none is absolute, each is relative to the recording's own folder, so that a recording can be moved together with what it names.
//!
//! In: a recording's options as JSON, which name a folder of videos and the files of policies. Out: the same options for another folder. Symbolic links
//! are followed before `..` is counted, since that is how the system follows the result.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use serde_json::Value;
use vibes_data::{followed, followed_place, whole};
use vibes_env::{PolicyMix, PolicySpec};

use crate::keys::MERGED;

/// The options of a recording in the folder `to`, made from those that are relative to `from`; without a `from`, from those that were typed.
pub(crate) fn rebase(options: &mut Value, from: Option<&Path>, to: Option<&Path>) {
    let moved = |path: &Path| -> PathBuf {
        let found = from.map_or_else(|| path.to_owned(), |from| found(from, path));
        to.map_or_else(|| found.clone(), |to| relative(to, &found))
    };
    change(options, &moved, &moved);
}

/// Leaves of every path what is the same wherever the recording in `folder` lies: the name of a policy's file or run. Where videos lie says nothing, since the
/// manifest lists them.
pub(crate) fn without_places(options: &mut Value, folder: &Path) {
    let name = |path: &Path| whole(&followed(folder).join(path)).file_name().map(PathBuf::from).unwrap_or_default();
    change(options, &|_: &Path| PathBuf::new(), &name);
}

/// Where all that is that the options of a recording in `folder` name: its videos, and the files and runs of policies.
pub(crate) fn places(options: &Value, folder: &Path) -> Vec<PathBuf> {
    let places = RefCell::new(Vec::new());
    let note = |path: &Path| {
        places.borrow_mut().push(whole(&followed(folder).join(path)));
        path.to_owned()
    };
    change(&mut options.clone(), &note, &note);
    places.into_inner()
}

/// Puts other paths in the place of those that options name, and of those that the parts name which a recording was merged of.
fn change(options: &mut Value, videos: &dyn Fn(&Path) -> PathBuf, policies: &dyn Fn(&Path) -> PathBuf) {
    for part in options.get_mut(MERGED).and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(options) = part.get_mut("options") {
            change(options, videos, policies);
        }
    }
    if let Some(folder) = options.pointer_mut("/videos/folder")
        && let Some(path) = folder.as_str().map(PathBuf::from)
    {
        *folder = videos(&path).to_string_lossy().into();
    }
    if let Some(policy) = options.get_mut("policy")
        && let Some(mix) = policy.as_str().and_then(|text| PolicyMix::written(text).ok())
    {
        let elsewhere = mix.with_paths(policies);
        // What stays is not worded anew.
        if elsewhere != mix {
            *policy = elsewhere.to_string().into();
        }
    }
}

/// A policy's name in the manifest of a recording in `folder`.
pub(crate) fn policy_name(spec: &PolicySpec, folder: &Path) -> String {
    spec.with_path(&|path: &Path| relative(folder, path)).to_string()
}

/// Where a path of a manifest in `folder` is; below the working directory it is said from there.
fn found(folder: &Path, path: &Path) -> PathBuf {
    let there = whole(&followed(folder).join(path));
    let here = std::env::current_dir().and_then(std::fs::canonicalize);
    here.ok().and_then(|here| there.strip_prefix(here).ok().map(Path::to_owned)).unwrap_or(there)
}

/// The way from a folder to a path.
fn relative(folder: &Path, path: &Path) -> PathBuf {
    followed_place(path, folder).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_back_from_wherever_the_recording_is() {
        let here = tempfile::tempdir().unwrap();
        let here = here.path().canonicalize().unwrap();
        let videos = here.join("sets/DAVIS");
        std::fs::create_dir_all(&videos).unwrap();
        std::fs::create_dir_all(here.join("recordings")).unwrap();
        let (recording, other) = (here.join("recordings/a"), here.join("b"));
        assert_eq!(relative(&recording, &videos), Path::new("../../sets/DAVIS"));
        assert_eq!(found(&recording, Path::new("../../sets/DAVIS")), videos);
        let typed = serde_json::json!({ "videos": { "folder": videos }, "policy": "actions:x/y.json:1", "task": "t" });
        let mut options = typed.clone();
        rebase(&mut options, None, Some(&recording));
        assert_eq!(options["videos"]["folder"], "../../sets/DAVIS");
        assert!(options["policy"].as_str().unwrap().starts_with("actions:../"), "{options}");
        rebase(&mut options, Some(&recording), Some(&other));
        assert_eq!(options["videos"]["folder"], "../sets/DAVIS");
        rebase(&mut options, Some(&other), None);
        assert_eq!(options["videos"], typed["videos"]);
        let mut merged = serde_json::json!({ "merged": [{ "options": typed }] });
        rebase(&mut merged, None, Some(&recording));
        assert_eq!(merged["merged"][0]["options"]["videos"]["folder"], "../../sets/DAVIS", "those of its parts too");
        let mut procedural = serde_json::json!({ "videos": "procedural", "policy": "random:1" });
        let before = procedural.clone();
        rebase(&mut procedural, None, Some(&recording));
        assert_eq!(procedural, before);
    }

    #[test]
    fn without_places_recordings_of_two_machines_are_one_and_those_of_two_files_are_not() {
        let named = |videos: &str, policy: &str, folder: &str| {
            let mut options = serde_json::json!({ "videos": { "folder": videos }, "policy": policy, "seed": 3 });
            without_places(&mut options, Path::new(folder));
            options
        };
        let here = named("../films", "random:0.5,../runs/a:0.5", "/home/one/recordings/r");
        assert_eq!(here, named("../../sets/films", "random:0.5,../../a:0.5", "/mnt/x/deep/r"));
        assert_ne!(here, named("../films", "random:0.5,../runs/b:0.5", "/home/one/recordings/r"));
        assert_ne!(named("v", "actions:../a.json:1", "/r"), named("v", "actions:../b.json:1", "/r"));
    }

    /// Through a link the way up leads elsewhere than the names say.
    #[test]
    fn links_are_followed() {
        let here = tempfile::tempdir().unwrap();
        let here = here.path().canonicalize().unwrap();
        for folder in ["far/away/recordings", "videos"] {
            std::fs::create_dir_all(here.join(folder)).unwrap();
        }
        std::os::unix::fs::symlink(here.join("far/away/recordings"), here.join("recordings")).unwrap();
        let recording = here.join("recordings/a");
        let way = relative(&recording, &here.join("videos"));
        std::fs::create_dir(&recording).unwrap();
        assert!(recording.join(&way).is_dir(), "{}", way.display());
        assert_eq!(found(&recording, &way), here.join("videos"));
    }
}
