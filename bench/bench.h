/* What the benches share: a clock, what must not fail, the machine, the median. Include after
 * gs4mpm.h. */
#ifndef BENCH_H
#define BENCH_H
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "../tests/scenes.h"

static double bench_now(void *user)
{
    struct timespec t;
    (void)user;
    timespec_get(&t, TIME_UTC);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void bench_need(const gs4_sim *sim, int result)
{
    if (result >= 0) return;
    fprintf(stderr, "%s\n", gs4_last_error(sim));
    exit(1);
}

/* Machine and compiler as comment lines of a CSV file. */
static void bench_machine(FILE *out)
{
    char line[256];
    FILE *f = fopen("/proc/cpuinfo", "r");
    while (f && fgets(line, sizeof line, f))
        if (strncmp(line, "model name", 10) == 0) {
            fprintf(out, "# %s", line);
            break;
        }
    if (f) fclose(f);
#ifdef __VERSION__
    fprintf(out, "# compiler %s\n", __VERSION__);
#endif
#ifdef BENCH_FLAGS
    fprintf(out, "# flags %s\n", BENCH_FLAGS);
#endif
}

static int bench_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double bench_median(double *v, int n)
{
    qsort(v, (size_t)n, sizeof *v, bench_ascending);
    return v[n / 2];
}
#endif
