//! No circles between the modules of a package: of two modules side by side, whatever lies below them, one may use the other and not both. Of a module and one
//! that lies in it both may use the other (types and helpers of the outer one are shared by all in it), but a function of the outer one that calls the inner one is
//! not called from there.
//!
//! A simple reading of the sources: paths that begin with `crate::` or `super::`, re-exports followed, test code left out.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "circles/source.rs"]
mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use source::{code_of, functions};

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

    /// The paths that a module names, from its crate's root.
    fn paths(&self, module: &Module) -> Vec<Vec<String>> {
        let text = &self.modules[module];
        let mut paths = Vec::new();
        for start in ["crate::", "super::"] {
            for (at, _) in text.match_indices(start) {
                // `super::super::x` is read once, from its beginning; `$crate` is a macro's.
                if !text[..at].ends_with("::") && !text[..at].ends_with('$') {
                    tree(&text[at..], &[], &mut paths);
                }
            }
        }
        paths.iter().filter_map(|path| Self::absolute(module, path)).collect()
    }

    /// Which module uses which.
    fn edges(&self) -> BTreeSet<(Module, Module)> {
        let of = |module: &Module| {
            let used = self.paths(module).into_iter();
            used.map(|path| (module.clone(), self.module_of(&path, 0))).collect::<Vec<_>>()
        };
        self.modules.keys().flat_map(of).collect()
    }

    /// The modules in a module that each of its functions calls, over its other functions too.
    fn inner_of_functions(&self, module: &Module) -> BTreeMap<String, BTreeSet<String>> {
        let functions = functions(&self.modules[module]);
        let mut found = BTreeMap::new();
        for name in functions.keys() {
            let (mut open, mut seen) = (vec![name.as_str()], BTreeSet::from([name.as_str()]));
            let mut inner = BTreeSet::new();
            while let Some(text) = open.pop().and_then(|name| functions.get(name)) {
                for (word, is_path) in words(text).filter(|(word, _)| !seen.contains(word)).collect::<Vec<_>>() {
                    if functions.contains_key(word) {
                        seen.insert(word);
                        open.push(word);
                    } else {
                        inner.extend(self.inner_of(module, word, is_path));
                    }
                }
            }
            found.insert(name.clone(), inner);
        }
        found
    }

    /// The module within a module that a word of it is, if a path begins with it, or that the word is imported from.
    fn inner_of(&self, module: &Module, word: &str, is_path: bool) -> Option<String> {
        let itself = [module.as_slice(), &[word.to_owned()]].concat();
        let path = self.aliases.get(&(module.clone(), word.to_owned())).or(Some(&itself).filter(|_| is_path))?;
        let inner = path.strip_prefix(module.as_slice())?.first()?;
        self.modules.contains_key(&[module.as_slice(), std::slice::from_ref(inner)].concat()).then(|| inner.clone())
    }

    /// Circles of a module and one that lies in it, as `a::run → a/b → a::run`.
    fn circles_inward(&self) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        for outer in self.modules.keys() {
            let inner_of = self.inner_of_functions(outer);
            let lies_in = |path: &[String]| path.len() > outer.len() && path.starts_with(outer);
            for module in self.modules.keys().filter(|module| lies_in(module)) {
                let calls_back = |path: &Vec<String>| {
                    let inner = inner_of.get(&path[outer.len()]);
                    inner.is_some_and(|inner| inner.contains(&module[outer.len()]))
                };
                for path in self.paths(module).iter().filter(|path| lies_in(path)).filter(|path| calls_back(path)) {
                    let function = path[..=outer.len()].join("::");
                    found.insert(format!("{function} → {} → {function}", module.join("/")));
                }
            }
        }
        found
    }

    /// Circles among modules that lie side by side, as `a → b → a`.
    fn circles(&self) -> BTreeSet<String> {
        let mut beside: BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
        for (from, to) in self.edges() {
            let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            // One above the other is no circle here: a module speaks for what lies in it. See `circles_inward`.
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

/// The words of a text, and whether a path goes on behind each.
fn words(text: &str) -> impl Iterator<Item = (&str, bool)> {
    let starts = text.match_indices(|c: char| c.is_alphanumeric() || c == '_').map(|(at, _)| at);
    let starts = starts.filter(|&at| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'));
    starts.map(|at| {
        let word = text[at..].split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
        (word, text[at + word.len()..].starts_with("::"))
    })
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
        let circles = package.circles().into_iter().chain(package.circles_inward());
        found.extend(circles.map(|circle| format!("{member}: {circle}")));
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

#[test]
fn a_planted_circle_of_a_module_and_one_within_it_is_found_and_a_shared_helper_is_none() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("src/a")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join("src").join(name), text).unwrap();
    write("lib.rs", "mod a;\n");
    write("a.rs", "mod b;\nuse b::Thing;\nstruct All(Thing);\nfn run(all: All) { b::run() }\nfn help() {}\n");
    write("a/b.rs", "use super::help;\npub struct Thing;\npub fn run() { help() }\n");
    assert_eq!(Package::open(folder.path()).circles_inward(), BTreeSet::new());
    write("a/b.rs", "pub struct Thing;\npub fn run() { super::run(crate::a::All(Thing)) }\n");
    let circles: Vec<String> = Package::open(folder.path()).circles_inward().into_iter().collect();
    assert_eq!(circles, ["a::run → a/b → a::run"]);
}
