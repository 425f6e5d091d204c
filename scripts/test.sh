#!/usr/bin/env bash
# Runs the tests: `sample` (what CI runs) or `all` (whole matrices, hours). Both need `make build` before.
#   release build   unit, simulation, thread and distributed tests
#   asan build      unit and simulation tests under AddressSanitizer and UBSan
#   tsan build      the daemon's own threads under ThreadSanitizer
set -euo pipefail
cd "$(dirname "$0")/.."
what=${1:-sample}

section() { printf '\n==== %s (%s)\n' "$1" "$(date +%H:%M:%S)"; }

section "sanitizer builds"
for preset in asan tsan; do
  cmake --preset "$preset" --log-level=WARNING
  cmake --build --preset "$preset"
done

exclude='|all$'
[ "$what" = all ] && exclude=

section "AddressSanitizer and UBSan"
ctest --test-dir build/asan --output-on-failure -j 2 -L '^(unit|simulation)$'

section "ThreadSanitizer"
ctest --test-dir build/tsan --output-on-failure -L '^thread$'

# What uses one core, side by side; then what starts daemons, or uses all.
section "release"
in_process='^(unit|simulation|accuracy)$'
ctest --test-dir build/release --output-on-failure -j 2 -L "$in_process"
ctest --test-dir build/release --output-on-failure -LE "$in_process$exclude"
