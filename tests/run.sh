#!/bin/sh
# The tests: sh tests/run.sh            quick ones in float and in double, and the cheap part of portability.sh: 60 to 80 s
#                                      of processor time by the machine, half to compile (user + sys of `time`)
#            sh tests/run.sh --full     all but the slow tests, and all compilers, machines and sanitizers that are installed
#            sh tests/run.sh --nightly  the slow tests, too, and whether the tests catch mutants.sh
# CC and CFLAGS choose compiler and flags of tests/main.c. The last line counts. Quick tests are compiled at -Og with what pays of
# -O1: that compiles in two thirds of the time of -O1, and runs a third longer. What is not the header is not optimized, tests of
# other tiers are left out, and what inlines is left to the compiler.
# shellcheck disable=SC2086             # flags are split on purpose
set -u
cd "$(dirname "$0")/.." || exit 1
CC=${CC:-cc}; export CC
quick='-Og -fexpensive-optimizations -ftree-sra -ftree-pta -fmove-loop-invariants -fif-conversion'
echo 'int main(void) { return 0; }' | $CC $quick -S -x c - -o - > /dev/null 2>&1 || quick=-O1 # clang has them not
quick="$quick -Dalways_inline=unused -DGS4_TESTS_QUICK"
case "${1:-}" in
    '') slow='' part=quick level="$quick" ;;
    --full) slow=--full part=full level=-O2 ;;
    --nightly) slow=--slow part=full level=-O2 ;;
    *) echo "usage: sh tests/run.sh [--full | --nightly]"; exit 2 ;;
esac
tmp=$(mktemp -d) || exit 1
native=-march=native; echo 'int main(void) { return 0; }' | $CC $native -x c - -o "$tmp/native" 2> /dev/null || native=''
trap 'rm -rf "$tmp"' EXIT
trap 'exit 1' HUP INT TERM

# tests NAME FLAGS: tests/main.c in one precision
tests() {
    $CC $level $native ${CFLAGS:-} $2 -DGS4_FEW -DGS4_PTHREADS -pthread -I. tests/main.c -o "$tmp/$1" -lm && (cd "$tmp" && "./$1" $slow)
}

tests double -DGS4_DOUBLE > "$tmp/double.log" 2>&1 &
tests float '' > "$tmp/float.log" 2>&1
GS4_FEW=$tmp/float sh tests/portability.sh $part > "$tmp/portability.log" 2>&1
wait
logs='float double portability'
if [ "$slow" = --slow ]; then
    sh tests/mutants.sh > "$tmp/mutants.log" 2>&1
    logs="$logs mutants"
fi

passed=0 failed=0 skipped=0
for log in $logs; do
    echo "== $log"; cat "$tmp/$log.log"
    line=$(tail -n 1 "$tmp/$log.log" | grep -E '^[0-9]+ passed, [0-9]+ failed')
    [ -n "$line" ] || { echo "failed: $log did not finish"; line='0 passed, 1 failed'; }
    # shellcheck disable=SC2046
    set -- $(echo "$line" | tr -dc '0-9 ')
    passed=$((passed + $1)) failed=$((failed + $2)) skipped=$((skipped + ${3:-0}))
done
echo "== all"
[ $skipped -eq 0 ] || echo "$skipped skipped for want of a tool"
echo "$passed passed, $failed failed"
[ $failed -eq 0 ]
