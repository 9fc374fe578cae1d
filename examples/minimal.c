/* minimal.c - the program of the README: honey falls on a floor, and its particles are written
 * to honey.ply.
 *     cc -O3 -march=native examples/minimal.c -I. -lm -o minimal && ./minimal
 * Takes seconds and prints nothing when all is well. */
#include <stdio.h>
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"

int main(void)
{
    gs4_sim_desc desc = { 0 };
    gs4_vec3 centre = { 0.064f, 0.08f, 0.064f };
    gs4_material honey;
    gs4_fill fill = { 0 };
    gs4_sim *sim;
    /* cells of 4 mm: a box of 13 cm; its walls stick */
    desc.cells[0] = desc.cells[1] = desc.cells[2] = 32;
    desc.cell_size = 0.004f;
    desc.gravity.y = -9.81f;
    if (gs4_create(&desc, &sim) < 0) return puts(gs4_last_error(NULL)), 1;
    gs4_material_preset("honey", &honey);
    fill.material = gs4_add_material(sim, &honey);
    gs4_add_particles(sim, gs4_sphere(centre, 0.03f), &fill);
    if (gs4_advance(sim, 0.25f) < 0 || gs4_write_ply(sim, "honey.ply") < 0)
        puts(gs4_last_error(sim));
    gs4_destroy(sim);
    return 0;
}
