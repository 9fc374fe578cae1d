/* tests/fuzz.c and tests/determinism.c as parts of tests/main.c (-DGS4_FEW), as to compile the
 * library takes longer than the few scenes that run.sh has of either: `few fuzz 1 5`,
 * `few steps=10`. With -DGS4_FEW_HASHES without the fuzzer, which needs signals. */
#ifndef GS4_FEW_HASHES
#define main fuzz_main
#include "fuzz.c"
#undef main
#endif
#define main determinism_main
#include "determinism.c"
#undef main

static int few(int argc, char **argv)
{
#ifndef GS4_FEW_HASHES
    if (argc > 1 && strcmp(argv[1], "fuzz") == 0) return fuzz_main(argc - 1, argv + 1);
#endif
    return determinism_main(argc, argv);
}
