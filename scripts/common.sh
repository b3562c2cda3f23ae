# shellcheck shell=bash
# Shared by the scripts beside it; sourced, never run. Leaves the shell in the repository's root.

cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
# shellcheck disable=SC2034 # used by those who source this
DEPS=$PWD/.deps

say() { printf 'setup: %s\n' "$*"; }
fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# rustup puts cargo here, but only login shells opened later have it on their PATH.
if ! command -v cargo >/dev/null && [ -x "${CARGO_HOME:-${HOME:-}/.cargo}/bin/cargo" ]; then
    PATH=${CARGO_HOME:-$HOME/.cargo}/bin:$PATH
fi
command -v cargo >/dev/null || fail "cargo is missing: install Rust with rustup, then run this again"

# Values of /etc/os-release without letting that file set variables here.
os_release() { (unset "$1"; . /etc/os-release 2>/dev/null; printf '%s' "${!1-}"); }

# Debian, Ubuntu and what calls itself like them.
is_debian_like() {
    command -v dpkg-query >/dev/null && command -v apt-get >/dev/null || return 1
    case " $(os_release ID) $(os_release ID_LIKE) " in
        *" debian "* | *" ubuntu "*) return 0 ;;
        *) return 1 ;;
    esac
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail "not root and no sudo: run as root: $*"
    fi
}

apt_update() {
    say "refreshing apt's package lists"
    as_root apt-get -q -o DPkg::Lock::Timeout=300 update || fail "apt-get update failed: see above"
}

# The system lavapipe's ICD file, whose name differs between distributions.
system_lavapipe() {
    local file
    for file in /usr/share/vulkan/icd.d/lvp_icd*.json /usr/local/share/vulkan/icd.d/lvp_icd*.json \
        /etc/vulkan/icd.d/lvp_icd*.json; do
        if [ -f "$file" ]; then
            printf '%s' "$file"
            return 0
        fi
    done
    return 1
}
