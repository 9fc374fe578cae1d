/* plain_mpm.c - the textbook MPM loop, the baseline of the benchmarks.
 *
 * First-order MLS-MPM in three dimensions as one writes it from Hu et al. 2018
 * (doi:10.1145/3197517.3201293 and its "88
 * lines" program): array of particle structs, dense grid, quadratic B-splines, 27-node loops, APIC,
 * symplectic Euler.
 * Plain C99, one thread, no intrinsics, no sorting; nor is anything slower than a careful author
 * would write it.
 *     gcc -O3 -march=native -DPLAIN_MPM_MAIN bench/plain_mpm.c -lm -o plain_mpm     (C11)
 *     ./plain_mpm --cells 50 --particles 1000000 --steps 5 --repeats 7
 * Or #include "plain_mpm.c" in another program and call what is declared below.
 *
 * Model: weakly compressible Newtonian liquid, SI units. Cauchy stress
 *     sigma = -p I + 2 mu D,   p = rho0 c0^2 / 7 ((1/J)^7 - 1),   D = (C + C^T) / 2,       (1)
 * J = volume / rest volume, C[a][b] = d v_a / d x_b (the APIC matrix). Stable for about (c0 + |v|)
 * dt < 0.5 h and
 * mu dt < 0.1 rho0 h^2; nothing is checked. The box is [0, n h] on each axis with nodes at x =
 * (node - 1) h,
 * node 1 on the low wall, node n + 1 on the high wall, nodes 0 and n + 2 outside. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Before a loop over the 4 numbers of a node. gcc at -O3 unrolls it before it vectorizes and so
 * misses that it is one vector operation (-O2 sees it): 1.5 times slower. -DPLAIN_HINT tells it
 * not to; the textbook has no such line. */
#if defined __GNUC__ && !defined __clang__ && defined PLAIN_HINT
#define PLAIN_ONE_VECTOR _Pragma("GCC unroll 1")
#else
#define PLAIN_ONE_VECTOR
#endif

typedef enum {
    PLAIN_SLIP,
    PLAIN_STICK
} plain_wall;

typedef struct {
    float x[3], v[3]; /* position, m, and velocity, m/s */
    float C[3][3];    /* APIC matrix C[a][b] = d v_a / d x_b, 1/s */
    float J;          /* volume ratio */
} plain_particle;

typedef struct {
    plain_particle *particles; /* in the order they were added; never sorted */
    size_t count, grid_bytes;
    /* per node momentum xyz and mass, after the grid update velocity xyz; x runs fastest */
    float (*grid)[4];
    int nodes[3]; /* cells + 3 */
    plain_wall wall;
    float h, density, sound_speed, viscosity, gravity[3];
    /* of every particle, at rest: volume = spacing^3, mass = density volume */
    float spacing, volume, mass;
} plain_sim;

plain_sim *plain_create(const int cells[3], float h, float density, float sound_speed,
                        float viscosity, const float gravity[3],
                        plain_wall wall); /* NULL when memory is short */
int plain_add_block(plain_sim *sim, const float low[3], const float high[3], float spacing,
                    uint32_t jitter_seed);
void plain_swirl(plain_sim *sim, float rate);
void plain_shuffle(plain_sim *sim, uint32_t seed);
void plain_step(plain_sim *sim, float dt);
size_t plain_particle_count(const plain_sim *sim);
void plain_destroy(plain_sim *sim);

size_t plain_particle_count(const plain_sim *sim) { return sim->count; }
void plain_destroy(plain_sim *sim)
{
    if (sim) free(sim->particles), free(sim->grid), free(sim);
}

plain_sim *plain_create(const int cells[3], float h, float density, float sound_speed,
                        float viscosity, const float gravity[3], plain_wall wall)
{
    plain_sim *sim = calloc(1, sizeof *sim);
    if (!sim) return NULL;
    for (int a = 0; a < 3; a++) sim->nodes[a] = cells[a] + 3, sim->gravity[a] = gravity[a];
    sim->h = h, sim->density = density, sim->sound_speed = sound_speed, sim->viscosity = viscosity,
    sim->wall = wall;
    sim->grid_bytes =
        (size_t)sim->nodes[0] * (size_t)sim->nodes[1] * (size_t)sim->nodes[2] * sizeof *sim->grid;
    sim->grid = malloc(sim->grid_bytes);
    return sim->grid ? sim : (plain_destroy(sim), NULL);
}

static uint32_t plain_random(uint32_t *state) /* xorshift; the state must not be 0 */
{
    *state ^= *state << 13, *state ^= *state >> 17;
    return *state ^= *state << 5;
}

/* Fills a box with particles on a lattice, x fastest, moved by up to 5 % of the spacing (not at
 * all with seed 0). All blocks of a simulation have the same spacing, since all particles have
 * the same mass. 0, or -1 on failure. */
int plain_add_block(plain_sim *sim, const float low[3], const float high[3], float spacing,
                    uint32_t jitter_seed)
{
    const float jitter = jitter_seed ? 0.1f * spacing / 4294967296.0f : 0.0f;
    uint32_t state = jitter_seed * 2654435769u | 1u;
    size_t n[3];
    for (int a = 0; a < 3; a++) n[a] = (size_t)((high[a] - low[a]) / spacing + 0.5f);
    if (sim->count && spacing != sim->spacing) return -1;
    plain_particle *p = realloc(sim->particles, (sim->count + n[0] * n[1] * n[2] + 1) * sizeof *p);
    if (!p) return -1;
    sim->particles = p, p += sim->count, sim->count += n[0] * n[1] * n[2];
    sim->spacing = spacing, sim->volume = spacing * spacing * spacing,
    sim->mass = sim->density * sim->volume;
    for (size_t k = 0; k < n[2]; k++)
        for (size_t j = 0; j < n[1]; j++)
            for (size_t i = 0; i < n[0]; i++, p++) {
                const float site[3] = { (float)i + 0.5f, (float)j + 0.5f, (float)k + 0.5f };
                *p = (plain_particle){ .J = 1.0f };
                for (int a = 0; a < 3; a++)
                    p->x[a] = low[a] + site[a] * spacing
                              + jitter * ((float)plain_random(&state) - 2147483648.0f);
            }
    return 0;
}

/* Sets a swirl about the vertical midline of the box, X by Z; free of divergence, tangential at
 * walls; rate in 1/s: v = rate (sin(kx x) cos(kz z) / kx, 0, -cos(kx x) sin(kz z) / kz), kx = pi
 * / X, kz = pi / Z. */
void plain_swirl(plain_sim *sim, float rate)
{
    const float kx = 3.14159265f / ((float)(sim->nodes[0] - 3) * sim->h);
    const float kz = 3.14159265f / ((float)(sim->nodes[2] - 3) * sim->h);
    for (plain_particle *p = sim->particles, *end = p + sim->count; p < end; p++) {
        p->v[0] = rate / kx * sinf(kx * p->x[0]) * cosf(kz * p->x[2]);
        p->v[1] = 0.0f;
        p->v[2] = -rate / kz * cosf(kx * p->x[0]) * sinf(kz * p->x[2]);
    }
}

/* Puts the particles in random memory order (Fisher-Yates): an unsorted code after long
 * stirring. */
void plain_shuffle(plain_sim *sim, uint32_t seed)
{
    uint32_t state = seed * 2654435769u | 1u;
    for (size_t i = sim->count; i > 1; i--) {
        plain_particle *p = &sim->particles[i - 1],
                       *other = &sim->particles[plain_random(&state) % i], swap = *p;
        *p = *other, *other = swap;
    }
}

/* On each axis a: first of the 3 nodes that meet x, their quadratic B-spline weights w[a], d[a]
 * = (x_node - x) / h. */
static void plain_weights(const float x[3], float inv_h, ptrdiff_t first[3], float w[3][3],
                          float d[3][3])
{
    for (int a = 0; a < 3; a++) {
        float node = x[a] * inv_h + 1.0f;
        first[a] = (int)(node - 0.5f);
        float f = node - (float)first[a]; /* 0.5 to 1.5 */
        w[a][0] = 0.5f * (1.5f - f) * (1.5f - f);
        w[a][1] = 0.75f - (f - 1.0f) * (f - 1.0f);
        w[a][2] = 0.5f * (f - 0.5f) * (f - 0.5f);
        for (int i = 0; i < 3; i++) d[a][i] = (float)i - f;
    }
}

/* Particles to grid, MLS-MPM: node momentum += w (m v + A d), A = h m C - dt J V0 4/h sigma,
 * sigma of (1). Component 3 carries the mass along, so a node is one sum of four numbers. */
static void plain_p2g(const plain_sim *sim, float dt)
{
    float(*restrict grid)[4] = sim->grid;
    const float h = sim->h, inv_h = 1.0f / h, mass = sim->mass, viscosity = sim->viscosity;
    const float stiffness = sim->density * sim->sound_speed * sim->sound_speed / 7.0f;
    const ptrdiff_t row = sim->nodes[0], slice = row * sim->nodes[1];
    for (const plain_particle *restrict p = sim->particles, *end = p + sim->count; p < end; p++) {
        ptrdiff_t first[3];
        float w[3][3], d[3][3];
        plain_weights(p->x, inv_h, first, w, d);
        const float r = 1.0f / p->J, r3 = r * r * r, pressure = stiffness * (r3 * r3 * r - 1.0f);
        const float force = -dt * p->J * sim->volume * 4.0f * inv_h; /* times sigma: momentum */
        const float mv[4] = { mass * p->v[0], mass * p->v[1], mass * p->v[2], mass };
        /* A[b][a] = A_ab: by columns, so that the loops over a are contiguous */
        float A[3][4] = { { 0.0f } };
        for (int b = 0; b < 3; b++)
            for (int a = 0; a < 3; a++)
                A[b][a] =
                    mass * h * p->C[a][b]
                    + force * (viscosity * (p->C[a][b] + p->C[b][a]) - (a == b ? pressure : 0.0f));
        float(*corner)[4] = grid + first[2] * slice + first[1] * row + first[0];
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++) {
                float(*node)[4] = corner + k * slice + j * row;
                float wjk = w[1][j] * w[2][k], m[4];
                PLAIN_ONE_VECTOR
                for (int a = 0; a < 4; a++) m[a] = mv[a] + A[1][a] * d[1][j] + A[2][a] * d[2][k];
                for (int i = 0; i < 3; i++) {
                    float wijk = w[0][i] * wjk;
                    PLAIN_ONE_VECTOR
                    for (int a = 0; a < 4; a++) node[i][a] += wijk * (m[a] + A[0][a] * d[0][i]);
                }
            }
    }
}

/* Momentum to velocity, gravity, walls: nothing moves out of the box at the wall nodes and those
 * outside. */
static void plain_grid_update(plain_sim *sim, float dt)
{
    const int *n = sim->nodes;
    float(*node)[4] = sim->grid;
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++)
            for (int i = 0; i < n[0]; i++, node++) {
                const int ijk[3] = { i, j, k };
                float *v = *node;
                if (v[3] <= 0.0f) continue;
                float inv_mass = 1.0f / v[3];
                for (int a = 0; a < 3; a++) v[a] = v[a] * inv_mass + dt * sim->gravity[a];
                for (int a = 0; a < 3; a++) {
                    int low = ijk[a] <= 1, high = ijk[a] >= n[a] - 2;
                    if ((low || high) && sim->wall == PLAIN_STICK) v[0] = v[1] = v[2] = 0.0f;
                    if ((low && v[a] < 0.0f) || (high && v[a] > 0.0f)) v[a] = 0.0f;
                }
            }
}

/* Grid to particles: v = sum w v_node, C = 4/h sum w v_node d^T, J *= 1 + dt tr C, x += dt v. */
static void plain_g2p(const plain_sim *sim, float dt)
{
    float(*restrict grid)[4] = sim->grid;
    const float inv_h = 1.0f / sim->h;
    const ptrdiff_t row = sim->nodes[0], slice = row * sim->nodes[1];
    for (plain_particle *restrict p = sim->particles, *end = p + sim->count; p < end; p++) {
        ptrdiff_t first[3];
        float w[3][3], d[3][3];
        plain_weights(p->x, inv_h, first, w, d);
        /* B[b][a] = sum w v_a d_b; component 3 is not used */
        float v[4] = { 0.0f }, B[3][4] = { { 0.0f } };
        float(*corner)[4] = grid + first[2] * slice + first[1] * row + first[0];
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++) {
                float(*node)[4] = corner + k * slice + j * row;
                float wjk = w[1][j] * w[2][k], s[4] = { 0.0f }; /* s = sum over this row of nodes */
                for (int i = 0; i < 3; i++) {
                    float wijk = w[0][i] * wjk;
                    PLAIN_ONE_VECTOR
                    for (int a = 0; a < 4; a++)
                        s[a] += wijk * node[i][a], B[0][a] += wijk * node[i][a] * d[0][i];
                }
                PLAIN_ONE_VECTOR
                for (int a = 0; a < 4; a++)
                    v[a] += s[a], B[1][a] += s[a] * d[1][j], B[2][a] += s[a] * d[2][k];
            }
        for (int a = 0; a < 3; a++) {
            float x = p->x[a] + dt * v[a], wall = (float)(sim->nodes[a] - 3) * sim->h;
            p->x[a] = x > 0.0f ? (x < wall ? x : wall) : 0.0f; /* also when x is not a number */
            p->v[a] = v[a];
            for (int b = 0; b < 3; b++) p->C[a][b] = 4.0f * inv_h * B[b][a];
        }
        p->J *= 1.0f + dt * (p->C[0][0] + p->C[1][1] + p->C[2][2]);
    }
}

void plain_step(plain_sim *sim, float dt)
{
    memset(sim->grid, 0, sim->grid_bytes);
    plain_p2g(sim, dt);
    plain_grid_update(sim, dt);
    plain_g2p(sim, dt);
}

#ifdef PLAIN_MPM_MAIN
#include <stdio.h>
#include <time.h>

static double plain_now(void) /* s */
{
    struct timespec t;
    return timespec_get(&t, TIME_UTC), (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A pool 1 m and `cells` wide, 8 particles a cell, with a quarter of its depth free above it. */
static plain_sim *plain_pool(long cells, long particles)
{
    const long layers = particles / (4 * cells * cells); /* two lattice layers a cell */
    const float h = 1.0f / (float)cells, gravity[3] = { 0.0f, -9.81f, 0.0f };
    const float low[3] = { 0.0f }, high[3] = { 1.0f, 0.5f * h * (float)layers, 1.0f };
    const int box[3] = { (int)cells, (int)(layers / 2 + layers / 8 + 1), (int)cells };
    plain_sim *sim = plain_create(box, h, 1000.0f, 30.0f, 1.0f, gravity, PLAIN_SLIP);
    if (!sim || plain_add_block(sim, low, high, 0.5f * h, 1) != 0) exit(1);
    return sim;
}

static void plain_bench(const char *scene, plain_sim *sim, long steps, long repeats)
{
    const float dt = 0.2f * sim->h / sim->sound_speed;
    double *ns = malloc((size_t)repeats * sizeof *ns);
    if (!ns) exit(1);
    plain_step(sim, dt); /* not timed: touches all memory once */
    for (long r = 0, i; r < repeats; r++) {
        double start = plain_now(), time;
        for (long step = 0; step < steps; step++) plain_step(sim, dt);
        time = 1e9 * (plain_now() - start) / ((double)steps * (double)sim->count);
        for (i = r; i > 0 && ns[i - 1] > time; i--) ns[i] = ns[i - 1];
        ns[i] = time; /* ns[] stays sorted */
    }
    printf("%s,%lu,%ld,%.2f,%.2f\n", scene, (unsigned long)sim->count, steps, ns[0],
           0.5 * (ns[(repeats - 1) / 2] + ns[repeats / 2]));
    free(ns);
    plain_destroy(sim);
}

int main(int argc, char **argv)
{
    const char *const names[4] = { "--cells", "--particles", "--steps", "--repeats" };
    long value[4] = { 50, 1000000, 5, 7 }, bad = argc % 2 == 0;
    for (int i = 1, a; i + 1 < argc; i += 2) {
        for (a = 0; a < 3 && strcmp(argv[i], names[a]) != 0;) a++;
        value[a] = strtol(argv[i + 1], NULL, 10);
        bad |= strcmp(argv[i], names[a]) != 0 || value[a] < 1 || value[a] > 1000000000;
    }
    if (bad || value[1] < 4 * value[0] * value[0])
        return fputs(
                   "plain_mpm [--cells N] [--particles N >= 4 cells^2] [--steps N] [--repeats N]\n",
                   stderr),
               2;
    puts("scene,particles,steps,min_ns_per_particle_step,median_ns_per_particle_step");
    plain_bench("settled", plain_pool(value[0], value[1]), value[2], value[3]);
    plain_sim *stirred = plain_pool(value[0], value[1]);
    plain_swirl(stirred, 3.0f), plain_shuffle(stirred, 1);
    plain_bench("stirred", stirred, value[2], value[3]);
    return 0;
}
#endif
