/* butter.c - a pat of butter slides down a tilted hot pan on what melts off it.
 *     cc -O3 -march=native examples/butter.c -Iexamples -I. -lm -lpthread -o butter
 *     ./butter                            pictures and particles in out/
 *
 * After figure 3 of "Augmented MPM" (2014). Pan and butter stick to each other: there is no
 * friction law here, the pat starts to slide when a layer under it has melted, and rides on it.
 * The pan has 130 degrees and is tilted by 4; butter melts at 32 and conducts 1000 times too
 * well here. */
#include "example.h"

int main(int argc, char **argv)
{
    const double length = 0.24, tilt = 4 * 3.14159265 / 180, faster = 1000;
    const float colours[6][3] = { { 0.99f, 0.93f, 0.62f }, { 0.99f, 0.92f, 0.58f },
                                  { 0.98f, 0.90f, 0.52f }, { 0.93f, 0.70f, 0.18f },
                                  { 0.91f, 0.66f, 0.14f }, { 0.88f, 0.61f, 0.10f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m;
    gs4_fill fill = { 0 };
    preview_solid things[5] = { { 0 } };
    gs4_sim *sim;
    e.name = "butter";
    e.frames = 72;
    e.cells = 64;
    e.frame_time = 1.0 / 20;
    example_options(&e, argc, argv);

    desc.cell_size = real(length / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = e.cells / 3;
    desc.cells[2] = e.cells * 2 / 3;
    desc.origin = vec(-length / 2, 0, -length / 3);
    desc.gravity = vec(9.81 * sin(tilt), -9.81 * cos(tilt), 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i)
        desc.walls[i] = i == 2 ? GS4_WALL_STICK : i == 3 ? GS4_WALL_OPEN : GS4_WALL_SLIP;
    desc.wall_is_isothermal[2] = 1;
    desc.wall_temperature[2] = 130;
    desc.ambient_temperature = 10;
    sim = example_create(&e, &desc);

    example_need(sim, gs4_material_preset("butter", &m));
    m.conductivity = real((double)m.conductivity * faster);
    fill.material = example_need(sim, gs4_add_material(sim, &m));
    fill.temperature = 10;
    fill.jitter = real(0.5);
    example_need(sim, gs4_add_particles(
                          sim, gs4_box(vec(-0.095, 0, -0.03), vec(-0.035, 0.034, 0.03)), &fill));

    for (int i = 0; i < 5; ++i) { /* a square pan: bottom and rim */
        const float w = (float)(length / 2), d = (float)(length / 3), t = 0.006f;
        preview_solid *b = &things[i];
        b->kind = PREVIEW_BOX;
        b->a[0] = i == 2 ? w : -w - t;
        b->b[0] = i == 1 ? -w : w + t;
        b->a[2] = i == 4 ? d : -d - t;
        b->b[2] = i == 3 ? -d : d + t;
        b->a[1] = -t;
        b->b[1] = i ? 0.016f : 0;
        b->colour[0] = b->colour[1] = 0.27f;
        b->colour[2] = 0.29f;
    }
    e.look.solids = things;
    e.look.solid_count = 5;
    e.look.eye[0] = 0.02f;
    e.look.eye[1] = 0.26f;
    e.look.eye[2] = 0.36f;
    e.look.target[1] = -0.01f;
    e.look.up[0] = (float)-sin(tilt);
    e.look.up[1] = (float)cos(tilt);
    e.look.field_of_view = 32;
    e.look.width = 600;
    e.look.height = 400;
    e.look.palette = colours;
    e.look.palette_count = 6;
    e.look.low = 10;
    e.look.high = 130;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.colour = EXAMPLE_TEMPERATURE;
    e.melting = (double)m.melting_temperature;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
