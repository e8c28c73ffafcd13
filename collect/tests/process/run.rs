//! Runs `vibes-collect` in a folder and compares what it leaves there.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test binary uses its part")]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

pub fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vibes-collect"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    command
}

pub fn collect(folder: &Path, arguments: &str) -> Output {
    command(folder, arguments).output().unwrap()
}

pub fn fails(folder: &Path, arguments: &str, code: i32, says: &str) {
    let output = collect(folder, arguments);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments}: {text}");
    assert!(text.contains(says), "{arguments}: {text}");
    assert!(!text.contains("panicked"), "{arguments}: {text}");
}

pub fn works(folder: &Path, arguments: &str) -> String {
    let output = collect(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Every file below a folder, by its path in it.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// The same files with the same bytes.
pub fn assert_same_bytes(one: &Path, other: &Path) {
    let (left, right) = (files(one), files(other));
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&left), names(&right), "{} and {}", one.display(), other.display());
    for (name, bytes) in &left {
        if *bytes != right[name] && name.ends_with(".json") {
            assert_eq!(String::from_utf8_lossy(bytes), String::from_utf8_lossy(&right[name]), "{name}");
        }
        assert!(*bytes == right[name], "{name} of {} differs from that of {}", one.display(), other.display());
    }
}
