#!/usr/bin/env bash
# Makes sure that MuJoCo can draw without a screen: EGL, and Mesa's software renderer where there is no GPU.
# Installs Debian's or Ubuntu's packages when EGL is missing; without root it says the exact command and stops.
set -euo pipefail

# On Debian /sbin is not on everybody's path.
libraries=$(PATH="$PATH:/usr/sbin:/sbin" ldconfig -p 2>/dev/null || true)
has() { [[ $libraries == *"$1"* ]]; }
if has libEGL.so.1 && has libGL.so.1 && { has libEGL_mesa.so.0 || has libEGL_nvidia.so.0; }; then exit 0; fi

packages="libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri libopengl0"
command -v apt-get >/dev/null || {
    echo "setup: EGL is missing; install Mesa's EGL and OpenGL (on Debian: $packages)" >&2
    exit 1
}
if [ "$(id -u)" = 0 ]; then sudo=""; elif sudo -n true 2>/dev/null; then sudo="sudo"; else
    echo "setup: EGL is missing and this is not root; run: sudo apt-get update && sudo apt-get install -y $packages" >&2
    exit 1
fi
echo "setup: installing $packages"
# shellcheck source=setup/apt.sh
. "$(dirname "$0")/apt.sh"
apt_update
# shellcheck disable=SC2086 — the list is meant to be split
apt_install $packages
