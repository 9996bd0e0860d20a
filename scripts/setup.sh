#!/usr/bin/env bash
# Installs what building and testing raycl needs and this machine lacks:
# a C linker, the OpenCL loader and its link library, and PoCL, which runs OpenCL on any CPU.
# Asks apt for nothing that is there already; says nothing when there is nothing to do.
set -euo pipefail

# Whether a C program links, here and with the given flags.
links() {
    local folder status=0
    folder=$(mktemp -d)
    echo 'int main(void) { return 0; }' >"$folder/probe.c"
    cc "$folder/probe.c" -o "$folder/probe" "$@" >/dev/null 2>&1 || status=$?
    rm -r "$folder"
    return "$status"
}

has_loader() { PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep 'libOpenCL\.so\.1' >/dev/null; }

has_pocl() { grep -il pocl /etc/OpenCL/vendors/*.icd >/dev/null 2>&1; }

# The packages that are missing, one a line.
missing() {
    if links; then :; else printf '%s\n' gcc libc6-dev; fi
    has_loader || echo ocl-icd-libopencl1
    links -lOpenCL || echo ocl-icd-opencl-dev
    has_pocl || echo pocl-opencl-icd
}

require_cargo() {
    command -v cargo >/dev/null && return
    echo "raycl is built with Rust, and cargo is not on the PATH. Get it from https://rustup.rs" >&2
    [ ! -x "${CARGO_HOME:-$HOME/.cargo}/bin/cargo" ] ||
        echo "(it is installed: run  . \"${CARGO_HOME:-$HOME/.cargo}/env\"  first)" >&2
    exit 1
}

# Runs a command quietly; shows what it said if it fails.
quietly() {
    local log status=0
    log=$(mktemp)
    "$@" >"$log" 2>&1 || status=$?
    [ "$status" = 0 ] || cat "$log" >&2
    rm "$log"
    return "$status"
}

install() {
    local as_root=()
    if ! command -v apt-get >/dev/null; then
        echo "These are missing, by their Debian names: $*. There is no apt-get here: install them by hand." >&2
        exit 1
    fi
    if [ "$(id -u)" != 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "These packages are missing: $*. Install them as root (there is no sudo here):" >&2
            echo "  apt-get install $*" >&2
            exit 1
        fi
        as_root=(sudo)
    fi
    echo "Installing $*"
    # Stale package lists may still do, so a failed update is not the end.
    quietly "${as_root[@]}" apt-get -q update || true
    quietly "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qy install --no-install-recommends "$@"
}

require_cargo
mapfile -t packages < <(missing)
[ "${#packages[@]}" = 0 ] || install "${packages[@]}"
