#!/usr/bin/env bash
# Makes sure that there is a Chromium, in which the tests open the report: Debian's package when there is none.
# Without root, or where no package fits, it says the command and stops.
set -euo pipefail

for name in chromium chromium-browser google-chrome; do
    # Ubuntu's package of that name is a stub that asks for a snap.
    if command -v "$name" >/dev/null && "$name" --version >/dev/null 2>&1; then exit 0; fi
done

missing() {
    echo "setup: Chromium is missing; install it (on Ubuntu: sudo snap install chromium), it opens the report in the tests" >&2
    exit 1
}

if ! command -v apt-get >/dev/null || grep -qi ubuntu /etc/os-release; then missing; fi
if [ "$(id -u)" = 0 ]; then sudo=""; elif sudo -n true 2>/dev/null; then sudo="sudo"; else
    echo "setup: Chromium is missing and this is not root; run: sudo apt-get update && sudo apt-get install -y chromium" >&2
    exit 1
fi
echo "setup: installing chromium"
export DEBIAN_FRONTEND=noninteractive
$sudo apt-get update -qq
# Read whole: a pipe that is closed at the first match would count as a failure (pipefail).
policy=$(apt-cache policy chromium 2>/dev/null || true)
case "$policy" in *"Candidate: "[0-9]*) ;; *) missing ;; esac
$sudo apt-get install -y -qq --no-install-recommends chromium >/dev/null
