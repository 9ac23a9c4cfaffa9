#!/usr/bin/env bash
# Drives the shards of a run as an array job of Slurm, and merges them in a job that waits for all.
#
#   deploy/slurm-array.sh --shards N [--at-once M] -- SET... [options of sim run] --out RUN
#
# sbatch's own options by its environment: SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT, SBATCH_MEM_PER_CPU ...
# SIM=PROGRAM: the sim, if it is not on PATH. It must be there on the nodes, and RUN on a folder that they share.
set -euo pipefail

tries=4    # of a shard that does not end by itself, in its task
pause=15   # seconds before the next try
restarts=50 # of a task that reached its time limit

fail() {
    printf 'error: %s\n' "$1" >&2
    exit 2
}

# The folder that `--out` names among sim's arguments.
out_of() {
    while (($# > 0)); do
        case $1 in
        --out) printf '%s' "${2-}" && return ;;
        --out=*) printf '%s' "${1#--out=}" && return ;;
        esac
        shift
    done
}

submit() {
    local shards='' at_once='' run array
    while (($# > 0)); do
        case $1 in
        --shards) shards=${2-} && shift 2 ;;
        --at-once) at_once=${2-} && shift 2 ;;
        --) shift && break ;;
        -h | --help) sed -n '2,/^set/{/^#/s/^# \{0,1\}//p}' "$0" && exit 0 ;;
        *) fail "what is $1? sim's arguments come after --" ;;
        esac
    done
    [[ $shards =~ ^[1-9][0-9]*$ ]] || fail 'say --shards N'
    [[ $at_once =~ ^([1-9][0-9]*)?$ ]] || fail '--at-once takes a number'
    command -v sbatch > /dev/null || fail "no sbatch: this is for a machine that submits to Slurm (Debian: apt install slurm-client)"
    sim=$(command -v "${SIM:-sim}") || fail "no program ${SIM:-sim}: say SIM=PROGRAM"
    sim=$(realpath "$sim")
    run=$(out_of "$@")
    [[ -n $run ]] || fail "no --out RUN among sim's arguments: all shards store in one folder"
    mkdir -p "$run.logs"

    # %M: no more than M at a time. A signal of its own two minutes before the time limit: the task is queued again then.
    array=$(sbatch --parsable --job-name=reloop --array="1-$shards${at_once:+%$at_once}" --ntasks=1 --cpus-per-task=1 \
        --requeue --open-mode=append --signal=B:USR1@120 --output="$run.logs/shard-%a.log" \
        "$0" --as-task "$shards" "$sim" "$@")
    array=${array%%;*}
    # afterany, not afterok: with failed episodes a shard ends with 1 and is whole. The merge looks itself whether something is missing.
    merge=$(sbatch --parsable --job-name=reloop-merge --dependency="afterany:$array" --ntasks=1 --open-mode=append \
        --output="$run.logs/merge.log" "$0" --as-merge "$sim" "$run")
    printf 'array %s, then merge %s; logs in %s.logs\n' "$array" "${merge%%;*}" "$run"
}

# One shard: `--shard I/N` by the array's own numbers, for an array of some tasks alone has other counts (--array=3,5).
task() {
    local shards=$1 sim=$2 try code=0 child='' stop=''
    shift 2
    # Either way sim drops the episode of the moment and leaves; all others are stored.
    trap stop=cancelled TERM INT # scancel, which signals sim as well; twice would be once too much
    trap 'stop=again; [[ -z $child ]] || kill -TERM "$child" 2> /dev/null || true' USR1 # the time limit is near
    for ((try = 1; try <= tries; try++)); do
        ((try == 1)) || sleep "$pause"
        [[ -z $stop ]] || break
        printf 'shard %s/%s, try %s, on %s\n' "$SLURM_ARRAY_TASK_ID" "$shards" "$try" "${SLURMD_NODENAME-}"
        "$sim" run "$@" --shard "$SLURM_ARRAY_TASK_ID/$shards" &
        child=$!
        code=0 && wait "$child" || code=$?
        # A trap ends the first wait; the second has the sim's own code.
        if kill -0 "$child" 2> /dev/null; then code=0 && wait "$child" || code=$?; fi
        ((code > 1)) || exit "$code"
        [[ -z $stop ]] || break
        printf 'sim ended with code %s\n' "$code" # killed (137), or 2: another process has the shard
    done
    if [[ $stop == again ]]; then
        ((${SLURM_RESTART_COUNT:-0} < restarts)) || fail "queued $restarts times, and not whole"
        printf 'the time limit is near: queued again\n'
        exec scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
    fi
    exit "$code"
}

case ${1-} in
--as-task) shift && task "$@" ;;
--as-merge) exec "$2" merge "$3" ;;
*) submit "$@" ;;
esac
