/* Viscoelastic liquids in motion. What one material point does is in test_stress.c. */

/* A liquid of viscosity mu in all, of which `local` at once and the rest after the time lambda. */
static gs4_material viscoelastic_liquid(double mu, double local, double lambda, double sound)
{
    gs4_material m = scene_liquid(1, mu, sound);
    m.liquid = GS4_OLDROYD_B;
    m.local_fraction = (gs4_real)local;
    m.relaxation_time = (gs4_real)lambda;
    return m;
}

/* Decay over b and frequency over w of what swings with 16 amplitudes a `step` apart, by the least
 * squares of a_n+2 = p a_n+1 + q a_n. */
static void elastic_fit(const double a[16], double step, double b, double w, double *decay,
                        double *frequency)
{
    double s[5] = { 0, 0, 0, 0, 0 }, p, q, det;
    int t;
    for (t = 2; t < 16; t++) {
        s[0] += a[t - 1] * a[t - 1];
        s[1] += a[t - 1] * a[t - 2];
        s[2] += a[t - 2] * a[t - 2];
        s[3] += a[t] * a[t - 1];
        s[4] += a[t] * a[t - 2];
    }
    det = s[0] * s[2] - s[1] * s[1];
    p = (s[3] * s[2] - s[4] * s[1]) / det;
    q = (s[4] * s[0] - s[3] * s[1]) / det;
    *decay = -0.5 * log(-q) / step / b;
    *frequency = acos(p / (2 * sqrt(-q))) / step / w;
}

/* Shear wave u_x = a(t) sin(2 pi y) in a periodic box, exact at any amplitude (shared reference:
 * shear_wave): a' = -mu_s k^2 a - b, lambda b' = mu_p k^2 a - b, so a has the decay d and the
 * frequency w of the roots of (z + mu_s k^2)(lambda z + 1) + mu_p k^2 = 0. Both are fitted to a
 * at equal times, a_{i+1} = p a_i + q a_{i-1}, and given over the exact ones. */
static void elastic_wave(int n, gs4_integrator integrator, double mu_s, double mu_p, double lambda,
                         double *decay, double *frequency)
{
    const double k = 2 * acos(-1.0), b = (1 + mu_s * k * k * lambda) / (2 * lambda),
                 c = (mu_s + mu_p) * k * k / lambda;
    const double w = sqrt(c - b * b), step = 0.35 / w;
    gs4_sim_desc d = scene_cube(n);
    gs4_material m = viscoelastic_liquid(mu_s + mu_p, mu_s / (mu_s + mu_p), lambda, 5);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double a[16];
    gs4_edit v;
    gs4_view x, u;
    gs4_sim *sim;
    int i, t;
    d.cells[0] = d.cells[2] = 4;
    d.integrator = integrator;
    /* else what the grid cannot see, 0.5 % here, fades at that rate */
    if (integrator == GS4_INTEGRATOR_GS4) d.flip_decay_time = (gs4_real)INFINITY;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_PERIODIC;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(4.0 / n, 1, 4.0 / n)), &f) > 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++)
        v.data[(size_t)i * (size_t)v.stride] =
            (gs4_real)(0.1 * sin(k * (double)x.data[(size_t)i * (size_t)x.stride + 1]));
    for (t = 0; t < 16; t++) {
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        u = gs4_particles(sim, GS4_FIELD_VELOCITY);
        for (a[t] = 0, i = 0; i < u.count; i++)
            a[t] += (double)u.data[(size_t)i * (size_t)u.stride]
                    * sin(k * (double)x.data[(size_t)i * (size_t)x.stride + 1]) / (0.05 * u.count);
        CHECK(physics_run(sim, (t + 1) * step) == 0);
    }
    gs4_destroy(sim);
    elastic_fit(a, step, b, w, decay, frequency);
}

/* The four interpolations of a step see (1 - (k h)^2/8) of a wave each: its frequency is 1.0 to
 * 1.1 % low at 32 cells a wave, 0.27 % at 64. */
static void test_elastic_wave(void)
{
    /* mu_s k^2, mu_p k^2, lambda */
    static const double cases[4][3] = {
        { 0, 4, 1 }, { 0.4, 3.6, 1 }, { 0.04, 3.96, 1 }, { 0, 100, 100 }
    };
    const double k2 = 4 * acos(-1.0) * acos(-1.0);
    const int n = test_full ? 32 : 16;
    int i, c;
    scene_sharp = 1; /* 0.05 % low at 32, 0.4 % at 16 */
    for (c = 0; c < (test_slow ? 4 : 1); c++) {
        double decay, frequency;
        elastic_wave(n, GS4_INTEGRATOR_GS4, cases[c][0] / k2, cases[c][1] / k2, cases[c][2], &decay,
                     &frequency);
        if (test_filter[0])
            printf("elastic wave %d, sharpened: decay %.4f, frequency %.4f of the exact ones\n", c,
                   decay, frequency);
        CHECK_CLOSE(frequency, 1, n == 32 ? 0.0006 : 0.005);
        CHECK_CLOSE(decay, 1, n == 32 ? 0.0006 : 0.005);
        if (c == 0 && n == 32) {
            double coarse;
            elastic_wave(16, GS4_INTEGRATOR_GS4, 0, 4 / k2, 1, &decay, &coarse);
            CHECK_CLOSE(log2((1 - coarse) / (1 - frequency)), 2.5, 0.1);
        }
    }
    scene_sharp = 0;
    for (i = 0; i < (test_full ? 2 : 1);
         i++) /* in the last one nearly nothing decays: the wave speed sqrt(G0/rho) */
        for (c = 0; c < (!test_slow ? 1 : i == 0 ? 4 : 2); c++) {
            double decay, frequency;
            elastic_wave(32, physics_integrators[i], cases[c][0] / k2, cases[c][1] / k2,
                         cases[c][2], &decay, &frequency);
            if (test_filter[0])
                printf("elastic wave %d, integrator %d: decay %.4f, frequency %.4f of the exact "
                       "ones\n",
                       c, (int)physics_integrators[i], decay, frequency);
            CHECK_BETWEEN(frequency, i == 0 ? 0.989 : 0.979, i == 0 ? 0.9905 : 0.984);
            CHECK_CLOSE(decay, 1, i == 0 ? 0.006 : 0.017);
            if (c == 0) {
                double coarse, d;
                elastic_wave(16, physics_integrators[i], 0, 4 / k2, 1, &d, &coarse);
                if (test_filter[0])
                    printf("    order in space of the frequency %.2f\n",
                           log2((1 - coarse) / (1 - frequency)));
                CHECK_CLOSE(log2((1 - coarse) / (1 - frequency)), 2, 0.03);
            }
        }
}

/* Start-up of plane channel flow (Waters & King): the first maximum of the velocity in the
 * middle, over the steady one, and its time t mu/(rho (H/2)^2), where El = lambda mu/(rho
 * (H/2)^2). */
static void channel_overshoot(int n, gs4_integrator integrator, double elasticity, double local,
                              double *most, double *when)
{
    const double mu = 0.5, steady = 4 * 0.25 / (2 * mu);
    gs4_sim_desc d = scene_cube(n);
    gs4_material m = viscoelastic_liquid(mu, local, elasticity * 0.25 / mu, 8);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    double now = 0, last = 0;
    d.cells[0] = d.cells[2] = 4;
    d.integrator = integrator;
    d.gravity = at(4, 0, 0);
    d.walls[0] = d.walls[1] = d.walls[4] = d.walls[5] = GS4_WALL_PERIODIC;
    d.walls[2] = d.walls[3] = GS4_WALL_STICK;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f) > 0);
    for (*most = 0; now >= last;) {
        double s[5] = { 0, 0, 0, 0, 0 };
        gs4_view x, v;
        int i;
        last = now;
        *most = now / steady;
        *when = gs4_get_stats(sim).time * mu / 0.25;
        if (*when > 10) break;
        CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim) / 2), GS4_OK);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        v = gs4_particles(sim, GS4_FIELD_VELOCITY);
        /* u = u0 + c (y - 1/2)^2 about the middle */
        for (i = 0; i < x.count; i++) {
            const double y = (double)x.data[(size_t)i * (size_t)x.stride + 1] - 0.5,
                         u = (double)v.data[(size_t)i * (size_t)v.stride];
            /* farther from it fronts come earlier */
            if (fabs(y) > 0.07) continue;
            s[0] += 1;
            s[1] += y * y;
            s[2] += y * y * y * y;
            s[3] += u;
            s[4] += u * y * y;
        }
        now = (s[3] * s[2] - s[4] * s[1]) / (s[0] * s[2] - s[1] * s[1]);
    }
    gs4_destroy(sim);
}

/* Where nearly all is elastic (local fraction 0.01 and below) the maximum is the corner of a
 * front and comes up to 6 % late (1.8 % where gradients are sharpened); its height holds. */
static void test_channel_overshoot(void)
{
    static const double cases[8][4] = {
        { 1, 0.5, 1.257863, 1.336052 },  { 1, 0.1, 1.719764, 1.214348 },
        { 1, 0.9, 1.024639, 1.881521 },  { 10, 0.9, 1.088830, 2.490418 },
        { 10, 0.5, 1.721785, 2.400964 }, { 100, 0.5, 1.938687, 3.999314 },
        { 1, 0.01, 1.927980, 1.085221 }, { 10, 0.01, 5.553945, 3.237834 }
    };
    int c;
    for (c = 0; c < (test_slow ? 8 : test_full ? 2 : 1); c++) {
        double most, when;
        channel_overshoot(32, GS4_INTEGRATOR_GS4, cases[c][0], cases[c][1], &most, &when);
        if (test_filter[0])
            printf("channel, El %g, local fraction %g: %.4f at %.4f, exact %.4f at %.4f\n",
                   cases[c][0], cases[c][1], most, when, cases[c][2], cases[c][3]);
        CHECK_CLOSE(most / cases[c][2], 1, cases[c][1] > 0.05 ? 0.002 : 0.007);
        CHECK_CLOSE(when / cases[c][3], 1, cases[c][1] > 0.05 ? 0.008 : 0.065);
        if (!test_slow) continue;
        scene_sharp = 1;
        channel_overshoot(32, GS4_INTEGRATOR_GS4, cases[c][0], cases[c][1], &most, &when);
        scene_sharp = 0;
        if (test_filter[0]) printf("    sharpened: %.4f at %.4f\n", most, when);
        CHECK_CLOSE(most / cases[c][2], 1, 0.011);
        CHECK_CLOSE(when / cases[c][3], 1, 0.018);
    }
}

/* A scene whose particles carry stress has the field, one without has not, and pays nothing. */
static void test_stress_is_paid_for_where_it_is(void)
{
    gs4_sim_desc d = scene_cube(8);
    gs4_material newtonian = scene_liquid(1000, 1, 10),
                 elastic = viscoelastic_liquid(1, 0.5, 0.1, 10);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *plain = physics_create(&d, &newtonian), *mixed = physics_create(&d, &newtonian);
    uint64_t before;
    int id, i;
    CHECK(gs4_add_particles(plain, gs4_box(at(0, 0, 0), at(1, 0.5, 1)), &f) > 0);
    CHECK(gs4_add_particles(mixed, gs4_box(at(0, 0, 0), at(1, 0.5, 1)), &f) > 0);
    CHECK(gs4_particles(plain, GS4_FIELD_STRESS).data == NULL);
    before = gs4_get_stats(mixed).memory_bytes;
    elastic.density = 1000;
    CHECK((id = gs4_add_material(mixed, &elastic)) == 1);
    CHECK(gs4_get_stats(mixed).memory_bytes - before
          >= 48 * (uint64_t)gs4_get_stats(mixed).particles);
    CHECK(gs4_particles(mixed, GS4_FIELD_STRESS).components == 6);
    f.material = id;
    CHECK(gs4_add_particles(mixed, gs4_box(at(0, 0.5, 0), at(1, 1, 1)), &f) > 0);
    for (i = 0; i < 5; i++) CHECK_RESULT(mixed, gs4_step(mixed, gs4_stable_dt(mixed) / 2), GS4_OK);
    {
        const gs4_view s = gs4_particles(mixed, GS4_FIELD_STRESS);
        const uint8_t *material = gs4_particle_materials(mixed);
        double newton = 0, other = 0;
        for (i = 0; i < s.count; i++)
            *(material[i] ? &other : &newton) += fabs((double)s.data[(size_t)i * (size_t)s.stride]);
        CHECK(s.count > 0 && newton == 0 && other >= 0);
    }
    gs4_destroy(plain);
    gs4_destroy(mixed);
}

/* gs4_stats counts particles. A first step of more than a relaxation time is beyond the midpoint
 * rule, so each needs substeps, and so does each in the first step after an edit; at rest none does
 * in any other. None is bounded but where anisotropy is above 1 and the flow is fast. */
static void test_stress_counts(void)
{
    gs4_sim_desc d = scene_cube(8);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_material m = viscoelastic_liquid(1, 0.5, 1e-3, 1e-2);
    uint64_t all;
    gs4_sim *sim;
    int i, k;
    m.density = 1;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f) > 0);
    all = (uint64_t)gs4_get_stats(sim).particles;
    for (i = 0; i < 6; i++) {
        if (i == 3) CHECK(gs4_edit_particles(sim, GS4_FIELD_VELOCITY).data != NULL);
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)2e-3), GS4_OK);
        CHECK(gs4_get_stats(sim).stress_substeps == (i < 3 ? all : 2 * all));
    }
    CHECK(gs4_get_stats(sim).stress_bounded == 0);
    gs4_destroy(sim);
    for (k = 0; k < 2; k++) {
        m = scene_liquid(1000, 1, 10);
        m.liquid = GS4_POM_POM;
        m.relaxation_time = 1;
        m.stretch_time = (gs4_real)0.9;
        m.arms = 8;
        m.anisotropy = (gs4_real)(k ? 100 : 1);
        sim = physics_create(&d, &m);
        CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.15), &f) > 0);
        order_stir(sim);
        CHECK(physics_run(sim, 0.1) == 0);
        if (test_filter[0])
            printf("anisotropy %g: %ld bounded, %ld with substeps\n", (double)m.anisotropy,
                   (long)gs4_get_stats(sim).stress_bounded,
                   (long)gs4_get_stats(sim).stress_substeps);
        CHECK((gs4_get_stats(sim).stress_bounded > 0) == (k == 1));
        gs4_destroy(sim);
    }
}

/* What 16 steps take of a shear wave, nu k^2 far below 1/dt so that elasticity allows them. */
static double elastic_brief_loss(gs4_scheme scheme, gs4_integrator how, double ratio,
                                 const gs4_material *kind)
{
    const double k = 2 * acos(-1.0), dt = 1e-3, h = 1.0 / 12;
    gs4_sim_desc d = scene_cube(12);
    gs4_material m = *kind;
    gs4_fill f = scene_fill(at(0, 0, 0));
    double left = 0, first = 0;
    gs4_sim *sim;
    gs4_edit v;
    gs4_view x;
    int i;
    d.scheme = scheme;
    d.integrator = how;
    d.cells[1] = d.cells[2] = 4;
    d.solver_tolerance = (gs4_real)1e-9;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_PERIODIC;
    if (how != GS4_INTEGRATOR_SYMPLECTIC_EULER) d.flip_decay_time = (gs4_real)INFINITY;
    m.viscosity = (gs4_real)(h * h / (30 * dt * ratio));
    if (m.liquid) m.relaxation_time = (gs4_real)(dt / ratio);
    m.stretch_time = m.liquid == GS4_POM_POM ? m.relaxation_time : 0;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f) > 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++) {
        const double mode = sin(k * (double)x.data[i * x.stride]);
        v.data[i * v.stride + 1] = (gs4_real)mode;
        first += mode * mode;
    }
    for (i = 0; i < 16; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)dt), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++)
        left += (double)gs4_particles(sim, GS4_FIELD_VELOCITY).data[i * x.stride + 1]
                * sin(k * (double)x.data[i * x.stride]);
    gs4_destroy(sim);
    return 1 - left / first;
}

/* Steps of 1e4 and 1e8 relaxation times, which nothing forbids: the loss of Newton's liquid. */
static void test_elastic_brief(void)
{
    static const gs4_integrator how[5] = { GS4_INTEGRATOR_GS4, GS4_INTEGRATOR_SYMPLECTIC_EULER,
                                           GS4_INTEGRATOR_GS4, GS4_INTEGRATOR_BACKWARD_EULER,
                                           GS4_INTEGRATOR_GS4 };
    int n, kind;
    if (sizeof(gs4_real) == 4) return; /* losses from 1e-4 to 1e-9 */
    for (n = 0; n < 10; n++) {
        const gs4_scheme scheme = n / 2 < 2   ? GS4_EXPLICIT
                                  : n / 2 < 4 ? GS4_PARTITIONED
                                              : GS4_SEMI_IMPLICIT;
        const double ratio = n & 1 ? 1e8 : 1e4;
        gs4_material m = scene_liquid(1, 0, 20);
        const double newton = elastic_brief_loss(scheme, how[n / 2], ratio, &m);
        for (kind = 0; kind < 2; kind++) {
            double loss;
            m.liquid = kind ? GS4_POM_POM : GS4_OLDROYD_B;
            m.local_fraction = (gs4_real)(kind ? 0.5 : 0);
            m.arms = (gs4_real)(kind ? 4 : 0);
            m.anisotropy = (gs4_real)(kind ? 0.1 : 0);
            loss = elastic_brief_loss(scheme, how[n / 2], ratio, &m);
            if (test_filter[0])
                printf("scheme %d, integrator %d, dt %g lambda_b: %.6f of Newton's loss, %.1e\n",
                       (int)scheme, (int)how[n / 2], ratio, loss / newton, newton);
            CHECK_CLOSE(loss / newton, 1, 1e-3);
        }
    }
}

static double viscoelastic_random(uint64_t *seed) /* -1 to 1 */
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)*seed / 9223372036854775808.0;
}

/* Work of each particle in one step, on average, of a block that sheared flow strains by up to 1/2,
 * and the result; GS4_ERROR_FORMAT where gs4_advance does not get through either. */
static double viscoelastic_step_work(const gs4_material *m, double rate, int *result)
{
    gs4_sim_desc d = scene_cube(16);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim = physics_create(&d, m);
    gs4i_report r;
    gs4_edit e;
    gs4_real dt;
    int i;
    CHECK(gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.5, 0.5, 0.5)), &f) == 512);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < e.count; i++) {
        const gs4_real *x = gs4_particles(sim, GS4_FIELD_POSITION).data + 3 * i;
        e.data[i * e.stride] = (gs4_real)(rate * ((double)x[1] - 0.375));
        e.data[i * e.stride + 1] = (gs4_real)(0.6 * rate * ((double)x[2] - 0.375));
    }
    dt = (gs4_real)0.8 * gs4_stable_dt(sim);
    *result = gs4_step(sim, dt);
    r = gs4i_all_reports(sim);
    if (*result != GS4_OK) {
        CHECK(*result == GS4_ERROR_UNSTABLE);
        if (strstr(gs4_last_error(sim), "30 times")) {
            CHECK(strstr(gs4_last_error(sim), "anisotropy") != NULL);
            if (gs4_advance(sim, dt) != GS4_OK) {
                *result = GS4_ERROR_FORMAT;
                if (test_filter[0]) printf("%s\n", gs4_last_error(sim));
            }
        } else
            *result = GS4_ERROR_ABI; /* for another reason */
    }
    gs4_destroy(sim);
    return (double)r.work / (double)(r.asked ? r.asked : 1);
}

/* No input makes a step cost more than 30 of others: a counter of work bounds it (GS4I_MEAN_WORK),
 * and steps that would take more are refused, which gs4_advance gets through but for few. */
static void test_stress_step_work(void)
{
    const int draws = test_slow ? 3000 : test_full ? 300 : 24;
    uint64_t seed = 3;
    double worst = 0;
    int i, refused = 0, odd = 0, stuck = 0;
    for (i = 0; i < draws; i++) {
        const double lambda = pow(10, -4.5 + 3.5 * viscoelastic_random(&seed)),
                     rate = 60 + 50 * viscoelastic_random(&seed);
        gs4_material m =
            scene_liquid(1000, lambda * pow(10, 2.5 + 2.5 * viscoelastic_random(&seed)), 10);
        double work;
        int result;
        m.liquid = i % 8 == 7 ? GS4_OLDROYD_B : GS4_POM_POM;
        m.relaxation_time = (gs4_real)lambda;
        if (m.liquid == GS4_POM_POM) {
            m.stretch_time = (gs4_real)(lambda * pow(10, -1 + 3 * viscoelastic_random(&seed)));
            m.arms = (gs4_real)pow(10, 1 + viscoelastic_random(&seed));
            m.anisotropy = (gs4_real)(i % 2 ? pow(10, 1 + viscoelastic_random(&seed))
                                            : fmax(0, fmin(1, 0.5 + viscoelastic_random(&seed))));
        }
        work = viscoelastic_step_work(&m, rate, &result);
        refused += result == GS4_ERROR_UNSTABLE || result == GS4_ERROR_FORMAT;
        stuck += result == GS4_ERROR_FORMAT;
        odd += result == GS4_ERROR_ABI;
        if (result == GS4_OK) {
            CHECK(work <= GS4I_MEAN_WORK + 8 * GS4I_SPARE_WORK / 512.0); /* 8 blocks */
            if (test_filter[0] && work > worst)
                printf("draw %d: work %.1f, lambda_b %.2g, r %.3g, Q %.3g, alpha %.3g\n", i, work,
                       lambda, lambda / (double)m.stretch_time, (double)m.arms,
                       (double)m.anisotropy);
            worst = fmax(worst, work);
        }
    }
    CHECK(worst > 30 && odd < draws / 4 && refused < draws / 3 && stuck <= refused / 30);
    if (test_filter[0])
        printf("%d draws, %d refused for work, %d of them for good, %d else\n", draws, refused,
               stuck, odd);
}

/* Symplectic Euler keeps no rates, so an edit that changes nothing changes nothing afterwards: the
 * next step is no first step. */
static void test_stress_edited_euler(void)
{
    gs4_sim_desc d = scene_cube(8);
    gs4_material m = scene_liquid(1000, 20, 10);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    uint64_t hash[2];
    int k, i;
    d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    m.liquid = GS4_POM_POM;
    m.relaxation_time = (gs4_real)0.5;
    m.stretch_time = (gs4_real)0.25;
    m.arms = 2;
    m.anisotropy = (gs4_real)0.3;
    for (k = 0; k < 2; k++) {
        gs4_sim *sim = physics_create(&d, &m);
        CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.15), &f) > 0);
        order_stir(sim);
        for (i = 0; i < 20; i++) {
            if (k && i > 10) CHECK(gs4_edit_particles(sim, GS4_FIELD_VELOCITY).data != NULL);
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-3), GS4_OK);
        }
        CHECK(gs4_get_stats(sim).stress_substeps == 0);
        hash[k] = gs4_state_hash(sim);
        gs4_destroy(sim);
    }
    CHECK(hash[0] == hash[1]);
}

/* A drop of Oldroyd-B, We 1, local fraction 0.1 (shared reference: drop_oldroyd_b): spreads, and
 * draws back. */
static void test_drop_draws_back(void)
{
    static const double reference[2][2] = { { 2.16, 1.71899 }, { 3.36, 1.46163 } };
    gs4_material m = viscoelastic_liquid(4, 0.1, 0.02, 20);
    m.density = 1000;
    physics_drop_widths(&m, 20, reference, 2, 0.035);
}

/* Start-up of plane Couette flow of Oldroyd-B between a wall and a body that moves, 1 apart,
 * density 1: velocities at mid-height at some times eta0 t / (rho h^2), by the shared reference
 * (couette_startup: Waters & King), whose overshoot is at the first or second of them. */
typedef struct couette_case {
    double elasticity, local, times[4], expected[4];
} couette_case;

static void test_elastic_couette(void)
{
    static const couette_case cases[] = {
        { 0.1, 0.1, { 0.2, 0.5, 1, 2 }, { 0.43272, 0.54087, 0.49976, 0.50001 } },
        { 1, 0.5, { 0.2, 0.5, 1, 2 }, { 0.29019, 0.50858, 0.53619, 0.50355 } },
        { 0.1, 0.5, { 0.2, 0.5, 1, 2 }, { 0.40841, 0.51587, 0.49961, 0.50000 } },
        { 10, 0.1, { 1, 2, 3, 5 }, { 0.38764, 0.63093, 0.63864, 0.50297 } },
        { 10, 0.5, { 0.5, 1, 2, 5 }, { 0.45443, 0.50617, 0.50923, 0.50502 } }
    };
    const int n = 32;
    int c, k, i;
    for (c = 0; c < (test_slow ? (int)(sizeof cases / sizeof cases[0]) : 1); c++) {
        const double h = 1.0 / n, mu = 0.5;
        gs4_sim_desc d = scene_cube(n);
        gs4_material m = viscoelastic_liquid(mu, cases[c].local, cases[c].elasticity / mu, 8);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_collider body;
        gs4_sim *sim;
        memset(&body, 0, sizeof body);
        body.shape = gs4_plane(at(0, 1, 0), at(0, -1, 0));
        body.velocity = at(1, 0, 0);
        body.contact = GS4_WALL_STICK;
        d.cells[0] = d.cells[2] = 4;
        d.cells[1] = n + 3;
        d.cell_size = (gs4_real)h;
        d.walls[0] = d.walls[1] = d.walls[4] = d.walls[5] = GS4_WALL_PERIODIC;
        d.walls[2] = GS4_WALL_STICK;
        sim = physics_create(&d, &m);
        CHECK(gs4_add_collider(sim, &body) == 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(4 * h, 1, 4 * h)), &f) > 0);
        for (k = 0; k < (test_slow ? 4 : test_full ? 3 : 2); k++) {
            double u = 0, slope = 0, weight = 0;
            gs4_view x, v;
            CHECK(physics_run(sim, cases[c].times[k] / mu) == 0);
            x = gs4_particles(sim, GS4_FIELD_POSITION);
            v = gs4_particles(sim, GS4_FIELD_VELOCITY);
            /* a straight line through the particles within a cell and a half */
            for (i = 0; i < x.count; i++) {
                const double y = (double)x.data[(size_t)i * (size_t)x.stride + 1] - 0.5;
                if (fabs(y) > 1.5 * h) continue;
                u += (double)v.data[(size_t)i * (size_t)v.stride];
                weight += 1;
                slope += y;
            }
            u /= weight;
            if (test_filter[0])
                printf("El %g, local %g, t* %g: %.4f, exact %.4f\n", cases[c].elasticity,
                       cases[c].local, cases[c].times[k], u, cases[c].expected[k]);
            CHECK_CLOSE(u, cases[c].expected[k], 0.01 * cases[c].expected[k]);
        }
        gs4_destroy(sim);
    }
}

/* How far p is from a body with a nozzle of radius 1 through it, which ends at y = 9. */
static gs4_real nozzle_distance(gs4_vec3 p, void *user)
{
    const double into = 1 - sqrt((double)p.x * (double)p.x + (double)p.z * (double)p.z),
                 beyond = (double)p.y - 9;
    (void)user;
    return (gs4_real)(into > 0 && beyond > 0 ? sqrt(into * into + beyond * beyond)
                                             : fmax(into, beyond));
}

/* A jet from a nozzle, a quarter of it, density and viscosity 1: its radius over the nozzle's
 * from one radius behind the mouth to two, by its mass, and the mean velocity in the nozzle. */
static double jet_radius(int n, double local, double lambda, double *velocity)
{
    const double h = 1.0 / n;
    gs4_sim_desc d = scene_cube(n);
    gs4_material m =
        lambda > 0 ? viscoelastic_liquid(1, local, lambda, 60) : scene_liquid(1, 1, 60);
    gs4_collider nozzle;
    gs4_emitter pump;
    gs4_sim *sim;
    gs4_view x, v, mass;
    double jet = 0, flow = 0, inside = 0;
    int i;
    memset(&nozzle, 0, sizeof nozzle);
    memset(&pump, 0, sizeof pump);
    d.cells[0] = d.cells[2] = 5 * n / 2;
    d.cells[1] = 14 * n;
    d.cfl = (gs4_real)0.8;
    d.walls[1] = d.walls[3] = d.walls[5] = GS4_WALL_OPEN;
    sim = physics_create(&d, &m);
    nozzle.shape = gs4_sdf(nozzle_distance, NULL, at(0, 0, 0), at(2.5, 9, 2.5));
    nozzle.contact = GS4_WALL_STICK;
    CHECK_RESULT(sim, gs4_add_collider(sim, &nozzle), 0);
    pump.fill.velocity = at(0, 1, 0);
    CHECK(gs4_add_particles(sim, gs4_cylinder(at(0, 4 * h, 0), at(0, 9, 0), 1), &pump.fill) > 0);
    pump.shape = gs4_cylinder(at(0, 0, 0), at(0, 4 * h, 0), 1);
    CHECK_RESULT(sim, gs4_add_emitter(sim, &pump), 0);
    CHECK_RESULT(sim, gs4_advance(sim, 5), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    mass = gs4_particles(sim, GS4_FIELD_MASS);
    for (i = 0; i < x.count; i++) {
        const double y = (double)x.data[(size_t)i * (size_t)x.stride + 1],
                     one = (double)mass.data[(size_t)i * (size_t)mass.stride];
        if (y > 10 && y < 11) jet += one;
        if (y > 6 && y < 8) {
            inside += one;
            flow += one * (double)v.data[(size_t)i * (size_t)v.stride + 1];
        }
    }
    gs4_destroy(sim);
    *velocity = flow / inside;
    return 2 * sqrt(jet / acos(-1.0));
}

/* Die swell (shared reference: die_swell_tanner): 0.13 + (1 + S^2/2)^(1/6), S = (1 - F) lambda 4
 * U, an estimate for creeping flow that is good to some 10 %; here the Reynolds number is 1.6.
 * Seen: 1.07, 1.26, 1.38 for 1.13, 1.18, 1.29; with 12 cells a radius 1.09 and 1.36. */
static void test_die_swell(void)
{
    /* lambda; the last two: of other local fractions */
    static const double cases[3] = { 0, 0.5, 0.55556 };
    double last = 1;
    int c;
    for (c = 0; c < 3; c++) {
        const double local = c == 1 ? 0.5 : 0.1;
        double velocity, swell = jet_radius(8, local, cases[c], &velocity),
                         S = (1 - local) * cases[c] * 4 * velocity;
        const double tanner = 0.13 + pow(1 + S * S / 2, 1.0 / 6);
        if (test_filter[0])
            printf("recoverable shear %.2f: jet over nozzle %.3f, Tanner %.3f\n", S, swell, tanner);
        CHECK_BETWEEN(swell / tanner, 0.95, 1.07);
        CHECK(swell > last + 0.05);
        last = swell;
    }
}
