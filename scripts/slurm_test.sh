#!/usr/bin/env bash
# Runs a batch as a real Slurm array of 32 tasks over more than 500 items, kills and requeues tasks and stops a node daemon
# meanwhile, and compares everything with what a single process makes. Root; see slurm_cluster.sh. BIN is the program.
set -euo pipefail
scripts=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
assets=$scripts/../assets
BIN=$(realpath "${BIN:-$scripts/../target/release/antumbra}")
out=${1:-out/slurm}
SHARDS=32

fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}
say() { printf '%6.1f s  %s\n' "$(bc <<<"$(date +%s.%N) - $begun")" "$*"; }
[ -x "$BIN" ] || fail "$BIN is missing: build it, or name another with BIN="

rm -rf "$out"
mkdir -p "$out"
out=$(cd "$out" && pwd)
begun=$(date +%s.%N)
"$scripts/slurm_cluster.sh" install
cluster=$(mktemp -d /tmp/antumbra-slurm.XXXXXX)
trap '"$scripts/slurm_cluster.sh" stop "$cluster"; rm -rf "$cluster"' EXIT
"$scripts/slurm_cluster.sh" start "$cluster"
# shellcheck source=/dev/null
. "$cluster/env"

mkdir -p "$out/tasks" "$out/scenes"
cp "$assets"/*.glb "$assets"/*.gltf "$out/scenes/"
cat >"$out/jobs.toml" <<'EOF'
[[job]]
name = "walk"
scenes = ["scenes/figure.glb"]
techniques = ["hard", "pcss:taps=16,search=16"]
frames = "0..230"
size = "64x64"

[[job]]
name = "stills"
scenes = ["scenes"]
techniques = ["hard", "pcf:taps=16", "pcss:taps=16,search=16"]
size = "64x64"
visibility = "exr"

[[job]]
name = "sweep"
scenes = ["scenes/sphere_over_plane.gltf"]
techniques = ["pcss:taps=16,search=16"]
lights = [
  { name = "lamp", scale = 0.25 }, { name = "lamp", scale = 0.5 }, { name = "lamp", scale = 0.75 },
  { name = "lamp", scale = 1.0 }, { name = "lamp", scale = 1.25 }, { name = "lamp", scale = 1.5 },
  { name = "lamp", scale = 1.75 }, { name = "lamp", scale = 2.0 }, { name = "lamp", scale = 2.25 },
  { name = "lamp", scale = 2.5 },
]
size = "64x64"
EOF
cat >"$out/task.sh" <<EOF
#!/bin/sh
echo \$\$ >"$out/tasks/\$SLURM_ARRAY_TASK_ID.pid"
echo "\$SLURM_ARRAY_TASK_ID on \$SLURMD_NODENAME, restart \${SLURM_RESTART_COUNT:-0}" >>"$out/tasks/starts"
exec "$BIN" batch "$out/jobs.toml" --out "$out/array"
EOF

items=$("$BIN" batch "$out/jobs.toml" --list --shard 1/1 | wc -l)
[ "$items" -ge 500 ] || fail "only $items items"
say "$items items"
# Pipelines are compiled before both are timed.
"$BIN" batch "$out/jobs.toml" --out "$out/warm" --shard 1/1 >/dev/null
say "single process"
"$BIN" batch "$out/jobs.toml" --out "$out/single" --shard 1/1 | tee "$out/single.txt"

# The name of item $2 of shard $1.
item() { "$BIN" batch "$out/jobs.toml" --list --shard "$1/$SHARDS" | sed -n "$2p" | cut -f 3; }
wait_for() {
    for _ in $(seq 6000); do
        if [ -e "$1" ]; then return 0; fi
        sleep 0.02
    done
    fail "$1 is not there after two minutes"
}
wait_idle() {
    for _ in $(seq 1200); do
        if [ -z "$(squeue -h -j "$job" -t PD,R,CG 2>/dev/null)" ]; then return 0; fi
        sleep 0.25
    done
    squeue >&2
    fail "the array has not ended after five minutes"
}
state() { scontrol show job "${job}_$1" | grep -o 'JobState=[A-Z]*'; }

killed=$(item 5 3) requeued=$(item 9 3) busy=$(item 14 2)
array_begun=$(date +%s.%N)
job=$(sbatch --parsable --requeue --array=1-$SHARDS --chdir="$out" --output="$out/tasks/%a.log" --open-mode=append "$out/task.sh")
say "array $job of $SHARDS tasks"
wait_for "$out/array/$killed.json"
kill -KILL "$(cat "$out/tasks/5.pid")"
say "task 5 killed by SIGKILL"
wait_for "$out/array/$requeued.json"
scontrol requeue "${job}_9"
say "task 9 requeued while it ran"
wait_for "$out/array/$busy.json"
"$scripts/slurm_cluster.sh" node-stop "$cluster" 2
say "daemon of node 2 stopped"
sleep 3
"$scripts/slurm_cluster.sh" node-start "$cluster" 2
say "daemon of node 2 started"
wait_idle
array_s=$(bc <<<"$(date +%s.%N) - $array_begun")
say "array ended: task 5 $(state 5), task 9 $(state 9)"
[ "$(state 5)" = JobState=FAILED ] || fail "task 5 should have failed: it ended before it was killed"
grep -q '^9 .*restart 1' "$out/tasks/starts" || fail "task 9 has not run twice"

# What is missing is named.
if "$BIN" merge "$out/array" >"$out/missing.txt" 2>"$out/missing.err"; then fail "merge did not miss anything"; fi
say "merge names $(wc -l <"$out/missing.txt") missing items: $(cat "$out/missing.err")"
before=$(find "$out/array" -name '*.json' | wc -l)
scontrol requeue "${job}_5"
wait_idle
[ "$(state 5)" = JobState=COMPLETED ] || fail "task 5 has not completed: $(state 5)"
say "task 5 requeued and completed, $before records before it and $(find "$out/array" -name '*.json' | wc -l) after it"
tail -n 3 "$out/tasks/5.log"

for folder in single array; do
    "$BIN" merge "$out/$folder" >/dev/null
    "$BIN" merge "$out/$folder" --no-timings --out "$out/merged-$folder" >/dev/null
    (cd "$out/$folder" && find . -type f \( -name '*.png' -o -name '*.exr' \) -not -path '*/.*' -print0 | LC_ALL=C sort -z |
        xargs -0 sha256sum) >"$out/$folder.sha256"
done
cmp "$out/single.sha256" "$out/array.sha256" || fail "images differ"
cmp "$out/merged-single/results.json" "$out/merged-array/results.json" || fail "merged results differ"
say "$(wc -l <"$out/single.sha256") images byte-identical, merged results equal"
echo "files left by killed processes: $(find "$out/array" -name '.antumbra-*.part' | wc -l)"
echo "task starts by node: $(cut -d ' ' -f 3 "$out/tasks/starts" | sort | uniq -c | tr -s ' \n' ' ')"

python3 - "$out" "$array_s" "$SHARDS" "$array_begun" <<'EOF'
import json, pathlib, sys
out, wall, shards, begun = pathlib.Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4])
one = json.loads((out / "single/shards/0001-of-0001.json").read_text())
logs = [json.loads(p.read_text()) for p in sorted((out / "array/shards").iterdir())]
assert len(logs) == shards, len(logs)
# Tasks that ran twice logged only what they did the second time.
whole = [log for log in logs if log["skipped"] == 0]
rate = sum(log["rendered"] for log in whole) / sum(log["seconds"] for log in whole)
alone = one["rendered"] / one["seconds"]
# Slurm holds a requeued task for two minutes.
files = [p for p in (out / "array/shards").iterdir() if p.name[:4] not in ("0005", "0009")]
others = max(p.stat().st_mtime for p in files) - begun
seconds = sorted(log["seconds"] for log in whole)
ready = sum(log["ready_s"] for log in whole) / len(whole)
print(f"single process: {one['seconds']:.2f} s, {alone:.1f} items/s, {one['scenes_loaded']} scene loads")
print(f"array of {shards}: {wall:.2f} s from sbatch to the last task, on two nodes of one CPU; {others:.2f} s without the requeued ones")
print(f"shards that ran once ({len(whole)}): {rate:.1f} items/s each while two ran at a time, {rate / alone:.2f} of the single process")
print(f"  seconds: least {seconds[0]:.2f}, median {seconds[len(seconds) // 2]:.2f}, most {seconds[-1]:.2f}; of it {ready:.2f} for device and scenes")
EOF
