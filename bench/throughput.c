/* Nanoseconds a particle and step: one block of a million particles, 8 a cell, settled and
 * stirred, GS4 and symplectic Euler, beside a textbook MLS-MPM loop (plain_mpm.c) in the same
 * run; then viscoelastic liquids, solids, melting, threads, the partitioned scheme, and what an
 * empty domain around costs.
 *   cc -O3 -march=native bench/throughput.c -I. -lm -lpthread -o throughput
 *   ./throughput [--particles N] [--steps N] [--repeats N]
 * CSV on standard output. */
#define _POSIX_C_SOURCE 200112L
#define GS4_PTHREADS
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"
#include "plain_mpm.c"

typedef struct row {
    double min_ns, median_ns, bytes_particle;
    int particles;
    uint64_t hash;
    double sort_share;
} row;

static gs4_sim *scene(int edge, const int cells[3], gs4_scheme scheme, gs4_integrator integrator,
                      gs4_liquid liquid, gs4_solid solid, int threads, int stirred)
{
    gs4_sim_desc d = scene_cube(edge);
    gs4_material m = scene_liquid(1000, 1, 30);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    int a, n;
    for (a = 0; a < 3; a++) d.cells[a] = cells[a];
    d.gravity = at(0, -9.81, 0);
    d.scheme = scheme;
    d.integrator = integrator;
    d.threads = threads;
    d.now = bench_now;
    d.max_particles = 8 * edge * edge * edge;
    if (gs4_create(&d, &sim) < 0) {
        puts(gs4_last_error(NULL));
        exit(1);
    }
    m.liquid = liquid;
    m.solid = solid;
    if (solid != GS4_NO_SOLID) m.shear_modulus = 1000;
    if (liquid != GS4_NEWTONIAN) {
        m.local_fraction = (gs4_real)0.1;
        m.relaxation_time = (gs4_real)0.5;
    }
    if (liquid == GS4_POM_POM) {
        m.stretch_time = (gs4_real)0.25;
        m.anisotropy = (gs4_real)0.1;
        m.arms = 4;
    }
    if (gs4_add_material(sim, &m) < 0) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    f.jitter = (gs4_real)0.2;
    f.random_seed = 1;
    n = gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f);
    if (n < 0) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    /* a swirl about the middle, one turn a second, for a while */
    if (stirred) {
        const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
        gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (a = 0; a < n; a++) {
            const gs4_real *p = x.data + (size_t)a * (size_t)x.stride;
            v.data[(size_t)a * (size_t)v.stride] = (gs4_real)(6 * ((double)p[2] - 0.5));
            v.data[(size_t)a * (size_t)v.stride + 2] = (gs4_real)(-6 * ((double)p[0] - 0.5));
        }
    }
    return sim;
}

/* The block in a corner of 128^3 cells or more, its upper quarter molten: with `solid`
 * GS4_NO_SOLID what is frozen flows, too. */
static gs4_sim *melting_scene(int edge, gs4_solid solid)
{
    const int n = edge < 128 ? 128 : edge, top = edge * 3 / 4;
    gs4_sim_desc d = scene_cube(edge);
    gs4_material m = scene_liquid(1000, 1, 30);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    d.cells[0] = d.cells[1] = d.cells[2] = n;
    d.gravity = at(0, -9.81, 0);
    d.now = bench_now;
    d.max_particles = 8 * edge * edge * edge;
    if (gs4_create(&d, &sim) < 0) {
        puts(gs4_last_error(NULL));
        exit(1);
    }
    m.heat_capacity = 2000;
    m.conductivity = (gs4_real)0.5;
    m.can_melt = 1;
    m.melting_temperature = 30;
    m.latent_heat = (gs4_real)1e5;
    m.solid = solid;
    m.shear_modulus = solid == GS4_NO_SOLID ? 0 : (gs4_real)1e4;
    if (gs4_add_material(sim, &m) < 0) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    f.jitter = (gs4_real)0.2;
    f.random_seed = 1;
    f.temperature = 20;
    if (gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, (double)top / edge, 1)), &f) < 0) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    f.temperature = 60;
    if (gs4_add_particles(sim, gs4_box(at(0, (double)top / edge, 0), at(1, 1, 1)), &f) < 0) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    return sim;
}

static row measure(gs4_sim *sim, int steps, int repeats)
{
    double times[64], before;
    row r;
    int i, k;
    const int n = gs4_get_stats(sim).particles;
    for (i = 0; i < 3; i++)
        if (gs4_step(sim, (gs4_real)(0.6 * (double)gs4_stable_dt(sim))) < 0) {
            puts(gs4_last_error(sim));
            exit(1);
        }
    before = gs4_get_stats(sim).seconds_sort;
    for (k = 0; k < repeats; k++) {
        const double start = bench_now(NULL);
        for (i = 0; i < steps; i++)
            if (gs4_step(sim, (gs4_real)(0.6 * (double)gs4_stable_dt(sim))) < 0) {
                puts(gs4_last_error(sim));
                exit(1);
            }
        times[k] = (bench_now(NULL) - start) / steps / n * 1e9;
    }
    r.particles = n;
    r.sort_share = (gs4_get_stats(sim).seconds_sort - before) / repeats / steps / n * 1e9;
    r.median_ns = bench_median(times, repeats);
    r.min_ns = times[0];
    r.hash = gs4_state_hash(sim);
    r.bytes_particle =
        ((double)gs4_get_stats(sim).memory_bytes - 48.0 * gs4_get_stats(sim).active_cells) / n;
    return r;
}

static double report(const char *name, gs4_sim *sim, int steps, int repeats)
{
    const row r = measure(sim, steps, repeats);
    printf("%s,%d,%.1f,%.1f,%.1f,%.1f,%016llx\n", name, r.particles, r.min_ns, r.median_ns,
           r.sort_share, r.bytes_particle, (unsigned long long)r.hash);
    fflush(stdout);
    gs4_destroy(sim);
    return r.median_ns;
}

static double plain(const char *name, int edge, int stirred, int steps, int repeats)
{
    int cells[3], k, i;
    float low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, gravity[3] = { 0, -9.81f, 0 };
    double times[64], min;
    plain_sim *p;
    cells[0] = cells[1] = cells[2] = edge;
    p = plain_create(cells, 1.0f / (float)edge, 1000, 30, 1, gravity, PLAIN_SLIP);
    if (!p || plain_add_block(p, low, high, 0.5f / (float)edge, 1) < 0) {
        puts("no memory");
        exit(1);
    }
    if (stirred) {
        plain_swirl(p, 6);
        plain_shuffle(p, 1);
    }
    plain_step(p, 1e-4f);
    for (k = 0; k < repeats; k++) {
        const double start = bench_now(NULL);
        for (i = 0; i < steps; i++) plain_step(p, 1e-4f);
        times[k] = (bench_now(NULL) - start) / steps / plain_particle_count(p) * 1e9;
    }
    min = bench_median(times, repeats);
    printf("%s,%d,%.1f,%.1f,,,\n", name, (int)plain_particle_count(p), times[0], min);
    plain_destroy(p);
    return min;
}

int main(int count, char **values)
{
    int particles = 1000000, steps = 5, repeats = 7, i, edge = 4;
    double gs4[2], euler[2], text[2], elastic[2], solid[3], melting[2], two;
    double projected[3];
    for (i = 1; i + 1 < count; i += 2) {
        if (strcmp(values[i], "--particles") == 0)
            particles = atoi(values[i + 1]);
        else if (strcmp(values[i], "--steps") == 0)
            steps = atoi(values[i + 1]);
        else if (strcmp(values[i], "--repeats") == 0)
            repeats = atoi(values[i + 1]);
    }
    if (repeats > 64) repeats = 64;
    while (8 * edge * edge * edge < particles) edge++;
    {
        const int snug[3] = { edge, edge, edge };
        bench_machine(stdout);
        puts("scene,particles,min_ns,median_ns,of_which_sort_ns,bytes_a_particle,state_hash");
        for (i = 0; i < 2; i++) {
            text[i] = plain(i ? "textbook stirred" : "textbook settled", edge, i, steps, repeats);
            gs4[i] = report(i ? "gs4 stirred" : "gs4 settled",
                            scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_NEWTONIAN,
                                  GS4_NO_SOLID, 1, i),
                            steps, repeats);
            euler[i] = report(i ? "euler stirred" : "euler settled",
                              scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER,
                                    GS4_NEWTONIAN, GS4_NO_SOLID, 1, i),
                              steps, repeats);
        }
        elastic[0] = report(
            "gs4 Oldroyd-B settled",
            scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_OLDROYD_B, GS4_NO_SOLID, 1, 0),
            steps, repeats);
        elastic[1] = report(
            "gs4 Pom-Pom settled",
            scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_POM_POM, GS4_NO_SOLID, 1, 0),
            steps, repeats);
        solid[0] = report("gs4 neo-Hookean settled",
                          scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_NEWTONIAN,
                                GS4_NEO_HOOKEAN, 1, 0),
                          steps, repeats);
        solid[1] = report("gs4 fixed-corotated settled",
                          scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_NEWTONIAN,
                                GS4_FIXED_COROTATED, 1, 0),
                          steps, repeats);
        solid[2] = report("euler neo-Hookean settled",
                          scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER,
                                GS4_NEWTONIAN, GS4_NEO_HOOKEAN, 1, 0),
                          steps, repeats);
        melting[0] =
            report("gs4 melting, all flows", melting_scene(edge, GS4_NO_SOLID), steps, repeats);
        melting[1] = report("gs4 melting, neo-Hookean below", melting_scene(edge, GS4_NEO_HOOKEAN),
                            steps, repeats);
        two = report(
            "gs4 settled two threads",
            scene(edge, snug, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_NEWTONIAN, GS4_NO_SOLID, 2, 0),
            steps, repeats);
        for (i = 0; i < 3; i++)
            projected[i] = report(i == 0   ? "partitioned gs4 settled"
                                  : i == 1 ? "partitioned backward Euler settled"
                                           : "partitioned gs4 settled two threads",
                                  scene(edge, snug, GS4_PARTITIONED,
                                        i == 1 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4,
                                        GS4_NEWTONIAN, GS4_NO_SOLID, i == 2 ? 2 : 1, 0),
                                  steps, repeats);
    }
    printf("# textbook over gs4: settled %.2f, stirred %.2f; over symplectic Euler: %.2f, %.2f; "
           "two threads %.2f times one\n",
           text[0] / gs4[0], text[1] / gs4[1], text[0] / euler[0], text[1] / euler[1],
           gs4[0] / two);
    printf("# over a Newtonian step: Oldroyd-B %.2f, Pom-Pom %.2f, neo-Hookean %.2f, "
           "fixed-corotated %.2f; symplectic Euler: neo-Hookean %.2f\n",
           elastic[0] / gs4[0], elastic[1] / gs4[0], solid[0] / gs4[0], solid[1] / gs4[0],
           solid[2] / euler[0]);
    printf("# a quarter of it molten: %.2f with heat alone, %.2f with solids below the melting "
           "point\n",
           melting[0] / gs4[0], melting[1] / gs4[0]);
    printf(
        "# partitioned over explicit gs4: %.2f, with backward Euler %.2f; two threads %.2f times "
        "one\n",
        projected[0] / gs4[0], projected[1] / gs4[0], projected[0] / projected[2]);
    {
        const int small[3] = { 20, 20, 20 }, huge[3] = { 512, 256, 256 };
        const double a = report(
            "50 k snug",
            scene(18, small, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_NEWTONIAN, GS4_NO_SOLID, 1, 0),
            4 * steps, repeats);
        const double b = report(
            "50 k in 33 million cells",
            scene(18, huge, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, GS4_NEWTONIAN, GS4_NO_SOLID, 1, 0),
            4 * steps, repeats);
        printf("# empty space costs a factor of %.2f\n", b / a);
    }
    return 0;
}
