/* The kernels of the library against tests/reference_step.h, particle by particle: the same
 * particles, the same steps, in small scenes that between them have every wall on every side,
 * members of the family, materials, short and long decay, uneven steps, spray, and particles
 * that change blocks. */
#ifdef GS4_TESTS_QUICK /* this would take two thirds of the test */
#pragma GCC push_options
#pragma GCC optimize("O1")
#endif
#include "reference_step.h"
#ifdef GS4_TESTS_QUICK
#pragma GCC pop_options
#endif

typedef struct reference_scene {
    const char *name;
    int cells[3];
    gs4_wall walls[6];
    double rho_inf, spurious, decay_time; /* s; 0: the default */
    double low[3], high[3];               /* filled, in cells */
    /* part of the height that is solid, from below; Oldroyd-B beyond the middle of x */
    double solid;
    int oldroyd, euler;
    double velocity[3], spin, missing; /* m/s; rad/s; part of the particles that is left out */
    int steps, edit; /* before step `edit` positions are edited by hand; 0: never */
    double packing;  /* mass of particles over what fills their space at rest */
} reference_scene;

#define STICK GS4_WALL_STICK
#define SLIP GS4_WALL_SLIP
#define APART GS4_WALL_SEPARATE
#define ROUND GS4_WALL_PERIODIC
#define ALL(kind)                          \
    {                                      \
        kind, kind, kind, kind, kind, kind \
    }
/* clang-format off */
static const reference_scene reference_scenes[] = {
    { "drop", { 12, 13, 11 }, ALL(SLIP), 0, 0, 0,
      { 3.3, 4, 3 }, { 7, 8, 7 }, 0, 0, 0, { 3, 2, -1.5 }, 9, 0, 24, 0, 1 },
    { "drop that keeps its sub-grid velocity", { 12, 9, 9 }, ALL(SLIP), 1, 0, INFINITY,
      { 3, 3, 2 }, { 6, 6, 6 }, 0, 0, 0, { 3, 0, 0 }, 9, 0, 20, 0, 1 },
    { "stick", { 6, 5, 4 }, ALL(STICK), 0.5, 0, 0,
      { 0, 0, 0 }, { 6, 5, 4 }, 0, 0, 0, { 1, 1, 1 }, 5, 0.2, 12, 0, 1 },
    { "slip", { 5, 4, 7 }, ALL(SLIP), 0.5, 0.5, 0,
      { 0, 0, 0 }, { 5, 4, 7 }, 0, 0, 0, { 1, -1, 2 }, 5, 0.2, 12, 0, 1 },
    { "separate", { 5, 6, 5 }, ALL(APART), 0, 0, 0.02,
      { 0, 0, 0 }, { 5, 5, 5 }, 0, 0, 0, { -1, -1, 1 }, 5, 0.2, 12, 0, 1 },
    { "three kinds of walls", { 6, 5, 4 }, { STICK, SLIP, APART, STICK, SLIP, APART }, 0.8, 0.2, 0,
      { 0, 0, 0 }, { 6, 5, 4 }, 0, 0, 0, { 1, -2, 1 }, 5, 0.3, 12, 0, 1 },
    { "three kinds, turned", { 5, 4, 6 }, { SLIP, APART, STICK, SLIP, APART, STICK }, 0, 0, 0.001,
      { 0, 0, 0 }, { 5, 4, 6 }, 0, 0, 0, { -1, 2, 1 }, 5, 0.3, 12, 0, 1 },
    { "three kinds, turned again", { 4, 5, 6 }, { APART, STICK, SLIP, APART, STICK, SLIP }, 1, 0, 0.05,
      { 0, 0, 0 }, { 4, 5, 6 }, 0, 1, 0, { 1, 1, -2 }, 5, 0.3, 12, 0, 1 },
    { "periodic", { 6, 5, 9 }, { ROUND, ROUND, STICK, SLIP, ROUND, ROUND }, 0.5, 0, 0,
      { 0, 0, 0 }, { 6, 4, 9 }, 0, 1, 0, { 3, 0, -3 }, 5, 0.4, 12, 0, 1 },
    { "cube", { 9, 10, 9 }, ALL(SLIP), 0, 0, 0,
      { 2.5, 3, 3 }, { 5.5, 6, 6 }, 1, 0, 0, { 2, 1, -1 }, 30, 0, 24, 0, 1 },
    { "cube whose decay is short", { 9, 9, 9 }, ALL(SLIP), 0.5, 0.5, 0.0005,
      { 3, 3, 3 }, { 6, 6, 6 }, 1, 0, 0, { 2, 1, -1 }, 40, 0, 12, 0, 1 },
    { "mix", { 8, 9, 7 }, { STICK, SLIP, APART, APART, SLIP, STICK }, 0, 0, 0.03,
      { 0, 0, 1 }, { 8, 7, 5 }, 0.5, 1, 0, { 1, -2, 1 }, 12, 0.3, 12, 0, 1 },
    { "mix, near Crank-Nicolson", { 8, 9, 7 }, { SLIP, STICK, STICK, SLIP, STICK, SLIP }, 0.9, 0.7, 0,
      { 0, 0, 1 }, { 8, 7, 5 }, 0.5, 1, 0, { 1, -2, 1 }, 12, 0.3, 12, 0, 1 },
    { "spray", { 12, 12, 9 }, ALL(STICK), 0.5, 0, 0.1,
      { 0, 0, 0 }, { 12, 12, 9 }, 0, 0, 0, { 1, -2, 1 }, 3, 0.97, 14, 0, 1 },
    { "edited", { 8, 8, 8 }, ALL(SLIP), 0, 0, 0,
      { 2, 1, 2 }, { 6, 5, 6 }, 0.5, 1, 0, { 1, -1, 0.5 }, 9, 0, 12, 5, 1 },
    { "Euler", { 6, 5, 7 }, { STICK, SLIP, APART, STICK, SLIP, APART }, 0, 0, 0,
      { 0, 0, 0 }, { 6, 5, 6 }, 0.5, 1, 1, { 1, -2, 1 }, 9, 0.3, 14, 0, 1 },
    { "Euler, turning", { 12, 9, 9 }, ALL(SLIP), 0, 0, 0,
      { 3, 3, 2 }, { 6, 6, 6 }, 0.5, 1, 1, { 3, 1, 1 }, 40, 0, 14, 0, 1 },
    { "packed", { 6, 5, 4 }, { STICK, SLIP, APART, STICK, SLIP, APART }, 0.5, 0, 0,
      { 0, 0, 0 }, { 6, 5, 4 }, 0, 0, 0, { 1, -2, 1 }, 5, 0, 12, 0, 1.1 },
    { "packed around a period", { 6, 5, 4 }, { ROUND, ROUND, SLIP, SLIP, ROUND, ROUND }, 0, 0, 0.05,
      { 0, 0, 0 }, { 6, 5, 4 }, 0, 0, 0, { 3, 0, -3 }, 5, 0, 12, 0, 1.3 },
    { "packed, Euler", { 6, 5, 4 }, { SLIP, APART, STICK, SLIP, APART, STICK }, 0, 0, 0,
      { 0, 0, 0 }, { 6, 5, 4 }, 0, 0, 1, { 1, -2, 1 }, 5, 0, 12, 0, 1.1 },
    { "packed in the midst, Euler", { 12, 9, 9 }, ALL(SLIP), 0, 0, 0,
      { 3, 2, 2 }, { 9, 7, 7 }, 0, 0, 1, { 1, -2, 1 }, 5, 0, 12, 0, 1.3 }
};
/* clang-format on */
#undef STICK
#undef SLIP
#undef APART
#undef ROUND
#undef ALL

static double reference_epsilon(void)
{
    return sizeof(gs4_real) == 8 ? DBL_EPSILON : (double)FLT_EPSILON;
}

static uint32_t reference_seed;

/* Uniform in [-1, 1). */
static double reference_random(void)
{
    reference_seed = reference_seed * 1664525u + 1013904223u;
    return (reference_seed >> 8) / 8388608.0 - 1;
}

static gs4_sim *reference_make(const reference_scene *c, gs4_material m[3])
{
    gs4_sim_desc d;
    gs4_sim *sim = NULL;
    int i;
    memset(&d, 0, sizeof d);
    memcpy(d.cells, c->cells, sizeof d.cells);
    memcpy(d.walls, c->walls, sizeof d.walls);
    d.cell_size = (gs4_real)0.1;
    d.origin = at(0.3, -0.2, 0.5);
    d.gravity = at(1.5, -9.81, 2);
    d.rho_inf = (gs4_real)c->rho_inf;
    d.rho_inf_spurious = (gs4_real)c->spurious;
    d.flip_decay_time = (gs4_real)c->decay_time;
    d.affine = scene_affine;
    d.integrator = c->euler ? GS4_INTEGRATOR_SYMPLECTIC_EULER : GS4_INTEGRATOR_GS4;
    m[0] = scene_liquid(1000, 150, 10);
    m[1] = scene_liquid(800, 120, 12);
    m[1].liquid = GS4_OLDROYD_B;
    m[1].local_fraction = (gs4_real)0.3;
    m[1].relaxation_time = (gs4_real)0.05;
    m[2] = scene_liquid(1200, 20, 14);
    m[2].solid = GS4_NEO_HOOKEAN;
    m[2].shear_modulus = (gs4_real)4e4;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), 0);
    for (i = 0; sim && i < 3; i++)
        if (i == 0 || (i == 1 ? c->oldroyd : c->solid > 0))
            CHECK_RESULT(sim, gs4_add_material(sim, &m[i]), 0);
    if (!c->oldroyd) m[1] = m[2]; /* materials as they are numbered */
    return sim;
}

/* One particle, whose velocity and spin are its own; the reference gets the same. */
static int reference_add(const reference_scene *c, gs4_sim *sim, const double cell[3],
                         const gs4_material m[3], ref_sim *r)
{
    const gs4_sim_desc d = gs4_get_desc(sim);
    const double h = (double)d.cell_size, mid = 0.5 * (c->low[0] + c->high[0]);
    const int solid = cell[1] < c->low[1] + c->solid * (c->high[1] - c->low[1]);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_real x[3];
    double from[3], w[3], v[3];
    ref_particle *p = &r->p[r->count];
    int a;
    f.material = solid ? 1 + (c->oldroyd != 0) : c->oldroyd && cell[0] > mid;
    for (a = 0; a < 3; a++) {
        x[a] = (gs4_real)(r->origin[a] + cell[a] * h);
        from[a] = (cell[a] - 0.5 * (c->low[a] + c->high[a])) * h;
        w[a] = c->spin * (0.3 + 0.4 * a - 0.7 * (a == 2) + 0.1 * reference_random());
    }
    for (a = 0; a < 3; a++)
        v[a] = c->velocity[a] + 0.4 * reference_random() + w[(a + 1) % 3] * from[(a + 2) % 3]
               - w[(a + 2) % 3] * from[(a + 1) % 3];
    if (reference_random() > 0.8) /* some spin so fast that the bound of 1/4 is met */
        for (a = 0; a < 3; a++) w[a] *= 8;
    f.velocity = at(v[0], v[1], v[2]);
    f.angular_velocity = at(w[0], w[1], w[2]);
    memset(p, 0, sizeof *p);
    p->is = &m[f.material];
    r->count++;
    p->J = 1;
    for (a = 0; a < 3; a++) {
        p->F[a][a] = 1;
        p->w[a] = solid && !c->euler && !scene_affine ? (double)(gs4_real)w[a] : 0;
        p->C[(a + 2) % 3][(a + 1) % 3] = (double)(gs4_real)w[a];
        p->C[(a + 1) % 3][(a + 2) % 3] = -(double)(gs4_real)w[a];
    }
    return gs4_add_points(sim, x, 1, (gs4_real)(c->packing * h * h * h / 8), &f);
}

/* Half a cell apart and shaken, a part of them missing; then what the library made of them. */
static void reference_fill(const reference_scene *c, gs4_sim *sim, const gs4_material m[3],
                           ref_sim *r)
{
    int n[3], i, a, most = 1, added = 0;
    double *x;
    for (a = 0; a < 3; a++) most *= n[a] = (int)(2 * (c->high[a] - c->low[a]));
    r->p = (ref_particle *)calloc((size_t)most, sizeof *r->p);
    x = (double *)calloc((size_t)most, 3 * sizeof *x);
    if (!r->p || !x) abort();
    for (i = 0; i < most; i++) {
        const int k[3] = { i % n[0], i / n[0] % n[1], i / n[0] / n[1] };
        double cell[3];
        for (a = 0; a < 3; a++)
            cell[a] = c->low[a] + 0.5 * (k[a] + 0.5 + 0.45 * reference_random());
        if (reference_random() * 0.5 + 0.5 >= c->missing)
            added += reference_add(c, sim, cell, m, r);
    }
    CHECK(added == r->count);
    scene_by_id(sim, GS4_FIELD_POSITION, x);
    for (i = 0; i < 3 * r->count; i++) r->p[i / 3].x[i % 3] = x[i];
    scene_by_id(sim, GS4_FIELD_VELOCITY, x);
    for (i = 0; i < 3 * r->count; i++) r->p[i / 3].v[i % 3] = x[i];
    scene_by_id(sim, GS4_FIELD_MASS, x);
    for (i = 0; i < r->count; i++) r->p[i].m = x[i];
    free(x);
}

static void reference_begin(const reference_scene *c, gs4_sim *sim, const gs4_material m[3],
                            ref_sim *r)
{
    const double eps = reference_epsilon();
    int i, a;
    memset(r, 0, sizeof *r);
    r->d = gs4_get_desc(sim);
    r->h = (double)r->d.cell_size;
    r->restart = 1;
    r->solids = c->solid > 0;
    r->least_rho = HUGE_VAL;
    for (i = 0; i < 1 + (c->solid > 0) + (c->oldroyd != 0); i++) {
        r->least_rho = fmin(r->least_rho, (double)m[i].density);
        r->most_c0 = fmax(r->most_c0, (double)m[i].sound_speed);
    }
    for (a = 0; a < 3; a++) {
        r->n[a] = r->d.cells[a] + 4;
        r->origin[a] = (double)(&r->d.origin.x)[a];
        r->g[a] = (double)(&r->d.gravity.x)[a];
    }
    r->node = (ref_node *)calloc((size_t)ref_nodes(r), sizeof *r->node);
    if (!r->node) abort();
    if (!c->solid && !c->oldroyd) r->unpacking = r->most_c0 / (200 * r->h);
    reference_fill(c, sim, m, r);
    r->lightest = HUGE_VAL;
    for (i = 0; i < r->count; i++) r->lightest = fmin(r->lightest, r->p[i].m * eps * eps);
}

/* Largest difference of a field; `from` is where particle 0 of the reference has it. */
static double reference_difference(const gs4_sim *sim, gs4_field field, const ref_sim *r,
                                   const double *from)
{
    const gs4_view view = gs4_particles(sim, field);
    const uint32_t *id = gs4_particle_ids(sim);
    static const int place[6] = { 0, 4, 8, 1, 2, 5 }; /* xx yy zz xy xz yz of nine */
    double most = 0;
    int i, c;
    CHECK(view.count == r->count);
    for (i = 0; i < view.count; i++)
        for (c = 0; c < view.components; c++) {
            const size_t to = field == GS4_FIELD_STRESS ? (size_t)place[c] : (size_t)c;
            const double *own =
                (const double *)(const void *)((const char *)from + id[i] * sizeof(ref_particle));
            const double d = fabs((double)view.data[i * view.stride + c] - own[to]);
            if (!(d <= most)) most = d;
        }
    return most;
}

/* Positions by hand in mid-flight, which does not touch spins as velocities do. */
static void reference_edit(gs4_sim *sim, ref_sim *r)
{
    const gs4_edit e = gs4_edit_particles(sim, GS4_FIELD_POSITION);
    const uint32_t *id = gs4_particle_ids(sim);
    int i, c;
    for (i = 0; i < e.count; i++)
        for (c = 0; c < 3; c++) {
            gs4_real *x = e.data + i * e.stride + c;
            *x += (gs4_real)(0.01 * (c - 1));
            r->p[id[i]].x[c] = (double)*x;
        }
    ref_restart(r);
}

/* The bounds are rounding, n eps in the units of each field after n steps. J is the worst: an
 * error eps of it is one of rho0 c0^2 eps of the pressure, which gives velocities c0 eps in a
 * step (c0 dt/h < 1). Measured: up to 1 n eps in double and 4 in float, where now and then the
 * kept half of a lag rounds the other way. */
static void reference_compare(const reference_scene *c, const gs4_sim *sim, const ref_sim *r)
{
    const double eps = 10 * c->steps * reference_epsilon();
    const ref_particle *p = r->p;
    const double G0 = 0.7 * 120 / 0.05, metre = 1;
    CHECK_CLOSE(reference_difference(sim, GS4_FIELD_POSITION, r, p->x), 0, metre * eps);
    CHECK_CLOSE(reference_difference(sim, GS4_FIELD_VELOCITY, r, p->v), 0, r->most_c0 * eps);
    CHECK_CLOSE(reference_difference(sim, GS4_FIELD_VOLUME_RATIO, r, &p->J), 0, eps);
    CHECK((c->solid > 0) == (gs4_particles(sim, GS4_FIELD_DEFORMATION).data != NULL));
    if (c->solid > 0)
        CHECK_CLOSE(reference_difference(sim, GS4_FIELD_DEFORMATION, r, p->F[0]), 0, eps);
    CHECK(c->oldroyd == (gs4_particles(sim, GS4_FIELD_STRESS).data != NULL));
    if (c->oldroyd)
        CHECK_CLOSE(reference_difference(sim, GS4_FIELD_STRESS, r, p->s[0]), 0, G0 * eps);
}

/* In which block of 4^3 cells is a particle? */
static int reference_block(const ref_sim *r, const ref_particle *p)
{
    int block = 0, a;
    for (a = 0; a < 3; a++) block = 64 * block + (int)((p->x[a] - r->origin[a]) / (4 * r->h));
    return block;
}

static void reference_run(const reference_scene *c)
{
    static const double part[5] = { 1, 0.6, 0.95, 0.3, 0.8 }; /* of the largest step */
    gs4_material m[3];
    gs4_sim *sim = reference_make(c, m);
    ref_sim r;
    double most;
    int i, *block, moved = 0;
    reference_seed = 1;
    if (!sim) return;
    reference_begin(c, sim, m, &r);
    block = (int *)calloc((size_t)r.count, sizeof *block);
    if (!block) abort();
    for (i = 0; i < r.count; i++) block[i] = reference_block(&r, &r.p[i]);
    most = 0.3 * (double)gs4_stable_dt(sim);
    for (i = 0; i < c->steps; i++) {
        const gs4_real dt = (gs4_real)(most * part[i % 5]);
        if (c->edit && i == c->edit) reference_edit(sim, &r);
        CHECK_RESULT(sim, gs4_step(sim, dt), 0);
        if (c->euler)
            ref_euler_step(&r, (double)dt);
        else
            ref_step(&r, (double)dt);
    }
    reference_compare(c, sim, &r);
    for (i = 0; i < r.count; i++) moved += block[i] != reference_block(&r, &r.p[i]);
    CHECK(moved >= 5);
    free(block);
    free(r.p);
    free(r.node);
    gs4_destroy(sim);
}

static void test_reference(void)
{
    const char *name = test_name;
    size_t i;
    for (i = 0; i < sizeof reference_scenes / sizeof reference_scenes[0]; i++) {
        test_name = reference_scenes[i].name;
        reference_run(&reference_scenes[i]);
        scene_affine = !reference_scenes[i].euler;
        if (scene_affine) reference_run(&reference_scenes[i]);
        scene_affine = 0;
    }
    test_name = name;
}
