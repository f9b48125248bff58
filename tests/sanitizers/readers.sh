#!/usr/bin/env bash
# The readers of every file format, and what they rest on, under the address and undefined-behaviour
# sanitizers: builds these alone, which takes no longer than without, and runs their unit tests. The
# whole suite: tests/README.md.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
cmake --preset asan-ubsan -B build/readers \
    -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O0 -g1" >/dev/null
cmake --build build/readers --target vio_reader_tests
export LSAN_OPTIONS="suppressions=tests/sanitizers/leaks.supp:print_suppressions=0" \
    UBSAN_OPTIONS="suppressions=tests/sanitizers/undefined.supp:halt_on_error=1:print_stacktrace=1"
build/readers/tests/vio_reader_tests --gtest_brief=1
