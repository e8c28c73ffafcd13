#!/usr/bin/env bash
# Points plain `cargo build`, `run` and `test` at the same target folder as make, outside the clone, so that dependencies are
# built once. In: CARGO_TARGET_DIR, if set. Out: .cargo/local.toml, which git ignores and .cargo/config.toml includes.
set -euo pipefail
cd "$(dirname "$0")/.."

command -v cargo >/dev/null || { echo "setup: cargo is missing; install Rust with rustup" >&2; exit 1; }
target=${CARGO_TARGET_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/vibes-toolkit/target}
mkdir -p "$target"
written="[build]
target-dir = \"$target\""
[ -f .cargo/local.toml ] && [ "$(cat .cargo/local.toml)" = "$written" ] || printf '%s\n' "$written" >.cargo/local.toml
