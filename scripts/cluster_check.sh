#!/usr/bin/env bash
# Checks examples/cluster/job.yaml strictly against the schema of Kubernetes (package kubernetes-validate, in .deps/).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
VERSION=${KUBERNETES_VERSION:-1.31}
venv=.deps/kubernetes-validate
if [ ! -x "$venv/bin/kubernetes-validate" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install -q "kubernetes-validate==1.31.0"
fi
"$venv/bin/kubernetes-validate" --strict --kubernetes-version "$VERSION" examples/cluster/job.yaml
# A validator that takes everything checks nothing.
wrong=$(mktemp --suffix=.yaml)
trap 'rm -f "$wrong"' EXIT
sed 's/completionMode: Indexed/completionsMode: Indexed/' examples/cluster/job.yaml >"$wrong"
if "$venv/bin/kubernetes-validate" --strict --kubernetes-version "$VERSION" "$wrong" >/dev/null 2>&1; then
    echo "error: the validator took a field that does not exist" >&2
    exit 1
fi
# Kubernetes tells a pod only its index; the number is written twice.
completions=$(sed -n 's/^  completions: //p' examples/cluster/job.yaml)
grep -q -- "--shards, \"$completions\"" examples/cluster/job.yaml || {
    echo "error: --shards is not the $completions of completions" >&2
    exit 1
}
echo "examples/cluster/job.yaml: valid for Kubernetes $VERSION, $completions shards"
