/* The partitioned scheme at its extremes: what is exact there, and draws over everything at once.
 * A step is taken, or refused with a code and then the state stays; energy is never above what was
 * put in, nothing is lost, numbers stay finite. */

/* The largest difference of a particle's velocity from v. */
static double extremes_apart(const gs4_sim *sim, gs4_vec3 v)
{
    const gs4_view u = gs4_particles(sim, GS4_FIELD_VELOCITY);
    double most = 0;
    int i;
    for (i = 0; i < u.count; i++) {
        const gs4_real *p = u.data + (size_t)i * (size_t)u.stride;
        most = fmax(most, fabs((double)p[0] - (double)v.x));
        most = fmax(most, fabs((double)p[1] - (double)v.y));
        most = fmax(most, fabs((double)p[2] - (double)v.z));
    }
    return most;
}

/* --- what is dry holds nothing ---------------------------------------------------------------- */

/* A body on the side of k, its surface where the wall would be: a box, a ball or a plane, which
 * moves. */
static gs4_collider extremes_body(const walls_case *k, gs4_wall contact, int shape)
{
    double low[3] = { -1, -1, -1 }, high[3] = { 2, 2, 2 }, centre[3] = { 0.5, 0.5, 0.5 };
    gs4_collider c;
    memset(&c, 0, sizeof c);
    if (k->out > 0)
        low[k->a] = 10.5 / 12;
    else
        high[k->a] = 1.5 / 12;
    centre[k->a] = k->out > 0 ? 13.5 / 12 : -1.5 / 12;
    c.contact = contact;
    c.shape = shape == 0   ? gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]))
              : shape == 1 ? gs4_sphere(at(centre[0], centre[1], centre[2]), (gs4_real)(3 / 12.0))
                           : gs4_plane(k->out > 0 ? at(10.5 / 12, 10.5 / 12, 10.5 / 12)
                                                  : at(1.5 / 12, 1.5 / 12, 1.5 / 12),
                                       walls_vector(k, -1, 0));
    c.velocity = walls_vector(k, 0, -1);
    return c;
}

/* A block that flies by a dry wall or body, two to three cells away, falls as in free space. */
static void extremes_fly_by(int n, gs4_wall kind, int shape, double gap)
{
    const double dt = 1.0 / 120, g = 1;
    walls_case k =
        walls_make(n, shape < 0 ? kind : GS4_WALL_OPEN, (gap + (shape < 0 ? 0 : 1.5)) / 12);
    gs4_vec3 v;
    gs4_sim *sim;
    int i;
    k.m.viscosity = (gs4_real)(n & 1 ? 20 : 0);
    k.d.gravity = walls_vector(&k, 0.2 * g, g);
    sim = walls_block(&k.d, &k.m, k.low, k.high, walls_vector(&k, 0.2, 2));
    if (shape >= 0) {
        const gs4_collider c = extremes_body(&k, kind, shape);
        CHECK_RESULT(sim, gs4_add_collider(sim, &c), GS4_OK);
    }
    for (i = 0; i < 8; i++)
        if (gs4_step(sim, (gs4_real)dt) != GS4_OK) break;
    CHECK_RESULT(sim, i < 8 ? GS4_ERROR_UNSTABLE : GS4_OK, GS4_OK);
    v = walls_vector(&k, 0.2 + 0.2 * g * 8 * dt, 2 + g * 8 * dt);
    CHECK_BETWEEN(extremes_apart(sim, v), 0, sizeof(gs4_real) == 8 ? 2e-9 : 2e-5);
    gs4_destroy(sim);
}

static void test_partitioned_extremes_fly_by(void)
{
    int n, kind, shape;
    for (n = 0; n < 24; n += test_slow ? 1 : test_full ? 5 : 17)
        for (kind = GS4_WALL_STICK; kind <= GS4_WALL_SEPARATE; kind++)
            for (shape = -1; shape < 3; shape++)
                extremes_fly_by(n, (gs4_wall)kind, shape, n % 2 ? 2.25 : 3);
}

/* --- behind walls ----------------------------------------------------------------------------- */

/* A particle, or a block of 64 whose first row it is in, which the stage of its second step finds
 * `behind` cells behind a side of the domain. Behind a periodic one it comes back, from an open one
 * it is gone, and all others keep it, no faster than it was. */
static void extremes_behind(int cells, int side, gs4_wall kind, double behind, int be)
{
    const int count = (cells + side) % 2 ? 64 : 1;
    const double h = 1.0 / 8, speed = 1, dt = 0.98 * h;
    const int a = side / 2, up = side & 1;
    gs4_sim_desc d = partitioned_cube(cells);
    gs4_material m = partitioned_liquid(1);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_real x[3 * 64], v[3] = { 0, 0, 0 };
    double there[3 * 64], free;
    gs4_sim *sim;
    int i, left;
    m.viscosity = 0;
    d.cell_size = (gs4_real)h;
    d.integrator = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    d.walls[side] = d.walls[side ^ (kind == GS4_WALL_PERIODIC)] = kind;
    for (i = 0; i < 3; i++) x[i] = (gs4_real)(h * (cells / 2 + 0.3));
    x[a] = (gs4_real)(2 * speed * dt - behind * h);
    if (up) x[a] = (gs4_real)(cells * h) - x[a];
    v[a] = (gs4_real)(up ? speed : -speed);
    for (i = 3; i < 3 * 64; i++) {
        const int row = i % 3 == a ? i / 3 % 4 : (i / 3 >> (i % 3 == (a + 1) % 3 ? 2 : 4)) % 4;
        x[i] = x[i % 3] + (gs4_real)(0.5 * h * row * (i % 3 == a && up ? -1 : 1));
    }
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.velocity = at((double)v[0], (double)v[1], (double)v[2]);
    f.material = gs4_add_material(sim, &m);
    CHECK_RESULT(sim, gs4_add_points(sim, x, count, (gs4_real)(h * h * h / 8), &f), GS4_OK);
    for (i = 0; i < 3; i++)
        CHECK_RESULT(
            sim,
            gs4_step(sim, (gs4_real)fmin(i < 2 ? dt : dt / 4, 0.99 * (double)gs4_stable_dt(sim))),
            GS4_OK);
    left = gs4_get_stats(sim).particles;
    CHECK(kind == GS4_WALL_OPEN ? left < count : left == count);
    if (kind != GS4_WALL_OPEN) scene_by_id(sim, GS4_FIELD_POSITION, there);
    for (i = a; i < 3 * count && kind != GS4_WALL_OPEN; i += 3)
        CHECK_BETWEEN(there[i], 0, cells * h);
    CHECK_BETWEEN(gs4_get_stats(sim).kinetic_energy, 0, 0.50001 * gs4_get_stats(sim).mass);
    if (kind == GS4_WALL_PERIODIC) {
        free = (double)x[a] + 2.25 * dt * (double)v[a] + (up ? -cells * h : cells * h);
        CHECK_CLOSE(there[a], free, 1e-5);
        CHECK_BETWEEN(extremes_apart(sim, f.velocity), 0, 1e-5);
    }
    gs4_destroy(sim);
}

static void test_partitioned_extremes_behind(void)
{
    int n, side, kind;
    for (partitioned_scheme = GS4_PARTITIONED; partitioned_scheme <= GS4_SEMI_IMPLICIT;
         partitioned_scheme = (gs4_scheme)(partitioned_scheme + 1))
        for (n = test_full ? 7 : 8; n <= (test_full ? 12 : 8); n++)
            for (side = 0; side < 6; side++)
                for (kind = GS4_WALL_STICK; kind <= GS4_WALL_PERIODIC; kind++)
                    extremes_behind(n, side, (gs4_wall)kind, 0.1 + 0.17 * ((n + kind) % 6),
                                    n % 5 % 2);
    partitioned_scheme = GS4_PARTITIONED;
}

/* --- steps of any size ------------------------------------------------------------------------ */

/* Members of the family, and backward Euler. */
static gs4_sim_desc extremes_member(int n)
{
    static const double rho[5][2] = { { 0, 0 }, { 0.5, 0 }, { 1, 0 }, { 0.5, 0.5 }, { 1, 0.9 } };
    gs4_sim_desc d = partitioned_cube(12);
    if (n == 5) d.integrator = GS4_INTEGRATOR_BACKWARD_EULER;
    if (n == 5) return d;
    d.rho_inf = (gs4_real)rho[n][0];
    d.rho_inf_spurious = (gs4_real)rho[n][1];
    return d;
}

/* A drop, or one particle, is thrown up and falls in steps of any size: where it is and how fast is
 * exact with GS4; backward Euler, which falls by g dt^2 in a step, gains no energy. */
static void extremes_fall(int member, int alone)
{
    const double g = 4, tiny = sizeof(gs4_real) == 8 ? 1e-9 : 1e-5;
    static double x0[3 * 4096], x[3 * 4096];
    gs4_sim_desc d = extremes_member(member);
    const gs4_material m = partitioned_liquid(0);
    gs4_fill f = scene_fill(at(0.1, 1, 0.05));
    const gs4_real where[3] = { (gs4_real)0.4, (gs4_real)0.4, (gs4_real)0.4 };
    uint32_t random = (uint32_t)member;
    double time = 0, off = 0, most = 0;
    gs4_stats s;
    gs4_sim *sim;
    int i, c;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    d.gravity = at(0, -g, 0);
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    if (alone)
        gs4_add_points(sim, where, 1, (gs4_real)1e-4, &f);
    else
        gs4_add_particles(sim, gs4_sphere(at(0.4, 0.4, 0.4), (gs4_real)0.17), &f);
    scene_by_id(sim, GS4_FIELD_POSITION, x0);
    for (i = 0; i < 30; i++) {
        const double dt = 0.02 * pow(10, -1.5 * (stability_random(&random) + 0.5));
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)dt), GS4_OK);
        time += (double)(gs4_real)dt;
    }
    s = gs4_get_stats(sim);
    scene_by_id(sim, GS4_FIELD_POSITION, x);
    for (i = 0; i < s.particles; i++)
        for (c = 0; c < 3; c++) {
            const double v = c == 0 ? 0.1 : c == 1 ? 1 : 0.05;
            const double free = x0[3 * i + c] + v * time - (c == 1 ? 0.5 * g * time * time : 0);
            off = fmax(off, fabs(x[3 * i + c] - free) * (c != 1 || member < 5));
            if (c == 1) most = fmax(most, (x[3 * i + c] - free));
        }
    CHECK_BETWEEN(off, 0, tiny);
    CHECK_BETWEEN(most, -1, tiny);
    CHECK_CLOSE(s.momentum[0] / s.mass, 0.1, tiny);
    CHECK_CLOSE(s.momentum[1] / s.mass, 1 - g * time, tiny);
    gs4_destroy(sim);
}

static void test_partitioned_extremes_fall(void)
{
    int n;
    for (n = 0; n < 12; n++) extremes_fall(n / 2, n % 2);
}

/* A drop that strains and turns in steps as long as viscosity lets them be, which is less for some
 * members: its energy decays. */
static void extremes_viscous(int member)
{
    const gs4_material m = partitioned_liquid(1e4);
    gs4_sim *sim = partitioned_strained(extremes_member(member), &m, 0.25);
    const double start = gs4_get_stats(sim).kinetic_energy;
    double most = 0;
    int i;
    for (i = 0; i < 100 && most < 100; i++) {
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.999 * (double)gs4_stable_dt(sim))), GS4_OK);
        most = fmax(most, gs4_get_stats(sim).kinetic_energy / start);
    }
    CHECK(strcmp(gs4_limit_name(sim), "viscosity") == 0);
    if (test_filter[0])
        printf("member %d: energy at most %.4f, at the end %.4g\n", member, most,
               gs4_get_stats(sim).kinetic_energy / start);
    CHECK_BETWEEN(most, 0.3, 1.001);
    gs4_destroy(sim);
}

static void test_partitioned_extremes_viscous(void)
{
    int n;
    for (n = 0; n < 6; n++)
        if (test_slow || n == 0 || n > 2) extremes_viscous(n);
}

/* --- draws over everything -------------------------------------------------------------------- */

/* What the partitioned scheme is drawn with; liquids of constant viscosity. */
static void extremes_materials(extremes_draw *k)
{
    const double denser = extremes_pick(k, 2) ? extremes_power(k, -3, 3) : 1;
    int n;
    k->materials = 2;
    for (n = 0; n < 2; n++) {
        const double mu = extremes_pick(k, 3) ? extremes_power(k, -3, 6) : 0;
        k->m[n] = partitioned_liquid(mu);
        k->m[n].density = (gs4_real)(n ? fmin(1000 * denser, 1e5) : 1000);
        if (extremes_pick(k, 2)) {
            k->m[n].incompressible = 0;
            k->m[n].bulk_modulus = (gs4_real)extremes_power(k, 0, 9);
        }
        CHECK_RESULT(k->sim, gs4_add_material(k->sim, &k->m[n]), GS4_OK);
    }
}

static void extremes_run(uint32_t seed, extremes_sum *sum)
{
    extremes_draw k;
    int i;
    extremes_begin(&k, seed, 0.125);
    extremes_describe(&k);
    k.d.solver_tolerance = 0; /* as it is by default */
    CHECK_RESULT(NULL, gs4_create(&k.d, &k.sim), GS4_OK);
    extremes_materials(&k);
    extremes_fill(&k);
    k.swing = extremes_pick(&k, 2) ? extremes_between(&k, 1, 10) : 1;
    extremes_put_in(&k);
    for (i = 0; i < 40 && k.particles; i++) {
        double dt = fmin((double)gs4_stable_dt(k.sim), 1);
        if (extremes_pick(&k, 20) == 0) dt *= extremes_power(&k, -9, 0);
        if (i % 2) dt /= k.swing;
        if (!(dt > 1e-12) || !extremes_step(&k, dt, 4, sum) || !extremes_watch(&k)) break;
    }
    extremes_judge(&k, seed, sum);
    CHECK_BETWEEN(k.most / (k.start + 1e-30), 0, 4);
    CHECK_BETWEEN(k.moved, 0, 0.01);
    gs4_destroy(k.sim);
}

/* Of 500 draws a handful gain more than 1 %: films and pockets between bodies that liquid slides
 * along or that let go, materials a million times as viscous, or as stiff, as their neighbours. */
static void test_partitioned_extremes_draws(void)
{
    const int draws = test_slow ? 500 : test_full ? 20 : 4;
    extremes_sum sum;
    int n;
    memset(&sum, 0, sizeof sum);
    for (n = 0; n < draws; n++) extremes_run((uint32_t)n, &sum);
    extremes_report(&sum);
    CHECK_BETWEEN(sum.above, 0, draws / 50);
    CHECK_BETWEEN(sum.taken, 20 * draws, 40 * draws);
}

static void run_partitioned_extremes(void)
{
    RUN_ONCE(test_partitioned_extremes_fly_by);
    RUN_ONCE(test_partitioned_extremes_behind);
    RUN_ONCE(test_partitioned_extremes_fall);
    RUN_FULL(test_partitioned_extremes_viscous);
    RUN_ONCE(test_partitioned_extremes_draws);
}
