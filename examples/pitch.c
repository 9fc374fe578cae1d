/* pitch.c - the pitch drop experiment: a drop forms below a funnel, hangs and thins.
 *     cc -O3 -march=native examples/pitch.c -Iexamples -I. -lm -lpthread -o pitch
 *     ./pitch                             two minutes; pictures in out/
 *     ./pitch --frames 50                 on to where its thread tears: many minutes
 *
 * Pitch of 2.3e8 Pa s in the funnel of Brisbane: a stem of 9.4 by 29 mm under 75 mm of pitch, here
 * in a cylinder of 24 mm (Edgeworth, Dalton & Parnell 1984). The semi-implicit scheme: explicit
 * steps would be 4 ps, here they are up to a week, and milliseconds where crumbs fall. What has
 * left the stem is printed beside the law of Poiseuille. There is no surface tension: weight alone
 * thins the drop, and its thread crumbles where it is less than about two cells wide. A slender
 * thread would break after sqrt(12 mu A/(rho g Q)) = 0.7 years (Wilson 1988), A the section of the
 * stem, Q what flows; those of the experiment last 8 to 13, so theirs are not as simple. */
#include "example.h"

enum {
    AROUND = 48,
    RINGS = 9
};
static gs4_real vertices[3 * RINGS * AROUND];
/* those behind the middle, for pictures, come first */
static int triangles[3 * 2 * RINGS * AROUND];
static const double year = 31557600, pi = 3.14159265358979;
/* m: the stem's radius and length; the level above it; the funnel's radius there */
static const double stem = 0.0047, length = 0.029, head = 0.075, wide = 0.012;
static const double density = 1100, viscosity = 2.3e8, gravity = 9.81;

/* Inside from the stem's end up, and outside down again: rings, the last before the first. */
static void make_funnel(void)
{
    const double top = length + head + 0.006, out = wide + 0.003, lip = stem + 0.0008;
    const double r[RINGS] = { stem, stem, wide, wide, out, out, stem + 0.003, stem + 0.003, lip };
    const double y[RINGS] = {
        0, length, length, top, top, length + 0.004, length - 0.01, 0.004, 0
    };
    int *to = triangles;
    for (int k = 0; k < AROUND; ++k)
        for (int i = 0; i < RINGS; ++i) {
            const int l = (k + 1) % AROUND, here = AROUND * i, there = AROUND * ((i + 1) % RINGS);
            const int corners[6] = {
                here + k, there + k, there + l, here + k, there + l, here + l
            };
            gs4_real *at = vertices + 3 * (here + k);
            at[0] = real(r[i] * cos(2 * pi * k / AROUND));
            at[1] = real(y[i]);
            at[2] = real(-r[i] * sin(2 * pi * k / AROUND));
            for (int c = 0; c < 6; ++c) *to++ = corners[c];
        }
}

/* What has left the stem, m^3; how far it hangs down, m. */
static double volume_below(gs4_sim *sim, double *lowest)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int count = 0;
    *lowest = 0;
    for (int i = 0; i < x.count; ++i) {
        const double y = (double)x.data[i * x.stride + 1];
        count += y < 0;
        *lowest = fmax(*lowest, -y);
    }
    return gs4_get_stats(sim).mass / density * count / x.count;
}

int main(int argc, char **argv)
{
    const float black[1][3] = { { 0.06f, 0.055f, 0.06f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_collider funnel = { 0 };
    gs4_fill fill = { 0 };
    preview_solid things[2] = { { 0 } };
    gs4_sim *sim;
    e.name = "pitch";
    e.frames = 44; /* 0.88 years */
    e.cells = 28;
    e.frame_time = 0.02 * year;
    example_options(&e, argc, argv);

    desc.scheme = GS4_SEMI_IMPLICIT;
    desc.cell_size = real(0.036 / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * 29 / 6;
    desc.origin = vec(-0.018, -0.06, -0.018);
    desc.gravity = vec(0, -gravity, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    sim = example_create(&e, &desc);
    liquid.density = real(density);
    liquid.viscosity = real(viscosity);
    liquid.incompressible = 1;
    example_need(sim, gs4_add_material(sim, &liquid));
    make_funnel();
    funnel.contact = GS4_WALL_STICK;
    funnel.shape = gs4_mesh(vertices, RINGS * AROUND, triangles, 2 * RINGS * AROUND);
    example_need(sim, gs4_add_collider(sim, &funnel));
    example_need(
        sim,
        gs4_add_particles(
            sim, gs4_cylinder(vec(0, length, 0), vec(0, length + head, 0), real(wide)), &fill));
    fill.jitter = 1; /* rows of what drips would be drawn apart into beads */
    example_need(sim, gs4_add_particles(
                          sim, gs4_cylinder(vec(0, 0, 0), vec(0, length, 0), real(stem)), &fill));
    things[0].kind = PREVIEW_MESH;
    things[0].vertices = vertices;
    things[0].vertex_count = RINGS * AROUND;
    things[0].triangles = triangles;
    things[0].triangle_count = RINGS * AROUND; /* its back */
    things[1].kind = PREVIEW_FLOOR;
    things[1].a[1] = -0.06f;
    e.look.solids = things;
    e.look.solid_count = 2;
    e.look.eye[0] = 0.0f;
    e.look.eye[1] = 0.03f;
    e.look.eye[2] = 0.3f;
    e.look.target[1] = 0.025f;
    e.look.width = 360;
    e.look.height = 640;
    e.look.palette = black;
    e.look.palette_count = 1;
    do {
        /* as so much more of the stem: the cylinder, and its end (half of Sampson's opening) */
        const double tube = head * pow(stem / wide, 4), into = 3 * pi / 16 * stem;
        const double law = pi * pow(stem, 4) * density * gravity * (length + head)
                           / (8 * viscosity * (length + tube + into));
        const gs4_stats s = gs4_get_stats(sim);
        double lowest, volume = volume_below(sim, &lowest);
        printf("%.2f years: %.3f cm3 (law %.3f), hangs %.1f mm, %d steps, %.0f s\n", s.time / year,
               1e6 * volume, 1e6 * law * s.time, 1e3 * lowest, (int)s.steps, s.seconds_total);
        fflush(stdout);
    } while (example_frame(&e, sim));
    gs4_destroy(sim);
    return 0;
}
