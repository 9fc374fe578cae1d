#!/bin/sh
# Do the tests have teeth? Each line of tests/mutants.txt changes one line of gs4mpm.h so that it is
# wrong; each must turn some test red. Prints the survivors and the lines that no longer apply, and
# fails if there are any. Runs at night: see run.sh.
#   sh tests/mutants.sh             all
#   sh tests/mutants.sh PATTERN     those whose line matches the pattern (grep -E)
#   sh tests/mutants.sh -n          none: only whether each line applies, and how many there are
# All of them are compiled into one program; the variable GS4_MUTANT says which one acts, 0: none.
# So two compilations, float and double, are enough; and with none the tests must be green.
# A mutant is tried on the tests named in its line, also with --full and then in double, then on all
# quick ones in float, in double, and on the full ones. CC as in run.sh; JOBS (2) mutants at a time; VERBOSE=1
# tells of all of them.
set -u
cd "$(dirname "$0")/.." || exit 1
CC=${CC:-cc}
JOBS=${JOBS:-2}
list=tests/mutants.txt
tmp=$(mktemp -d) || exit 1
trap 'rm -rf "$tmp"' EXIT
trap 'exit 1' HUP INT TERM

# The header with all mutants; those that do not apply to exactly one line, into $tmp/stale.
cat > "$tmp/mutate.awk" <<'AWK'
function times(text, part,    n, at) {
    for (n = 0; at = index(text, part); n++) text = substr(text, at + length(part))
    return n
}
FNR == NR {
    if (/^#/ || /^$/) next
    n = split($0, f, / @ /)
    count++
    name[count] = f[1]; old[count] = f[2]; new[count] = f[3]; whole[count] = $0
    of[f[1]] = of[f[1]] " " count
    next
}
{ line = $0 }
/^(#define )?[A-Za-z].*\(/ && !/;$/ {
    match($0, /\(/)
    inside = substr($0, 1, RSTART - 1)
    sub(/.*[ *]/, "", inside)
}
inside in of {
    n = split(of[inside], k, " ")
    for (i = 1; i <= n; i++) {
        m = k[i]
        if (!times($0, old[m])) continue
        found[m] += times($0, old[m]) == 1 && times(line, old[m]) == 1 ? 1 : 2
        at = index(line, old[m])
        if (old[m] ~ /;$/)
            text = "{ if (gs4i_mutant == " m ") { " new[m] " } else { " old[m] " } }"
        else
            text = "(gs4i_mutant == " m " ? (" new[m] ") : (" old[m] "))"
        line = substr(line, 1, at - 1) text substr(line, at + length(old[m]))
    }
}
{ print line }
/^}/ || (/^[A-Za-z].*}$/) { inside = "" }
END { for (m = 1; m <= count; m++) if (found[m] != 1) print whole[m] > stale }
AWK
: > "$tmp/stale"
awk -v stale="$tmp/stale" -f "$tmp/mutate.awk" $list gs4mpm.h > "$tmp/gs4mpm.h" || exit 1
sed 's/^/does not apply to exactly one line: /' "$tmp/stale"
stale=$(wc -l < "$tmp/stale")
grep -vE '^(#|$)' $list | awk '{ print NR " @ " $0 }' > "$tmp/numbered"
awk -v stale="$tmp/stale" '
    BEGIN { while ((getline line < stale) > 0) old[line] = 1 }
    { line = $0; sub(/^[0-9]+ @ /, "") } !($0 in old) { print line }' "$tmp/numbered" > "$tmp/all"
if [ "${1:-}" = -n ]; then
    echo "$(wc -l < "$tmp/all") apply, $stale do not"
    [ "$stale" -eq 0 ]; exit
fi

cat > "$tmp/choose.h" <<'EOC'
extern char *getenv(const char *);
extern int atoi(const char *);
static int gs4i_mutant;
__attribute__((constructor)) static void gs4i_choose_mutant(void)
{
    const char *number = getenv("GS4_MUTANT");
    gs4i_mutant = number ? atoi(number) : 0;
}
EOC
build() { # NAME FLAGS
    # shellcheck disable=SC2086
    $CC -O1 -w $2 -DGS4_PTHREADS -pthread -include "$tmp/choose.h" -I"$tmp" -I. tests/main.c \
        -o "$tmp/$1" -lm
}
if ! build float '' || ! build double -DGS4_DOUBLE; then
    echo '0 passed, 1 failed'; exit 1
fi
for program in float double; do
    (cd "$tmp" && GS4_MUTANT=0 "./$program" --stop > control 2>&1) && continue
    cat "$tmp/control"
    echo "the control is red: without a mutant the tests in $program fail"
    echo '0 passed, 1 failed'
    exit 1
done

# red MUTANT PROGRAM [TEST...]: success if a test fails, crashes or does not end
red() {
    mutant=$1 program=$2; shift 2
    mkdir -p "$tmp/at$mutant"
    # what takes much longer than it should does not end; all full tests may take an hour
    limit=900; [ "$*" = --full ] && limit=7200
    (cd "$tmp/at$mutant" && GS4_MUTANT=$mutant timeout $limit "../$program" --stop "$@") \
        > "$tmp/at$mutant/log" 2>&1 && return 1
    return 0
}

# try "NUMBER @ FUNCTION @ OLD @ NEW @ TESTS": prints how it went
try() {
    m=${1%% @ *} how=''
    tests=$(printf '%s\n' "$1" | awk -F ' @ ' '{ print $5 }')
    for test in $tests; do
        if red "$m" float "$test"; then how=hint; break; fi
    done
    for test in $tests; do
        [ -z "$how" ] && red "$m" float --full "$test" && how='hint, full'
        [ -z "$how" ] && red "$m" double --full "$test" && how='hint, full, double'
    done
    if [ -z "$how" ] && red "$m" float; then how=quick; fi
    if [ -z "$how" ]; then
        if red "$m" double; then how=double; elif red "$m" float --full; then how=full; fi
    fi
    if [ -n "$how" ]; then
        first=$(grep -o 'test_[a-z_0-9]*: failed' "$tmp/at$m/log" | head -n 1)
        echo "red by $how (${first%%:*}): ${1#* @ }"
    else
        echo "SURVIVES: ${1#* @ }"
    fi
    rm -rf "$tmp/at$m"
}

grep -E -- "${1:-.}" "$tmp/all" > "$tmp/list"
: > "$tmp/said"
worker() {
    awk -v jobs="$JOBS" -v mine="$1" 'NR % jobs == mine' "$tmp/list" | while IFS= read -r line; do
        try "$line" >> "$tmp/said"
    done
}
job=0
while [ "$job" -lt "$JOBS" ]; do worker "$job" & job=$((job + 1)); done
wait
[ -z "${VERBOSE:-}" ] || cat "$tmp/said"
grep '^SURVIVES' "$tmp/said"
survivors=$(grep -c '^SURVIVES' "$tmp/said")
echo "red by hint $(grep -c '^red by hint' "$tmp/said"), quick $(grep -c '^red by quick' "$tmp/said")," \
     "double $(grep -c '^red by double' "$tmp/said"), full $(grep -c '^red by full' "$tmp/said")"
echo "$(($(wc -l < "$tmp/said") - survivors)) passed, $((survivors + stale)) failed"
[ $((survivors + stale)) -eq 0 ]
