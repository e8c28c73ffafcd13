#!/usr/bin/env bash
# Fetches the MuJoCo library and the Control Suite's models into third_party/, which git ignores.
# In: setup/wheels.txt (two wheels, pinned by hash). Out: third_party/made-by-make-setup/. Done once; needs Python with pip.
set -euo pipefail
cd "$(dirname "$0")/.."

out=third_party/made-by-make-setup
stamp="$out/wheels.txt"
if cmp -s setup/wheels.txt "$stamp"; then exit 0; fi

fail() { echo "setup: $1" >&2; exit 1; }
command -v python3 >/dev/null || fail "python3 is missing; install Python 3 with pip (Debian: apt-get install python3-pip)"
python3 -m pip --version >/dev/null 2>&1 || fail "pip is missing; install it (Debian: apt-get install python3-pip)"
machine=$(uname -m)
case "$machine" in x86_64 | aarch64) ;; *) fail "no MuJoCo wheel for $machine; x86_64 and aarch64 are known" ;; esac

wheels=$(mktemp -d)
trap 'rm -rf "$wheels"' EXIT
version=$(sed -n 's/^mujoco==\([0-9.]*\).*/\1/p' setup/wheels.txt)
echo "setup: fetching MuJoCo $version and the Control Suite's models"
# --require-hashes: what arrives is what was pinned, or nothing.
python3 -m pip download --quiet --disable-pip-version-check --no-deps --require-hashes --only-binary=:all: \
    --python-version 3.11 --implementation cp --abi cp311 --platform "manylinux_2_28_$machine" \
    --dest "$wheels" --requirement setup/wheels.txt || fail "pip could not fetch the wheels of setup/wheels.txt"

rm -rf "$out"
python3 - "$wheels" "$out" <<'PY'
import pathlib, re, sys, zipfile

wheels, out = map(pathlib.Path, sys.argv[1:])
wanted = [
    (r"mujoco/(libmujoco\.so\.[\d.]+)", r"\1"),
    (r"dm_control/suite/((?:common/)?\w+\.xml)", r"suite/\1"),
    (r"(mujoco|dm_control)-[^/]*\.dist-info/licenses/(LICENSE\w*(?:\.md)?)", r"licenses/\1-\2"),
]
for wheel in sorted(wheels.glob("*.whl")):
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            for pattern, place in wanted:
                if match := re.fullmatch(pattern, name):
                    path = out / match.expand(place)
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(archive.read(name))
PY
ln -s "libmujoco.so.$version" "$out/libmujoco.so"
cp setup/wheels.txt "$stamp"
