/* pour_honey.c - honey is poured on a plate and coils.
 *     cc -O3 -march=native examples/pour_honey.c -Iexamples -I. -lm -lpthread -o pour_honey
 *     ./pour_honey                        pictures and particles in out/
 *     ./pour_honey --cells 80             finer; the time grows with the fifth power of the cells
 *
 * A rope of 8 mm leaves the emitter at 0.11 m/s and grows thinner as it falls; soon after it has
 * met the plate it buckles, and from then on it lays itself down in coils that sink into the
 * heap. */
#include "example.h"

int main(int argc, char **argv)
{
    const double width = 0.08, height = 0.065, plate_radius = 0.036, plate_thickness = 0.006;
    const float amber[1][3] = { { 0.93f, 0.60f, 0.10f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material honey;
    gs4_collider plate = { 0 };
    gs4_emitter emitter = { 0 };
    preview_solid things[2] = { { 0 } };
    gs4_sim *sim;
    e.name = "pour_honey";
    e.frames = 40;
    e.cells = 48;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * 9 / 8;
    desc.origin = vec(-width / 2, -0.01, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    gs4_material_preset("honey", &honey); /* 1420 kg/m^3, 10 Pa s */
    honey.sound_speed = real(6);          /* nothing here moves faster than 0.6 m/s */
    example_need(sim, gs4_add_material(sim, &honey));

    plate.shape = gs4_cylinder(vec(0, -plate_thickness, 0), vec(0, 0, 0), real(plate_radius));
    plate.contact = GS4_WALL_STICK;
    example_need(sim, gs4_add_collider(sim, &plate));

    emitter.shape = gs4_cylinder(vec(0, height, 0), vec(0, height + 0.006, 0), real(0.004));
    emitter.fill.velocity = vec(0, -0.11, 0);
    emitter.fill.jitter = real(0.5); /* what is symmetric has no side to fall to */
    example_need(sim, gs4_add_emitter(sim, &emitter));

    things[0].kind = PREVIEW_CYLINDER;
    things[0].a[1] = (float)-plate_thickness;
    things[0].radius = (float)plate_radius;
    things[0].colour[0] = 0.93f;
    things[0].colour[1] = 0.94f;
    things[0].colour[2] = 0.96f;
    things[1].kind = PREVIEW_FLOOR;
    things[1].a[1] = (float)-plate_thickness;
    e.look.solids = things;
    e.look.solid_count = 2;
    e.look.eye[0] = 0.03f;
    e.look.eye[1] = 0.07f;
    e.look.eye[2] = 0.155f;
    e.look.target[1] = 0.0265f;
    e.look.width = 540;
    e.look.height = 600;
    e.look.palette = amber;
    e.look.palette_count = 1;
    e.look.clarity = 0.006f;
    /* a little more than half the spacing: a smoother surface */
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
