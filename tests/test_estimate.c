/* What gs4_estimate says of a run against what the run then takes; and that features which a scene
 * has no use for cost no byte in it. Run all with run_estimate(). */

typedef enum estimate_kind {
    ESTIMATE_COLUMN, /* of water, which collapses */
    ESTIMATE_POUR,   /* an emitter that has not given anything yet */
    ESTIMATE_HONEY,  /* viscosity limits explicit steps */
    ESTIMATE_BALL,   /* a solid that falls on a floor */
    ESTIMATE_KINDS
} estimate_kind;

typedef struct estimate_mode {
    gs4_scheme scheme;
    gs4_integrator integrator;
} estimate_mode;
static const estimate_mode estimate_modes[] = {
    { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 },      { GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER },
    { GS4_PARTITIONED, GS4_INTEGRATOR_GS4 },   { GS4_PARTITIONED, GS4_INTEGRATOR_BACKWARD_EULER },
    { GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4 }, { GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_BACKWARD_EULER }
};
enum {
    ESTIMATE_MODES = 6
};

static double estimate_clock(void *user)
{
    (void)user;
    return (double)clock() / CLOCKS_PER_SEC;
}

static gs4_sim_desc estimate_desc(int n, gs4_wall wall)
{
    gs4_sim_desc d = scene_cube(n);
    int w;
    for (w = 0; w < 6; w++) d.walls[w] = wall;
    d.gravity = at(0, 0, -10);
    d.now = estimate_clock;
    return d;
}

/* A unit cube of n^3 cells with one thing in it, to be run with this mode or another. */
static gs4_sim *estimate_scene(estimate_kind kind, int n, const estimate_mode *m,
                               const gs4_allocator *allocator)
{
    gs4_sim_desc d = estimate_desc(n, kind == ESTIMATE_COLUMN ? GS4_WALL_SLIP : GS4_WALL_SEPARATE);
    gs4_material liquid = scene_liquid(1000,
                                       kind == ESTIMATE_HONEY  ? 4000
                                       : kind == ESTIMATE_POUR ? 5
                                                               : 0.001,
                                       0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_emitter e;
    gs4_sim *sim = NULL;
    d.scheme = m->scheme;
    d.integrator = m->integrator;
    if (allocator) d.allocator = *allocator;
    if (gs4_create(&d, &sim) < 0) return NULL;
    if (kind == ESTIMATE_BALL) {
        liquid.solid = GS4_NEO_HOOKEAN;
        liquid.shear_modulus = (gs4_real)2e4;
    }
    gs4_add_material(sim, &liquid);
    if (kind == ESTIMATE_POUR) {
        memset(&e, 0, sizeof e);
        e.shape = gs4_cylinder(at(0.5, 0.5, 0.6), at(0.5, 0.5, 0.75), (gs4_real)0.15);
        e.fill.velocity = at(0, 0, -1);
        gs4_add_emitter(sim, &e);
    } else
        gs4_add_particles(sim,
                          kind == ESTIMATE_COLUMN ? gs4_box(at(0, 0, 0), at(0.5, 1, 0.5))
                                                  : gs4_sphere(at(0.5, 0.5, 0.35), (gs4_real)0.3),
                          &f);
    return sim;
}

/* Steps within a factor of 1.5, bytes too; the scene stays as it is. */
static void estimate_check(estimate_kind kind, int n, const estimate_mode *m, double duration)
{
    gs4_sim *sim = estimate_scene(kind, n, m, NULL);
    const uint64_t hash = gs4_state_hash(sim);
    gs4_stats before = gs4_get_stats(sim), after;
    gs4_cost c;
    CHECK_RESULT(sim, gs4_estimate(sim, m->scheme, m->integrator, duration, &c), GS4_OK);
    after = gs4_get_stats(sim);
    CHECK(gs4_state_hash(sim) == hash && memcmp(&before, &after, sizeof before) == 0);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)duration), GS4_OK);
    after = gs4_get_stats(sim);
    CHECK_BETWEEN((double)c.steps / (double)after.steps, 1 / 1.5, 1.5);
    CHECK_BETWEEN((double)c.bytes / (double)after.memory_bytes, 1 / 1.5, 1.5);
    CHECK_BETWEEN((double)c.particles / after.particles, 0.95, 1.05);
    CHECK_CLOSE(c.dt * (double)c.steps, duration, 1e-9 * duration);
    CHECK(c.seconds > 0 && c.seconds < 1e4);
    if (kind == ESTIMATE_HONEY && m->scheme != GS4_SEMI_IMPLICIT)
        CHECK(strcmp(c.limit, "viscosity") == 0);
    if (kind == ESTIMATE_COLUMN && m->scheme == GS4_EXPLICIT) CHECK(strcmp(c.limit, "sound") == 0);
    if (kind == ESTIMATE_BALL && m->scheme == GS4_PARTITIONED)
        CHECK(strcmp(c.limit, "elasticity") == 0);
    gs4_destroy(sim);
}

/* Where cells are merged: 8192 particles and more; of emitters what they will have given. */
static void test_estimate_larger_cells(void)
{
    estimate_check(ESTIMATE_COLUMN, 16, &estimate_modes[0], 0.01);
    estimate_check(ESTIMATE_POUR, 24, &estimate_modes[1], 0.02);
}

static void test_estimate_schemes(void)
{
    int kind, m;
    if (!TEST_FULL_ONCE) {
        estimate_check(ESTIMATE_HONEY, 8, &estimate_modes[1], 0.003);
        estimate_check(ESTIMATE_POUR, 8, &estimate_modes[2], 0.05);
        estimate_check(ESTIMATE_BALL, 8, &estimate_modes[2], 0.05);
        estimate_check(ESTIMATE_HONEY, 8, &estimate_modes[5], 0.1);
        return;
    }
    for (kind = 0; kind < ESTIMATE_KINDS; kind++)
        for (m = 0; m < ESTIMATE_MODES; m++)
            estimate_check((estimate_kind)kind, test_slow ? 32 : 22, &estimate_modes[m],
                           kind == ESTIMATE_HONEY ? 0.03 : 0.3);
}

/* In the midst of a run, with a collider, of another scheme than its own; what is incompressible
 * has a speed of sound there. */
static void test_estimate_midway(void)
{
    const estimate_mode m = { GS4_PARTITIONED, GS4_INTEGRATOR_GS4 };
    gs4_sim_desc d = estimate_desc(8, GS4_WALL_SLIP);
    gs4_material water = scene_liquid(1000, 0.1, 0);
    gs4_collider pillar;
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_cost own, other;
    gs4_sim *sim = NULL;
    uint64_t hash, steps;
    d.scheme = m.scheme;
    water.incompressible = 1;
    memset(&pillar, 0, sizeof pillar);
    pillar.shape = gs4_box(at(0.7, 0.3, -1), at(0.9, 0.6, 2));
    pillar.contact = GS4_WALL_SLIP;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    gs4_add_material(sim, &water);
    gs4_add_collider(sim, &pillar);
    gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(0.5, 1, 0.5)), &f);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.1), GS4_OK);
    hash = gs4_state_hash(sim);
    CHECK_RESULT(sim, gs4_estimate(sim, m.scheme, m.integrator, 0.1, &own), GS4_OK);
    CHECK_RESULT(sim, gs4_estimate(sim, GS4_EXPLICIT, m.integrator, 0.01, &other), GS4_OK);
    CHECK(gs4_state_hash(sim) == hash);
    CHECK(strcmp(other.limit, "sound") == 0);
    /* sound at 10 sqrt(2 g) m/s, 1.73 c dt/h = sqrt 2, of which half: see STABILITY */
    CHECK_BETWEEN(other.dt, 0.9 * 0.5 * sqrt(2) / 1.73 / 8 / (10 * sqrt(20)),
                  1.1 * 0.5 * sqrt(2) / 1.73 / 8 / (10 * sqrt(20)));
    steps = gs4_get_stats(sim).steps;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.1), GS4_OK);
    CHECK_BETWEEN((double)own.steps / (double)(gs4_get_stats(sim).steps - steps), 1 / 1.5, 1.5);
    gs4_destroy(sim);
}

static int estimate_asks;
static gs4_sim *estimate_of;

static double estimate_asking(void *user)
{
    gs4_cost c;
    (void)user;
    if (estimate_of
        && gs4_estimate(estimate_of, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1, &c) == GS4_ERROR_ARGUMENT)
        estimate_asks++;
    return 0;
}

static void estimate_refused(gs4_sim *sim, estimate_mode m, double duration, const char *says)
{
    gs4_cost c;
    CHECK(gs4_estimate(sim, m.scheme, m.integrator, duration, &c) == GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(sim), says) != NULL);
    CHECK(c.steps == 0 && c.limit == NULL);
}

static void test_estimate_errors(void)
{
    const estimate_mode gs4 = estimate_modes[0],
                        mixed = { GS4_EXPLICIT, GS4_INTEGRATOR_BACKWARD_EULER },
                        symplectic = { GS4_PARTITIONED, GS4_INTEGRATOR_SYMPLECTIC_EULER },
                        none = { (gs4_scheme)7, GS4_INTEGRATOR_GS4 };
    gs4_sim_desc d = estimate_desc(8, GS4_WALL_SLIP);
    gs4_sim *sim = estimate_scene(ESTIMATE_BALL, 8, &gs4, NULL);
    gs4_collider rough;
    gs4_cost c;
    gs4_edit x;
    CHECK(gs4_estimate(NULL, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1, &c) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_estimate(sim, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1, NULL) == GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(sim), "cost") != NULL);
    estimate_refused(sim, gs4, 0, "duration");
    estimate_refused(sim, gs4, -1, "duration");
    estimate_refused(sim, gs4, (double)NAN, "duration");
    estimate_refused(sim, gs4, (double)INFINITY, "duration");
    estimate_refused(sim, mixed, 1, "backward Euler");
    estimate_refused(sim, symplectic, 1, "symplectic Euler");
    estimate_refused(sim, none, 1, "scheme is 7");
    memset(&rough, 0, sizeof rough);
    rough.shape = gs4_sphere(at(0.5, 0.5, 0), (gs4_real)0.1);
    rough.contact = GS4_WALL_SEPARATE;
    rough.friction = 1;
    gs4_add_collider(sim, &rough);
    estimate_refused(sim, estimate_modes[2], 1, "friction");
    x = gs4_edit_particles(sim, GS4_FIELD_POSITION);
    x.data[0] = 100;
    estimate_refused(sim, gs4, 1, "edit");
    gs4_destroy(sim);
    d.now = estimate_asking;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    err_add_block(sim); /* refused without a material: an empty scene is one, too */
    estimate_of = sim;
    CHECK_RESULT(sim, gs4_estimate(sim, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1, &c), GS4_OK);
    CHECK(estimate_asks > 0 && c.seconds == 0 && c.particles == 0);
    CHECK(strcmp(c.limit, gs4_limit_name(sim)) == 0);
    estimate_of = NULL;
    CHECK_RESULT(sim, gs4_advance(sim, 1), GS4_OK);
    CHECK(c.steps == gs4_get_stats(sim).steps);
    gs4_destroy(sim);
}

/* The k-th allocation is refused: nothing is lost, and the scene is as it was. */
static void test_estimate_memory(void)
{
    files_memory m;
    gs4_allocator a;
    gs4_sim *sim;
    gs4_cost c;
    uint64_t hash;
    size_t bytes;
    long k, calls, first, live;
    memset(&m, 0, sizeof m);
    m.fail_at = -1;
    a.alloc_fn = files_alloc;
    a.free_fn = files_free;
    a.user = &m;
    sim = estimate_scene(ESTIMATE_COLUMN, 16, &estimate_modes[0], &a);
    hash = gs4_state_hash(sim);
    bytes = m.bytes;
    live = m.live;
    first = m.calls;
    CHECK_RESULT(sim, gs4_estimate(sim, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1e-4, &c), GS4_OK);
    CHECK(m.bytes == bytes && m.live == live);
    calls = m.calls - first;
    for (k = 0; k < calls; k += test_slow ? 1 : test_full ? 3 : 1 + calls / 6) {
        m.fail_at = m.calls + k;
        CHECK(gs4_estimate(sim, GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 1e-4, &c) == GS4_ERROR_MEMORY);
        CHECK(strstr(gs4_last_error(sim), "memory") != NULL);
        CHECK(m.bytes == bytes && m.live == live && m.wrong == 0);
        CHECK(gs4_state_hash(sim) == hash && c.steps == 0);
        m.fail_at = -1;
    }
    gs4_destroy(sim);
    CHECK(m.live == 0 && m.bytes == 0);
}

/* --- what is not used costs nothing ----------------------------------------------------------- */

typedef struct estimate_feature {
    const char *name;
    estimate_mode mode;
    /* bytes that a particle of it has more than one of a Newtonian liquid with GS4, as MEMORY says:
     * in reals of gs4_real, and in bytes */
    int reals, bytes;
} estimate_feature;
static const estimate_feature estimate_features[] = {
    { "plain", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 0, 0 },
    { "bulk modulus", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 0, 0 },
    { "stress", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 12, 0 },
    { "solid", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 24, 0 },
    { "heat", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 4, 1 },
    { "latent heat", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 4, 1 },
    { "flux", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 12, 1 },
    { "sharp", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 0, 0 },
    { "flip", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, -4, 0 },
    { "affine", { GS4_EXPLICIT, GS4_INTEGRATOR_GS4 }, 18, 0 },
    { "projection", { GS4_PARTITIONED, GS4_INTEGRATOR_GS4 }, 20, 0 },
    { "projection, K", { GS4_PARTITIONED, GS4_INTEGRATOR_GS4 }, 20, 0 },
    { "one solve", { GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4 }, 20, 0 }
};
enum {
    ESTIMATE_FEATURES = (int)(sizeof estimate_features / sizeof *estimate_features)
};

static gs4_sim *estimate_with(const estimate_feature *e)
{
    gs4_sim_desc d = estimate_desc(8, GS4_WALL_SLIP);
    gs4_material m = scene_liquid(1000, 1, 0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim = NULL;
    const char *is = e->name;
    d.scheme = e->mode.scheme;
    d.integrator = e->mode.integrator;
    d.sharp_gradients = strcmp(is, "sharp") == 0;
    d.affine = strcmp(is, "affine") == 0;
    if (strcmp(is, "flip") == 0) d.flip_decay_time = (gs4_real)INFINITY;
    if (strcmp(is, "bulk modulus") == 0) m.bulk_modulus = (gs4_real)1e6;
    if (strcmp(is, "stress") == 0) {
        m.liquid = GS4_OLDROYD_B;
        m.local_fraction = (gs4_real)0.5;
        m.relaxation_time = 1;
    }
    if (strcmp(is, "solid") == 0) {
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = 1000;
    }
    if (strcmp(is, "heat") == 0 || strcmp(is, "latent heat") == 0 || strcmp(is, "flux") == 0) {
        m.heat_capacity = 1000;
        m.conductivity = 1;
    }
    if (strcmp(is, "latent heat") == 0) {
        m.can_melt = 1;
        m.melting_temperature = -10;
        m.latent_heat = 1000;
    }
    if (strcmp(is, "flux") == 0) m.flux_relaxation_time = 1;
    if (d.scheme != GS4_EXPLICIT && strcmp(is, "projection, K") != 0) m.incompressible = 1;
    if (gs4_create(&d, &sim) < 0) return NULL;
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(0.5, 0.5, 0.5)), &f);
    return sim;
}

/* Bytes of all that is there but particles and what the scheme keeps of nodes. */
static uint64_t estimate_bytes_of_nodes(const gs4_sim *sim, double *particle)
{
    double node;
    CHECK(gs4i_bytes_of(sim, particle, &node) == GS4_OK);
    return sim->memory.bytes - (uint64_t)(*particle * (sim->particles.capacity + 1));
}

static void test_estimate_unused(void)
{
    const double real = sizeof(gs4_real), plain = 20 * real + (real == 4 ? 1 : -7);
    uint64_t nodes = 0;
    int i;
    for (i = 0; i < ESTIMATE_FEATURES; i++) {
        const estimate_feature *e = &estimate_features[i];
        gs4_sim *sim = estimate_with(e);
        const char *is = e->name;
        double particle;
        uint64_t bytes;
        const int has_heat = strcmp(is, "heat") == 0 || strstr(is, "latent") || strstr(is, "flux"),
                  is_explicit = e->mode.scheme == GS4_EXPLICIT;
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.1 * gs4_stable_dt(sim)), GS4_OK);
        bytes = estimate_bytes_of_nodes(sim, &particle);
        CHECK_CLOSE(particle, plain + e->reals * real + e->bytes, 1e-9);
        if (i == 0) nodes = bytes;
        CHECK((sim->particles.elastic != NULL) == (strcmp(is, "stress") == 0));
        CHECK((sim->particles.deformation != NULL) == (strcmp(is, "solid") == 0));
        CHECK((sim->particles.heat != NULL) == has_heat);
        CHECK((sim->particles.flux != NULL) == (strcmp(is, "flux") == 0));
        CHECK((sim->conduction.heat_nodes != NULL) == has_heat);
        CHECK((sim->conduction.box.fields != NULL) == has_heat);
        CHECK((sim->grid.deconvolved != NULL) == (strcmp(is, "sharp") == 0));
        CHECK((sim->staggered.box.fields != NULL) == !is_explicit);
        CHECK(sim->boundary.collider_count == 0);
        /* what particles alone carry costs no cell a byte */
        if (is_explicit && !has_heat && strcmp(is, "sharp") != 0) CHECK(bytes == nodes);
        gs4_destroy(sim);
    }
}

static void run_estimate(void)
{
    RUN_ONCE(test_estimate_larger_cells);
    RUN_ONCE(test_estimate_schemes);
    RUN(test_estimate_midway);
    RUN(test_estimate_errors);
    RUN_ONCE(test_estimate_memory);
    RUN(test_estimate_unused);
}
