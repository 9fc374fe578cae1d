/* The stress of viscoelastic liquids, at one material point: against solutions that are not ours, turned about, and at random. */

#include "xpp_reference.h"
enum { STRESS_ROWS = sizeof reference_rows / sizeof *reference_rows, STRESS_DOUBLE = sizeof(gs4_real) == 8 };
static const double stress_members[4][2] = { { 0, 0 }, { 0.5, 0.5 }, { 1, 0 }, { 1, 1 } };
static const int stress_index[3][3] = { { 0, 3, 4 }, { 3, 1, 5 }, { 4, 5, 2 } };       /* of xx yy zz xy xz yz */

/* --- material, flow, run -------------------------------------------------------------------------------- */

/* Of a set of the reference; -1: Oldroyd-B, UCM with local = 0. */
static gs4_material stress_material(int set, double modulus, double lambda, double local)
{
    gs4_material m = scene_liquid(1000, modulus * lambda / (1 - local), 10);
    m.liquid = set < 0 ? GS4_OLDROYD_B : GS4_POM_POM;
    m.local_fraction = (gs4_real)local; m.relaxation_time = (gs4_real)lambda;
    if (set < 0) return m;
    m.stretch_time = (gs4_real)(lambda / reference_sets[set][0]);
    m.arms = (gs4_real)reference_sets[set][1]; m.anisotropy = (gs4_real)reference_sets[set][2];
    return m;
}

static void stress_flow(int flow, double rate, gs4_real L[9])
{
    memset(L, 0, 9 * sizeof *L);
    if (flow == REF_SHEAR) { L[1] = (gs4_real)rate; return; }
    L[0] = (gs4_real)rate;
    L[4] = (gs4_real)(flow == REF_PLANAR ? -rate : -0.5 * rate);
    L[8] = (gs4_real)(flow == REF_PLANAR ? 0 : -0.5 * rate);
}

static int stress_run(const gs4_material *m, gs4_point *p, const gs4_real L[9], double time, int steps, const double member[2])
{
    int i, r = GS4_OK;
    for (i = 0; i < steps && r == GS4_OK; i++) r = gs4_point_step(m, p, L, (gs4_real)(time / steps), (gs4_real)member[0], (gs4_real)member[1]);
    if (r < 0) printf("    step %d of %d: %s\n", i, steps, gs4_last_error(NULL));
    return r;
}

/* Largest difference of a component of s (xx yy zz xy xz yz), over the largest component of the reference (xx xy yy zz). */
static double stress_error(const double s[6], const double S[4])
{
    const double full[6] = { S[0], S[2], S[3], S[1], 0, 0 };
    double error = 0, size = 0;
    int i;
    for (i = 0; i < 6; i++) { error = fmax(error, fabs(s[i] - full[i])); size = fmax(size, fabs(full[i])); }
    return error / size;
}

static double stress_point_error(const gs4_point *p, double modulus, const double S[4])
{
    double s[6];
    int i;
    for (i = 0; i < 6; i++) s[i] = (double)p->stress[i] / modulus;
    return stress_error(s, S);
}

/* --- the reference --------------------------------------------------------------------------------------- */

/* Rows of one run: the same flow at growing times. */
static int stress_rows(int first)
{
    const reference_row *a = &reference_rows[first];
    int n = 1;
    for (; first + n < STRESS_ROWS; n++) {
        const reference_row *b = &a[n];
        if (b->kind != a->kind || b->set != a->set || b->flow != a->flow || b->Wi != a->Wi || b->t <= a[n - 1].t) break;
    }
    return n;
}

/* Stress over G0 that a run starts with, xx yy zz xy xz yz; and its gradient, times lambda_b. */
static void stress_start(const reference_row *row, double S[6], double L[9])
{
    gs4_real flow[9];
    int i;
    memset(S, 0, 6 * sizeof *S); memset(flow, 0, sizeof flow);
    if (row->kind == REF_STARTUP || row->kind == REF_STEADY) stress_flow(row->flow, 1, flow);
    for (i = 0; i < 9; i++) L[i] = row->Wi * (double)flow[i];
    if (row->kind == REF_STEP) { S[0] = row->Wi * row->Wi; S[3] = row->Wi; }
    if (row->kind == REF_CESSATION) { S[0] = row->S[0]; S[1] = row->S[2]; S[2] = row->S[3]; S[3] = row->S[1]; }
    if (row->kind == REF_ROTATION) { S[0] = 2; S[3] = 1; L[1] = -row->Wi; L[3] = row->Wi; }
}

static double stress_rate_of(const reference_row *row) { return row->kind == REF_STARTUP || row->kind == REF_ROTATION ? fmax(1, row->Wi) : 1; }

/* Steps of a run, `fineness` per relaxation time or unit of strain, and the error of each of its rows. */
static int stress_follow(const reference_row *rows, int n, int fineness, double modulus, double lambda, const double member[2], double *error)
{
    const gs4_material m = stress_material(rows->set, modulus, lambda, rows->set < 0 ? 0.1 : 0);
    double S[6], L[9];
    gs4_real flow[9];
    gs4_point p;
    int i, k, all = 0;
    memset(&p, 0, sizeof p);
    stress_start(rows, S, L);
    for (i = 0; i < 6; i++) p.stress[i] = (gs4_real)(modulus * S[i]);
    for (i = 0; i < 9; i++) flow[i] = (gs4_real)(L[i] / lambda);
    for (k = 0; k < n; k++) {
        const double time = rows[k].t - (k ? rows[k - 1].t : 0);
        const int steps = (int)ceil(time * stress_rate_of(rows) * 25 - 1e-9) * (fineness / 25);
        const int result = stress_run(&m, &p, flow, lambda * time, steps, member);
        CHECK(result == GS4_OK);
        error[k] = stress_point_error(&p, modulus, rows[k].S);
        all += steps;
    }
    return all;
}

static void test_stress_reference(void)
{
    int first, n, k, member;
    for (first = 0; first < STRESS_ROWS; first += n) {
        const reference_row *rows = &reference_rows[first];
        double e1[8], e2[8];
        int steps;
        n = stress_rows(first);
        if (rows->kind == REF_STEADY) continue;
        if (!test_slow && rows->Wi * rows[n-1].t > 300 && rows->kind == REF_STARTUP) continue;
        for (member = 0; member < 4; member++) {
            clock_t c0 = clock();
            steps = stress_follow(rows, n, 200, 1, 1, stress_members[member], e1);
            c0 = clock() - c0;
            stress_follow(rows, n, 400, 1, 1, stress_members[member], e2);
            for (k = 0; k < n; k++) printf("R %d set %d flow %d Wi %g t %g m %d steps %d err %.2e %.2e order %.2f  ms %.1f\n", rows->kind, rows->set, rows->flow, rows->Wi, rows[k].t, member, steps, e1[k], e2[k], log2(e1[k]/e2[k]), c0*1e3/CLOCKS_PER_SEC);
        }
    }
}
