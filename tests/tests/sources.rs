//! Laws over the project's own files, read as text: what a compiler does not see and a reader relies on.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every file below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

/// The packages' folders, from the workspace's list.
fn packages() -> Vec<PathBuf> {
    let manifest: toml::Table = std::fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    members.iter().map(|member| root().join(member.as_str().unwrap())).collect()
}

/// Errors whose text holds a cause that they also hand on, so that whoever prints the whole chain prints it twice.
fn said_twice(source: &str) -> Vec<&str> {
    let texts = source.split("#[error(").skip(1).map(|rest| rest.split(")]").next().unwrap_or_default());
    texts.filter(|text| text.contains("{source")).collect()
}

#[test]
fn an_error_says_its_cause_or_hands_it_on_and_never_both() {
    let planted = "#[error(\"cannot read: {source}: {path}\")]\nIo {\n";
    assert_eq!(said_twice(planted).len(), 1);
    let mut variants = 0;
    for package in packages() {
        for path in files(&package.join("src")) {
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            variants += text.matches("#[error(").count();
            let found = said_twice(&text);
            assert!(found.is_empty(), "{}: name the field cause instead of source: {found:?}", path.display());
        }
    }
    assert!(variants > 50, "only {variants} errors were found: the test reads the wrong files");
}

/// Whether a path, as `tables/a.npz`, is one of those that a pattern with one `*` names.
fn is_named(pattern: &str, path: &str) -> bool {
    match pattern.split_once('*') {
        Some((before, after)) => {
            path.len() >= before.len() + after.len() && path.starts_with(before) && path.ends_with(after)
        }
        None => pattern == path,
    }
}

/// The rows `| files | generator |` of a folder's page.
fn generators(page: &str) -> Vec<(String, String)> {
    let cell = |text: &str| text.trim().trim_matches('`').to_owned();
    let rows = page.lines().filter(|line| line.starts_with("| `"));
    rows.filter_map(|row| {
        let mut cells = row.trim_matches('|').split('|');
        Some((cell(cells.next()?), cell(cells.next()?)))
    })
    .collect()
}

#[test]
fn every_golden_file_has_its_generator_beside_it() {
    let mut checked = 0;
    for package in packages() {
        let golden = package.join("tests/golden");
        if !golden.is_dir() {
            continue;
        }
        let page = std::fs::read_to_string(golden.join("README.md")).unwrap_or_default();
        let rows = generators(&page);
        let mut used = vec![false; rows.len()];
        for path in files(&golden) {
            let name = path.strip_prefix(&golden).unwrap().to_str().unwrap().replace('\\', "/");
            if name == "README.md" || name.starts_with("make_") || name.contains("__pycache__") {
                continue;
            }
            let place = rows.iter().position(|(pattern, _)| is_named(pattern, &name));
            let place = place.unwrap_or_else(|| panic!("no row for {name} in {}/README.md", golden.display()));
            let generator = golden.join(&rows[place].1);
            assert!(generator.is_file(), "{name} is made by {}, which is not there", generator.display());
            used[place] = true;
            checked += 1;
        }
        let unused: Vec<_> = rows.iter().zip(used).filter(|(_, used)| !used).map(|(row, _)| row).collect();
        assert!(unused.is_empty(), "{}/README.md names files that are not there: {unused:?}", golden.display());
    }
    assert!(checked > 100, "only {checked} golden files were found");
    assert!(is_named("a/*", "a/b/c.png") && is_named("a-*.json", "a-1.json") && !is_named("a-*.json", "b.json"));
}
