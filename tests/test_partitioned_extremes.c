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

typedef struct extremes_draw {
    uint32_t random;
    gs4_sim_desc d;
    gs4_material m[2];
    gs4_sim *sim;
    double g[3], speed; /* gravity; the fastest that is thrown in, cells a second */
    double start;       /* J that were put in, with what gravity may give */
    int kind, bodies, particles;
    double mass, swing; /* of dt */
} extremes_draw;

static double extremes_between(extremes_draw *k, double low, double high)
{
    return low + (high - low) * (stability_random(&k->random) + 0.5);
}
static int extremes_pick(extremes_draw *k, int n) { return (int)extremes_between(k, 0, n - 1e-6); }
static double extremes_power(extremes_draw *k, double low, double high)
{
    return pow(10, extremes_between(k, low, high));
}

static void extremes_describe(extremes_draw *k)
{
    static const double rho[4][2] = { { 0, 0 }, { 0.5, 0 }, { 1, 0 }, { 0.5, 0.5 } };
    int a;
    k->d = partitioned_cube(8);
    for (a = 0; a < 3; a++) {
        const int periodic = extremes_pick(k, 5) == 0;
        k->d.cells[a] = 6 + extremes_pick(k, 7);
        k->d.walls[2 * a] = periodic ? GS4_WALL_PERIODIC : (gs4_wall)extremes_pick(k, 4);
        k->d.walls[2 * a + 1] = periodic ? GS4_WALL_PERIODIC : (gs4_wall)extremes_pick(k, 4);
    }
    k->d.cell_size = (gs4_real)0.125;
    k->d.solver_tolerance = 0; /* as it is by default */
    a = extremes_pick(k, 8);
    k->d.integrator = a % 2 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    if (a % 2 == 0) {
        k->d.rho_inf = (gs4_real)rho[a / 2][0];
        k->d.rho_inf_spurious = (gs4_real)rho[a / 2][1];
    }
    for (a = 0; a < 3; a++) k->g[a] = 0;
    a = extremes_pick(k, 3);
    if (extremes_pick(k, 3)) k->g[a] = -extremes_power(k, -1, 2);
    if (k->d.walls[2 * a] == GS4_WALL_PERIODIC) k->g[a] = 0;
    k->d.gravity = at(k->g[0], k->g[1], k->g[2]);
    CHECK_RESULT(NULL, gs4_create(&k->d, &k->sim), GS4_OK);
}

static void extremes_materials(extremes_draw *k)
{
    const double denser = extremes_pick(k, 2) ? extremes_power(k, -3, 3) : 1;
    int n;
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

/* Bodies at rest, before there is material: that is left out where they are. */
static void extremes_bodies(extremes_draw *k, gs4_shape shape[2])
{
    int n, a;
    k->bodies = extremes_pick(k, 2) * extremes_pick(k, 3);
    for (n = 0; n < k->bodies; n++) {
        gs4_collider c;
        double p[3], low[3], high[3];
        const double r = extremes_between(k, 0.13, 0.35);
        memset(&c, 0, sizeof c);
        for (a = 0; a < 3; a++) {
            p[a] = extremes_between(k, 0, 0.125 * k->d.cells[a]);
            low[a] = p[a] - extremes_between(k, 0.1, 0.3);
            high[a] = p[a] + extremes_between(k, 0.1, 0.3);
        }
        c.contact = (gs4_wall)extremes_pick(k, 3);
        c.shape = extremes_pick(k, 2)
                      ? gs4_sphere(at(p[0], p[1], p[2]), (gs4_real)r)
                      : gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]));
        shape[n] = c.shape;
        CHECK_RESULT(k->sim, gs4_add_collider(k->sim, &c), GS4_OK);
    }
}

/* One particle; spray; a film; all cells full; full but for a pocket; a block; two blocks. */
static void extremes_fill(extremes_draw *k)
{
    double size[3], low[3], high[3], v[3];
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_shape body[2];
    int a, n, i, parts;
    extremes_bodies(k, body);
    k->kind = extremes_pick(k, 7);
    k->speed = extremes_pick(k, 4) ? extremes_power(k, -2, 3) : 0;
    parts = k->kind == 1 ? 40 : k->kind < 3 || k->kind == 5 ? 1 : 2;
    for (a = 0; a < 3; a++) size[a] = 0.125 * k->d.cells[a];
    for (n = 0; n < parts; n++) {
        for (a = 0; a < 3; a++) {
            v[a] = 0.125 * k->speed * extremes_between(k, -0.57, 0.57);
            low[a] = extremes_between(k, 0.05 * size[a], 0.5 * size[a]);
            high[a] = low[a] + extremes_between(k, 0.3, 0.7);
            if (k->kind < 2) high[a] = (low[a] *= 1.8);
            if (k->kind == 3 || k->kind == 4) low[a] = -1;
            if (k->kind == 3 || k->kind == 4) high[a] = 9;
        }
        a = extremes_pick(k, 3);
        if (k->kind == 2) high[a] = low[a] + extremes_between(k, 0.06, 0.2);
        if (parts == 2 && n == 0) high[0] = 0.5 * size[0];
        if (parts == 2 && n == 1) low[0] = 0.5 * size[0];
        f.material = n % 2;
        f.velocity = at(v[0], v[1], v[2]);
        f.jitter = (gs4_real)(extremes_pick(k, 2) * extremes_between(k, 0, 1));
        f.random_seed = k->random >> 4;
        if (k->kind < 2) {
            const gs4_real x[3] = { (gs4_real)low[0], (gs4_real)low[1], (gs4_real)low[2] };
            gs4_add_points(k->sim, x, 1, (gs4_real)(0.125 * 0.125 * 0.125 / 8), &f);
        } else
            gs4_add_particles(
                k->sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])), &f);
    }
    if (k->kind == 4)
        gs4_remove_particles(k->sim, gs4_sphere(at(size[0] / 2, size[1] / 2, size[2] / 2),
                                                (gs4_real)extremes_between(k, 0.1, 0.3)));
    for (i = 0; i < k->bodies; i++) gs4_remove_particles(k->sim, body[i]);
}

/* Kinetic energy, and of gravity; there is none of volume at first. */
static double extremes_energy(extremes_draw *k)
{
    const gs4_view x = gs4_particles(k->sim, GS4_FIELD_POSITION),
                   m = gs4_particles(k->sim, GS4_FIELD_MASS);
    double sum = gs4_get_stats(k->sim).kinetic_energy;
    int i, a;
    for (i = 0; i < x.count; i++)
        for (a = 0; a < 3; a++)
            sum -= (double)m.data[i * m.stride] * k->g[a] * (double)x.data[i * x.stride + a];
    return sum;
}

static int extremes_is_free(const extremes_draw *k)
{
    int i, free = k->bodies == 0;
    for (i = 0; i < 6; i++)
        free &= k->d.walls[i] == GS4_WALL_OPEN || k->d.walls[i] == GS4_WALL_PERIODIC;
    return free;
}

static int extremes_views_are_finite(const gs4_sim *sim)
{
    static const gs4_field field[4] = { GS4_FIELD_POSITION, GS4_FIELD_VELOCITY,
                                        GS4_FIELD_VOLUME_RATIO, GS4_FIELD_PRESSURE };
    int n, i, c, good = 1;
    for (n = 0; n < 4; n++) {
        const gs4_view v = gs4_particles(sim, field[n]);
        for (i = 0; i < v.count; i++)
            for (c = 0; c < v.components; c++)
                good &= fabs((double)v.data[i * v.stride + c]) < 1e30;
    }
    return good;
}

static int extremes_refused, extremes_taken, extremes_above;
static double extremes_gain;

static void extremes_print(const extremes_draw *k, uint32_t seed, const char *what)
{
    printf("draw %u: %s: kind %d, bodies %d, %s rho %g %g, walls %d%d%d%d%d%d, g %.2g, speed %.2g, "
           "mu %.1e %.1e, density %.1e, K %.1e %.1e, swing %.2g\n",
           (unsigned)seed, what, k->kind, k->bodies, k->d.integrator ? "BE" : "GS4",
           (double)k->d.rho_inf, (double)k->d.rho_inf_spurious, (int)k->d.walls[0],
           (int)k->d.walls[1], (int)k->d.walls[2], (int)k->d.walls[3], (int)k->d.walls[4],
           (int)k->d.walls[5], k->g[0] + k->g[1] + k->g[2], k->speed, (double)k->m[0].viscosity,
           (double)k->m[1].viscosity, (double)k->m[1].density, (double)k->m[0].bulk_modulus,
           (double)k->m[1].bulk_modulus, k->swing);
}

/* A step, or a shorter one where it is refused; then nothing has changed. */
static double extremes_step(extremes_draw *k, double dt)
{
    int tries, result = GS4_OK;
    for (tries = 0; tries < 4; tries++, dt /= 2) {
        const uint64_t hash = gs4_state_hash(k->sim);
        result = gs4_step(k->sim, (gs4_real)dt);
        if (result == GS4_OK) break;
        extremes_refused++;
        CHECK(result == GS4_ERROR_UNSTABLE || result == GS4_ERROR_NOT_CONVERGED);
        CHECK(gs4_last_error(k->sim)[0] != 0);
        CHECK(gs4_state_hash(k->sim) == hash);
    }
    extremes_taken += result == GS4_OK;
    return result == GS4_OK ? dt : -1;
}

static void extremes_run(uint32_t seed)
{
    extremes_draw k;
    double e, most = 0, p[3], scale, moved = 0, time = 0;
    gs4_stats s;
    int i, c;
    memset(&k, 0, sizeof k);
    k.random = seed * 2654435769u + 12345u;
    for (i = 0; i < 4; i++) extremes_pick(&k, 2);
    extremes_describe(&k);
    extremes_materials(&k);
    extremes_fill(&k);
    k.swing = extremes_pick(&k, 2) ? extremes_between(&k, 1, 10) : 1;
    s = gs4_get_stats(k.sim);
    k.particles = s.particles;
    k.mass = s.mass;
    k.start = extremes_energy(&k);
    scale = sqrt(2 * s.kinetic_energy * s.mass);
    for (c = 0; c < 3; c++) p[c] = s.momentum[c];
    for (i = 0; i < 40; i++) {
        double dt = fmin((double)gs4_stable_dt(k.sim), 1);
        if (k.particles == 0) break;
        if (extremes_pick(&k, 20) == 0) dt *= extremes_power(&k, -9, 0);
        if (i % 2) dt /= k.swing;
        if (!(dt > 1e-12)) break;
        dt = extremes_step(&k, dt);
        if (dt < 0) break;
        time += dt;
        s = gs4_get_stats(k.sim);
        e = extremes_energy(&k);
        most = fmax(most, e);
        if (!extremes_views_are_finite(k.sim) || e > 100 * k.start + 1e9) break;
        if (s.particles < k.particles) break;
        for (c = 0; c < 3 && extremes_is_free(&k); c++)
            moved = fmax(moved, fabs(s.momentum[c] - p[c] - s.mass * k.g[c] * time)
                                    / (scale + s.mass * fabs(k.g[c]) * time + 1e-30));
    }
    CHECK(extremes_views_are_finite(k.sim));
    for (c = 0; c < 6 && k.d.walls[c] != GS4_WALL_OPEN; c++) {
    }
    if (c == 6) {
        CHECK(s.particles == k.particles);
        CHECK_CLOSE(s.mass / (k.mass + 1e-30), k.particles ? 1 : 0, 1e-12);
    }
    if (k.start > 0 && most / k.start > 1.001 && test_filter[0]) {
        char text[64];
        sprintf(text, "energy %.4g at %d", most / k.start, i);
        extremes_print(&k, seed, text);
    }
    if (moved > 1e-4 && test_filter[0]) {
        char text[64];
        sprintf(text, "momentum off by %.2e", moved);
        extremes_print(&k, seed, text);
    }
    extremes_gain = fmax(extremes_gain, most / (k.start + 1e-30));
    extremes_above += most > 1.01 * k.start + 1e-30;
    CHECK_BETWEEN(most / (k.start + 1e-30), 0, 4);
    CHECK_BETWEEN(moved, 0, 0.01);
    gs4_destroy(k.sim);
}

/* Of 500 draws a handful gain more than 1 %: films and pockets between bodies that liquid slides
 * along or that let go, materials a million times as viscous, or as stiff, as their neighbours. */
static void test_partitioned_extremes_draws(void)
{
    const int draws = test_slow ? 500 : test_full ? 20 : 4;
    int n;
    extremes_refused = extremes_taken = extremes_above = 0;
    extremes_gain = 0;
    for (n = 0; n < draws; n++) extremes_run((uint32_t)n);
    if (test_filter[0])
        printf("%d steps taken, %d refused, energy at most %.4g of what it was, %d above 1.01\n",
               extremes_taken, extremes_refused, extremes_gain, extremes_above);
    CHECK_BETWEEN(extremes_above, 0, draws / 50);
    CHECK_BETWEEN(extremes_taken, 20 * draws, 40 * draws);
}

static void run_partitioned_extremes(void)
{
    RUN_ONCE(test_partitioned_extremes_fly_by);
    RUN_ONCE(test_partitioned_extremes_behind);
    RUN_ONCE(test_partitioned_extremes_fall);
    RUN_FULL(test_partitioned_extremes_viscous);
    RUN_ONCE(test_partitioned_extremes_draws);
}
