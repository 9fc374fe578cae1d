/* The partitioned scheme against exact solutions of whole flows: sound. */

/* --- sound ------------------------------------------------------------------------------------ */

/* A standing wave in a closed box of the side 1 along axis a, c = 1: u = .001 sin(2 pi x), at first
 * without compression; the amplitude of u is cos(2 pi t). */
static gs4_sim *flows_sound(int n, int a, gs4_integrator how)
{
    gs4_sim_desc d = partitioned_cube(n);
    gs4_material m = scene_liquid(1000, 0, 1);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_edit v;
    gs4_view x;
    gs4_sim *sim;
    int i;
    d.cells[(a + 1) % 3] = d.cells[(a + 2) % 3] = 4;
    d.integrator = how;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 2, 2)), &f) > 0);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++)
        v.data[i * v.stride + a] =
            (gs4_real)(0.001 * sin(2 * acos(-1.0) * (double)x.data[i * x.stride + a]));
    return sim;
}

/* Its frequency over that of theory, in steps of `cfl` h/c, by `most` times at which u is 0. The
 * amplitude after five periods over the first into `left`, where most is that long. */
static double flows_sound_frequency(int n, int a, gs4_integrator how, double cfl, int most,
                                    double *left)
{
    gs4_sim *sim = flows_sound(n, a, how);
    double before = 0, first = 0, last = 0;
    int i, k, crossings = 0;
    *left = 0;
    for (k = 0; crossings < most && k * cfl < 6 * n; k++) {
        const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                       v = gs4_particles(sim, GS4_FIELD_VELOCITY);
        double now = 0;
        for (i = 0; i < x.count; i++)
            now += 2 / 0.001 / x.count * (double)v.data[i * v.stride + a]
                   * sin(2 * acos(-1.0) * (double)x.data[i * x.stride + a]);
        if (k && before * now <= 0) {
            last = (k - now / (now - before)) * cfl / n;
            if (!crossings++) first = last;
        }
        if (crossings == 10) *left = fmax(*left, now);
        before = now;
        if (gs4_step(sim, (gs4_real)(cfl / n)) != GS4_OK) break;
    }
    CHECK_RESULT(sim, crossings < most ? GS4_ERROR_UNSTABLE : GS4_OK, GS4_OK);
    gs4_destroy(sim);
    return (most - 1) * 0.5 / (last - first);
}

/* Resolved, 20 cells a wave: within 1.5 % along every axis, second order. Central differences alone
 * give 1 - (k h)^2/24 = .996. Backward Euler damps by exp(-omega^2 dt t/2). */
static void test_partitioned_sound(void)
{
    double left, coarse, fine;
    int n;
    coarse = flows_sound_frequency(20, 1, GS4_INTEGRATOR_GS4, 0.5, 2, &left);
    CHECK_BETWEEN(coarse, 0.985, 1);
    if (!test_full) return;
    for (n = 0; n < 6; n++) {
        const int be = n & 1;
        const double w = 2 * acos(-1.0);
        coarse = flows_sound_frequency(20, n / 2, periodic_integrators[be], 0.25, 11, &left);
        CHECK_BETWEEN(coarse, 0.985, 1);
        if (be)
            CHECK_CLOSE(left / exp(-0.5 * w * w * 0.25 / 20 * 5), 1, 0.03);
        else
            CHECK_BETWEEN(left, 0.95, 1);
    }
    coarse = flows_sound_frequency(20, 0, GS4_INTEGRATOR_GS4, 0.25, 3, &left);
    fine = flows_sound_frequency(40, 0, GS4_INTEGRATOR_GS4, 0.25, 3, &left);
    CHECK_BETWEEN(log2((1 - coarse) / (1 - fine)), 1.85, 2.15);
}

/* Of a cell of vortices u = U sin(pi x) cos(pi y), at rest in time, and of sound of the amplitude
 * `loud` across both axes, the amplitudes after some steps of 30 h/c, over U and `loud`. */
static void flows_unresolved(gs4_integrator how, int incompressible, double loud, int steps,
                             double *slow, double *sound)
{
    const double U = 0.01, w = acos(-1.0);
    gs4_sim_desc d = partitioned_cube(12);
    gs4_material m = scene_liquid(1000, 0, incompressible ? 0 : 1);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_edit e;
    gs4_view x, v;
    gs4_sim *sim;
    int i;
    d.cells[2] = 4;
    d.integrator = how;
    m.incompressible = incompressible;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 2, 2)), &f) > 0);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++) {
        const double p = w * (double)x.data[i * x.stride], q = w * (double)x.data[i * x.stride + 1];
        e.data[i * e.stride] = (gs4_real)(U * sin(p) * cos(q) + loud * sin(2 * p) * cos(2 * q));
        e.data[i * e.stride + 1] =
            (gs4_real)(-U * cos(p) * sin(q) + loud * cos(2 * p) * sin(2 * q));
    }
    for (i = 0; i < steps; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(30.0 / 12)), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    *slow = *sound = 0;
    for (i = 0; i < x.count; i++) {
        const double p = w * (double)x.data[i * x.stride], q = w * (double)x.data[i * x.stride + 1],
                     a = (double)v.data[i * v.stride], b = (double)v.data[i * v.stride + 1];
        *slow += 2 / U / x.count * (a * sin(p) * cos(q) - b * cos(p) * sin(q));
        if (loud > 0)
            *sound +=
                2 / loud / x.count * (a * sin(2 * p) * cos(2 * q) + b * cos(2 * p) * sin(2 * q));
    }
    gs4_destroy(sim);
}

/* Unresolved, c dt/h = 30: after six steps it is gone. What is slow is as without it, to .5 % of
 * the sound, and as in a liquid that nothing compresses. */
static void test_partitioned_sound_unresolved(void)
{
    int be;
    for (be = 0; be < 2; be++) {
        const double loud = 0.005;
        double slow, sound, without, incompressible, none;
        flows_unresolved(periodic_integrators[be], 0, loud, 6, &slow, &sound);
        flows_unresolved(periodic_integrators[be], 0, 0, 6, &without, &none);
        flows_unresolved(periodic_integrators[be], 1, 0, 6, &incompressible, &none);
        CHECK_CLOSE(sound, 0, 0.01);
        CHECK_CLOSE(slow, without, 0.005 * loud / 0.01);
        CHECK_CLOSE(without / incompressible, 1, 0.002);
        if (!be) CHECK_CLOSE(without, 1, 0.005);
    }
}

static void run_partitioned_flows(void)
{
    RUN_ONCE(test_partitioned_sound);
    RUN_FULL(test_partitioned_sound_unresolved);
}
