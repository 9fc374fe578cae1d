/* A million steps each of small scenes that should go on for ever: a pool at rest, a cup that a
 * paddle stirs, a jelly ball that rings. What drifts, at decades of steps.
 *   cc -O3 -march=native bench/long.c -I. -lm -o long        (-DGS4_DOUBLE for double)
 *   ./long [--steps 1000000] [--scene pool|cup|ball] [--affine|--euler]  CSV on standard output
 * mass, volume (by how densely particles lie, and by J), height of the centre of mass: over those
 * at first. kinetic: over rho V g H (pool, cup; H the depth) or that at first (ball). momentum: its
 * size over mass and the speed of sound; spin: angular momentum about the axis of the ball over
 * that at first, 0 elsewhere. */
#define _POSIX_C_SOURCE 200112L
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"
#include <math.h>

enum {
    POOL,
    CUP,
    BALL,
    SCENES
};
static const char *const names[SCENES] = { "pool", "cup", "ball" };
static const double g = 9.81, h = 0.01, sound = 10, density = 1000;

/* Velocities of a turn and, in opposite halves, of a twist about z. */
static void twist(gs4_sim *sim, double middle)
{
    gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i;
    for (i = 0; i < v.count; i++) {
        const gs4_real *p = x.data + i * x.stride;
        const double w = 1 + 100 * ((double)p[2] - middle);
        v.data[i * v.stride] = (gs4_real)(-w * ((double)p[1] - middle));
        v.data[i * v.stride + 1] = (gs4_real)(w * ((double)p[0] - middle));
    }
}

enum {
    GS4,
    AFFINE,
    EULER
};
static const char *const how_names[3] = { "GS4", "affine GS4", "symplectic Euler" };

static gs4_sim *scene(int which, int how)
{
    gs4_sim_desc d = scene_cube(which == BALL ? 14 : 8);
    gs4_material m = scene_liquid(density, which == CUP ? 0.1 : 0.001, sound);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_collider paddle;
    gs4_sim *sim;
    int i;
    d.cell_size = (gs4_real)h;
    if (which == POOL) d.cells[2] = 4;
    if (which != BALL) d.gravity = at(0, -g, 0);
    if (how == EULER) d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    d.affine = how == AFFINE;
    if (which == BALL) {
        m.viscosity = 0;
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = (gs4_real)(0.1 * density * sound * sound);
        for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    }
    bench_need(NULL, gs4_create(&d, &sim));
    bench_need(sim, gs4_add_material(sim, &m));
    bench_need(sim, gs4_add_particles(sim,
                                      which == BALL
                                          ? gs4_sphere(at(7 * h, 7 * h, 7 * h), (gs4_real)(3 * h))
                                          : gs4_box(at(0, 0, 0), at(1, 4 * h, 1)),
                                      &f));
    if (which == BALL) twist(sim, 7 * h);
    if (which != CUP) return sim;
    memset(&paddle, 0, sizeof paddle);
    paddle.shape =
        gs4_box(at(2 * h, 1.5 * h, 3.25 * h), at(6 * h, 6 * h, 4.75 * h)); /* stands above it */
    paddle.contact = GS4_WALL_SLIP;
    paddle.pivot = at(4 * h, 4 * h, 4 * h);
    paddle.angular_velocity = at(0, 3, 0);
    gs4_remove_particles(sim, paddle.shape);
    bench_need(sim, gs4_add_collider(sim, &paddle));
    return sim;
}

static double height(const gs4_sim *sim)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    double sum = 0;
    int i;
    for (i = 0; i < x.count; i++) sum += (double)x.data[i * x.stride + 1] / x.count;
    return sum;
}

static double size(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static void print(gs4_sim *sim, int which, const gs4_stats *first, double first_height)
{
    const gs4_stats s = gs4_get_stats(sim);
    const double unit = which == BALL ? first->kinetic_energy : first->mass * g * 4 * h,
                 turn = which == BALL ? s.angular_momentum[2] / first->angular_momentum[2] : 0;
    printf("%.0f,%.5g,%d,%.2e,%.5f,%.5f,%.5f,%.5f,%.5f,%.3e,%.3e,%.2e,%.6f,%.0f\n", (double)s.steps,
           s.time, s.particles, s.mass / first->mass - 1,
           s.occupied_volume / first->occupied_volume, s.volume / first->volume, s.min_volume_ratio,
           s.max_volume_ratio, height(sim) / first_height, s.kinetic_energy / unit, s.max_speed,
           size(s.momentum) / (s.mass * sound), turn, (double)s.memory_bytes);
    fflush(stdout);
}

/* Steps to each power of ten, as long as gs4_advance takes them. */
static void follow(int which, int how, double steps)
{
    gs4_sim *sim = scene(which, how);
    const gs4_stats first = gs4_get_stats(sim);
    const double first_height = height(sim), start = bench_now(NULL);
    double next = 1;
    printf("# %s, %s, %d particles\n", names[which], how_names[how], first.particles);
    puts("steps,time,particles,mass off,occupied volume,volume,least J,largest J,height,kinetic,"
         "max speed,momentum,spin,bytes");
    while (next <= steps) {
        const gs4_budget to = { (int)(next - (double)gs4_get_stats(sim).steps), 0, NULL, NULL };
        bench_need(sim, gs4_advance_within(sim, (gs4_real)1000, &to, NULL));
        print(sim, which, &first, first_height);
        next = next < steps && next * 10 > steps ? steps : next * 10;
    }
    printf("# %.0f s\n", bench_now(NULL) - start);
    gs4_destroy(sim);
}

int main(int count, char **values)
{
    double steps = 1e6;
    int how = GS4, only = SCENES, i, k;
    for (i = 1; i < count; i++) {
        if (!strcmp(values[i], "--euler")) how = EULER;
        if (!strcmp(values[i], "--affine")) how = AFFINE;
        if (!strcmp(values[i], "--steps") && i + 1 < count) steps = atof(values[i + 1]);
        for (k = 0; k < SCENES; k++)
            if (!strcmp(values[i], names[k])) only = k;
    }
    bench_machine(stdout);
    printf("# bytes of gs4_real %d\n", (int)sizeof(gs4_real));
    for (k = 0; k < SCENES; k++)
        if (only == SCENES || only == k) follow(k, how, steps);
    return 0;
}
