/* The partitioned scheme at walls that separate, against exact flows, along every axis. */

/* A block low .. high of the domain, 8 particles a cell. */
static gs4_sim *walls_block(const gs4_sim_desc *d, const gs4_material *m, const double low[3],
                            const double high[3], gs4_vec3 velocity)
{
    static gs4_real xyz[3 * 4096];
    const double dx = (double)d->cell_size / 2;
    gs4_fill f = scene_fill(velocity);
    gs4_sim *sim;
    int n[3], i, c, count;
    for (c = 0; c < 3; c++) n[c] = (int)floor((high[c] - low[c]) / dx + 0.5);
    count = n[0] * n[1] * n[2];
    CHECK(count <= 4096);
    for (i = 0; i < count; i++) {
        const int at[3] = { i % n[0], i / n[0] % n[1], i / (n[0] * n[1]) };
        for (c = 0; c < 3; c++) xyz[3 * i + c] = (gs4_real)(low[c] + (at[c] + 0.5) * dx);
    }
    CHECK_RESULT(NULL, gs4_create(d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, m);
    CHECK_RESULT(sim, gs4_add_points(sim, xyz, count, (gs4_real)(dx * dx * dx), &f), GS4_OK);
    return sim;
}

/* Case n: a box of 12 cells, side `w` of which is `kind`; a block of 4 cells in its midst that is
 * `gap` away from that side. */
typedef struct walls_case {
    gs4_sim_desc d;
    gs4_material m;
    double low[3], high[3], out; /* +1 or -1: towards the side */
    int w, a;
} walls_case;

static walls_case walls_make(int n, gs4_wall kind, double gap)
{
    walls_case k;
    int i;
    k.d = partitioned_cube(12);
    k.m = partitioned_liquid(0);
    k.w = n % 6;
    k.a = k.w / 2;
    k.out = k.w & 1 ? 1 : -1;
    k.d.integrator = n / 6 % 2 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    for (i = 0; i < 6; i++) k.d.walls[i] = GS4_WALL_OPEN;
    k.d.walls[k.w] = kind;
    if (n / 12 % 2) {
        k.m.incompressible = 0;
        k.m.bulk_modulus = (gs4_real)1e6;
    }
    for (i = 0; i < 3; i++) {
        k.low[i] = 4 / 12.0;
        k.high[i] = 8 / 12.0;
    }
    k.low[k.a] = k.out > 0 ? 8 / 12.0 - gap : gap;
    k.high[k.a] = k.out > 0 ? 1 - gap : 4 / 12.0 + gap;
    return k;
}

/* The vector that has `out` towards the side and `along` along the next axis. */
static gs4_vec3 walls_vector(const walls_case *k, double out, double along)
{
    double v[3] = { 0, 0, 0 };
    v[k->a] = out * k->out;
    v[(k->a + 1) % 3] = along;
    return at(v[0], v[1], v[2]);
}

static double walls_speed(gs4_sim *sim, const walls_case *k)
{
    const gs4_stats s = gs4_get_stats(sim);
    return s.momentum[k->a] / s.mass * k->out;
}

/* A block at rest that touches a separating ceiling falls, and one thrown off a wall leaves, as if
 * there were none. Walls that slip hold both back. */
static void test_partitioned_walls_let_go(void)
{
    const double tiny = sizeof(gs4_real) == 8 ? 2e-9 : 2e-6;
    int n, slips;
    for (n = 0; n < 24; n += test_full ? 1 : 5)
        for (slips = 0; slips < 2; slips++) {
            walls_case k = walls_make(n, slips ? GS4_WALL_SLIP : GS4_WALL_SEPARATE, 0);
            gs4_sim *sim;
            k.m.viscosity = (gs4_real)(n & 1 ? 20 : 0);
            k.d.gravity = walls_vector(&k, -1, 0);
            sim = walls_block(&k.d, &k.m, k.low, k.high, at(0, 0, 0));
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.2), GS4_OK);
            if (slips)
                CHECK_BETWEEN(walls_speed(sim, &k) / -0.2, 0.1, 0.95);
            else
                CHECK_CLOSE(walls_speed(sim, &k) / -0.2, 1, tiny);
            gs4_destroy(sim);
            k.d.gravity = at(0, 0, 0);
            sim = walls_block(&k.d, &k.m, k.low, k.high, walls_vector(&k, -1, 0.5));
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.2), GS4_OK);
            if (slips)
                CHECK_BETWEEN(walls_speed(sim, &k), -0.995, -0.5);
            else
                CHECK_CLOSE(walls_speed(sim, &k), -1, tiny);
            CHECK_CLOSE(gs4_get_stats(sim).momentum[(k.a + 1) % 3] / gs4_get_stats(sim).mass, 0.5,
                        slips ? 0.02 : tiny);
            gs4_destroy(sim);
        }
}

/* A block is thrown at a ceiling. A separating one takes its speed, and lets it fall with g again;
 * under one that slips it hangs and keeps what it had along it, at a sticky one it stays. Energy
 * is never above what was put in. */
static void walls_throw(int n, gs4_wall kind)
{
    const double g = 4, v0 = 2;
    walls_case k = walls_make(n, kind, 2 / 12.0);
    double before, energy, most;
    gs4_sim *sim;
    gs4_stats s;
    int i;
    k.m.viscosity = (gs4_real)(kind == GS4_WALL_STICK ? 100 : 0);
    k.d.gravity = walls_vector(&k, -g, 0);
    sim = walls_block(&k.d, &k.m, k.low, k.high, walls_vector(&k, v0, 0.3));
    most = 0.5 * (v0 * v0 + 0.3 * 0.3) - g * (2 / 12.0 + 2 / 12.0);
    for (i = 0; i < 30; i++) {
        double away = 0;
        gs4_view x;
        int p;
        before = walls_speed(sim, &k);
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.02), GS4_OK);
        s = gs4_get_stats(sim);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        for (p = 0; p < x.count; p++) {
            const double there = (double)x.data[p * x.stride + k.a];
            away += (k.out > 0 ? 1 - there : there) / x.count;
        }
        energy = s.kinetic_energy / s.mass - g * away;
        CHECK_BETWEEN(energy, -10, most * (kind == GS4_WALL_SEPARATE ? 1.0001 : 1.005));
    }
    if (test_filter[0])
        printf("thrown, case %d, kind %d: speed %.4f, accelerates %.4f g, along %.4f\n", n,
               (int)kind, walls_speed(sim, &k), (walls_speed(sim, &k) - before) / (-g * 0.02),
               s.momentum[(k.a + 1) % 3] / s.mass);
    if (kind == GS4_WALL_SEPARATE) {
        CHECK_CLOSE((walls_speed(sim, &k) - before) / (-g * 0.02), 1, 0.03);
        CHECK_BETWEEN(walls_speed(sim, &k), -1.4, -0.9);
    } else
        CHECK_BETWEEN(walls_speed(sim, &k), -0.35, 0.1);
    gs4_destroy(sim);
}

static void test_partitioned_walls_thrown(void)
{
    int n, kind;
    for (n = 0; n < 24; n += test_full ? 1 : 7)
        for (kind = GS4_WALL_STICK; kind <= GS4_WALL_SEPARATE; kind++)
            walls_throw(n, (gs4_wall)kind);
}

/* A slug that fills a channel meets a separating wall at its end, in the first step or later: it
 * stops there, and nothing throws it back. What a first step takes as feedback stays as a rate. */
static void walls_slug(int n, double rho, double gap)
{
    walls_case k = walls_make(n, GS4_WALL_SEPARATE, gap / 12);
    gs4_sim *sim;
    int i;
    for (i = 0; i < 3; i++)
        if (i != k.a) {
            k.d.cells[i] = 4;
            k.d.walls[2 * i] = k.d.walls[2 * i + 1] = GS4_WALL_SLIP;
            k.low[i] = 0;
            k.high[i] = 4 / 12.0;
        }
    if (k.d.integrator == GS4_INTEGRATOR_GS4) k.d.rho_inf = (gs4_real)rho;
    sim = walls_block(&k.d, &k.m, k.low, k.high, walls_vector(&k, 0.5, 0));
    for (i = 0; i < 40; i++) {
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.02), GS4_OK);
        CHECK_BETWEEN(walls_speed(sim, &k), -1e-3, 0.5001);
    }
    if (test_filter[0])
        printf("slug %d, rho %g, gap %g: %.1e\n", n, rho, gap, walls_speed(sim, &k));
    CHECK_BETWEEN(walls_speed(sim, &k), -1e-3, 2e-3);
    gs4_destroy(sim);
}

static void test_partitioned_walls_slug(void)
{
    static const double rho[4] = { 0, 0.5, 0.9, 0 }, gap[4] = { 0, 0.3, 0, 1.2 };
    int n, k;
    for (n = 0; n < 12; n += test_full ? 1 : 11) /* elastic ones may bounce */
        for (k = n % 2; k < 4; k += 2) walls_slug(n, rho[k], gap[k]);
}

/* A pool between separating walls is at rest, and its pressure is that of its depth. */
static void test_partitioned_walls_rest(void)
{
    static const double rest[4] = { 0, 0.25, 0.5, 0.8 };
    const double limit = sizeof(gs4_real) == 8 ? 1e-9 : 1e-5;
    double worst = 0;
    int n, i;
    for (n = 0; n < 24; n += test_full ? 1 : 13) {
        const int a = n / 8, down = n & 1, cells = 8, big = n % 3 == 2;
        const double H = (5 + rest[n / 2 % 4]) / cells;
        gs4_sim_desc d = partitioned_cube(cells);
        gs4_material m = partitioned_liquid(n % 3 ? 0 : 1);
        gs4_sim *sim;
        for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_SEPARATE;
        d.integrator = n / 3 % 2 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
        if (big) {
            m.incompressible = 0;
            m.bulk_modulus = (gs4_real)1e8;
        }
        sim = partitioned_pool(d, &m, a, down, H);
        partitioned_steps(sim, test_full ? 0.2 : 0.1, test_full ? 50 : 25);
        CHECK_BETWEEN(gs4_get_stats(sim).max_speed / sqrt(H), 0, big ? 1e-4 : limit);
        worst = partitioned_pressure_off(sim, a, down, H, worst);
        gs4_destroy(sim);
    }
    CHECK_BETWEEN(worst, -0.001, 0.001);
}

/* A closed box that is full: between walls that slip liquid would have to follow a piston; a
 * separating wall lets it go. Pushed into the box it is refused by both. */
static void test_partitioned_walls_piston(void)
{
    int n;
    for (n = 0; n < 4; n++) {
        const int pulls = n & 1, separates = n & 2;
        gs4_sim_desc d = partitioned_cube(8);
        const gs4_material m = partitioned_liquid(0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_collider c;
        gs4_sim *sim;
        int i, result = GS4_OK;
        for (i = 0; i < 6; i++) d.walls[i] = separates ? GS4_WALL_SEPARATE : GS4_WALL_SLIP;
        memset(&c, 0, sizeof c);
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        c.shape = gs4_plane(at(0.5, 0.75, 0.5), at(0, -1, 0));
        c.contact = GS4_WALL_SLIP;
        c.velocity = at(0, pulls ? 0.1 : -0.1, 0);
        gs4_add_collider(sim, &c);
        gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 0.75, 2)), &f);
        for (i = 0; i < 5 && result == GS4_OK; i++) result = gs4_step(sim, (gs4_real)0.02);
        if (pulls && separates) {
            CHECK_RESULT(sim, result, GS4_OK);
            CHECK_CLOSE(gs4_get_stats(sim).momentum[0], 0, 1e-3);
        } else {
            CHECK_RESULT(sim, result, GS4_ERROR_UNSTABLE);
            CHECK(strstr(gs4_last_error(sim), "closed") != NULL);
        }
        gs4_destroy(sim);
    }
}

/* Liquid stirred between walls of which some separate: along every axis, in every mirror. */
static void symmetry_partitioned_walls(symmetry_world *w, int n)
{
    static const int walls[4][6] = {
        { 2, 1, 3, 2, 2, 2 }, { 2, 2, 0, 2, 2, 1 }, { 2, 2, 2, 2, 2, 2 }, { 0, 2, 2, 1, 3, 2 }
    };
    const double low[3] = { 0, 2, 0 };
    const int size[3] = { 6, 4, 4 };
    const gs4_material liquid = scene_liquid(1000, n & 1 ? 20 : 0, n & 2 ? 10 : 0);
    gs4_material m = liquid;
    gs4_sim_desc d =
        symmetry_box(8, 7, 7, n & 4 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4);
    int i;
    m.incompressible = !(n & 2);
    d.scheme = partitioned_scheme;
    d.solver_max_iterations = partitioned_iterations;
    d.sharp_gradients = 0;
    d.solver_tolerance = (gs4_real)1e-12;
    for (i = 0; i < 6; i++) d.walls[i] = (gs4_wall)walls[n % 4][i];
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 0);
    symmetry_edit(w, symmetry_stir, NULL);
}

static void test_partitioned_walls_symmetry(void)
{
    int n;
    /* in float the half in which dx/dt is kept rounds more than the check allows */
    if (sizeof(gs4_real) == 4) return;
    for (n = 0; n < 8; n++) symmetry_check("partitioned_walls", symmetry_partitioned_walls, n, 3);
}

/* A splash between walls that separate; with heat, if so. */
static gs4_sim *walls_splash(int threads, int with_heat)
{
    gs4_sim_desc d = partitioned_cube(12);
    gs4_material m = partitioned_liquid(2);
    gs4_fill f = scene_fill(at(0.5, 2, 0.3));
    gs4_sim *sim;
    int i;
    if (with_heat) {
        m.heat_capacity = 1;
        m.conductivity = 50;
        m.viscous_heating = 1;
    }
    for (i = 0; i < 6; i++) d.walls[i] = i == 2 ? GS4_WALL_SLIP : GS4_WALL_SEPARATE;
    d.gravity = at(0, -5, 0);
    d.threads = threads;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_sphere(at(0.35, 0.75, 0.7), (gs4_real)0.24), &f);
    return sim;
}

/* The same bits for any number of threads, and from a checkpoint. */
static void test_partitioned_walls_bits(void)
{
    int with_heat;
    for (with_heat = 0; with_heat < 2; with_heat++) {
        const char *path = "gs4mpm-test-walls.state";
        gs4_sim *a = walls_splash(1, with_heat), *b = walls_splash(3, with_heat);
        CHECK_RESULT(a, gs4_advance(a, (gs4_real)0.1), GS4_OK);
        CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.1), GS4_OK);
        CHECK(gs4_state_hash(a) == gs4_state_hash(b));
        CHECK_RESULT(a, gs4_save(a, path), GS4_OK);
        gs4_destroy(b);
        b = walls_splash(1, with_heat);
        CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.02), GS4_OK); /* it has a past of its own */
        CHECK_RESULT(b, gs4_load(b, path), GS4_OK);
        remove(path);
        CHECK_RESULT(a, gs4_advance(a, (gs4_real)0.1), GS4_OK);
        CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.1), GS4_OK);
        CHECK(gs4_state_hash(a) == gs4_state_hash(b));
        gs4_destroy(a);
        gs4_destroy(b);
    }
}

static void run_partitioned_walls(void)
{
    RUN(test_partitioned_walls_let_go);
    RUN_FULL(test_partitioned_walls_slug);
    RUN_FULL_ONCE(test_partitioned_walls_thrown);
    RUN_FULL(test_partitioned_walls_rest);
    RUN(test_partitioned_walls_piston);
    RUN_FULL_ONCE(test_partitioned_walls_symmetry);
    RUN_FULL(test_partitioned_walls_bits);
}
