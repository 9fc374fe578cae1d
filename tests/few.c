/* tests/fuzz.c and tests/determinism.c as parts of tests/main.c (-DGS4_FEW), as to compile the
 * library takes longer than the few scenes that run.sh has of either: `few fuzz 1 5`,
 * `few steps=10`. */
#define main fuzz_main
#include "fuzz.c"
#undef main
#define main determinism_main
#include "determinism.c"
#undef main

static int few(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "fuzz") == 0) return fuzz_main(argc - 1, argv + 1);
    return determinism_main(argc, argv);
}
