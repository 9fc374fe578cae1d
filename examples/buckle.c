/* buckle.c - a sheet of liquid falls on the floor and folds: chocolate, or cream that remembers
 * its shape.
 *     cc -O3 -march=native examples/buckle.c -Iexamples -I. -lm -lpthread -o buckle
 *     ./buckle --row 1      Newtonian; --row 2: Pom-Pom; pictures and particles in out/
 *     ./buckle --scheme semi-implicit   no step by viscosity or sound
 *
 * As in the GS4 paper (figure 6; table 4, buckling 1 and 2): 30.6 Pa s are local in both, and
 * the cream is a gel of 990 Pa for three seconds. Chocolate folds narrowly and fast, and its
 * folds melt into each other; cream lays down wide folds that stay. */
#include "example.h"

int main(int argc, char **argv)
{
    const double width = 0.3, height = 0.2, half_sheet = 0.07, thickness = 0.02;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_emitter slit = { 0 };
    preview_solid floor = { 0 };
    gs4_sim *sim;
    e.name = "buckle";
    e.frames = 60;
    e.cells = 48;
    e.rows = 2;
    e.takes_scheme = 1;
    e.frame_time = 1.0 / 20;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = e.cells * 3 / 4;
    desc.cells[2] = e.cells * 2 / 3;
    desc.origin = vec(-width / 2, 0, -width / 3);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    liquid.density = 1000;
    liquid.viscosity = real(e.row == 1 ? 30.625 : 3063);
    if (e.scheme)
        liquid.incompressible = 1;
    else
        liquid.sound_speed = 12;
    if (e.row == 2) {
        liquid.liquid = GS4_POM_POM;
        liquid.local_fraction = real(0.01);
        liquid.relaxation_time = real(3.0625); /* G0 = 990 Pa */
        liquid.stretch_time = real(2.7563);
        liquid.anisotropy = real(0.01);
        liquid.arms = 16;
    }
    example_need(sim, gs4_add_material(sim, &liquid));

    slit.shape = gs4_box(vec(-thickness / 2, height, -half_sheet),
                         vec(thickness / 2, height + 0.0126, half_sheet));
    slit.fill.velocity = vec(0, -0.2, 0);
    slit.fill.jitter = real(0.5); /* what is symmetric has no side to fall to */
    example_need(sim, gs4_add_emitter(sim, &slit));

    floor.kind = PREVIEW_FLOOR;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[0] = 0.20f;
    e.look.eye[1] = 0.22f;
    e.look.eye[2] = 0.52f;
    e.look.target[1] = 0.08f;
    e.look.width = 540;
    e.look.height = 480;
    e.look.palette = e.row == 1 ? preview_chocolate : preview_cream;
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
