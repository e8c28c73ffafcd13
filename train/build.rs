//! Tells this package's programs where the MuJoCo library lies beside them: cargo does not hand a linker argument on from `vibes-env`, whose
//! build script puts the library there. And which version of Burn they are built with, which a run writes down.
//!
//! In: `Cargo.lock`. Out: linker arguments, and the variable `VIBES_BURN_VERSION`.

use std::path::Path;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/lib:$ORIGIN/../lib");
    match locked_version("burn") {
        Ok(version) => println!("cargo::rustc-env=VIBES_BURN_VERSION={version}"),
        Err(fault) => println!("cargo::error={fault}"),
    }
}

/// The version to which the lock file pins a package; the error is the one sentence the user sees.
fn locked_version(package: &str) -> Result<String, String> {
    let folder = env::var("CARGO_MANIFEST_DIR").map_err(|error| error.to_string())?;
    let lock = Path::new(&folder).join("../Cargo.lock");
    println!("cargo::rerun-if-changed={}", lock.display());
    let text = fs::read_to_string(&lock).map_err(|error| format!("cannot read ({error}): {}", lock.display()))?;
    let entry = format!("name = \"{package}\"\nversion = \"");
    let version = text.split_once(&entry).and_then(|(_, rest)| Some(rest.split_once('"')?.0.to_owned()));
    version.ok_or_else(|| format!("no version of {package}: {}", lock.display()))
}
