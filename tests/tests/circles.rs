//! No circles between the modules of a package: of two modules side by side, whatever lies below them, one may use the other and not both.
//!
//! A simple reading of the sources: paths that begin with `crate::` or `super::`, re-exports followed, test code left out.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module's path from its crate's root.
type Module = Vec<String>;

#[derive(Default)]
struct Package {
    /// Every module's source, without its tests.
    modules: BTreeMap<Module, String>,
    /// Names that a module passes on from elsewhere in the crate.
    aliases: BTreeMap<(Module, String), Module>,
}

fn read(folder: &Path, module: &mut Module, package: &mut Package) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let is_root = module.is_empty() && ["lib", "main"].contains(&name.as_str());
        if name == "tests" || (is_root && name == "main") {
            continue;
        }
        if !is_root {
            module.push(name);
        }
        if path.is_dir() {
            read(&path, module, package);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            package.modules.insert(module.clone(), code_of(&text));
        }
        if !is_root {
            module.pop();
        }
    }
}

/// The text without comments, strings' worth of prose, and what comes after the first `#[cfg(test)]`.
fn code_of(text: &str) -> String {
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Every path of a use tree that begins at `text`, as in `a::{b, c::d}`.
fn tree(text: &str, before: &[String], all: &mut Vec<Vec<String>>) -> usize {
    let mut path = before.to_vec();
    let bytes = text.as_bytes();
    let mut at = 0;
    loop {
        let word: String = text[at..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        at += word.len();
        if !word.is_empty() {
            path.push(word);
        } else if bytes.get(at) == Some(&b'{') {
            at += 1;
            while at < text.len() && bytes[at] != b'}' {
                if bytes[at].is_ascii_whitespace() || bytes[at] == b',' {
                    at += 1;
                    continue;
                }
                let used = tree(&text[at..], &path, all);
                // `as name`, `*`: nothing more of a path.
                at += used.max(1);
            }
            return at + 1;
        }
        if text[at..].starts_with("::") {
            at += 2;
        } else {
            all.push(path);
            return at;
        }
    }
}

impl Package {
    fn open(folder: &Path) -> Self {
        let mut package = Self::default();
        read(&folder.join("src"), &mut Vec::new(), &mut package);
        let modules: Vec<Module> = package.modules.keys().cloned().collect();
        for module in &modules {
            for path in package.uses_of(module) {
                if let Some(name) = path.last()
                    && path.len() > module.len() + 1
                {
                    package.aliases.entry((module.clone(), name.clone())).or_insert(path.clone());
                }
            }
        }
        package
    }

    /// The absolute paths of a module's `use` lines, those relative to its own modules included.
    fn uses_of(&self, module: &Module) -> Vec<Vec<String>> {
        let mut all = Vec::new();
        for (at, _) in self.modules[module].match_indices("use ") {
            tree(&self.modules[module][at + 4..], &[], &mut all);
        }
        let absolute = all.into_iter().filter(|path| !path.is_empty()).filter_map(|path| {
            let child = [module.as_slice(), &path[..1]].concat();
            if path[0] == "crate" || path[0] == "super" || path[0] == "self" {
                Self::absolute(module, &path)
            } else {
                self.modules.contains_key(&child).then(|| [module.as_slice(), &path].concat())
            }
        });
        absolute.collect()
    }

    fn absolute(module: &Module, path: &[String]) -> Option<Vec<String>> {
        let ups = path.iter().take_while(|word| *word == "super").count();
        match path[0].as_str() {
            "crate" => Some(path[1..].to_vec()),
            "self" => Some([module.as_slice(), &path[1..]].concat()),
            "super" => Some([module.get(..module.len().checked_sub(ups)?)?, &path[ups..]].concat()),
            _ => None,
        }
    }

    /// The module in which a path ends, re-exports followed.
    fn module_of(&self, path: &[String], depth: usize) -> Module {
        let mut module = Vec::new();
        for (place, word) in path.iter().enumerate() {
            let next = [module.as_slice(), std::slice::from_ref(word)].concat();
            if self.modules.contains_key(&next) {
                module = next;
                continue;
            }
            if let Some(elsewhere) = self.aliases.get(&(module.clone(), word.clone()))
                && depth < 8
            {
                return self.module_of(&[elsewhere.as_slice(), &path[place + 1..]].concat(), depth + 1);
            }
            break;
        }
        module
    }

    /// Which module uses which.
    fn edges(&self) -> BTreeSet<(Module, Module)> {
        let mut edges = BTreeSet::new();
        for (module, text) in &self.modules {
            for start in ["crate::", "super::"] {
                for (at, _) in text.match_indices(start) {
                    // `super::super::x` is read once, from its beginning; `$crate` is a macro's.
                    if text[..at].ends_with("::") || text[..at].ends_with('$') {
                        continue;
                    }
                    let mut paths = Vec::new();
                    tree(&text[at..], &[], &mut paths);
                    for path in paths.iter().filter_map(|path| Self::absolute(module, path)) {
                        edges.insert((module.clone(), self.module_of(&path, 0)));
                    }
                }
            }
        }
        edges
    }

    /// Circles among modules that lie side by side, as `a → b → a`.
    fn circles(&self) -> BTreeSet<String> {
        let mut beside: BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
        for (from, to) in self.edges() {
            let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            // One above the other is no circle: a module speaks for what lies in it.
            if let (Some(a), Some(b)) = (from.get(shared), to.get(shared)) {
                beside.entry(from[..shared].to_vec()).or_default().entry(a.clone()).or_default().insert(b.clone());
            }
        }
        let mut found = BTreeSet::new();
        for (parent, uses) in &beside {
            for start in uses.keys() {
                if let Some(path) = way_back(uses, start) {
                    let least = path.iter().min().unwrap();
                    let turn = path.iter().position(|name| name == least).unwrap();
                    let names: Vec<&str> =
                        path.iter().cycle().skip(turn).take(path.len() + 1).map(String::as_str).collect();
                    let within = if parent.is_empty() { String::new() } else { format!("{}: ", parent.join("/")) };
                    found.insert(format!("{within}{}", names.join(" → ")));
                }
            }
        }
        found
    }
}

/// The shortest way from a module over what it uses back to itself.
fn way_back(uses: &BTreeMap<String, BTreeSet<String>>, start: &String) -> Option<Vec<String>> {
    let mut ways = vec![vec![start.clone()]];
    let mut seen = BTreeSet::new();
    while !ways.is_empty() {
        let mut longer = Vec::new();
        for way in ways {
            for next in uses.get(way.last()?).into_iter().flatten() {
                if next == start {
                    return Some(way);
                }
                if seen.insert(next.clone()) {
                    longer.push([way.as_slice(), std::slice::from_ref(next)].concat());
                }
            }
        }
        ways = longer;
    }
    None
}

#[test]
fn no_package_has_a_circle_of_modules() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let manifest: toml::Table = std::fs::read_to_string(root.join("Cargo.toml")).unwrap().parse().unwrap();
    let mut found = Vec::new();
    for member in manifest["workspace"]["members"].as_array().unwrap() {
        let member = member.as_str().unwrap();
        let package = Package::open(&root.join(member));
        found.extend(package.circles().into_iter().map(|circle| format!("{member}: {circle}")));
    }
    assert!(found.is_empty(), "circles:\n{}", found.join("\n"));
}

#[test]
fn a_planted_circle_is_found_through_a_re_export_and_below_a_module() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join("src").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("lib.rs", "mod a; mod b; mod c;\npub use b::{Thing, other};\n");
    write("a.rs", "use crate::{Thing as T, c};\n");
    write("b.rs", "pub struct Thing;\n#[cfg(test)]\nmod tests { use crate::a; }\n");
    write("c.rs", "mod d;\nmod e;\n// crate::a is only spoken of\n");
    write("c/d.rs", "use super::e::X;\n");
    write("c/e.rs", "pub struct X;\n");
    assert_eq!(Package::open(folder.path()).circles(), BTreeSet::new());
    write("b.rs", "pub struct Thing;\nfn f() { crate::a::f() }\n");
    write("c/e.rs", "fn f() -> super::d::Y {}\n");
    let circles: Vec<String> = Package::open(folder.path()).circles().into_iter().collect();
    assert_eq!(circles, ["a → b → a", "c: d → e → d"]);
}
