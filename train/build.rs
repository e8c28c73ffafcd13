//! Lets this package's programs and tests find the MuJoCo library, which `vibes-collect`'s build puts into `<target>/<profile>/lib/`.
//! Link arguments of a build script reach its own package only, so every package that links `vibes-collect` has these lines.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/lib:$ORIGIN/../lib");
}
