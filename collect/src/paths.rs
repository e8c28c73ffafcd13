//! Paths in a manifest: none is absolute, each is relative to the recording's own folder, so that a recording can be moved together with what it names.
//!
//! In: a recording's options as JSON, which name a folder of videos and the files of policies. Out: the same options for another folder. Symbolic links
//! are followed before `..` is counted, since that is how the system follows the result.

use std::path::{Path, PathBuf};

use serde_json::Value;
use vibes_data::{followed, followed_place, whole};
use vibes_env::{PolicyMix, PolicySpec};

/// The options of a recording in the folder `to`, made from those that are relative to `from`; without a `from`, from those that were typed.
pub(crate) fn rebase(options: &mut Value, from: Option<&Path>, to: Option<&Path>) {
    let moved = |path: &Path| -> PathBuf {
        let found = from.map_or_else(|| path.to_owned(), |from| found(from, path));
        to.map_or_else(|| found.clone(), |to| relative(to, &found))
    };
    if let Some(folder) = options.pointer_mut("/videos/folder")
        && let Some(path) = folder.as_str().map(PathBuf::from)
    {
        *folder = moved(&path).to_string_lossy().into();
    }
    if let Some(policy) = options.get_mut("policy")
        && let Some(mix) = policy.as_str().and_then(|text| text.parse::<PolicyMix>().ok())
    {
        let elsewhere = mix.with_paths(&moved);
        // Shares that are written once more may round once more.
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
        let mut procedural = serde_json::json!({ "videos": "procedural", "policy": "random:1" });
        let before = procedural.clone();
        rebase(&mut procedural, None, Some(&recording));
        assert_eq!(procedural, before);
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
