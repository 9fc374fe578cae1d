/* poisson.c - the elliptic solver alone: the temperature of a slab with a hole in it, 1 on top,
 * 0 below, insulated at the sides.
 *     cc -O3 -march=native examples/poisson.c -I. -lm -o poisson && ./poisson
 * Prints the temperature along the middle, the iterations, and by how much the hole lowers the
 * flow of heat, in an instant. */
#include <stdio.h>
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"

enum {
    N = 64
};
static uint8_t kind[N * N * N];
static gs4_real rhs[N * N * N], x[N * N * N];

int main(void)
{
    gs4_poisson_desc desc = { 0 };
    gs4_poisson *solver;
    gs4_solve_stats stats;
    double flow = 0;
    int i, j, k, at = 0;
    for (k = 0; k < N; k++)
        for (j = 0; j < N; j++)
            for (i = 0; i < N; i++, at++) {
                const int a = i - N / 2, b = j - N / 2, c = k - N / 2;
                kind[at] = k == 0 || k == N - 1              ? GS4_CELL_AIR
                           : a * a + b * b + c * c < 20 * 20 ? GS4_CELL_SOLID
                                                             : GS4_CELL_LIQUID;
                /* given in the air, a guess elsewhere */
                x[at] = k == N - 1;
            }
    desc.cells[0] = desc.cells[1] = desc.cells[2] = N;
    /* 1 between the middles of top and bottom */
    desc.cell_size = (gs4_real)(1.0 / (N - 1));
    desc.kind = kind;
    if (gs4_poisson_create(&desc, &solver) < 0 || gs4_poisson_solve(solver, rhs, x, &stats) < 0)
        return puts(gs4_last_error(NULL)), 1;
    gs4_poisson_destroy(solver);
    for (k = 0; k < N; k += 9)
        printf("height %.2f   temperature beside the hole %.4f\n", k / (N - 1.0),
               (double)x[(k * N + N / 2) * N + 2]);
    for (at = 0; at < N * N; at++) flow += (double)(x[N * N + at] - x[at]) * (N - 1) / (N * N);
    printf("%d iterations, residual %.1e; flow of heat %.3f of what it is without the hole\n",
           stats.iterations, stats.residual, flow);
    return 0;
}
