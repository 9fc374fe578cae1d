/* Second order in time: a drop that breathes and shears, with three steps, each half as long as
 * the one before: what the first halving changes over what the second does. */

#include "printed_2021.h"
#define ORDER_MAX 4096

typedef struct order_run {
    double x[3 * ORDER_MAX], v[3 * ORDER_MAX], J[ORDER_MAX];
    int count;
} order_run;

/* v = 0.5 A (x - c): expands along x, less along y, turns about z */
static void order_stir(gs4_sim *sim)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    int i;
    for (i = 0; i < v.count; i++) {
        const gs4_real *p = x.data + (size_t)i * (size_t)x.stride;
        gs4_real *u = v.data + (size_t)i * (size_t)v.stride;
        const double a = (double)p[0] - 0.5, b = (double)p[1] - 0.5, c = (double)p[2] - 0.5;
        u[0] = (gs4_real)(0.6 * a + 0.3 * b);
        u[1] = (gs4_real)(0.4 * b - 0.5 * a);
        u[2] = (gs4_real)(0.2 * c + 0.2 * a);
    }
}

static int order_simulate(double rho, double spurious, double decay, double time, int steps,
                          order_run *run)
{
    gs4_sim_desc d = scene_cube(12);
    gs4_material m = scene_liquid(1000, 20, 2);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    int i, result = 0;
    d.rho_inf = (gs4_real)rho;
    d.rho_inf_spurious = (gs4_real)spurious;
    d.flip_decay_time = (gs4_real)decay;
    if (gs4_create(&d, &sim) < 0) return -1;
    gs4_add_material(sim, &m);
    run->count = gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.26), &f);
    order_stir(sim);
    for (i = 0; i < steps && result == 0; i++) result = gs4_step(sim, (gs4_real)(time / steps));
    if (result < 0) printf("    %s\n", gs4_last_error(sim));
    scene_by_id(sim, GS4_FIELD_POSITION, run->x);
    scene_by_id(sim, GS4_FIELD_VELOCITY, run->v);
    scene_by_id(sim, GS4_FIELD_VOLUME_RATIO, run->J);
    gs4_destroy(sim);
    return result;
}

static double order_difference(const double *a, const double *b, int n)
{
    double sum = 0;
    int i;
    for (i = 0; i < n; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / n);
}

/* From runs whose steps are 1, 1/2 and 1/4. */
static double order_of(const double *coarse, const double *fine, const double *finest, int n)
{
    return log2(order_difference(coarse, fine, n) / order_difference(fine, finest, n));
}

static void order_case(double rho, double spurious, double decay)
{
    static order_run run[3];
    /* affine: the order comes to 2 from 1.87 (x) and 2.10 (v) at 128 steps */
    const int steps = test_full || scene_affine ? 256 : 128;
    const double most = steps == 256 ? 2.06 : 2.1;
    double x, v, J;
    int i;
    for (i = 0; i < 3; i++)
        CHECK(order_simulate(rho, spurious, decay, 0.4, steps << i, &run[i]) == 0);
    x = order_of(run[0].x, run[1].x, run[2].x, 3 * run[0].count);
    v = order_of(run[0].v, run[1].v, run[2].v, 3 * run[0].count);
    J = order_of(run[0].J, run[1].J, run[2].J, run[0].count);
    if (test_filter[0])
        printf("rho %g %g decay %g, sharpened %d, affine %d: order x %.3f v %.3f J %.3f; last "
               "changes %.1e "
               "%.1e %.1e\n",
               rho, spurious, decay, scene_sharp, scene_affine, x, v, J,
               order_difference(run[1].x, run[2].x, 3 * run[0].count),
               order_difference(run[1].v, run[2].v, 3 * run[0].count),
               order_difference(run[1].J, run[2].J, run[0].count));
    CHECK_BETWEEN(x, 1.92, most);
    /* as in NOISE */
    CHECK_BETWEEN(v, steps == 256 ? 1.955 : 1.92, test_full && !scene_affine ? 2.015 : most);
    CHECK_BETWEEN(J, 1.92, most);
}

/* All kinds of members of the family, without decay, with one as long as half the run, and by
 * default; in quick runs the first without, and another with and by default. */
static void test_order_in_time(void)
{
    static const double members[7][2] = { { 0, 0 },   { 0.5, 0 },   { 0.5, 0.5 }, { 1, 0 },
                                          { 1, 0.5 }, { 0.9, 0.9 }, { 0.8, 0.2 } };
    int i, sharp;
    if (sizeof(gs4_real) < 8) return; /* rounding would hide it */
    for (sharp = 0; sharp < (test_full ? 2 : 1); sharp++)
        for (i = 0; i < (test_full ? 7 : 4); i += test_full ? 1 : 3) {
            scene_sharp = sharp;
            if ((test_full && !sharp) || i % 4 < 2)
                order_case(members[i][0], members[i][1], (double)INFINITY);
            if ((test_full && !sharp) || i % 4 > 1) order_case(members[i][0], members[i][1], 0.2);
            if (test_full || i == 3) order_case(members[i][0], members[i][1], 0);
            scene_sharp = 0;
        }
    scene_affine = 1;
    for (i = 0; i < (test_full ? 7 : 1); i++) {
        order_case(members[i][0], members[i][1], i % 2 ? 0.2 : (double)INFINITY);
        if (test_full) order_case(members[i][0], members[i][1], 0);
    }
    scene_affine = 0;
}

/* Why rates live on particles: the algorithm as printed in 2021 does not converge in time, pure
 * FLIP or blended, against the same ordinary differential equations (x' = v, v' = sum w f_i/m_i,
 * F' = L F) solved with a small step. */
static double bar_error(double flip, int steps, const bar *exact)
{
    static bar b;
    bar_run(&b, 10, steps, flip);
    return order_difference(b.x, exact->x, BAR_COUNT) + order_difference(b.v, exact->v, BAR_COUNT);
}

static void test_order_as_printed(void)
{
    static const double flips[3] = { -1, 1, 0.95 };
    static bar exact;
    int k;
    bar_run(&exact, 10, 32768, -1);
    for (k = 0; k < 3; k++) {
        const double coarse = bar_error(flips[k], 256, &exact),
                     fine = bar_error(flips[k], 2048, &exact), order = log2(coarse / fine) / 3;
        if (test_filter[0])
            printf("%s, FLIP %g: errors %.1e %.1e, order %.2f\n",
                   k ? "as printed" : "rates on particles", fabs(flips[k]), coarse, fine, order);
        if (k == 0)
            CHECK_CLOSE(order, 2, 0.05);
        else
            CHECK_BETWEEN(order, -1, 0.5);
    }
}
