//! The scripts of `setup/`, with stand-ins for the programs that would reach the network: two calls at once, what was lost, what another clone has made.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Stands in front of python3: `pip download` makes a wheel of seven small files, counts itself in `downloads`, and takes long enough for another call to begin.
const PYTHON: &str = r#"#!/usr/bin/env bash
set -eu
here=$(dirname "$(dirname "$0")")
if [ "$1 $2 ${3:-}" = "-m pip download" ]; then
    echo once >>"$here/downloads"
    if [ -e "$here/offline" ]; then exit 1; fi
    while [ "$1" != --dest ]; do shift; done
    sleep 0.5
    set -- -c 'import sys, zipfile
with zipfile.ZipFile(sys.argv[1] + "/all.whl", "w") as wheel:
    for name in sys.argv[2:]: wheel.writestr(name, name)' "$2" mujoco/libmujoco.so.VERSION dm_control/suite/reacher.xml dm_control/suite/common/skybox.xml \
        mujoco-1.dist-info/licenses/LICENSE mujoco-1.dist-info/licenses/LICENSES_THIRD_PARTY.md dm_control-1.dist-info/licenses/LICENSE
fi
PATH=${PATH#"$here/bin:"} exec python3 "$@"
"#;

fn setup(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../setup").join(name)
}

/// A clone that holds nothing but what fetching needs, and the stand-in.
struct Clone(tempfile::TempDir);

impl Clone {
    fn new() -> Self {
        let clone = Self(tempfile::tempdir().unwrap());
        for folder in ["setup", "bin"] {
            std::fs::create_dir(clone.path(folder)).unwrap();
        }
        for name in ["setup/fetch.sh", "setup/wheels.txt"] {
            std::fs::copy(setup("..").join(name), clone.path(name)).unwrap();
        }
        let wheels = std::fs::read_to_string(setup("wheels.txt")).unwrap();
        let line = wheels.lines().find_map(|line| line.strip_prefix("mujoco==")).unwrap();
        let python = PYTHON.replace("VERSION", line.trim_end_matches('\\').trim());
        std::fs::write(clone.path("bin/python3"), python).unwrap();
        std::fs::set_permissions(clone.path("bin/python3"), PermissionsExt::from_mode(0o755)).unwrap();
        clone
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn made(&self, name: &str) -> PathBuf {
        self.path("third_party/made-by-make-setup").join(name)
    }

    fn command(&self) -> Command {
        let mut command = Command::new("bash");
        let path = std::env::var("PATH").unwrap();
        command.arg(self.path("setup/fetch.sh")).env("PATH", format!("{}:{path}", self.path("bin").display()));
        command
    }

    fn fetch(&self) -> Output {
        self.command().output().unwrap()
    }

    fn downloads(&self) -> usize {
        std::fs::read_to_string(self.path("downloads")).unwrap_or_default().lines().count()
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn of_two_that_fetch_at_once_one_waits_for_the_other() {
    let clone = Clone::new();
    let calls = [clone.command(), clone.command()].map(|mut command| command.spawn().unwrap());
    for mut call in calls {
        assert!(call.wait().unwrap().success());
    }
    assert_eq!(clone.downloads(), 1);
    assert!(clone.fetch().status.success());
    assert_eq!(clone.downloads(), 1);
    let left = std::fs::read_dir(clone.path("third_party")).unwrap().count();
    assert_eq!(left, 2, "the folder and the lock");
}

#[test]
fn what_was_lost_or_has_changed_is_fetched_again_and_what_is_whole_is_not() {
    let clone = Clone::new();
    assert!(clone.fetch().status.success());
    let mut downloads = 1;
    for lost in ["libmujoco.so", "suite/common", "licenses/mujoco-LICENSE", "SHA256SUMS"] {
        let path = clone.made(lost);
        if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) }.unwrap();
        // Without its sums the folder looks as set-up made it before there were any: it is taken as it is.
        downloads += usize::from(lost != "SHA256SUMS");
        let output = clone.fetch();
        assert!(output.status.success() && path.exists(), "{lost}: {}", said(&output));
        assert_eq!(clone.downloads(), downloads, "{lost}");
    }
    std::fs::write(clone.made("suite/reacher.xml"), "").unwrap();
    assert!(clone.fetch().status.success());
    assert_eq!(std::fs::read_to_string(clone.made("suite/reacher.xml")).unwrap(), "dm_control/suite/reacher.xml");
    // What cannot be fetched leaves what is there.
    let wheels = std::fs::read_to_string(clone.path("setup/wheels.txt")).unwrap();
    std::fs::write(clone.path("setup/wheels.txt"), wheels + "# changed\n").unwrap();
    std::fs::write(clone.path("offline"), "").unwrap();
    let output = clone.fetch();
    assert!(!output.status.success() && said(&output).contains("could not fetch"), "{}", said(&output));
    assert!(clone.made("suite/reacher.xml").exists());
}

/// What `environment.sh` did, with a list that names no package.
fn environment(folder: &Path) -> Output {
    let list = folder.join("list.txt");
    std::fs::write(&list, "# nothing\n").unwrap();
    Command::new("bash").arg(setup("environment.sh")).args([list, folder.join("made")]).output().unwrap()
}

#[test]
fn an_environment_whose_python_is_gone_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let output = environment(folder);
    assert!(output.status.success() && !output.stdout.is_empty(), "{}", said(&output));
    assert!(environment(folder).stdout.is_empty(), "all of it was there");
    // Which of these links leads out of the folder is another from one Python to the next.
    let is_python = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"));
    let programs = std::fs::read_dir(folder.join("made/bin")).unwrap().map(|entry| entry.unwrap().path());
    for python in programs.filter(is_python).collect::<Vec<_>>() {
        std::fs::remove_file(&python).unwrap();
        symlink(folder.join("gone"), &python).unwrap();
    }
    std::fs::write(folder.join("made/mine"), "").unwrap();
    let output = environment(folder);
    assert!(output.status.success() && !output.stdout.is_empty(), "{}", said(&output));
    assert!(Command::new(folder.join("made/bin/python")).args(["-c", ""]).status().unwrap().success());
    assert!(folder.join("made/mine").exists(), "the folder may be the user's own");
}

#[test]
fn clones_with_other_lists_have_other_environments() {
    let wheres = ["a==1\n", "a==2\n", "# in other words\na==1\n"].map(|list| {
        let clone = tempfile::tempdir().unwrap();
        let inside = clone.path().join("setup");
        std::fs::create_dir(&inside).unwrap();
        std::fs::copy(setup("python.sh"), inside.join("python.sh")).unwrap();
        std::fs::write(inside.join("python.txt"), list).unwrap();
        let mut command = Command::new("bash");
        let output =
            command.arg(inside.join("python.sh")).arg("--where").env("XDG_CACHE_HOME", "/cache").output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
        String::from_utf8(output.stdout).unwrap()
    });
    assert!(wheres[0].starts_with("/cache/vibes-toolkit/python-"), "{}", wheres[0]);
    assert_ne!(wheres[0], wheres[1]);
    assert_eq!(wheres[0], wheres[2], "comments do not count");
}
