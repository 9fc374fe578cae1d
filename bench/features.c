/* What each feature costs alone: bytes a particle, bytes a cell near material and nanoseconds a
 * particle and step of a half full box, beside a Newtonian liquid with GS4. All scenes are stepped
 * in turn, so that what disturbs the clock disturbs all; ratios are medians over turns.
 *   cc -O3 -march=native bench/features.c -I. -lm -o features
 *   ./features [--cells 24] [--rounds 15] [--steps 2]     CSV on standard output */
#define _POSIX_C_SOURCE 200112L
#ifndef GS4_LINKED
#define GS4MPM_IMPLEMENTATION
#endif
#include "gs4mpm.h"
#include "bench.h"
#include <math.h>

typedef enum feature {
    NEWTONIAN,
    BULK_MODULUS,
    FLIP,
    SHARP,
    AFFINE,
    EULER,
    OLDROYD,
    SOLID,
    YIELD,
    HEAT,
    LATENT,
    FLUX,
    PROJECTION,
    PROJECTION_K,
    PROJECTION_VISCOUS,
    PROJECTION_EULER,
    SPLIT,
    SPLIT_OLDROYD,
    SPLIT_SOLID,
    FEATURES
} feature;
static const char *const names[FEATURES] = { "Newtonian, explicit, GS4",
                                             "bulk modulus given",
                                             "flip_decay_time INFINITY",
                                             "sharp gradients",
                                             "affine",
                                             "symplectic Euler",
                                             "stress: Oldroyd-B",
                                             "solid: neo-Hookean",
                                             "solid that yields",
                                             "heat: Fourier",
                                             "heat that melts",
                                             "heat: Cattaneo",
                                             "partitioned, incompressible, inviscid",
                                             "partitioned, finite K, inviscid",
                                             "partitioned, incompressible, viscous",
                                             "the same with backward Euler",
                                             "semi-implicit, incompressible, viscous",
                                             "the same with stress",
                                             "the same with a solid" };

static gs4_sim_desc describe(feature what, int cells)
{
    gs4_sim_desc d = scene_cube(cells);
    d.gravity = at(0, -9.81, 0);
    if (what == FLIP) d.flip_decay_time = (gs4_real)INFINITY;
    if (what == SHARP) d.sharp_gradients = 1;
    if (what == AFFINE) d.affine = 1;
    if (what == EULER) d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    if (what >= PROJECTION) d.scheme = what >= SPLIT ? GS4_SEMI_IMPLICIT : GS4_PARTITIONED;
    if (what == PROJECTION_EULER) d.integrator = GS4_INTEGRATOR_BACKWARD_EULER;
    return d;
}

static gs4_material material_of(feature what)
{
    gs4_material m = scene_liquid(1000, 1, what >= PROJECTION ? 0 : 30);
    if (what == BULK_MODULUS) m.bulk_modulus = (gs4_real)9e5;
    if (what == OLDROYD || what == SPLIT_OLDROYD) {
        m.liquid = GS4_OLDROYD_B;
        m.local_fraction = (gs4_real)0.1;
        m.relaxation_time = (gs4_real)0.5;
    }
    if (what == SOLID || what == YIELD || what == SPLIT_SOLID) {
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = 1000;
    }
    if (what == YIELD) m.yield_compression = m.yield_stretch = (gs4_real)0.01;
    if (what == HEAT || what == LATENT || what == FLUX) {
        m.heat_capacity = 2000;
        m.conductivity = (gs4_real)0.5;
    }
    if (what == LATENT) {
        m.can_melt = 1;
        m.melting_temperature = 30;
        m.latent_heat = (gs4_real)1e5;
    }
    if (what == FLUX) m.flux_relaxation_time = 1;
    if (what == PROJECTION || what == PROJECTION_K) m.viscosity = 0;
    if (what >= PROJECTION && what != PROJECTION_K) m.incompressible = 1;
    return m;
}

/* The lower half of a box, `side` particles along a cell. */
static gs4_sim *scene(feature what, int cells, int side)
{
    const gs4_sim_desc d = describe(what, cells);
    const gs4_material m = material_of(what);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    int i;
    bench_need(NULL, gs4_create(&d, &sim));
    bench_need(sim, gs4_add_material(sim, &m));
    f.spacing = d.cell_size / (gs4_real)side;
    f.jitter = (gs4_real)0.2;
    if (m.heat_capacity > 0) f.temperature = 60;
    bench_need(sim, gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 0.5, 1)), &f));
    for (i = 0; i < 3; i++) bench_need(sim, gs4_step(sim, (gs4_real)0.3 * gs4_stable_dt(sim)));
    return sim;
}

/* Bytes of one more particle in the same cells, and of one more cell. */
static void count_bytes(feature what, int cells, double *particle, double *cell)
{
    gs4_stats s[3];
    int i;
    for (i = 0; i < 3; i++) {
        gs4_sim *sim = scene(what, i == 2 ? cells / 2 : cells, i == 1 ? 3 : 2);
        s[i] = gs4_get_stats(sim);
        gs4_destroy(sim);
    }
    *particle =
        ((double)s[1].memory_bytes - (double)s[0].memory_bytes) / (s[1].particles - s[0].particles);
    *cell = ((double)s[0].memory_bytes - (double)s[2].memory_bytes
             - *particle * (s[0].particles - s[2].particles))
            / (s[0].active_cells - s[2].active_cells);
}

int main(int argc, char **argv)
{
    static double times[FEATURES][64], ratios[FEATURES][64];
    gs4_sim *sims[FEATURES];
    int cells = 24, rounds = 15, steps = 2, i, k, round;
    for (i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--cells") == 0) cells = atoi(argv[i + 1]);
        if (strcmp(argv[i], "--rounds") == 0) rounds = atoi(argv[i + 1]);
        if (strcmp(argv[i], "--steps") == 0) steps = atoi(argv[i + 1]);
    }
    if (rounds > 64) rounds = 64;
    bench_machine(stdout);
    printf("feature,bytes a particle,bytes a cell,ns a particle and step,times Newtonian\n");
    for (i = 0; i < FEATURES; i++) sims[i] = scene((feature)i, cells, 2);
    for (round = 0; round < rounds; round++)
        for (i = 0; i < FEATURES; i++) {
            const int particles = gs4_get_stats(sims[i]).particles;
            const double start = bench_now(NULL);
            for (k = 0; k < steps; k++)
                bench_need(sims[i], gs4_step(sims[i], (gs4_real)0.5 * gs4_stable_dt(sims[i])));
            times[i][round] = (bench_now(NULL) - start) / steps / particles * 1e9;
            ratios[i][round] = times[i][round] / times[0][round];
        }
    for (i = 0; i < FEATURES; i++) {
        double particle, cell;
        gs4_destroy(sims[i]);
        count_bytes((feature)i, cells, &particle, &cell);
        printf("\"%s\",%.1f,%.1f,%.1f,%.2f\n", names[i], particle, cell,
               bench_median(times[i], rounds), bench_median(ratios[i], rounds));
        fflush(stdout);
    }
    return 0;
}
