#!/usr/bin/env bash
# A real Slurm on this machine alone: munge, a controller and two node daemons on the loopback interface. Needs root and
# Debian's slurm-wlm and munge; touches nothing outside its folder but the user `munge`'s socket folder there.
#
#   slurm_cluster.sh install          packages
#   slurm_cluster.sh start DIR        keys, configuration, daemons; `. DIR/env` lets sbatch and squeue find them
#   slurm_cluster.sh node-stop DIR N  stops the daemon of node N (1 or 2)
#   slurm_cluster.sh node-start DIR N
#   slurm_cluster.sh stop DIR
set -euo pipefail

fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}
[ "$(id -u)" -eq 0 ] || fail "Slurm's daemons need root: run as root"

command=${1:-}
case $command in install) ;; start | stop | node-stop | node-start) [ $# -ge 2 ] || fail "give the cluster's folder" ;;
*) fail "give install, start, stop, node-stop or node-start" ;; esac

if [ "$command" = install ]; then
    if command -v slurmctld slurmd munged >/dev/null; then exit 0; fi
    export DEBIAN_FRONTEND=noninteractive
    apt-get -q -o DPkg::Lock::Timeout=300 install -y --no-install-recommends slurm-wlm munge ||
        fail "apt-get cannot install slurm-wlm and munge: see above; \`apt-get update\` may help"
    exit 0
fi

mkdir -p "$2"
dir=$(cd "$2" && pwd)
conf=$dir/slurm.conf
export SLURM_CONF=$conf

# Ends the daemon that wrote this file, and only it.
end() {
    local pid
    [ -f "$1" ] || return 0
    pid=$(cat "$1")
    kill "$pid" 2>/dev/null || true
    for _ in $(seq 100); do
        kill -0 "$pid" 2>/dev/null || break
        sleep 0.1
    done
    kill -9 "$pid" 2>/dev/null || true
    rm -f "$1"
}

start_node() {
    mkdir -p "$dir/spool$1"
    # One configuration for all: NodeName of -N decides port, log and spool.
    slurmd -N "node$1" -f "$conf"
}

case $command in
start)
    host=$(hostname)
    # The plain names in front of 1-9: each run of this has its own ports.
    port=$((20000 + $$ % 20000))
    mkdir -p "$dir/munge" "$dir/state"
    # munged refuses keys and sockets below folders that others may write to.
    chmod 755 "$dir" "$dir/munge"
    (umask 077 && head -c 128 /dev/urandom >"$dir/munge/key")
    cat >"$conf" <<EOF
ClusterName=antumbra
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CryptoType=crypto/munge
AuthInfo=socket=$dir/munge/socket
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool-%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd-%n.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,bf_interval=1
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
ReturnToService=2
SlurmdTimeout=300
SlurmctldTimeout=30
KillWait=5
MinJobAge=600
JobRequeue=1
MaxArraySize=1001
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=1
NodeName=node2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=1
PartitionName=all Nodes=node1,node2 Default=YES MaxTime=INFINITE State=UP
EOF
    printf 'export SLURM_CONF=%q\n' "$conf" >"$dir/env"
    munged --socket="$dir/munge/socket" --key-file="$dir/munge/key" --pid-file="$dir/munge/pid" \
        --log-file="$dir/munge/log" --seed-file="$dir/munge/seed" --num-threads=2 --force
    slurmctld -f "$conf"
    start_node 1
    start_node 2
    for _ in $(seq 100); do
        if [ "$(sinfo -h -N -o %T 2>/dev/null | grep -c '^idle')" = 2 ]; then exit 0; fi
        sleep 0.3
    done
    sinfo -N >&2 || true
    tail -n 5 "$dir"/*.log >&2 || true
    fail "the two nodes are not ready after 30 s: see above"
    ;;
node-stop) end "$dir/slurmd-node$3.pid" ;;
node-start) start_node "$3" ;;
stop)
    for node in 1 2; do end "$dir/slurmd-node$node.pid"; done
    end "$dir/slurmctld.pid"
    end "$dir/munge/pid"
    ;;
esac
