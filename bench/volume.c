/* Volume of a falling drop against the sound speed (2021, figure 10): D 0.02 m, impact at about
 * 1.26 m/s, mu 4 Pa s.
 *   cc -O3 -march=native bench/volume.c -I. -lm -o volume
 *   ./volume [cells over D]       CSV on standard output */
#define _POSIX_C_SOURCE 200112L
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"

int main(int count, char **values)
{
    static const double speed[] = { 0.1, 0.5, 1, 10 };
    const int n = count > 1 ? atoi(values[1]) : 10;
    const double D = 0.02;
    int i, k;
    bench_machine(stdout);
    puts("c0,t_over_D,volume_over_initial,min_J,max_J,steps");
    for (i = 0; i < 4; i++) {
        gs4_sim_desc d = scene_cube(1);
        gs4_material m = scene_liquid(1000, 4, speed[i]);
        gs4_fill f = scene_fill(at(0, -1, 0));
        gs4_sim *sim;
        double first;
        d.cells[0] = d.cells[2] = 2 * n + 4;
        d.cells[1] = 3 * n;
        d.cell_size = (gs4_real)(D / n);
        d.gravity = at(0, -9.81, 0);
        d.walls[2] = GS4_WALL_STICK;
        if (gs4_create(&d, &sim) < 0) {
            puts(gs4_last_error(NULL));
            return 1;
        }
        gs4_add_material(sim, &m);
        gs4_add_particles(
            sim, gs4_sphere(at((n + 2) * D / n, 2 * D, (n + 2) * D / n), (gs4_real)(D / 2)), &f);
        first = gs4_get_stats(sim).volume;
        for (k = 1; k <= 10; k++) {
            const int result = gs4_advance(sim, (gs4_real)(0.5 * D));
            const gs4_stats s = gs4_get_stats(sim);
            if (result < 0) {
                printf("# c0 %g: %s\n", speed[i], gs4_last_error(sim));
                break;
            }
            printf("%g,%.1f,%.4f,%.3f,%.3f,%d\n", speed[i], 0.5 * k, s.volume / first,
                   s.min_volume_ratio, s.max_volume_ratio, (int)s.steps);
        }
        gs4_destroy(sim);
    }
    return 0;
}
