/* print3d.c - nozzles print a star or letters of hot polymer in layers, which set; then the bed
 * tips up and lets go, and what was printed lands on its edge, bends, bounces and falls over.
 *     cc -O3 -march=native examples/print3d.c -Iexamples -I. -lm -lpthread -o print3d
 *     ./print3d --row 1                   a star; --row 2: letters, a nozzle each; some 4 minutes
 *
 * After figures 15 and 16 of the GS4 paper. Layers have two colours in turn; orange is what is hot.
 * It sets at 110 degrees to a solid so soft that its fall bends it; sound is slow in that:
 * explicit steps do. The melt is Oldroyd-B as in table 4, but of 10 Pa s, not 2: beads were flat
 * before they set. It conducts 1000 times too well. After 2 s G and 4 tear where they are thin. */
#include "example.h"
#include "strokes.h"

static const int layers = 3;
static const double pi = 3.14159265358979, bed_top = 0.175, bed_radius = 0.165, bead = 0.0065,
                    layer = 0.0095, dt = 0.005;

typedef struct part {
    stroke drawn;
    double middle, size, length, speed;
    int emitter, begun; /* layers */
} part;

/* Where a nozzle is after `s` metres; every other layer goes back along its stroke. */
static gs4_vec3 nozzle_at(const part *p, double s)
{
    const int k = (int)fmin(floor(s / p->length), layers - 1);
    const double done = s - k * p->length, climb = k ? k - 1 + fmin(1, done / 0.01) : 0;
    double at[2] = { 0, 0 };
    stroke_walk(&p->drawn, (k % 2 ? p->length - done : done) / p->size, at);
    return vec(p->middle + p->size * (at[0] - 0.36),
               bed_top + layer * (1.35 + climb) + 0.3 * fmax(0, done - p->length),
               p->size * (0.5 - at[1]));
}

/* What is drawn from `first` to `last` along the normal of a bed that has tipped by `angle`. */
static preview_solid rod(gs4_vec3 at, double angle, double first, double last, double radius)
{
    preview_solid is = { PREVIEW_CYLINDER };
    is.radius = (float)radius;
    is.a[0] = is.b[0] = (float)at.x;
    is.a[1] = (float)((double)at.y + first * cos(angle));
    is.b[1] = (float)((double)at.y + last * cos(angle));
    is.a[2] = (float)((double)at.z + first * sin(angle));
    is.b[2] = (float)((double)at.z + last * sin(angle));
    return is;
}

/* Moves a nozzle on for `dt`, and draws it. Each layer has an emitter, of its colour. */
static void print_on(gs4_sim *sim, part *p, double t, preview_solid *drawn)
{
    gs4_pose pose = { 0 };
    if (p->begun < layers && t * p->speed >= p->begun * p->length) {
        gs4_vec3 low = nozzle_at(p, p->speed * t), high = low;
        gs4_emitter nozzle = { 0 };
        high.y += real(1.05 * layer);
        nozzle.pivot = low;
        nozzle.shape = gs4_cylinder(low, high, real(bead));
        nozzle.fill.material = p->begun % 2;
        nozzle.fill.temperature = 200;
        nozzle.fill.velocity = vec(0, -2 * layer / (pi * bead) * p->speed, 0); /* fills a bead */
        nozzle.start = real(t);
        nozzle.stop = real(++p->begun * p->length / p->speed);
        p->emitter = example_need(sim, gs4_add_emitter(sim, &nozzle));
    }
    pose.position = nozzle_at(p, p->speed * (t + dt));
    example_need(sim, gs4_move_emitter_to(sim, p->emitter, &pose, real(dt)));
    *drawn = rod(pose.position, 0, layer, 0.1, bead);
}

int main(int argc, char **argv)
{
    const double width = 0.36, cooling = 0.15, tipping = 0.35, tip = 1.5; /* tip: rad */
    const float colours[3][3] = { { .2f, .4f, .65f }, { .5f, .75f, .9f }, { 1, .55f, .15f } };
    static part parts[3];
    preview_solid things[5] = { { PREVIEW_FLOOR } };
    const preview_settings look = { 640, 560, { .12f, .38f, .62f }, { 0, .11f, 0 } };
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material m = { 0 };
    gs4_collider bed = { 0 };
    e.name = "print3d";
    e.frames = 60;
    e.cells = 64;
    e.rows = 2;
    example_options(&e, argc, argv);
    e.frame_time = dt; /* example_frame does the last of a frame */
    const int count = e.row == 1 ? 1 : 3;
    const double stop = layers * (e.row == 1 ? 0.55 : 0.36);
    desc.cell_size = real(width / e.cells);
    desc.cells[0] = desc.cells[1] = desc.cells[2] = e.cells;
    desc.origin = vec(-width / 2, 0, -width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = i == 2 ? GS4_WALL_SEPARATE : GS4_WALL_OPEN;
    desc.air_is_isothermal = 1;
    desc.ambient_temperature = 25;
    gs4_sim *sim = example_create(&e, &desc);
    m.density = 1000;
    m.liquid = GS4_OLDROYD_B;
    m.viscosity = 10;
    m.local_fraction = m.relaxation_time = real(0.5);
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = real(8e4);
    m.bulk_modulus = real(1.6e5);
    m.heat_capacity = 2000;
    m.conductivity = real(0.2 * 1000);
    m.can_melt = 1;
    m.melting_temperature = 110;
    m.latent_heat = 2e4;
    for (int i = 0; i < 2; ++i) example_need(sim, gs4_add_material(sim, &m));
    bed.shape = gs4_cylinder(vec(0, bed_top - 0.02, 0), vec(0, bed_top, 0), real(bed_radius));
    bed.pivot = vec(0, bed_top, 0);
    bed.is_isothermal = 1;
    bed.temperature = 25;
    const int collider = example_need(sim, gs4_add_collider(sim, &bed));
    for (int i = 0; i < count; ++i) {
        part *p = &parts[i];
        p->drawn = e.row == 1 ? stroke_star() : stroke_letters[i];
        if (i == 2) p->drawn.path[6] = 0.40; /* the bar of 4 ends before its stem */
        p->size = e.row == 1 ? 0.16 : 0.125;
        p->middle = e.row == 1 ? 0 : 0.112 * (i - 1);
        p->length = p->size * stroke_walk(&p->drawn, 0, NULL);
        p->speed = layers * p->length / stop;
    }
    e.look = look;
    e.look.solids = things;
    e.look.palette = colours;
    e.look.palette_count = 3;
    e.look.high = 2;
    e.look.shine = 0.4f;
    e.colour = EXAMPLE_SETTING;
    for (int i = 0, more = 1; more; ++i) {
        const double t = i * dt, since = t + dt - stop - cooling;
        const double angle = tip / 2 * (1 - cos(pi * fmax(0, fmin(1, since / tipping))));
        const double away = fmax(0, since - tipping);
        for (int k = 0; k < count; ++k) print_on(sim, &parts[k], t, &things[2 + k]);
        const gs4_pose pose = { vec(0, bed_top - (away > 0), 0),
                                { real(cos(angle / 2)), real(sin(angle / 2)) } };
        example_need(sim, away > 0 ? gs4_put_collider(sim, collider, &pose) /* out of the way */
                                   : gs4_move_collider_to(sim, collider, &pose, real(dt)));
        things[1] = rod(bed.pivot, angle, -2 * away - 0.02, -2 * away, bed_radius);
        e.look.solid_count = since < 0 ? 2 + count : 2;
        if (e.frame < e.frames && (i + 1) % (away > 0 ? 4 : 16))
            example_need(sim, gs4_advance(sim, real(dt)));
        else
            more = example_frame(&e, sim);
    }
    gs4_destroy(sim);
    return 0;
}
