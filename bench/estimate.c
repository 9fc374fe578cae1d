/* What gs4_estimate says of a run, and what the run then takes: scenes of one kind each, with all
 * schemes and integrators. Seconds are those of the processor.
 *   cc -O3 -march=native bench/estimate.c -I. -lm -o estimate
 *   ./estimate [--cells 32] [--scene dam] [--mode 3]     CSV on standard output */
#define _POSIX_C_SOURCE 200112L
#ifndef GS4_LINKED
#define GS4MPM_IMPLEMENTATION
#endif
#include "gs4mpm.h"
#include "bench.h"
#include <math.h>

typedef struct mode {
    const char *name;
    gs4_scheme scheme;
    gs4_integrator integrator;
} mode;
static const mode modes[] = {
    { "explicit gs4", GS4_EXPLICIT, GS4_INTEGRATOR_GS4 },
    { "explicit euler", GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER },
    { "partitioned gs4", GS4_PARTITIONED, GS4_INTEGRATOR_GS4 },
    { "partitioned euler", GS4_PARTITIONED, GS4_INTEGRATOR_BACKWARD_EULER },
    { "semi-implicit gs4", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4 },
    { "semi-implicit euler", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_BACKWARD_EULER },
};
enum {
    MODES = (int)(sizeof modes / sizeof *modes)
};

/* s of processor time, so that others on the machine do not count. */
static double now(void *user)
{
    (void)user;
    return (double)clock() / CLOCKS_PER_SEC;
}

/* A box of 1 x 1 x 0.5 m, with walls of one kind. */
static gs4_sim *box_of(int cells, const mode *m, gs4_wall wall)
{
    gs4_sim_desc d;
    gs4_sim *sim;
    int i;
    memset(&d, 0, sizeof d);
    d.cells[0] = d.cells[1] = cells;
    d.cells[2] = cells / 2;
    d.cell_size = (gs4_real)(1.0 / cells);
    d.gravity = at(0, -9.81, 0);
    for (i = 0; i < 6; i++) d.walls[i] = wall;
    d.scheme = m->scheme;
    d.integrator = m->integrator;
    d.now = now;
    bench_need(NULL, gs4_create(&d, &sim));
    return sim;
}

static int add_liquid(gs4_sim *sim, double viscosity, double relaxation)
{
    gs4_material m = scene_liquid(1000, viscosity, 0);
    if (relaxation > 0) {
        m.liquid = GS4_OLDROYD_B;
        m.local_fraction = (gs4_real)0.5;
        m.relaxation_time = (gs4_real)relaxation;
    }
    bench_need(sim, gs4_add_material(sim, &m));
    return 0;
}

/* A column of water, which collapses. */
static double dam(int cells, const mode *m, gs4_sim **sim)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    *sim = box_of(cells, m, GS4_WALL_SLIP);
    add_liquid(*sim, 1e-3, 0);
    bench_need(*sim, gs4_add_particles(*sim, gs4_box(at(0, 0, 0), at(0.25, 0.5, 0.5)), &f));
    return 0.6;
}

/* Honey that an emitter pours from above; it has not given anything yet. */
static double pour(int cells, const mode *m, gs4_sim **sim)
{
    gs4_emitter e;
    *sim = box_of(cells, m, GS4_WALL_STICK);
    add_liquid(*sim, 10, 0);
    memset(&e, 0, sizeof e);
    e.shape = gs4_cylinder(at(0.5, 0.75, 0.25), at(0.5, 0.85, 0.25), (gs4_real)0.08);
    e.fill.velocity = at(0, -1, 0);
    bench_need(*sim, gs4_add_emitter(*sim, &e));
    return 1;
}

/* A drop of thick honey that falls on a floor and creeps. */
static double honey(int cells, const mode *m, gs4_sim **sim)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    *sim = box_of(cells, m, GS4_WALL_STICK);
    add_liquid(*sim, 200, 0);
    bench_need(*sim, gs4_add_particles(*sim, gs4_sphere(at(0.5, 0.3, 0.25), (gs4_real)0.18), &f));
    return 0.3;
}

/* The same of an elastic liquid. */
static double elastic(int cells, const mode *m, gs4_sim **sim)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    *sim = box_of(cells, m, GS4_WALL_STICK);
    add_liquid(*sim, 20, 0.1);
    bench_need(*sim, gs4_add_particles(*sim, gs4_sphere(at(0.5, 0.3, 0.25), (gs4_real)0.18), &f));
    return 0.4;
}

/* An elastic ball that bounces. */
static double ball(int cells, const mode *m, gs4_sim **sim)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_material rubber = scene_liquid(1000, 0, 0);
    *sim = box_of(cells, m, GS4_WALL_SEPARATE);
    rubber.solid = GS4_NEO_HOOKEAN;
    rubber.shear_modulus = (gs4_real)2e4;
    bench_need(*sim, gs4_add_material(*sim, &rubber));
    bench_need(*sim, gs4_add_particles(*sim, gs4_sphere(at(0.5, 0.4, 0.25), (gs4_real)0.18), &f));
    return 0.4;
}

/* Hot wax on a cold floor. */
static double wax(int cells, const mode *m, gs4_sim **sim)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_material w = scene_liquid(900, 5, 0);
    *sim = box_of(cells, m, GS4_WALL_STICK);
    w.heat_capacity = 2000;
    w.conductivity = (gs4_real)200;
    w.can_melt = 1;
    w.melting_temperature = 60;
    w.latent_heat = (gs4_real)2e4;
    w.solid = GS4_NEO_HOOKEAN;
    w.shear_modulus = (gs4_real)1e4;
    f.temperature = 80;
    bench_need(*sim, gs4_add_material(*sim, &w));
    bench_need(*sim, gs4_add_particles(*sim, gs4_sphere(at(0.5, 0.2, 0.25), (gs4_real)0.18), &f));
    return 0.4;
}

typedef struct scene {
    const char *name;
    double (*make)(int cells, const mode *m, gs4_sim **sim); /* how long it runs, s */
} scene;
static const scene scenes[] = { { "dam", dam },         { "pour", pour }, { "honey", honey },
                                { "elastic", elastic }, { "ball", ball }, { "wax", wax } };
enum {
    SCENES = (int)(sizeof scenes / sizeof *scenes)
};

/* A line of the table; the worst ratios so far. */
static void run(const scene *s, const mode *m, int cells, double worst[3][2])
{
    gs4_sim *sim;
    gs4_cost c;
    gs4_stats taken;
    const double duration = s->make(cells, m, &sim);
    double start = now(NULL), asked, took, ratio[3];
    int i;
    bench_need(sim, gs4_estimate(sim, m->scheme, m->integrator, duration, &c));
    asked = now(NULL) - start;
    start = now(NULL);
    if (gs4_advance(sim, (gs4_real)duration) < 0) {
        printf("# %s, %s: %s\n", s->name, m->name, gs4_last_error(sim));
        gs4_destroy(sim);
        return;
    }
    took = now(NULL) - start;
    taken = gs4_get_stats(sim);
    ratio[0] = (double)c.steps / (double)taken.steps;
    ratio[1] = c.seconds / took;
    ratio[2] = (double)c.bytes / (double)taken.memory_bytes;
    for (i = 0; i < 3; i++) {
        worst[i][0] = fmin(worst[i][0], ratio[i]);
        worst[i][1] = fmax(worst[i][1], ratio[i]);
    }
    printf("%s,%s,%d,%d,%d,%s,%.0f,%.0f,%.2f,%.3f,%.3f,%.2f,%.2f,%.2f,%.2f,%.3f\n", s->name,
           m->name, cells, taken.particles, c.particles, c.limit, (double)c.steps,
           (double)taken.steps, ratio[0], c.seconds, took, ratio[1], (double)c.bytes / 1e6,
           (double)taken.memory_bytes / 1e6, ratio[2], asked);
    fflush(stdout);
    gs4_destroy(sim);
}

int main(int argc, char **argv)
{
    double worst[3][2] = { { 1e9, 0 }, { 1e9, 0 }, { 1e9, 0 } };
    const char *only = "";
    int cells = 32, one = -1, i, k;
    for (i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--cells") == 0) cells = atoi(argv[i + 1]);
        if (strcmp(argv[i], "--scene") == 0) only = argv[i + 1];
        if (strcmp(argv[i], "--mode") == 0) one = atoi(argv[i + 1]);
    }
    bench_machine(stdout);
    printf("scene,mode,cells,particles,estimated,limit,steps estimated,taken,ratio,seconds "
           "estimated,taken,ratio,MB estimated,taken,ratio,seconds to estimate\n");
    for (i = 0; i < SCENES; i++)
        for (k = 0; k < MODES; k++)
            if (strstr(scenes[i].name, only) && (one < 0 || one == k))
                run(&scenes[i], &modes[k], cells, worst);
    for (i = 0; i < 3; i++)
        printf("# %s: %.2f to %.2f of what was taken\n", i ? i == 1 ? "seconds" : "bytes" : "steps",
               worst[i][0], worst[i][1]);
    return 0;
}
