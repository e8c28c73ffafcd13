#!/usr/bin/env bash
# Fetches the MuJoCo library and the Control Suite's models into third_party/, which git ignores.
# In: setup/wheels.txt (two wheels, pinned by hash). Out: third_party/made-by-make-setup/, which appears whole or not at all. Done once; needs Python with pip.
# In it lie the list and the script that it was made by, and SHA256SUMS of every file: while all are as they were there is nothing to do.
set -euo pipefail
cd "$(dirname "$0")/.."

out=third_party/made-by-make-setup
version=$(sed -n 's/^mujoco==\([0-9.]*\).*/\1/p' setup/wheels.txt)

finished() {
    cmp -s setup/wheels.txt "$out/wheels.txt" && cmp -s setup/fetch.sh "$out/fetch.sh" && [ -e "$out/libmujoco.so" ] &&
        (cd "$out" && sha256sum --check --status SHA256SUMS 2>/dev/null)
}

# Whether a folder holds every kind of file that the build takes from it.
whole() {
    local pattern
    for pattern in wheels.txt libmujoco.so "libmujoco.so.$version" "suite/*.xml" "suite/common/*.xml" \
        licenses/dm_control-LICENSE licenses/mujoco-LICENSE licenses/mujoco-LICENSES_THIRD_PARTY.md; do
        compgen -G "$1/$pattern" >/dev/null || return 1
    done
}

# The sums come last, so that a folder with them was finished.
stamp() {
    cp setup/fetch.sh "$1/fetch.sh"
    (cd "$1" && find . -type f ! -name '*SHA256SUMS' -print0 | sort -z | xargs -0 sha256sum >.SHA256SUMS && mv .SHA256SUMS SHA256SUMS)
}

if finished; then exit 0; fi

# Of two makes in one clone the second waits, and finds the work done. Without util-linux's flock nobody waits; the last one's folder stays.
mkdir -p third_party
if command -v flock >/dev/null; then
    exec 9>third_party/.lock
    flock 9
    if finished; then exit 0; fi
    # What a make left that was killed.
    rm -rf third_party/.making.*
fi
# Folders that were made before there was a SHA256SUMS had their list copied last, and hold the same.
if [ ! -e "$out/SHA256SUMS" ] && cmp -s setup/wheels.txt "$out/wheels.txt" && whole "$out"; then
    stamp "$out"
    exit 0
fi

fail() { echo "setup: $1" >&2; exit 1; }
command -v python3 >/dev/null || fail "python3 is missing; install Python 3 with pip (Debian: apt-get install python3-pip)"
python3 -m pip --version >/dev/null 2>&1 || fail "pip is missing; install it (Debian: apt-get install python3-pip)"
machine=$(uname -m)
case "$machine" in x86_64 | aarch64) ;; *) fail "no MuJoCo wheel for $machine; x86_64 and aarch64 are known" ;; esac

making=third_party/.making.$$
wheels=$(mktemp -d)
# Whoever is stopped between the last two lines leaves the old folder in its place.
trap 'if [ ! -e "$out" ] && [ -e "$making.old" ]; then mv -T "$making.old" "$out"; fi; rm -rf "$wheels" "$making" "$making.old"' EXIT
echo "setup: fetching MuJoCo $version and the Control Suite's models"
# --require-hashes: what arrives is what was pinned, or nothing.
python3 -m pip download --quiet --disable-pip-version-check --no-deps --require-hashes --only-binary=:all: \
    --python-version 3.11 --implementation cp --abi cp311 --platform "manylinux_2_28_$machine" \
    --dest "$wheels" --requirement setup/wheels.txt || fail "pip could not fetch the wheels of setup/wheels.txt"

mkdir "$making"
python3 - "$wheels" "$making" <<'PY'
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
ln -sfn "libmujoco.so.$version" "$making/libmujoco.so"
cp setup/wheels.txt "$making/wheels.txt"
whole "$making" || fail "the wheels of setup/wheels.txt lack a file that the build needs; MuJoCo's library, the suite's models and the licences should be in them"
stamp "$making"
if [ -e "$out" ]; then mv -T "$out" "$making.old"; fi
mv -T "$making" "$out"
