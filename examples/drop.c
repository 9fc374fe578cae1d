/* drop.c - a drop of 2 cm falls on a sticky floor and spreads: Reynolds number 5, a test case of
 * many papers.
 *     cc -O3 -march=native examples/drop.c -Iexamples -I. -lm -lpthread -o drop
 *     ./drop                              pictures in out/, and at the end its width over time
 *
 * Centre 2 D above the floor, 1 m/s down at the start, so that it meets the floor at t U/D =
 * 1.33 with 1.26 m/s. A volume-of-fluid solution has the widths 1.36 D at 2, 1.42 at 3, 1.45 at
 * 4 and 1.48 at 5. */
#include "example.h"

/* Of the whole drop, mean of x and z: the outermost particles stand for half a spacing more. */
static double width_of(const gs4_sim *sim, double spacing)
{
    gs4_view p = gs4_particles(sim, GS4_FIELD_POSITION);
    double low[3] = { 1e9, 1e9, 1e9 }, high[3] = { -1e9, -1e9, -1e9 };
    for (int i = 0; i < p.count; ++i)
        for (int a = 0; a < 3; ++a) {
            const double x = (double)p.data[(size_t)i * (size_t)p.stride + (size_t)a];
            if (x < low[a]) low[a] = x;
            if (x > high[a]) high[a] = x;
        }
    return 0.5 * (high[0] - low[0] + high[2] - low[2]) + spacing;
}

int main(int argc, char **argv)
{
    const double D = 0.02, U = 1;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_fill fill = { 0 };
    preview_solid floor = { 0 };
    static double time[10000], width[10000];
    gs4_sim *sim;
    e.name = "drop";
    e.frames = 50;
    e.cells = 48;
    e.frame_time = 0.1 * D / U;
    example_options(&e, argc, argv);

    desc.cell_size = real(3 * D / e.cells);
    desc.cells[0] = desc.cells[1] = desc.cells[2] = e.cells;
    desc.origin = vec(-1.5 * D, 0, -1.5 * D);
    desc.gravity = vec(0, -9.81, 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    desc.walls[2] = GS4_WALL_STICK;
    sim = example_create(&e, &desc);

    liquid.density = 1000;
    liquid.viscosity = 4;
    fill.material = example_need(sim, gs4_add_material(sim, &liquid));
    fill.velocity = vec(0, -U, 0);
    example_need(sim, gs4_add_particles(sim, gs4_sphere(vec(0, 2 * D, 0), real(0.5 * D)), &fill));

    floor.kind = PREVIEW_FLOOR;
    floor.radius = (float)D;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[1] = 0.025f;
    e.look.eye[2] = 0.11f;
    e.look.target[1] = 0.02f;
    e.look.width = 480;
    e.look.height = 480;
    e.look.palette = preview_speed;
    e.look.high = 1.3f;
    e.colour = EXAMPLE_SPEED;
    while (example_frame(&e, sim)) {
        time[e.frame] = gs4_get_stats(sim).time * U / D;
        width[e.frame] = width_of(sim, 0.5 * (double)desc.cell_size) / D;
    }
    printf("  t U/D   width/D\n");
    for (int i = 1; i <= e.frames; ++i) printf("%7.2f %9.3f\n", time[i], width[i]);
    gs4_destroy(sim);
    return 0;
}
