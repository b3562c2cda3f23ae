#!/usr/bin/env bash
# Merges the system's static shaderc, glslang and SPIRV-Tools archives into the one that the shaderc crate links
# (.deps/shaderc, named by .cargo/config.toml). Exit 1: not possible here, the crate builds its own from source.
set -euo pipefail
# shellcheck source=scripts/common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

target=$DEPS/shaderc
archive=$target/libshaderc_combined.a
# Names come and go between glslang releases: whichever exist are merged and the trial program below decides.
parts=(shaderc_combined glslang MachineIndependent GenericCodeGen OSDependent OGLCompiler SPIRV HLSL SPIRV-Tools-opt SPIRV-Tools)

lib_dir=
for dir in "/usr/lib/$(cc -print-multiarch 2>/dev/null || true)" /usr/lib64 /usr/lib; do
    if [ -f "$dir/libshaderc_combined.a" ]; then
        lib_dir=$dir
        break
    fi
done
if [ -z "$lib_dir" ]; then
    say "no static shaderc on this system: it will be built from source, which takes about 12 minutes on two cores"
    rm -rf "$target"
    exit 1
fi

sources=()
for part in "${parts[@]}"; do
    if [ -f "$lib_dir/lib$part.a" ]; then sources+=("$lib_dir/lib$part.a"); fi
done

# Sizes and dates, because a package's files are dated by their build, which may lie before an earlier merge.
fingerprint=$(stat -c '%n %s %Y' "${sources[@]}")
if [ -f "$target/sources" ] && [ "$(cat "$target/sources")" = "$fingerprint" ]; then
    if [ -f "$archive" ]; then exit 0; fi
    say "the system's static shaderc does not link: it will be built from source"
    exit 1
fi

stage=$(mktemp -d "$DEPS/shaderc.XXXXXX")
trap 'rm -rf "$stage"' EXIT
mkdir "$stage/out"

say "merging the system's static shaderc archives into .deps/shaderc"
{
    echo "CREATE $(basename "$archive")"
    printf 'ADDLIB %s\n' "${sources[@]}"
    echo SAVE
    echo END
} >"$stage/script"

cat >"$stage/trial.c" <<'C'
#include <shaderc/shaderc.h>
#include <string.h>

int main(void) {
    static const char source[] =
        "#version 460\n"
        "layout(local_size_x = 8) in;\n"
        "layout(binding = 0) buffer Words { uint words[]; };\n"
        "void main() { words[gl_GlobalInvocationID.x] *= 2u; }\n";
    shaderc_compiler_t compiler = shaderc_compiler_initialize();
    shaderc_compile_options_t options = shaderc_compile_options_initialize();
    shaderc_compile_options_set_optimization_level(options, shaderc_optimization_level_performance);
    shaderc_compilation_result_t result = shaderc_compile_into_spv(
        compiler, source, strlen(source), shaderc_glsl_compute_shader, "trial", "main", options);
    return !(shaderc_result_get_compilation_status(result) == shaderc_compilation_status_success
             && shaderc_result_get_length(result) > 20);
}
C

# ar's scripts cannot quote, so it works inside the folder it writes to.
if { (cd "$stage/out" && ar -M <../script) \
    && cc "$stage/trial.c" -L"$stage/out" -lshaderc_combined -lstdc++ -lm -lpthread -o "$stage/trial" \
    && "$stage/trial"; } 2>"$stage/errors"; then
    status=0
else
    sed -n 1,3p "$stage/errors" >&2
    say "the merged archive does not compile a shader: shaderc will be built from source, which takes about 12 minutes on two cores"
    rm -f "$stage/out/libshaderc_combined.a"
    status=1
fi
printf '%s\n' "$fingerprint" >"$stage/out/sources"
chmod 755 "$stage/out"
rm -rf "$target"
mv "$stage/out" "$target"
exit $status
