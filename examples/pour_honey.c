/* pour_honey.c - honey is poured on a plate and coils.
 *     cc -O3 -march=native examples/pour_honey.c -Iexamples -I. -lm -lpthread -o pour_honey
 *     ./pour_honey                        pictures and particles in out/
 *     ./pour_honey --cells 96             finer and prettier; 128 takes hours */
#include "example.h"

static double num(const char *n, double d) { const char *s = getenv(n); return s ? atof(s) : d; }
int main(int argc, char **argv)
{
    double width = num("W", 0.08), mouth = num("A", 0.0045), height = num("H", 0.06), speed = num("U", 0.12);
    example e = {0};
    gs4_sim_desc d = {0};
    gs4_material honey;
    gs4_collider plate = {0};
    gs4_emitter nozzle = {0};
    gs4_sim *sim;
    e.name = "pour_honey"; e.frames = 60; e.cells = 48;
    example_options(&e, argc, argv);

    d.cell_size = real(width / e.cells);
    d.cells[0] = d.cells[2] = e.cells;
    d.cells[1] = e.cells * 10 / 8;
    d.origin = vec(-width / 2, -0.01, -width / 2);
    d.gravity = vec(0, -9.81, 0);
    d.cfl = real(num("CFL", 0.5));
    if (getenv("EULER")) d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    for (int i = 0; i < 6; ++i) d.walls[i] = GS4_WALL_OPEN;
    sim = example_create(&e, &d);

    gs4_material_preset("honey", &honey);
    honey.viscosity = real(num("MU", 10));
    honey.sound_speed = real(num("C", 8));
    example_need(sim, gs4_add_material(sim, &honey));

    plate.shape = gs4_cylinder(vec(0, -0.006, 0), vec(0, 0, 0), real(0.036));
    plate.contact = GS4_WALL_STICK;
    example_need(sim, gs4_add_collider(sim, &plate));

    nozzle.shape = gs4_cylinder(vec(0, height, 0), vec(0, height + 0.006, 0), real(mouth));
    nozzle.fill.velocity = vec(0, -speed, 0);
    nozzle.fill.jitter = real(0.5);
    example_need(sim, gs4_add_emitter(sim, &nozzle));

    preview_solid things[2] = {{0}};
    things[0].kind = PREVIEW_CYLINDER; things[0].a[1] = -0.006f; things[0].radius = 0.036f;
    things[0].colour[0] = 0.93f; things[0].colour[1] = 0.94f; things[0].colour[2] = 0.96f;
    things[1].kind = PREVIEW_FLOOR; things[1].a[1] = -0.006f;
    e.look.solids = things; e.look.solid_count = 2;
    e.look.eye[0] = 0.03f; e.look.eye[1] = 0.07f; e.look.eye[2] = 0.15f;
    e.look.target[1] = 0.025f;
    e.look.width = (int)num("PW", 720); e.look.height = (int)num("PH", 720);
    while (example_frame(&e, sim)) { gs4_stats s = gs4_get_stats(sim); fprintf(stderr, "   J %.4f %.4f vol %.4f vmax %.3f steps %d\n", s.min_volume_ratio, s.max_volume_ratio, s.volume/s.mass*1420, s.max_speed, (int)s.steps); }
    gs4_destroy(sim);
    return 0;
}
