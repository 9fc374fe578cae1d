/* The elliptic solver alone: pools, closed boxes, walls and pores (tests/poisson_cases.h), white
 * noise, residual 1e-8.
 *   cc -O3 -march=native bench/poisson.c -I. -lm -lpthread -o poisson
 *   ./poisson [--cells N] [--largest N] [--repeats N] [--threads N]
 * With the struct solvers of HYPRE beside it in the same run, one process and one thread each
 * (Debian: libhypre-dev, mpicc):
 *   mpicc -O3 -march=native -DBENCH_HYPRE -I/usr/include/hypre bench/poisson.c -I. \
 *       -lm -lpthread -lHYPRE -o poisson && ./poisson --threads 1
 * CSV on standard output: sizes from --cells doubling to --largest, P1 to P5 at all of them and
 * the hard ones at the first. `again` is a setup in memory that is there already, as from step
 * to step. `limit` is the time of a solve over that of its iterations at 60 bytes a cell, as
 * fast as the same threads read. */
#define _POSIX_C_SOURCE 200112L
#define GS4_PTHREADS
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"
#include "../tests/poisson_cases.h"
#ifdef BENCH_HYPRE
#include "peers/hypre_pfmg.c"
#endif

typedef struct reading {
    const double *v;
    size_t count;
    double sums[64];
} reading;

static void read_part(int index, void *context)
{
    reading *r = (reading *)context;
    const double *v = r->v + r->count / 64 * (size_t)index;
    double s[16] = { 0 };
    size_t i;
    int l;
    for (i = 0; i + 16 <= r->count / 64; i += 16)
        for (l = 0; l < 16; l++) s[l] += v[i + (size_t)l];
    r->sums[index] = s[0];
    for (l = 1; l < 16; l++) r->sums[index] += s[l];
}

/* Bytes a second that the tasks of a solver read from memory, at best of five. */
static double read_speed(const gs4i_tasks *tasks)
{
    reading r;
    double best = 0, start, speed;
    double *v;
    size_t i;
    int k;
    r.count = (size_t)1 << 25;
    v = (double *)malloc(r.count * sizeof *v);
    if (!v) exit(3);
    for (i = 0; i < r.count; i++) v[i] = (double)i;
    r.v = v;
    for (k = 0; k < 5; k++) {
        start = bench_now(NULL);
        gs4i_parallel_for(tasks, 64, read_part, &r);
        speed = (double)r.count * sizeof *v / (bench_now(NULL) - start);
        if (speed > best) best = speed;
    }
    free(v);
    return best;
}

static void measure(const char *name, int n, int repeats, int threads)
{
    poisson_case p = poisson_make(name, n);
    gs4_poisson *s;
    gs4_solve_stats stats;
    double setup[16], again[16], solve[16], start, speed, unknowns = 0;
    size_t i;
    int k;
    memset(&stats, 0, sizeof stats);
    for (i = 0; i < p.count; i++) unknowns += p.kind[i] == GS4_CELL_LIQUID;
    p.desc.threads = threads;
    for (k = 0; k < repeats; k++) {
        start = bench_now(NULL);
        if (gs4_poisson_create(&p.desc, &s) < 0) {
            puts(gs4_last_error(NULL));
            exit(1);
        }
        setup[k] = bench_now(NULL) - start;
        start = bench_now(NULL);
        if (gs4i_solver_setup(&s->solver, &p.desc) != GS4_OK) exit(1);
        again[k] = bench_now(NULL) - start;
        memset(p.x, 0, p.count * sizeof *p.x);
        start = bench_now(NULL);
        if (gs4_poisson_solve(s, p.rhs, p.x, &stats) < 0) puts(gs4_last_error(NULL));
        solve[k] = bench_now(NULL) - start;
        if (k == repeats - 1) {
            speed = read_speed(&s->tasks);
            k = repeats;
            printf("%s,%d,%.0f,%d,%.2e,%.4f,%.4f,%.4f", name, n, unknowns, stats.iterations,
                   stats.residual, bench_median(setup, k), bench_median(again, k),
                   bench_median(solve, k));
            printf(",%.2f,%.2f,%.1f", 1e9 * solve[k / 2] / unknowns / stats.iterations,
                   solve[k / 2] / unknowns / stats.iterations / (60 / speed),
                   (double)stats.memory_bytes / (double)p.count);
        }
        gs4_poisson_destroy(s);
    }
#ifdef BENCH_HYPRE
    {
        const hypre_result h = hypre_pfmg(&p, 1e-8, 200);
        printf(",%d,%.2e,%.3f,%.3f,%.1f", h.iterations, h.residual, h.setup, h.solve,
               (h.setup + h.solve) / (setup[repeats / 2] + solve[repeats / 2]));
    }
#endif
    printf("\n");
    fflush(stdout);
    poisson_free(&p);
}

int main(int count, char **values)
{
    int i, n = 64, largest = 256, repeats = 3, threads = 2, q, size;
    for (i = 1; i + 1 < count; i += 2) {
        const int value = atoi(values[i + 1]);
        if (strcmp(values[i], "--cells") == 0) n = value;
        if (strcmp(values[i], "--largest") == 0) largest = value;
        if (strcmp(values[i], "--repeats") == 0) repeats = value < 16 ? value : 16;
        if (strcmp(values[i], "--threads") == 0) threads = value;
    }
    bench_machine(stdout);
    printf("# gs4_real of %d bytes, %d threads, medians of %d\n", gs4_real_size(), threads,
           repeats);
    printf("problem,n,unknowns,iterations,residual,setup s,again s,solve s,ns per unknown and "
           "iteration,limit,bytes per cell");
#ifdef BENCH_HYPRE
    hypre_begin();
    printf(",PFMG iterations,residual,setup s,solve s,times gs4mpm");
#endif
    printf("\n");
    for (size = n; size <= largest; size *= 2)
        for (q = 0; q < (size == n ? POISSON_CASES : 5); q++)
            measure(poisson_names[q], size, repeats, threads);
#ifdef BENCH_HYPRE
    hypre_end();
#endif
    return 0;
}
