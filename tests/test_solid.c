/* Solids: one material point against solutions that are not ours; waves, order, energy,
 * plasticity and files of whole scenes. */

#include "solid_reference.h"
enum {
    SOLID_DOUBLE = sizeof(gs4_real) == 8,
    SOLID_CASES = sizeof reference_solids / sizeof *reference_solids,
    SOLID_CLAMPS = sizeof reference_clamps / sizeof *reference_clamps,
    SOLID_RUBBERS = sizeof reference_rubbers / sizeof *reference_rubbers
};
static const gs4_solid solid_models[2] = { GS4_NEO_HOOKEAN, GS4_FIXED_COROTATED };
/* of xx yy zz xy xz yz */
static const int solid_index[3][3] = { { 0, 3, 4 }, { 3, 1, 5 }, { 4, 5, 2 } };
static const gs4_real solid_rest[9] = { 0, 0, 0, 0, 0, 0, 0, 0, 0 };
#define SOLID_EPSILON (SOLID_DOUBLE ? (double)DBL_EPSILON : (double)FLT_EPSILON)

static gs4_material solid_material(gs4_solid model, double density, double shear_modulus,
                                   double sound)
{
    gs4_material m = scene_liquid(density, 0, sound);
    m.solid = model;
    m.shear_modulus = (gs4_real)shear_modulus;
    return m;
}

static void solid_point(gs4_point *p, const double F[9])
{
    int i;
    memset(p, 0, sizeof *p);
    for (i = 0; i < 9; i++) p->deformation[i] = (gs4_real)F[i];
}

static double solid_determinant(const double F[9])
{
    return F[0] * (F[4] * F[8] - F[5] * F[7]) + F[1] * (F[5] * F[6] - F[3] * F[8])
           + F[2] * (F[3] * F[7] - F[4] * F[6]);
}

/* --- one point -------------------------------------------------------------------------------- */

/* Largest difference of Cauchy stress from tau G/J, over the largest component; G = 7. */
static double solid_stress_error(gs4_solid model, const reference_solid *r)
{
    const gs4_material m = solid_material(model, 1000, 7, 10);
    const double *tau = model == GS4_NEO_HOOKEAN ? r->neo_hookean : r->split,
                 J = r->s[0] * r->s[1] * r->s[2];
    gs4_real s[6];
    gs4_point p;
    double error = 0, size = 7;
    int i;
    solid_point(&p, r->F);
    CHECK_RESULT(NULL, gs4_point_stress(&m, &p, solid_rest, s), GS4_OK);
    for (i = 0; i < 9; i++) size = fmax(size, fabs(7 * tau[i] / J));
    for (i = 0; i < 9; i++)
        error = fmax(error, fabs((double)s[solid_index[i / 3][i % 3]] - 7 * tau[i] / J));
    return error / size;
}

/* Rounding of F alone changes the smallest singular value by epsilon s[0]. F that is flat or
 * inside out has no isochoric part: refused. */
static void test_solid_stress(void)
{
    int c, k;
    for (c = 0; c < SOLID_CASES; c++)
        for (k = 0; k < 2; k++) {
            const reference_solid *r = &reference_solids[c];
            const gs4_material m = solid_material(solid_models[k], 1000, 1, 10);
            const double condition = r->s[0] / r->s[2];
            gs4_real s[6];
            gs4_point p;
            double error;
            solid_point(&p, r->F);
            if (!(r->s[2] > 1e-9)) {
                CHECK_RESULT(NULL, gs4_point_stress(&m, &p, solid_rest, s), GS4_ERROR_ARGUMENT);
                CHECK(strstr(gs4_last_error(NULL), "deformation") != NULL);
                continue;
            }
            error = solid_stress_error(solid_models[k], r);
            if (test_filter[0])
                printf("%s, model %d: error %.1e, condition %.1e\n", r->name, k, error, condition);
            CHECK(error < (!SOLID_DOUBLE     ? fmax(1e-6, 2 * condition * SOLID_EPSILON)
                           : condition < 1e6 ? 1e-15
                                             : 1e-10));
        }
}

/* Viscosity of what melts at 0: there is none of the solid. */
static gs4_real solid_viscosity(gs4_real T, gs4_real rate, void *user)
{
    (void)rate;
    (void)user;
    return T > 0 ? 7 : (gs4_real)NAN;
}

/* Solid it has s_F alone, liquid 2 mu D alone: of a point that is stretched and sheared, and flows.
 * The viscosity of the other phase is not asked for. */
static void test_solid_melts(void)
{
    static const double F[9] = { 1.2, 0.3, 0, 0, 0.9, 0.1, -0.2, 0, 1.1 },
                        L[9] = { 2, -1, 0.5, 3, -1, 0, 0, 1, -1 };
    int i, j, k, callback, T;
    for (callback = 0; callback < 2; callback++)
        for (T = -5; T <= 5; T += 10) {
            gs4_material m = scene_liquid(1000, callback ? 0 : 7, 10);
            gs4_real flow[9], cauchy[6];
            gs4_point p;
            double J, trace = 0, B[3][3];
            memset(&p, 0, sizeof p);
            m.heat_capacity = 1000;
            m.can_melt = 1;
            m.solid = GS4_NEO_HOOKEAN;
            m.shear_modulus = 40;
            if (callback) {
                m.viscosity_law = GS4_VISCOSITY_CALLBACK;
                m.viscosity_fn = solid_viscosity;
            }
            for (i = 0; i < 9; i++) {
                p.deformation[i] = (gs4_real)F[i];
                flow[i] = (gs4_real)L[i];
            }
            p.temperature = (gs4_real)T;
            J = solid_determinant(F);
            for (i = 0; i < 3; i++)
                for (j = 0; j < 3; j++)
                    for (B[i][j] = 0, k = 0; k < 3; k++)
                        B[i][j] += pow(J, -2.0 / 3) * F[3 * i + k] * F[3 * j + k];
            for (i = 0; i < 3; i++) trace += B[i][i] / 3;
            CHECK_RESULT(NULL, gs4_point_stress(&m, &p, flow, cauchy), GS4_OK);
            for (i = 0; i < 3; i++)
                for (j = i; j < 3; j++)
                    CHECK_CLOSE(cauchy[solid_index[i][j]],
                                T < 0 ? 40 / J * (B[i][j] - (i == j ? trace : 0))
                                      : 7 * (L[3 * i + j] + L[3 * j + i]),
                                sizeof(gs4_real) == 8 ? 1e-12 : 3e-5);
        }
}

/* Singular values and the rotation nearest to F, of flat and inverted F too: the energy |F -
 * R|^2 + (J - 1)^2 has a stress for each. */
static void test_solid_svd(void)
{
    int c, i, j, k;
    for (c = 0; c < SOLID_CASES; c++) {
        const reference_solid *r = &reference_solids[c];
        double F[3][3], U[3][3], s[3], V[3][3], worst = 0, J;
        for (i = 0; i < 9; i++) F[i / 3][i % 3] = r->F[i];
        gs4i_svd(F, U, s, V);
        J = s[0] * s[1] * s[2];
        for (k = 0; k < 3; k++) CHECK_CLOSE(s[k], r->s[k], 1e-15 * r->s[0]);
        CHECK_CLOSE(gs4i_determinant(U), 1, 1e-15);
        CHECK_CLOSE(gs4i_determinant(V), 1, 1e-15);
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                double back = 0, R = 0, tau = 2 * (J - 1) * J * (i == j), UU = 0, VV = 0;
                for (k = 0; k < 3; k++) {
                    back += U[i][k] * s[k] * V[j][k];
                    R += U[i][k] * V[j][k];
                    tau += 2 * s[k] * (s[k] - 1) * U[i][k] * U[j][k];
                    UU += U[i][k] * U[j][k];
                    VV += V[i][k] * V[j][k];
                }
                worst = fmax(worst, fmax(fabs(back - F[i][j]),
                                         fmax(fabs(UU - (i == j)), fabs(VV - (i == j)))));
                worst = fmax(worst,
                             fmax(fabs(R - r->R[3 * i + j]), fabs(tau - r->corotated[3 * i + j])));
            }
        if (test_filter[0]) printf("%s: %.1e\n", r->name, worst);
        CHECK(worst < 4e-15);
    }
    { /* what has no directions of its own */
        double none[3][3] = { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 } },
               line[3][3] = { { 1, 2, 2 }, { 2, 4, 4 }, { -1, -2, -2 } }, U[3][3], s[3], V[3][3];
        gs4i_svd(none, U, s, V);
        CHECK(s[0] == 0 && s[2] == 0 && fabs(gs4i_determinant(U) - 1) < 1e-15);
        gs4i_svd(line, U, s, V);
        CHECK_CLOSE(s[0], sqrt(54.0), 1e-14);
        CHECK_CLOSE(s[1], 0, 1e-14);
        CHECK_CLOSE(gs4i_determinant(U), 1, 1e-15);
        CHECK_CLOSE(gs4i_determinant(V), 1, 1e-15);
    }
}

/* Stretches at constant volume and shear: differences of stress, in which the pressure has no
 * part. */
static void test_solid_rubber(void)
{
    int c, k;
    for (c = 0; c < SOLID_RUBBERS; c++) {
        const reference_rubber *r = &reference_rubbers[c];
        const gs4_material m = solid_material(GS4_NEO_HOOKEAN, 1000, 1, 10);
        const double a = r->parameter,
                     b = r->mode == REF_UNIAXIAL_STRETCH ? 1 / sqrt(a) : 1 / (a * a);
        const double stretched[2][9] = { { a, 0, 0, 0, b, 0, 0, 0, b },
                                         { a, 0, 0, 0, a, 0, 0, 0, b } },
                     sheared[9] = { 1, a, 0, 0, 1, 0, 0, 0, 1 };
        gs4_real s[6];
        gs4_point p;
        solid_point(&p, r->mode == REF_SIMPLE_SHEAR
                            ? sheared
                            : stretched[r->mode == REF_EQUIBIAXIAL_STRETCH]);
        CHECK_RESULT(NULL, gs4_point_stress(&m, &p, solid_rest, s), GS4_OK);
        k = r->mode == REF_SIMPLE_SHEAR;
        CHECK_CLOSE((double)(k ? s[3] : s[0] - s[2]), r->cauchy,
                    20 * SOLID_EPSILON * (1 + fabs(r->cauchy)));
        if (k) CHECK_CLOSE((double)(s[0] - s[1]), r->N1, 20 * SOLID_EPSILON * (1 + fabs(r->N1)));
    }
}

/* One step at rest yields. */
static void test_solid_clamp(void)
{
    int c, i;
    for (c = 0; c < SOLID_CLAMPS; c++) {
        const reference_clamp *r = &reference_clamps[c];
        gs4_material m = solid_material(GS4_NEO_HOOKEAN, 1000, 1, 10);
        double worst = 0;
        gs4_point p;
        m.yield_compression = (gs4_real)r->compression;
        m.yield_stretch = (gs4_real)r->stretch;
        solid_point(&p, r->F);
        CHECK_RESULT(NULL, gs4_point_step(&m, &p, solid_rest, 1, 0, 0), GS4_OK);
        for (i = 0; i < 9; i++) worst = fmax(worst, fabs((double)p.deformation[i] - r->elastic[i]));
        if (test_filter[0]) printf("clamp %d: %.1e\n", c, worst);
        CHECK(worst < (SOLID_DOUBLE ? 1e-10 : solid_determinant(r->F) < 1e-3 ? 5e-3 : 1e-6));
    }
}

/* exp(L t), by the series of a small part of t. */
static void solid_exponential(const double L[9], double t, double E[9])
{
    double x[3][3], e[3][3];
    int i;
    for (i = 0; i < 9; i++) x[i / 3][i % 3] = L[i];
    gs4i_exponential(x, t, e);
    for (i = 0; i < 9; i++) E[i] = e[i / 3][i % 3];
}

static double solid_flow_error(const double L[9], double time, int steps)
{
    static const double start[9] = { 1.1, 0.2, 0, -0.1, 0.9, 0.3, 0.05, 0, 1.2 };
    const gs4_material m = solid_material(GS4_NEO_HOOKEAN, 1000, 1, 10);
    gs4_real l[9];
    double E[9], worst = 0, size = 0;
    gs4_point p;
    int i, k;
    solid_point(&p, start);
    for (i = 0; i < 9; i++) l[i] = (gs4_real)L[i];
    for (k = 0; k < steps; k++)
        CHECK_RESULT(NULL, gs4_point_step(&m, &p, l, (gs4_real)(time / steps), 0, 0), GS4_OK);
    solid_exponential(L, time, E);
    for (i = 0; i < 9; i++) {
        const double exact = E[i / 3 * 3] * start[i % 3] + E[i / 3 * 3 + 1] * start[3 + i % 3]
                             + E[i / 3 * 3 + 2] * start[6 + i % 3];
        worst = fmax(worst, fabs((double)p.deformation[i] - exact));
        size = fmax(size, fabs(exact));
    }
    return worst / size;
}

static void test_solid_order_of_a_point(void)
{
    static const double flows[5][9] = { { 0, 3, 0, 0, 0, 0, 0, 0, 0 },
                                        { 0, -2, 1, 2, 0, -1, -1, 1, 0 },
                                        { 1, 0, 0, 0, -0.5, 0, 0, 0, -0.5 },
                                        { 0.7, 0, 0, 0, 0, 0, 0, 0, 0 },
                                        { 0.3, 1, -0.4, 0.2, -0.6, 0.5, 0.1, 0.9, 0.4 } };
    int k;
    for (k = 0; k < 5; k++) {
        const double coarse = solid_flow_error(flows[k], 2, 40),
                     fine = solid_flow_error(flows[k], 2, 80),
                     once = solid_flow_error(flows[k], 2, 1);
        if (test_filter[0])
            printf("flow %d: errors %.1e %.1e, order %.2f; in one step %.1e\n", k, coarse, fine,
                   log2(coarse / fine), once);
        if (SOLID_DOUBLE) CHECK(coarse < 1e-13 || fabs(log2(coarse / fine) - 2) <= 0.02);
        CHECK(once < (SOLID_DOUBLE ? 1e-12 : 1e-5)); /* the exponential */
    }
}

/* --- scenes ----------------------------------------------------------------------------------- */

/* Elastic energy by the energies of the models, with that of the Tait equation, V0 (rho0 c0^2 /
 * 7) (J^-6/6 + J - 7/6). */
static double solid_elastic_energy(gs4_sim *sim, const gs4_material *m)
{
    const gs4_view F = gs4_particles(sim, GS4_FIELD_DEFORMATION),
                   J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO),
                   mass = gs4_particles(sim, GS4_FIELD_MASS);
    const double c2 = (double)m->sound_speed * (double)m->sound_speed,
                 G = (double)m->shear_modulus / (double)m->density;
    double sum = 0;
    int i, k;
    for (i = 0; i < F.count; i++) {
        const gs4_real *f = F.data + (size_t)i * (size_t)F.stride;
        const double j = (double)J.data[(size_t)i * (size_t)J.stride], q = cbrt(j);
        double a[3][3], U[3][3], s[3], V[3][3], energy = c2 / 7 * (pow(j, -6) / 6 + j - 7.0 / 6);
        for (k = 0; k < 9; k++) a[k / 3][k % 3] = (double)f[k];
        gs4i_svd(a, U, s, V);
        for (k = 0; k < 3; k++)
            energy += m->solid == GS4_NEO_HOOKEAN ? 0.5 * G * (s[k] * s[k] / (q * q) - 1)
                                                  : G * (s[k] / q - 1) * (s[k] / q - 1);
        sum += energy * (double)mass.data[(size_t)i * (size_t)mass.stride];
    }
    return sum;
}

/* Worst difference of det F from J, and the smallest of det F / J, over all particles. */
static double solid_worst_volume(const gs4_sim *sim, double *least)
{
    const gs4_view F = gs4_particles(sim, GS4_FIELD_DEFORMATION),
                   J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO);
    double worst = 0;
    int i, k;
    for (*least = 1, i = 0; i < F.count; i++) {
        double f[9], ratio;
        for (k = 0; k < 9; k++) f[k] = (double)F.data[(size_t)i * (size_t)F.stride + (size_t)k];
        ratio = solid_determinant(f) / (double)J.data[(size_t)i * (size_t)J.stride];
        worst = fmax(worst, fabs(ratio - 1));
        if (!(ratio > *least)) *least = ratio;
        if (!(ratio == ratio)) worst = 1e9;
    }
    return worst;
}

/* Standing wave in a periodic box, along y, of vy (length) or vx (shear) = a sin(2 pi y) at
 * first; its frequency over the exact one from the turning points of what it overlaps with. */
static double solid_wave(gs4_integrator integrator, gs4_solid model, int along, int n)
{
    const double pi = acos(-1.0), c2 = along ? 16 + 4.0 / 3 : 1, w = 2 * pi * sqrt(c2),
                 step = 0.25 / w;
    gs4_sim_desc d = scene_cube(n);
    gs4_material m = solid_material(model, 1, 1, 4);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double a[24], s[2] = { 0, 0 };
    gs4_edit v;
    gs4_view x, u;
    gs4_sim *sim;
    int i, t;
    d.cells[0] = d.cells[2] = 4;
    d.integrator = integrator;
    if (integrator == GS4_INTEGRATOR_GS4) d.flip_decay_time = (gs4_real)INFINITY;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_PERIODIC;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(4.0 / n, 1, 4.0 / n)), &f) > 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++)
        v.data[(size_t)i * (size_t)v.stride + (size_t)along] =
            (gs4_real)(0.002 * sin(2 * pi * (double)x.data[(size_t)i * (size_t)x.stride + 1]));
    for (t = 0; t < 24; t++) {
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        u = gs4_particles(sim, GS4_FIELD_VELOCITY);
        for (a[t] = 0, i = 0; i < u.count; i++)
            a[t] += (double)u.data[(size_t)i * (size_t)u.stride + (size_t)along]
                    * sin(2 * pi * (double)x.data[(size_t)i * (size_t)x.stride + 1]);
        CHECK(physics_run(sim, (t + 1) * step) == 0);
        if (t < 2) continue;
        /* a cosine: a_{t+1} + a_{t-1} = 2 cos(w dt) a_t */
        s[0] += (a[t] + a[t - 2]) * a[t - 1];
        s[1] += 2 * a[t - 1] * a[t - 1];
    }
    gs4_destroy(sim);
    return acos(s[0] / s[1]) / step / w;
}

static void test_solid_waves(void)
{
    int i, along, model;
    for (i = 0; i < (test_full ? 2 : 1); i++)
        for (along = 0; along < 2; along++)
            for (model = 0; model < (test_full ? 2 : 1); model++) {
                const double ratio =
                    solid_wave(physics_integrators[i], solid_models[model], along, 32);
                if (test_filter[0])
                    printf("%s wave, integrator %d, model %d: %.4f of the exact frequency\n",
                           along ? "length" : "shear", i, model, ratio);
                CHECK_BETWEEN(ratio,
                              i == 1  ? 0.987
                              : along ? 0.9885
                                      : 0.992,
                              i == 1  ? 0.988
                              : along ? 0.9895
                                      : 0.993);
            }
}

/* --- order in time ---------------------------------------------------------------------------- */

typedef struct solid_run {
    double x[3 * ORDER_MAX], v[3 * ORDER_MAX], J[ORDER_MAX], F[9 * ORDER_MAX];
    int count;
} solid_run;

/* A ball that breathes, shears and turns. */
static int solid_simulate(gs4_solid model, double rho, double decay, double time, int steps,
                          solid_run *run)
{
    gs4_sim_desc d = scene_cube(16);
    gs4_material m = solid_material(model, 1000, 1000, 2);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    int i, result = 0;
    d.rho_inf = (gs4_real)rho;
    d.flip_decay_time = (gs4_real)decay;
    sim = physics_create(&d, &m);
    run->count = gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.18), &f);
    order_stir(sim);
    for (i = 0; i < steps && result == 0; i++) result = gs4_step(sim, (gs4_real)(time / steps));
    if (result < 0) printf("    %s\n", gs4_last_error(sim));
    scene_by_id(sim, GS4_FIELD_POSITION, run->x);
    scene_by_id(sim, GS4_FIELD_VELOCITY, run->v);
    scene_by_id(sim, GS4_FIELD_VOLUME_RATIO, run->J);
    scene_by_id(sim, GS4_FIELD_DEFORMATION, run->F);
    gs4_destroy(sim);
    return result;
}

static void test_solid_order(void)
{
    /* model, rho_inf, decay */
    static const double cases[6][3] = { { 0, 0, 1e30 }, { 1, 0.5, 0.2 }, { 0, 0.5, 1e30 },
                                        { 1, 0, 1e30 }, { 0, 0, 0.2 },   { 1, 1, 1e30 } };
    static solid_run run[3];
    int c, i;
    if (!SOLID_DOUBLE) return; /* rounding would hide it */
    for (c = 0; c < (test_full ? 6 : 2); c++) {
        const gs4_solid model = solid_models[(int)cases[c][0]];
        double x, v, J, F;
        for (i = 0; i < 3; i++)
            CHECK(solid_simulate(model, cases[c][1], cases[c][2], 0.4, (test_full ? 256 : 128) << i,
                                 &run[i])
                  == 0);
        x = order_of(run[0].x, run[1].x, run[2].x, 3 * run[0].count);
        v = order_of(run[0].v, run[1].v, run[2].v, 3 * run[0].count);
        J = order_of(run[0].J, run[1].J, run[2].J, run[0].count);
        F = order_of(run[0].F, run[1].F, run[2].F, 9 * run[0].count);
        if (test_filter[0])
            printf("model %d, rho %g, decay %g: order x %.2f v %.2f J %.2f F %.2f\n", (int)model,
                   cases[c][1], cases[c][2], x, v, J, F);
        CHECK_BETWEEN(x, 1.9, 2.15);
        CHECK_BETWEEN(v, 1.9, 2.15);
        CHECK_BETWEEN(J, 1.9, 2.15);
        CHECK_BETWEEN(F, 1.9, 2.15);
    }
}

/* --- turning, bouncing ------------------------------------------------------------------------ */

/* A steady turn leaves F a rotation, whatever the step. */
static void test_solid_turns(void)
{
    const gs4_material m = solid_material(GS4_FIXED_COROTATED, 1000, 1, 10);
    const double turns[3] = { 0.02, 0.3, 1.9 };
    int k, i, j;
    for (k = 0; k < 3; k++) {
        gs4_real L[9] = { 0, -3, 2, 3, 0, -1, -2, 1, 0 }, s[6];
        double worst = 0;
        gs4_point p;
        memset(&p, 0, sizeof p);
        for (i = 0; i < 1000; i++)
            CHECK_RESULT(NULL, gs4_point_step(&m, &p, L, (gs4_real)(turns[k] / 5.2), 0, 0), GS4_OK);
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                double sum = -(i == j);
                int c;
                for (c = 0; c < 3; c++)
                    sum += (double)p.deformation[3 * i + c] * (double)p.deformation[3 * j + c];
                worst = fmax(worst, fabs(sum));
            }
        CHECK_RESULT(NULL, gs4_point_stress(&m, &p, solid_rest, s), GS4_OK);
        for (i = 0; i < 6; i++) worst = fmax(worst, fabs((double)s[i]));
        if (test_filter[0]) printf("turns of %g: strain %.1e\n", turns[k], worst);
        CHECK(worst < 4 * 1000 * SOLID_EPSILON); /* rounding of a thousand steps */
    }
}

/* A free cube that turns at 1/50 of the speed of shear waves: kinetic energy over what it was,
 * elastic energy over kinetic; its velocities given with the particles, or by hand. */
static void solid_spin(gs4_integrator integrator, double decay, int by_hand, double *kept,
                       double *strained, double *spin)
{
    gs4_sim_desc d = scene_cube(16);
    gs4_material m = solid_material(GS4_NEO_HOOKEAN, 1000, 1e5, 20);
    gs4_fill f = scene_fill(at(0.05, 0, 0));
    gs4_stats before, after;
    gs4_sim *sim;
    int i;
    d.integrator = integrator;
    d.flip_decay_time = (gs4_real)decay;
    sim = physics_create(&d, &m);
    if (!by_hand) f.angular_velocity = at(0, 0.3, 1);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.3125, 0.3125, 0.3125), at(0.625, 0.625, 0.625)), &f)
          > 0);
    if (by_hand) {
        const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
        const gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (i = 0; i < v.count; i++) {
            const gs4_real *p = x.data + (size_t)i * (size_t)x.stride, c = (gs4_real)0.46875;
            gs4_real *u = v.data + (size_t)i * (size_t)v.stride;
            u[0] += (gs4_real)0.3 * (p[2] - c) - (p[1] - c);
            u[1] += p[0] - c;
            u[2] -= (gs4_real)0.3 * (p[0] - c);
        }
    }
    before = gs4_get_stats(sim);
    CHECK(physics_run(sim, 1.2) == 0);
    after = gs4_get_stats(sim);
    *kept = after.kinetic_energy / before.kinetic_energy;
    *spin = after.angular_momentum[2] / before.angular_momentum[2];
    *strained = solid_elastic_energy(sim, &m) / before.kinetic_energy;
    /* corners count as spray, and what fades there takes some along */
    for (i = 0; i < 3; i++)
        CHECK_CLOSE(after.momentum[i], before.momentum[i],
                    before.mass * 0.3
                        * (integrator == GS4_INTEGRATOR_GS4 ? 1e-5
                           : SOLID_DOUBLE                   ? 1e-13
                                                            : 1e-6));
    gs4_destroy(sim);
}

static void test_solid_spin(void)
{
    int i;
    for (i = test_full ? 0 : 1; i < (test_full ? 3 : 2); i++) {
        double kept, strained, spin;
        solid_spin(physics_integrators[i == 2], i == 0 ? 1e30 : 0, i == 1, &kept, &strained, &spin);
        if (test_filter[0])
            printf("spin, integrator %d: kinetic energy %.4f, spin %.4f, elastic %.5f\n", i, kept,
                   spin, strained);
        CHECK_CLOSE(kept, 1, i == 2 ? 1.2e-3 : 2e-4);
        CHECK_CLOSE(spin, 1, 2e-4);
        /* centrifugal: 2e-5; what rounding F makes of it in float */
        CHECK_CLOSE(strained, 0, SOLID_DOUBLE ? 1e-4 : 2e-3);
    }
}

/* A ball that turns on for 1e4 steps of 0.7 ms: mean square distance from axis a over that at
 * first. */
static double solid_turns_on(int a, double rate)
{
    gs4_sim_desc d = scene_cube(10);
    gs4_material m = solid_material(GS4_NEO_HOOKEAN, 1000, 1e4, 10);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    double square[2] = { 0, 0 };
    gs4_sim *sim;
    int i, k;
    d.cell_size = (gs4_real)0.01;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.05, 0.05, 0.05), (gs4_real)0.02), &f) > 0);
    for (k = 0; k < 2; k++) {
        const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
        const gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (i = 0; i < x.count; i++) {
            const gs4_real *p = x.data + (size_t)i * (size_t)x.stride;
            const double y = (double)p[b] - 0.05, z = (double)p[c] - 0.05;
            square[k] += y * y + z * z;
            if (k) continue;
            v.data[(size_t)i * (size_t)v.stride + (size_t)b] = (gs4_real)(-rate * z);
            v.data[(size_t)i * (size_t)v.stride + (size_t)c] = (gs4_real)(rate * y);
        }
        for (i = 0; i < 10000 && k == 0; i++)
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)7e-4), GS4_OK);
    }
    gs4_destroy(sim);
    return square[1] / square[0];
}

/* Round an arc of which a step is 1e-4, the second order of a position is less than its rounding.
 * It must not get lost in it: that was a ball that grew by that much with each step, 1e-3 here. */
static void test_solid_turns_on(void)
{
    static const double rates[3] = { 0.15, 0.3, 0.6 };
    int a;
    for (a = 0; a < 3; a++) {
        const double grown = solid_turns_on(a, rates[a]);
        if (test_filter[0]) printf("%g rad/s about axis %d: %.2e\n", rates[a], a, grown - 1);
        CHECK_CLOSE(grown, 1, SOLID_DOUBLE ? 1e-5 : 1e-4);
    }
}

/* A cube falls on a floor that lets go: energy over what it was, at its highest point
 * thereafter, and how high that is over where it started. */
static void solid_bounce(gs4_integrator integrator, gs4_solid model, double decay, double viscosity,
                         double *kept, double *height)
{
    gs4_sim_desc d = scene_cube(20);
    gs4_material m = solid_material(model, 1000, 3e4, 20);
    gs4_fill f = scene_fill(at(0, -1, 0));
    gs4_sim *sim;
    double start = 0, now = 0, most = 0, y = 0;
    int i, k, fallen = 0;
    d.integrator = integrator;
    d.flip_decay_time = (gs4_real)decay;
    d.gravity = at(0, -9.81, 0);
    d.walls[2] = GS4_WALL_SEPARATE;
    m.viscosity = (gs4_real)viscosity;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.35, 0.1, 0.35), at(0.65, 0.4, 0.65)), &f) > 0);
    for (k = 0; k < 60; k++) {
        const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
        const gs4_stats s = gs4_get_stats(sim);
        for (y = 0, i = 0; i < x.count; i++)
            y += (double)x.data[(size_t)i * (size_t)x.stride + 1] / x.count;
        now = s.kinetic_energy + solid_elastic_energy(sim, &m) + s.mass * 9.81 * (y - 0.15);
        if (k == 0) start = now;
        fallen |= s.momentum[1] > 0;
        if (fallen) most = fmax(most, y - 0.15);
        if (fallen && s.momentum[1] < 0) break;
        CHECK(physics_run(sim, (k + 1) * 0.01) == 0);
    }
    *kept = now / start;
    *height = most / (start / gs4_get_stats(sim).mass / 9.81);
    gs4_destroy(sim);
}

/* What contact takes is the motion into the floor of the nodes it touches: 9 % here, 7.6 % of 40
 * cells a side, 7.0 of 60, 5.7 of 80; the rest is the decay, 0.5 s, in 0.3 s of which half goes
 * by without strain; symplectic Euler, whose particles are all that the grid sees, keeps 63 %. */
static void test_solid_bounce(void)
{
    /* integrator, model, decay, viscosity, energy */
    static const double cases[5][5] = { { 0, 0, 1e30, 0, 0.91 },
                                        { 1, 0, 0, 0, 0.64 },
                                        { 0, 0, 0, 0, 0.89 },
                                        { 0, 1, 1e30, 0, 0.91 },
                                        { 0, 0, 1e30, 50, 0.66 } };
    int c;
    for (c = 0; c < (test_full ? 5 : 2); c++) {
        double kept, height;
        solid_bounce(physics_integrators[(int)cases[c][0]], solid_models[(int)cases[c][1]],
                     cases[c][2], cases[c][3], &kept, &height);
        if (test_filter[0])
            printf("bounce, integrator %g, model %g, decay %g, viscosity %g: energy %.4f, height "
                   "%.4f\n",
                   cases[c][0], cases[c][1], cases[c][2], cases[c][3], kept, height);
        CHECK_CLOSE(kept, cases[c][4], 0.01);
        CHECK_BETWEEN(height, cases[c][4] - 0.15, cases[c][4]);
    }
}

/* A ball that rings for five periods: energy over what it was, momentum. */
static double solid_ring(gs4_integrator integrator, gs4_solid model, double decay)
{
    gs4_sim_desc d = scene_cube(20);
    gs4_material m = solid_material(model, 1000, 1000, 4);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_stats before, after;
    gs4_view x;
    gs4_edit v;
    gs4_sim *sim;
    double start;
    int i;
    d.integrator = integrator;
    d.flip_decay_time = (gs4_real)decay;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.2), &f) > 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++) { /* at constant volume */
        const gs4_real *p = x.data + (size_t)i * (size_t)x.stride;
        gs4_real *u = v.data + (size_t)i * (size_t)v.stride;
        const double a = (double)p[0] - 0.5, b = (double)p[1] - 0.5, c = (double)p[2] - 0.5;
        u[0] = (gs4_real)(0.5 * a + 0.3 * b);
        u[1] = (gs4_real)(-0.25 * b - 0.3 * a);
        u[2] = (gs4_real)(-0.25 * c);
    }
    before = gs4_get_stats(sim);
    start = before.kinetic_energy;
    CHECK(physics_run(sim, 3) == 0);
    after = gs4_get_stats(sim);
    for (i = 0; i < 3; i++)
        CHECK_CLOSE(after.momentum[i], before.momentum[i],
                    before.mass * 0.1 * (SOLID_DOUBLE ? 1e-13 : 1e-5));
    start = (after.kinetic_energy + solid_elastic_energy(sim, &m)) / start;
    gs4_destroy(sim);
    return start;
}

static void test_solid_ring(void)
{
    int k;
    for (k = 0; k < 2; k++) {
        const double kept = solid_ring(GS4_INTEGRATOR_GS4, solid_models[k], 1e30),
                     faded = solid_ring(GS4_INTEGRATOR_GS4, solid_models[k], 0),
                     euler = solid_ring(GS4_INTEGRATOR_SYMPLECTIC_EULER, solid_models[k], 0);
        if (test_filter[0])
            printf("ring, model %d: energy %.4f, with the default decay %.4f, Euler %.4f\n", k,
                   kept, faded, euler);
        CHECK_CLOSE(kept, 0.92, 0.01);
        CHECK_CLOSE(faded, 0.6, 0.02);
        CHECK_CLOSE(euler, 0.28, 0.01);
    }
}

/* --- plasticity ------------------------------------------------------------------------------- */

/* A cube hits the floor at speed; its height over what it was when it has come to rest, for a
 * solid that yields and one that does not. */
static double solid_squash(gs4_integrator integrator, double yield)
{
    gs4_sim_desc d = scene_cube(16);
    gs4_material m = solid_material(GS4_FIXED_COROTATED, 1000, 2e4, 20);
    gs4_fill f = scene_fill(at(0, -2.5, 0));
    gs4_sim *sim;
    gs4_view x;
    double low = 1, high = 0, least;
    int i;
    d.integrator = integrator;
    d.gravity = at(0, -9.81, 0);
    d.walls[2] = GS4_WALL_SEPARATE;
    m.yield_compression = (gs4_real)yield;
    m.yield_stretch = (gs4_real)yield;
    m.viscosity = 30;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.375, 0, 0.375), at(0.625, 0.25, 0.625)), &f) > 0);
    CHECK(physics_run(sim, 0.7) == 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++) {
        const double y = (double)x.data[(size_t)i * (size_t)x.stride + 1];
        low = fmin(low, y);
        high = fmax(high, y);
    }
    CHECK(solid_worst_volume(sim, &least) < 1e-3);
    CHECK(least > 0);
    gs4_destroy(sim);
    return (high - low) / (0.25 - 0.5 / 16);
}

static void test_solid_yield(void)
{
    int i;
    for (i = 0; i < 2; i++) {
        const double elastic = solid_squash(physics_integrators[i], 0),
                     plastic = solid_squash(physics_integrators[i], 0.02);
        if (test_filter[0])
            printf("squash, integrator %d: height %.3f elastic, %.3f plastic\n", i, elastic,
                   plastic);
        CHECK_CLOSE(elastic, 1, 0.04);
        CHECK_BETWEEN(plastic, 0.3, 0.85);
    }
}

/* --- extremes --------------------------------------------------------------------------------- */

/* Jittered balls and boxes of all stiffnesses thrown about in a box: every step is taken or
 * refused with a sentence and without a trace; det F stays above 0 and near J. */
static void test_solid_extremes(void)
{
    uint32_t seed = 11;
    int c, i, k, taken = 0, refused = 0;
    for (c = 0; c < (test_slow ? 200 : 12); c++) {
        gs4_sim_desc d = scene_cube(12);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        double least, worst = 0;
        d.integrator = physics_integrators[c % 2];
        d.gravity = at(0, -20 * fabs(stability_random(&seed)), 0);
        for (i = 0; i < 6; i++)
            d.walls[i] = c % 3 == 0   ? GS4_WALL_STICK
                         : c % 3 == 1 ? GS4_WALL_SEPARATE
                                      : GS4_WALL_SLIP;
        if (c % 2 == 0) {
            d.rho_inf = (gs4_real)(c % 5 ? 0.5 : 0);
            d.rho_inf_spurious = (gs4_real)(c % 7 ? 0 : 0.4) * d.rho_inf;
        }
        sim = physics_create(&d, NULL);
        for (k = 0; k < 3; k++) {
            gs4_material m = solid_material(solid_models[(c + k) % 2], 1000,
                                            1000 * pow(10, 6 * stability_random(&seed)),
                                            3 + 20 * fabs(stability_random(&seed)));
            if (k == 1 && c % 4 == 0) {
                m.solid = GS4_NO_SOLID;
                m.shear_modulus = 0;
                m.viscosity = 1;
            }
            if (k == 2) {
                m.yield_compression = (gs4_real)0.05;
                m.yield_stretch = (gs4_real)(c % 2 ? 0.02 : 0);
            }
            CHECK_RESULT(sim, gs4_add_material(sim, &m), GS4_OK);
            f.material = k;
            f.jitter = (gs4_real)(c % 2);
            f.random_seed = (uint32_t)c;
            f.velocity = at(20 * stability_random(&seed), 20 * stability_random(&seed),
                            20 * stability_random(&seed));
            f.angular_velocity = at(0, 0, 40 * stability_random(&seed));
            CHECK(gs4_add_particles(
                      sim, gs4_box(at(0.1, 0.1 + 0.28 * k, 0.3), at(0.8, 0.33 + 0.28 * k, 0.6)), &f)
                  > 0);
        }
        if (c % 3 == 2) stability_stir(sim, 30, seed);
        for (i = 0; i < 60; i++) {
            const uint64_t hash = gs4_state_hash(sim);
            const double fraction = 0.3 + 2 * fabs(stability_random(&seed));
            const int result = gs4_step(sim, (gs4_real)(fraction * (double)gs4_stable_dt(sim)));
            if (result == GS4_OK)
                taken++;
            else {
                refused++;
                CHECK(result == GS4_ERROR_UNSTABLE && gs4_state_hash(sim) == hash
                      && strlen(gs4_last_error(sim)) > 20);
                if (gs4_step(sim, (gs4_real)(0.02 * (double)gs4_stable_dt(sim))) < 0) break;
            }
        }
        worst = solid_worst_volume(sim, &least);
        if (worst > 1e-3 && test_filter[0])
            printf("case %d: det F / J differs from 1 by %.1e, least %.1e\n", c, worst, least);
        CHECK(least > 0);
        CHECK(worst < (SOLID_DOUBLE ? 1e-6 : 1e-2));
        CHECK(gs4_get_stats(sim).kinetic_energy >= 0 && gs4_get_stats(sim).kinetic_energy < 1e6);
        gs4_destroy(sim);
    }
    if (test_filter[0]) printf("extremes: %d steps taken, %d refused\n", taken, refused);
    CHECK(taken > refused); /* one in three is beyond the limit */
}

/* At any step, of one point. */
static void test_solid_huge_steps(void)
{
    uint32_t seed = 5;
    int c, i, k;
    for (c = 0; c < (test_full ? 300 : 100); c++) {
        gs4_material m = solid_material(solid_models[c % 2], 1000, 1, 10);
        gs4_real s[6];
        gs4_point p;
        memset(&p, 0, sizeof p);
        for (i = 0; i < 20; i++) {
            gs4_real L[9];
            gs4_point before = p;
            double F[9], size = pow(10, 3 * fabs(stability_random(&seed)) - 1), all = 0;
            int r;
            for (k = 0; k < 9; k++) L[k] = (gs4_real)(size * stability_random(&seed));
            L[8] = -L[0] - L[4];
            for (k = 0; k < 9; k++) all += (double)L[k] * (double)L[k];
            r = gs4_point_step(&m, &p, L, 1, 0, 0);
            if (r < 0) {
                CHECK(r == GS4_ERROR_UNSTABLE && all > 60 && memcmp(&p, &before, sizeof p) == 0);
                continue;
            }
            for (k = 0; k < 9; k++) F[k] = (double)p.deformation[k];
            CHECK(solid_determinant(F) > 0);
            CHECK_CLOSE(solid_determinant(F), 1, SOLID_DOUBLE ? 1e-6 : 0.2);
            r = gs4_point_stress(&m, &p, L, s);
            CHECK(r == GS4_OK && fabs((double)s[0]) < 1e12);
        }
    }
}

/* --- whole scenes: threads, checkpoints, files, memory ---------------------------------------- */

/* Solids of both models, one of them plastic, and a liquid; solids added to a scene that runs
 * already. */
static gs4_sim *solid_scene(gs4_integrator integrator, int threads, int filled)
{
    gs4_sim_desc d = scene_cube(12);
    gs4_material water = scene_liquid(1000, 1, 10),
                 rubber = solid_material(GS4_NEO_HOOKEAN, 1000, 2000, 10),
                 clay = solid_material(GS4_FIXED_COROTATED, 1500, 5000, 10);
    gs4_fill f = scene_fill(at(0.5, -1, 0));
    gs4_sim *sim;
    d.integrator = integrator;
    d.gravity = at(0, -9.81, 0);
    d.threads = threads;
    d.walls[2] = GS4_WALL_SEPARATE;
    clay.yield_compression = (gs4_real)0.03;
    clay.yield_stretch = (gs4_real)0.01;
    clay.viscosity = 2;
    sim = physics_create(&d, &water);
    if (filled) CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 0.25, 1)), &f) > 0);
    CHECK_RESULT(sim, gs4_add_material(sim, &rubber), 0);
    CHECK_RESULT(sim, gs4_add_material(sim, &clay), 0);
    if (!filled) return sim;
    f.material = 1;
    f.angular_velocity = at(0, 1, 3);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.2, 0.35, 0.2), at(0.5, 0.6, 0.5)), &f) > 0);
    f.material = 2;
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.7, 0.5, 0.6), (gs4_real)0.15), &f) > 0);
    return sim;
}

static void test_solid_state(void)
{
    int k, i, steps = test_full ? 60 : 24;
    for (k = 0; k < 2; k++) {
        gs4_sim *one = solid_scene(physics_integrators[k], 1, 1), *other, *next;
        uint64_t halfway;
#ifdef GS4_PTHREADS
        other = solid_scene(physics_integrators[k], 3, 1);
#else
        other = solid_scene(physics_integrators[k], 1, 1);
#endif
        next = solid_scene(physics_integrators[k], 1, 0);
        for (i = 0; i < steps; i++) {
            const gs4_real dt = gs4_stable_dt(one) / 2;
            if (i == steps / 2) {
                CHECK_RESULT(one, gs4_save(one, "solid.save"), GS4_OK);
                CHECK_RESULT(next, gs4_load(next, "solid.save"), GS4_OK);
                halfway = gs4_state_hash(one);
                CHECK(gs4_state_hash(next) == halfway);
            }
            CHECK_RESULT(one, gs4_step(one, dt), GS4_OK);
            CHECK_RESULT(other, gs4_step(other, dt), GS4_OK);
            if (i >= steps / 2) CHECK_RESULT(next, gs4_step(next, dt), GS4_OK);
        }
        CHECK(gs4_state_hash(one) == gs4_state_hash(other));
        CHECK(gs4_state_hash(one) == gs4_state_hash(next));
        /* the liquid has no strain but that of its volume, the solids have; det F = J */
        {
            const gs4_view F = gs4_particles(one, GS4_FIELD_DEFORMATION),
                           J = gs4_particles(one, GS4_FIELD_VOLUME_RATIO);
            double liquid = 0, solid = 0, least;
            CHECK(F.components == 9 && F.count == J.count);
            for (i = 0; i < F.count; i++) {
                const gs4_real *f = F.data + (size_t)i * (size_t)F.stride;
                const double off = fabs((double)f[1]) + fabs((double)f[2]) + fabs((double)f[5])
                                   + fabs((double)f[0] - (double)f[4]);
                if (gs4_particle_materials(one)[i])
                    solid = fmax(solid, off);
                else
                    liquid = fmax(liquid, off);
            }
            CHECK(liquid == 0);
            CHECK(solid > 0.01);
            CHECK(solid_worst_volume(one, &least) < (SOLID_DOUBLE ? 1e-13 : 5e-6));
        }
        gs4_destroy(one);
        gs4_destroy(other);
        gs4_destroy(next);
        remove("solid.save");
    }
}

static int solid_file_has(const char *path, const char *what)
{
    static char text[4096];
    FILE *f = fopen(path, "rb");
    size_t n = f ? fread(text, 1, sizeof text - 1, f) : 0, i, found = 0;
    if (f) fclose(f);
    for (i = 0; i + strlen(what) <= n; i++) found |= memcmp(text + i, what, strlen(what)) == 0;
    return (int)found;
}

/* F is in views, frames and memory where there is a solid, and nowhere else; a point beyond its
 * yield has less stress after a step. */
static void test_solid_is_paid_for_where_it_is(void)
{
    gs4_sim_desc d = scene_cube(8);
    gs4_material water = scene_liquid(1000, 1, 10),
                 rubber = solid_material(GS4_NEO_HOOKEAN, 1000, 2000, 10);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim = physics_create(&d, &water);
    uint64_t before;
    int i;
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 0.5, 1)), &f) > 0);
    for (i = 0; i < 3; i++) CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim) / 2), GS4_OK);
    CHECK(gs4_particles(sim, GS4_FIELD_DEFORMATION).data == NULL);
    CHECK_RESULT(sim, gs4_write_ply(sim, "solid.ply"), GS4_OK);
    CHECK(!solid_file_has("solid.ply", "F_xx"));
    before = gs4_get_stats(sim).memory_bytes;
    CHECK_RESULT(sim, gs4_add_material(sim, &rubber), 0);
    CHECK(gs4_get_stats(sim).memory_bytes - before
          >= 24 * sizeof(gs4_real) * (uint64_t)gs4_get_stats(sim).particles);
    CHECK(gs4_particles(sim, GS4_FIELD_DEFORMATION).components == 9);
    CHECK_CLOSE(pow((double)gs4_particles(sim, GS4_FIELD_DEFORMATION).data[0], 3),
                (double)gs4_particles(sim, GS4_FIELD_VOLUME_RATIO).data[0], 1e-6);
    CHECK_RESULT(sim, gs4_write_ply(sim, "solid.ply"), GS4_OK);
    CHECK(solid_file_has("solid.ply", "F_xx") && solid_file_has("solid.ply", "F_zy"));
    CHECK_RESULT(sim, gs4_write_raw(sim, "solid.npy"), GS4_OK);
    CHECK(solid_file_has("solid.npy", "'deformation', '<f")
          && solid_file_has("solid.npy", "(3, 3)"));
    for (i = 0; i < 3; i++) CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim) / 2), GS4_OK);
    remove("solid.ply");
    remove("solid.npy");
    gs4_destroy(sim);
}

/* One stage of a scene in which solids come to a liquid; velocities are set by hand before a
 * step. */
static int solid_do(gs4_sim *sim, int stage)
{
    const gs4_material water = scene_liquid(1000, 1, 10),
                       clay = solid_material(GS4_FIXED_COROTATED, 1500, 5000, 10);
    gs4_fill f = scene_fill(at(0, -1, 0));
    if (stage == 0) return gs4_add_material(sim, &water);
    if (stage == 1) return gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 0.25, 1)), &f);
    if (stage == 2) return gs4_add_material(sim, &clay);
    f.material = 1;
    f.angular_velocity = at(0, 0, 2);
    if (stage == 3)
        return gs4_add_particles(sim, gs4_box(at(0.2, 0.4, 0.2), at(0.6, 0.7, 0.6)), &f);
    if (stage == 5) gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    if (stage == 6) return gs4_save(sim, "solid_memory.save");
    if (stage == 8) return gs4_load(sim, "solid_memory.save");
    return gs4_step(sim, (gs4_real)5e-4);
}

/* Every allocation refused once: a code, nothing lost, nothing changed, and the same end when it
 * is done again. */
static void test_solid_memory(void)
{
    uint64_t reference[2] = { 0, 0 };
    int euler, stage, r;
    long k, calls;
    for (euler = 0; euler < 2; euler++)
        for (calls = 0, k = -1; k < 0 || k < calls; k += k < 0 || test_full ? 1 : 5) {
            gs4_sim_desc d = scene_cube(8);
            gs4_sim *sim = NULL;
            files_memory m;
            uint64_t before, hash;
            memset(&m, 0, sizeof m);
            m.fail_at = k;
            d.integrator = physics_integrators[euler];
            d.gravity = at(0, -9.81, 0);
            d.allocator.alloc_fn = files_alloc;
            d.allocator.free_fn = files_free;
            d.allocator.user = &m;
            if (gs4_create(&d, &sim) < 0) {
                CHECK(m.live == 0 && k >= 0);
                continue;
            }
            for (stage = 0; stage < 10; stage++) {
                before = gs4_state_hash(sim);
                r = solid_do(sim, stage);
                if (r >= 0) continue;
                CHECK(k >= 0 && r == GS4_ERROR_MEMORY
                      && (stage == 5 || gs4_state_hash(sim) == before));
                m.fail_at = -1;
                CHECK_RESULT(sim, solid_do(sim, stage), 0);
            }
            hash = gs4_state_hash(sim);
            if (k < 0) {
                reference[euler] = hash;
                calls = m.calls;
            }
            CHECK(hash == reference[euler]);
            CHECK(gs4_get_stats(sim).memory_bytes == m.bytes);
            gs4_destroy(sim);
            CHECK(m.live == 0 && m.bytes == 0 && m.wrong == 0);
        }
    remove("solid_memory.save");
}

/* 0.95 of the limit, where elastic waves set it, with all wiggles that a grid has. */
static void test_solid_stability(void)
{
    static const double family[4][2] = { { 0, 0 }, { 1, 0 }, { 0.5, 0.5 }, { -1, 0 } };
    int c, i;
    for (c = 0; c < 8; c++) {
        gs4_sim_desc d = scene_cube(14);
        gs4_material m = solid_material(solid_models[c / 4], 1000, 1e5, 3);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        stability_bounds bounds;
        double start, most = 0;
        if (family[c % 4][0] < 0)
            d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
        else {
            d.rho_inf = (gs4_real)family[c % 4][0];
            d.rho_inf_spurious = (gs4_real)family[c % 4][1];
            d.flip_decay_time = INFINITY;
        }
        sim = physics_create(&d, &m);
        f.jitter = 1;
        f.random_seed = 5;
        CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)(3.5 / 14)), &f) > 0);
        stability_stir(sim, 0.01, 1);
        start = gs4_get_stats(sim).kinetic_energy;
        bounds = stability_before(sim, start);
        for (i = 0; i < (test_slow ? 3000 : test_full ? 150 : 80) && most < 100; i++) {
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.95 * (double)gs4_stable_dt(sim))), GS4_OK);
            most = fmax(most, gs4_get_stats(sim).kinetic_energy / start);
        }
        if (test_filter[0])
            printf("solid, model %d, rho %g %g: kinetic energy at most %.3f of the start\n", c / 4,
                   family[c % 4][0], family[c % 4][1], most);
        CHECK_BETWEEN(most, bounds.least, bounds.most);
        CHECK_BETWEEN(gs4_get_stats(sim).kinetic_energy / start, bounds.least, bounds.most);
        gs4_destroy(sim);
    }
}

static void run_solid(void)
{
    RUN(test_solid_stress);
    RUN(test_solid_melts);
    RUN(test_solid_svd);
    RUN(test_solid_rubber);
    RUN(test_solid_clamp);
    RUN(test_solid_order_of_a_point);
    RUN(test_solid_turns);
    RUN_FULL(test_solid_waves);
    RUN_FULL(test_solid_order);
    RUN_FULL(test_solid_spin);
    RUN_FULL(test_solid_turns_on);
    RUN_FULL(test_solid_bounce);
    RUN_FULL(test_solid_ring);
    RUN_FULL(test_solid_yield);
    RUN_FULL(test_solid_extremes);
    RUN(test_solid_huge_steps);
    RUN_ONCE(test_solid_state);
    RUN(test_solid_is_paid_for_where_it_is);
    RUN_FULL(test_solid_memory);
    RUN_FULL(test_solid_stability);
}
