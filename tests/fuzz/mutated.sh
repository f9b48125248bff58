#!/usr/bin/env bash
# Mutated rawlogs through the program with the sanitizers: tests/fuzz/mutated.sh [BUILD [N [FIRST]]]
# runs N (1000) of one sequence of mutations from FIRST (0) on. BUILD holds vio-slam and
# vio_faults_tests, built by the preset asan-ubsan or fuzz.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
export VIO_MUTATIONS=${2:-1000} VIO_FIRST_MUTATION=${3:-0} \
    ASAN_OPTIONS="allocator_may_return_null=1:detect_leaks=1" \
    LSAN_OPTIONS="suppressions=$PWD/tests/sanitizers/leaks.supp:print_suppressions=0" \
    UBSAN_OPTIONS="suppressions=$PWD/tests/sanitizers/undefined.supp:halt_on_error=1:print_stacktrace=1"
"${1:-build/fuzz}/tests/vio_faults_tests" --gtest_filter='MutatedRawlogs.*'
