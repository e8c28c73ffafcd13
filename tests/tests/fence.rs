//! The fence: a package may name only the dependencies that ARCHITECTURE.md gives it.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use std::collections::BTreeSet;
use std::path::Path;

/// What every package may use: errors, text formats, numbers, threads.
const EVERYONE: &[&str] = &[
    "anyhow",
    "arrow",
    "bytemuck",
    "half",
    "rand",
    "rand_chacha",
    "rayon",
    "serde",
    "serde_json",
    "sha2",
    "thiserror",
    "toml",
];
/// What a program needs to be one.
const PROGRAM: &[&str] = &["clap", "ctrlc", "indicatif"];

/// Folder, and what it alone or with few others may name.
const PACKAGES: &[(&str, &[&[&str]])] = &[
    ("data", &[&["bytes", "foxglove", "mcap", "memmap2", "prost", "prost-types"]]),
    (
        "collect",
        &[
            PROGRAM,
            &["vibes-data", "mujoco-rs", "khronos-egl", "image", "libc", "rustix"],
            // The formats of others.
            &["parquet", "hdf5-pure", "less-avc", "zip"],
        ],
    ),
    ("train/model", &[&["vibes-data", "burn", "burn-flex", "gemm", "memmap2", "safetensors"]]),
    ("train", &[PROGRAM, &["vibes-data", "vibes-model", "burn", "crc32c", "memmap2", "prost"]]),
    (
        "analyze",
        &[
            PROGRAM,
            &[
                "vibes-data",
                "rerun",
                "ab_glyph",
                "tiny-skia",
                "linfa",
                "linfa-linalg",
                "linfa-reduction",
                "ndarray",
                "kiddo",
                "image",
                "parquet",
                "base64",
            ],
        ],
    ),
    ("python", &[&["vibes-data", "vibes-env", "vibes-measure", "vibes-model", "numpy", "pyo3", "pythonize"]]),
    ("tests", &[&["regex-syntax"]]),
];

fn dependencies(folder: &str) -> BTreeSet<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder).join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let names = |table: &toml::Value| table.as_table().unwrap().keys().cloned().collect::<Vec<_>>();
    ["dependencies", "build-dependencies"].iter().filter_map(|key| manifest.get(*key)).flat_map(names).collect()
}

#[test]
fn every_package_names_only_what_it_may() {
    for (folder, allowed) in PACKAGES {
        let allowed: BTreeSet<&str> = allowed.iter().copied().chain([EVERYONE]).flatten().copied().collect();
        for name in dependencies(folder) {
            assert!(
                allowed.contains(name.as_str()),
                "{folder}/Cargo.toml names {name}, which ARCHITECTURE.md does not give it"
            );
        }
    }
}

#[test]
fn every_member_is_behind_the_fence() {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    let members: BTreeSet<&str> = members.iter().filter_map(toml::Value::as_str).collect();
    assert_eq!(members, PACKAGES.iter().map(|(folder, _)| *folder).collect());
}
