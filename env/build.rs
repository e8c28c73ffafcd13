//! Embeds the Control Suite's models into the package and puts the MuJoCo library where the built programs look for it.
//!
//! In: `third_party/made-by-make-setup/` (`libmujoco.so.VERSION`, `suite/*.xml`, `suite/common/*.xml`, and `wheels.txt`, which says the
//! versions), filled by `make setup`.
//! Out: `OUT_DIR/models.rs`, the list of all the suite's models that `physics/models.rs` includes (a task names the one it wants), and `<target>/<profile>/lib/` with the library,
//! found from binaries by the relative rpath `$ORIGIN/lib` and from tests by `$ORIGIN/../lib`. mujoco-rs itself is linked against the script
//! `mujoco/libmujoco.so` beside this file, which names that library; so it builds before set-up, and what is missing is said here.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if let Err(missing) = prepare() {
        println!("cargo::error={missing}");
    }
}

/// Copies everything into place; the error is the one sentence the user sees.
fn prepare() -> Result<(), String> {
    let third_party = third_party()?;
    let out = PathBuf::from(env::var("OUT_DIR").map_err(|error| error.to_string())?);
    embed_models(&third_party.join("suite"), &out)?;
    let wheels = third_party.join("wheels.txt");
    println!("cargo::rerun-if-changed={}", wheels.display());
    let pinned = fs::read_to_string(&wheels).map_err(|error| missing(&wheels, &error))?;
    println!("cargo::rustc-env=VIBES_SUITE_VERSION={}", version_of("dm-control", &pinned)?);
    // Named as its own SONAME says, since that is the name the loader looks for.
    let library = format!("libmujoco.so.{}", version_of("mujoco", &pinned)?);
    let lib = profile_folder(&out)?.join("lib");
    place(&third_party.join(&library), &lib.join(&library))?;
    // Where the linker script in env/mujoco finds it; inside the target folder, so `cargo run` and `cargo test` also put it on the loader's
    // path (doc tests need that).
    println!("cargo::rustc-link-search=native={}", lib.display());
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/lib:$ORIGIN/../lib");
    Ok(())
}

/// The version to which set-up pinned a wheel: the one place that says it.
fn version_of(wheel: &str, pinned: &str) -> Result<String, String> {
    let lines = pinned.lines().filter_map(|line| line.strip_prefix(wheel)?.strip_prefix("=="));
    let version = lines.map(|rest| rest.trim_end_matches('\\').trim()).next();
    version.map(ToOwned::to_owned).ok_or_else(|| format!("setup/wheels.txt pins no version of {wheel}"))
}

/// Copies every model of the suite and writes the list of them: `&[("reacher.xml", include_str!("…")), …]`, sorted.
fn embed_models(suite: &Path, out: &Path) -> Result<(), String> {
    let mut names = Vec::new();
    for folder in ["", "common/"] {
        let listed = suite.join(folder);
        println!("cargo::rerun-if-changed={}", listed.display());
        let entries = fs::read_dir(&listed).map_err(|error| missing(&listed, &error))?;
        let files = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        names.extend(files.filter(|name| name.ends_with(".xml")).map(|name| format!("{folder}{name}")));
    }
    names.sort();
    let mut list = String::from("&[\n");
    for name in &names {
        let copy = out.join("models").join(name);
        place(&suite.join(name), &copy)?;
        list += &format!("    ({name:?}, include_str!({:?})),\n", copy.display().to_string());
    }
    list += "]\n";
    fs::write(out.join("models.rs"), list).map_err(|error| format!("cannot write ({error}): {}", out.display()))
}

/// What the user reads where set-up has not been run.
fn missing(path: &Path, error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => {
            format!(
                "a piece of MuJoCo or the Control Suite is missing; run `make setup` to fetch it: {}",
                path.display()
            )
        }
        _ => format!("cannot read ({error}): {}", path.display()),
    }
}

/// The folder `make setup` fills.
fn third_party() -> Result<PathBuf, String> {
    let package = env::var("CARGO_MANIFEST_DIR").map_err(|error| error.to_string())?;
    Ok(Path::new(&package).join("../third_party/made-by-make-setup"))
}

/// `<target>/<profile>`, three folders above `<target>/<profile>/build/<package>/out`.
fn profile_folder(out: &Path) -> Result<PathBuf, String> {
    let folder = out.ancestors().nth(3).ok_or("the build's output folder is not inside a target folder")?;
    Ok(folder.to_owned())
}

/// Copies a file by way of a temporary name, so that a build running beside this one never sees half of it.
fn place(from: &Path, to: &Path) -> Result<(), String> {
    println!("cargo::rerun-if-changed={}", from.display());
    let bytes = fs::read(from).map_err(|error| missing(from, &error))?;
    if fs::read(to).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    let refused = |error: io::Error| format!("cannot write ({error}): {}", to.display());
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(refused)?;
    }
    let partial = to.with_extension(format!("partial-{}", std::process::id()));
    fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, to)).map_err(refused)
}
