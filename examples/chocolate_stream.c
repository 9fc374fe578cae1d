/* chocolate_stream.c - hot chocolate is poured over a cold chocolate bunny; the colours are
 * temperatures.
 *     cc -O3 -march=native examples/chocolate_stream.c -Iexamples -I. -lm -lpthread \
 *         -o chocolate_stream
 *     ./chocolate_stream                  pictures and particles in out/
 *
 * After figure 10 of "Augmented MPM" (2014). The stream has 70 degrees, the bunny 5, both melt
 * at 34: the stream eats into the bunny and freezes on the plate, which has 0. Greys are solid,
 * from cold to warm, colours liquid. Chocolate conducts 600 times too well here. */
#include "example.h"
#include "bunny.h"

/* a mesh's arrays must outlive the simulation */
static gs4_real vertices[BUNNY_VERTEX_COUNT][3];

int main(int argc, char **argv)
{
    const double width = 0.24, size = 0.12, faster = 600, outlet_height = 0.165;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m;
    gs4_fill fill = { 0 };
    gs4_emitter emitter = { 0 };
    preview_solid things[2] = { { 0 } };
    gs4_sim *sim;
    double lowest = 1;
    e.name = "chocolate_stream";
    e.frames = 50;
    e.cells = 44;
    e.frame_time = 1.0 / 20;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * 9 / 10;
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    desc.wall_is_isothermal[2] = 1;
    desc.wall_temperature[2] = 0;
    desc.ambient_temperature = 0;
    sim = example_create(&e, &desc);

    example_need(sim, gs4_material_preset("chocolate", &m));
    /* the preset, softer still, lets the ears hang */
    m.shear_modulus = 8e4;
    m.viscosity = 9; /* thrice the preset: films of more than a cell */
    m.yield_compression = m.yield_stretch = real(0.1);
    m.conductivity = real((double)m.conductivity * faster);
    fill.material = example_need(sim, gs4_add_material(sim, &m));
    fill.temperature = 5;
    for (int k = 0; k < BUNNY_VERTEX_COUNT; ++k)
        lowest = fmin(lowest, (double)bunny_vertices[k][1]);
    for (int k = 0; k < BUNNY_VERTEX_COUNT; ++k)
        for (int a = 0; a < 3; ++a)
            vertices[k][a] = real(size * ((double)bunny_vertices[k][a] - (a == 1 ? lowest : 0)));
    example_need(sim, gs4_add_particles(sim,
                                        gs4_mesh(&vertices[0][0], BUNNY_VERTEX_COUNT,
                                                 &bunny_triangles[0][0], BUNNY_TRIANGLE_COUNT),
                                        &fill));

    emitter.shape = gs4_cylinder(vec(-0.026, outlet_height, 0.010),
                                 vec(-0.026, outlet_height + 0.015, 0.010), real(0.014));
    emitter.fill.velocity = vec(0, -0.5, 0);
    emitter.fill.temperature = 70;
    emitter.fill.jitter = real(0.5);
    emitter.stop = real(1.2);
    example_need(sim, gs4_add_emitter(sim, &emitter));

    things[0].kind = PREVIEW_FLOOR;
    e.look.solids = things;
    e.look.solid_count = 1;
    e.look.eye[0] = 0.08f;
    e.look.eye[1] = 0.20f;
    e.look.eye[2] = 0.44f;
    e.look.target[1] = 0.07f;
    e.look.width = 480;
    e.look.height = 480;
    e.look.low = 5;
    e.look.high = 70;
    e.look.shine = 0.5f;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.colour = EXAMPLE_TEMPERATURE;
    e.melting = (double)m.melting_temperature;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
