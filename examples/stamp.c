/* stamp.c - nine bunnies of toothpaste fall on each other; then a word is stamped in the pile.
 *     cc -O3 -march=native examples/stamp.c -Iexamples -I. -lm -lpthread -o stamp
 *     ./stamp                             pictures and particles in out/; two minutes
 *
 * After figures 1 and 4 of the GS4 paper. Its bunnies are Newtonian, and a print in those fills
 * again; a liquid that keeps one has a yield stress, here 150 Pa, the weight of 12 mm of it. At
 * rest it has 1500 Pa s, so it is for the semi-implicit scheme, whose steps do not follow
 * viscosity. The stamp, a plate with the word, is a separating body: it comes off clean. Prints how
 * deep the word is when the stamp has left and at the end. */
#include "example.h"
#include "bunny.h"

enum {
    BUNNIES = 9,
    BARS = 14
};
/* a mesh's arrays must outlive the simulation */
static gs4_real vertices[BUNNIES][BUNNY_VERTEX_COUNT][3];

/* The word, of bars a unit wide, and its plate: left, lower, right and upper sides, in units. */
static const double bars[BARS][4] = { { 0, 4, 4, 5 },   { 0, 0, 1, 5 },   { 0, 0, 4, 1 },
                                      { 3, 0, 4, 3 },   { 2, 2, 4, 3 },   { 5, 4, 9, 5 },
                                      { 5, 2, 6, 5 },   { 5, 2, 9, 3 },   { 8, 0, 9, 3 },
                                      { 5, 0, 9, 1 },   { 10, 2, 11, 5 }, { 10, 2, 14, 3 },
                                      { 13, 0, 14, 5 }, { -1, -1, 15, 6 } };
static const double across = 14, high = 5, unit = 0.0075, tall = 0.02, relief = 0.009; /* m */

/* Distance to the stamp, its lower side at y = 0. */
static gs4_real stamp_distance(gs4_vec3 at, void *user)
{
    const double X = (double)at.x / unit + across / 2, Y = high / 2 - (double)at.z / unit;
    double best = 1;
    (void)user;
    for (int i = 0; i < BARS; ++i) {
        const double *b = bars[i], low = i == BARS - 1 ? relief : 0;
        const double x = unit * fmax(b[0] - X, X - b[2]), z = unit * fmax(b[1] - Y, Y - b[3]),
                     y = fmax(low - (double)at.y, (double)at.y - tall);
        best = fmin(best, hypot(hypot(fmax(x, 0), fmax(y, 0)), fmax(z, 0))
                              + fmin(0, fmax(fmax(x, z), y)));
    }
    return real(best);
}

/* m: how much lower the pile is under the word's strokes than between them, on average. Its height
 * is that of the highest particle in a square of half a unit. */
static double print_depth(const gs4_sim *sim)
{
    double top[10][28] = { { 0 } }, sum[2] = { 0 }, count[2] = { 0 };
    const double side = unit / 2;
    const gs4_view at = gs4_particles(sim, GS4_FIELD_POSITION);
    for (int i = 0; i < at.count; ++i) {
        const gs4_real *p = at.data + (ptrdiff_t)i * at.stride;
        const int c = (int)floor((double)p[0] / side) + 14, r = (int)floor((double)p[2] / side) + 5;
        if (c >= 0 && c < 28 && r >= 0 && r < 10) top[r][c] = fmax(top[r][c], (double)p[1]);
    }
    for (int r = 0; r < 10; ++r)
        for (int c = 0; c < 28; ++c) {
            const int outside =
                stamp_distance(vec((c - 13.5) * side, relief / 2, (r - 4.5) * side), NULL) > 0;
            sum[outside] += top[r][c];
            count[outside] += top[r][c] > 0;
        }
    return sum[1] / fmax(count[1], 1) - sum[0] / fmax(count[0], 1);
}

int main(int argc, char **argv)
{
    static const double place[BUNNIES][5] = {
        { -0.044, 0.023, -0.0165, 3, 0 },  { 0.001, 0.024, -0.0165, 3.1, 0 },
        { 0.045, 0.023, -0.0165, 3.2, 0 }, { -0.045, 0.023, 0.0165, 0.1, 0 },
        { 0, 0.023, 0.0165, 0, 0 },        { 0.045, 0.024, 0.0165, -0.1, 0 },
        { -0.04, 0.067, 0, 0.3, 1.3 },     { 0.003, 0.068, 0.002, 2.9, 1.5 },
        { 0.044, 0.067, -0.002, 0.1, 1.4 }
    };
    const float paste_colour[1][3] = { { 0.56f, 0.78f, 0.80f } };
    const double width = 0.16, size = 0.041, start = 0.11, low = 0.006;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material paste;
    gs4_fill fill = { 0 };
    gs4_collider stamp = { 0 };
    preview_solid things[1 + BARS] = { { 0 } };
    gs4_pose pose = { 0 };
    gs4_sim *sim;
    int body;
    e.name = "stamp";
    e.frames = 45;
    e.cells = 48;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[1] = e.cells;
    desc.cells[2] = e.cells * 2 / 3;
    desc.origin = vec(-width / 2, 0, -width / 3);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    desc.scheme = GS4_SEMI_IMPLICIT;
    sim = example_create(&e, &desc);

    example_need(sim, gs4_material_preset("toothpaste", &paste));
    paste.incompressible = 1;
    fill.velocity = vec(0, -0.5, 0);
    fill.material = example_need(sim, gs4_add_material(sim, &paste));
    for (int i = 0; i < BUNNIES; ++i) {
        const double *p = place[i]; /* x, y, z, turn, tip */
        example_need(
            sim, gs4_add_particles(
                     sim, bunny_at(vertices[i], size, p[3], p[4], vec(p[0], p[1], p[2])), &fill));
    }
    stamp.shape =
        gs4_sdf(stamp_distance, NULL, vec(-9 * unit, 0, -5 * unit), vec(9 * unit, tall, 5 * unit));
    stamp.contact = GS4_WALL_SEPARATE;
    body = example_need(sim, gs4_add_collider(sim, &stamp));

    e.look.solids = things;
    e.look.solid_count = 1 + BARS;
    e.look.eye[1] = 0.25f;
    e.look.eye[2] = 0.10f;
    e.look.target[1] = 0.01f;
    e.look.width = 640;
    e.look.height = 480;
    e.look.palette = paste_colour;
    e.look.palette_count = 1;
    e.look.shine = -1;

    for (double at = start;;) { /* where the stamp's lower side is */
        const double t = e.frame * e.frame_time;
        const double speed = t < 0.3 ? 0 : t < 0.8 ? (low - at) / (0.8 - t) : t < 1 ? 0.3 : 1;
        pose.position.y = real(at);
        if (!e.frame) example_need(sim, gs4_put_collider(sim, body, &pose));
        example_need(sim, gs4_move_collider(sim, body, vec(0, speed, 0), vec(0, 0, 0)));
        if (e.frame == 30)
            printf("the print is %.1f mm deep when the stamp has left\n", 1e3 * print_depth(sim));
        at += speed * e.frame_time;
        for (int i = 0; i < BARS; ++i)
            for (int k = 0; k < 2; ++k) {
                float *corner = k ? things[1 + i].b : things[1 + i].a;
                corner[0] = (float)(unit * (bars[i][2 * k] - across / 2));
                corner[1] = (float)(at + (k ? tall : i == BARS - 1 ? relief : 0));
                corner[2] = (float)(unit * (high / 2 - bars[i][3 - 2 * k]));
                things[1 + i].kind = PREVIEW_BOX;
            }
        if (!example_frame(&e, sim)) break;
    }
    printf("and %.1f mm at the end\n", 1e3 * print_depth(sim));
    gs4_destroy(sim);
    return 0;
}
