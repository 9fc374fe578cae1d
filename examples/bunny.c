/* bunny.c - eight bunnies of chocolate and cream fall on each other in a box; then a stamp comes
 * down on them.
 *     cc -O3 -march=native examples/bunny.c -Iexamples -I. -lm -lpthread -o bunny
 *     ./bunny                             pictures and particles in out/
 *
 * Shows meshes as shapes to fill, several materials, and a body that is moved while the
 * simulation runs. */
#include "example.h"
#include "bunny.h"

enum {
    BUNNIES = 8
};
/* a mesh's arrays must outlive the simulation */
static gs4_real vertices[BUNNIES][BUNNY_VERTEX_COUNT][3];

int main(int argc, char **argv)
{
    const double box = 0.24, size = 0.10, stamp_half = 0.06, stamp_height = 0.05,
                 stamp_start = 0.75;
    const float colours[BUNNIES][3] = { { 0.30f, 0.16f, 0.09f }, { 0.98f, 0.93f, 0.84f },
                                        { 0.55f, 0.34f, 0.20f }, { 0.30f, 0.16f, 0.09f },
                                        { 0.98f, 0.93f, 0.84f }, { 0.55f, 0.34f, 0.20f },
                                        { 0.98f, 0.93f, 0.84f }, { 0.30f, 0.16f, 0.09f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_fill fill = { 0 };
    gs4_collider stamp = { 0 };
    preview_solid things[2] = { { 0 } };
    gs4_sim *sim;
    int body;
    e.name = "bunny";
    e.frames = 60;
    e.cells = 36;
    example_options(&e, argc, argv);

    desc.cell_size = real(box / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = 3 * e.cells;
    desc.origin = vec(-box / 2, 0, -box / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    /* on a side wall that sticks, what grazes it would hang for ever */
    for (int i = 0; i < 6; ++i)
        desc.walls[i] = i == 2 ? GS4_WALL_STICK : i == 3 ? GS4_WALL_OPEN : GS4_WALL_SLIP;
    sim = example_create(&e, &desc);

    liquid.density = 1200;
    liquid.viscosity = 6;
    liquid.sound_speed = 20;
    /* a material each, so that the pictures can tell them apart */
    for (int i = 0; i < BUNNIES; ++i) {
        const double x = i % 2 ? 0.054 : -0.054, z = i / 2 % 2 ? 0.054 : -0.054;
        fill.material = example_need(sim, gs4_add_material(sim, &liquid));
        example_need(sim, gs4_add_particles(sim,
                                            bunny_at(vertices[i], size, 1.3 * i, 0.5 * i,
                                                     vec(x, 0.06 + 0.075 * i, z)),
                                            &fill));
    }
    stamp.shape = gs4_box(vec(-stamp_half, stamp_start, -stamp_half),
                          vec(stamp_half, stamp_start + stamp_height, stamp_half));
    stamp.contact = GS4_WALL_STICK;
    body = example_need(sim, gs4_add_collider(sim, &stamp));

    things[0].kind = PREVIEW_ROOM;
    for (int a = 0; a < 3; ++a) {
        things[0].a[a] = a == 1 ? 0 : (float)(-box / 2);
        things[0].b[a] = a == 1 ? 0.9f : (float)(box / 2);
    }
    things[1].kind = PREVIEW_BOX;
    e.look.solids = things;
    e.look.solid_count = 2;
    e.look.eye[0] = 0.10f;
    e.look.eye[1] = 0.36f;
    e.look.eye[2] = 0.75f;
    e.look.target[1] = 0.14f;
    e.look.width = 540;
    e.look.height = 600;
    e.look.palette = colours;
    e.look.palette_count = BUNNIES;
    e.look.high = BUNNIES - 1;
    e.colour = EXAMPLE_MATERIAL;

    for (double at = stamp_start;;) { /* where the stamp's lower side is */
        const double t = e.frame * e.frame_time, speed = t < 0.55  ? 0
                                                         : t < 1.4 ? -(at - 0.02) / (1.4 - t)
                                                         : t < 1.6 ? 0
                                                                   : 0.5;
        example_need(sim, gs4_move_collider(sim, body, vec(0, speed, 0), vec(0, 0, 0)));
        at += speed * e.frame_time;
        for (int a = 0; a < 3; ++a) {
            things[1].a[a] = (float)(a == 1 ? at : -stamp_half);
            things[1].b[a] = (float)(a == 1 ? at + stamp_height : stamp_half);
        }
        if (!example_frame(&e, sim)) break;
    }
    gs4_destroy(sim);
    return 0;
}
