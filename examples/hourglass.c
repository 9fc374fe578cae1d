/* hourglass.c - a thick liquid runs through the throat of an hourglass.
 *     cc -O3 -march=native examples/hourglass.c -Iexamples -I. -lm -lpthread -o hourglass
 *     ./hourglass                         pictures and particles in out/
 *     ./hourglass --row 2                 the same in Pom-Pom
 *
 * Shows shapes given by a distance function: the glass is one, and so is the filling. Materials
 * as in the GS4 paper (figures 12 and 13; table 4, hourglass 1 and 2): 0.49 Pa s, and a Pom-Pom
 * of as much local viscosity and of 49 Pa s in all. The first runs as a stream. The second comes
 * out of the throat in clumps as wide as the throat and wider, which hang on threads until those
 * tear. It has a glass three times as large (54 cm): in the small one its weight does not get it
 * through. */
#include "example.h"

/* radii of both, half the height, m */
typedef struct glass {
    double throat, bulb, half;
} glass;

/* How far (x, y, z) is inside of the glass's inner surface, m. The profile is a cosine,
 * narrowest at y = 0; dividing by the length of the gradient turns the difference of radii into
 * very nearly a distance. */
static double depth_inside(const glass *g, gs4_vec3 p)
{
    const double pi = 3.14159265358979, y = fmin(fabs((double)p.y), g->half) / g->half,
                 swell = g->bulb - g->throat;
    const double radius = g->throat + 0.5 * swell * (1 - cos(pi * y)),
                 slope = 0.5 * pi * swell / g->half * sin(pi * y);
    return (radius - sqrt((double)p.x * (double)p.x + (double)p.z * (double)p.z))
           / sqrt(1 + slope * slope);
}

/* negative in the glass, outside of the hollow */
static gs4_real glass_distance(gs4_vec3 p, void *user)
{
    return real(depth_inside((const glass *)user, p));
}

/* negative in the hollow between two heights */
static gs4_real liquid_distance(gs4_vec3 p, void *user)
{
    const glass *g = (const glass *)user;
    const double y = (double)p.y,
                 inside = fmin(depth_inside(g, p), fmin(y - 0.03 * g->half, 0.78 * g->half - y));
    return real(-inside);
}

int main(int argc, char **argv)
{
    const float mint[1][3] = { { 0.25f, 0.72f, 0.66f } };
    example e = { 0 };
    glass g;
    gs4_vec3 low, high;
    double scale;
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_fill fill = { 0 };
    gs4_collider wall = { 0 };
    preview_solid frame[6] = { { 0 } };
    gs4_sim *sim;
    e.name = "hourglass";
    e.frames = 60;
    e.cells = 24;
    e.rows = 2;
    example_options(&e, argc, argv);

    scale = e.row == 1 ? 1 : 3;
    g.throat = 0.008 * scale;
    g.bulb = 0.034 * scale;
    g.half = 0.09 * scale;
    low = vec(-g.bulb, -g.half, -g.bulb);
    high = vec(g.bulb, g.half, g.bulb);
    desc.cell_size = real(0.08 * scale / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * 9 / 4;
    desc.origin = vec(-0.04 * scale, -g.half, -0.04 * scale);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    /* s that viscosity takes over a cell */
    desc.flip_decay_time = real(1000.0 / 0.49 * 0.08 * 0.08 * scale * scale / e.cells / e.cells);
    sim = example_create(&e, &desc);

    liquid.density = 1000;
    liquid.viscosity = real(e.row == 1 ? 0.49 : 49);
    liquid.sound_speed = real(12 * sqrt(scale));
    if (e.row == 2) {
        liquid.liquid = GS4_POM_POM;
        liquid.local_fraction = real(0.01);
        liquid.relaxation_time = real(1.96); /* G0 = 24.75 Pa */
        liquid.stretch_time = real(1.764);
        liquid.anisotropy = 1;
        liquid.arms = 16;
    }
    fill.material = example_need(sim, gs4_add_material(sim, &liquid));
    example_need(sim, gs4_add_particles(sim, gs4_sdf(liquid_distance, &g, low, high), &fill));

    wall.shape = gs4_sdf(glass_distance, &g, low, high);
    wall.contact = GS4_WALL_STICK;
    example_need(sim, gs4_add_collider(sim, &wall));

    /* the glass cannot be seen; its frame can */
    for (int i = 0; i < 5; ++i) {
        const float k = (float)scale, r = 0.041f * k,
                    x = i < 2 ? 0 : r * 0.93f * cosf(2.1f * (float)i),
                    z = i < 2 ? 0 : r * 0.93f * sinf(2.1f * (float)i);
        const float end = (float)g.half, from = i == 0 ? -end - 0.006f * k : i == 1 ? end : -end;
        frame[i].kind = PREVIEW_CYLINDER;
        frame[i].a[0] = frame[i].b[0] = x;
        frame[i].a[2] = frame[i].b[2] = z;
        frame[i].a[1] = from;
        frame[i].b[1] = i < 2 ? from + 0.006f * k : end;
        frame[i].radius = i < 2 ? r : 0.0018f * k;
        frame[i].colour[0] = 0.62f;
        frame[i].colour[1] = 0.45f;
        frame[i].colour[2] = 0.30f;
    }
    frame[5].kind = PREVIEW_FLOOR;
    frame[5].a[1] = (float)(-g.half - 0.006 * scale);
    e.look.solids = frame;
    e.look.solid_count = 6;
    e.look.eye[1] = (float)(0.03 * scale);
    e.look.eye[2] = (float)(0.37 * scale);
    e.look.target[1] = (float)(-0.003 * scale);
    e.look.width = 480;
    e.look.height = 640;
    e.look.palette = mint;
    e.look.palette_count = 1;
    e.look.clarity = (float)(0.02 * scale);
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
