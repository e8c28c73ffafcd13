//! Places named inside files: a recording in a run, a checkpoint in a table of latents. They are written relative to the folder of the file that
//! names them, so that folders can be moved together, to another disk or another machine, and still find each other.

use std::path::{Component, Path, PathBuf};

/// `target` as it is written into a file of `folder`: relative to it, as in `../../recordings/reacher`.
pub fn relative_place(target: &Path, folder: &Path) -> String {
    let (target, folder) = (whole(target), whole(folder));
    let shared = target.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let place: PathBuf = up.chain(target.components().skip(shared)).collect();
    if place.as_os_str().is_empty() { ".".into() } else { place.to_string_lossy().into_owned() }
}

/// The same with symbolic links followed before `..` is counted, as the system follows the result: for what is opened by joining it to the folder.
pub fn followed_place(target: &Path, folder: &Path) -> String {
    relative_place(&followed(target), &followed(folder))
}

/// The absolute path without symbolic links, as far as it exists.
pub fn followed(path: &Path) -> PathBuf {
    let path = whole(path);
    for there in path.ancestors() {
        if let (Ok(found), Ok(rest)) = (there.canonicalize(), path.strip_prefix(there)) {
            // What does not exist has no links.
            return if rest.as_os_str().is_empty() { found } else { found.join(rest) };
        }
    }
    path
}

/// What a file of `folder` names by `place`: relative to that folder, as typed, or below any folder above it; `is_it` says whether the thing
/// is there.
pub fn find_place(place: &str, folder: &Path, is_it: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    let place = Path::new(place);
    let folder = whole(folder);
    let above = folder.ancestors().map(|above| whole(&above.join(place)));
    // As typed last: a file that was moved must not meet another thing of the same name in the present folder.
    above.chain(std::iter::once(place.to_path_buf())).find(|path| is_it(path))
}

/// Whether two paths lead to one file or folder, which may be named in two ways.
pub fn is_same_place(one: &Path, other: &Path) -> bool {
    one == other || one.canonicalize().ok().zip(other.canonicalize().ok()).is_some_and(|(one, other)| one == other)
}

/// The absolute path without `.` and `..`. Links are not followed: they may be what makes a folder movable.
pub fn whole(path: &Path) -> PathBuf {
    // The folder of a file in the present folder is named by nothing, which has no absolute path.
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let mut plain = PathBuf::new();
    for part in std::path::absolute(path).unwrap_or_else(|_unknown| path.to_owned()).components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_relative_to_the_file_that_names_it() {
        let place = |target, folder| relative_place(Path::new(target), Path::new(folder));
        assert_eq!(place("/a/recordings/x", "/a/runs/y"), "../../recordings/x");
        assert_eq!(place("/a/runs/y/checkpoints/000001", "/a/runs/y"), "checkpoints/000001");
        assert_eq!(place("recordings/./x", "runs/../runs/y"), "../../recordings/x");
        assert_eq!(place("/a", "/a"), ".");
        assert_eq!(place("runs/y", ""), "runs/y", "the folder of a file in the present folder");
    }

    #[test]
    fn one_folder_is_known_by_every_name_and_two_are_kept_apart() {
        let home = tempfile::tempdir().unwrap();
        let (here, there) = (home.path().join("here"), home.path().join("there"));
        std::fs::create_dir(&here).unwrap();
        std::fs::create_dir(&there).unwrap();
        assert!(is_same_place(&here, &there.join("../here")) && !is_same_place(&here, &there));
        let nowhere = home.path().join("nowhere");
        assert!(is_same_place(&nowhere, &nowhere) && !is_same_place(&nowhere, &home.path().join("gone")));
    }

    #[test]
    fn folders_that_are_moved_together_find_each_other() {
        let home = tempfile::tempdir().unwrap();
        let before = home.path().join("before");
        let (recording, run) = (before.join("recordings/x"), before.join("runs/y"));
        std::fs::create_dir_all(&recording).unwrap();
        std::fs::create_dir_all(&run).unwrap();
        let place = relative_place(&recording, &run);
        assert_eq!(find_place(&place, &run, Path::is_dir).unwrap(), recording);
        let after = home.path().join("after");
        std::fs::rename(&before, &after).unwrap();
        assert_eq!(find_place(&place, &after.join("runs/y"), Path::is_dir).unwrap(), after.join("recordings/x"));
        assert_eq!(find_place("recordings/x", &after.join("runs/y"), Path::is_dir), Some(after.join("recordings/x")));
        assert_eq!(find_place("recordings/z", &after.join("runs/y"), Path::is_dir), None);
    }
}
