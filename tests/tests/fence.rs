//! The fence: a package names exactly the dependencies that the table in ARCHITECTURE.md gives it, those of its tests included, and uses what
//! it names.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

type Names = BTreeSet<String>;

/// A row of the table: what a package may name, and what its tests may name beside.
#[derive(Debug, Default, PartialEq)]
struct Allowance {
    package: String,
    library: Names,
    tests: Names,
}

/// Named by a package that uses nothing of it, and why that is right.
const UNUSED_ON_PURPOSE: &[(&str, &str)] = &[
    ("tests", "regex-syntax"), // so that builds with and without tests select the same features, and build it once
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The words in backticks.
fn quoted(text: &str) -> Names {
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The table of packages, by folder, and what every package may use.
fn architecture() -> (BTreeMap<String, Allowance>, Names) {
    let text = read("ARCHITECTURE.md");
    let everyone = text.lines().find(|line| line.starts_with("Every package may also use")).unwrap();
    let rows = text.lines().filter_map(|line| {
        let cells: Vec<&str> = line.strip_prefix('|')?.split('|').collect();
        let [folder, package, _, library, tests, ""] = cells[..] else { return None };
        let folder = quoted(folder).pop_first()?.trim_end_matches('/').to_owned();
        let package = quoted(package).pop_first().unwrap_or_default();
        Some((folder, Allowance { package, library: quoted(library), tests: quoted(tests) }))
    });
    (rows.collect(), quoted(everyone))
}

/// What a package's manifest names: as a library or program, and for its tests alone.
fn manifest(folder: &str) -> (String, Names, Names) {
    let manifest: toml::Table = read(&format!("{folder}/Cargo.toml")).parse().unwrap();
    let names = |key: &str| -> Names {
        manifest.get(key).and_then(toml::Value::as_table).into_iter().flat_map(toml::Table::keys).cloned().collect()
    };
    let package = manifest["package"]["name"].as_str().unwrap().to_owned();
    let library: Names = &names("dependencies") | &names("build-dependencies");
    (package, library, names("dev-dependencies"))
}

/// What the table and the manifests disagree about.
fn disagreements(folder: &str, may: &Allowance, everyone: &Names) -> Vec<String> {
    let (package, library, tests) = manifest(folder);
    let mut found = Vec::new();
    let mut compare =
        |what: &str, named: &Names, allowed: &Names, free: &Names| {
            let table = "the table in ARCHITECTURE.md";
            found.extend(
                named
                    .iter()
                    .filter(|name| !allowed.contains(*name) && !free.contains(*name))
                    .map(|name| format!("{folder}/Cargo.toml names {name}{what}, which {table} does not allow")),
            );
            found.extend(allowed.difference(named).map(|name| {
                format!("{table} allows {folder} to use {name}{what}, which its Cargo.toml does not name")
            }));
        };
    compare("", &library, &may.library, everyone);
    compare(" in tests", &tests, &may.tests, everyone);
    if package != may.package {
        found.push(format!("{folder} holds {package}; the table in ARCHITECTURE.md says {}", may.package));
    }
    found
}

#[test]
fn packages_name_exactly_what_the_table_allows() {
    let (table, everyone) = architecture();
    let mut found: Vec<String> = table.iter().flat_map(|(folder, may)| disagreements(folder, may, &everyone)).collect();
    let named: Names = table.keys().flat_map(|folder| manifest(folder).1).collect();
    found.extend(everyone.difference(&named).map(|name| format!("every package may use {name}, and none does")));
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn every_member_is_behind_the_fence() {
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    let members: Names = members.iter().filter_map(toml::Value::as_str).map(str::to_owned).collect();
    assert_eq!(members, architecture().0.into_keys().collect());
}

/// All sources below a folder of a package.
fn sources(path: &Path, all: &mut String) {
    for entry in std::fs::read_dir(path).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, all);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            *all += &std::fs::read_to_string(&path).unwrap();
        }
    }
}

#[test]
fn packages_use_what_they_name() {
    let (table, _) = architecture();
    let mut found = Vec::new();
    for folder in table.keys() {
        let (_, library, tests) = manifest(folder);
        let (mut text, mut test_text) = (String::new(), String::new());
        sources(&root().join(folder).join("src"), &mut text);
        text += &std::fs::read_to_string(root().join(folder).join("build.rs")).unwrap_or_default();
        sources(&root().join(folder).join("tests"), &mut test_text);
        // What its tests/fuzz.rs includes.
        test_text += &std::fs::read_to_string(root().join(format!("fuzz/readers/{folder}.rs"))).unwrap_or_default();
        let uses = |text: &str, name: &str| {
            let name = name.replace('-', "_");
            [format!("{name}::"), format!("use {name};"), format!("use {name} as")]
                .iter()
                .any(|form| text.contains(form))
        };
        let purpose = |name: &&String| !UNUSED_ON_PURPOSE.contains(&(folder.as_str(), name.as_str()));
        let unused = library.iter().filter(|name| !uses(&text, name)).filter(purpose);
        found.extend(unused.map(|name| format!("{folder} names {name} and does not use it")));
        let unused = tests.iter().filter(|name| !uses(&test_text, name) && !uses(&text, name)).filter(purpose);
        found.extend(unused.map(|name| format!("{folder} names {name} for its tests, which do not use it")));
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}
