#!/usr/bin/env bash
# Makes sure that there is a Chromium, in which the tests open the report: Debian's package when there is none.
# Without root, or where no package fits, it says the command and stops.
set -euo pipefail

for name in chromium chromium-browser google-chrome; do
    # Ubuntu's package of that name is a stub that asks for a snap.
    if command -v "$name" >/dev/null && "$name" --version >/dev/null 2>&1; then exit 0; fi
done

if ! command -v apt-get >/dev/null || ! apt-cache policy chromium 2>/dev/null | grep -q 'Candidate: [0-9].*' || grep -qi ubuntu /etc/os-release; then
    echo "setup: Chromium is missing; install it (on Ubuntu: sudo snap install chromium), it opens the report in the tests" >&2
    exit 1
fi
if [ "$(id -u)" = 0 ]; then sudo=""; elif sudo -n true 2>/dev/null; then sudo="sudo"; else
    echo "setup: Chromium is missing and this is not root; run: sudo apt-get update && sudo apt-get install -y chromium" >&2
    exit 1
fi
echo "setup: installing chromium"
export DEBIAN_FRONTEND=noninteractive
$sudo apt-get update -qq
$sudo apt-get install -y -qq --no-install-recommends chromium >/dev/null
