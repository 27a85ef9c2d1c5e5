#!/usr/bin/env bash
# System calls a cycle of controller and plant in their steady state, counted by strace while they run: sleeps and
# nothing else. The controller sleeps once a cycle. The plant sleeps up to three times: before SYNC, before the process
# data, before the command; on a core that wakes up late it spins for the command instead. Needs strace and the right to
# trace.
#
#     tests/realtime/count_syscalls.sh target/release/masseter
set -euo pipefail
masseter=${1:?usage: $0 path/to/masseter}
rate_hz=1000
traced_s=4

work=$(mktemp -d)
# Being traced holds a process up for longer than its partners wait in earnest.
cat >"$work/lenient.toml" <<'END'
[controller]
stale_cycles = 5000
tracking_limit_m = 1.0
tracking_limit_rad = 1.0
tracking_rms_limit_m = 1.0
tracking_rms_limit_rad = 1.0
[can]
command_timeout_cycles = 5000
heartbeat_consumer_ms = 5000
[drives]
slide.following_error_m = 1.0
leg.following_error_m = 1.0
END
"$masseter" run "$work/lenient.toml" --duration 60s --rate-hz $rate_hz --clock rt --out "$work/run" >"$work/said" 2>&1 &
rig=$!
trap 'kill -INT $rig 2>/dev/null; wait $rig 2>/dev/null || true; rm -rf "$work"' EXIT

pid_of() {
    local id
    for id in $(cat "/proc/$rig/task/$rig/children"); do
        if tr '\0' '\n' <"/proc/$id/cmdline" | sed -n 2p | grep -qx "$1"; then
            echo "$id"
        fi
    done
}

sleep 3 # started, eased in, moving
failed=0
for role_and_sleeps in controller:1 plant:3; do
    role=${role_and_sleeps%:*}
    sleeps=${role_and_sleeps#*:}
    pid=$(pid_of "$role")
    [ -n "$pid" ] || { cat "$work/said"; exit 1; }
    strace -c -f -p "$pid" -o "$work/$role" 2>>"$work/said" &
    tracer=$!
    sleep $traced_s
    kill -INT $tracer || { cat "$work/said"; exit 1; }
    wait $tracer || true
    # Columns: % time, seconds, µs/call, calls, [errors,] syscall. A tracer's coming and going makes a wait
    # restart; that is not the rig's.
    calls=$(awk '$4 ~ /^[0-9]+$/ && $NF != "total" && $NF != "restart_syscall" { n += $4 } END { print n + 0 }' "$work/$role")
    others=$(awk '$4 ~ /^[0-9]+$/ && $NF !~ /^(clock_nanosleep|restart_syscall|total)$/ { printf "%s ", $NF }' "$work/$role")
    cycles=$((rate_hz * traced_s))
    echo "$role: $calls system calls in about $cycles cycles (at most $sleeps each);" \
        "other than clock_nanosleep: ${others:-none}"
    # A tenth more for the time that attaching and leaving take.
    if [ "$calls" -eq 0 ] || [ "$calls" -gt $((cycles * sleeps * 11 / 10)) ] || [ -n "$others" ]; then
        failed=1
    fi
done
exit $failed
