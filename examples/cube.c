/* cube.c - a viscous cube of 10 cm is dropped on the floor and spreads.
 *     cc -O3 -march=native examples/cube.c -Iexamples -I. -lm -lpthread -o cube
 *     ./cube                              pictures and particles in out/
 *
 * Like the Newtonian cube of the GS4 paper (4.9 Pa s), but slower: it hits the floor at about 2
 * m/s, keeps its corners for a moment, and is a pancake half a second later. */
#include "example.h"

int main(int argc, char **argv)
{
    const double side = 0.1, width = 0.48;
    const float raspberry[1][3] = { { 0.86f, 0.20f, 0.30f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_fill fill = { 0 };
    preview_solid floor = { 0 };
    gs4_sim *sim;
    e.name = "cube";
    e.frames = 40;
    e.cells = 64;
    e.frame_time = 1.0 / 60;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells / 2;
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    liquid.density = 1000;
    liquid.viscosity = real(4.9);
    fill.material = example_need(sim, gs4_add_material(sim, &liquid));
    fill.velocity = vec(0, -1.5, 0);
    example_need(sim, gs4_add_particles(sim,
                                        gs4_box(vec(-side / 2, 0.08, -side / 2),
                                                vec(side / 2, 0.08 + side, side / 2)),
                                        &fill));

    floor.kind = PREVIEW_FLOOR;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[0] = 0.35f;
    e.look.eye[1] = 0.30f;
    e.look.eye[2] = 0.55f;
    e.look.target[1] = 0.06f;
    e.look.width = 600;
    e.look.height = 480;
    e.look.palette = raspberry;
    e.look.palette_count = 1;
    e.look.clarity = 0.04f;
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
