#!/usr/bin/env bash
# Installs the packages of a requirements file in a Python environment: setup/environment.sh [--anew] REQUIREMENTS FOLDER [OPTION OF PIP …]
# In: the file. Out: the environment, made if it is not there. The file's copy in it comes last and says that all of it is installed, so that an installation
# that was cut short goes on, and a file that has changed since is installed again; so is one whose Python has gone from the system. Comments do not count. With
# --anew the old environment is removed first, so that no package of an older list is left; without, nothing is but links
# to a Python that is gone, because the folder may be the user's own.
set -euo pipefail

anew=
if [ "${1:-}" = --anew ]; then anew=1; shift; fi
requirements=$1 folder=$2
shift 2
# A folder that is made anew is ours; in another the user may have a list of this name.
stamp=$folder/$([ -n "$anew" ] || echo .vibes-)$(basename "$requirements")
packages() { grep -v '^#' "$1" || true; }
runs() { "$folder/bin/python" -c '' 2>/dev/null; }

# Two that want the same environment come after each other; without util-linux's flock, or where nothing can be written beside the folder, nobody waits.
mkdir -p "$(dirname "$folder")"
lock=$(dirname "$folder")/.$(basename "$folder").lock
if command -v flock >/dev/null && { : >>"$lock"; } 2>/dev/null; then
    exec 9>>"$lock"
    flock 9
fi
if [ -f "$stamp" ] && cmp -s <(packages "$requirements") <(packages "$stamp") && runs; then exit 0; fi

fail() { echo "setup: $1" >&2; exit 1; }
command -v python3 >/dev/null || fail "python3 is missing; run: sudo apt-get install -y python3 python3-pip python3-venv"
echo "setup: installing the packages of $requirements in $folder"
if [ -n "$anew" ]; then rm -rf "$folder"; fi
# What follows may be cut short, and then the folder is that of no list.
rm -f "$stamp"
# venv leaves links as they are, also those that lead to a Python that is gone.
for link in "$folder"/bin/python*; do
    if [ -L "$link" ] && [ ! -e "$link" ]; then rm -f "$link"; fi
done
if ! python3 -m venv "$folder"; then
    found=$(python3 -c 'import importlib.util; print(importlib.util.find_spec("ensurepip") is not None)' 2>/dev/null || true)
    if [ "$found" = False ]; then fail "python3 has no ensurepip, which fills an environment; run: sudo apt-get install -y python3-venv"; fi
    fail "python3 could not make the environment, for the reason above: $folder"
fi
# A user who has pip install for the user alone means the system's Python, not this one.
PIP_USER=0 "$folder/bin/python" -m pip install --quiet --disable-pip-version-check "$@" --requirement "$requirements" ||
    fail "pip could not install the packages of $requirements"
cp "$requirements" "$stamp"
