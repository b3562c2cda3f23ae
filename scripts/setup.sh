#!/usr/bin/env bash
# Makes a machine ready to build, run and test, and does nothing where all is there already.
# usage: scripts/setup.sh demo|test|bench     test adds what only the whole test run needs, bench the ray tracer Embree
set -euo pipefail
# shellcheck source=scripts/common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

level=${1-}
case $level in
    demo | test | bench) ;;
    *) fail "usage: scripts/setup.sh demo|test|bench" ;;
esac

mkdir -p "$DEPS"
# Two runs at once would download twice and race on the renames.
if command -v flock >/dev/null; then
    exec 9>"$DEPS/lock"
    flock 9
fi
# What a killed run left behind; the folder of its name without the dots is whole or absent.
rm -rf "$DEPS"/{shaderc,vulkan}.??????

packages=(ca-certificates libvulkan1 mesa-vulkan-drivers vulkan-validationlayers libshaderc-dev glslang-dev spirv-tools)

missing_packages() {
    local package
    for package in "$@"; do
        case " $(dpkg-query -W -f '${db:Status-Status} ' "$package" 2>/dev/null)" in
            *" installed "*) ;;
            *) printf '%s\n' "$package" ;;
        esac
    done
}

missing_tools() {
    local tool
    for tool in "$@"; do
        command -v "$tool" >/dev/null || printf '%s\n' "$tool"
    done
}

install_packages() {
    local package policy
    say "installing $*"
    for package in "$@"; do
        policy=$(apt-cache policy "$package" 2>/dev/null)
        case $policy in
            *"Candidate: (none)"* | "")
                apt_update
                break
                ;;
        esac
    done
    local install=(env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300 --no-install-recommends install "$@")
    # Lists that are merely old name versions the mirror has dropped.
    as_root "${install[@]}" || {
        apt_update
        as_root "${install[@]}" || fail "could not install $*: see apt's messages above"
    }
}

setup_debian() {
    local missing=()
    # A compiler from elsewhere is as good as the package.
    if [ -n "$(missing_tools cc c++ ar)" ]; then missing+=(build-essential); fi
    local package
    while read -r package; do missing+=("$package"); done < <(missing_packages "${packages[@]}")
    if [ ${#missing[@]} -gt 0 ]; then install_packages "${missing[@]}"; fi
}

check_other() {
    local wanted=()
    local tools
    tools=$(missing_tools cc c++ ar)
    if [ -n "$tools" ]; then wanted+=("a C and C++ compiler with ar (missing: ${tools//$'\n'/ })"); fi
    case $(PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null) in
        *libvulkan.so.1*) ;;
        *) wanted+=("the Vulkan loader (libvulkan.so.1)") ;;
    esac
    system_lavapipe >/dev/null || wanted+=("Mesa's software Vulkan driver, lavapipe (its file is icd.d/lvp_icd*.json)")
    local layer found=
    for layer in {/usr/share,/usr/local/share,/etc}/vulkan/explicit_layer.d/VkLayer_khronos_validation.json; do
        if [ -f "$layer" ]; then found=yes; fi
    done
    [ -n "$found" ] || wanted+=("the Khronos validation layer (VkLayer_khronos_validation.json)")
    [ -z "$(missing_tools spirv-val)" ] || wanted+=("SPIRV-Tools (spirv-val)")
    if [ ${#wanted[@]} -eq 0 ]; then return; fi
    {
        printf 'error: this system is neither Debian nor Ubuntu; install by hand, then run this again:\n'
        printf '  - %s\n' "${wanted[@]}"
    } >&2
    exit 1
}

setup_shaderc() {
    if scripts/shaderc.sh; then return; fi
    # The crate's own source build takes over.
    local tools
    tools=$(missing_tools cmake git python3 ninja)
    if [ -z "$tools" ]; then return; fi
    if is_debian_like; then
        # shellcheck disable=SC2086 # one word each
        install_packages ${tools/ninja/ninja-build}
    else
        # ninja only makes it faster.
        tools=${tools%ninja}
        [ -z "$tools" ] || fail "building shaderc from source needs ${tools//$'\n'/ }: install by hand, then run this again"
    fi
}

# Wanted, not needed: benchmarks fall back on the slower tracer of the references.
setup_embree() {
    if [ -f /usr/include/embree3/rtcore.h ] || [ -f /usr/local/include/embree3/rtcore.h ]; then return; fi
    if is_debian_like && (install_packages libembree-dev); then return; fi
    say "without Embree 3 (Debian: libembree-dev) the ray-tracing rival is not the fastest there is"
}

setup_rust() {
    local component
    for component in rustfmt clippy; do
        if cargo "${component/rust/}" --version >/dev/null 2>&1; then continue; fi
        say "adding the Rust component $component"
        rustup component add "$component" || fail "the Rust component $component is missing and rustup could not add it"
    done
}

if is_debian_like; then setup_debian; else check_other; fi
setup_shaderc
if [ "$level" = bench ]; then setup_embree; fi
if [ "$level" != test ]; then
    scripts/vulkan.sh layer || say "without the current validation layer some tests fail; run this again to fetch it"
else
    scripts/vulkan.sh layer
    scripts/vulkan.sh lavapipe
    setup_rust
fi
say "ready"
