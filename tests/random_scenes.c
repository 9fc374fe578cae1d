/* Random scenes of everything, through the public interface alone. Two builds for one machine must
 * print the same: a line a scene with its seed, steps, particles and hash, how many calls were
 * refused and the code of the first of them; then the sums.
 *   first=N, count=N   seeds (1, 100)
 *   steps=N            calls of gs4_step or gs4_advance a scene (40)
 *   threads=N          of the library's own pool (GS4_PTHREADS) */
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "random_scene.h"
#include <stdio.h>
#include <stdlib.h>

static int result_of(scene *s, int result)
{
    if (result >= 0) return result;
    if (!s->refused++) s->first_code = result;
    return result;
}

static void add_material(scene *s, const gs4_sim_desc *d)
{
    gs4_material m;
    make_material(s, d->sharp_gradients, &m);
    if (d->scheme == GS4_PARTITIONED) make_incompressible(&m);
    if (result_of(s, gs4_add_material(s->sim, &m)) >= 0) s->materials++;
}

static void add_body(scene *s)
{
    gs4_collider c;
    make_body(s, &c);
    if (result_of(s, gs4_add_collider(s->sim, &c)) >= 0) s->bodies++;
}

static void add_emitter(scene *s)
{
    gs4_emitter e;
    make_emitter(s, &e);
    if (result_of(s, gs4_add_emitter(s->sim, &e)) >= 0) s->emitters++;
}

/* All but the particles: the same for a seed, whenever it is asked for */
static int build(scene *s, int seed, int threads)
{
    gs4_sim_desc d;
    int i, n;
    memset(s, 0, sizeof *s);
    random_begin(seed);
    make_desc(s, &d, threads);
    if (seed % 4 == 0) make_partitioned(&d);
    i = gs4_create(&d, &s->sim);
    if (i < 0) return i;
    n = pick(1, 3);
    for (i = 0; i < n; i++) add_material(s, &d);
    n = pick(0, MAX_BODIES);
    for (i = 0; i < n; i++) add_body(s);
    n = one_in(3);
    for (i = 0; i < n; i++) add_emitter(s);
    return GS4_OK;
}

static void fill(scene *s)
{
    int i, n = pick(1, 3);
    for (i = 0; i < n; i++) {
        gs4_fill f;
        make_fill(s, &f);
        if (one_in(2)) f.angular_velocity = vector(100, 10);
        if (one_in(5)) {
            const gs4_real half = length(s, CELL / 2);
            gs4_real xyz[8 * 3];
            int k;
            for (k = 0; k < 8 * 3; k++) {
                const int a = k % 3;
                xyz[k] = length(s, s->origin[a] + pick(CELL, (s->cells[a] - 1) * CELL));
            }
            result_of(s, gs4_add_points(s->sim, xyz, 8, half * half * half, &f));
        } else
            result_of(s, gs4_add_particles(s->sim, shape_within(s, 90, 200), &f));
    }
}

/* ==== the run ================================================================================= */

/* Exchanges the positions of neighbours in the store, which are near each other after a sort, or
 * turns every third velocity round */
static void edit(scene *s)
{
    const gs4_field field = one_in(2) ? GS4_FIELD_POSITION : GS4_FIELD_VELOCITY;
    const gs4_edit e = gs4_edit_particles(s->sim, field);
    int i, a;
    for (i = 0; i + 2 < e.count; i += 3)
        for (a = 0; a < 3; a++) {
            gs4_real *one = e.data + (size_t)i * (size_t)e.stride + a, *other = one + e.stride;
            const gs4_real old = *one;
            *one = field == GS4_FIELD_POSITION ? *other : -old;
            if (field == GS4_FIELD_POSITION) *other = old;
        }
}

/* Saves, builds the scene again and goes on from the file: the same bits as without */
static void reload(scene *s, int seed, int threads, const char *checkpoint)
{
    const uint32_t state = random_state;
    const int refused = s->refused, first_code = s->first_code;
    result_of(s, gs4_save(s->sim, checkpoint));
    gs4_destroy(s->sim);
    if (build(s, seed, threads) < 0) exit(2);
    s->refused = refused;
    s->first_code = first_code;
    result_of(s, gs4_load(s->sim, checkpoint));
    remove(checkpoint);
    random_state = state;
}

static void go_on(scene *s)
{
    const int eighths = pick(1, 8);
    double stable;
    if (s->bodies && one_in(10)) {
        const gs4_vec3 velocity = vector(100, 100), turning = vector(300, 10);
        result_of(s, gs4_move_collider(s->sim, 0, velocity, turning));
    }
    if (s->emitters && one_in(10)) result_of(s, gs4_move_emitter(s->sim, 0, vector(100, 100)));
    stable = (double)gs4_stable_dt(s->sim);
    if (one_in(6))
        result_of(s, gs4_advance(s->sim, (gs4_real)(stable * eighths / 4)));
    else
        result_of(s, gs4_step(s->sim, (gs4_real)(stable * eighths / 8)));
}

int main(int count, char **values)
{
    int scenes = 100, first = 1, steps = 40, threads = 0, i, k, seed, empty = 0, refused = 0;
    char checkpoint[1024];
    long taken = 0;
    static scene s;
    for (i = 1; i < count; i++)
        if (sscanf(values[i], "count=%d", &scenes) != 1
            && sscanf(values[i], "first=%d", &first) != 1
            && sscanf(values[i], "steps=%d", &steps) != 1
            && sscanf(values[i], "threads=%d", &threads) != 1) {
            printf("%s is unknown\n", values[i]);
            return 2;
        }
    sprintf(checkpoint, "%.1000s.checkpoint", values[0]);
    for (seed = first; seed < first + scenes; seed++) {
        uint64_t hash;
        gs4_stats stats;
        if (build(&s, seed, threads) < 0) {
            printf("%d: %s\n", seed, gs4_last_error(NULL));
            return 2;
        }
        fill(&s);
        for (i = 0, k = pick(0, 2 * steps); i < steps; i++) {
            if (i == k) edit(&s);
            if (2 * i == k) reload(&s, seed, threads, checkpoint);
            go_on(&s);
        }
        hash = gs4_state_hash(s.sim);
        stats = gs4_get_stats(s.sim);
        printf("%d %d %d %08lx%08lx", seed, (int)stats.steps, stats.particles,
               (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffffu));
        if (s.refused) printf(" refused %d first %d", s.refused, s.first_code);
        printf("\n");
        taken += (long)stats.steps;
        refused += s.refused;
        empty += stats.particles == 0;
        gs4_destroy(s.sim);
    }
    printf("%d scenes, %ld steps, %d refused, %d without particles\n", scenes, taken, refused,
           empty);
    return 0;
}
