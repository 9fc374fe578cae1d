/* The solve for velocity and pressure alone, on the domains of tests/stokes_cases.h, residual 1e-6.
 *   cc -O3 -march=native bench/stokes.c -I. -lm -lpthread -o stokes
 *   ./stokes [--cells N] [--largest N] [--threads N] [--only NAME]
 * CSV on standard output: sizes from --cells (32) doubling to --largest (32; 64 takes minutes, 128
 * more and several GB); each with mu s/(rho h^2) of 0, 1, 1e2, 1e4 and 1e7, then contrasts. One run
 * each: times are wall clock, us per unknown. `way`: CC for Cahouet & Chabard, C for the
 * commutator. */
#define _POSIX_C_SOURCE 200112L
#define GS4_PTHREADS
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"
#include "../tests/stokes_cases.h"

static void measure(const char *name, const char *contrast, int n, double mu, int threads)
{
    stokes_case *k = stokes_make(name, n, mu, contrast);
    const gs4i_stokes_system *y = &k->s.system;
    double start, setup, solve;
    int result;
    if (threads > 1) k->tasks.pool = gs4i_pool_create(&k->memory, threads - 1);
    k->s.threads = threads;
    start = bench_now(NULL);
    if (gs4i_stokes_setup(&k->s) != GS4_OK) exit(1);
    setup = bench_now(NULL) - start;
    start = bench_now(NULL);
    result = gs4i_stokes_find(&k->s);
    solve = bench_now(NULL) - start;
    printf("%s,%s,%d,%d,%g,%s,%d,%.1e,%s,%.2f,%.3f,%.0f\n", name, contrast, n, y->all - 2, mu,
           y->schur.by_commutator ? "C" : "CC", k->s.iterations, k->s.residual,
           result == GS4_OK ? "yes" : "NO", 1e6 * setup / y->all,
           1e6 * solve / y->all / (k->s.iterations ? k->s.iterations : 1),
           (double)k->memory.bytes / y->all);
    fflush(stdout);
    gs4i_pool_destroy(&k->memory, k->tasks.pool, threads - 1);
    if (stokes_free(k)) exit(1);
}

int main(int count, char **values)
{
    static const double mu[5] = { 0, 1, 1e2, 1e4, 1e7 };
    static const char *const contrasts[4] = { "stiff", "soft", "halves", "smooth" };
    const char *only = "";
    int i, n = 32, largest = 0, threads = 1, q, c;
    for (i = 1; i + 1 < count; i += 2) {
        if (strcmp(values[i], "--cells") == 0) n = atoi(values[i + 1]);
        if (strcmp(values[i], "--largest") == 0) largest = atoi(values[i + 1]);
        if (strcmp(values[i], "--threads") == 0) threads = atoi(values[i + 1]);
        if (strcmp(values[i], "--only") == 0) only = values[i + 1];
    }
    bench_machine(stdout);
    printf("# gs4_real of %d bytes, %d threads\n", gs4_real_size(), threads);
    printf("domain,contrast,n,unknowns,mu,way,iterations,residual,converged,setup us per unknown,"
           "us per unknown and iteration,bytes per unknown\n");
    do {
        for (q = 0; q < STOKES_CASES; q++)
            for (i = 0; i < 5; i++)
                if (strstr(stokes_names[q], only)) measure(stokes_names[q], "", n, mu[i], threads);
        for (q = 0; q < 4; q += 3)
            for (c = 0; c < 4; c++)
                for (i = 1; i < 5; i++)
                    if (strstr(stokes_names[q], only))
                        measure(stokes_names[q], contrasts[c], n, mu[i], threads);
        n *= 2;
    } while (n <= largest);
    return 0;
}
