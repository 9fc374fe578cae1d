/* bunny.c - a bunny of liquid bounces and keeps its ears; one without its memory collapses.
 *     cc -O3 -march=native examples/bunny.c -Iexamples -I. -lm -lpthread -o bunny
 *     ./bunny                             pictures and particles in out/; three minutes
 *
 * After figure 5 of the GS4 paper. The right bunny is extended Pom-Pom: 306.25 Pa s in all, of
 * which a hundredth is Newtonian, and the left one has that hundredth alone. (All of it would
 * neither bounce nor collapse: a Newtonian bunny so thick stands where it lands.) Table 4 has
 * lambda_b 0.613 s, but its G0, 4950 Pa, and its lambda_0s, 0.9 lambda_b in other rows, both say
 * 0.0613 s, which it is here.
 *
 * The paper has 29 m/s and names neither length nor density. What counts is the impact speed over
 * that of elastic waves, c = sqrt(G0/rho), as strain; lambda_b over length/c, by how much the
 * bounce is over before the liquid forgets its shape; and height, v^2/2g, over length. A foam of
 * 400 kg/m^3 (c = 3.5 m/s), 3 cm long, that lands at 1.25 m/s has 0.36, 7 and up to 2.6. It falls
 * with its nose down, turning at 22 rad/s: what lands evenly on its feet and heavy haunches is
 * thrown on its nose. A bounce is a wave, of elasticity at 3.5 and of sound at 12 m/s, that has to
 * be resolved in time anyway, so it is for the explicit scheme.
 *
 * It leaves the floor by 13 mm, 0.43 of its length, lands again after 0.13 s and hops by 3 mm, with
 * both ears, which are three cells thick. Its volume is never below 0.995 of the first and the
 * same at the end; of 74 450 particles none is apart from the others. */
#include "example.h"
#include "bunny.h"

enum {
    BUNNIES = 2
};
/* a mesh's arrays must outlive the simulation */
static gs4_real vertices[BUNNIES][BUNNY_VERTEX_COUNT][3];

/* m: how high the lowest particle of the elastic bunny, the right one, is. */
static double lowest(const gs4_sim *sim)
{
    const gs4_view at = gs4_particles(sim, GS4_FIELD_POSITION);
    const uint8_t *material = gs4_particle_materials(sim);
    double low = INFINITY;
    for (int i = 0; i < at.count; ++i)
        if (material[i] == 1) low = fmin(low, (double)at.data[(ptrdiff_t)i * at.stride + 1]);
    return low;
}

int main(int argc, char **argv)
{
    const double size = 0.03, width = 4 * size, drop = 0.4 * size, speed = 1.15, thick = 306.25;
    const float colours[BUNNIES][3] = { { 0.35f, 0.19f, 0.11f }, { 0.98f, 0.93f, 0.84f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_fill fill = { 0 };
    preview_solid floor = { 0 };
    gs4_stats first;
    gs4_sim *sim;
    double hop = 0, least = 1;
    int landed = 0;
    e.name = "bunny";
    e.frames = 48;
    e.cells = 144;
    e.frame_time = 0.0045;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = e.cells / 2;
    desc.cells[2] = e.cells * 2 / 5;
    desc.origin = vec(-width / 2, 0, -width / 5);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_SEPARATE : GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    liquid.density = 400;
    liquid.viscosity = real(0.01 * thick);
    liquid.sound_speed = 12;
    fill.velocity = vec(0, -speed, 0);
    fill.angular_velocity = vec(0, 0, 22);
    for (int i = 0; i < BUNNIES; ++i) {
        if (i) {
            liquid.viscosity = real(thick);
            liquid.liquid = GS4_POM_POM;
            liquid.local_fraction = real(0.01);
            liquid.relaxation_time = real(0.0613);
            liquid.stretch_time = real(0.0551);
            liquid.anisotropy = 1;
            liquid.arms = 8;
        }
        fill.material = example_need(sim, gs4_add_material(sim, &liquid));
        example_need(sim,
                     gs4_add_particles(sim,
                                       bunny_at(vertices[i], size, 0, 0,
                                                vec((i ? 0.7 : -1) * size, 0.49 * size + drop, 0)),
                                       &fill));
    }

    floor.kind = PREVIEW_FLOOR;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[1] = (float)(1.2 * size);
    e.look.eye[2] = (float)(4.6 * size);
    e.look.target[1] = (float)(0.75 * size);
    e.look.field_of_view = 26;
    e.look.width = 900;
    e.look.height = 480;
    e.look.palette = colours;
    e.look.palette_count = BUNNIES;
    e.look.high = BUNNIES - 1;
    e.colour = EXAMPLE_MATERIAL;
    first = gs4_get_stats(sim);
    while (example_frame(&e, sim)) {
        const double low = lowest(sim);
        least = fmin(least, gs4_get_stats(sim).volume / first.volume);
        landed = landed || low < 0.05 * size;
        if (landed) hop = fmax(hop, low);
    }
    printf("it leaves the floor by %.0f mm; the least volume is %.3f, the last %.4f\n", 1e3 * hop,
           least, gs4_get_stats(sim).volume / first.volume);
    gs4_destroy(sim);
    return 0;
}
