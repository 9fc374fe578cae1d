/* dam_break.c - a column of water collapses and runs round a pillar, with either scheme.
 *     cc -O3 -march=native examples/dam_break.c -Iexamples -I. -lm -lpthread -o dam_break
 *     ./dam_break                         the partitioned scheme: incompressible, long steps
 *     ./dam_break --row 2                 the explicit one: sound at ten times the speed of water
 *
 * Walls and pillar are slippery. At the end it prints how far the front was until it met the
 * pillar; water of height H on a dry floor runs at most 2 sqrt(g H). */
#include "example.h"

static double front_of(const gs4_sim *sim)
{
    gs4_view p = gs4_particles(sim, GS4_FIELD_POSITION);
    double most = 0;
    for (int i = 0; i < p.count; ++i)
        most = fmax(most, (double)p.data[(size_t)i * (size_t)p.stride]);
    return most;
}

int main(int argc, char **argv)
{
    const double length = 1.2, height = 0.6, depth = 0.4, wide = 0.3, H = 0.4, g = 9.81;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material water = { 0 };
    gs4_fill fill = { 0 };
    gs4_collider pillar = { 0 };
    double fronts[10000], times[10000];
    preview_solid solids[2] = { { 0 }, { 0 } };
    gs4_sim *sim;
    e.name = "dam_break";
    e.frames = 75;
    e.cells = 72;
    e.frame_time = 1.0 / 50;
    e.rows = 2;
    example_options(&e, argc, argv);

    desc.cell_size = real(length / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = (int)(e.cells * height / length);
    desc.cells[2] = (int)(e.cells * depth / length);
    desc.gravity = vec(0, -g, 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_SLIP;
    desc.walls[3] = GS4_WALL_OPEN;
    if (e.row == 1) desc.scheme = GS4_PARTITIONED;
    sim = example_create(&e, &desc);

    water.density = 1000;
    water.viscosity = real(1e-3);
    if (e.row == 1)
        water.incompressible = 1;
    else
        water.sound_speed = real(10 * sqrt(2 * g * H));
    fill.material = example_need(sim, gs4_add_material(sim, &water));
    pillar.shape = gs4_box(vec(0.72, -0.1, 0.14), vec(0.82, 0.5, 0.26));
    pillar.contact = GS4_WALL_SLIP;
    example_need(sim, gs4_add_collider(sim, &pillar));
    fill.jitter = real(0.5); /* rows of a lattice would show as ripples */
    example_need(sim, gs4_add_particles(sim, gs4_box(vec(0, 0, 0), vec(wide, H, depth)), &fill));

    solids[0].kind = PREVIEW_FLOOR;
    solids[1].kind = PREVIEW_BOX;
    solids[1].a[0] = 0.72f;
    solids[1].a[2] = 0.14f;
    solids[1].b[0] = 0.82f;
    solids[1].b[1] = 0.5f;
    solids[1].b[2] = 0.26f;
    e.look.solids = solids;
    e.look.solid_count = 2;
    e.look.eye[0] = 1.5f;
    e.look.eye[1] = 0.9f;
    e.look.eye[2] = 1.6f;
    e.look.target[0] = 0.55f;
    e.look.target[1] = 0.12f;
    e.look.target[2] = 0.2f;
    e.look.field_of_view = 38;
    e.look.width = 800;
    e.look.height = 500;
    e.look.palette = preview_speed;
    e.look.high = real(sqrt(4 * g * H));
    e.colour = EXAMPLE_SPEED;
    while (example_frame(&e, sim)) {
        times[e.frame] = gs4_get_stats(sim).time;
        fronts[e.frame] = front_of(sim);
    }
    printf("  t (s)   front (m)\n");
    for (int i = 1; i <= e.frames && (i == 1 || fronts[i - 1] < 0.72); ++i)
        printf("%7.3f %9.3f\n", times[i], fronts[i]);
    gs4_destroy(sim);
    return 0;
}
