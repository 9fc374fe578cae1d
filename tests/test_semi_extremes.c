/* The semi-implicit scheme at its extremes: draws over everything it has at once, and what is exact
 * there. */

/* --- draws over everything -------------------------------------------------------------------- */

/* Liquids of one law of stress each, whose viscosity may vary. */
static void semi_extremes_liquid(extremes_draw *k, gs4_material *m, int kind)
{
    m->viscosity = (gs4_real)(extremes_pick(k, 4) ? extremes_power(k, -6, 12) : 0);
    if (kind == 2) {
        m->viscosity = 0;
        m->viscosity_law = GS4_VISCOSITY_HERSCHEL_BULKLEY;
        m->herschel_bulkley.yield_stress = (gs4_real)extremes_power(k, -2, 4);
        m->herschel_bulkley.consistency = (gs4_real)extremes_power(k, -3, 4);
        m->herschel_bulkley.index = (gs4_real)extremes_between(k, 0.3, 1);
        m->herschel_bulkley.creep_rate = (gs4_real)extremes_power(k, -3, 1);
    }
    if (kind < 3) return;
    m->liquid = kind < 5 ? GS4_OLDROYD_B : GS4_POM_POM;
    m->local_fraction = (gs4_real)(kind == 3 ? 0 : extremes_between(k, 0, 1)); /* 3: UCM */
    m->relaxation_time =
        (gs4_real)fmax(1e-14 * (double)m->viscosity, extremes_power(k, -9, 9)); /* G0 to 1e14 */
    if (kind < 5) return;
    m->stretch_time = (gs4_real)((double)m->relaxation_time * extremes_power(k, -2, 0));
    m->anisotropy = (gs4_real)extremes_between(k, 0, 1);
    m->arms = (gs4_real)(1 + extremes_pick(k, 8));
}

static void semi_extremes_solid(extremes_draw *k, gs4_material *m, int kind)
{
    m->solid = kind == 6 ? GS4_NEO_HOOKEAN : GS4_FIXED_COROTATED;
    m->shear_modulus = (gs4_real)extremes_power(k, 0, 12);
    m->viscosity = (gs4_real)(extremes_pick(k, 3) == 0 ? extremes_power(k, -3, 6) : 0);
    if (extremes_pick(k, 2)) m->yield_compression = (gs4_real)extremes_power(k, -3, -0.1);
    if (extremes_pick(k, 2)) m->yield_stretch = (gs4_real)extremes_power(k, -3, 0);
}

/* The bulk modulus bears weight and impact, else the range of J refuses steps: rightly. */
static void semi_extremes_volume(extremes_draw *k, gs4_material *m)
{
    const double v = k->h * k->speed, fall = 24 * k->h * fabs(k->g[0] + k->g[1] + k->g[2]),
                 least = 20 * (double)m->density * (v * v + fall);
    if (extremes_pick(k, 2)) return;
    m->incompressible = 0;
    m->bulk_modulus =
        (gs4_real)fmax(fmax(least, (double)m->shear_modulus), extremes_power(k, 0, 12));
}

static void semi_extremes_heat(extremes_draw *k, gs4_material *m)
{
    m->heat_capacity = (gs4_real)extremes_power(k, 1, 4);
    m->conductivity = (gs4_real)(extremes_pick(k, 3) ? extremes_power(k, -3, 3) : 0);
    m->viscous_heating = extremes_pick(k, 2);
    m->can_melt = extremes_pick(k, 2);
    if (m->can_melt) m->melting_temperature = (gs4_real)extremes_between(k, 0, 20);
    if (m->can_melt && extremes_pick(k, 2)) m->latent_heat = (gs4_real)extremes_power(k, 0, 6);
}

static void semi_extremes_materials(extremes_draw *k, int with_heat, extremes_sum *sum)
{
    const double density = extremes_power(k, -3, 4);
    int n;
    k->materials = 1 + extremes_pick(k, 3);
    for (n = 0; n < k->materials; n++) {
        const int kind = extremes_pick(k, 8), one = n == 0 || extremes_pick(k, 2);
        k->m[n] = partitioned_liquid(0);
        k->m[n].density = (gs4_real)fmin(
            1e4, fmax(1e-3, density * (one ? 1 : extremes_power(k, -1.5, 1.5))));
        if (kind < 6)
            semi_extremes_liquid(k, &k->m[n], kind);
        else
            semi_extremes_solid(k, &k->m[n], kind);
        semi_extremes_volume(k, &k->m[n]);
        if (with_heat) semi_extremes_heat(k, &k->m[n]);
        if (with_heat && n == 0) k->m[n].conductivity = 1;
        CHECK_RESULT(k->sim, gs4_add_material(k->sim, &k->m[n]), GS4_OK);
    }
    (void)sum;
}

/* What is there when a step begins: flows out of a box as fast as anything moves. */
static void semi_extremes_emitter(extremes_draw *k)
{
    const double v = k->h * fmax(k->speed, 1);
    double low[3], high[3];
    gs4_emitter e;
    int a;
    memset(&e, 0, sizeof e);
    for (a = 0; a < 3; a++) {
        low[a] = k->h * extremes_between(k, 1, k->d.cells[a] - 4);
        high[a] = low[a] + k->h * extremes_between(k, 1, 3);
    }
    e.shape = gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]));
    e.fill.material = extremes_pick(k, k->materials);
    e.fill.velocity = at(0, -v, 0);
    gs4_remove_particles(k->sim, e.shape);
    CHECK_RESULT(k->sim, gs4_add_emitter(k->sim, &e), GS4_OK);
    k->emits = 1;
}

/* The scene: speeds up to 50 m/s, cells of 0.1 mm to 100 m. */
static void semi_extremes_make(extremes_draw *k, uint32_t seed, extremes_sum *sum)
{
    int a, with_heat;
    extremes_begin(k, seed, 1);
    k->h = extremes_power(k, -4, 2);
    k->speed = extremes_pick(k, 4) ? extremes_power(k, -4, 1.7) / k->h : 0;
    extremes_describe(k);
    if (!(k->speed > 0) && k->g[0] + k->g[1] + k->g[2] >= 0) k->speed = 0.1 / k->h;
    k->d.scheme = GS4_SEMI_IMPLICIT;
    k->d.solver_tolerance = 0; /* as it is by default */
    with_heat = extremes_pick(k, 5) == 0;
    for (a = 0; a < 3; a++) k->g[a] *= 10;
    k->d.gravity = at(k->g[0], k->g[1], k->g[2]);
    CHECK_RESULT(NULL, gs4_create(&k->d, &k->sim), GS4_OK);
    semi_extremes_materials(k, with_heat, sum);
    k->moves = extremes_pick(k, 3) == 0;
    extremes_fill(k);
    if (extremes_pick(k, 5) == 0) semi_extremes_emitter(k);
    k->swing = extremes_pick(k, 2) ? extremes_between(k, 1, 10) : 1;
    extremes_put_in(k);
}

/* By gs4_step, as long as may be, or swinging, or tiny; or by gs4_advance. */
static int semi_extremes_step(extremes_draw *k, int i, int how, extremes_sum *sum)
{
    double dt = fmin((double)gs4_stable_dt(k->sim), 1e6);
    gs4_budget budget;
    int result;
    if (extremes_pick(k, 20) == 0) dt *= extremes_power(k, -9, 0);
    if (i % 2) dt /= k->swing;
    if (how == 1) dt *= extremes_power(k, -9, 0);
    if (dt < 1e-9) dt = 1e-9;
    if (how < 2 || !(dt > 0)) {
        result = extremes_step(k, fmin(dt, (double)gs4_stable_dt(k->sim)), 8, sum);
        if (!result) sum->draws_by[extremes_reason(k->sim)]++;
        return result;
    }
    memset(&budget, 0, sizeof budget);
    budget.steps = 2;
    dt = gs4_get_stats(k->sim).time;
    result = gs4_advance_within(k->sim, (gs4_real)1e6, &budget, NULL);
    k->time += gs4_get_stats(k->sim).time - dt;
    sum->taken += 2 * (result == GS4_OK);
    if (result == GS4_OK) return 1;
    sum->steps_by[extremes_reason(k->sim)]++;
    sum->draws_by[extremes_reason(k->sim)]++;
    CHECK(result == GS4_ERROR_UNSTABLE || result == GS4_ERROR_NOT_CONVERGED);
    return 0;
}

static void semi_extremes_run(uint32_t seed, int steps, extremes_sum *sum)
{
    extremes_draw k;
    int i, how, c;
    semi_extremes_make(&k, seed, sum);
    how = extremes_pick(&k, 3);
    for (i = 0; i < steps && (k.particles || k.emits); i++) {
        const clock_t before = clock();
        if (!semi_extremes_step(&k, i, how, sum)) break;
#ifdef SEMI_TIMES
        { gs4_stats s = gs4_get_stats(k.sim);
        printf("T %u %d %d %d %g %d %d %g\n", seed, i, s.particles, s.active_cells, (double)(clock() - before)/CLOCKS_PER_SEC, s.viscous_iterations, s.elastic_iterations, s.dt);}
#else
        (void)before;
#endif
        c = extremes_watch(&k);
        if (!c) break;
    }
    how = i == steps || (!gs4_get_stats(k.sim).particles && !k.emits);
    sum->ended += how;
    if (!how && test_filter[0] && test_times) extremes_print(&k, seed, gs4_last_error(k.sim));
    extremes_judge(&k, seed, sum);
    gs4_destroy(k.sim);
}

static void test_semi_extremes_draws(void)
{
    const int draws = test_slow ? 500 : test_full ? 20 : 4;
    extremes_sum sum;
    int n, first = 0, end = draws;
    memset(&sum, 0, sizeof sum);
    if (getenv("FIRST")) first = atoi(getenv("FIRST")), end = atoi(getenv("END"));
    for (n = first; n < end; n++) semi_extremes_run((uint32_t)n, 30, &sum);
    extremes_report(&sum);
}

static void run_semi_extremes(void) { RUN_ONCE(test_semi_extremes_draws); }
