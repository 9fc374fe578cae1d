/* print3d.c - a nozzle prints a star of hot polymer, which sets on a cold bed; then the bed
 * drops away and the part bounces on it.
 *     cc -O3 -march=native examples/print3d.c -Iexamples -I. -lm -lpthread -o print3d
 *     ./print3d                           pictures and particles in out/
 *
 * After figures 15 and 16 of the GS4 paper. The nozzle climbs by one layer a turn. What leaves it
 * has 200 degrees and sets at 110, cooled by bed and air (25), into an elastic solid of 60 kPa.
 * When all is cold the bed is pulled down faster than the part can fall. The melt is Oldroyd-B with
 * half of its viscosity local, as in the paper (table 4), but 20 Pa s and not 2, or a bead would be
 * flat before it sets. For the sake of coarse cells it conducts 1000 times too well, and beads are
 * 18 mm wide. */
#include "example.h"

static const double pi = 3.14159265358979;

static gs4_vec3 star(double angle, double y) /* its outline */
{
    const double r = 0.068 * (1 + 0.24 * cos(5 * angle));
    return vec(r * sin(angle), y, r * cos(angle));
}

/* The nozzle's velocity over `dt` at `speed`, rising by `climb` a turn; moves `angle` on. */
static gs4_vec3 print_on(double *angle, double speed, double climb, double dt)
{
    const gs4_vec3 a = star(*angle, 0), near_a = star(*angle + 1e-3, 0);
    const double turned =
        1e-3 * speed * dt / hypot((double)near_a.x - (double)a.x, (double)near_a.z - (double)a.z);
    const gs4_vec3 b = star(*angle + turned, 0);
    *angle += turned;
    return vec(((double)b.x - (double)a.x) / dt, climb * turned / (2 * pi) / dt,
               ((double)b.z - (double)a.z) / dt);
}

int main(int argc, char **argv)
{
    const double width = 0.25, bed_top = 0.14, bed_half = 0.11, bead = 0.009, outlet_height = 0.009,
                 layer = 0.0105, layers = 3, low = bed_top + layer;
    const double speed = 0.5, faster = 1000, cooling = 0.5, dropping = 0.05, drop = 0.12;
    const int chords = 8; /* of the path, a frame */
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m = { 0 };
    gs4_collider bed = { 0 };
    gs4_emitter nozzle = { 0 };
    /* kind, two corners or ends, radius, colour */
    preview_solid things[3] = {
        { PREVIEW_FLOOR },
        { PREVIEW_BOX, { 0 }, { 0 }, 0, { 0.62f, 0.68f, 0.74f } },
        { PREVIEW_CYLINDER, { 0 }, { 0 }, (float)bead, { 0.75f, 0.62f, 0.30f } }
    };
    gs4_sim *sim;
    int collider, emitter, more = 1;
    double angle = 0, dt, lift = 0;
    gs4_vec3 at, travel;
    e.name = "print3d";
    e.frames = 96;
    e.cells = 48;
    e.frame_time = 1.0 / 20;
    example_options(&e, argc, argv);
    dt = e.frame_time / chords;
    e.frame_time = dt; /* example_frame does the last of them */

    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[1] = desc.cells[2] = e.cells;
    desc.origin = vec(-width / 2, -0.02, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    desc.air_is_isothermal = 1;
    desc.ambient_temperature = 25;
    sim = example_create(&e, &desc);

    m.density = 1000;
    m.liquid = GS4_OLDROYD_B;
    m.viscosity = 20;
    m.local_fraction = real(0.5);
    m.relaxation_time = real(0.5);
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = real(6e4);
    m.heat_capacity = 2000;
    m.conductivity = real(0.2 * faster);
    m.can_melt = 1;
    m.melting_temperature = 110;
    m.latent_heat = 2e4;
    example_need(sim, gs4_add_material(sim, &m));

    bed.shape =
        gs4_box(vec(-bed_half, bed_top - 0.02, -bed_half), vec(bed_half, bed_top, bed_half));
    bed.contact = GS4_WALL_SEPARATE;
    bed.friction = 1;
    bed.is_isothermal = 1;
    bed.temperature = 25;
    collider = example_need(sim, gs4_add_collider(sim, &bed));
    while (angle < 2 * pi * layers) {
        print_on(&angle, speed, layer, dt);
        nozzle.stop += real(dt);
    }
    angle = 0;
    at = star(0, low);
    nozzle.shape =
        gs4_cylinder(at, vec((double)at.x, low + outlet_height, (double)at.z), real(bead));
    nozzle.fill.temperature = 200;
    /* as much as a bead one layer high and as wide as the nozzle takes */
    nozzle.fill.velocity = vec(0, -2 * layer / (pi * bead) * speed, 0);
    nozzle.fill.jitter = real(0.3);
    emitter = example_need(sim, gs4_add_emitter(sim, &nozzle));

    e.look.solids = things;
    e.look.eye[0] = 0.10f;
    e.look.eye[1] = 0.36f;
    e.look.eye[2] = 0.50f;
    e.look.target[1] = 0.10f;
    e.look.width = 520;
    e.look.height = 480;
    e.look.radius = 0.29f * (float)desc.cell_size;
    e.look.low = 25;
    e.look.high = 200;
    e.look.shine = 0.5f;
    e.colour = EXAMPLE_TEMPERATURE;
    e.melting = (double)m.melting_temperature;
    for (int i = 0; more; i = (i + 1) % chords) {
        const double stop = (double)nozzle.stop, t = gs4_get_stats(sim).time,
                     since = t - stop - cooling;
        const int printing =
            t<stop - 0.5 * dt, falls = since> - 0.5 * dt && since < dropping - 0.5 * dt;
        travel =
            printing ? print_on(&angle, speed, layer, dt) : vec(0, t < stop + 0.2 ? 0.3 : 0, 0);
        example_need(sim, gs4_move_emitter(sim, emitter, travel));
        example_need(sim, gs4_move_collider(sim, collider, vec(0, falls ? -drop / dropping : 0, 0),
                                            vec(0, 0, 0)));
        at = vec((double)at.x + (double)travel.x * dt, (double)at.y + (double)travel.y * dt,
                 (double)at.z + (double)travel.z * dt);
        lift -= falls ? drop / dropping * dt : 0;
        for (int a = 0; a < 3; ++a) {
            things[1].a[a] = (float)(a == 1 ? bed_top - 0.02 + lift : -bed_half);
            things[1].b[a] = (float)(a == 1 ? bed_top + lift : bed_half);
        }
        things[2].a[0] = things[2].b[0] = (float)at.x;
        things[2].a[2] = things[2].b[2] = (float)at.z;
        things[2].a[1] = (float)((double)at.y + outlet_height);
        things[2].b[1] = (float)((double)at.y + 0.05);
        e.look.solid_count = t < stop + 0.3 ? 3 : 2;
        if (i + 1 < chords && e.frame < e.frames)
            example_need(sim, gs4_advance(sim, real(dt)));
        else
            more = example_frame(&e, sim);
    }
    gs4_destroy(sim);
    return 0;
}
