/* letters.c - six letters of different stiffness fall on a floor: some bounce, some stay bent.
 *     cc -O3 -march=native examples/letters.c -Iexamples -I. -lm -lpthread -o letters
 *     ./letters                           the explicit scheme: K ten times G, or 256 kPa
 *     ./letters --row 2 --cells 60        the partitioned one: bulk moduli K from G to 1e6 G
 *     ./letters --row 3 --cells 60        the semi-implicit one: G 500 times as large, up to 75 MPa
 *
 * After figure 9 of "Augmented MPM" (2014), softer: shear moduli G from 20 to 150 kPa. Blue and
 * green are elastic; red, yellow and orange yield at 4 to 10 % of strain and keep the shape that
 * the fall gave them. */
#include "example.h"
#include "strokes.h"

enum {
    LETTERS = 6
};

typedef struct letter {
    const stroke *drawn;
    double middle[3], size, tilt, thick;
} letter;

/* Distance to the round bar that the pen drew, with flat front and back. */
static gs4_real letter_distance(gs4_vec3 at, void *user)
{
    const letter *l = (const letter *)user;
    const double X = ((double)at.x - l->middle[0]) / l->size,
                 Y = ((double)at.y - l->middle[1]) / l->size;
    const double x = cos(l->tilt) * X + sin(l->tilt) * Y + 0.37,
                 y = -sin(l->tilt) * X + cos(l->tilt) * Y + 0.5;
    const double side = fabs((double)at.z - l->middle[2]) / l->size - 1.3 * l->thick;
    double best = 1e9;
    for (int i = 0; i + 1 < l->drawn->points; ++i) {
        const double *a = l->drawn->path + 2 * i, *b = a + 2, dx = b[0] - a[0], dy = b[1] - a[1];
        const double t =
            fmin(1, fmax(0, ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)));
        best = fmin(best, hypot(x - a[0] - t * dx, y - a[1] - t * dy));
    }
    return real(l->size * fmax(best - l->thick, side));
}

int main(int argc, char **argv)
{
    /* G S 4 above M P M */
    static const int which[LETTERS] = { 0, 1, 2, 3, 4, 3 };
    /* shear moduli, Pa */
    static const double stiff[LETTERS] = { 150e3, 40e3, 50e3, 60e3, 20e3, 30e3 };
    static const double bulk[LETTERS] = { 1e4, 1, 1, 1e2, 1e6, 10 }; /* K/G with --row 2 */
    static const double yields[LETTERS] = { 0, 0.05, 0, 0.04, 0, 0.1 };
    static const double place[LETTERS][3] = { { -0.16, 0.29, 0.3 }, { 0.0, 0.32, -0.35 },
                                              { 0.17, 0.30, 0.25 }, { -0.17, 0.10, -0.2 },
                                              { 0.01, 0.14, 0.4 },  { 0.18, 0.095, -0.3 } };
    const float colours[LETTERS][3] = { { 0.15f, 0.25f, 0.70f }, { 0.85f, 0.20f, 0.25f },
                                        { 0.20f, 0.50f, 0.85f }, { 0.95f, 0.65f, 0.10f },
                                        { 0.25f, 0.65f, 0.40f }, { 0.90f, 0.40f, 0.15f } };
    static letter letters[LETTERS];
    const double width = 0.66;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m = { 0 };
    gs4_fill fill = { 0 };
    preview_solid floor = { 0 };
    gs4_sim *sim;
    e.name = "letters";
    e.frames = 72;
    e.cells = 110;
    e.frame_time = 1.0 / 90;
    e.rows = 3;
    example_options(&e, argc, argv);

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = e.cells * 4 / 5;
    desc.cells[2] = e.cells * 2 / 5;
    desc.origin = vec(-width / 2, 0, -width / 5);
    desc.gravity = vec(0, -9.81, 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_SEPARATE : GS4_WALL_OPEN;
    if (e.row == 2) desc.scheme = GS4_PARTITIONED;
    if (e.row == 3) desc.scheme = GS4_SEMI_IMPLICIT;
    sim = example_create(&e, &desc);

    for (int i = 0; i < LETTERS; ++i) {
        letter *l = &letters[i];
        const double r = 0.11;
        l->drawn = &stroke_letters[which[i]];
        l->size = 0.13;
        l->thick = 0.085;
        l->tilt = place[i][2];
        l->middle[0] = place[i][0];
        l->middle[1] = place[i][1];
        m.density = 1000;
        m.solid = yields[i] > 0 ? GS4_FIXED_COROTATED : GS4_NEO_HOOKEAN;
        m.shear_modulus = real((e.row == 3 ? 500 : 1) * stiff[i]);
        m.yield_compression = m.yield_stretch = real(yields[i]);
        m.bulk_modulus = real(e.row == 1   ? fmax(256e3, 10 * stiff[i])
                              : e.row == 2 ? bulk[i] * stiff[i]
                                           : 10 * (double)m.shear_modulus);
        m.viscosity = 3; /* a little damping */
        fill.material = example_need(sim, gs4_add_material(sim, &m));
        fill.velocity = vec(0, -0.8, 0);
        fill.angular_velocity = vec(i % 2 ? 0.6 : -0.4, 0, i % 2 ? -2 : 2);
        example_need(sim, gs4_add_particles(sim,
                                            gs4_sdf(letter_distance, l,
                                                    vec(l->middle[0] - r, l->middle[1] - r, -0.03),
                                                    vec(l->middle[0] + r, l->middle[1] + r, 0.03)),
                                            &fill));
    }

    floor.kind = PREVIEW_FLOOR;
    e.look.solids = &floor;
    e.look.solid_count = 1;
    e.look.eye[0] = 0.12f;
    e.look.eye[1] = 0.36f;
    e.look.eye[2] = 0.95f;
    e.look.target[1] = 0.14f;
    e.look.field_of_view = 32;
    e.look.width = 900;
    e.look.height = 700;
    e.look.palette = colours;
    e.look.palette_count = LETTERS;
    e.look.high = LETTERS - 1;
    e.look.shine = 0.4f;
    e.colour = EXAMPLE_MATERIAL;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
