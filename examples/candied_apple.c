/* candied_apple.c - a cold apple is drawn out of a pot of hot candy; what clings to it sets.
 *     cc -O3 -march=native examples/candied_apple.c -Iexamples -I. -lm -lpthread -o candied_apple
 *     ./candied_apple                     pictures and particles in out/
 *
 * After figure 2 of "Augmented MPM for phase-change and varied materials" (2014). The candy is at
 * 150 degrees and sets at 110, on the apple (15, from the start) and in air (20). It leaves a coat
 * on the apple and a neck below, which thins to a thread that sets and breaks. It conducts 100
 * times too well, or the coat would have run off before it sets, and is softer than cold sugar.
 *     Explicit: at 12 Pa s sound and viscosity ask for steps of 0.15 ms, and a semi-implicit one of
 * 13 ms costs more than all of them, as it solves for what sets, too. It takes seven minutes of
 * processor time. */
#include "example.h"

static const double apple_radius = 0.033, stick_radius = 0.005, low = 0.041, level = 0.080;

/* The candy in the pot: below its level, around the apple and its stick. */
static gs4_real candy_around(gs4_vec3 p, void *user)
{
    const double x = (double)p.x, y = (double)p.y, z = (double)p.z;
    const double apple = sqrt(x * x + (y - low) * (y - low) + z * z) - apple_radius;
    const double stick = y > low ? hypot(x, z) - stick_radius : 1;
    (void)user;
    return real(fmax(y - level, -fmin(apple, stick)));
}

int main(int argc, char **argv)
{
    const double width = 0.11, speed = 0.08, lift = 0.135, faster = 100;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material candy = { 0 };
    gs4_collider body = { 0 };
    gs4_fill fill = { 0 };
    preview_solid things[3] = { { 0 } };
    gs4_sim *sim;
    int bodies[2], more = 1;
    double raised = 0;
    e.name = "candied_apple";
    e.frames = 40;
    e.cells = 24;
    e.frame_time = 1.0 / 15;
    e.takes_scheme = 1;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = (int)(0.24 / width * e.cells);
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 3 ? GS4_WALL_OPEN : GS4_WALL_STICK;
    desc.air_is_isothermal = 1;
    desc.ambient_temperature = 20;
    sim = example_create(&e, &desc);

    candy.density = 1400;
    candy.viscosity = 12;
    if (e.scheme)
        candy.incompressible = 1;
    else
        candy.sound_speed = 12;
    candy.solid = GS4_FIXED_COROTATED;
    candy.shear_modulus = 2e4;
    candy.yield_compression = candy.yield_stretch = real(0.05);
    candy.heat_capacity = 2000;
    candy.conductivity = real(0.4 * faster);
    candy.can_melt = 1;
    candy.melting_temperature = 110;
    candy.latent_heat = 5e4;
    fill.material = example_need(sim, gs4_add_material(sim, &candy));
    fill.temperature = 150;
    fill.jitter = real(0.3);
    example_need(sim, gs4_add_particles(sim,
                                        gs4_sdf(candy_around, NULL, vec(-width / 2, 0, -width / 2),
                                                vec(width / 2, level, width / 2)),
                                        &fill));
    body.contact = GS4_WALL_STICK;
    body.is_isothermal = 1;
    body.temperature = 15;
    body.shape = gs4_sphere(vec(0, low, 0), real(apple_radius));
    bodies[0] = example_need(sim, gs4_add_collider(sim, &body));
    body.shape = gs4_cylinder(vec(0, low, 0), vec(0, low + 0.1, 0), real(stick_radius));
    bodies[1] = example_need(sim, gs4_add_collider(sim, &body));

    things[0].kind = PREVIEW_SPHERE;
    things[0].radius = (float)apple_radius;
    things[0].colour[0] = 0.55f;
    things[0].colour[1] = 0.72f;
    things[0].colour[2] = 0.25f;
    things[1].kind = PREVIEW_CYLINDER;
    things[1].radius = (float)stick_radius;
    things[1].colour[0] = 0.86f;
    things[1].colour[1] = 0.74f;
    things[1].colour[2] = 0.52f;
    things[2].kind = PREVIEW_FLOOR;
    e.look.solids = things;
    e.look.solid_count = 3;
    e.look.eye[0] = 0.16f;
    e.look.eye[1] = 0.20f;
    e.look.eye[2] = 0.38f;
    e.look.target[1] = 0.105f;
    e.look.width = 400;
    e.look.height = 560;
    e.look.clarity = 0.02f;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.look.low = 20;
    e.look.high = 150;
    while (more) {
        const double up = raised < lift ? fmin(speed, (lift - raised) / e.frame_time) : 0;
        for (int k = 0; k < 2; ++k)
            example_need(sim, gs4_move_collider(sim, bodies[k], vec(0, up, 0), vec(0, 0, 0)));
        raised += up * e.frame_time;
        things[0].a[1] = things[1].a[1] = (float)(low + raised);
        things[1].b[1] = (float)(low + 0.1 + raised);
        more = example_frame(&e, sim);
    }
    gs4_destroy(sim);
    return 0;
}
