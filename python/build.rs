//! Puts the MuJoCo library and its licences where the wheel takes them from, and tells the extension to look for the library there.
//!
//! In: `third_party/made-by-make-setup/`, filled by `make setup`. Out: `OUT_DIR` with the library and the licences, which pyproject.toml includes in the
//! wheel as `vibes/mujoco/`. A wheel is moved about whole, so the extension's path to it is relative.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// The library, named as its own SONAME says, and the licences of what the extension holds.
const FILES: [&str; 7] = [
    "libmujoco.so.3.17.0",
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
    for file in FILES {
        let from = third_party.join(file);
        println!("cargo::rerun-if-changed={}", from.display());
        let name = Path::new(file).file_name().unwrap_or_default();
        fs::copy(&from, out.join(name)).map_err(|error| {
            format!("a piece of MuJoCo is missing ({error}); run `make setup` to fetch it: {}", from.display())
        })?;
    }
    Ok(())
}
