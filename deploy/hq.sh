#!/usr/bin/env bash
# Drives the shards of a run by HyperQueue's program `hq`, and merges them. Without that program: hq_driver.py.
#
#   deploy/hq.sh --shards N [--workers W [--any-interface]] -- SET... [options of sim run] --out RUN
#
# --workers W starts a server of its own and W workers of one core on this host, and ends them; in a network of their own, for
# HyperQueue listens on every interface: --any-interface does without. Without --workers the server is the one that `hq` finds
# (HQ_SERVER_DIR), with the workers that it has, on any hosts; RUN is on a folder that they share.
# SIM=PROGRAM: the sim, if it is not on PATH.
set -euo pipefail

tries=4 # of a shard that does not end by itself; lost workers are HyperQueue's business (--crash-limit)
pause=2 # seconds before the next try

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

typed=("$@")
shards='' workers='' any=''
while (($# > 0)); do
    case $1 in
    --shards) shards=${2-} && shift 2 ;;
    --workers) workers=${2-} && shift 2 ;;
    --any-interface) any=yes && shift ;;
    --) shift && break ;;
    -h | --help) sed -n '2,/^set/{/^#/s/^# \{0,1\}//p}' "$0" && exit 0 ;;
    *) fail "what is $1? sim's arguments come after --" ;;
    esac
done
[[ $shards =~ ^[1-9][0-9]*$ ]] || fail 'say --shards N'
[[ $workers =~ ^([1-9][0-9]*)?$ ]] || fail '--workers takes a number'
command -v hq > /dev/null || fail 'no hq: take it from https://github.com/It4innovations/hyperqueue/releases (0.27.0 or newer), or use hq_driver.py'
sim=$(command -v "${SIM:-sim}") || fail "no program ${SIM:-sim}: say SIM=PROGRAM"
sim=$(realpath "$sim")
run=$(out_of "$@")
[[ -n $run ]] || fail "no --out RUN among sim's arguments: all shards store in one folder"
logs=$(realpath -m "$run").logs
mkdir -p "$logs"

if [[ -n $workers && -z $any && -z ${RELOOP_OWN_NETWORK-} ]]; then
    # Root may have a network of its own; everybody else needs a user namespace for it.
    own=(unshare --net)
    "${own[@]}" true 2> /dev/null || own=(unshare --user --map-current-user --keep-caps --net)
    "${own[@]}" true || fail 'cannot make a network of its own: say --any-interface if all who reach this machine may reach HyperQueue'
    # shellcheck disable=SC2016 # the inner shell reads it
    RELOOP_OWN_NETWORK=yes exec "${own[@]}" bash -c 'ip link set lo up && exec "$@"' own "$0" "${typed[@]}"
fi

if [[ -n $workers ]]; then
    HQ_SERVER_DIR=$(mktemp -d)
    export HQ_SERVER_DIR
    pids=()
    stop() {
        kill "${pids[@]}" 2> /dev/null || true # workers take their shards with them
        wait || true
        rm -rf "$HQ_SERVER_DIR"
    }
    trap stop EXIT
    trap 'exit 130' INT TERM
    hq server start --host=127.0.0.1 > "$logs/server.log" 2>&1 &
    pids+=($!)
    hq server wait > /dev/null
    for ((worker = 1; worker <= workers; worker++)); do
        hq worker start --cpus=1 > "$logs/worker-$worker.log" 2>&1 &
        pids+=($!)
    done
fi

# Exit codes that mean whole: 0, and 1 with failed episodes. HyperQueue knows of 0 alone, so the task says 0 for both; the merge tells.
# shellcheck disable=SC2016 # the task's shell reads these
whole='shards=$1; shift; "$@" --shard "$HQ_TASK_ID/$shards" || { code=$?; exit $((code == 1 ? 0 : code)); }'
wanted=1-$shards
for ((try = 1; try <= tries; try++)); do
    # HQ_TASK_ID is the shard's number; said outright, for `--shard auto` may see Slurm's numbers too where workers run in its jobs.
    job=$(hq submit --output-mode=quiet --array="$wanted" --cpus=1 --name=reloop \
        --stdout="$logs/shard-%{TASK_ID}.out" --stderr="$logs/shard-%{TASK_ID}.err" \
        -- bash -c "$whole" task "$shards" "$sim" run "$@")
    hq job wait "$job" > /dev/null || true
    wanted=$(hq job task-ids "$job" --filter=failed,canceled)
    [[ -n $wanted ]] || break
    printf 'try %s of %s: shards %s did not end by themselves\n' "$try" "$tries" "$wanted" >&2
    sleep "$pause"
done

"$sim" merge "$run"
