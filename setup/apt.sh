# Read by setup/egl.sh and setup/browser.sh: apt-get that waits while another process, such as the system's own updates, holds its locks.
# In: `sudo`, the word in front of apt-get, empty for root; `APT_WAIT`, seconds between two tries at the lists (20).
export DEBIAN_FRONTEND=noninteractive

# The timeout is for dpkg's lock alone; that of the lists is asked for anew.
apt_update() {
    local try
    for try in 1 2 3 4 5; do
        if $sudo apt-get update -qq; then return; fi
        [ "$try" = 5 ] || sleep "${APT_WAIT:-20}"
    done
    echo "setup: apt-get update failed five times, for the reason above" >&2
    return 1
}

apt_install() { $sudo apt-get install -y -qq --no-install-recommends -o DPkg::Lock::Timeout=600 "$@" >/dev/null; }
