#!/usr/bin/env bash
# Everything a change must pass: format, lints, tests, documentation, and the GPU tests on each software driver at hand.
# Runs all steps even after one fails, lists them with their durations, and fails if one did. After the build, two
# processes go on at a time; tests that open a device run one by one in theirs.
set -euo pipefail
# shellcheck source=scripts/common.sh
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# Which driver runs is never left to chance, and never a graphics card. Loaders before 1.3.207 know only the second name.
use_driver() { export VK_DRIVER_FILES=$1 VK_ICD_FILENAMES=$1; }

lavapipe=$(system_lavapipe) || fail "Mesa's lavapipe is missing: run scripts/setup.sh test"
use_driver "$lavapipe"
unset VK_INSTANCE_LAYERS VK_LOADER_LAYERS_ENABLE VK_LOADER_LAYERS_DISABLE
# Mesa's implicit layer reorders devices.
export NODEVICE_SELECT=1
# Variables set outside would win over those of .cargo/config.toml.
unset VK_LAYER_PATH VK_ADD_LAYER_PATH LP_NATIVE_VECTOR_WIDTH ANTUMBRA_TEST_FEWER ANTUMBRA_TEST_ALL ANTUMBRA_TEST_TRUTH

# Nothing is built in small steps in a fresh clone: bookkeeping for later builds would cost a sixth of the time.
if [ ! -d "${CARGO_TARGET_DIR:-target}/debug/incremental" ]; then export CARGO_INCREMENTAL=0; fi

# Tests that open a Vulkan device run one at a time, or they measure and starve each other.
gpu_tests=()
# Those of them that are asked on every driver.
driver_tests=()
other_tests=()
for file in tests/*.rs tests/*/main.rs; do
    [ -f "$file" ] || continue
    name=${file#tests/}
    name=${name%.rs}
    name=${name%/main}
    case $name in
        capture_stress) ;; # see stress_job
        # Jobs and shards, reports, files, the ray tracer, SPIR-V, what follows an error: the same whatever the driver.
        cli_batch | cli_bench | cli_reference | shader_modules | capture_faults | capture_soak | cli_fuzz) gpu_tests+=(--test "$name") ;;
        gpu_* | shader_* | capture* | cli* | embed* | host* | golden*)
            gpu_tests+=(--test "$name")
            driver_tests+=(--test "$name")
            ;;
        *) other_tests+=(--test "$name") ;;
    esac
done

started=$SECONDS
summary=()
failed=0

# Much of a GPU test is one thread's work (compiling pipelines, validation, rays of the truth), as is much of a
# build, so two processes at a time finish sooner than one. What they print comes out whole, when a job is done.
jobs_dir=$(mktemp -d)
trap 'rm -rf "$jobs_dir"' EXIT
job_names=()
job_pids=()
next_shown=0
start_job() {
    while [ "$(jobs -rp | wc -l)" -ge 2 ]; do wait -n || true; done
    local name=$1 base=$jobs_dir/${#job_names[@]}
    shift
    job_names+=("$name")
    printf '\n==> %s: begun\n' "$name"
    (
        begin=$SECONDS
        code=0
        "$@" >"$base.log" 2>&1 || code=$?
        echo "$code $((SECONDS - begin))" >"$base.result"
    ) &
    job_pids+=($!)
}
show_jobs() {
    local code seconds verdict
    for ((; next_shown < ${#job_names[@]}; next_shown++)); do
        wait "${job_pids[next_shown]}" || true
        read -r code seconds <"$jobs_dir/$next_shown.result" || { code=1 seconds=0; }
        verdict=ok
        if [ "$code" != 0 ]; then
            verdict=FAILED
            failed=1
        fi
        printf '\n==> %s\n' "${job_names[next_shown]}"
        cat "$jobs_dir/$next_shown.log"
        summary+=("$(printf '%-6s %5d s  %s' "$verdict" "$seconds" "${job_names[next_shown]}")")
        printf '%s\n' "--- ${summary[-1]}"
    done
}
# What of the other files is the same whatever the driver: that the validation layer sees a missing barrier,
# arguments and file names of the program, its files. That a frame is the same in every run, `capture_stress` asks of
# all techniques on all drivers.
anywhere=(random_graphs_without_one_of_their_barriers choice:: failures:: interrupted::
    help_and_version_go formats_follow_the_ending lights_are_chosen_by an_image_says_how_bright
    a_report_counts_tiles a_scene_without_a_camera_is graph_prints_the_plan techniques_are_listed
    visibility_is_the_same_in_every_run a_failing_frame_is_named termination_leaves_whole
    wrong_names_of_images_exit_2 light_in_the_name_of_a_picture)
gpu_job() {
    if [ ${#gpu_tests[@]} -eq 0 ]; then return; fi
    start_job "GPU tests on $1" cargo test --no-fail-fast "${gpu_tests[@]}" -- --test-threads=1
}
driver_job() {
    if [ ${#driver_tests[@]} -eq 0 ]; then return; fi
    local skip=() name
    for name in "${anywhere[@]}"; do skip+=(--skip "$name"); done
    start_job "GPU tests on $1" cargo test --no-fail-fast "${driver_tests[@]}" -- --test-threads=1 "${skip[@]}"
}
# stress_job NAME [FILTER]
stress_job() {
    start_job "stress scenes on $1" cargo test --test capture_stress -- --test-threads=1 "${@:2}"
}
# on DRIVER JOB [FILTER]: where set-up could unpack that driver, what may depend on it.
on() {
    if [ ! -f ".deps/vulkan/$1/version" ]; then return; fi
    use_driver "$PWD/.deps/vulkan/$1/icd.json"
    # Frames of seconds there: of the slow techniques every other stress scene.
    if [ "$1" = swiftshader ]; then export ANTUMBRA_TEST_FEWER=1; else unset ANTUMBRA_TEST_FEWER; fi
    "$2" "$1 of $(cat ".deps/vulkan/$1/version")" "${@:3}"
    use_driver "$lavapipe"
    unset ANTUMBRA_TEST_FEWER
}

lints() {
    local code=0
    cargo clippy --all-targets -- -D warnings || code=1
    cargo clippy --no-default-features -- -D warnings || code=1
    return $code
}
documentation() {
    RUSTDOCFLAGS="-D warnings" cargo doc --no-deps
}

start_job "format" cargo fmt --check
# All at once, for linking and much of compiling are one thread's work.
start_job "build of the tests" cargo test --no-run
wait "${job_pids[1]}" || true
if [ "$(cut -d ' ' -f 1 "$jobs_dir/1.result")" != 0 ]; then
    show_jobs
    fail "the tests do not build"
fi

# Drivers ask for the same truth.
export ANTUMBRA_TEST_TRUTH=$jobs_dir/truth
mkdir "$ANTUMBRA_TEST_TRUTH"
# The longest first, so that both processes end at about the same time. All relations over all stress scenes take
# minutes: once, and elsewhere each scene by itself. Cargo builds one thing at a time: lints and documentation are done
# before the second process goes on with tests.
on swiftshader driver_job
start_job "lints" lints
start_job "documentation" documentation
stress_job "the system's lavapipe"
gpu_job "the system's lavapipe"
on swiftshader stress_job every_case
on lavapipe driver_job
on lavapipe stress_job every_case
start_job "unit and graph tests" cargo test --no-fail-fast --lib --bins --examples "${other_tests[@]}"
start_job "documentation examples" cargo test --doc
show_jobs

printf '\n'
printf '%s\n' "${summary[@]}"
printf '%-6s %5d s  %s\n' "$([ $failed -eq 0 ] && echo ok || echo FAILED)" $((SECONDS - started)) "all"
exit $failed
