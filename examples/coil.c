/* coil.c - a thick rope of liquid falls on a plate: Newtonian, Oldroyd-B, Pom-Pom.
 *     cc -O3 -march=native examples/coil.c -Iexamples -I. -lm -lpthread -o coil
 *     ./coil --row 1          Newtonian; --row 2: Oldroyd-B; --row 3: Pom-Pom; pictures in out/
 *     ./coil --scheme semi-implicit     no step by viscosity or sound
 *
 * The materials are those of the GS4 paper (table 4, coiling 1 to 3; figure 2); 61.25 Pa s are
 * local in all three. The scene is that of pour_honey.c, four times as large: the paper names no
 * lengths and no density. Row 1 coils fast and narrowly, and the coils melt into the heap. In
 * rows 2 and 3 the rope is elastic for 12 s (245 Pa): it lies down in wide loops that stay. */
#include "example.h"

int main(int argc, char **argv)
{
    const double width = 0.34, height = 0.28, plate_radius = 0.15, plate_thickness = 0.025;
    const float colours[3][3] = { { 0.93f, 0.60f, 0.10f },
                                  { 0.36f, 0.62f, 0.85f },
                                  { 0.90f, 0.50f, 0.62f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_collider plate = { 0 };
    gs4_emitter emitter = { 0 };
    preview_solid things[2] = { { 0 } };
    gs4_sim *sim;
    e.name = "coil";
    e.frames = 60;
    e.cells = 40;
    e.rows = 3;
    e.takes_scheme = 1;
    e.frame_time = 1.0 / 15;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * 9 / 8;
    desc.origin = vec(-width / 2, -0.04, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    liquid.density = 1000;
    liquid.viscosity = real(e.row == 1 ? 61.25 : 3063);
    if (e.scheme)
        liquid.incompressible = 1;
    else
        liquid.sound_speed = 12; /* ten times what anything here moves at */
    if (e.row > 1) {
        liquid.liquid = e.row == 2 ? GS4_OLDROYD_B : GS4_POM_POM;
        liquid.local_fraction = real(0.02);
        liquid.relaxation_time = real(12.25); /* G0 = 245 Pa */
    }
    if (e.row == 3) {
        liquid.stretch_time = real(11.025);
        liquid.anisotropy = 1;
        liquid.arms = 16;
    }
    example_need(sim, gs4_add_material(sim, &liquid));

    plate.shape = gs4_cylinder(vec(0, -plate_thickness, 0), vec(0, 0, 0), real(plate_radius));
    plate.contact = GS4_WALL_STICK;
    example_need(sim, gs4_add_collider(sim, &plate));

    emitter.shape = gs4_cylinder(vec(0, height, 0), vec(0, height + 0.024, 0), real(0.017));
    emitter.fill.velocity = vec(0, -0.23, 0);
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
    e.look.eye[0] = 0.13f;
    e.look.eye[1] = 0.30f;
    e.look.eye[2] = 0.66f;
    e.look.target[1] = 0.113f;
    e.look.width = 480;
    e.look.height = 540;
    e.look.palette = &colours[e.row - 1];
    e.look.palette_count = 1;
    e.look.clarity = e.row == 1 ? 0.025f : 0;
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
