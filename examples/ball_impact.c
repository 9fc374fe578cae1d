/* ball_impact.c - a ball falls on a floor: what it loses of its volume.
 *     cc -O3 -march=native examples/ball_impact.c -Iexamples -I. -lm -lpthread -o ball_impact
 *     ./ball_impact --row 1     explicit, sound at 1 m/s; --row 2: at 10 m/s; 25 s each
 *     ./ball_impact --row 3     partitioned, incompressible; pictures and particles in out/
 *
 * After figure 7 of the GS4 paper (figure 10: its volume over time). A liquid that carries sound
 * no faster than it falls is squeezed to a part of its volume where it lands; one that carries it
 * ten times faster nearly keeps it, and a solve for pressure keeps it however it falls. The paper
 * names neither lengths nor density, and 46 m/s, which would be Mach 5 for row 2: this is a ball of
 * 2 cm and 1225 kg/m^3 at 1 m/s, which with the viscosity of table 4 has Reynolds number 5 and
 * Froude number 2.26, as the drop of its figure 9. Pom-Pom, anisotropy 1 and not 100, as in
 * cube_impact.c. Prints two volumes: the mean of J, which is what the material believes, and what
 * particles occupy. */
#include "example.h"

int main(int argc, char **argv)
{
    const double width = 0.06, radius = 0.01, speed = 1;
    const float colours[PREVIEW_COLOURS][3] = { { 0.10f, 0.20f, 0.55f },
                                                { 0.20f, 0.45f, 0.75f },
                                                { 0.45f, 0.65f, 0.80f },
                                                { 0.90f, 0.60f, 0.30f },
                                                { 0.95f, 0.80f, 0.45f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m = { 0 };
    gs4_fill fill = { 0 };
    gs4_stats first, now;
    preview_solid floor = { 0 };
    gs4_sim *sim;
    double least_j = 1, least_occupied = 1, j = 1, occupied = 1;
    e.name = "ball_impact";
    e.frames = 60;
    e.cells = 40;
    e.frame_time = 1.0 / 500;
    e.rows = 3;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells / 2;
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    if (e.row == 3) desc.scheme = GS4_PARTITIONED;
    sim = example_create(&e, &desc);

    m.density = 1225;
    m.liquid = GS4_POM_POM;
    m.viscosity = real(4.9);
    m.local_fraction = real(0.01);
    m.relaxation_time = real(0.0098);
    m.stretch_time = real(0.0088);
    m.anisotropy = 1;
    m.arms = 8;
    m.incompressible = e.row == 3;
    if (e.row < 3) m.sound_speed = e.row == 1 ? 1 : 10;
    fill.material = example_need(sim, gs4_add_material(sim, &m));
    fill.velocity = vec(0, -speed, 0);
    fill.jitter = real(0.5);
    example_need(sim,
                 gs4_add_particles(sim, gs4_sphere(vec(0, 1.2 * radius, 0), real(radius)), &fill));
    first = gs4_get_stats(sim);

    floor.kind = PREVIEW_FLOOR;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[1] = 0.016f;
    e.look.eye[2] = 0.08f;
    e.look.target[1] = 0.007f;
    e.look.width = 480;
    e.look.height = 320;
    e.look.palette = colours;
    e.look.palette_count = PREVIEW_COLOURS;
    e.look.high = (float)speed;
    e.colour = EXAMPLE_SPEED;
    while (example_frame(&e, sim)) {
        now = gs4_get_stats(sim);
        j = now.volume / first.volume;
        occupied = now.occupied_volume / first.occupied_volume;
        least_j = fmin(least_j, j);
        least_occupied = fmin(least_occupied, occupied);
    }
    printf("of its volume at first   least   at the end\n"
           "mean of J                %.3f   %.3f\n"
           "what particles occupy    %.3f   %.3f\n",
           least_j, j, least_occupied, occupied);
    gs4_destroy(sim);
    return 0;
}
