/* wax.c - candles of wax in hot air: how much latent heat holds melting up.
 *     cc -O3 -march=native examples/wax.c -Iexamples -I. -lm -lpthread -o wax
 *     ./wax --row 1       no latent heat; --row 2: 2e5 J/kg, paraffin; --row 3: ten times that
 *
 * After figure 5 of "Augmented MPM" (2014), where the factors are 0, 1 and 10 too. The air has
 * 160 degrees, wax melts at 56. After two seconds row 1 is a puddle, after three row 2 is a column
 * on what has run off it, and row 3 has not begun to run. Greys are solid, colours liquid. Wax
 * conducts 400 times too well here. */
#include "example.h"

int main(int argc, char **argv)
{
    static const double latent[3] = { 0, 2e5, 2e6 };
    const double width = 0.20, radius = 0.03, height = 0.085, faster = 400;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m;
    gs4_fill fill = { 0 };
    preview_solid floor = { 0 };
    gs4_sim *sim;
    e.name = "wax";
    e.frames = 36;
    e.cells = 48;
    e.rows = 3;
    e.frame_time = 0.1;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells / 2;
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i)
        desc.walls[i] = i == 2 ? GS4_WALL_STICK : i == 3 ? GS4_WALL_OPEN : GS4_WALL_SLIP;
    desc.air_is_isothermal = 1;
    desc.ambient_temperature = 160;
    sim = example_create(&e, &desc);

    example_need(sim, gs4_material_preset("wax", &m));
    m.latent_heat = real(latent[e.row - 1]);
    /* eighty times that of paraffin: films thicker than a cell, and no splash */
    m.viscosity = 4;
    m.conductivity = real((double)m.conductivity * faster);
    fill.material = example_need(sim, gs4_add_material(sim, &m));
    fill.temperature = 20;
    fill.jitter = real(0.5);
    example_need(sim, gs4_add_particles(
                          sim, gs4_cylinder(vec(0, 0, 0), vec(0, height, 0), real(radius)), &fill));

    floor.kind = PREVIEW_FLOOR;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[0] = 0.05f;
    e.look.eye[1] = 0.15f;
    e.look.eye[2] = 0.32f;
    e.look.target[1] = 0.035f;
    e.look.width = 420;
    e.look.height = 420;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.look.low = 20;
    e.look.high = 160;
    e.look.shine = 0.5f;
    e.colour = EXAMPLE_TEMPERATURE;
    e.melting = (double)m.melting_temperature;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
