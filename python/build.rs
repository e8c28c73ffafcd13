//! Puts the MuJoCo library and its licences where the wheel takes them from, and tells the extension to look for the library there.
//!
//! In: `third_party/made-by-make-setup/`, filled by `make setup`, whose `wheels.txt` says the library's version. Out: `OUT_DIR` with the library and the licences, which
//! pyproject.toml includes in the wheel as `vibes/mujoco/`. A wheel is moved about whole, so the extension's path to it is relative.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// The licences of what the extension holds.
const LICENCES: [&str; 6] = [
    "licenses/mujoco-LICENSE",
    "licenses/mujoco-LICENSES_THIRD_PARTY.md",
    "licenses/dm_control-LICENSE",
    "../../LICENSE-APACHE",
    "../../LICENSE-MIT",
    "../../NOTICE",
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-link-arg-cdylib=-Wl,-rpath,$ORIGIN/mujoco:$ORIGIN/lib");
    if let Err(missing) = place() {
        println!("cargo::error={missing}");
    }
}

/// The error is the one sentence the user sees.
fn place() -> Result<(), String> {
    let variable = |name: &str| env::var(name).map(PathBuf::from).map_err(|error| format!("{name}: {error}"));
    let (package, out) = (variable("CARGO_MANIFEST_DIR")?, variable("OUT_DIR")?);
    let third_party = package.join("../third_party/made-by-make-setup");
    let library = library(&third_party.join("wheels.txt"))?;
    for file in LICENCES.into_iter().chain([library.as_str()]) {
        let from = third_party.join(file);
        println!("cargo::rerun-if-changed={}", from.display());
        let name = Path::new(file).file_name().unwrap_or_default();
        fs::copy(&from, out.join(name)).map_err(|error| missing(&from, &error))?;
    }
    Ok(())
}

/// The library's file, named as its own SONAME says, from the version to which set-up pinned its wheel.
fn library(wheels: &Path) -> Result<String, String> {
    println!("cargo::rerun-if-changed={}", wheels.display());
    let pinned = fs::read_to_string(wheels).map_err(|error| missing(wheels, &error))?;
    let lines = pinned.lines().filter_map(|line| line.strip_prefix("mujoco=="));
    let version = lines.map(|rest| rest.trim_end_matches('\\').trim()).next();
    let version = version.ok_or_else(|| "setup/wheels.txt pins no version of mujoco".to_owned())?;
    Ok(format!("libmujoco.so.{version}"))
}

fn missing(file: &Path, error: &std::io::Error) -> String {
    format!("a piece of MuJoCo is missing ({error}); run `make setup` to fetch it: {}", file.display())
}
