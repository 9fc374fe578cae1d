/* Random scenes, calls and edits, many of them absurd: `fuzz [first_seed] [count]` (1, 100; count
 * 0: without end). Prints how many scenes and calls there were, or the seed of what failed and the
 * line that repeats it; a sanitizer's report is followed by that line too. Build it with
 *     cc -O1 -g -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all
 *        -DGS4_PTHREADS -pthread -I. tests/fuzz.c -o fuzz -lm
 * A scene is small: 4 to 24 cells an axis, up to some thousand particles, 4 to 30 calls. It is what
 * tests/random_scene.h makes, in other units now and then (a cell of 1e-9 to 1e9), and in two of
 * three scenes with values that nobody should give: not a number, infinite, denormal, of the wrong
 * sign, off by any power of ten. Allocation fails at any place, callbacks lie, files are damaged,
 * also under a right checksum. After each call:
 *   - fields of particles are finite, J within its range, places within the domain
 *   - particles are there that were there: none appear or vanish but by what may do that, each
 *     keeps its mass and material; gs4_stats.mass is their sum
 *   - a call that is refused has a sentence, and neither hash nor stable step nor time has changed
 *   - time goes forward, by what was asked for
 *   - memory that was given back is what was asked for; after gs4_destroy all of it
 * Of three seeds one runs on 2 or 3 threads, too, one without other calls than steps that were
 * refused, and one with tasks in reverse order and, now and then, another simulation that goes on
 * from a checkpoint. Each must give the same results and hashes, call by call. */
#if !defined(_POSIX_C_SOURCE) && !defined(_WIN32)
#define _POSIX_C_SOURCE 200112L
#endif
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "random_scene.h"
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#define MOST_CALLS 32
#define MOST_PARTICLES 6000
#define MOST_BYTES ((size_t)256 << 20)
#define COUNT(a) ((int)(sizeof(a) / sizeof((a)[0])))

typedef enum variant {
    ALONE,
    TWO_THREADS,
    THREE_THREADS,
    WITHOUT_REFUSED,
    RELOADED
} variant;

static const char *const variant_names[] = { "one thread", "2 threads", "3 threads",
                                             "without refused calls",
                                             "tasks reversed and checkpoints" };

typedef struct particle {
    gs4_real mass;
    int there, material;
} particle;

/* What a scene was built of, to build it again. */
typedef struct part {
    enum {
        A_MATERIAL,
        A_COLLIDER,
        AN_EMITTER
    } kind;
    gs4_material material;
    gs4_collider collider;
    gs4_emitter emitter;
} part;

typedef struct outcome {
    const char *call;
    int result, unchanged; /* refused, it may be left out */
    uint64_t hash;
} outcome;

typedef struct run {
    scene s;
    int seed, call, calls, wild, lies; /* one value in `wild` is absurd; 0: none */
    variant how;
    double length, time, mass; /* units */
    gs4_sim_desc desc;
    part parts[MOST_CALLS];
    int part_count, with_gravity, version; /* of what a checkpoint must fit to */
    gs4_vec3 gravity;
    gs4_real viscosity[MOST_CALLS]; /* as it was set; below 0: never */
    particle *known;                /* by id */
    uint32_t known_count;
    char path[1000];
    uint64_t saved_hash; /* of what the file at `path` holds */
    int saved_version;   /* -1: there is none */
    /* before a call */
    uint64_t hash;
    gs4_real stable;
    gs4_stats stats;
    int may_add, may_drop, may_go_on, may_jump, unchanged, forged, takes_time;
} run;

static run r;
static outcome outcomes[MOST_CALLS];
static const char *program;
static int first_seed;
static long all_calls, all_refused, all_steps, all_particles, all_scenes;

/* ==== what failed ============================================================================= */

static void tell_where(void)
{
    printf("seed %d, call %d, %s\n    repeat: %s %d 1\n", r.seed, r.call, variant_names[r.how],
           program, r.seed);
    fflush(stdout);
}

static void fail(const char *what, double value)
{
    printf("failed: %s: %s (%g); last error: %s\n",
           r.call < MOST_CALLS ? outcomes[r.call].call : "", what, value,
           r.s.sim ? gs4_last_error(r.s.sim) : gs4_last_error(NULL));
    tell_where();
    exit(1);
}

static void check(int good, const char *what, double value)
{
    if (!good) fail(what, value);
}

static void on_abort(int number)
{
    tell_where();
    signal(number, SIG_DFL);
    raise(number);
}

/* Sanitizers end by abort(), so that the seed is told. */
const char *__asan_default_options(void);
const char *__asan_default_options(void) { return "abort_on_error=1:allocator_may_return_null=1"; }
const char *__ubsan_default_options(void);
const char *__ubsan_default_options(void) { return "abort_on_error=1:print_stacktrace=1"; }

/* ==== values ================================================================================== */

static double uniform(double low, double high)
{
    return low + (high - low) * pick(0, 1 << 20) / (double)(1 << 20);
}

static gs4_real special(void)
{
    const int wide = sizeof(gs4_real) == 8;
    switch (pick(0, 13)) {
    case 0: return (gs4_real)NAN;
    case 1: return (gs4_real)INFINITY;
    case 2: return (gs4_real)-INFINITY;
    case 3: return 0;
    case 4: return (gs4_real)-0.0;
    case 5: return (gs4_real)(wide ? 1e-320 : 1e-44);
    case 6: return (gs4_real)(wide ? 1e-300 : 1.2e-38);
    case 7: return (gs4_real)(wide ? 1.7e308 : 3.4e38);
    case 8: return (gs4_real)(wide ? -1.7e308 : -3.4e38);
    case 9: return (gs4_real)(wide ? 9e99 : 9e17);
    case 10: return (gs4_real)(wide ? 2e-100 : 2e-18);
    case 11: return -1;
    case 12: return 1;
    default: return (gs4_real)(1 - 1e-7);
    }
}

/* Log-uniform over all that gs4_real has, or special, or off by any power of ten up to 1e6. */
static gs4_real absurd(gs4_real sane)
{
    const double most = sizeof(gs4_real) == 8 ? 300 : 37, sign = one_in(4) ? -1 : 1;
    switch (pick(0, 3)) {
    case 0: return special();
    case 1: return (gs4_real)(sign * pow(10, uniform(-most, most)));
    default: break;
    }
    return (gs4_real)(sign * (sane == 0 ? 1 : (double)sane) * pow(10, uniform(-6, 6)));
}

static gs4_real any(gs4_real sane) { return r.wild && one_in(r.wild) ? absurd(sane) : sane; }

static int any_int(int sane)
{
    static const int values[] = { -1, INT_MIN, INT_MAX, 0, 1, 2, 3, 4, 77, 256, 1025 };
    return r.wild && one_in(2 * r.wild) ? values[pick(0, COUNT(values) - 1)] : sane;
}

/* A real member, its dimension in length, time and mass, and how many there are in a row. */
typedef struct field {
    size_t offset;
    int length, time, mass, count;
} field;

static void disturb(void *object, const field *f, int count)
{
    int i, k;
    for (i = 0; i < count; i++)
        for (k = 0; k < f[i].count; k++) {
            gs4_real *x = (gs4_real *)(void *)((char *)object + f[i].offset) + k;
            *x = any((gs4_real)((double)*x * pow(r.length, f[i].length) * pow(r.time, f[i].time)
                                * pow(r.mass, f[i].mass)));
        }
}

/* ==== hooks =================================================================================== */

static size_t bytes_out, bytes_of_pointers;
static int fail_after = -1; /* how many more allocations succeed; below 0: all */

static size_t mark(const void *memory, size_t bytes)
{
    return (size_t)gs4i_mix((uint64_t)(size_t)memory) * (bytes + 1);
}

static void *counted_alloc(size_t bytes, size_t alignment, void *user)
{
    void *memory = NULL;
    (void)user;
    if (fail_after == 0 || bytes_out + bytes > MOST_BYTES) return NULL;
    if (fail_after > 0) fail_after--;
#ifdef _WIN32
    memory = _aligned_malloc(bytes ? bytes : 1, alignment);
#else
    if (posix_memalign(&memory, alignment < 16 ? 16 : alignment, bytes ? bytes : 1) != 0)
        return NULL;
#endif
    if (!memory) return NULL;
    memset(memory, 0xa5, bytes);
    bytes_out += bytes;
    bytes_of_pointers += mark(memory, bytes);
    return memory;
}

static void counted_free(void *memory, size_t bytes, void *user)
{
    (void)user;
    bytes_out -= bytes;
    bytes_of_pointers -= mark(memory, bytes);
#ifdef _WIN32
    _aligned_free(memory);
#else
    free(memory);
#endif
}

static void tasks_reversed(int count, gs4_task_fn task, void *context, void *user)
{
    (void)user;
    while (count-- > 0) task(count, context);
}

static void heard(int level, const char *message, void *user)
{
    (void)user;
    check(level >= 0 && level <= 2 && message && message[0], "a word of the log", level);
}

static int ticks;

static double clock_of(void *user)
{
    (void)user;
    ticks++;
    if (r.lies && ticks % 7 == 0) return ticks % 2 ? NAN : -1e300;
    return ticks * 1e-3;
}

/* The same lie for the same question: threads ask in any order. */
static int lies_about(const void *question, size_t bytes)
{
    return r.lies && gs4i_hash_bytes((uint64_t)r.seed, question, bytes) % (uint64_t)r.lies == 0;
}

static gs4_real lie(const void *question, size_t bytes)
{
    static const double lies[] = { NAN, INFINITY, -INFINITY, -1, 1e30, 1e-30, 0, 1e17 };
    return (gs4_real)lies[gs4i_hash_bytes(77, question, bytes) % COUNT(lies)];
}

static gs4_real any_viscosity(gs4_real temperature, gs4_real rate, void *user)
{
    gs4_real q[2];
    q[0] = temperature;
    q[1] = rate;
    check(temperature == temperature && rate >= 0,
          "a callback is asked for a viscosity at no number", (double)rate);
    return lies_about(q, sizeof q)
               ? lie(q, sizeof q)
               : (gs4_real)((double)viscosity_of(temperature, (gs4_real)((double)rate * r.time),
                                                 user)
                            * r.mass / r.length / r.time);
}

static gs4_real any_distance(gs4_vec3 x, void *user)
{
    const gs4_real q[3] = { x.x, x.y, x.z };
    check(x.x == x.x && x.y == x.y && x.z == x.z, "a callback is asked for a distance nowhere", 0);
    return lies_about(q, sizeof q) ? lie(q, sizeof q) : octahedron_distance(x, user);
}

/* ==== before and after a call ================================================================= */

static const char *last_sentence(void) { return gs4_last_error(r.s.sim); }

/* Each particle that is there is known, or may be new; those that are gone may be. */
static void check_particles(int added)
{
    const uint32_t *id = gs4_particle_ids(r.s.sim);
    const uint8_t *material = gs4_particle_materials(r.s.sim);
    const gs4_view mass = gs4_particles(r.s.sim, GS4_FIELD_MASS);
    const gs4_stats stats = gs4_get_stats(r.s.sim);
    double sum = 0;
    int i, fresh = 0, known = 0, all = 0;
    uint32_t k;
    for (k = 0; k < r.known_count; k++) {
        all += r.known[k].there != 0;
        if (r.known[k].there) r.known[k].there = 2;
    }
    for (i = 0; i < mass.count; i++) {
        const gs4_real m = mass.data[(size_t)i * (size_t)mass.stride];
        sum += (double)m;
        if (id[i] >= r.known_count) {
            const uint32_t more = id[i] + 1000;
            check(id[i] < 10000000u, "an id", id[i]);
            r.known = (particle *)realloc(r.known, more * sizeof *r.known);
            memset(r.known + r.known_count, 0, (more - r.known_count) * sizeof *r.known);
            r.known_count = more;
        }
        if (r.known[id[i]].there == 0 || r.may_jump) {
            fresh += r.known[id[i]].there == 0;
            r.known[id[i]].mass = m;
            r.known[id[i]].material = material[i];
        }
        known += r.known[id[i]].there == 2;
        check(r.known[id[i]].there != 1, "an id is there twice", id[i]);
        check(m > 0 && r.known[id[i]].mass == m && r.known[id[i]].material == material[i]
                  && material[i] < r.s.materials,
              "mass and material of a particle", id[i]);
        r.known[id[i]].there = 1;
    }
    for (k = 0; k < r.known_count; k++) r.known[k].there = r.known[k].there == 1;
    check(stats.particles == mass.count, "gs4_stats.particles", stats.particles);
    check(fabs(stats.mass - sum) <= 1e-12 * sum, "gs4_stats.mass", stats.mass);
    check(r.may_add || r.may_jump || fresh == 0, "particles appear", fresh);
    check(r.may_drop || r.may_jump || known == all, "particles vanish", all - known);
    check(added < 0 || fresh == added, "as many particles as were said", fresh);
}

static void check_views(void)
{
    const gs4_sim_desc *d = &r.desc;
    const gs4_real low[3] = { d->origin.x, d->origin.y, d->origin.z };
    int f, i, c;
    for (f = 0; f <= GS4_FIELD_PRESSURE + 1; f++) {
        const gs4_view v = gs4_particles(r.s.sim, (gs4_field)f);
        for (i = 0; i < v.count; i++)
            for (c = 0; c < v.components; c++) {
                const double x = (double)v.data[(size_t)i * (size_t)v.stride + (size_t)c],
                             h = (double)d->cell_size;
                if (!(fabs(x) < 1e300 * (sizeof(gs4_real) == 8 ? 1e8 : 1))) fail("a field", f);
                if (f == GS4_FIELD_POSITION
                    && !(x >= (double)low[c] - 0.1 * h
                         && x <= (double)low[c] + (d->cells[c] + 0.1) * h))
                    fail("a place outside of the grid", x);
                if (f == GS4_FIELD_VOLUME_RATIO && !(x > 0.06 && x < 256.1)) fail("J", x);
            }
    }
}

static void check_stats(const gs4_stats *s)
{
    const double values[] = { s->time,
                              s->dt,
                              s->mass,
                              s->momentum[0],
                              s->kinetic_energy,
                              s->thermal_energy,
                              s->volume,
                              s->occupied_volume,
                              s->max_speed,
                              s->time_left,
                              s->min_temperature,
                              s->max_temperature,
                              s->min_volume_ratio,
                              s->max_volume_ratio,
                              s->solver_residual,
                              s->angular_momentum[0] };
    int i;
    for (i = 0; i < COUNT(values); i++)
        check(fabs(values[i]) <= 1.7e308, "a number of gs4_stats", i);
    check(s->time_left >= 0 && s->volume >= 0 && s->kinetic_energy >= 0, "a sum of gs4_stats", 0);
}

/* The calls draw from what the seed and their number say, whatever those before them drew. */
static void begin(const char *call)
{
    outcomes[r.call].call = call;
    ticks = 0;
    r.may_add = r.may_drop = r.may_go_on = r.may_jump = r.unchanged = 0;
    r.hash = gs4_state_hash(r.s.sim);
    r.stable = gs4_stable_dt(r.s.sim);
    r.stats = gs4_get_stats(r.s.sim);
    fail_after = one_in(12) ? pick(0, 8) : -1;
    if (r.how >= WITHOUT_REFUSED) fail_after = -1; /* these allocate at other places */
}

static int same_real(gs4_real a, gs4_real b) { return memcmp(&a, &b, sizeof a) == 0; }

static int end(int result, int added)
{
    gs4_stats stats = gs4_get_stats(r.s.sim);
    const gs4_real stable = gs4_stable_dt(r.s.sim);
    fail_after = -1;
    check(result >= GS4_ERROR_ABI, "the result", result);
    check(stable >= 0 && (double)stable <= 1.7e308, "the stable step", (double)stable);
    if (result < 0) {
        check(strlen(last_sentence()) > 10, "a sentence", 0);
        check(gs4_result_string(result)[0] != 0, "a word for the result", result);
        if (!r.may_go_on || stats.steps == r.stats.steps) {
            r.may_add = r.may_drop = r.may_go_on = r.may_jump = 0;
            check(gs4_state_hash(r.s.sim) == r.hash, "a refused call has changed the hash", result);
            check(same_real(stable, r.stable), "a refused call has changed the stable step",
                  (double)stable);
            check(stats.time == r.stats.time, "a refused call has changed the time", stats.time);
            r.unchanged = 1;
        }
    }
    check(r.may_jump || (r.may_go_on ? stats.time >= r.stats.time : stats.time == r.stats.time),
          "time", stats.time);
    check_stats(&stats);
    if (!r.forged) check_particles(result >= 0 ? added : -1);
    check_views();
    if (r.how == ALONE) all_calls++;
    if (r.how == ALONE && result < 0) all_refused++;
    return result;
}

/* ==== descriptions of all kinds =============================================================== */

#define REAL(type, member, l, t, m, n)     \
    {                                      \
        offsetof(type, member), l, t, m, n \
    }

static const field of_desc[] = { REAL(gs4_sim_desc, cell_size, 1, 0, 0, 1),
                                 REAL(gs4_sim_desc, origin, 1, 0, 0, 3),
                                 REAL(gs4_sim_desc, gravity, 1, -2, 0, 3),
                                 REAL(gs4_sim_desc, rho_inf, 0, 0, 0, 2),
                                 REAL(gs4_sim_desc, flip_decay_time, 0, 1, 0, 1),
                                 REAL(gs4_sim_desc, wall_temperature, 0, 0, 0, 6),
                                 REAL(gs4_sim_desc, ambient_temperature, 0, 0, 0, 1),
                                 REAL(gs4_sim_desc, cfl, 0, 0, 0, 1),
                                 REAL(gs4_sim_desc, max_dt, 0, 1, 0, 1),
                                 REAL(gs4_sim_desc, solver_tolerance, 0, 0, 0, 1) };

static const field of_material[] = { REAL(gs4_material, density, -3, 0, 1, 1),
                                     REAL(gs4_material, viscosity, -1, -1, 1, 1),
                                     REAL(gs4_material, local_fraction, 0, 0, 0, 1),
                                     REAL(gs4_material, relaxation_time, 0, 1, 0, 2),
                                     REAL(gs4_material, anisotropy, 0, 0, 0, 2),
                                     REAL(gs4_material, cross_wlf.a, 0, 0, 0, 2),
                                     REAL(gs4_material, cross_wlf.d1, -1, -1, 1, 1),
                                     REAL(gs4_material, cross_wlf.a1, 0, 0, 0, 3),
                                     REAL(gs4_material, herschel_bulkley.yield_stress, -1, -2, 1,
                                          1),
                                     REAL(gs4_material, herschel_bulkley.consistency, -1, -1, 1, 1),
                                     REAL(gs4_material, herschel_bulkley.index, 0, 0, 0, 1),
                                     REAL(gs4_material, herschel_bulkley.creep_rate, 0, -1, 0, 1),
                                     REAL(gs4_material, bulk_modulus, -1, -2, 1, 1),
                                     REAL(gs4_material, sound_speed, 1, -1, 0, 1),
                                     REAL(gs4_material, shear_modulus, -1, -2, 1, 1),
                                     REAL(gs4_material, yield_compression, 0, 0, 0, 2),
                                     REAL(gs4_material, heat_capacity, 2, -2, 0, 1),
                                     REAL(gs4_material, conductivity, 1, -3, 1, 1),
                                     REAL(gs4_material, flux_relaxation_time, 0, 1, 0, 1),
                                     REAL(gs4_material, fourier_fraction, 0, 0, 0, 2),
                                     REAL(gs4_material, latent_heat, 2, -2, 0, 1) };

static const field of_fill[] = { REAL(gs4_fill, spacing, 1, 0, 0, 1),
                                 REAL(gs4_fill, velocity, 1, -1, 0, 3),
                                 REAL(gs4_fill, angular_velocity, 0, -1, 0, 3),
                                 REAL(gs4_fill, temperature, 0, 0, 0, 2) };

static const field of_shape[] = { REAL(gs4_shape, a, 1, 0, 0, 6),
                                  REAL(gs4_shape, radius, 1, 0, 0, 1) };

static const field of_collider[] = { REAL(gs4_collider, friction, 0, 0, 0, 1),
                                     REAL(gs4_collider, velocity, 1, -1, 0, 3),
                                     REAL(gs4_collider, angular_velocity, 0, -1, 0, 3),
                                     REAL(gs4_collider, pivot, 1, 0, 0, 3),
                                     REAL(gs4_collider, temperature, 0, 0, 0, 1) };

static const field of_emitter[] = { REAL(gs4_emitter, travel, 1, -1, 0, 3),
                                    REAL(gs4_emitter, start, 0, 1, 0, 2),
                                    REAL(gs4_emitter, pivot, 1, 0, 0, 3) };

static const field of_pose[] = { REAL(gs4_pose, position, 1, 0, 0, 3),
                                 REAL(gs4_pose, quaternion, 0, 0, 0, 4) };

static void any_desc(gs4_sim_desc *d)
{
    const int threads = r.how == TWO_THREADS ? 2 : r.how == THREE_THREADS ? 3 : 1;
    int a;
    make_desc(&r.s, d, threads);
    if (one_in(4)) make_partitioned(d);
    if (d->scheme == GS4_PARTITIONED && one_in(2)) d->scheme = GS4_SEMI_IMPLICIT;
    for (a = 0; a < 3; a++)
        if (!one_in(3)) d->cells[a] = r.s.cells[a] = one_in(8) ? pick(15, 24) : pick(4, 10);
    if (one_in(4)) d->max_particles = pick(1, MOST_PARTICLES);
    if (one_in(4)) d->cfl = number(1, 10, 10);
    if (one_in(6)) d->max_dt = number(1, 100, 10000);
    if (one_in(6)) d->solver_max_iterations = pick(1, 20);
    if (one_in(8)) d->solver_tolerance = number(1, 100, 1000);
    disturb(d, of_desc, COUNT(of_desc));
    for (a = 0; a < 3; a++) d->cells[a] = any_int(d->cells[a]);
    for (a = 0; a < 6; a++) d->walls[a] = (gs4_wall)any_int((int)d->walls[a]);
    d->scheme = (gs4_scheme)any_int((int)d->scheme);
    d->integrator = (gs4_integrator)any_int((int)d->integrator);
    d->solver_max_iterations = any_int(d->solver_max_iterations);
    d->max_particles = any_int(d->max_particles);
    if (d->max_particles > 100000) d->max_particles = -1;
    d->allocator.alloc_fn = counted_alloc;
    if (any_int(0) == 0) d->allocator.free_fn = counted_free;
    if (r.how == RELOADED) d->parallel_for = tasks_reversed;
    d->log = heard;
    if (!one_in(4)) d->now = clock_of;
}

/* The consistency is in Pa s^index; `disturb` takes it for Pa s. */
static void make_yielding(gs4_material *m)
{
    m->liquid = GS4_NEWTONIAN;
    m->viscosity_law = GS4_VISCOSITY_HERSCHEL_BULKLEY;
    m->viscosity_fn = NULL;
    m->viscosity = m->local_fraction = m->relaxation_time = m->stretch_time = m->anisotropy =
        m->arms = 0;
    memset(&m->cross_wlf, 0, sizeof m->cross_wlf);
    if (!one_in(4)) m->herschel_bulkley.yield_stress = number(1, 100, 1);
    m->herschel_bulkley.index = one_in(4) ? 1 : number(1, 20, 10);
    m->herschel_bulkley.consistency =
        (gs4_real)(pick(0, 100) * 0.1 * pow(r.time, (double)m->herschel_bulkley.index - 1));
    m->herschel_bulkley.creep_rate = number(1, 100, 10);
}

static void any_material(gs4_material *m)
{
    static const char *const names[] = {
        "water",        "olive oil",  "glycerol", "honey",  "cream", "ice cream", "boger fluid",
        "polymer melt", "chocolate",  "wax",      "butter", "lava",  "ketchup",   "yoghurt",
        "mayonnaise",   "toothpaste", "mud",      "paint",  "blood", "ice",       ""
    };
    make_material(&r.s, r.desc.sharp_gradients, m);
    if ((m->solid == GS4_NO_SOLID || m->can_melt) && one_in(5)) make_yielding(m);
    if (one_in(5) && gs4_material_preset(names[pick(0, COUNT(names) - 1)], m) < 0)
        check(strlen(gs4_last_error(NULL)) > 10, "a sentence about presets", 0);
    if (r.desc.scheme != GS4_EXPLICIT) make_incompressible(m);
    disturb(m, of_material, COUNT(of_material));
    if (m->viscosity_fn) m->viscosity_fn = any_viscosity;
    m->liquid = (gs4_liquid)any_int((int)m->liquid);
    m->solid = (gs4_solid)any_int((int)m->solid);
    m->viscosity_law = (gs4_viscosity_law)any_int((int)m->viscosity_law);
    m->can_melt = any_int(m->can_melt);
    m->viscous_heating = any_int(m->viscous_heating);
    m->incompressible = any_int(m->incompressible);
}

/* What a shape points at is scaled once, as it is made. */
static void any_shape(gs4_shape *shape)
{
    const int slot = r.s.shapes - 1;
    int i;
    if (shape->kind == GS4_SHAPE_SDF || shape->kind == GS4_SHAPE_MESH) {
        octahedron *o = &r.s.octahedra[slot];
        gs4_real *v = &r.s.vertices[slot][0][0];
        o->centre.x = (gs4_real)((double)o->centre.x * r.length);
        o->centre.y = (gs4_real)((double)o->centre.y * r.length);
        o->centre.z = (gs4_real)((double)o->centre.z * r.length);
        o->reach = (gs4_real)((double)o->reach * r.length);
        for (i = 0; i < 24; i++) v[i] = any((gs4_real)((double)v[i] * r.length));
    }
    if (shape->kind == GS4_SHAPE_SDF && (r.lies || one_in(2))) shape->distance = any_distance;
    disturb(shape, of_shape, COUNT(of_shape));
    shape->kind = (gs4_shape_kind)any_int((int)shape->kind);
    if (shape->kind == GS4_SHAPE_MESH && !shape->vertices) shape->vertex_count = 0;
    if (shape->kind == GS4_SHAPE_MESH && one_in(40)) shape->triangle_count = pick(-1, 3);
}

static void any_fill(gs4_fill *f)
{
    make_fill(&r.s, f);
    if (one_in(3)) f->angular_velocity = vector(100, 10);
    disturb(f, of_fill, COUNT(of_fill));
    f->material = any_int(f->material);
    /* a lattice finer than a tenth of a cell takes too long */
    if (f->spacing > 0 && (double)f->spacing < 0.2 * (double)r.desc.cell_size)
        f->spacing = (gs4_real)(0.01 * (double)r.desc.cell_size);
}

static gs4_vec3 any_vector(double scale)
{
    gs4_vec3 v;
    v.x = any((gs4_real)((double)number(-100, 100, 100) * scale));
    v.y = any((gs4_real)((double)number(-100, 100, 100) * scale));
    v.z = any((gs4_real)((double)number(-100, 100, 100) * scale));
    return v;
}

static void any_pose(gs4_pose *p)
{
    int at[3], a;
    for (a = 0; a < 3; a++) at[a] = pick(-CELL, (r.s.cells[a] + 1) * CELL);
    p->position = place(&r.s, at);
    for (a = 0; a < 4; a++) p->quaternion[a] = one_in(4) ? 0 : number(-10, 10, 10);
    disturb(p, of_pose, COUNT(of_pose));
}

/* ==== calls that build ======================================================================== */

static int has_room(void)
{
    return r.s.materials > 0 && gs4_get_stats(r.s.sim).particles < MOST_PARTICLES / 2
           && r.s.shapes < MAX_SHAPES - 1;
}

static int added_part(int result)
{
    r.part_count += result >= 0;
    r.version += result >= 0;
    return result;
}

static int add_material(void)
{
    part *p = &r.parts[r.part_count];
    int result;
    p->kind = A_MATERIAL;
    any_material(&p->material);
    begin("gs4_add_material");
    result = gs4_add_material(r.s.sim, one_in(200) ? NULL : &p->material);
    check(result < 0 || result == r.s.materials, "the id of a material", result);
    if (result >= 0) r.viscosity[r.s.materials++] = -1;
    return added_part(end(result, -1));
}

static int add_collider(void)
{
    part *p = &r.parts[r.part_count];
    int result;
    if (r.s.shapes >= MAX_SHAPES - 1) return 0;
    p->kind = A_COLLIDER;
    make_body(&r.s, &p->collider);
    any_shape(&p->collider.shape);
    disturb(&p->collider, of_collider, COUNT(of_collider));
    p->collider.contact = (gs4_wall)any_int((int)p->collider.contact);
    begin("gs4_add_collider");
    result = end(gs4_add_collider(r.s.sim, one_in(200) ? NULL : &p->collider), -1);
    r.s.bodies += result >= 0;
    return added_part(result);
}

static int add_emitter(void)
{
    part *p = &r.parts[r.part_count];
    int result;
    if (!has_room()) return 0;
    p->kind = AN_EMITTER;
    make_emitter(&r.s, &p->emitter);
    any_shape(&p->emitter.shape);
    any_fill(&p->emitter.fill);
    if (!one_in(10)) memset(&p->emitter.fill.angular_velocity, 0, sizeof(gs4_vec3));
    disturb(&p->emitter, of_emitter, COUNT(of_emitter));
    begin("gs4_add_emitter");
    result = end(gs4_add_emitter(r.s.sim, one_in(200) ? NULL : &p->emitter), -1);
    r.s.emitters += result >= 0;
    return added_part(result);
}

static int add_particles(void)
{
    const int shapes = r.s.shapes, before = gs4_get_stats(r.s.sim).particles;
    gs4_shape shape;
    gs4_fill f;
    int result, most;
    if (!has_room()) return 0;
    any_fill(&f);
    most = one_in(6) ? 200 : 110;
    shape = one_in(20) ? plane(&r.s) : shape_within(&r.s, 32, most);
    if (shape.kind != GS4_SHAPE_PLANE) any_shape(&shape);
    begin("gs4_add_particles");
    r.may_add = 1;
    result = gs4_add_particles(r.s.sim, shape, one_in(200) ? NULL : &f);
    r.s.shapes = shapes;
    return end(result, gs4_get_stats(r.s.sim).particles - before);
}

static int add_points(void)
{
    static gs4_real xyz[3 * 64];
    const int count = any_int(pick(0, 64)), before = gs4_get_stats(r.s.sim).particles;
    const double half = (double)length(&r.s, pick(8, CELL)) * r.length;
    gs4_fill f;
    int i, a, at[3], result;
    gs4_vec3 x;
    if (!has_room() || count > 64) return 0;
    any_fill(&f);
    for (i = 0; i < 64; i++) {
        for (a = 0; a < 3; a++) at[a] = pick(1, r.s.cells[a] * CELL - 1);
        x = place(&r.s, at);
        xyz[3 * i] = any((gs4_real)((double)x.x * r.length));
        xyz[3 * i + 1] = any((gs4_real)((double)x.y * r.length));
        xyz[3 * i + 2] = any((gs4_real)((double)x.z * r.length));
    }
    begin("gs4_add_points");
    r.may_add = 1;
    result = gs4_add_points(r.s.sim, one_in(200) ? NULL : xyz, count,
                            any((gs4_real)(half * half * half)), one_in(200) ? NULL : &f);
    return end(result, gs4_get_stats(r.s.sim).particles - before);
}

static int remove_particles(void)
{
    const int shapes = r.s.shapes, before = gs4_get_stats(r.s.sim).particles;
    gs4_shape shape;
    int result;
    if (shapes >= MAX_SHAPES - 1) return 0;
    shape = one_in(10) ? plane(&r.s) : shape_within(&r.s, 40, 200);
    if (shape.kind != GS4_SHAPE_PLANE) any_shape(&shape);
    begin("gs4_remove_particles");
    r.may_drop = 1;
    result = gs4_remove_particles(r.s.sim, shape);
    r.s.shapes = shapes;
    if (result >= 0)
        check(before - gs4_get_stats(r.s.sim).particles == result, "how many were removed", result);
    return end(result, -1);
}

static int set_gravity(void)
{
    const gs4_vec3 g = any_vector(20 * r.length / r.time / r.time);
    int result;
    begin("gs4_set_gravity");
    result = end(gs4_set_gravity(r.s.sim, g), -1);
    if (result < 0) return result;
    r.gravity = g;
    r.with_gravity = 1;
    r.version++;
    return result;
}

static int set_viscosity(void)
{
    const int material = any_int(pick(0, r.s.materials > 0 ? r.s.materials - 1 : 0));
    const gs4_real mu = any((gs4_real)((double)number(0, 1000, 100) * r.mass / r.length / r.time));
    int result;
    begin("gs4_set_viscosity");
    result = end(gs4_set_viscosity(r.s.sim, material, mu), -1);
    if (result < 0) return result;
    r.viscosity[material] = mu;
    r.version++;
    return result;
}

/* ==== calls that move ========================================================================= */

static int move_body(void)
{
    const int collider = pick(-1, r.s.bodies + r.s.emitters), emitter = pick(-1, r.s.emitters);
    const gs4_vec3 v = any_vector(r.length / r.time), w = any_vector(30 / r.time);
    if (one_in(2)) {
        begin("gs4_move_collider");
        return end(gs4_move_collider(r.s.sim, collider, v, w), -1);
    }
    begin("gs4_move_emitter");
    return end(gs4_move_emitter(r.s.sim, emitter, v), -1);
}

static int place_body(void)
{
    const int collider = pick(-1, r.s.bodies + r.s.emitters), emitter = pick(-1, r.s.emitters);
    const gs4_real duration = any((gs4_real)((double)number(1, 100, 1000) * r.time));
    gs4_pose pose, *p = one_in(100) ? NULL : &pose;
    any_pose(&pose);
    switch (pick(0, 5)) {
    case 0: begin("gs4_put_collider"); return end(gs4_put_collider(r.s.sim, collider, p), -1);
    case 1: begin("gs4_put_emitter"); return end(gs4_put_emitter(r.s.sim, emitter, p), -1);
    case 2:
        begin("gs4_move_collider_to");
        return end(gs4_move_collider_to(r.s.sim, collider, p, duration), -1);
    case 3:
        begin("gs4_move_emitter_to");
        return end(gs4_move_emitter_to(r.s.sim, emitter, p, duration), -1);
    case 4:
        begin("gs4_collider_pose");
        if (end(gs4_collider_pose(r.s.sim, collider, p), -1) < 0) return -1;
        break;
    default:
        begin("gs4_emitter_pose");
        if (end(gs4_emitter_pose(r.s.sim, emitter, p), -1) < 0) return -1;
    }
    check(fabs((double)p->position.x) < 1e300 && fabs((double)p->quaternion[0]) <= 1.001, "a pose",
          (double)p->position.x);
    return 0;
}

/* ==== calls that take time ==================================================================== */

static int has_open_wall(void)
{
    int i, open = 0;
    for (i = 0; i < 6; i++) open |= r.desc.walls[i] == GS4_WALL_OPEN;
    return open;
}

static void begin_time(const char *call)
{
    begin(call);
    r.may_go_on = r.takes_time = 1;
    r.may_add = r.s.emitters > 0;
    r.may_drop = has_open_wall();
}

static void check_time(double passed)
{
    const double now = gs4_get_stats(r.s.sim).time;
    check(fabs(now - r.stats.time - passed) <= 1e-6 * passed + 1e-12 * now, "the time that passed",
          now - r.stats.time);
}

static int take_step(void)
{
    const double stable = (double)gs4_stable_dt(r.s.sim), part = number(1, 8, 8);
    const gs4_real dt = any((gs4_real)(stable * (one_in(20) ? 1.5 : part)));
    int result;
    check(stable > 0 || strcmp(gs4_limit_name(r.s.sim), "none") == 0, "what limits", stable);
    begin_time("gs4_step");
    result = gs4_step(r.s.sim, dt);
    if (result == GS4_OK) check_time((double)dt);
    return end(result, -1);
}

static int questions;

static int goes_on(void *user)
{
    (void)user;
    check(gs4_step(r.s.sim, (gs4_real)1e-6) == GS4_ERROR_ARGUMENT, "a callback takes a step", 0);
    return ++questions < 4;
}

/* With so few iterations steps of an implicit scheme may have to be 1e5 times as short as
 * gs4_stable_dt before their solve converges. */
static int hardly_converges(void)
{
    return r.desc.scheme != GS4_EXPLICIT && r.desc.solver_max_iterations > 0
           && r.desc.solver_max_iterations < 20;
}

static int advance(void)
{
    const double stable = (double)gs4_stable_dt(r.s.sim),
                 most = r.desc.max_dt > 0 ? (double)r.desc.max_dt : 1e300,
                 step = fmin(stable * (r.desc.cfl > 0 ? (double)r.desc.cfl : 0.5), most);
    const gs4_real duration = any((gs4_real)(step * (double)number(0, 40, 10)));
    gs4_budget budget = { 0, 0, NULL, NULL };
    double done = -1;
    int result;
    if ((double)duration <= 8 * step && one_in(2) && !hardly_converges()) {
        begin_time("gs4_advance");
        result = gs4_advance(r.s.sim, duration);
        if (result == GS4_OK) check_time((double)duration);
        return end(result, -1);
    }
    questions = 0;
    if (one_in(3))
        budget.go_on = goes_on;
    else
        budget.steps = pick(1, 4);
    if (one_in(3)) budget.seconds = any((gs4_real)0.01);
    if (one_in(50)) budget.steps = -1;
    begin_time("gs4_advance_within");
    result = gs4_advance_within(r.s.sim, duration, one_in(200) ? NULL : &budget, &done);
    check(done >= 0 && (result < 0 || done <= (double)duration * (1 + 1e-12)), "how much was done",
          done);
    check_time(done);
    return end(result, -1);
}

/* Of any scheme, for some steps; what it says is numbers. */
static int estimate(void)
{
    const double stable = (double)gs4_stable_dt(r.s.sim),
                 duration = (double)any((gs4_real)(stable * (double)number(0, 20, 10)));
    gs4_cost c;
    int result;
    begin("gs4_estimate");
    result = gs4_estimate(r.s.sim, (gs4_scheme)pick(-1, 3), (gs4_integrator)pick(-1, 3), duration,
                          one_in(50) ? NULL : &c);
    if (result == GS4_OK)
        check(c.steps > 0 && c.limit && c.dt > 0 && c.seconds >= 0 && c.seconds < 1e30
                  && c.particles >= 0,
              "what a run takes", c.dt);
    return end(result, -1);
}

/* ==== edits by hand =========================================================================== */

/* The particle with this id or the next there is, whatever their order; -1: none */
static int index_from(int id)
{
    const uint32_t *ids = gs4_particle_ids(r.s.sim);
    const int count = gs4_get_stats(r.s.sim).particles;
    uint32_t k = (uint32_t)id;
    int i;
    while (k < r.known_count && !r.known[k].there) k++;
    for (i = 0; i < count; i++)
        if (ids[i] == k) return i;
    return -1;
}

/* Some change places, or velocities turn round, or temperatures are exchanged */
static int edit(void)
{
    static const gs4_field fields[] = { GS4_FIELD_POSITION, GS4_FIELD_VELOCITY,
                                        GS4_FIELD_TEMPERATURE, GS4_FIELD_MASS };
    const gs4_field field = fields[pick(0, 15) % 4];
    gs4_edit e;
    int i, a, step = pick(2, 200);
    begin("gs4_edit_particles");
    e = gs4_edit_particles(r.s.sim, field);
    check(field != GS4_FIELD_MASS || !e.data, "masses are not to be edited", 0);
    for (i = 0; i < 40 && e.data; i++) {
        const int one = index_from(i * step), other = index_from(i * step + step / 2);
        for (a = 0; one >= 0 && other >= 0 && a < e.components; a++) {
            gs4_real *x = e.data + (size_t)one * (size_t)e.stride + a,
                     *y = e.data + (size_t)other * (size_t)e.stride + a;
            const gs4_real old = *x;
            *x = field == GS4_FIELD_VELOCITY ? -old : *y;
            if (field != GS4_FIELD_VELOCITY) *y = old;
        }
    }
    end(0, -1);
    return 0;
}

/* Each is refused, and does no harm. */
static void use_bad_edit(void)
{
    gs4_fill f;
    make_fill(&r.s, &f);
    f.temperature = 0;
    (void)gs4_stable_dt(r.s.sim);
    (void)gs4_get_stats(r.s.sim);
    (void)gs4_state_hash(r.s.sim);
    (void)gs4_particles(r.s.sim, GS4_FIELD_DEFORMATION);
    check(gs4_step(r.s.sim, (gs4_real)1e-9) < 0, "a step after a bad edit", 0);
    check(gs4_advance(r.s.sim, (gs4_real)1e-9) < 0, "gs4_advance after a bad edit", 0);
    check(gs4_save(r.s.sim, r.path) < 0, "gs4_save after a bad edit", 0);
    check(gs4_write_ply(r.s.sim, r.path) < 0, "gs4_write_ply after a bad edit", 0);
    check(gs4_write_raw(r.s.sim, r.path) < 0, "gs4_write_raw after a bad edit", 0);
    check(gs4_add_particles(r.s.sim, gs4_plane(gs4_get_desc(r.s.sim).origin, any_vector(1)), &f)
              < 0,
          "gs4_add_particles after a bad edit", 0);
    check(gs4_last_error(r.s.sim)[0] != 0, "a sentence after a bad edit", 0);
}

/* Anything in a few places: it is good by chance, or all is refused until it is repaired. */
static int edit_absurdly(void)
{
    const gs4_field fields[] = { GS4_FIELD_POSITION, GS4_FIELD_VELOCITY, GS4_FIELD_TEMPERATURE };
    const gs4_field field = fields[pick(0, 2)];
    gs4_edit e;
    gs4_vec3 far_away = r.desc.origin;
    gs4_real before[4];
    int at[4], i;
    begin("gs4_edit_particles");
    fail_after = -1;
    e = gs4_edit_particles(r.s.sim, field);
    if (!e.data) return 0;
    for (i = 0; i < 4; i++) {
        const int one = index_from(pick(0, (int)r.known_count)), c = pick(0, e.components - 1);
        at[i] = (one < 0 ? index_from(0) : one) * e.stride + c;
        before[i] = e.data[at[i]];
    }
    for (i = 0; i < 4; i++) e.data[at[i]] = one_in(2) ? special() : absurd(before[i]);
    far_away.x -= 10 * r.desc.cell_size;
    if (gs4_remove_particles(r.s.sim, gs4_sphere(far_away, r.desc.cell_size)) < 0) {
        use_bad_edit();
        e = gs4_edit_particles(r.s.sim, field);
        for (i = 3; i >= 0; i--) e.data[at[i]] = before[i];
    }
    end(0, -1);
    return 0;
}

/* ==== files =================================================================================== */

static int save(void)
{
    int result;
    begin("gs4_save");
    result = end(gs4_save(r.s.sim, one_in(20) ? one_in(2) ? "" : NULL : r.path), -1);
    if (result < 0) return result;
    r.saved_hash = gs4_state_hash(r.s.sim);
    r.saved_version = r.version;
    return result;
}

static int load(void)
{
    int result, must;
    begin("gs4_load");
    must = fail_after < 0 && r.saved_version == r.version;
    r.may_jump = 1;
    result = gs4_load(r.s.sim, r.path);
    check(result == GS4_OK || !must, "its own checkpoint is refused", result);
    check(result < 0 || gs4_state_hash(r.s.sim) == r.saved_hash, "the hash after loading", 0);
    return end(result, -1);
}

static unsigned char *read_whole(const char *path, size_t *bytes)
{
    FILE *f = fopen(path, "rb");
    unsigned char *data = NULL;
    long size = 0;
    if (f && fseek(f, 0, SEEK_END) == 0) size = ftell(f);
    if (f && size > 0) data = (unsigned char *)malloc((size_t)size);
    if (data) rewind(f);
    if (data && fread(data, 1, (size_t)size, f) != (size_t)size) size = 0;
    if (f) fclose(f);
    *bytes = (size_t)size;
    return data;
}

static void write_whole(const char *path, const unsigned char *data, size_t bytes)
{
    FILE *f = fopen(path, "wb");
    check(f && fwrite(data, 1, bytes, f) == bytes, "the file of the fuzzer", 0);
    if (f) fclose(f);
}

/* The checksum that the contents have now, of the pieces that head `h` tells. */
static void sign(const gs4i_head *h, unsigned char *data, size_t bytes)
{
    const int behind[5] = { GS4I_PIECE_OCCUPIED, GS4I_PIECE_FIRST, GS4I_PIECE_BLOCKS,
                            GS4I_PIECE_REMEMBERED, GS4I_PIECE_FLAGS };
    uint64_t hash = gs4i_hash_bytes(0, data, sizeof *h);
    size_t at = sizeof *h;
    gs4i_pieces p;
    int k;
    if (bytes != sizeof *h + gs4i_piece_sizes(r.s.sim, h, &p) + sizeof hash) return;
    for (k = 0; k < 3 + GS4I_STATE_ARRAYS + 5; k++) {
        const int piece = k < 3                       ? k
                          : k < 3 + GS4I_STATE_ARRAYS ? GS4I_PIECE_PARTICLES + k - 3
                                                      : behind[k - 3 - GS4I_STATE_ARRAYS];
        hash = gs4i_hash_bytes(hash, data + at, p.size[piece]);
        at += p.size[piece];
    }
    memcpy(data + at, &hash, sizeof hash);
}

/* Bits, bytes, numbers, or its length. */
static size_t damage(unsigned char *data, size_t bytes)
{
    int i, n = pick(1, 3);
    if (one_in(6)) return (size_t)pick(0, (int)bytes - 1);
    for (i = 0; i < n; i++) {
        const size_t where = one_in(3) ? (size_t)pick(0, (int)sizeof(gs4i_head) - 1)
                                       : (size_t)pick(0, (int)bytes - 9);
        const gs4_real x = absurd(1);
        const int whole = any_int(pick(-2, 300));
        switch (pick(0, 3)) {
        case 0: data[where] ^= (unsigned char)(1 << pick(0, 7)); break;
        case 1: data[where] = (unsigned char)pick(0, 255); break;
        case 2: memcpy(data + where / sizeof x * sizeof x, &x, sizeof x); break;
        default: memcpy(data + where / 4 * 4, &whole, 4);
        }
    }
    return bytes;
}

/* A damaged checkpoint, now and then under a right checksum: refused, or all goes on with numbers;
 * then back by the good one. */
static int load_damaged(void)
{
    size_t bytes, left;
    unsigned char *data, *whole;
    gs4i_head h;
    int i, is_signed = one_in(2);
    begin("gs4_load, damaged");
    fail_after = -1;
    if (gs4_save(r.s.sim, r.path) < 0) return end(GS4_ERROR_IO, -1);
    r.saved_hash = gs4_state_hash(r.s.sim);
    r.saved_version = r.version;
    data = read_whole(r.path, &bytes);
    check(data && bytes > sizeof h, "the checkpoint", (double)bytes);
    memcpy(&h, data, sizeof h);
    whole = (unsigned char *)malloc(bytes);
    memcpy(whole, data, bytes);
    left = damage(data, bytes);
    if (is_signed && left == bytes) sign(&h, data, bytes);
    write_whole(r.path, data, left);
    r.may_jump = 1;
    i = gs4_load(r.s.sim, r.path);
    check(i < 0 || is_signed || gs4_state_hash(r.s.sim) == r.hash, "a damaged checkpoint", i);
    r.forged = 1;
    if (end(i, -1) >= 0)
        for (i = 0; i < 3; i++) {
            begin_time("gs4_step, forged");
            end(gs4_step(r.s.sim, (gs4_real)0.5 * gs4_stable_dt(r.s.sim)), -1);
        }
    r.forged = 0;
    write_whole(r.path, whole, bytes);
    free(data);
    free(whole);
    begin("gs4_load, good again");
    fail_after = -1;
    r.may_jump = 1;
    i = gs4_load(r.s.sim, r.path);
    check(i == GS4_OK && gs4_state_hash(r.s.sim) == r.saved_hash, "the good checkpoint", i);
    return end(i, -1);
}

/* A field that may not be there, memory that may be refused; what is given is whole. */
static int get_surface(void)
{
    gs4_triangles t;
    int result, i, bad = 0;
    begin("gs4_surface");
    result = gs4_surface(r.s.sim, (gs4_field)pick(-1, 11), &t);
    for (i = 0; result >= 0 && i < 3 * t.triangle_count; i++)
        bad += t.triangles[i] < 0 || t.triangles[i] >= t.vertex_count;
    for (i = 0; result >= 0 && i < 3 * t.vertex_count; i++)
        bad += !(fabs((double)t.positions[i]) < 1e30) || !(fabs((double)t.normals[i]) <= 1.001);
    check(bad == 0 && (result >= 0 || !t.vertex_count), "the triangles", bad);
    gs4_surface_free(r.s.sim, &t);
    if (end(result, -1) < 0) return -1;
    begin("gs4_write_surface");
    return end(gs4_write_surface(r.s.sim, one_in(10) ? NULL : r.path), -1);
}

static int write_frames(void)
{
    const int bad = one_in(10);
    begin("gs4_write_ply");
    if (end(gs4_write_ply(r.s.sim, bad ? NULL : r.path), -1) < 0) return -1;
    r.saved_version = -1; /* a frame has taken the place of a checkpoint */
    if (get_surface() < 0) return -1;
    begin("gs4_write_raw");
    return end(gs4_write_raw(r.s.sim, bad ? "/nowhere/at/all" : r.path), -1);
}

/* ==== calls without a simulation ============================================================== */

static int numbers(const gs4_real *x, int count)
{
    int i;
    for (i = 0; i < count; i++)
        if (!(fabs((double)x[i]) <= 1.7e308) || (sizeof *x == 4 && fabs((double)x[i]) > 3.4e38))
            return 0;
    return 1;
}

static int use_point(void)
{
    gs4_material m;
    gs4_point p, before;
    gs4_real L[9], cauchy[6], rho;
    int i, k, result;
    begin("gs4_point_step");
    any_material(&m);
    memset(&p, 0, sizeof p);
    if (one_in(2)) p.temperature = any(20);
    for (i = 0; i < 6; i++)
        if (one_in(8)) p.stress[i] = any(100);
    for (i = 0; i < 9; i++)
        if (one_in(16)) p.deformation[i] = any(1);
    for (i = 0; i < 9; i++) L[i] = any(number(-100, 100, 10));
    rho = any(number(0, 10, 10));
    for (k = 0; k < 5; k++) {
        before = p;
        result = gs4_point_step(&m, &p, L, any((gs4_real)(1e-3 * r.time)), rho, rho / 2);
        check(result == GS4_OK || strlen(gs4_last_error(NULL)) > 10, "a sentence of a point",
              result);
        check(result == GS4_OK || memcmp(&p, &before, sizeof p) == 0, "a point that is refused",
              result);
        if (result == GS4_OK)
            check(numbers(p.stress, 6) && numbers(p.stress_rate, 6) && numbers(p.deformation, 9),
                  "a point", 0);
        result = gs4_point_stress(&m, &p, L, cauchy);
        check(result == GS4_OK ? numbers(cauchy, 6) : gs4_last_error(NULL)[0] != 0, "its stress",
              result);
    }
    return end(0, -1);
}

static void fill_poisson(gs4_poisson_desc *d, uint8_t *kind, gs4_real *values, gs4_real *rhs)
{
    const int cells = 13 * 13 * 13, liquid = pick(1, 8);
    int i;
    memset(d, 0, sizeof *d);
    for (i = 0; i < 3; i++) d->cells[i] = any_int(pick(1, 12));
    for (i = 0; i < 3; i++)
        if (d->cells[i] > 12) d->cells[i] = 0;
    d->cell_size = any((gs4_real)0.1);
    for (i = 0; i < cells; i++) kind[i] = (uint8_t)(one_in(liquid) ? pick(0, 2) : GS4_CELL_LIQUID);
    if (r.wild) kind[pick(0, cells - 1)] = (uint8_t)pick(0, 5);
    for (i = 0; i < 4 * cells; i++) values[i] = number(0, 100, 10);
    for (i = 0; i < cells; i++) rhs[i] = number(-100, 100, 10);
    for (i = 0; r.wild && i < 3; i++) {
        const int at = pick(0, 4 * cells - 1);
        values[at] = any(values[at]);
        rhs[at % cells] = any(rhs[at % cells]);
    }
    d->kind = kind;
    if (one_in(2)) d->diagonal = values;
    for (i = 0; i < 3; i++)
        if (one_in(2)) d->coefficient[i] = values + (i + 1) * cells;
    d->tolerance = any((gs4_real)1e-5);
    d->max_iterations = any_int(pick(0, 30));
    if (d->max_iterations > 1000) d->max_iterations = 1000;
    d->threads = r.how == TWO_THREADS ? 2 : r.how == THREE_THREADS ? 3 : 0;
    d->allocator.alloc_fn = counted_alloc;
    d->allocator.free_fn = counted_free;
}

static int use_poisson(void)
{
    static uint8_t kind[13 * 13 * 13];
    static gs4_real values[4 * 13 * 13 * 13], rhs[13 * 13 * 13], x[13 * 13 * 13],
        before[13 * 13 * 13];
    const size_t bytes = bytes_out;
    gs4_poisson_desc d;
    gs4_poisson *p = NULL;
    gs4_solve_stats stats;
    int i, result, cells;
    begin("gs4_poisson_solve");
    fail_after = -1;
    fill_poisson(&d, kind, values, rhs);
    for (i = 0; i < COUNT(x); i++) x[i] = number(-10, 10, 10);
    if (r.wild) x[pick(0, COUNT(x) - 1)] = any(1);
    memcpy(before, x, sizeof x);
    if (one_in(8)) fail_after = pick(0, 20);
    result = gs4_poisson_create(&d, &p);
    fail_after = -1;
    check((result == GS4_OK) == (p != NULL), "gs4_poisson_create", result);
    check(p || strlen(gs4_last_error(NULL)) > 10, "a sentence of gs4_poisson_create", result);
    if (p) {
        result = gs4_poisson_solve(p, rhs, x, one_in(4) ? NULL : &stats);
        cells = d.cells[0] * d.cells[1] * d.cells[2];
        check(result == GS4_OK || strlen(gs4_last_error(NULL)) > 10, "a sentence of a solve",
              result);
        for (i = 0; i < cells; i++)
            check(kind[i] != GS4_CELL_LIQUID || numbers(x + i, 1) || result == GS4_ERROR_ARGUMENT,
                  "a solution", i);
        if (result != GS4_OK && result != GS4_ERROR_NOT_CONVERGED)
            check(memcmp(before, x, sizeof x) == 0, "x after an error", result);
    }
    gs4_poisson_destroy(p);
    check(bytes_out == bytes, "memory of a solver", (double)(bytes_out - bytes));
    return end(0, -1);
}

static int use_nothing(void)
{
    const gs4_vec3 x = any_vector(1);
    const gs4_shape s = one_in(2) ? gs4_box(x, x) : gs4_cylinder(x, any_vector(1), any(1));
    gs4_sim *none = NULL;
    gs4_pose pose;
    gs4_real real = 0;
    int bad = 0;
    memset(&pose, 0, sizeof pose);
    begin("calls with NULL");
    bad += gs4_create(NULL, &none) != GS4_ERROR_ARGUMENT || none;
    bad += gs4_add_material(NULL, NULL) != GS4_ERROR_ARGUMENT;
    bad += gs4_set_gravity(NULL, x) != GS4_ERROR_ARGUMENT;
    bad += gs4_set_viscosity(NULL, 0, 1) != GS4_ERROR_ARGUMENT;
    bad += gs4_add_particles(NULL, s, NULL) != GS4_ERROR_ARGUMENT;
    bad += gs4_add_points(NULL, &real, 0, 1, NULL) != GS4_ERROR_ARGUMENT;
    bad += gs4_remove_particles(NULL, s) != GS4_ERROR_ARGUMENT;
    bad += gs4_add_collider(NULL, NULL) != GS4_ERROR_ARGUMENT;
    bad += gs4_put_collider(NULL, 0, &pose) != GS4_ERROR_ARGUMENT;
    bad += gs4_step(NULL, 1) != GS4_ERROR_ARGUMENT;
    bad += gs4_estimate(NULL, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1, NULL) != GS4_ERROR_ARGUMENT;
    bad += gs4_advance(NULL, 1) != GS4_ERROR_ARGUMENT;
    gs4_surface_free(NULL, NULL);
    bad += gs4_surface(NULL, GS4_FIELD_MASS, NULL) != GS4_ERROR_ARGUMENT
           || gs4_write_surface(NULL, r.path) != GS4_ERROR_ARGUMENT;
    bad += gs4_save(NULL, r.path) != GS4_ERROR_ARGUMENT
           || gs4_load(NULL, r.path) != GS4_ERROR_ARGUMENT;
    bad +=
        gs4_particles(NULL, GS4_FIELD_MASS).data || gs4_edit_particles(NULL, GS4_FIELD_MASS).data;
    bad += gs4_particle_ids(NULL) || gs4_particle_materials(NULL) || gs4_state_hash(NULL);
    bad += strcmp(gs4_limit_name(NULL), "none") != 0;
    bad += gs4_stable_dt(NULL) != 0 || gs4_get_stats(NULL).particles || gs4_get_desc(NULL).cells[0];
    bad += gs4_material_preset(NULL, NULL) != GS4_ERROR_ARGUMENT;
    bad += gs4_version() != GS4_VERSION || gs4_real_size() != (int)sizeof real;
    bad += gs4_poisson_solve(NULL, &real, &real, NULL) != GS4_ERROR_ARGUMENT;
    gs4_destroy(NULL);
    check(bad == 0, "calls with NULL", bad);
    return end(0, -1);
}

/* ==== a scene ================================================================================= */

typedef struct kind_of_call {
    int (*call)(void);
    int weight;
} kind_of_call;

static int any_call(void)
{
    static const kind_of_call kinds[] = {
        { take_step, 24 },    { advance, 20 },         { add_particles, 8 },
        { add_points, 4 },    { remove_particles, 4 }, { add_material, 3 },
        { add_collider, 4 },  { add_emitter, 3 },      { set_gravity, 3 },
        { set_viscosity, 4 }, { move_body, 5 },        { place_body, 8 },
        { edit, 5 },          { edit_absurdly, 5 },    { save, 3 },
        { load, 3 },          { load_damaged, 5 },     { write_frames, 2 },
        { use_point, 3 },     { use_poisson, 2 },      { use_nothing, 1 },
        { estimate, 1 }
    };
    int i, which, all = 0;
    for (i = 0; i < COUNT(kinds); i++) all += kinds[i].weight;
    which = pick(0, all - 1);
    for (i = 0; which >= kinds[i].weight; i++) which -= kinds[i].weight;
    return kinds[i].call();
}

static void destroy(void)
{
    gs4_destroy(r.s.sim);
    r.s.sim = NULL;
    check(bytes_out == 0 && bytes_of_pointers == 0, "memory after gs4_destroy", (double)bytes_out);
}

/* Another simulation of the same parts goes on from a checkpoint: the same results. */
static void reload(void)
{
    const uint64_t hash = gs4_state_hash(r.s.sim);
    const gs4_real stable = gs4_stable_dt(r.s.sim);
    char path[1010];
    int i, material = 0;
    sprintf(path, "%s.re", r.path);
    check(gs4_save(r.s.sim, path) == GS4_OK, "gs4_save to go on from", 0);
    destroy();
    check(gs4_create(&r.desc, &r.s.sim) == GS4_OK, "the same simulation again", 0);
    for (i = 0; i < r.part_count; i++) {
        const part *p = &r.parts[i];
        check((p->kind == A_MATERIAL   ? gs4_add_material(r.s.sim, &p->material)
               : p->kind == A_COLLIDER ? gs4_add_collider(r.s.sim, &p->collider)
                                       : gs4_add_emitter(r.s.sim, &p->emitter))
                  >= 0,
              "the same part again", i);
    }
    if (r.with_gravity) check(gs4_set_gravity(r.s.sim, r.gravity) == GS4_OK, "the same gravity", 0);
    for (; material < r.s.materials; material++)
        if (r.viscosity[material] >= 0)
            check(gs4_set_viscosity(r.s.sim, material, r.viscosity[material]) == GS4_OK,
                  "the same viscosity", material);
    check(gs4_load(r.s.sim, path) == GS4_OK, "a checkpoint of the same scene", 0);
    check(gs4_state_hash(r.s.sim) == hash, "the hash after loading", 0);
    check(same_real(gs4_stable_dt(r.s.sim), stable), "the stable step after loading",
          (double)stable);
    remove(path);
}

static void begin_units(void)
{
    const double reach = one_in(4) ? 4 : 1;
    r.length = r.time = r.mass = 1;
    if (!one_in(4)) return;
    r.length = pow(10, uniform(-reach, reach));
    r.time = pow(10, uniform(-reach, reach));
    r.mass = pow(10, uniform(-reach, reach));
}

/* A simulation that has been made, or 0: the description was refused three times. */
static int begin_scene(void)
{
    static const int wilds[] = { 0, 0, 2000, 400, 60, 10 };
    int tries, result = -1;
    begin_units();
    r.wild = wilds[pick(0, COUNT(wilds) - 1)];
    r.lies = r.wild && one_in(2) ? pick(50, 5000) : 0;
    for (tries = 0; tries < 3 && result < 0; tries++) {
        any_desc(&r.desc);
        outcomes[0].call = "gs4_create";
        fail_after = r.wild && one_in(8) ? pick(0, 5) : -1;
        result = gs4_create(&r.desc, &r.s.sim);
        if (result == GS4_ERROR_MEMORY) {
            check(bytes_out == 0 && gs4_last_error(NULL)[0], "memory after gs4_create",
                  (double)bytes_out);
            fail_after = -1;
            result = gs4_create(&r.desc, &r.s.sim);
        }
        fail_after = -1;
        check((result < 0) == !r.s.sim, "the simulation of gs4_create", result);
        check(result >= 0 || (gs4_last_error(NULL)[0] && bytes_out == 0), "what gs4_create refused",
              result);
    }
    return result >= 0
           && (double)r.desc.cells[0] * r.desc.cells[1] * (double)r.desc.cells[2] <= 64000;
}

static int make_call(int call)
{
    random_begin((int)(gs4i_mix((uint64_t)(unsigned)r.seed * 64 + (uint64_t)call) & 0x7fffffff));
    if (call < 3) return add_material();
    if (call < 5) return add_particles();
    if (call < 8 && one_in(2)) return call < 7 ? add_collider() : add_emitter();
    return any_call();
}

/* The outcomes of seed and variant; those there are must be the same. Steps that are refused are
 * not left out: they sort the particles by places predicted for their own dt, and sums are in
 * another order then. Seen: 5 of 295 particles differ after the next step, by 2e-17 to 4e-16. */
static void run_scene(int seed, variant how)
{
    int call, result, calls;
    char path[1000];
    sprintf(path, "%.900s.%d.tmp", program, first_seed);
    memset(&r, 0, sizeof r);
    r.seed = seed;
    r.how = how;
    r.saved_version = -1;
    strcpy(r.path, path);
    remove(path);
    random_begin(seed);
    calls = pick(6, MOST_CALLS - 1);
    for (call = 0; call < calls; call++) {
        r.call = call;
        if (call == 0) {
            if (how == ALONE) memset(outcomes, 0, sizeof outcomes);
            if (!begin_scene()) break;
            continue;
        }
        if (how != ALONE && !outcomes[call].call) break;
        if (how >= WITHOUT_REFUSED && outcomes[call].unchanged) continue;
        if (how >= WITHOUT_REFUSED && outcomes[call].result == GS4_ERROR_MEMORY) break;
        r.unchanged = r.takes_time = 0;
        if (how == ALONE) outcomes[call].call = "no call";
        result = make_call(call);
        if (how == ALONE) {
            outcomes[call].result = result;
            outcomes[call].hash = gs4_state_hash(r.s.sim);
            outcomes[call].unchanged = result < 0 && r.unchanged && !r.takes_time;
        }
        check(outcomes[call].result == result, "another result than on one thread", result);
        check(outcomes[call].hash == gs4_state_hash(r.s.sim), "another hash than on one thread", 0);
        if (gs4_get_stats(r.s.sim).particles > 4 * MOST_PARTICLES) break;
        if (how == RELOADED && one_in(3)) reload();
    }
    if (how == ALONE && r.s.sim) {
        all_steps += (long)gs4_get_stats(r.s.sim).steps;
        all_particles += gs4_get_stats(r.s.sim).particles;
    }
    destroy();
    free(r.known);
    r.known = NULL;
    remove(path);
}

int main(int count, char **values)
{
    const int scenes = count > 2 ? atoi(values[2]) : 100;
    int seed;
    program = values[0];
    first_seed = count > 1 ? atoi(values[1]) : 1;
    signal(SIGABRT, on_abort);
    signal(SIGSEGV, on_abort);
    signal(SIGFPE, on_abort);
    for (seed = first_seed; scenes == 0 || seed < first_seed + scenes; seed++) {
        run_scene(seed, ALONE);
#ifdef GS4_PTHREADS
        if (seed % 6 == 0) run_scene(seed, TWO_THREADS);
        if (seed % 6 == 3) run_scene(seed, THREE_THREADS);
#endif
        if (seed % 3 == 1) run_scene(seed, WITHOUT_REFUSED);
        if (seed % 3 == 2) run_scene(seed, RELOADED);
        all_scenes++;
        if (all_scenes % 100 == 0) {
            printf("%ld scenes so far, the last of seed %d\n", all_scenes, seed);
            fflush(stdout);
        }
    }
    printf("%ld scenes, %ld calls, %ld refused, %ld steps, %ld particles: nothing found\n",
           all_scenes, all_calls, all_refused, all_steps, all_particles);
    return 0;
}
