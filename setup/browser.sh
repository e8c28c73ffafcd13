#!/usr/bin/env bash
# Makes sure that there is a Chromium, in which the tests open the report: Debian's package when there is none. In: CHROMIUM, a program to take instead, if set.
# Without root, or where no package fits, it says what to install and stops.
set -euo pipefail

# Whether a program runs and is no snap, which may not read hidden folders and sees a /tmp of its own. Ubuntu's package `chromium-browser` is a script that runs the snap.
# analyze/tests/cli/browser.rs asks the same.
fits() {
    local path
    path=$(command -v "$1") && "$1" --version >/dev/null 2>&1 || return 1
    case $(readlink -f "$path") in */snap | /snap/*) return 1 ;; esac
    ! grep -qsIF /snap/bin "$path"
}

if [ -n "${CHROMIUM:-}" ]; then
    "$CHROMIUM" --version >/dev/null 2>&1 || { echo "setup: CHROMIUM does not run: $CHROMIUM" >&2; exit 1; }
    exit 0
fi
# In the order of analyze/tests/cli/browser.rs, which takes the first that fits.
for name in google-chrome chromium chromium-browser; do
    if fits "$name"; then exit 0; fi
done

missing() {
    echo "setup: a Chromium that is no snap is missing, in which the tests open the report; install one (on Ubuntu: Google Chrome's .deb package)," \
        "or name one: CHROMIUM=PROGRAM" >&2
    exit 1
}

if ! command -v apt-get >/dev/null || grep -qi ubuntu /etc/os-release; then missing; fi
if [ "$(id -u)" = 0 ]; then sudo=""; elif sudo -n true 2>/dev/null; then sudo="sudo"; else
    echo "setup: Chromium is missing and this is not root; run: sudo apt-get update && sudo apt-get install -y chromium" >&2
    exit 1
fi
echo "setup: installing chromium"
# shellcheck source=setup/apt.sh
. "$(dirname "$0")/apt.sh"
apt_update
# Read whole: a pipe that is closed at the first match would count as a failure (pipefail).
policy=$(apt-cache policy chromium 2>/dev/null || true)
case "$policy" in *"Candidate: "[0-9]*) ;; *) missing ;; esac
apt_install chromium
