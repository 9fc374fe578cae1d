/* The elliptic solver: against conjugate gradients with the diagonal, exact solutions, symmetry,
 * hard geometry, failures. Run all with run_poisson(). */
#include "poisson_cases.h"

/* --- the oracle ------------------------------------------------------------------------------- */

/* Conjugate gradients with the diagonal, in double, from the definition; x has the values of the
 * air. */
static int pois_oracle(const poisson_case *p, double *x, double tolerance)
{
    double *r = poisson_doubles(p->rhs, p->count), *d = poisson_doubles(NULL, p->count),
           *q = poisson_doubles(NULL, p->count), *m = poisson_doubles(NULL, p->count);
    double rz = 0, norm = 0, goal = 0;
    size_t at;
    int i[3], k;
    poisson_take_means(p, r);
    for (at = 0; at < p->count; at++)
        if (p->kind[at] == GS4_CELL_LIQUID) x[at] = 0;
    POISSON_EACH(p, i, at)
    {
        r[at] -= poisson_row(p, i, x, &m[at], NULL);
        norm += r[at] * r[at];
    }
    goal = norm * tolerance * tolerance;
    for (k = 0; norm > goal && k < 20000; k++) {
        double last = rz, pq = 0;
        rz = 0;
        POISSON_EACH(p, i, at) rz += m[at] > 0 ? r[at] * r[at] / m[at] : 0;
        POISSON_EACH(p, i, at)
        d[at] = (m[at] > 0 ? r[at] / m[at] : 0) + (k ? rz / last * d[at] : 0);
        POISSON_EACH(p, i, at)
        {
            q[at] = poisson_row(p, i, d, NULL, NULL);
            pq += d[at] * q[at];
        }
        norm = 0;
        POISSON_EACH(p, i, at)
        {
            x[at] += rz / pq * d[at];
            r[at] -= rz / pq * q[at];
            norm += r[at] * r[at];
        }
    }
    poisson_take_means(p, x);
    free(r);
    free(d);
    free(q);
    free(m);
    return norm <= goal;
}

/* |x - oracle| / |oracle| in the liquid */
static double pois_distance(const poisson_case *p)
{
    double *x = poisson_doubles(p->x, p->count), above = 0, below = 0;
    size_t at;
    CHECK(pois_oracle(p, x, 1e-12));
    for (at = 0; at < p->count; at++)
        if (p->kind[at] == GS4_CELL_LIQUID) {
            above += ((double)p->x[at] - x[at]) * ((double)p->x[at] - x[at]);
            below += x[at] * x[at];
        }
    free(x);
    return below > 0 ? sqrt(above / below) : sqrt(above);
}

static int pois_solve(poisson_case *p, gs4_solve_stats *stats)
{
    gs4_poisson *s;
    int r = gs4_poisson_create(&p->desc, &s);
    CHECK_RESULT(NULL, r, GS4_OK);
    if (r != GS4_OK) {
        memset(stats, 0, sizeof *stats);
        return r;
    }
    r = gs4_poisson_solve(s, p->rhs, p->x, stats);
    gs4_poisson_destroy(s);
    return r;
}

/* A box of random kinds, coefficients and diagonal. */
static poisson_case pois_random(int n0, int n1, int n2, uint64_t seed, int weighted)
{
    poisson_case p = poisson_box(n0, n1, n2, GS4_CELL_LIQUID);
    size_t at;
    int a;
    p.random = seed * 0x9e3779b97f4a7c15u + 1;
    for (at = 0; at < p.count; at++) {
        const double u = poisson_random(&p.random);
        p.kind[at] = (uint8_t)(u < 0.15  ? GS4_CELL_SOLID
                               : u < 0.2 ? GS4_CELL_AIR
                                         : GS4_CELL_LIQUID);
        if (p.kind[at] == GS4_CELL_AIR) p.x[at] = (gs4_real)(4 * poisson_random(&p.random) - 2);
    }
    if (!weighted) return p;
    p.desc.diagonal = p.diagonal = poisson_array(p.count);
    for (at = 0; at < p.count; at++)
        p.diagonal[at] =
            (gs4_real)(poisson_random(&p.random) < 0.5 ? 0 : poisson_random(&p.random));
    for (a = 0; a < 3; a++) {
        p.desc.coefficient[a] = p.coefficient[a] = poisson_array(p.faces[a]);
        for (at = 0; at < p.faces[a]; at++)
            p.coefficient[a][at] = (gs4_real)(poisson_random(&p.random) < 0.1
                                                  ? 0
                                                  : pow(10, 2 * poisson_random(&p.random) - 1));
    }
    return p;
}

/* --- solutions -------------------------------------------------------------------------------- */

static void test_poisson_agrees_with_oracle(void)
{
    int q;
    for (q = 0; q < POISSON_CASES; q++) {
        poisson_case p = poisson_make(poisson_names[q], test_full ? 24 : 12);
        gs4_solve_stats stats;
        size_t at;
        p.desc.tolerance = (gs4_real)1e-11;
        for (at = 0; at < p.count; at++)
            if (p.kind[at] == GS4_CELL_AIR) p.x[at] = (gs4_real)sin((double)at);
        CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
        /* 1e-11 by the condition, up to 1e5; rounding of x to float */
        CHECK_CLOSE(pois_distance(&p), 0, 1e-6);
        poisson_free(&p);
    }
}

/* Iterations, and the residual as the definition has it. */
static void pois_iterations(const char *name, int n)
{
    poisson_case p = poisson_make(name, n);
    gs4_solve_stats stats;
    double bound, residual;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    CHECK(stats.iterations > 0 && stats.iterations <= (name[0] == 'P' && !name[2] ? 11 : 20));
    residual = poisson_residual(&p, p.x, &bound);
    CHECK(residual <= 1.001e-8 + bound);
    CHECK(fabs(residual - stats.residual) <= 1e-3 * stats.residual + bound);
    poisson_free(&p);
}

static void test_poisson_iterations(void)
{
    static const int sizes[] = { 24, 37, 64, 100, 136, 160, 256 };
    const int most = test_slow ? 7 : test_full ? 3 : 1;
    int q, k;
    for (k = 0; k < most; k++)
        for (q = 0; q < POISSON_CASES; q++) pois_iterations(poisson_names[q], sizes[k]);
    /* a chain of corridors longer than what is solved directly */
    if (test_full) pois_iterations("T4", 132);
}

/* Faces that differ by 1000 from one to the next, some of them or half. */
static void test_poisson_faces(void)
{
    static const double shares[] = { 0.001, 0.01, 0.1, 0.5, 0.9 };
    int k, a, n;
    for (k = 0; k < 5; k++)
        for (n = 24; n <= (test_full ? 64 : 24); n += 40) {
            poisson_case p = poisson_make("P1", n);
            gs4_solve_stats stats;
            double bound;
            size_t f;
            for (a = 0; a < 3; a++) {
                p.desc.coefficient[a] = p.coefficient[a] = poisson_array(p.faces[a]);
                for (f = 0; f < p.faces[a]; f++)
                    p.coefficient[a][f] = poisson_random(&p.random) < shares[k] ? 1000 : 1;
            }
            CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
            CHECK(poisson_residual(&p, p.x, &bound) <= 1.001e-8 + bound && stats.iterations <= 130);
            poisson_free(&p);
        }
}

/* A box of corridors one cell wide, all of them one tree: the way between two cells may be as
 * long as all corridors. */
static void test_poisson_maze(void)
{
    static const int step[6][3] = { { 1, 0, 0 },  { -1, 0, 0 }, { 0, 1, 0 },
                                    { 0, -1, 0 }, { 0, 0, 1 },  { 0, 0, -1 } };
    enum {
        N = 31
    };
    poisson_case p = poisson_box(N, N, N, GS4_CELL_SOLID);
    int *path = (int *)malloc(N * N * N * sizeof *path), length = 0, a, ways[6], open;
    gs4_solve_stats stats;
    double bound;
    if (!path) exit(3);
    path[length++] = 0;
    p.kind[0] = GS4_CELL_LIQUID;
    /* on to a cell two steps away that is not reached yet, or back */
    while (length) {
        const int at = path[length - 1], i[3] = { at % N, at / N % N, at / (N * N) };
        int way;
        for (open = a = 0; a < 6; a++) {
            const int x = i[0] + 2 * step[a][0], y = i[1] + 2 * step[a][1],
                      z = i[2] + 2 * step[a][2];
            if (x >= 0 && y >= 0 && z >= 0 && x < N && y < N && z < N
                && p.kind[(z * N + y) * N + x] == GS4_CELL_SOLID)
                ways[open++] = a;
        }
        if (!open) {
            length--;
            continue;
        }
        a = ways[(int)(poisson_random(&p.random) * open)];
        way = (step[a][2] * N + step[a][1]) * N + step[a][0];
        p.kind[at + way] = p.kind[at + 2 * way] = GS4_CELL_LIQUID;
        path[length++] = at + 2 * way;
    }
    p.kind[0] = GS4_CELL_AIR;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    CHECK(poisson_residual(&p, p.x, &bound) <= 1.001e-8 + bound && stats.iterations <= 80);
    free(path);
    poisson_free(&p);
}

static void test_poisson_shapes(void)
{
    static const int shapes[][3] = { { 1, 1, 1 },  { 2, 1, 1 },   { 5, 1, 1 },  { 1, 6, 1 },
                                     { 1, 1, 40 }, { 200, 1, 1 }, { 1, 7, 9 },  { 11, 1, 6 },
                                     { 2, 3, 1 },  { 17, 5, 2 },  { 64, 1, 3 }, { 33, 31, 34 },
                                     { 3, 3, 67 }, { 35, 2, 2 } };
    size_t q;
    int weighted, seed;
    for (q = 0; q < sizeof shapes / sizeof *shapes; q++)
        for (weighted = q == 11 && !test_full; weighted < 2; weighted++)
            for (seed = 0; seed < (q < 11 && test_full ? 3 : 1); seed++) {
                poisson_case p = pois_random(shapes[q][0], shapes[q][1], shapes[q][2],
                                             q * 10 + (size_t)seed, weighted);
                gs4_solve_stats stats;
                double bound;
                p.desc.tolerance = (gs4_real)1e-11;
                CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
                CHECK_CLOSE(pois_distance(&p), 0, 1e-6);
                CHECK(poisson_residual(&p, p.x, &bound) <= 1.001e-11 + bound);
                poisson_free(&p);
            }
}

/* No unknown, one, one without neighbours: the answers by hand. */
static void test_poisson_few_unknowns(void)
{
    poisson_case p = poisson_box(3, 1, 1, GS4_CELL_AIR);
    gs4_real one[3] = { 2, 2, 2 };
    gs4_solve_stats stats;
    int i;
    for (i = 0; i < 3; i++) {
        p.rhs[i] = 6;
        p.x[i] = (gs4_real)(10 + i);
    }
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    CHECK(stats.iterations == 0 && stats.residual == 0 && p.x[0] == 10 && p.x[1] == 11
          && p.x[2] == 12);
    p.kind[1] = GS4_CELL_LIQUID;
    p.desc.cell_size = (gs4_real)0.5;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK); /* (2 x - 10 - 12) / 0.25 = 6 */
    CHECK_CLOSE(p.x[1], 11.75, 1e-5);
    p.desc.diagonal = one;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK); /* and 2 x */
    CHECK_CLOSE(p.x[1], 94.0 / 10, 1e-5);
    p.kind[0] = p.kind[2] = GS4_CELL_SOLID;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    CHECK_CLOSE(p.x[1], 3, 1e-5);
    CHECK(p.x[0] == 10 && p.x[2] == 12);
    p.desc.diagonal = NULL;
    /* nothing holds it, and nothing can meet 6 */
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    CHECK(p.x[1] == 0 && stats.pockets == 1);
    CHECK_CLOSE(stats.removed_mean, 6, 1e-6);
    poisson_free(&p);
}

/* -div grad u = 3 pi^2 u for u = sin sin sin + x, exact in the air around: error of order 2. */
static void test_poisson_order(void)
{
    const double pi = 3.14159265358979323846;
    double error[3] = { 0, 0, 0 };
    int q, i[3];
    for (q = 0; q < 3; q++) {
        const int n = 10 << q;
        poisson_case p = poisson_box(n + 2, n + 2, n + 2, GS4_CELL_LIQUID);
        gs4_solve_stats stats;
        int pass;
        poisson_shell(&p, GS4_CELL_AIR);
        p.desc.cell_size = (gs4_real)(1.0 / n);
        for (pass = 0; pass < 2; pass++) {
            size_t at = 0;
            for (i[2] = 0; i[2] < n + 2; i[2]++)
                for (i[1] = 0; i[1] < n + 2; i[1]++)
                    for (i[0] = 0; i[0] < n + 2; i[0]++, at++) {
                        const double x = (i[0] - 0.5) / n, u = sin(pi * x)
                                                               * sin(pi * (i[1] - 0.5) / n)
                                                               * sin(pi * (i[2] - 0.5) / n);
                        if (pass)
                            error[q] = fmax(error[q], fabs((double)p.x[at] - (u + x)));
                        else {
                            p.rhs[at] = (gs4_real)(3 * pi * pi * u);
                            p.x[at] = p.kind[at] == GS4_CELL_AIR ? (gs4_real)(u + x) : 0;
                        }
                    }
            if (!pass) CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
        }
        poisson_free(&p);
    }
    CHECK_CLOSE(log2(error[0] / error[1]), 2, 0.1);
    CHECK_CLOSE(log2(error[1] / error[2]), 2, 0.1);
}

/* A solution as guess needs no iteration; x and b in other units give the same answer. */
static void test_poisson_guess_and_units(void)
{
    poisson_case p = poisson_make("P4", 24);
    gs4_poisson *s;
    gs4_solve_stats stats;
    gs4_real *first = poisson_array(p.count);
    size_t at;
    int a;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    memcpy(first, p.x, p.count * sizeof *first);
    /* more than x in float can hold */
    if (sizeof(gs4_real) == 4) p.desc.tolerance = (gs4_real)1e-4;
    CHECK_RESULT(NULL, gs4_poisson_create(&p.desc, &s), GS4_OK);
    CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_OK);
    CHECK(stats.iterations == 0);
    gs4_poisson_destroy(s);
    p.desc.tolerance = (gs4_real)1e-8;
    for (a = 0; a < 3; a++)
        for (at = 0; at < p.faces[a]; at++) p.coefficient[a][at] *= (gs4_real)1e-12;
    for (at = 0; at < p.count; at++) {
        p.rhs[at] *= (gs4_real)1e6;
        p.x[at] = 0;
    }
    p.desc.cell_size = (gs4_real)1e-3;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK); /* x by 1e6 / 1e-12 / 1e6 */
    CHECK(stats.iterations <= 11);
    for (at = 0; at < p.count; at++)
        if (fabs((double)p.x[at] * 1e-12 - (double)first[at])
            > 1e-5 * fabs((double)first[at]) + 1e-6)
            break;
    CHECK(at == p.count);
    free(first);
    poisson_free(&p);
}

/* --- identities ------------------------------------------------------------------------------- */

static void pois_fill(const poisson_case *p, const gs4i_solver *s, double **to, const double *from)
{
    size_t at;
    int i[3];
    POISSON_EACH(p, i, at)
    to[(i[0] + i[1] + i[2]) & 1][gs4i_row_of(&s->level[0], i[1], i[2]) + (size_t)(i[0] / 2)] =
        from[at];
}

/* u.M v of the cycle, or u.A v */
static double pois_form(const poisson_case *p, gs4i_solver *s, const double *u, const double *v,
                        int cycle)
{
    static const gs4i_pass_fn residual[] = { gs4i_pass_residual };
    const gs4i_level *g = &s->level[0];
    double sum = 0;
    size_t at;
    int i[3], c;
    for (c = 0; c < 2; c++) {
        memset(g->r[c], 0, g->count * sizeof(double));
        memset(s->x[c], 0, g->count * sizeof(double));
    }
    pois_fill(p, s, cycle ? s->level[0].r : s->x, v);
    if (cycle)
        gs4i_cycle(s);
    else
        gs4i_wavefront_run(s, 0, residual, 1);
    POISSON_EACH(p, i, at)
    {
        const size_t to = gs4i_row_of(g, i[1], i[2]) + (size_t)(i[0] / 2);
        c = (i[0] + i[1] + i[2]) & 1;
        sum += u[at] * (cycle ? (double)g->z[c][to] : -g->r[c][to]);
    }
    return sum;
}

/* u.Av = v.Au as the definition has it, u.Mv = v.Mu, u.Mu > 0, on random masks, coefficients and
 * diagonals. */
static void test_poisson_symmetry(void)
{
    static const int shapes[4][3] = {
        { 21, 34, 27 }, { 7, 5, 80 }, { 64, 20, 20 }, { 40, 40, 40 }
    };
    int q, weighted, t, i[3];
    for (q = 0; q < (test_full ? 4 : 2); q++)
        for (weighted = 0; weighted < 2; weighted++) {
            poisson_case p =
                pois_random(shapes[q][0], shapes[q][1], shapes[q][2], 77 + (size_t)q, weighted);
            gs4_poisson *s;
            double *u = poisson_doubles(NULL, p.count), *v = poisson_doubles(NULL, p.count);
            size_t at;
            CHECK_RESULT(NULL, gs4_poisson_create(&p.desc, &s), GS4_OK);
            for (t = 0; t < 3; t++) {
                double uu, vv, uv, vu, exact = 0;
                POISSON_EACH(&p, i, at)
                {
                    /* noise, which the finest levels see; and smooth, for the coarse ones */
                    u[at] = 2 * poisson_random(&p.random) - 1 + 2 * t;
                    v[at] = 2 * poisson_random(&p.random) - 1 + t * cos(0.1 * i[0] + 0.2 * i[2]);
                }
                POISSON_EACH(&p, i, at) exact += u[at] * poisson_row(&p, i, v, NULL, NULL);
                uu = pois_form(&p, &s->solver, u, u, 0);
                vv = pois_form(&p, &s->solver, v, v, 0);
                uv = pois_form(&p, &s->solver, u, v, 0);
                vu = pois_form(&p, &s->solver, v, u, 0);
                CHECK_CLOSE(uv, vu, 1e-13 * sqrt(uu * vv));
                CHECK_CLOSE(uv, exact * s->solver.diagonal_unit, 1e-12 * sqrt(uu * vv));
                uu = pois_form(&p, &s->solver, u, u, 1);
                vv = pois_form(&p, &s->solver, v, v, 1);
                uv = pois_form(&p, &s->solver, u, v, 1);
                vu = pois_form(&p, &s->solver, v, u, 1);
                CHECK(uu > 0 && vv > 0);
                CHECK_CLOSE(uv, vu, 1e-5 * sqrt(uu * vv));
            }
            gs4_poisson_destroy(s);
            free(u);
            free(v);
            poisson_free(&p);
        }
}

/* Every edge of every graph has its mate of the same weight, in the bulk and beside it; of a
 * full box of 48^3 cells graph 0 is one of 12^3 nodes whose edges have half of four faces that
 * have half of four faces each. */
static void test_poisson_graphs(void)
{
    static const char *const names[] = { "P1", "P2", "P4", "P5", "T3" };
    int q, l, i, e, back;
    for (q = 0; q < 5; q++) {
        poisson_case p = poisson_make(names[q], 48);
        gs4_poisson *s;
        int mates = 0, edges = 0, exact = 0;
        CHECK_RESULT(NULL, gs4_poisson_create(&p.desc, &s), GS4_OK);
        for (l = 0; l < s->solver.graphs; l++) {
            const gs4i_graph *g = &s->solver.graph[l];
            for (i = 0; i < g->n; i++)
                for (e = g->start[i]; e < g->start[i + 1]; e++) {
                    for (back = g->start[g->to[e]];
                         back < g->start[g->to[e] + 1] && g->to[back] != i; back++) {
                    }
                    mates += back < g->start[g->to[e] + 1]
                             && fabs((double)(g->w[back] - g->w[e])) <= 1e-6 * (double)g->w[e];
                    edges++;
                    if (l == 0) exact += g->w[e] == 4;
                }
        }
        CHECK(edges > 0 && mates == edges);
        if (strcmp(names[q], "P5") == 0)
            CHECK(s->solver.graph[0].n == 12 * 12 * 12 && exact == 6 * 12 * 12 * 11
                  && s->solver.graph[0].start[12 * 12 * 12] == exact);
        gs4_poisson_destroy(s);
        poisson_free(&p);
    }
}

/* --- determinism, reuse ----------------------------------------------------------------------- */

static void pois_shuffled(int count, gs4_task_fn task, void *context, void *user)
{
    int i, *calls = (int *)user;
    ++*calls;
    if (*calls & 1)
        for (i = count - 1; i >= 0; i--) task(i, context);
    else {
        for (i = 1; i < count; i += 2) task(i, context);
        for (i = 0; i < count; i += 2) task(i, context);
    }
}

static uint64_t pois_hash(poisson_case *p, int threads, int shuffled)
{
    gs4_solve_stats stats;
    uint64_t h;
    int calls = 0;
    p->desc.threads = threads;
    p->desc.parallel_for = shuffled ? pois_shuffled : NULL;
    p->desc.parallel_user = &calls;
    memset(p->x, 0, p->count * sizeof *p->x);
    CHECK_RESULT(NULL, pois_solve(p, &stats), GS4_OK);
    CHECK(!shuffled || calls > 0);
    h = gs4i_hash_bytes((uint64_t)stats.iterations, p->x, p->count * sizeof *p->x);
    return gs4i_hash_bytes(h, &stats.residual, sizeof stats.residual);
}

static void test_poisson_same_bits(void)
{
    static const char *const names[3] = { "P2", "P4", "T5" };
    int q, n;
    for (q = 0; q < 3; q++) {
        poisson_case p = poisson_make(names[q], test_full ? 66 : 34);
        const uint64_t one = pois_hash(&p, 1, 0);
        for (n = 1; n <= 8; n = n < 3 ? n + 1 : n + 5) {
            CHECK(pois_hash(&p, n, 1) == one);
#ifdef GS4_PTHREADS
            CHECK(pois_hash(&p, n, 0) == one);
#endif
        }
        poisson_free(&p);
    }
}

/* One solver for one problem after the other: as if each were its first, and no memory once it
 * has the largest. */
static void test_poisson_reuse(void)
{
    static const char *const names[5] = { "P2", "P4", "P3", "P2", "T3" };
    gs4i_memory memory;
    gs4i_tasks tasks;
    gs4i_solver s;
    int q, round;
    uint64_t bytes = 0;
    memset(&memory, 0, sizeof memory);
    memset(&tasks, 0, sizeof tasks);
    memset(&s, 0, sizeof s);
    memory.hook.alloc_fn = gs4i_default_alloc;
    memory.hook.free_fn = gs4i_default_free;
    s.memory = &memory;
    s.tasks = &tasks;
    for (round = 0; round < 2; round++)
        for (q = 0; q < 5; q++) {
            poisson_case p = poisson_make(names[q], test_full ? 40 : 26);
            gs4_solve_stats stats;
            gs4_real *x = poisson_array(p.count);
            CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
            memset(&stats, 0, sizeof stats);
            CHECK(gs4i_solver_setup(&s, &p.desc) == GS4_OK);
            CHECK(gs4i_solver_solve(&s, p.rhs, x, 1e-8, 200, &stats) == GS4_OK);
            CHECK(memcmp(x, p.x, p.count * sizeof *x) == 0);
            free(x);
            poisson_free(&p);
            if (round)
                CHECK(memory.bytes == bytes);
            else if (q == 4)
                bytes = memory.bytes;
        }
    gs4i_solver_free(&s);
    CHECK(memory.bytes == 0);
}

/* --- failures --------------------------------------------------------------------------------- */

/* What a diagonal has beyond the digits of a float counts: it rules here, and the solver begins at
 * a guess that is wrong everywhere. */
static void test_poisson_diagonal(void)
{
    poisson_case p = pois_random(13, 9, 11, 5, 1);
    gs4_solve_stats stats;
    size_t at;
    for (at = 0; at < p.count; at++) {
        p.diagonal[at] = (gs4_real)(1e3 * (1 + poisson_random(&p.random)));
        p.x[at] = (gs4_real)(1 + poisson_random(&p.random));
    }
    p.desc.cell_size = (gs4_real)0.3;
    p.desc.tolerance = (gs4_real)1e-13;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
    CHECK_CLOSE(pois_distance(&p), 0, sizeof(gs4_real) == 8 ? 1e-11 : 1e-7);
    poisson_free(&p);
}

static void test_poisson_limit(void)
{
    poisson_case p = poisson_make("P2", 32);
    gs4_solve_stats stats;
    double bound = 0, residual;
    p.desc.max_iterations = 2;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_ERROR_NOT_CONVERGED);
    CHECK(stats.iterations == 2 && strstr(gs4_last_error(NULL), "max_iterations"));
    CHECK(stats.residual > 1e-8 && stats.residual < 0.1);
    residual = poisson_residual(&p, p.x, &bound);
    CHECK_CLOSE(residual, stats.residual, 1e-6 * stats.residual + bound);
    /* more than double can give */
    p.desc.max_iterations = 0;
    p.desc.tolerance = (gs4_real)1e-17;
    CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_ERROR_NOT_CONVERGED);
    CHECK(strstr(gs4_last_error(NULL), "stays at") && stats.residual < 1e-12);
    residual = poisson_residual(&p, p.x, &bound);
    CHECK_CLOSE(residual, stats.residual, 1e-14 + bound);
    poisson_free(&p);
}

/* A guess that is far off, and what it has of the null space of a closed pocket, does not stay. */
static void test_poisson_bad_guess(void)
{
    static const char *const names[3] = { "P2", "P5", "T5" };
    int q, k;
    size_t i;
    for (q = 0; q < 3; q++)
        for (k = 0; k < 2; k++) {
            poisson_case p = poisson_make(names[q], test_full ? 24 : 16);
            gs4_solve_stats stats, cold;
            double bound;
            for (i = 0; i < p.count; i++)
                if (p.kind[i] == GS4_CELL_LIQUID) p.x[i] = 0;
            CHECK_RESULT(NULL, pois_solve(&p, &cold), GS4_OK);
            for (i = 0; i < p.count; i++)
                if (p.kind[i] == GS4_CELL_LIQUID)
                    p.x[i] = (gs4_real)(1e6 * (k ? 1 : poisson_random(&p.random)));
            CHECK_RESULT(NULL, pois_solve(&p, &stats), GS4_OK);
            CHECK(stats.iterations == cold.iterations); /* it was not taken */
            CHECK(poisson_residual(&p, p.x, &bound) <= 1.001e-8 + bound);
            CHECK_CLOSE(pois_distance(&p), 0, 1e-6);
            poisson_free(&p);
        }
}

/* Few cells whose faces differ by up to 1e6: the residual rises and falls for long before it
 * goes down. */
static void test_poisson_contrast(void)
{
    int seed, solved = 0, a;
    size_t i;
    for (seed = 1; seed <= 200; seed++) {
        poisson_case p = poisson_box(5, 4, 3, GS4_CELL_LIQUID);
        gs4_solve_stats stats;
        double bound;
        p.random = (uint64_t)seed * 88172645463325252u;
        p.kind[0] = GS4_CELL_AIR;
        p.desc.tolerance = (gs4_real)1e-4;
        for (a = 0; a < 3; a++) {
            p.desc.coefficient[a] = p.coefficient[a] = poisson_array(p.faces[a]);
            for (i = 0; i < p.faces[a]; i++)
                p.coefficient[a][i] = (gs4_real)pow(10, -6 * poisson_random(&p.random));
        }
        if (pois_solve(&p, &stats) == GS4_OK) {
            solved++;
            CHECK(poisson_residual(&p, p.x, &bound) <= 1.001e-4 + bound);
        }
        poisson_free(&p);
    }
    CHECK(solved == 200);
}

/* A cycle that gives NaN: once more with the diagonal; a diagonal that does too: the guess
 * stays. */
static void test_poisson_breakdown(void)
{
    poisson_case p = poisson_make("P2", 24);
    gs4_poisson *s;
    gs4_solve_stats stats;
    double bound = 0, residual;
    size_t at;
    CHECK_RESULT(NULL, gs4_poisson_create(&p.desc, &s), GS4_OK);
    for (at = 0; at < s->solver.level[1].count; at++)
        if (s->solver.level[1].inverse[0][at] > 0) s->solver.level[1].inverse[0][at] = (float)NAN;
    CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_OK);
    CHECK(stats.iterations > 20 && poisson_residual(&p, p.x, &bound) <= 1.001e-8 + bound);
    for (at = 0; at < s->solver.level[0].count; at++)
        s->solver.level[0].inverse[0][at] = -s->solver.level[0].inverse[0][at];
    for (at = 0; at < p.count; at++) p.x[at] = 1;
    CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_ERROR_NOT_CONVERGED);
    CHECK(strstr(gs4_last_error(NULL), "broke down"));
    for (at = 0; at < p.count && fabs((double)p.x[at]) < 1e6; at++) {
    }
    CHECK(at == p.count);
    residual = poisson_residual(&p, p.x, &bound);
    CHECK_CLOSE(residual, stats.residual, 1e-6 * stats.residual + bound);
    gs4_poisson_destroy(s);
    poisson_free(&p);
}

static void pois_refused(const gs4_poisson_desc *d, const char *word)
{
    int nothing;
    gs4_poisson *s = (gs4_poisson *)(void *)&nothing; /* must become NULL */
    CHECK_RESULT(NULL, gs4_poisson_create(d, &s), GS4_ERROR_ARGUMENT);
    CHECK(s == NULL && strstr(gs4_last_error(NULL), word));
    gs4_poisson_destroy(s);
}

static void test_poisson_arguments(void)
{
    poisson_case p = pois_random(8, 9, 10, 5, 1);
    const gs4_poisson_desc good = p.desc;
    const gs4_real bad[3] = { (gs4_real)NAN, (gs4_real)-1, (gs4_real)INFINITY };
    gs4_poisson_desc d;
    gs4_poisson *s;
    int a;
    for (a = 0; a < 3; a++) {
        d = good;
        d.cells[a] = 0;
        pois_refused(&d, "cells[");
        d = good;
        d.cell_size = bad[a];
        pois_refused(&d, "cell_size");
        d = good;
        d.tolerance = bad[a];
        pois_refused(&d, "tolerance");
    }
    d = good;
    d.cell_size = 0;
    pois_refused(&d, "cell_size");
    d = good;
    d.kind = NULL;
    pois_refused(&d, "kind");
    d = good;
    d.max_iterations = -1;
    pois_refused(&d, "max_iterations");
    d = good;
    d.threads = -1;
    pois_refused(&d, "threads");
    d = good;
    d.threads = 1025;
    pois_refused(&d, "threads");
    d = good;
    d.allocator.alloc_fn = gs4i_default_alloc;
    pois_refused(&d, "allocator");
#ifndef GS4_PTHREADS
    d = good;
    d.threads = 2;
    pois_refused(&d, "threads");
#endif
    d = good;
    d.cells[0] = d.cells[1] = d.cells[2] = 1 << 20;
    pois_refused(&d, "cells");
    CHECK(gs4_poisson_create(NULL, &s) == GS4_ERROR_ARGUMENT
          && gs4_poisson_create(&good, NULL) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_poisson_solve(NULL, p.rhs, p.x, NULL) == GS4_ERROR_ARGUMENT);
    p.kind[77] = 3;
    pois_refused(&good, "kind[]");
    p.kind[77] = GS4_CELL_LIQUID;
    poisson_free(&p);
}

/* NaN, negative and infinite numbers in each array: refused where they matter, and nowhere else. */
static void test_poisson_bad_numbers(void)
{
    const gs4_real bad[3] = { (gs4_real)NAN, (gs4_real)-1, (gs4_real)INFINITY };
    poisson_case p = pois_random(8, 9, 10, 6, 1);
    gs4_poisson *s;
    gs4_solve_stats stats;
    int a, b;
    memset(p.kind, GS4_CELL_LIQUID, p.count);
    p.kind[0] = GS4_CELL_AIR;
    p.kind[p.count - 1] = GS4_CELL_SOLID;
    for (b = 0; b < 3; b++) {
        gs4_real keep = p.diagonal[300];
        p.diagonal[300] = bad[b];
        pois_refused(&p.desc, "diagonal[]");
        p.diagonal[300] = keep;
        for (a = 0; a < 3; a++) {
            keep = p.coefficient[a][334];
            p.coefficient[a][334] = bad[b];
            pois_refused(&p.desc, "coefficient[]");
            p.coefficient[a][334] = keep;
        }
    }
    p.diagonal[0] = p.diagonal[p.count - 1] = (gs4_real)NAN;
    for (a = 0; a < 3; a++) p.coefficient[a][0] = p.coefficient[a][p.faces[a] - 1] = (gs4_real)NAN;
    p.rhs[0] = p.rhs[p.count - 1] = p.x[p.count - 1] = (gs4_real)NAN;
    CHECK_RESULT(NULL, gs4_poisson_create(&p.desc, &s), GS4_OK);
    CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_OK);
    for (b = 0; b < 3; b += 2) {
        const gs4_real x = p.x[300], rhs = p.rhs[300], air = p.x[0];
        p.rhs[300] = bad[b];
        CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_ERROR_ARGUMENT);
        CHECK(strstr(gs4_last_error(NULL), "rhs[]"));
        p.rhs[300] = rhs;
        CHECK(p.x[300] == x);
        p.x[300] = bad[b];
        CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_ERROR_ARGUMENT);
        CHECK(strstr(gs4_last_error(NULL), "x[]"));
        p.x[300] = x;
        p.x[0] = bad[b];
        CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_ERROR_ARGUMENT);
        CHECK(strstr(gs4_last_error(NULL), "x[]"));
        p.x[0] = air;
    }
    CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, NULL), GS4_OK);
    gs4_poisson_destroy(s);
    p.coefficient[0][334] = (gs4_real)1e-35;
    pois_refused(&p.desc, "1e-30");
    poisson_free(&p);
}

typedef struct pois_heap {
    int left, balance;
} pois_heap;

static void *pois_alloc(size_t bytes, size_t alignment, void *user)
{
    pois_heap *h = (pois_heap *)user;
    void *p;
    if (h->left-- <= 0) return NULL;
    p = gs4i_default_alloc(bytes, alignment, NULL);
    if (p) h->balance++;
    return p;
}

static void pois_free(void *memory, size_t bytes, void *user)
{
    ((pois_heap *)user)->balance--;
    gs4i_default_free(memory, bytes, NULL);
}

/* The k-th allocation is refused, for all k; a solve allocates nothing. */
static void test_poisson_memory(void)
{
    poisson_case p = pois_random(30, 31, 32, 9, 1);
    pois_heap heap;
    gs4_poisson *s;
    gs4_solve_stats stats;
    int k, r = GS4_ERROR_MEMORY;
    p.desc.allocator.alloc_fn = pois_alloc;
    p.desc.allocator.free_fn = pois_free;
    p.desc.allocator.user = &heap;
    heap.balance = 0;
    for (k = 0; k < 100 && r != GS4_OK; k++) {
        heap.left = k;
        r = gs4_poisson_create(&p.desc, &s);
        CHECK(r == GS4_OK
              || (r == GS4_ERROR_MEMORY && s == NULL && heap.balance == 0
                  && strstr(gs4_last_error(NULL), "memory")));
    }
    CHECK(k > 8 && r == GS4_OK && heap.left == 0);
    CHECK_RESULT(NULL, gs4_poisson_solve(s, p.rhs, p.x, &stats), GS4_OK);
    CHECK(stats.memory_bytes > 0);
    gs4_poisson_destroy(s);
    CHECK(heap.balance == 0);
    poisson_free(&p);
}

/* Conjugate gradients for any operator: n steps at most for n unknowns, the answer of a matrix
 * made from it, an honest residual, and the preconditioner's fault handed on. */
enum {
    POIS_KRYLOV = 8
};

static int pois_krylov_calls, pois_krylov_fault;

static double pois_krylov_entry(int i, int j)
{
    return i == j ? 3 + i : (i - j) * (i - j) == 1 ? -1 : 0.1;
}

static void pois_krylov_apply(void *context, const double *p, double *out)
{
    int i, j;
    (void)context;
    pois_krylov_calls++;
    for (i = 0; i < POIS_KRYLOV; i++)
        for (out[i] = 0, j = 0; j < POIS_KRYLOV; j++) out[i] += pois_krylov_entry(i, j) * p[j];
}

static int pois_krylov_jacobi(void *context, const double *r, double *out)
{
    int i;
    (void)context;
    for (i = 0; i < POIS_KRYLOV; i++) out[i] = r[i] / pois_krylov_entry(i, i);
    return pois_krylov_fault;
}

static void test_poisson_krylov(void)
{
    double v[4][POIS_KRYLOV], b[POIS_KRYLOV], Ax[POIS_KRYLOV], off = 0, size = 0;
    gs4i_krylov k;
    int i, limit;
    memset(&k, 0, sizeof k);
    k.n = POIS_KRYLOV;
    k.x = v[0];
    k.r = v[1];
    k.p = v[2];
    k.q = v[3];
    k.apply = pois_krylov_apply;
    k.precondition = pois_krylov_jacobi;
    for (limit = 2; limit <= 100; limit += 98) {
        for (i = 0; i < POIS_KRYLOV; i++) v[1][i] = b[i] = 1 + (i * i) % 5;
        pois_krylov_calls = pois_krylov_fault = 0;
        i = gs4i_conjugate_gradients(&k, 1e-10, limit);
        CHECK(i == (limit == 2 ? GS4_ERROR_NOT_CONVERGED : GS4_OK));
        CHECK(pois_krylov_calls == limit || (limit == 100 && pois_krylov_calls <= POIS_KRYLOV));
        pois_krylov_apply(NULL, v[0], Ax);
        for (off = size = 0, i = 0; i < POIS_KRYLOV; i++) {
            off += (b[i] - Ax[i]) * (b[i] - Ax[i]);
            size += b[i] * b[i];
        }
        CHECK_CLOSE(sqrt(off / size), k.residual, 1e-14);
        CHECK((sqrt(off / size) <= 1e-10) == (limit == 100));
    }
    v[1][0] = 1;
    pois_krylov_fault = GS4_ERROR_MEMORY;
    CHECK(gs4i_conjugate_gradients(&k, 1e-10, 100) == GS4_ERROR_MEMORY);
}

/* Coefficients over twelve orders of magnitude and few iterations, whose residuals go up at first:
 * what is left is never worse than the start, 0. */
static void test_poisson_never_worse(void)
{
    enum {
        SIDE = 6,
        CELLS = SIDE * SIDE * SIDE,
        FACES = SIDE * SIDE * (SIDE + 1)
    };
    int seed, i, a, worse = 0, ended_early = 0;
    for (seed = 0; seed < 60; seed++) {
        static gs4_real face[3][FACES], rhs[CELLS], x[CELLS];
        static uint8_t kind[CELLS];
        gs4_poisson_desc d;
        gs4_poisson *p = NULL;
        gs4_solve_stats stats;
        memset(&d, 0, sizeof d);
        memset(x, 0, sizeof x);
        d.kind = kind;
        d.cell_size = 1;
        d.max_iterations = 1 + seed % 4;
        d.tolerance = (gs4_real)1e-6;
        for (a = 0; a < 3; a++) {
            d.cells[a] = SIDE;
            d.coefficient[a] = face[a];
            for (i = 0; i < FACES; i++)
                face[a][i] = (gs4_real)pow(
                    10, (double)(gs4i_mix((uint64_t)(seed * 3000 + a * 1000 + i)) % 13) - 6);
        }
        for (i = 0; i < CELLS; i++) {
            const uint64_t u = gs4i_mix((uint64_t)(seed * 1000 + i) << 20);
            kind[i] = (uint8_t)(u % 10 ? GS4_CELL_LIQUID : GS4_CELL_AIR);
            rhs[i] = (gs4_real)((double)(u >> 40) / 16777216 - 0.5);
        }
        CHECK(gs4_poisson_create(&d, &p) == GS4_OK);
        ended_early += gs4_poisson_solve(p, rhs, x, &stats) == GS4_ERROR_NOT_CONVERGED;
        worse += !(stats.residual <= 1 + 1e-9);
        gs4_poisson_destroy(p);
    }
    CHECK(worse == 0 && ended_early > 10);
    if (worse) printf("    worse than 0: %d of %d\n", worse, ended_early);
}

/* Coefficients that jump by `jump` squared from face to face, at random. One solve. */
static double poisson_jumps(int seed, double jump, int limit, int *iterations, int *result)
{
    enum {
        N = 8
    };
    static uint8_t kind[N * N * N];
    static gs4_real c[N * N * (N + 1)], rhs[N * N * N], x[N * N * N];
    gs4_poisson_desc d;
    gs4_poisson *p = NULL;
    gs4_solve_stats stats;
    uint64_t state = (uint64_t)seed;
    int i, a;
    memset(&d, 0, sizeof d);
    for (i = 0; i < N * N * N; i++) {
        state = gs4i_mix(state);
        kind[i] = (uint8_t)(state % 16 ? GS4_CELL_LIQUID : GS4_CELL_AIR);
        rhs[i] = (gs4_real)((double)(state >> 40) / (1 << 24) - 0.5);
        x[i] = 0;
    }
    for (i = 0; i < N * N * (N + 1); i++) {
        state = gs4i_mix(state);
        c[i] = (gs4_real)(state & 1024 ? jump : 1 / jump);
    }
    for (a = 0; a < 3; a++) {
        d.cells[a] = N;
        d.coefficient[a] = c;
    }
    d.cell_size = 1;
    d.kind = kind;
    d.tolerance = (gs4_real)1e-7;
    d.max_iterations = limit;
    CHECK(gs4_poisson_create(&d, &p) == GS4_OK);
    *result = gs4_poisson_solve(p, rhs, x, &stats);
    *iterations = stats.iterations;
    gs4_poisson_destroy(p);
    return stats.residual;
}

/* What does not converge is the best of all iterates: none of those of fewer iterations has a
 * smaller residual. */
static void test_poisson_best(void)
{
    int seed, limit, refused = 0;
    for (seed = 1; seed < 12; seed++) {
        double least = 1, residual;
        int iterations, result;
        for (limit = 1; limit < 16; limit++) {
            residual = poisson_jumps(seed, 1e4, limit, &iterations, &result);
            if (result != GS4_ERROR_NOT_CONVERGED) break;
            refused++;
            CHECK(iterations <= limit);
            CHECK(residual <= least * 1.001);
            if (residual < least) least = residual;
        }
    }
    CHECK(refused > 100);
}

static void run_poisson(void)
{
    RUN(test_poisson_never_worse);
    RUN(test_poisson_krylov);
    RUN_ONCE(test_poisson_agrees_with_oracle);
    RUN_ONCE(test_poisson_iterations);
    RUN_ONCE(test_poisson_faces);
    RUN(test_poisson_maze);
    RUN_FULL(test_poisson_shapes);
    RUN(test_poisson_few_unknowns);
    RUN(test_poisson_order);
    RUN(test_poisson_guess_and_units);
    RUN_ONCE(test_poisson_symmetry);
    RUN(test_poisson_graphs);
    RUN_FULL(test_poisson_same_bits);
    RUN_ONCE(test_poisson_reuse);
    RUN(test_poisson_diagonal);
    RUN(test_poisson_limit);
    RUN_FULL(test_poisson_bad_guess);
    RUN(test_poisson_contrast);
    RUN(test_poisson_breakdown);
    RUN(test_poisson_arguments);
    RUN(test_poisson_bad_numbers);
    RUN_ONCE(test_poisson_memory);
    RUN_FULL(test_poisson_best);
}
