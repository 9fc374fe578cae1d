#!/bin/sh
# What compilers, linkers, sanitizers and other machines say about gs4mpm.h.
#   sh tests/portability.sh            everything; what is not installed is skipped and counted as such
#   sh tests/portability.sh quick      the cheap part
#   sh tests/portability.sh GROUP...   some groups: see the two lists below
# A group is a function of that name. Groups run side by side, JOBS at a time (2).
# shellcheck disable=SC2086             # flags are split on purpose
set -u
cd "$(dirname "$0")/.." || exit 1
CC=${CC:-cc}

quick='few_layout few_warnings few_hashes'
full='warnings tsan fused scenes hashes asan fuzz arm hashes_double wasm windows tiny musl i386 form layout names left_out units snippets link frames examples web'

# A transfer kernel may be longer than 60 lines; nothing else. This one is a transpose, spelled out.
long_functions='gs4i_from_lanes'
# Tests of tests/main.c that run on foreign machines too: parts of their names. All of them run where it costs no more than here.
few_tests='partitioned_bits partitioned_flight free_flight files_continue errors_desc errors_fill solid_stress poisson_shapes heat_walls phase_freezing'
# Words that stood for two things, or that the field does not use: no identifier or comment of gs4mpm.h has one.
retired='ghost rehears calm strayed hidden fading unseen turning kick frozen warmth afresh unsorted unturned mouth nozzle obstacle'
# What the library may ask of libc; all of libm is allowed, and with GS4_PTHREADS what is named here.
libc='calloc|free|mem(cpy|move|set|cmp)|str(len|cmp|chr)|f(open|close|read|write|flush|error)|rename|remove|stat|readlink|__assert_fail'
pthreads='pthread_((mutex|cond)_[a-z]+|create|join)'

strict='-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wdouble-promotion -Wcast-qual -Wundef -Werror'
strict_c="$strict -Wstrict-prototypes -Wmissing-prototypes"

# ==== counting =================================================================================================

passed=0 failed=0 skipped=0

# check NAME COMMAND...: passes if the command succeeds; else shows what it said
check() {
    name=$1; shift
    if "$@" > "$tmp/said" 2>&1; then passed=$((passed + 1)); return 0; fi
    failed=$((failed + 1))
    echo "failed: $group: $name"; sed 's/^/    /;25q' "$tmp/said"
    return 1
}

refused() { ! "$@"; }

skip() { skipped=$((skipped + 1)); echo "skipped: $group: $1"; }

# have TOOL: is it there? If not, that is counted and said.
have() {
    command -v "$1" > /dev/null 2>&1 || { skip "needs $1"; return 1; }
}

finish() {
    if [ $skipped -gt 0 ]; then echo "$passed passed, $failed failed, $skipped skipped"; else echo "$passed passed, $failed failed"; fi
    [ $failed -eq 0 ]
}

# ==== sources to compile =======================================================================================

write_sources() {
    printf '#include "gs4mpm.h"\n#include "gs4mpm.h"\ngs4_view use(const gs4_sim *s);\ngs4_view use(const gs4_sim *s) { return gs4_particles(s, GS4_FIELD_POSITION); }\n' > "$tmp/declarations.c"
    printf '#include "gs4mpm.h"\n#define GS4MPM_IMPLEMENTATION\n#include "gs4mpm.h"\n#include "gs4mpm.h"\n' > "$tmp/implementation.c"
    cat > "$tmp/user.c" << 'END'
#include "gs4mpm.h"
int main(void)
{
    gs4_sim *sim;
    gs4_sim_desc d = { { 8, 8, 8 }, 1 };
    return gs4_version() != GS4_VERSION || gs4_real_size() != (int)sizeof(gs4_real) || gs4_create(&d, &sim) != GS4_OK
        || (gs4_destroy(sim), 0);
}
END
    cat > "$tmp/half.c" << 'END'                    # of a program in both precisions
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#ifdef GS4_DOUBLE
int in_double(void);
int in_double(void) { return gs4_real_size() == 8 && sizeof(gs4_box) > 0; }
#else
int in_double(void);
int main(void) { return !(gs4_real_size() == 4 && in_double()); }
#endif
END
    cat > "$tmp/fused.c" << 'END'                   # the user's own a * b + c: the header must leave its rounding alone
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
double users_own(double a, double b, double c);
double users_own(double a, double b, double c) { return a * b + c; }
END
    for f in declarations implementation user half; do cp "$tmp/$f.c" "$tmp/$f.cpp"; done
}

# ==== warnings =================================================================================================

# parses BUILD FILE...: strictly, in each configuration; what an optimizer sees is asked with -O2 below
configurations() {
    for real in '' -DGS4_DOUBLE; do for threads in '' -DGS4_PTHREADS; do for linkage in '' -DGS4_STATIC; do
        check "$1 $real $threads $linkage" $1 $real $threads $linkage -I. -fsyntax-only "$tmp/implementation.$2"
    done; done; done
}

warnings() {
    for cc in gcc clang; do
        have $cc || continue
        for std in c99 c11 c17; do configurations "$cc -std=$std $strict_c" c; done
        for real in '' -DGS4_DOUBLE; do
            check "$cc declarations $real" $cc -std=c99 $strict_c $real -I. -S -o /dev/null "$tmp/declarations.c"
            check "$cc -O2 $real" $cc -std=c99 -O2 $strict_c $real -I. -S -o /dev/null "$tmp/implementation.c"
        done
        check "$cc without assertions and vectors" $cc -std=c99 -O1 $strict_c -DNDEBUG -DGS4_NO_VECTORS -I. -S -o /dev/null "$tmp/implementation.c"
    done
    for cc in g++ clang++; do
        have $cc || continue
        for std in c++11 c++14 c++17 c++20; do configurations "$cc -std=$std $strict" cpp; done
        check "$cc declarations" $cc -std=c++11 $strict -I. -S -o /dev/null "$tmp/declarations.cpp"
    done
}

few_warnings() {
    check "$CC" $CC -std=c99 $strict_c -DGS4_PTHREADS -I. -fsyntax-only "$tmp/implementation.c"
    check "$CC declarations" $CC -std=c99 $strict_c -I. -fsyntax-only "$tmp/declarations.c"
    have clang && check "clang -DGS4_DOUBLE" clang -std=c11 $strict_c -DGS4_DOUBLE -I. -fsyntax-only "$tmp/implementation.c"
    have g++ && check "g++ -DGS4_STATIC -DGS4_NO_VECTORS" g++ -std=c++11 $strict -DGS4_STATIC -DGS4_NO_VECTORS -I. -fsyntax-only "$tmp/implementation.cpp"
}

# ==== what is left out =========================================================================================

# left_out_of COMPILER SWITCH...: refuses what it is without, and has the hash of one that is without nothing
left_out_of() {
    check "$*" "$@" -O1 -I. tests/left_out.c -o "$tmp/left_out" -lm || return
    (cd "$tmp" && ./left_out) > "$tmp/left_out.hash" 2>&1
    check "$* refuses that" test $? -eq 0
    check "$* has the same bits else" cmp "$tmp/left_out.hash" "$tmp/whole.hash"
}

left_out() {
    all='-DGS4_NO_VISCOELASTIC -DGS4_NO_SOLIDS -DGS4_NO_HEAT -DGS4_NO_IMPLICIT -DGS4_NO_FILES'
    check "nothing" $CC -O1 -I. tests/left_out.c -o "$tmp/whole" -lm || return
    (cd "$tmp" && ./whole) > "$tmp/whole.hash" 2>&1
    check "works" test $? -eq 0
    for switch in $all "$all"; do left_out_of $CC -std=c99 $strict_c $switch; done
    have clang && left_out_of clang -std=c99 $strict_c $all
    have g++ && left_out_of g++ -std=c++11 -x c++ $strict $all
    have tcc && check "tcc" tcc -Wall -Werror $all -I. -c "$tmp/implementation.c" -o "$tmp/left_out.o"
    $CC -O1 -DGS4_DOUBLE -I. tests/left_out.c -o "$tmp/whole" -lm && (cd "$tmp" && ./whole) > "$tmp/whole.hash" 2>&1
    left_out_of $CC -std=c99 $strict_c -DGS4_DOUBLE $all
}

# ==== several translation units ================================================================================

# object NAME FILE BUILD...: $tmp/NAME.o
object() { name=$1 file=$2; shift 2; check "$* $file" "$@" -I. -c "$tmp/$file" -o "$tmp/$name.o"; }

# linked LINKER OBJECT OBJECT
linked() { $1 "$tmp/$2.o" "$tmp/$3.o" -o "$tmp/linked" -lm; }
runs_linked() { linked "$@" && "$tmp/linked"; }

units() {
    for f in user implementation; do object $f $f.c $CC; object ${f}64 $f.c $CC -DGS4_DOUBLE; done
    object half half.c $CC; object half64 half.c $CC -DGS4_DOUBLE
    check "two units" runs_linked $CC user implementation
    check "two units in double" runs_linked $CC user64 implementation64
    check "float and double in one program" runs_linked $CC half half64
    check "a user in float does not link with an implementation in double" refused linked $CC user implementation64
    check "nor the other way round" refused linked $CC user64 implementation
    have g++ || return
    for f in user implementation; do object ${f}_cpp $f.cpp g++; done
    check "C++ uses C" runs_linked g++ user_cpp implementation
    check "C uses C++" runs_linked g++ user implementation_cpp
}

# Programs in the manual and in README.md, each of which has a main
snippets() {
    sed -n 's/^ \*     //p' gs4mpm.h | awk '/^#include <stdio.h>/ { on = 1 } on; on && /^}/ { exit }' > "$tmp/snippet0.c"
    awk -v name="$tmp/snippet" '/^```/ { on = /^```c$/; n += on; next } on { print > (name n ".c") }' README.md 2> "$tmp/m" || skip "no README.md yet"
    for f in $(grep -l 'int main' "$tmp"/snippet*.c); do
        check "$(head -n 3 "$f" | tail -n 1)" $CC -std=c99 -Wall -Wpedantic -Werror -I. "$f" -o "$tmp/linked" -lm
    done
}

# ==== names ====================================================================================================

exported() { $CC "$@" -I. -c "$tmp/implementation.c" -o "$tmp/names.o" && nm -g --defined-only "$tmp/names.o" | awk '{ print $NF }' | sort; }

macros() { $CC -std=c99 "$@" -I. -dM -E - | sed 's/(.*/ /' | awk '{ print $2 }' | sort -u; }

# new_macros FLAGS... < SOURCE: those that the header leaves beside what its own includes do
new_macros() {
    cat > "$tmp/macros.c"
    macros "$@" < "$tmp/macros.c" > "$tmp/after"
    { sed -n 's/^ *#include </#include </p' gs4mpm.h | grep -v pthread; printf '#ifdef GS4_PTHREADS\n#include <pthread.h>\n#endif\n'; } | macros "$@" > "$tmp/before"
    comm -23 "$tmp/after" "$tmp/before"
}

tags_of() { ctags -x --language-force=C --kinds-C=+plzm -I GS4I_INLINE+,GS4_API+,GS4I_RESTRICT+,GS4I_THREAD_LOCAL+ --sort=no --_xformat='%K %N %n' gs4mpm.h; }
implementation_line() { grep -n 'defined(GS4MPM_IMPLEMENTATION)' gs4mpm.h | head -n 1 | cut -d: -f1; }

names() {
    have nm || return
    sed -n 's/^#define \(gs4_[a-z0-9_]*\)  *gs4_[a-z0-9_]*_f64$/\1/p' gs4mpm.h | sort > "$tmp/block"
    sed 's/$/_f64/' "$tmp/block" | sort > "$tmp/block64"
    exported > "$tmp/float"; exported -DGS4_DOUBLE > "$tmp/double"; exported -DGS4_PTHREADS > "$tmp/threads"; exported -DGS4_STATIC > "$tmp/static"
    check "the #define block of GS4_DOUBLE is the set of exported functions" diff "$tmp/float" "$tmp/block"
    check "in double all end in _f64" diff "$tmp/double" "$tmp/block64"
    check "with threads the same" diff "$tmp/float" "$tmp/threads"
    check "none with GS4_STATIC" refused grep . "$tmp/static"
    new_macros < "$tmp/declarations.c" | grep -vxE 'GS4_[A-Z0-9_]+|GS4MPM_H' > "$tmp/m"
    check "declarations leave macros in GS4_ only" refused grep . "$tmp/m"
    for flags in '' -DGS4_DOUBLE -DGS4_PTHREADS -DGS4_STATIC -DGS4_NO_VECTORS -mavx512f; do
        new_macros $flags < "$tmp/implementation.c" 2> /dev/null | grep -vxFf "$tmp/block" | grep -vxE 'GS4_[A-Z0-9_]+|GS4MPM_(H|IMPLEMENTATION)|GS4I_IMPLEMENTED'
    done > "$tmp/m"
    check "so does the implementation, but for its guard" refused grep . "$tmp/m"
    grep -niE "(^|[^a-z])($(echo $retired | tr ' ' '|'))" gs4mpm.h > "$tmp/m"
    check "no word that is retired" refused grep . "$tmp/m"
    have ctags || return
    tags_of | grep -v ' __anon' > "$tmp/tags"
    half=$(implementation_line)
    grep -E ' (_|[^ ]*__)' "$tmp/tags" > "$tmp/m"
    check "no identifier begins with an underscore or has two" refused grep . "$tmp/m"
    grep -vE '^(local|member|parameter) | (gs4i?_|GS4I?_|GS4MPM_H )' "$tmp/tags" > "$tmp/m"
    check "all of file scope is gs4_ or gs4i_" refused grep . "$tmp/m"
    awk -v half="$half" '$3 < half { public[$2] = 1 } $3 >= half && $2 ~ /^(gs4|GS4)_/ && !public[$2]' "$tmp/tags" > "$tmp/m"
    check "what only the implementation has is gs4i_ or GS4I_" refused grep . "$tmp/m"
    grep '^prototype gs4i_' "$tmp/tags" > "$tmp/m"
    check "no private function is declared ahead" refused grep . "$tmp/m"
}

# ==== layout ===================================================================================================

banners() { grep -n '^/\* ==== \[\[' gs4mpm.h | sed 's/^\([0-9]*\):.*\[\[\(.*\)\]\].*/\1 \2/'; }

# The part of the implementation before line $1, closed: as many #endif as are open
prefix() {
    echo '#define GS4MPM_IMPLEMENTATION'
    head -n $(($1 - 1)) gs4mpm.h
    head -n $(($1 - 1)) gs4mpm.h | awk '/^#if/ { n++ } /^#endif/ { n-- } END { while (n-- > 0) print "#endif" }'
}

compiles_until() { prefix "$1" > "$tmp/prefix.c" && $CC -std=c99 -fsyntax-only -Wall -Wextra -Wpedantic -Werror -Wno-unused -DGS4_PTHREADS "$tmp/prefix.c"; }

# .clang-format, and what it does not hold: comments within 100 columns (manual and reference tables aside)
form() {
    have clang-format || return
    sources=$(ls gs4mpm.h tests/*.[ch] bench/*.[ch] bench/peers/*.c examples/*.[ch] examples/web/*.c)
    check "all sources have the form of .clang-format" clang-format --dry-run --Werror $sources
    awk 'FNR == 1 { data = 0 } /clang-format off/ { data = 1 } /clang-format on/ { data = 0 }
         length > 100 && !data { print FILENAME ":" FNR }' $sources examples/web/*.html examples/web/*.mjs > "$tmp/m"
    check "no line is wider than 100 columns" refused grep . "$tmp/m"
}

few_layout() {
    banners > "$tmp/banners"; cut -d' ' -f2 "$tmp/banners" > "$tmp/sections"
    awk -v half="$(implementation_line)" -v upper="$tmp/upper" -v lower="$tmp/lower" '{ print $2 > ($1 < half ? upper : lower) }' "$tmp/banners"
    { sort "$tmp/upper" | uniq -d; sort "$tmp/lower" | uniq -d; } > "$tmp/m"
    check "no tag twice in one half" refused grep . "$tmp/m"
    grep -xFf "$tmp/lower" "$tmp/upper" > "$tmp/order_upper"; grep -xFf "$tmp/upper" "$tmp/lower" > "$tmp/order_lower"
    check "tags of both halves in the same order" diff "$tmp/order_upper" "$tmp/order_lower"
    grep -o '\[\[[a-z0-9_]*\]\]' gs4mpm.h | tr -d '[]' | sort -u | grep -vxFf "$tmp/sections" > "$tmp/m"
    check "every [[tag]] that is spoken of is a section" refused grep . "$tmp/m"
    # the manual's map: lines before the first banner that begin with a tag; left column, then right column
    head -n "$(head -n 1 "$tmp/banners" | cut -d' ' -f1)" gs4mpm.h | sed '$d' | grep '^[ *]*\[\[' > "$tmp/m"
    { sed -n 's/^[ *]*\[\[\([a-z0-9_]*\)\]\].*\[\[.*/\1/p' "$tmp/m"; sed 's/.*\[\[\([a-z0-9_]*\)\]\].*/\1/' "$tmp/m"; } > "$tmp/map"
    check "the map in the manual" diff "$tmp/map" "$tmp/sections"
    awk '/^[A-Za-z].*\(/ { head = $0; first = NR } /^\{$/ { start = first } /^\}/ { n = NR - start + 1; if (start && n > 60) print n, head; start = 0 }' gs4mpm.h > "$tmp/long"
    for f in $long_functions; do grep -v "[ *]$f(" "$tmp/long" > "$tmp/m"; cp "$tmp/m" "$tmp/long"; done
    check "no function is longer than 60 lines" refused grep . "$tmp/long"
    awk '/^[A-Za-z].*\(/ { head = "" } { head = head $0 }
         /^\{$/ { n = gsub(/,/, ",", head); if (n > 7) print n + 1, substr(head, 1, 80); head = "" } /;$/ { head = "" }' gs4mpm.h > "$tmp/m"
    check "no function has more than 8 parameters" refused grep . "$tmp/m"
}
layout() {
    few_layout
    while read -r line tag; do
        [ "$line" -lt "$(implementation_line)" ] || check "all before [[$tag]] compiles without the rest" compiles_until "$line"
    done < "$tmp/banners"
}

# ==== the same bits ============================================================================================

# det BUILD ARGUMENTS: builds tests/determinism.c if that build is not there yet, and runs it. All groups share that of the reference.
det() {
    program=$tmp/det$(echo "$1 $real" | cksum | tr ' ' _)
    [ "$1" = "$threaded" ] && program=${GS4_SHARED:-$tmp}/reference$real
    built_once "$program" $1 $real -I. tests/determinism.c && (cd "$tmp" && "$program" $scene steps=$steps ${2:-})
}

# built_once PROGRAM BUILD...: unless it is there; a group that wants it meanwhile waits
built_once() (
    [ -z "${GS4_SHARED:-}" ] || { exec 9> "$1.lock"; flock 9; }
    [ -x "$1" ] || { program=$1; shift; "$@" -o "$program" -lm; }
)

# same NAME BUILD ARGUMENTS: prints what the reference printed
same() { check "$1 $scene $real" prints_same "$2" "$3"; }
prints_same() { det "$@" > "$tmp/det.out" && tr -d '\r' < "$tmp/det.out" | diff "$tmp/reference" -; }

# reference REAL STEPS: what this compiler gives, to compare all others with
scene=''
threaded="$CC -O2 -DGS4_PTHREADS -pthread"
reference() {
    real=$1 steps=$2
    det "$threaded" > "$tmp/reference"
}

# Numbers of threads, tasks in another order, from a checkpoint
ways='threads=1 threads=2 threads=3 threads=8 shuffle=1 checkpoint=checkpoint'
threads_and_checkpoint() {
    for how in $ways; do same "$how" "$threaded" $how; done
}

# The program of tests/main.c with -DGS4_FEW; run.sh has it already
few_prints() { (cd "$tmp" && "$few" few steps=10 "$@"); }
few_same() { few_prints "$@" | diff "$tmp/reference" -; }
few_hashes() {
    few=${GS4_FEW:-$tmp/few}
    [ -x "$few" ] || check "few.c" $CC -O0 -w -DGS4_FEW -DGS4_PTHREADS -pthread -I. tests/main.c -o "$few" -lm
    few_prints > "$tmp/reference"
    for how in $ways; do check "$how" few_same $how; done
    check "a few scenes of the fuzzer" sh -c 'cd "$1" && "$2" few fuzz 1 5' few "$tmp" "$few"
}

all_hashes() {
    reference "$1" 250
    for cc in gcc clang; do
        have $cc || continue
        for level in '-O0 -std=c99' '-O3 -march=native'; do same "$cc $level" "$cc $level" ""; done
    done
    have g++ && same "g++" "g++ -x c++ -O1" ""
    same "GS4_NO_VECTORS" "$CC -O1 -DGS4_NO_VECTORS" ""
    threads_and_checkpoint
}
# 100 random scenes of everything, bodies that turn about general axes among them: every build of a
# compiler gives the same hashes.
scenes() {
    for cc in gcc clang; do
        have $cc || continue
        [ $cc = gcc ] && level=-O2 || level='-O3 -march=native'
        $cc $level -w -I. tests/random_scenes.c -o "$tmp/scenes" -lm && "$tmp/scenes" steps=10 > "$tmp/scenes.hashes"
        check "$cc $level: 100 scenes" grep '^100 scenes' "$tmp/scenes.hashes"
        [ $cc = clang ] || check "gcc -O3 -march=native" same_scenes gcc '-O3 -march=native'
        check "$cc -O0, threads" same_scenes $cc '-O0 -DGS4_PTHREADS -pthread'
    done
}
same_scenes() {
    threads=; [ "$2" = "${2#*PTHREADS}" ] || threads=threads=3
    $1 $2 -w -I. tests/random_scenes.c -o "$tmp/scenes" -lm && "$tmp/scenes" steps=10 $threads | diff "$tmp/scenes.hashes" -
}

hashes() { all_hashes ""; bunnies; history; }
hashes_double() { all_hashes -DGS4_DOUBLE; }

bunnies() {
    scene=scene=bunny
    reference "" 250
    for level in '-O0 -std=c99' '-O3 -march=native'; do same "$level" "$CC $level" ""; done
    threads_and_checkpoint
    scene=''
}

# Stress that depends on what was before: the robust paths of single particles among them
history() {
    for scene in elastic=1 solid=1 heat=1; do
        reference "" 200
        for level in '-O0 -std=c99' '-O3 -march=native'; do same "$level" "$CC $level" ""; done
        same "GS4_NO_VECTORS" "$CC -O1 -DGS4_NO_VECTORS" ""
        threads_and_checkpoint
    done
    scene=''
}

# Products and sums rounded once: what x86-64 and aarch64 call them
fused_product='^[[:space:]]*v?f(n?m(add|sub|la|ls|ad|sb)|cmla)'

# unfused COMPILER...: the header holds none of them, whatever a user asks for
unfused() { "$@" -I. -S "$tmp/implementation.c" -o "$tmp/unfused.s" && refused grep -E "$fused_product" "$tmp/unfused.s"; }

# fuses COMPILER...: the user's own are still fused where they asked for it
fuses() { "$@" -I. -S "$tmp/fused.c" -o "$tmp/fused.s" && sed -n '/^users_own:/,/ret/p' "$tmp/fused.s" | grep -E "$fused_product"; }

# fused_for COMPILER FLAGS...: in both precisions
fused_for() {
    for real in '' -DGS4_DOUBLE; do check "$* $real" unfused "$@" $real; done
}
# gcc fuses while it vectorizes: in float as eagerly as any flag makes it, in double as users ask. clang's front end decides what may
# be fused, which -O0 shows; its -ffp-contract=fast does not ask the source.
fused() {
    for cc in gcc clang; do
        have $cc || continue
        $cc -march=x86-64-v4 -E -x c /dev/null > /dev/null 2>&1 || { skip "needs $cc for x86-64"; continue; }
        check "$cc: contraction of the code around is as it was" fuses $cc -O2 -mfma -ffp-contract=fast
        fused_for $cc -O0 -mfma
        [ $cc = gcc ] || { check "$cc -O2 -march=x86-64-v3" unfused $cc -O2 -march=x86-64-v3; continue; }
        fused_for gcc -O2 -march=x86-64-v3
        check "gcc, eager" unfused gcc -O3 -march=x86-64-v4 -ffp-contract=fast -ftree-slp-vectorize -fvect-cost-model=unlimited
        check "gcc -O3 -march=x86-64-v4 -DGS4_DOUBLE" unfused gcc -O3 -march=x86-64-v4 -DGS4_DOUBLE
    done
    have aarch64-linux-gnu-gcc || return
    check "aarch64: contraction of the code around is as it was" fuses aarch64-linux-gnu-gcc -O2
    # armv8.3-a has all that armv8-a has, and products of complex numbers
    fused_for aarch64-linux-gnu-gcc -O3 -march=armv8.3-a
    have clang && fused_for clang --target=aarch64-linux-gnu -isystem /usr/aarch64-linux-gnu/include -O0 -march=armv8.3-a
}

# ==== sanitizers ===============================================================================================

# sanitized_det BUILD ARGUMENTS: tests/determinism.c, built once
sanitized_det() {
    program=$tmp/det$(echo "$1" | cksum | tr ' ' _)
    [ -x "$program" ] || $1 -g1 -w -DGS4_PTHREADS -pthread -I. tests/determinism.c -o "$program" -lm || return 1
    "$program" steps=100 $2
}
sanitized_main() { $1 -g1 -O1 -Dalways_inline=unused -fno-var-tracking-assignments -w -DGS4_PTHREADS -pthread -I. tests/main.c -o "$tmp/main" -lm && "$tmp/main" ${2:-}; }

# Sanitizers take ten times as long: all quick tests, and the full ones that go where no quick one does.
robust='files_memory files_forged mesh_memory mesh_fan poisson_same_bits stress_random symmetry_all symmetry_bodies solid_extremes stability_of_blades
    partitioned_moduli contact_pairs contact_balls'

asan() {
    if have clang; then
        # -O0: arrays in place of vectors take clang 14 more than eight minutes at -O1
        build="clang -O0 -fsanitize=address,undefined -fno-sanitize-recover=all"
        check "clang determinism" sanitized_det "$build" "threads=2 elastic=1 steps=50 checkpoint=$tmp/checkpoint frames=$tmp/frame"
        check "clang determinism of solids" sanitized_det "$build" "threads=2 solid=1 steps=50 checkpoint=$tmp/checkpoint frames=$tmp/frame"
        check "clang determinism of heat" sanitized_det "$build" "threads=2 heat=1 steps=50 checkpoint=$tmp/checkpoint frames=$tmp/frame"
        check "clang determinism in double" sanitized_det "$build -DGS4_DOUBLE -DGS4_NO_VECTORS" "checkpoint=$tmp/checkpoint"
    fi
    have gcc || return
    check "quick tests" sanitized_main "gcc -fsanitize=address,undefined -fno-sanitize-recover=all"
    for t in $robust; do check "tests $t" "$tmp/main" $t; done
}

# fuzzed BUILD FIRST COUNT: random scenes and calls
fuzzed() { $1 -DGS4_PTHREADS -pthread -I. tests/fuzz.c -o "$tmp/fuzz" -lm && "$tmp/fuzz" $2 $3; }
fuzz() {
    check "calls each public function" sh -c 'for f in $(sed -n "s/^#define \(gs4_[a-z_]*\) gs4_[a-z_]*_f64$/\1/p" gs4mpm.h); do grep -q "$f(" tests/fuzz.c tests/random_scene.h || { echo "$f"; exit 1; }; done'
    have gcc || return
    build="gcc -O1 -Dalways_inline=unused -g1 -fno-var-tracking-assignments -w -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
    check "in float" fuzzed "$build" 1 80
    check "in double" fuzzed "$build -DGS4_DOUBLE" 1101 50
}

tsan() {
    have gcc || return
    for n in 2 3; do check "determinism on $n threads" sanitized_det "gcc -O1 -fsanitize=thread" "threads=$n checkpoint=$tmp/checkpoint"; done
    check "determinism of stress on 2 threads" sanitized_det "gcc -O1 -fsanitize=thread" "threads=2 elastic=1"
    check "determinism of solids on 2 threads" sanitized_det "gcc -O1 -fsanitize=thread" "threads=2 solid=1"
    check "determinism of heat on 2 threads" sanitized_det "gcc -O1 -fsanitize=thread" "threads=2 heat=1"
    check "tests of files" sanitized_main "gcc -fsanitize=thread" files
}

# ==== other compilers and machines =============================================================================

# few_of_main RUNNER: some of the tests; a part of which no test is run is a failure
few_of_main() {
    for t in $few_tests; do
        (cd "$tmp" && $1 "./main$suffix" "$t") > "$tmp/main.out" 2>&1 && grep '^[1-9][0-9]* passed' "$tmp/main.out" || { cat "$tmp/main.out"; return 1; }
    done
}

# main_prints STEPS RUNNER: what the reference printed, also when it goes on from a checkpoint
main_prints() {
    (cd "$tmp" && $2 "./main$suffix" few steps=$1 checkpoint=checkpoint) > "$tmp/main.out" && tr -d '\r' < "$tmp/main.out" | diff "$tmp/reference" -
}

# -O1, and what inlines is left to the compiler: that compiles in two thirds of the time.
# machine BUILD WARNINGS STEPS [RUNNER SUFFIX]: strict, and the hashes of this machine, in both precisions; some tests in the first
machine() {
    tests=some
    for precision in ${precisions:-'' -DGS4_DOUBLE}; do
        reference "$precision" "$3"; suffix=${5:-}
        check "strict $precision" $1 -std=c99 $2 $precision -I. -c "$tmp/implementation.c" -o "$tmp/strict.o"
        check "tests/main.c $precision" $1 -O1 -Dalways_inline=unused -w $precision -DGS4_FEW -DGS4_FEW_HASHES -I. tests/main.c -o "$tmp/main$suffix" -lm || continue
        check "hashes $precision" main_prints "$3" "${4:-}"
        [ -z "$tests" ] || check "some tests $precision" few_of_main "${4:-}"
        tests=
    done
}

# In double only: tcc 0.9.27 stores a returned struct of three floats as four, over whatever lies behind it
tiny() {
    have tcc || return
    check "compiles in float" tcc -Wall -Werror -I. -c "$tmp/implementation.c" -o "$tmp/strict.o"
    precisions=-DGS4_DOUBLE; machine tcc "-Wall -Werror" 100
}
musl() { have musl-gcc && machine "musl-gcc -static" "$strict_c" 100; }
i386() {
    echo 'int main(void) { return 0; }' | gcc -m32 -x c - -o "$tmp/m32" -lm 2> /dev/null || { skip "needs gcc-multilib"; return; }
    machine "gcc -m32 -msse2 -mfpmath=sse" "$strict_c" 100
}
arm() {
    have aarch64-linux-gnu-gcc || return
    qemu=$(command -v qemu-aarch64-static || command -v qemu-aarch64) || { have qemu-aarch64; return; }
    machine "aarch64-linux-gnu-gcc -static" "$strict_c" 20 "$qemu"
}

# wine starts nothing now and then, on a busy machine; a program of ours that began has printed its test's name
wined() {
    for try in 1 2 3; do
        wine "$@" > "$tmp/wined"; code=$?
        [ -s "$tmp/wined" ] && break
        echo "wine printed nothing, exit $code, try $try" >> "$tmp/wined.log"; sleep 2
    done
    cat "$tmp/wined"
    return $code
}
windows() {
    have x86_64-w64-mingw32-gcc || return
    check "threads" x86_64-w64-mingw32-gcc -std=c99 $strict_c -DGS4_PTHREADS -I. -c "$tmp/implementation.c" -o "$tmp/strict.o"
    check "links" x86_64-w64-mingw32-gcc -static -pthread -I. "$tmp/user.c" "$tmp/strict.o" -o "$tmp/linked.exe" -lm
    have wine || return
    WINEPREFIX=$tmp/wine WINEDEBUG=-all; export WINEPREFIX WINEDEBUG
    wine "$tmp/linked.exe" > /dev/null 2>&1                            # its first run sets it up
    machine "x86_64-w64-mingw32-gcc -static" "$strict_c" 100 wined .exe
    wineserver -w                                                      # until it has written its last
    [ ! -s "$tmp/wined.log" ] || cat "$tmp/wined.log"
}
have_wasi() {
    have clang && have node || return
    echo 'int main(void) { return 0; }' | clang --target=wasm32-wasi -x c - -o "$tmp/wasi" 2> /dev/null || { skip "needs wasi-libc, lld and libclang-rt for wasm32"; return 1; }
}
wasm() {
    have_wasi || return
    cat > "$tmp/run.mjs" << 'END'
import { readFileSync } from 'node:fs';
import { WASI } from 'node:wasi';
const wasi = new WASI({ version: 'preview1', args: process.argv.slice(2), preopens: { '.': '.' } });
const module = await WebAssembly.compile(readFileSync(process.argv[2]));
process.exitCode = wasi.start(await WebAssembly.instantiate(module, wasi.getImportObject())) ?? 0;
END
    machine "clang --target=wasm32-wasi -Wl,-z,stack-size=262144 -D_WASI_EMULATED_PROCESS_CLOCKS -lwasi-emulated-process-clocks" "$strict_c -Wno-unused-command-line-argument" \
        100 "node --no-warnings run.mjs" .wasm
}

# ==== files and linking ========================================================================================

frames() {
    for python in python3 /usr/bin/python3 ''; do [ -n "$python" ] && $python -c 'import numpy, meshio' 2> /dev/null && break; done
    [ -n "$python" ] || { skip "needs python3 with numpy and meshio"; return; }
    cat > "$tmp/frames.py" << 'END'
import sys, numpy, meshio
name, real = sys.argv[1:]
text = numpy.loadtxt(name + '.txt')
columns = [('x', 0), ('y', 1), ('z', 2), ('vx', 3), ('vy', 4), ('vz', 5), ('volume_ratio', 12), ('mass', 13), ('id', 14), ('material', 15)]
ply, raw = meshio.read(name + '.ply'), numpy.load(name + '.npy')
assert len(text) > 1000 and text[:, 15].max() == 1
assert raw.shape == (len(text),) and raw['velocity'].dtype == real and ply.points.dtype == real
for key, c in columns:
    read = ply.points[:, c] if c < 3 else ply.point_data[key]
    assert (read == text[:, c]).all(), 'PLY: ' + key
    read = raw['position'][:, c] if c < 3 else raw['velocity'][:, c - 3] if c < 6 else raw[key]
    assert (read == text[:, c]).all(), 'npy: ' + key
for c, key in enumerate(['xx', 'yy', 'zz', 'xy', 'xz', 'yz']):
    assert (ply.point_data['stress_' + key] == text[:, 6 + c]).all() and (raw['stress'][:, c] == text[:, 6 + c]).all(), key
assert numpy.abs(text[:, 6:12]).max() > 0
END
    for real in float32 float64; do
        [ $real = float64 ] && flag=-DGS4_DOUBLE || flag=''
        check "PLY and npy in $real are read back as they were" frames_agree $real $flag
    done
}
frames_agree() {
    $CC -O2 ${2:-} -I. tests/determinism.c -o "$tmp/det" -lm && "$tmp/det" steps=50 elastic=1 frames="$tmp/frame" && $python "$tmp/frames.py" "$tmp/frame" $1
}

link() {
    have nm && have readelf || return
    nm -D --defined-only "$($CC -print-file-name=libm.so.6)" 2> /dev/null | awk '{ print $NF }' | sed 's/@.*//' > "$tmp/libm"
    check "asks of libc and libm what it may" asks_only "$libc" ""
    check "and of threads" asks_only "$libc|$pthreads" -DGS4_PTHREADS
    check "a program needs no other library" needs_only
}
asks_only() {
    $CC -fno-stack-protector -U_FORTIFY_SOURCE $2 -I. -c "$tmp/implementation.c" -o "$tmp/link.o" || return 1
    nm -u "$tmp/link.o" | awk '{ print $NF }' | grep -vxF -f "$tmp/libm" | grep -vxE "$1|_GLOBAL_OFFSET_TABLE_" > "$tmp/m"
    refused grep . "$tmp/m"
}
needs_only() {
    $CC -I. "$tmp/user.c" "$tmp/link.o" -o "$tmp/linked" -lm || return 1
    readelf -d "$tmp/linked" | grep NEEDED | grep -vE '\[(lib[cm]\.|ld-)' > "$tmp/m"
    refused grep . "$tmp/m"
}

# ==== examples and benches =====================================================================================

# builds LEVEL FILE PROGRAM FLAGS...: by the line in the comment at its head, which must be there, but quickly
builds() {
    level=$1; shift
    line=$(sed -n 's/^[ *]*g*cc -O3 \(.*\)/\1/p' "$1" | head -n 1 | sed 's/ -o .*//; s/\\$//') program=$2
    [ -n "$line" ] || { echo "no line to build it with"; return 1; }
    shift 2
    $CC $level $line -Wall -Wno-unused-function -Werror "$@" -lm -lpthread -o "$program"
}

# shows FILE PROGRAM [ROW]: one frame, and whether picture and particles are there where it writes such
shows() {
    name=$(basename "$1" .c)${3:+_$3}; mkdir -p "$tmp/out"
    "$2" ${3:+--row $3} --frames 1 --cells 16 --threads 2 --out "$tmp/out" || return 1
    grep -q example_frame "$1" || return 0
    # a row may have a scheme of its own, which is in the name
    for scheme in "" _partitioned _semi-implicit; do
        [ -s "$tmp/out/$name${scheme}_0001.png" ] && [ -s "$tmp/out/$name${scheme}_0001.ply" ] && return 0
    done
    echo "no picture or no particles"
    return 1
}

# The implementation is compiled once for all examples that can be linked with it.
examples() {
    check "one object" $CC -O1 -Wall -Werror -DGS4MPM_IMPLEMENTATION -DGS4_PTHREADS -I. -x c -c gs4mpm.h -o "$tmp/gs4mpm.o"
    for file in bench/*.c examples/*.c; do
        linked=; grep -q '"example.h"' "$file" && linked="-DGS4_LINKED $tmp/gs4mpm.o"
        level=-O1; [ "$file" = "${file#bench}" ] || level=-O0          # benches are not run here
        check "$file is built" builds $level "$file" "$tmp/$(basename "$file" .c)" $linked
    done
    check "an example is built as its comment says" builds -O1 examples/drop.c "$tmp/drop"
    for file in examples/*.c; do
        program=$tmp/$(basename "$file" .c)
        rows=$(sed -n 's/.*e\.rows = \([0-9]*\);.*/\1/p' "$file")
        grep -q '"example.h"' "$file" || continue
        for row in $(seq "${rows:-0}"); do check "$file --row $row" shows "$file" "$program" $row; done
        [ -n "$rows" ] || check "$file" shows "$file" "$program"
    done
    check "examples/minimal.c writes" sh -c 'cd "$1" && ./minimal && [ -s honey.ply ]' sh "$tmp"
    check "examples/rheometer.c writes" sh -c '"$1/rheometer" --out "$1" && [ -s "$1/rheometer.csv" ] && [ -s "$1/rheometer.svg" ]' sh "$tmp"
}

# The page of examples/web in headless Chromium: three scenes, hashes of this machine, sentences of refused steps. Pictures of a page
# that fails are left in out/. Optimized less than build.sh does, which compiles in half the time.
web() {
    have_wasi && have "${CHROMIUM:-chromium}" || return
    check "native" $CC -std=c99 -O1 -Dalways_inline=unused -Wall -Wextra -Werror -I. examples/web/web.c -o "$tmp/web" -lm
    check "page" env CFLAGS='-O1 -msimd128 -Dalways_inline=unused' sh examples/web/build.sh "$tmp/web.html" || return
    check "in Chromium" node examples/web/check.mjs "$tmp/web.html" "$tmp/web" "$tmp" || { mkdir -p out && cp "$tmp"/*.png out/; }
}

# ==== main =====================================================================================================

tmp=$(mktemp -d) || exit 1
trap 'rm -rf "$tmp" 2> /dev/null' EXIT
trap 'exit 1' HUP INT TERM

if [ "${1:-}" = --group ]; then                     # one group in this process
    group=$2
    write_sources
    "$group"
    times > "$tmp/times"; echo "processor time of it: $(tail -n 1 "$tmp/times")"
    finish
    exit
fi

# shared by groups where there is a lock
command -v flock > /dev/null 2>&1 && GS4_SHARED=$tmp && export GS4_SHARED
case "${1:-full}" in quick) groups=$quick ;; full) groups=$full ;; *) groups=$* ;; esac
echo $groups | tr ' ' '\n' | xargs -P "${JOBS:-2}" -I{} sh -c 'sh tests/portability.sh --group "$1" > "$2/$1.log" 2>&1 < /dev/null; cat "$2/$1.log" | sed "$ s/^/$1: /"' sh {} "$tmp"
for group in $groups; do
    line=$(tail -n 1 "$tmp/$group.log" 2> /dev/null | grep -E '^[0-9]+ passed, [0-9]+ failed')
    # shellcheck disable=SC2046
    set -- $(echo "${line:-0 passed, 1 failed}" | tr -dc '0-9 ')
    passed=$((passed + $1)) failed=$((failed + $2)) skipped=$((skipped + ${3:-0}))
    [ -n "$line" ] || echo "failed: $group did not finish"
done
finish
