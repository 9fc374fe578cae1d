/* ketchup.c - a nozzle that travels on a circle lays an even bead of ketchup, which stands.
 *     cc -O3 -march=native examples/ketchup.c -Iexamples -I. -lm -lpthread -o ketchup
 *     ./ketchup                           two minutes; pictures in out/
 *
 * The nozzle, 8 mm wide, travels as fast as ketchup leaves it, so that the bead has the area of its
 * bore, 50.3 mm^2. Then it stops and lifts, and what was in it stays as a dollop at the end. What
 * the program prints is measured from particles, in sectors of 15 degrees: how even the bead is
 * away from its two ends, and its height half a second after the nozzle has gone and at the end.
 * The semi-implicit scheme: what should stand creeps, the less the smaller creep_rate is. A tenth
 * of the preset's makes 2000 Pa s at rest, which would hold explicit steps to less than a
 * microsecond; here they follow the nozzle, 4 ms. */
#include "example.h"

enum {
    SECTORS = 24,
    CHORDS = 4 /* of the path, a frame */
};
static const double pi = 3.14159265358979, ring = 0.036, speed = 0.1, bore = 0.004, gap = 0.005;

static gs4_vec3 on_ring(double angle, double y)
{
    return vec(ring * sin(angle), y, ring * cos(angle));
}

/* Of each sector of the ring: the area across the bead (m^2) and, of what is within a bore of its
 * middle, the mean height (m). */
static void measure(gs4_sim *sim, double density, double area[SECTORS], double height[SECTORS])
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   mass = gs4_particles(sim, GS4_FIELD_MASS);
    const double arc = 2 * pi * ring / SECTORS;
    for (int s = 0; s < SECTORS; ++s) area[s] = height[s] = 0;
    for (int i = 0; i < x.count; ++i) {
        const gs4_real *p = x.data + (size_t)i * (size_t)x.stride;
        const double volume = (double)mass.data[(size_t)i * (size_t)mass.stride] / density;
        const double turn = atan2((double)p[0], (double)p[2]) / (2 * pi);
        const int s = (int)((turn < 0 ? turn + 1 : turn) * SECTORS) % SECTORS;
        area[s] += volume / arc;
        if (fabs(hypot((double)p[0], (double)p[2]) - ring) < bore)
            height[s] += volume / arc / (2 * bore);
    }
}

static void report(const double area[SECTORS], const double laid[SECTORS],
                   const double height[SECTORS])
{
    const int first = 2, count = SECTORS - 5; /* without the ends */
    double mean = 0, least = area[first], most = area[first];
    printf("sector   area (mm^2)   height when laid, at the end (mm)\n");
    for (int s = 0; s < SECTORS; ++s)
        printf("%6d %13.1f %18.2f %12.2f\n", s, 1e6 * area[s], 1e3 * laid[s], 1e3 * height[s]);
    for (int s = first; s < first + count; ++s) {
        mean += area[s] / count;
        least = fmin(least, area[s]);
        most = fmax(most, area[s]);
    }
    if (!(mean > 0)) return; /* too few frames */
    printf("sectors %d to %d: %.1f mm^2, %+.1f to %+.1f %%\n", first, first + count - 1, 1e6 * mean,
           100 * (least / mean - 1), 100 * (most / mean - 1));
}

int main(int argc, char **argv)
{
    const double width = 0.1, last = 2 * pi * (SECTORS - 1.5) / SECTORS;
    const float red[1][3] = { { 0.70f, 0.07f, 0.03f } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material ketchup;
    gs4_emitter nozzle = { 0 };
    gs4_pose to = { { 0, 0, 0 }, { 0 } };
    preview_solid things[3] = {
        { PREVIEW_FLOOR },
        { PREVIEW_CYLINDER, { 0 }, { 0 }, 0.055f, { 0.93f, 0.94f, 0.96f } },
        { PREVIEW_CYLINDER, { 0 }, { 0 }, 0.0045f, { 0.95f, 0.8f, 0.3f } }
    };
    double angle = 0, dt, lift = 0, laid[SECTORS] = { 0 }, area[SECTORS], height[SECTORS];
    gs4_sim *sim;
    int emitter, more = 1;
    e.name = "ketchup";
    e.frames = 80;
    e.cells = 64;
    e.frame_time = 1.0 / 20;
    example_options(&e, argc, argv);
    dt = e.frame_time / CHORDS;
    e.frame_time = dt; /* example_frame does the last of them */

    desc.scheme = GS4_SEMI_IMPLICIT;
    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells / 4;
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    sim = example_create(&e, &desc);
    gs4_material_preset("ketchup", &ketchup); /* 1140 kg/m^3, stands under 15 Pa */
    ketchup.herschel_bulkley.creep_rate = real(0.01);
    ketchup.incompressible = 1;
    example_need(sim, gs4_add_material(sim, &ketchup));

    nozzle.shape = gs4_cylinder(on_ring(0, gap), on_ring(0, gap + 0.002), real(bore));
    nozzle.pivot = on_ring(0, 0);
    nozzle.fill.velocity = vec(0, -speed, 0); /* so the bead has the area of the bore */
    nozzle.fill.jitter = real(0.3);
    nozzle.stop = real(last * ring / speed);
    emitter = example_need(sim, gs4_add_emitter(sim, &nozzle));

    things[0].a[1] = -0.005f;
    things[1].a[1] = -0.005f;
    e.look.solids = things;
    e.look.solid_count = 3;
    e.look.eye[0] = 0.02f;
    e.look.eye[1] = 0.11f;
    e.look.eye[2] = 0.16f;
    e.look.width = 600;
    e.look.height = 440;
    e.look.palette = red;
    e.look.palette_count = 1;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.look.shine = 0.6f;
    for (int i = 0; more; i = (i + 1) % CHORDS) {
        const double t = gs4_get_stats(sim).time;
        if (angle < last - 1e-9)
            angle = fmin(last, angle + speed * dt / ring);
        else
            lift += 0.1 * dt;
        to.position = on_ring(angle, lift);
        example_need(sim, gs4_move_emitter_to(sim, emitter, &to, real(dt)));
        things[2].a[0] = things[2].b[0] = (float)to.position.x;
        things[2].a[2] = things[2].b[2] = (float)to.position.z;
        things[2].a[1] = (float)(lift + gap);
        things[2].b[1] = (float)(lift + gap + 0.04);
        if (i + 1 < CHORDS && e.frame < e.frames)
            example_need(sim, gs4_advance(sim, real(dt)));
        else
            more = example_frame(&e, sim);
        measure(sim, (double)ketchup.density, area, height);
        for (int s = 0; s < SECTORS; ++s) /* half a second after the nozzle has left it */
            if (t < 2 * pi * ring / speed * (s + 1) / SECTORS + 0.5) laid[s] = height[s];
    }
    report(area, laid, height);
    gs4_destroy(sim);
    return 0;
}
