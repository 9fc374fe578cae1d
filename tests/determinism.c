/* A block of liquid falls on a turning ball beside a nozzle, between walls of every kind; prints
 * a hash of the state. Every build for one machine must print the same, whatever this says, but
 * for the first three:
 *   scene=bunny    eight bunnies thrown on each other in a box, and a stamp on them, instead
 *   elastic=1      both liquids of the block viscoelastic, and gradients sharpened where there are
 *                  such; needs the same libm, too
 *   solid=1        the block an elastic solid, and what the nozzle gives a plastic one; the same
 *   heat=1         the block frozen, its flux lagging behind, between warm walls and a hot ball;
 *                  what the nozzle gives is molten and viscoelastic
 *   steps=N        length of the run (500)
 *   threads=N      of the library's own pool (GS4_PTHREADS)
 *   shuffle=1      a parallel_for that runs the tasks in another order every time
 *   checkpoint=F   half way, saves to the file F and goes on in a new simulation
 *   frames=F       writes F.ply, F.npy and, as text to compare with, F.txt */
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "../examples/bunny.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct options {
    int steps, threads, shuffle, bunnies, elastic, solid, heat;
    const char *checkpoint, *frames;
} options;

static gs4_vec3 vec(double x, double y, double z)
{
    gs4_vec3 v;
    v.x = (gs4_real)x;
    v.y = (gs4_real)y;
    v.z = (gs4_real)z;
    return v;
}

/* Tasks in the order i, i + stride, i + 2 stride, ... of the remainders by count; the stride has
 * no factor in common with it. */
static void run_shuffled(int count, gs4_task_fn task, void *context, void *user)
{
    unsigned *calls = (unsigned *)user;
    int stride = (int)(++*calls * 7919u % (unsigned)count) + 1, i, a, b,
        at_task = (int)(*calls % (unsigned)count);
    for (;; stride++) {
        for (a = stride, b = count; b;) {
            const int rest = a % b;
            a = b;
            b = rest;
        }
        if (a == 1) break;
    }
    for (i = 0; i < count; i++) {
        task(at_task, context);
        at_task = (at_task + stride) % count;
    }
}

static void stop(const char *what, const gs4_sim *sim)
{
    printf("%s: %s\n", what, gs4_last_error(sim));
    exit(2);
}

/* 0.6 x 0.4 x 0.8 m: open above, periodic along y; liquids, a ball and a nozzle; no particle yet */
static gs4_sim *create_block(gs4_sim_desc *d, const options *o)
{
    gs4_material m;
    gs4_collider c;
    gs4_emitter e;
    gs4_sim *sim;
    memset(&m, 0, sizeof m);
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    d->cells[0] = 18;
    d->cells[1] = 12;
    d->cells[2] = 24;
    d->cell_size = (gs4_real)(1.0 / 30);
    d->walls[0] = GS4_WALL_STICK;
    d->walls[1] = GS4_WALL_SEPARATE;
    d->walls[2] = d->walls[3] = GS4_WALL_PERIODIC;
    d->walls[4] = GS4_WALL_SLIP;
    d->walls[5] = GS4_WALL_OPEN;
    if (o->heat) {
        d->wall_is_isothermal[0] = 1;
        d->wall_temperature[0] = 30;
        d->air_is_isothermal = 1;
        d->ambient_temperature = 5;
    }
    if (gs4_create(d, &sim) < 0) stop("gs4_create", NULL);
    m.density = 1000;
    m.viscosity = (gs4_real)0.5;
    m.sound_speed = 20;
    if (o->elastic) {
        m.liquid = GS4_OLDROYD_B;
        m.local_fraction = (gs4_real)0.2;
        m.relaxation_time = (gs4_real)0.05;
    }
    if (o->solid || o->heat) {
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = 3000;
    }
    if (o->heat) {
        m.heat_capacity = 1000;
        m.conductivity = 400;
        m.flux_relaxation_time = (gs4_real)0.01;
        m.fourier_fraction = (gs4_real)0.3;
        m.can_melt = 1;
        m.melting_temperature = 10;
        m.latent_heat = 2000;
        m.viscous_heating = 1;
    }
    if (gs4_add_material(sim, &m) < 0) stop("gs4_add_material", sim);
    m.density = 800;
    m.viscosity = 5;
    if (o->heat) {
        m.liquid = GS4_OLDROYD_B;
        m.local_fraction = (gs4_real)0.5;
        m.relaxation_time = (gs4_real)0.05;
        m.flux_relaxation_time = m.fourier_fraction = 0;
    }
    if (o->solid) {
        m.solid = GS4_FIXED_COROTATED;
        m.yield_compression = (gs4_real)0.02;
        m.yield_stretch = (gs4_real)0.01;
    }
    /* relaxes and stretches too fast for the step: the split, mostly */
    if (o->elastic) {
        m.liquid = GS4_POM_POM;
        m.relaxation_time = (gs4_real)0.002;
        m.stretch_time = (gs4_real)0.0005;
        m.anisotropy = (gs4_real)0.3;
        m.arms = 4;
    }
    if (gs4_add_material(sim, &m) < 0) stop("gs4_add_material", sim);
    c.shape = gs4_sphere(vec(0.33, 0.21, 0.16), (gs4_real)0.09);
    c.pivot = vec(0.33, 0.21, 0.16);
    c.contact = GS4_WALL_SEPARATE;
    c.friction = (gs4_real)0.3;
    c.angular_velocity = vec(0, 4, 1);
    if (o->heat) {
        c.is_isothermal = 1;
        c.temperature = 60;
    }
    if (gs4_add_collider(sim, &c) < 0) stop("gs4_add_collider", sim);
    e.shape = gs4_cylinder(vec(0.1, 0.2, 0.5), vec(0.1, 0.2, 0.55), (gs4_real)0.05);
    if (o->heat) e.fill.temperature = 25;
    e.fill.material = 1;
    e.fill.velocity = vec(0, 0, -1);
    if (gs4_add_emitter(sim, &e) < 0) stop("gs4_add_emitter", sim);
    return sim;
}

static void fill_block(gs4_sim *sim)
{
    gs4_fill block;
    memset(&block, 0, sizeof block);
    block.velocity = vec(0.3, 0.5, 0);
    block.angular_velocity = vec(0, 0, 2);
    block.jitter = (gs4_real)0.2;
    block.random_seed = 7;
    if (gs4_add_particles(sim, gs4_box(vec(0.2, 0.1, 0.28), vec(0.45, 0.3, 0.45)), &block) < 0)
        stop("gs4_add_particles", sim);
}

/* Eight bunnies on a coarse grid with z up: a box of 0.24 x 0.24 x 0.72 m whose walls are
 * sticky, two liquids, a stamp on its way down */
static gs4_sim *create_bunnies(gs4_sim_desc *d)
{
    gs4_material m;
    gs4_collider c;
    gs4_sim *sim;
    int i;
    memset(&m, 0, sizeof m);
    memset(&c, 0, sizeof c);
    d->cells[0] = d->cells[1] = 20;
    d->cells[2] = 60;
    d->cell_size = (gs4_real)0.012;
    d->origin = vec(-0.12, -0.12, 0);
    if (gs4_create(d, &sim) < 0) stop("gs4_create", NULL);
    for (i = 0; i < 2; i++) {
        m.density = 1200;
        m.viscosity = (gs4_real)(i ? 6 : 2);
        m.sound_speed = 20;
        if (gs4_add_material(sim, &m) < 0) stop("gs4_add_material", sim);
    }
    c.shape = gs4_box(vec(-0.06, -0.06, 0.66), vec(0.06, 0.06, 0.7));
    c.contact = GS4_WALL_STICK;
    c.velocity = vec(0, 0, -3.5);
    if (gs4_add_collider(sim, &c) < 0) stop("gs4_add_collider", sim);
    return sim;
}

static void fill_bunnies(gs4_sim *sim)
{
    static gs4_real vertices[8][BUNNY_VERTEX_COUNT][3];
    gs4_fill bunny;
    int i, k;
    memset(&bunny, 0, sizeof bunny);
    for (i = 0; i < 8; i++) {
        const double turn = 1.3 * i, tip = 0.5 * i;
        for (k = 0; k < BUNNY_VERTEX_COUNT; k++) {
            const double x = (double)bunny_vertices[k][0], y = -(double)bunny_vertices[k][2],
                         z = (double)bunny_vertices[k][1] - 0.49;
            const double tipped = cos(tip) * y - sin(tip) * z;
            vertices[i][k][0] =
                (gs4_real)((i % 2 ? 0.054 : -0.054) + 0.1 * (cos(turn) * x - sin(turn) * tipped));
            vertices[i][k][1] = (gs4_real)((i / 2 % 2 ? 0.054 : -0.054)
                                           + 0.1 * (sin(turn) * x + cos(turn) * tipped));
            vertices[i][k][2] = (gs4_real)(0.06 + 0.075 * i + 0.1 * (sin(tip) * y + cos(tip) * z));
        }
        bunny.material = i % 2;
        bunny.velocity = vec(0, 0, -1 - 0.2 * i);
        if (gs4_add_particles(sim,
                              gs4_mesh(&vertices[i][0][0], BUNNY_VERTEX_COUNT,
                                       &bunny_triangles[0][0], BUNNY_TRIANGLE_COUNT),
                              &bunny)
            < 0)
            stop("gs4_add_particles", sim);
    }
}

static gs4_sim *create(gs4_integrator integrator, const options *o, unsigned *calls)
{
    gs4_sim_desc d;
    memset(&d, 0, sizeof d);
    d.gravity.z = (gs4_real)-9.81;
    d.integrator = integrator;
    if (integrator == GS4_INTEGRATOR_GS4) {
        d.rho_inf = (gs4_real)0.8;
        d.rho_inf_spurious = (gs4_real)0.2;
        d.sharp_gradients = o->elastic;
        d.affine = o->heat;
    }
    d.threads = o->threads;
    if (o->shuffle) {
        d.parallel_for = run_shuffled;
        d.parallel_user = calls;
    }
    return o->bunnies ? create_bunnies(&d) : create_block(&d, o);
}

static void write_all_frames(gs4_sim *sim, const char *name)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    const gs4_view J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    const gs4_view s = gs4_particles(sim, GS4_FIELD_STRESS);
    char path[512];
    FILE *text;
    int i, k;
    sprintf(path, "%.500s.ply", name);
    if (gs4_write_ply(sim, path) < 0) stop("gs4_write_ply", sim);
    sprintf(path, "%.500s.npy", name);
    if (gs4_write_raw(sim, path) < 0) stop("gs4_write_raw", sim);
    sprintf(path, "%.500s.txt", name);
    text = fopen(path, "w");
    if (!text) {
        printf("%s cannot be written\n", path);
        exit(2);
    }
    for (i = 0; i < x.count; i++) {
        for (k = 0; k < 3; k++) fprintf(text, "%.17g ", (double)x.data[i * x.stride + k]);
        for (k = 0; k < 3; k++) fprintf(text, "%.17g ", (double)v.data[i * v.stride + k]);
        for (k = 0; k < 6; k++)
            fprintf(text, "%.17g ", s.data ? (double)s.data[i * s.stride + k] : 0.0);
        fprintf(text, "%.17g %.17g %lu %u\n", (double)J.data[i * J.stride],
                (double)m.data[i * m.stride], (unsigned long)gs4_particle_ids(sim)[i],
                (unsigned)gs4_particle_materials(sim)[i]);
    }
    fclose(text);
}

static void hash_scene(const char *name, gs4_integrator integrator, const options *o)
{
    unsigned calls = 0;
    gs4_sim *sim = create(integrator, o, &calls);
    uint64_t hash;
    int i;
    if (o->bunnies)
        fill_bunnies(sim);
    else
        fill_block(sim);
    for (i = 0; i < o->steps; i++) {
        if (i == o->steps / 2 && o->checkpoint) {
            if (gs4_save(sim, o->checkpoint) < 0) stop("gs4_save", sim);
            gs4_destroy(sim);
            sim = create(integrator, o, &calls);
            if (gs4_load(sim, o->checkpoint) < 0) stop("gs4_load", sim);
        }
        if (i == 3 * (o->steps / 4)
            && gs4_move_collider(sim, 0, vec(0.2, 0, 0.3), vec(0, 0, 0)) < 0)
            stop("gs4_move_collider", sim);
        if (gs4_step(sim, gs4_stable_dt(sim) / 2) < 0) stop("gs4_step", sim);
    }
    hash = gs4_state_hash(sim);
    printf("%s %d steps %d particles %08lx%08lx\n", name, o->steps, gs4_get_stats(sim).particles,
           (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
    if (o->frames) write_all_frames(sim, o->frames);
    gs4_destroy(sim);
}

/* The text behind `name`, which ends in =, or NULL when the argument is another one */
static const char *value_of(const char *argument, const char *name)
{
    return strncmp(argument, name, strlen(name)) == 0 ? argument + strlen(name) : NULL;
}

int main(int count, char **values)
{
    options o = { 500, 0, 0, 0, 0, 0, 0, NULL, NULL };
    const char *v;
    int i;
    for (i = 1; i < count; i++) {
        if ((v = value_of(values[i], "scene=")) != NULL && strcmp(v, "bunny") == 0)
            o.bunnies = 1;
        else if ((v = value_of(values[i], "steps=")) != NULL)
            o.steps = atoi(v);
        else if ((v = value_of(values[i], "elastic=")) != NULL)
            o.elastic = atoi(v);
        else if ((v = value_of(values[i], "solid=")) != NULL)
            o.solid = atoi(v);
        else if ((v = value_of(values[i], "heat=")) != NULL)
            o.heat = atoi(v);
        else if ((v = value_of(values[i], "threads=")) != NULL)
            o.threads = atoi(v);
        else if ((v = value_of(values[i], "shuffle=")) != NULL)
            o.shuffle = atoi(v);
        else if ((v = value_of(values[i], "checkpoint=")) != NULL)
            o.checkpoint = v;
        else if ((v = value_of(values[i], "frames=")) != NULL)
            o.frames = v;
        else {
            printf("%s is unknown\n", values[i]);
            return 2;
        }
    }
    hash_scene("gs4", GS4_INTEGRATOR_GS4, &o);
    hash_scene("symplectic", GS4_INTEGRATOR_SYMPLECTIC_EULER, &o);
    return 0;
}
