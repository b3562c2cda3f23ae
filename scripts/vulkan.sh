#!/usr/bin/env bash
# Unpacks newer Vulkan pieces than the distribution's own beside the project, from the Debian mirror the machine uses.
# Nothing is installed and the machine's package lists stay as they are.
# usage: scripts/vulkan.sh layer       current validation layer and SwiftShader -> .deps/vulkan/{validation,swiftshader}
#        scripts/vulkan.sh lavapipe    a newer lavapipe than an old system's    -> .deps/vulkan/lavapipe
set -euo pipefail
# shellcheck source=scripts/common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

vulkan=$DEPS/vulkan
unit=${1-}
case $unit in
    layer)
        # The browser's package carries both; no other Debian package has them this new.
        package=chromium-common
        if [ -f "$vulkan/validation/version" ] && [ -f "$vulkan/swiftshader/version" ]; then exit 0; fi
        left_out="the distribution's own validation layer is used and SwiftShader is left out"
        ;;
    lavapipe)
        package=mesa-vulkan-drivers
        if [ -f "$vulkan/lavapipe/version" ]; then exit 0; fi
        left_out="a second, newer lavapipe is left out"
        installed=$(dpkg-query -W -f '${Version}\n' "$package" 2>/dev/null | head -n 1 || true)
        if [ -n "$installed" ] && dpkg --compare-versions "$installed" ge 25; then exit 0; fi
        ;;
    *) fail "usage: scripts/vulkan.sh layer|lavapipe" ;;
esac

if ! is_debian_like; then
    say "not a Debian system: $left_out"
    exit 0
fi

# One line "URI RELEASE" for each of Debian's own archives that this machine is configured for, whichever file format
# and mirror that is written in.
codename=$(os_release VERSION_CODENAME)
debian_archives() {
    # shellcheck disable=SC2016 # apt expands these
    apt-get indextargets --format '$(ORIGIN)|$(COMPONENT)|$(CODENAME)|$(REPO_URI)|$(RELEASE)' 'Created-By: Packages' 2>/dev/null \
        | awk -F'|' -v code="$codename" \
            '$1 == "Debian" && $2 == "main" && ($3 == code || $3 == code "-security") && !seen[$4 $5]++ { print $4, $5 }'
}
archives=
if [ "$(os_release ID)" != ubuntu ]; then
    archives=$(debian_archives)
    if [ -z "$archives" ] && [ -z "$(apt-get indextargets 2>/dev/null)" ]; then
        apt_update
        archives=$(debian_archives)
    fi
fi
if [ -z "$archives" ]; then
    say "no Debian mirror is configured: $left_out"
    exit 0
fi

mkdir -p "$vulkan"
stage=$(mktemp -d "$DEPS/vulkan.XXXXXX")
trap 'rm -rf "$stage"' EXIT
mkdir -p "$stage/lists/partial" "$stage/cache/archives/partial" "$stage/deb" "$stage/files"
: >"$stage/status"

options=
for keyring in /usr/share/keyrings/debian-archive-keyring.{pgp,gpg}; do
    if [ -f "$keyring" ]; then
        options="[signed-by=$keyring] "
        break
    fi
done
if [ "$unit" = layer ]; then
    printf '%s\n' "$archives" | while read -r uri release; do printf 'deb %s%s %s main\n' "$options" "$uri" "$release"; done
else
    base=$(printf '%s\n' "$archives" | awk '$2 !~ /security/ { print $1 }')
    base=${base%%$'\n'*}
    printf 'deb %s%s %s-backports main\n' "$options" "$base" "$codename"
fi >"$stage/sources.list"

private_apt() {
    apt-get -q -o Dir::Etc::SourceList="$stage/sources.list" -o Dir::Etc::SourceParts=/dev/null \
        -o Dir::Etc::Preferences=/dev/null -o Dir::Etc::PreferencesParts=/dev/null \
        -o Dir::State="$stage" -o Dir::State::Lists="$stage/lists" -o Dir::State::Status="$stage/status" \
        -o Dir::Cache="$stage/cache" -o APT::Sandbox::User="$(id -un)" -o Acquire::Languages=none \
        -o Acquire::IndexTargets::deb::DEP-11::DefaultEnabled=false -o Acquire::Retries=3 \
        -o APT::Update::Error-Mode=any -o APT::Update::Post-Invoke::= -o APT::Update::Post-Invoke-Success::= "$@"
}

# Extracts files of the package into $stage/files, without the folders they lie in there.
extract() {
    local pattern
    for pattern in "$@"; do
        dpkg-deb --fsys-tarfile "$deb" \
            | tar -x -C "$stage/files" --wildcards --no-anchored --transform='s,.*/,,' "$pattern" 2>/dev/null \
            || fail "$(basename "$deb") has no $pattern: it cannot be used here"
    done
}

# A library whose own libraries are missing would fail later, far from here.
check_loads() {
    local unresolved
    unresolved=$(ldd "$1" | awk '/not found/ { print $1 }' | paste -sd' ')
    [ -z "$unresolved" ] || fail "$(basename "$1") of $package $version needs $unresolved, which this system lacks"
}

write_icd() {
    printf '{\n  "file_format_version": "1.0.0",\n  "ICD": { "library_path": "./%s", "api_version": "1.3.0" }\n}\n' "$2" >"$1/icd.json"
}

# The version file goes in last and the folder moves as a whole, so that a folder with one is complete.
finish() {
    printf '%s %s\n' "$package" "$version" >"$stage/$1/version"
    chmod 755 "$stage/$1"
    rm -rf "${vulkan:?}/$1"
    mv "$stage/$1" "$vulkan/$1"
}

say "downloading $package from the Debian mirror of this machine, to unpack into .deps/vulkan"
private_apt update >"$stage/log" 2>&1 || { cat "$stage/log" >&2; fail "could not read the Debian mirror's package lists"; }
(cd "$stage/deb" && private_apt download "$package") >"$stage/log" 2>&1 || { cat "$stage/log" >&2; fail "could not download $package"; }
deb=$(find "$stage/deb" -name '*.deb')
version=$(dpkg-deb -f "$deb" Version)

case $unit in
    layer)
        extract libVkLayer_khronos_validation.so libvk_swiftshader.so
        check_loads "$stage/files/libVkLayer_khronos_validation.so"
        check_loads "$stage/files/libvk_swiftshader.so"

        mkdir "$stage/validation" "$stage/swiftshader"
        mv "$stage/files/libVkLayer_khronos_validation.so" "$stage/validation/"
        cat >"$stage/validation/VkLayer_khronos_validation.json" <<JSON
{
  "file_format_version": "1.2.0",
  "layer": {
    "name": "VK_LAYER_KHRONOS_validation",
    "type": "GLOBAL",
    "library_path": "./libVkLayer_khronos_validation.so",
    "api_version": "1.4.0",
    "implementation_version": "1",
    "description": "Khronos validation layer of $package $version",
    "instance_extensions": [
      { "name": "VK_EXT_debug_utils", "spec_version": "2" },
      { "name": "VK_EXT_layer_settings", "spec_version": "2" },
      { "name": "VK_EXT_validation_features", "spec_version": "6" }
    ],
    "device_extensions": []
  }
}
JSON
        mv "$stage/files/libvk_swiftshader.so" "$stage/swiftshader/"
        write_icd "$stage/swiftshader" libvk_swiftshader.so
        finish swiftshader
        finish validation
        ;;
    lavapipe)
        dpkg --compare-versions "$version" ge 25 || { say "$package $version is no newer than 25: $left_out"; exit 0; }
        extract libvulkan_lvp.so
        check_loads "$stage/files/libvulkan_lvp.so"
        mkdir "$stage/lavapipe"
        mv "$stage/files/libvulkan_lvp.so" "$stage/lavapipe/"
        write_icd "$stage/lavapipe" libvulkan_lvp.so
        finish lavapipe
        ;;
esac
