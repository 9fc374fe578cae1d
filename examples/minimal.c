/* minimal.c - the shortest program: a ball of honey falls on the floor; where it is then is written to honey.ply.
 *     cc -O3 -march=native examples/minimal.c -I. -lm -o minimal */
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include <stdio.h>

int main(void)
{
    gs4_sim *sim;
    gs4_sim_desc desc = {{48, 32, 48}, 0.002f};         /* cells, and their size in m; walls are sticky */
    gs4_vec3 centre = {0.048f, 0.040f, 0.048f};
    gs4_material honey;
    gs4_fill fill = {0};
    desc.gravity.y = -9.81f;
    if (gs4_create(&desc, &sim) < 0) return puts(gs4_last_error(NULL)), 1;
    gs4_material_preset("honey", &honey);
    fill.material = gs4_add_material(sim, &honey);
    gs4_add_particles(sim, gs4_sphere(centre, 0.015f), &fill);
    if (gs4_advance(sim, 0.2f) < 0 || gs4_write_ply(sim, "honey.ply") < 0) puts(gs4_last_error(sim));
    gs4_destroy(sim);
    return 0;
}
