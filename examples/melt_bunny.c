/* melt_bunny.c - a chocolate bunny melts in a hot pan, or in hot air.
 *     cc -O3 -march=native examples/melt_bunny.c -Iexamples -I. -lm -lpthread -o melt_bunny
 *     ./melt_bunny --row 1      the melt has no viscosity; --row 2: 39.2 Pa s; pictures in out/
 *     ./melt_bunny --row 3      in hot air, 3 Pa s
 *     ./melt_bunny --row 2 --scheme semi-implicit
 *
 * After figure 14 of the GS4 paper (viscosities: table 4, bunny melting 1 and 2). The pan has
 * 120 degrees and holds the bunny by its feet; chocolate melts at 34. In row 1 what melts runs
 * away in waves, in row 2 the bunny sits in what has melted and sinks. Row 3 is after figure 8 of
 * "Augmented MPM" (2014): the pan conducts nothing, the air has 120 degrees, and ears go first.
 * Chocolate conducts 2500 times too well here (row 3: 500), or the melting would take hours; a run
 * takes some four minutes of processor time. */
#include "example.h"
#include "bunny.h"

/* a mesh's arrays must outlive the simulation */
static gs4_real vertices[BUNNY_VERTEX_COUNT][3];

int main(int argc, char **argv)
{
    const double pan = 0.26, rim = 0.02, size = 0.13, faster = 2500;
    const float chocolate[6][3] = { { 0.50f, 0.33f, 0.22f }, { 0.48f, 0.31f, 0.20f },
                                    { 0.45f, 0.28f, 0.17f }, { 0.27f, 0.13f, 0.07f },
                                    { 0.25f, 0.12f, 0.06f }, { 0.23f, 0.10f, 0.05f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m;
    gs4_fill fill = { 0 };
    preview_solid things[6] = { { 0 } };
    gs4_sim *sim;
    double lowest = 1;
    e.name = "melt_bunny";
    e.frames = 60;
    e.cells = 40;
    e.rows = 3;
    e.frame_time = 0.1;
    e.takes_scheme = 1;
    example_options(&e, argc, argv);

    desc.cell_size = real(pan / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells / 2;
    desc.origin = vec(-pan / 2, 0, -pan / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i)
        desc.walls[i] = i == 2 ? GS4_WALL_STICK : i == 3 ? GS4_WALL_OPEN : GS4_WALL_SLIP;
    desc.wall_is_isothermal[2] = e.row < 3;
    desc.wall_temperature[2] = real(e.row < 3 ? 120 : 0);
    desc.air_is_isothermal = e.row == 3;
    desc.ambient_temperature = real(e.row < 3 ? 20 : 120);
    sim = example_create(&e, &desc);

    example_need(sim, gs4_material_preset("chocolate", &m));
    m.viscosity = real(e.row == 1 ? 0 : e.row == 2 ? 39.2 : 3);
    /* stiff, where elasticity limits no step; else so soft that the ears hang */
    m.shear_modulus = real(e.scheme == GS4_SEMI_IMPLICIT ? 1e7 : 8e4);
    m.yield_compression = m.yield_stretch = real(0.1);
    m.conductivity = real((double)m.conductivity * (e.row < 3 ? faster : faster / 5));
    fill.material = example_need(sim, gs4_add_material(sim, &m));
    fill.temperature = 20;
    for (int k = 0; k < BUNNY_VERTEX_COUNT; ++k)
        lowest = fmin(lowest, (double)bunny_vertices[k][1]);
    for (int k = 0; k < BUNNY_VERTEX_COUNT; ++k)
        for (int a = 0; a < 3; ++a)
            vertices[k][a] = real(size * ((double)bunny_vertices[k][a] - (a == 1 ? lowest : 0)));
    example_need(sim, gs4_add_particles(sim,
                                        gs4_mesh(&vertices[0][0], BUNNY_VERTEX_COUNT,
                                                 &bunny_triangles[0][0], BUNNY_TRIANGLE_COUNT),
                                        &fill));

    for (int i = 0; i < 5; ++i) { /* a square pan: bottom and rim */
        const float w = (float)(pan / 2), t = 0.006f;
        preview_solid *b = &things[i];
        b->kind = PREVIEW_BOX;
        b->a[0] = i == 2 ? w : -w - t;
        b->b[0] = i == 1 ? -w : w + t;
        b->a[2] = i == 4 ? w : -w - t;
        b->b[2] = i == 3 ? -w : w + t;
        b->a[1] = -t;
        b->b[1] = i ? (float)rim : 0;
        b->colour[0] = b->colour[1] = 0.32f;
        b->colour[2] = 0.34f;
    }
    things[5].kind = PREVIEW_FLOOR;
    things[5].a[1] = -0.006f;
    e.look.solids = things;
    e.look.solid_count = 6;
    e.look.eye[0] = 0.08f;
    e.look.eye[1] = 0.25f;
    e.look.eye[2] = 0.44f;
    e.look.target[1] = 0.04f;
    e.look.width = 540;
    e.look.height = 420;
    e.look.palette = chocolate;
    e.look.palette_count = 6;
    e.look.low = 20;
    e.look.high = 120;
    e.look.shine = 0.6f;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.colour = EXAMPLE_TEMPERATURE;
    e.melting = (double)m.melting_temperature;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
