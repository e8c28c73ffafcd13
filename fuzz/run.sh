#!/usr/bin/env bash
# Gives every reader of foreign files damaged input under libFuzzer, SECONDS each, and says what was run: executions, coverage, faults.
#
# usage: fuzz/run.sh SECONDS [READER ...]        all readers of fuzz/readers/ unless named
#
# Needs a C++ compiler, for libFuzzer. Builds outside the clone, in a folder of its own: coverage counters go into every crate. Corpora grow in
# that folder, beside the inputs that broke a reader; `fuzz/corpus/` in the clone is where they begin and is not written to.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=$1
shift

# In the build folder of every other build, as setup/cargo.sh names it.
target=${CARGO_TARGET_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/vibes-toolkit/target}/fuzz
work=$target/work
host=$(rustc -vV | sed -n 's/^host: //p')
coverage="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters"
coverage+=" -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares"

# The versions that every other build uses. A target is named so that the counters stay out of build scripts.
cp Cargo.lock fuzz/Cargo.lock
RUSTC_BOOTSTRAP=1 RUSTFLAGS=$coverage cargo build --manifest-path fuzz/Cargo.toml --target "$host" --target-dir "$target"
export LD_LIBRARY_PATH=$PWD/third_party/made-by-make-setup${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
readers=$target/$host/debug/readers

mkdir -p "$work/corpus" "$work/faults"
cp -r fuzz/corpus/. "$work/corpus/"
VIBES_FUZZ_CORPUS=$work/corpus VIBES_FUZZ_ONLY=manifest "$readers" -runs=0 2>/dev/null
[ $# -gt 0 ] || set -- $(ls "$work/corpus")

faults=0
for reader; do
    log=$work/$reader.log
    VIBES_FUZZ_ONLY=$reader "$readers" "$work/corpus/$reader" -artifact_prefix="$work/faults/$reader-" -max_total_time="$seconds" \
        -rss_limit_mb=2048 -malloc_limit_mb=256 -timeout=60 -print_final_stats=1 >"$log" 2>&1 || faults=$((faults + 1))
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    coverage=$(grep -o 'cov: [0-9]*' "$log" | tail -1)
    echo "$reader: ${executions:-?} executions, ${coverage:-cov: ?}, $(ls "$work/faults" | grep -c "^$reader-" || true) faults"
done
[ "$faults" = 0 ] || { echo "$faults readers failed; their inputs are in $work/faults, what they said in $work/*.log" >&2; exit 1; }
