#!/usr/bin/env bash
# Runs every fuzzer of the readers for a time, two at a time:
#   tests/fuzz/run.sh [SECONDS [NAME...]]      default: 600 s each, all of them
# New inputs go to build/fuzz/corpus/NAME, findings to build/fuzz/findings/NAME-*. Fails if there is
# a finding. Built by: cmake --preset fuzz && cmake --build --preset fuzz
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
seconds=${1:-600}
shift || true
names=("$@")
((${#names[@]})) || names=(rawlog features asl ros2 tables trajectory ini calibration results)
build=build/fuzz
mkdir -p "$build/findings"

one() {
    local name=$1 corpus=$build/corpus/$1
    mkdir -p "$corpus"
    nice "$build/tests/fuzz_$name" "$corpus" "tests/fuzz/corpus/$name" \
        -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -malloc_limit_mb=1024 \
        -max_len=16384 -print_final_stats=1 -artifact_prefix="$build/findings/$name-" \
        >"$build/findings/$name.log" 2>&1
    local code=$?
    printf '%-12s %s %s\n' "$name" "$( ((code)) && echo FINDING || echo clean)" \
        "$(grep -E 'number_of_executed_units|new_units_added' "$build/findings/$name.log" |
            awk '{printf "%s %s  ", $1, $2}')"
    return "$code"
}
export -f one
# fuzz/memory.cpp replaces operator new, the sanitizer's runtime has been built with its own.
export seconds build ASAN_OPTIONS="alloc_dealloc_mismatch=0:detect_leaks=1" \
    LSAN_OPTIONS="suppressions=tests/sanitizers/leaks.supp:print_suppressions=0" \
    UBSAN_OPTIONS="suppressions=tests/sanitizers/undefined.supp:halt_on_error=1:print_stacktrace=1"
printf '%s\n' "${names[@]}" | xargs -P 2 -I{} bash -c 'one {}'
