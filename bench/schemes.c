/* What the same scene costs by each scheme.
 *   cc -O3 -march=native bench/schemes.c -I. -lm -lpthread -o schemes
 *   ./schemes [--threads N]     CSV on standard output; a minute
 * droplet: 57 thousand particles in 8 thousand cells fall on a floor, 50 steps of those of "GS4
 * viscoelastic MPM", 7.1.4: 1e-4 s explicit, 1e-3 s else; its table 3 has 9.05 s a step by
 * semi-implicit backward Euler, 12.28 by GS4, 1.25 explicit. pour: a stream of 1e4 Pa s onto a
 * sticky floor, 48^3 cells of 6 mm, one second, in steps of a film frame at most. Explicitly that
 * is too long to wait for: from where the semi-implicit scheme is after 1/4, 1/2, 3/4 and 1 s, 40
 * steps each are timed and the mean is taken for all. Iterations are the mean of a step, for
 * pressure or for velocity and pressure. */
#define _POSIX_C_SOURCE 200112L
#define GS4_PTHREADS
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"

typedef struct way {
    const char *name;
    gs4_scheme scheme;
    gs4_integrator integrator;
    double dt; /* of the droplet */
} way;
static const way ways[4] = {
    { "explicit", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1e-4 },
    { "partitioned", GS4_PARTITIONED, GS4_INTEGRATOR_GS4, 1e-3 },
    { "semi-implicit backward euler", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_BACKWARD_EULER, 1e-3 },
    { "semi-implicit", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4, 1e-3 },
};

static gs4_sim *make(const way *w, int is_pour, int threads)
{
    gs4_sim_desc d = scene_cube(is_pour ? 48 : 40);
    gs4_material m = scene_liquid(1000, is_pour ? 1e4 : 10, 0);
    gs4_sim *sim;
    d.cell_size = (gs4_real)(is_pour ? 0.006 : 0.01);
    d.gravity = at(0, 0, -9.81);
    d.walls[4] = GS4_WALL_STICK;
    d.scheme = w->scheme;
    d.integrator = w->integrator;
    d.threads = threads;
    d.cfl = (gs4_real)0.8;
    if (w->scheme != GS4_EXPLICIT)
        m.incompressible = 1;
    else
        m.sound_speed = is_pour ? 6 : 30; /* ten times what moves, or more */
    bench_need(NULL, gs4_create(&d, &sim));
    bench_need(sim, gs4_add_material(sim, &m));
    return sim;
}

static void print(const char *scene, const way *w, gs4_sim *sim, double steps, double seconds,
                  double iterations)
{
    const gs4_stats s = gs4_get_stats(sim);
    printf("%s,%s,%d,%d,%.0f,%.4f,%.1f,%.4g,%.3g\n", scene, w->name, s.particles, s.active_cells,
           steps, seconds / steps, iterations / steps, seconds, (double)s.memory_bytes);
    fflush(stdout);
}

static void droplet(const way *w, int threads)
{
    gs4_fill f = scene_fill(at(0, 0, -1));
    gs4_sim *sim = make(w, 0, threads);
    double seconds, iterations = 0;
    int i;
    bench_need(sim, gs4_add_particles(sim, gs4_sphere(at(0.2, 0.2, 0.13), (gs4_real)0.119), &f));
    seconds = bench_now(NULL);
    for (i = 0; i < 50; i++) {
        gs4_stats s;
        bench_need(sim, gs4_step(sim, (gs4_real)w->dt));
        s = gs4_get_stats(sim);
        iterations += s.pressure_iterations + s.viscous_iterations;
    }
    print("droplet", w, sim, 50, bench_now(NULL) - seconds, iterations);
    gs4_destroy(sim);
}

/* Adds explicit steps in a second from where `from` is, and the seconds that they take. */
static void time_explicitly(gs4_sim *from, int threads, double *steps, double *seconds)
{
    const gs4_view x = gs4_particles(from, GS4_FIELD_POSITION);
    gs4_sim *sim = make(&ways[0], 1, threads);
    gs4_real *p = (gs4_real *)malloc(3 * sizeof *p * (size_t)x.count);
    const gs4_real each = (gs4_real)(gs4_get_stats(from).mass / 1000 / x.count);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double start, dt;
    int i;
    if (!p) exit(1);
    for (i = 0; i < x.count; i++) memcpy(p + 3 * i, x.data + i * x.stride, 3 * sizeof *p);
    bench_need(sim, gs4_add_points(sim, p, x.count, each, &f));
    free(p);
    dt = (double)gs4_stable_dt(sim);
    start = bench_now(NULL);
    for (i = 0; i < 40; i++) bench_need(sim, gs4_step(sim, (gs4_real)dt));
    *steps += 1 / dt;
    *seconds += (bench_now(NULL) - start) / (40 * dt);
    if (gs4_get_stats(from).time > 0.99) print("pour", &ways[0], sim, *steps / 4, *seconds / 4, 0);
    gs4_destroy(sim);
}

/* A quarter of a second in film frames, by steps of the scheme's own; sums up their iterations. */
static double pour_quarter(gs4_sim *sim)
{
    double iterations = 0;
    gs4_budget one;
    int frame;
    memset(&one, 0, sizeof one);
    one.steps = 1;
    for (frame = 0; frame < 6; frame++) {
        double left = 1.0 / 24;
        while (left > 0) {
            gs4_stats s;
            bench_need(sim, gs4_advance_within(sim, (gs4_real)left, &one, NULL));
            s = gs4_get_stats(sim);
            left = s.time_left;
            iterations += s.viscous_iterations;
        }
    }
    return iterations;
}

static void pour(int threads)
{
    gs4_sim *sim = make(&ways[3], 1, threads);
    double seconds = 0, iterations = 0, explicit_steps = 0, explicit_seconds = 0;
    int quarter;
    gs4_emitter e;
    memset(&e, 0, sizeof e);
    e.shape = gs4_cylinder(at(0.144, 0.144, 0.2), at(0.144, 0.144, 0.212), (gs4_real)0.024);
    e.fill = scene_fill(at(0, 0, -0.3));
    e.fill.jitter = (gs4_real)0.5;
    bench_need(sim, gs4_add_emitter(sim, &e));
    for (quarter = 0; quarter < 4; quarter++) {
        const double start = bench_now(NULL);
        iterations += pour_quarter(sim);
        seconds += bench_now(NULL) - start;
        time_explicitly(sim, threads, &explicit_steps, &explicit_seconds);
    }
    print("pour", &ways[3], sim, (double)gs4_get_stats(sim).steps, seconds, iterations);
    gs4_destroy(sim);
}

int main(int count, char **values)
{
    int i, threads = 1;
    for (i = 1; i + 1 < count; i += 2)
        if (strcmp(values[i], "--threads") == 0) threads = atoi(values[i + 1]);
    bench_machine(stdout);
    printf("scene,scheme,particles,active cells,steps,seconds a step,iterations,seconds in all,"
           "bytes\n");
    for (i = 0; i < 4; i++) droplet(&ways[i], threads);
    pour(threads);
    return 0;
}
