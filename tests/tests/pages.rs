//! Laws over the pages for readers: links lead somewhere, and a command that a page shows names a verb that there is, and options that this verb has.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use vibes_tests::program;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every page of the project: Markdown in the root, in its folders and in theirs.
fn pages() -> Vec<(PathBuf, String)> {
    fn below(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir()
                && depth > 0
                && !name.starts_with('.')
                && !["third_party", "target", "runs"].contains(&&*name)
            {
                below(&path, depth - 1, found);
            } else if name.ends_with(".md") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    below(&root(), 3, &mut found);
    found.sort();
    found.into_iter().map(|path| (path.clone(), std::fs::read_to_string(&path).unwrap())).collect()
}

/// A heading as links name it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    kept.chars().filter(|c| c.is_alphanumeric() || "-_ ".contains(*c)).map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn has_heading(page: &str, name: &str) -> bool {
    page.lines().any(|line| line.starts_with('#') && anchor(line.trim_start_matches('#')) == name)
}

/// The targets of a page's links, but for those to the network.
fn links(page: &str) -> Vec<&str> {
    let targets = page.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(target, _)| target));
    targets.filter(|target| !target.starts_with("http")).collect()
}

#[test]
fn every_link_of_a_page_leads_to_a_file_and_a_heading() {
    let mut followed = 0;
    for (path, text) in pages() {
        for link in links(&text) {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link} is not there", path.display());
            if !heading.is_empty() {
                let page = std::fs::read_to_string(&target).unwrap();
                assert!(has_heading(&page, heading), "{}: {link} names no heading", path.display());
            }
            followed += 1;
        }
    }
    assert!(followed > 50, "only {followed} links were found: the test reads the wrong files");
}

/// The commands of a program in a page: what stands behind its name, to the end of the line or of the code. Lines that end in a backslash go on.
fn commands<'t>(page: &'t str, name: &str) -> Vec<&'t str> {
    let ends = |rest: &'t str| rest.split(['\n', '`', '#', '|', ';']).next().unwrap_or_default();
    // Behind `-p` stands a package, and behind that are options of cargo.
    let places = page.match_indices(name).filter(|(place, _)| !page[..*place].ends_with("-p "));
    places.map(|(place, _)| ends(&page[place + name.len()..])).collect()
}

/// The names behind `--` in a command or in help.
fn options(text: &str) -> Vec<String> {
    let names = text.split("--").skip(1).filter(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase()));
    names.map(|rest| rest.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect()).collect()
}

#[test]
fn every_command_of_a_page_names_a_verb_that_there_is_and_options_that_it_has() {
    let mut known: BTreeMap<String, Option<Vec<String>>> = BTreeMap::new();
    let mut help = |name: &str, verb: &str| {
        let found = || {
            let mut command = Command::new(program(name));
            command.args(Some(verb).filter(|verb| !verb.is_empty())).arg("--help");
            let output = command.output().unwrap();
            output.status.success().then(|| options(&String::from_utf8_lossy(&output.stdout)))
        };
        known.entry(format!("{name} {verb}")).or_insert_with(found).clone()
    };
    let mut checked = 0;
    for (path, text) in pages() {
        let text = text.replace("\\\n", " ");
        for name in ["vibes-collect", "vibes-train", "vibes-analyze"] {
            for command in commands(&text, name) {
                let first = command.split_whitespace().next().unwrap_or_default();
                let is_verb = first.chars().all(|c| c.is_ascii_lowercase());
                let there = help(name, if is_verb { first } else { "" });
                // Words that are no verb end a sentence about the program, and no sentence has an option in it.
                let Some(there) = there else {
                    assert!(
                        options(command).is_empty(),
                        "{}: {name}{command}: there is no verb {first}",
                        path.display()
                    );
                    continue;
                };
                for option in options(command) {
                    assert!(there.contains(&option), "{}: {name}{command}: there is no --{option}", path.display());
                    checked += 1;
                }
            }
        }
    }
    assert!(checked > 100, "only {checked} options were found: the test reads the wrong files");
}
