#!/bin/sh
# sh examples/web/build.sh [FILE.html]: compiles web.c to wasm and puts it into page.html, so that
# the page is one file, which a browser opens from disk as well. Needs clang, lld, and wasi-libc and
# libclang-rt for wasm32 (Debian: wasi-libc libclang-rt-dev-wasm32).
set -eu
cd "$(dirname "$0")/../.."
page=${1:-out/web.html}
mkdir -p "$(dirname "$page")"
wasm=$(mktemp)
trap 'rm -f "$wasm"' EXIT
exports=
for f in start step viscosity time hash error limit said look; do
    exports="$exports -Wl,--export=web_$f"
done
# A reactor: functions to call, and no main. No call of the library's that is left needs a system.
# shellcheck disable=SC2086
clang --target=wasm32-wasi -mexec-model=reactor ${CFLAGS:--O3 -msimd128} -DNDEBUG -w -I. \
    -Wl,-z,stack-size=1048576 -Wl,--export=malloc $exports examples/web/web.c -lm -o "$wasm"
# the line that says WASM becomes the module in base64
{
    sed '/^WASM$/,$d' examples/web/page.html
    base64 "$wasm" | tr -d '\n'
    sed '1,/^WASM$/d' examples/web/page.html
} > "$page"
echo "$page"
