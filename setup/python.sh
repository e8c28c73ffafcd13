#!/usr/bin/env bash
# Makes the Python environment in which the notebooks, the examples and the readers of other people's formats are tested, outside the clone.
# In: setup/python.txt (every package with its version). Out: the environment; with --where, its folder is printed and nothing is made. Built once; needs Python 3.11
# or newer.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() { echo "setup: $1" >&2; exit 1; }
command -v python3 >/dev/null || fail "python3 is missing; run: sudo apt-get install -y python3 python3-pip python3-venv"
# Clones with other lists, or made under another Python, have environments of their own and leave this one alone. Comments do not count.
kind=$({ python3 -c 'import sys; print(sys.version_info[:2])'; grep -v '^#' setup/python.txt; } | sha256sum | cut -c1-12)
home=${XDG_CACHE_HOME:-$HOME/.cache}/vibes-toolkit/python-$kind
if [ "${1:-}" = --where ]; then echo "$home"; exit 0; fi

python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "$(python3 --version) is too old for setup/python.txt; 3.11 or newer is needed"
# Wheels only: nothing is compiled.
setup/environment.sh --anew setup/python.txt "$home" --only-binary=:all:
