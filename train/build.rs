//! Tells this package's programs where the MuJoCo library lies beside them: cargo does not hand a linker argument on from `vibes-env`, whose
//! build script puts the library there.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/lib:$ORIGIN/../lib");
}
