/* lava.c - lava oozes down a slope whose ground is the colder the further down, and crusts over.
 *     cc -O3 -march=native examples/lava.c -Iexamples -I. -lm -lpthread -o lava
 *     ./lava                              pictures and particles in out/
 *
 * After figure 1 of "Augmented MPM" (2014), whose mountain is colder away from the source too.
 * Eight threads of lava leave a vent side by side, at 1180 degrees; they freeze at 1050 to 1095, so
 * that the crust tears and toes break out of it. The ground is a row of slabs from 1100 down to 200
 * degrees, the air has 300. Lava is three times as thick 33 degrees colder. Explicit: 700 Pa s in
 * cells of 15 cm limit the step little more than the sound of the crust does. It conducts 1500
 * times too well here: what takes seventeen hours takes forty seconds. A run takes five
 * minutes of processor time. */
#include "example.h"

enum {
    SLABS = 6,
    KINDS = 4,  /* of lava, by where they freeze */
    ACROSS = 4, /* threads of it, side by side */
    THREADS = 8
};

/* Pa s; thicker as it cools, down to where it would limit the step too much */
static gs4_real viscosity(gs4_real temperature, gs4_real shear_rate, void *user)
{
    (void)shear_rate;
    (void)user;
    return real(700 * exp((1180 - fmax((double)temperature, 1147)) / 30));
}

int main(int argc, char **argv)
{
    const double length = 6, tilt = 15 * 3.14159265 / 180, faster = 1500, width = 0.9, speed = 0.5;
    const float glow[6][3] = { { 0.10f, 0.09f, 0.10f }, { 0.17f, 0.13f, 0.13f },
                               { 0.30f, 0.12f, 0.09f }, { 0.80f, 0.20f, 0.04f },
                               { 0.98f, 0.52f, 0.08f }, { 1.00f, 0.86f, 0.35f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m;
    gs4_collider ground = { 0 };
    gs4_emitter spring = { 0 };
    preview_solid things[SLABS] = { { 0 } };
    gs4_sim *sim;
    int kind[KINDS];
    e.name = "lava";
    e.frames = 40;
    e.cells = 40;
    e.frame_time = 1;
    example_options(&e, argc, argv);

    desc.cell_size = real(length / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = e.cells / 4;
    desc.cells[2] = e.cells * 4 / 5;
    desc.origin = vec(-length / 2, -length / 16, -length * 2 / 5);
    desc.gravity = vec(9.81 * sin(tilt), -9.81 * cos(tilt), 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    desc.air_is_isothermal = 1;
    desc.ambient_temperature = 300;
    sim = example_create(&e, &desc);

    example_need(sim, gs4_material_preset("lava", &m));
    m.viscosity_law = GS4_VISCOSITY_CALLBACK;
    m.viscosity = 0;
    m.viscosity_fn = viscosity;
    m.sound_speed = 20;
    m.conductivity = real((double)m.conductivity * faster);
    for (int i = 0; i < KINDS; ++i) {
        m.melting_temperature = real(1050 + 15 * i);
        kind[i] = example_need(sim, gs4_add_material(sim, &m));
    }

    for (int i = 0; i < SLABS; ++i) {
        const double x = length * ((double)i / SLABS - 0.5),
                     T = 1100 - 900 * pow((double)i / (SLABS - 1), 1.4);
        const double from = i ? x : x - length,
                     to = i + 1 < SLABS ? x + length / SLABS : x + length;
        ground.shape = gs4_box(vec(from, -2, -length), vec(to, 0, length));
        ground.contact = GS4_WALL_STICK;
        ground.is_isothermal = 1;
        ground.temperature = real(T);
        example_need(sim, gs4_add_collider(sim, &ground));
        things[i].kind = PREVIEW_BOX;
        things[i].a[0] = (float)x;
        things[i].a[1] = -0.5f;
        things[i].a[2] = (float)(-length * 2 / 5);
        things[i].b[0] = (float)to;
        things[i].b[2] = (float)(length * 2 / 5);
        if (i + 1 == SLABS) things[i].b[0] = (float)(length / 2);
        things[i].colour[0] = (float)(0.34 + 0.10 * (T - 200) / 950);
        things[i].colour[1] = 0.33f;
        things[i].colour[2] = (float)(0.36 - 0.06 * (T - 200) / 950);
    }
    for (int i = 0; i < THREADS; ++i) {
        const double side = width / ACROSS, z = side * (i % ACROSS) - width / 2,
                     y = 0.02 + side * (i / ACROSS);
        spring.shape = gs4_box(vec(-2.6, y, z), vec(-2.3, y + side, z + side));
        spring.fill.material = kind[(3 * i + i / ACROSS) % KINDS];
        spring.fill.velocity = vec(speed, 0, 0);
        spring.fill.temperature = 1180;
        spring.fill.jitter = real(0.5);
        example_need(sim, gs4_add_emitter(sim, &spring));
    }

    e.look.solids = things;
    e.look.solid_count = SLABS;
    e.look.eye[0] = 3.5f;
    e.look.eye[1] = 4.5f;
    e.look.eye[2] = 5.5f;
    e.look.target[0] = -0.3f;
    e.look.up[0] = (float)-sin(tilt);
    e.look.up[1] = (float)cos(tilt);
    e.look.field_of_view = 34;
    e.look.width = 640;
    e.look.height = 420;
    e.look.palette = glow;
    e.look.palette_count = 6;
    e.look.low = 300;
    e.look.high = 1180;
    e.look.shine = 0.25f;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.colour = EXAMPLE_TEMPERATURE;
    e.melting = (double)m.melting_temperature;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
