#!/usr/bin/env bash
# Builds the Python package as a wheel in the build folder's wheels/, under the manylinux tag that is true for it.
# auditwheel decides the tag: it reads from the wheel's libraries which versions of glibc's symbols they ask for, and what else of the system they
# link (docs/python.md). In: the clone after `make setup`. Out: one wheel. Needs Python with pip and venv.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() { echo "setup: $1" >&2; exit 1; }
target=${CARGO_TARGET_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/vibes-toolkit/target}
tools="$target/auditwheel"
setup/environment.sh setup/auditwheel.txt "$tools" --only-binary=:all:

built=$(mktemp -d)
trap 'rm -rf "$built"' EXIT
python3 -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$built" ./python
rm -rf "$target/wheels"
# Nothing is copied into the wheel: MuJoCo lies in it already, and the rest is glibc's and GCC's. Only the tag changes.
PATH="$tools/bin:$PATH" "$tools/bin/auditwheel" repair --plat auto --wheel-dir "$target/wheels" "$built"/vibes-*.whl >"$built/said" 2>&1 ||
    { cat "$built/said" >&2; fail "auditwheel found no tag for the wheel"; }
echo "$target"/wheels/vibes-*.whl
