/* The partitioned scheme at bodies that separate, of every kind along every axis and askew. */

/* Case n of a body: its frame, shape and contact; the integrator, and the liquid or solid. */
typedef struct bodies_case {
    contact_frame f;
    gs4_sim_desc d;
    gs4_material m;
    int shape;
    gs4_wall contact;
    double deep, friction;
} bodies_case;

/* Frames 0 to 5 are faces of a box that is 3.3 cells from a side, 6 to 11 lie askew. */
static bodies_case bodies_make(int n, int be, double viscosity)
{
    bodies_case k;
    int i;
    memset(&k, 0, sizeof k);
    contact_seed = (uint32_t)n + 3;
    k.f = n % 12 < 6 ? contact_face(n % 6, n & 1, 0.33) : contact_askew(0.2);
    k.shape = n % CONTACT_SHAPES;
    k.contact = GS4_WALL_SEPARATE;
    k.deep = n % 3 ? 0.5 : 2 * CONTACT_H;
    k.d = contact_desc(0, GS4_WALL_OPEN);
    k.d.scheme = GS4_PARTITIONED;
    k.d.sharp_gradients = 0;
    k.d.solver_tolerance = (gs4_real)(CONTACT_DOUBLE ? 1e-10 : 1e-5);
    k.d.integrator = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    k.m = partitioned_liquid(viscosity);
    for (i = 0; i < 6; i++) k.d.walls[i] = GS4_WALL_OPEN;
    return k;
}

/* Finite K, and elasticity if so. */
static void bodies_soften(bodies_case *k, double K, double G)
{
    k->m.incompressible = 0;
    k->m.bulk_modulus = (gs4_real)K;
    k->m.solid = G > 0 ? GS4_NEO_HOOKEAN : GS4_NO_SOLID;
    k->m.shear_modulus = (gs4_real)G;
}

/* The body, 0, and a block of 4 by `height` by 4 cells, `gap` before it. */
static gs4_sim *bodies_block(bodies_case *k, double gap, double height, gs4_vec3 velocity)
{
    const double low[3] = { -0.2, gap, -0.2 }, high[3] = { 0.2, gap + height, 0.2 };
    gs4_sim *sim;
    CHECK_RESULT(NULL, gs4_create(&k->d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &k->m), 0);
    contact_body(sim, &k->f, k->shape, k->deep, k->contact, k->friction);
    contact_fill(sim, &k->f, low, high, velocity);
    return sim;
}

/* Number of particles deep in the body: it moves when they have been put back. */
static int bodies_inside(gs4_sim *sim, int c)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i, inside = 0;
    for (i = 0; i < x.count; i++) {
        const gs4_real *p = x.data + i * x.stride;
        inside += gs4i_collider_distance(&sim->boundary.colliders[c], at(p[0], p[1], p[2]))
                  < (gs4_real)-0.5 * sim->grid.h;
    }
    return inside;
}

/* A block at rest under a body falls as if that were not there, and one thrown off leaves it. One
 * that slips holds both back. */
static void test_partitioned_bodies_let_go(void)
{
    const double tiny = CONTACT_DOUBLE ? 2e-9 : 1e-5;
    int n, slips;
    for (n = 0; n < 24; n += test_slow ? 1 : 3)
        for (slips = 0; slips < 2; slips++) {
            bodies_case k = bodies_make(n, (n / 12 + n / 3) % 2, n & 1 ? 20 : 0);
            double v[3];
            gs4_sim *sim;
            k.contact = slips ? GS4_WALL_SLIP : GS4_WALL_SEPARATE;
            if (n % 5 == 4) bodies_soften(&k, 1e6, 0);
            k.d.gravity = contact_vector(&k.f, 0, 1, 0);
            sim = bodies_block(&k, 0, 0.4, at(0, 0, 0));
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.2), GS4_OK);
            contact_mean(sim, &k.f, v);
            if (slips)
                CHECK_BETWEEN(v[1] / 0.2, 0.1, 0.95);
            else
                CHECK_CLOSE(v[1] / 0.2, 1, tiny);
            gs4_destroy(sim);
            if (slips) continue;
            k.d.gravity = at(0, 0, 0);
            sim = bodies_block(&k, 0, 0.4, contact_vector(&k.f, 0.5, 1, 0));
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.2), GS4_OK);
            contact_mean(sim, &k.f, v);
            CHECK_CLOSE(v[0], 0.5, tiny);
            CHECK_CLOSE(v[1], 1, tiny);
            gs4_destroy(sim);
        }
}

/* Thrown against a body a block loses what it has along the normal, and falls off with g. */
static void test_partitioned_bodies_thrown(void)
{
    const double g = 4, v0 = 2;
    int n, i;
    for (n = 0; n < 24; n += test_slow ? 1 : 5) {
        bodies_case k = bodies_make(n, (n / 12 + n / 3) % 2, n & 1 ? 20 : 0);
        double v[3], before[3] = { 0, 0, 0 };
        gs4_sim *sim;
        if (n % 5 == 4) bodies_soften(&k, 1e6, 0);
        k.d.gravity = contact_vector(&k.f, 0, g, 0);
        sim = bodies_block(&k, 0.2, 0.4, contact_vector(&k.f, 0.3, -v0, 0));
        for (i = 0; i < 60; i++) {
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
            contact_mean(sim, &k.f, i < 40 ? before : v);
            if (i < 40) memcpy(v, before, sizeof v);
        }
        if (test_filter[0])
            printf("thrown, case %d: speed %.4f, accelerates %.4f g, along %.4f\n", n, v[1],
                   (v[1] - before[1]) / (g * 0.2), v[0]);
        /* what splashes has no split rates here, and flies with .86 to 1.01 g */
        CHECK_BETWEEN((v[1] - before[1]) / (g * 0.2), 0.85, 1.05);
        CHECK_BETWEEN(v[1], 0.5, 1.05);
        CHECK_BETWEEN(bodies_inside(sim, 0), 0, 0);
        gs4_destroy(sim);
    }
}

/* A block that a body carries or pushes, once that goes away: as if it had never been there. */
static void bodies_leave(int n, int pushes)
{
    double v[2][3], start[3], from[3] = { 0, 0, 0 };
    int i, gone;
    for (gone = 0; gone < 2; gone++) {
        bodies_case k = bodies_make(n, (n / 12 + n / 3) % 2, 100);
        gs4_sim *sim;
        if (n % 3 == 1) bodies_soften(&k, 1e5, n & 4 ? 2e4 : 0);
        if (!pushes) k.d.gravity = contact_vector(&k.f, 0, -2, 0);
        sim = bodies_block(&k, pushes ? 0.05 : 0, 0.4, at(0, 0, 0));
        contact_mean(sim, &k.f, start);
        if (pushes)
            CHECK_RESULT(sim, gs4_move_collider(sim, 0, contact_vector(&k.f, 0, 1, 0), at(0, 0, 0)),
                         GS4_OK);
        for (i = 0; i < (pushes ? 40 : 20); i++)
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.005), GS4_OK);
        contact_mean(sim, &k.f, from);
        for (i = 0; i < 3 && gone; i++) sim->boundary.colliders[0].at[i] -= 100 * k.f.e[1][i];
        if (!gone)
            CHECK_RESULT(sim,
                         gs4_move_collider(sim, 0, contact_vector(&k.f, 0, -3, 0), at(0, 0, 0)),
                         GS4_OK);
        for (i = 0; i < 20; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.005), GS4_OK);
        contact_mean(sim, &k.f, v[gone]);
        gs4_destroy(sim);
    }
    if (test_filter[0])
        printf("leaves, case %d, pushes %d: %.4f, then %.4f, without %.4f\n", n, pushes, from[1],
               v[0][1], v[1][1]);
    CHECK_BETWEEN(from[1], pushes ? 0.5 : -0.19, pushes ? 1.6 : -0.03);
    CHECK_CLOSE(v[0][1], v[1][1], 0.003);
}

static void test_partitioned_bodies_leave(void)
{
    int n;
    for (n = 0; n < 24; n += test_slow ? 1 : 5) {
        bodies_leave(n, 0);
        bodies_leave(n, 1);
    }
}

/* Pools around a ball and a box that separate are at rest, with the pressure of their depth. */
static void test_partitioned_bodies_rest(void)
{
    static const double rest[4] = { 0, 0.25, 0.5, 0.8 };
    int n, i;
    for (n = 0; n < 24; n += test_slow ? 1 : 5) {
        const int a = n / 8, down = n & 1, cells = 12;
        const double H = (9 + rest[n / 2 % 4]) / cells;
        static const double centre[3] = { 0.3, 0.37, 0.41 }, low[3] = { 0.16, 0.55, 0.6 },
                            high[3] = { 0.44, 0.87, 0.83 };
        gs4_sim_desc d = partitioned_cube(cells);
        gs4_material m = partitioned_liquid(n % 3 ? 0 : 1);
        gs4_shape body[2];
        double c[3][3], worst;
        gs4_sim *sim;
        for (i = 0; i < 6; i++) d.walls[i] = (i + n) % 2 ? GS4_WALL_SEPARATE : GS4_WALL_SLIP;
        d.integrator = n / 3 % 2 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
        if (n % 5 == 4) {
            m.incompressible = 0;
            m.bulk_modulus = (gs4_real)1e8;
        }
        for (i = 0; i < 3; i++) {
            const int b = (a + i) % 3, turned = i == 0 && !down;
            c[0][b] = turned ? 1 - centre[i] : centre[i];
            c[1][b] = turned ? 1 - high[i] : low[i];
            c[2][b] = turned ? 1 - low[i] : high[i];
        }
        body[0] = gs4_sphere(at(c[0][0], c[0][1], c[0][2]), (gs4_real)0.17);
        body[1] = gs4_box(at(c[1][0], c[1][1], c[1][2]), at(c[2][0], c[2][1], c[2][2]));
        sim = partitioned_pool(d, &m, a, down, H);
        for (i = 0; i < 2; i++) {
            gs4_collider b;
            memset(&b, 0, sizeof b);
            b.shape = body[i];
            b.contact = GS4_WALL_SEPARATE;
            CHECK(gs4_remove_particles(sim, body[i]) > 100);
            CHECK_RESULT(sim, gs4_add_collider(sim, &b), GS4_OK + i);
        }
        partitioned_steps(sim, 0.2, 20);
        worst = partitioned_pressure_off(sim, a, down, H, 0);
        CHECK_BETWEEN(worst, -0.0005, 0.0005);
        CHECK_BETWEEN(gs4_get_stats(sim).max_speed / sqrt(H), 0,
                      n % 5 == 4       ? 1e-4
                      : CONTACT_DOUBLE ? 1e-9
                                       : 1e-5);
        gs4_destroy(sim);
    }
}

/* A plate two cells thick that fills a channel goes through a column of liquid, or a paddle as thin
 * turns in a pool: nothing gets through or into it. */
static void test_partitioned_bodies_thin(void)
{
    int n, i;
    for (n = 0; n < 6; n++) {
        const int a = n % 3, turns = n >= 3;
        gs4_sim_desc d = partitioned_cube(12);
        const gs4_material m = partitioned_liquid(n & 1 ? 1 : 0);
        const gs4_fill f = scene_fill(at(0, 0, 0));
        double low[3] = { -1, -1, -1 }, high[3] = { 2, 2, 2 }, g[3] = { 0, 0, 0 };
        gs4_collider c;
        gs4_view x;
        gs4_sim *sim;
        int above = 0, below = 0;
        for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_SLIP;
        memset(&c, 0, sizeof c);
        g[a] = -1;
        d.gravity = at(g[0], g[1], g[2]);
        d.integrator = n & 1 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
        c.contact = GS4_WALL_SEPARATE;
        low[a] = turns ? 0.3 : 0.25;
        high[a] = low[a] + 2 / 12.0;
        if (turns) {
            low[(a + 1) % 3] = 0.2;
            high[(a + 1) % 3] = 0.8;
        }
        c.shape = gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]));
        g[a] = turns ? 0 : 0.7;
        c.velocity = at(g[0], g[1], g[2]);
        g[0] = g[1] = g[2] = 0;
        g[(a + 2) % 3] = turns ? 3 : 0;
        c.angular_velocity = at(g[0], g[1], g[2]);
        c.pivot = at(0.5, 0.5, 0.5);
        gs4_add_collider(sim, &c);
        low[0] = low[1] = low[2] = -1;
        high[0] = high[1] = high[2] = 2;
        low[a] = turns ? -1 : 0.25 + 2 / 12.0;
        high[a] = 0.65;
        gs4_add_particles(sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])),
                          &f);
        gs4_remove_particles(sim, c.shape);
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)(turns ? 0.5 : 0.3)), GS4_OK);
        CHECK_BETWEEN(bodies_inside(sim, 0), 0, 0);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        for (i = 0; i < x.count; i++)
            if ((double)x.data[i * x.stride + a] < 0.46)
                below++;
            else
                above++;
        if (!turns) CHECK_BETWEEN(below, 0, 0);
        if (test_filter[0])
            printf("thin %d: %d above, %d below, fastest %.3f\n", n, above, below,
                   (double)gs4_get_stats(sim).max_speed);
        CHECK_BETWEEN(gs4_get_stats(sim).max_speed, 0, 5);
        gs4_destroy(sim);
    }
}

/* Liquid stirred around a separating body: along every axis, in every mirror. */
static void symmetry_partitioned_bodies(symmetry_world *w, int n)
{
    const double low[3] = { 0, 2, 0 };
    const int size[3] = { 6, 4, 4 };
    gs4_material m = scene_liquid(1000, n & 1 ? 20 : 0, n & 2 ? 10 : 0);
    gs4_sim_desc d =
        symmetry_box(8, 7, 7, n & 4 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4);
    gs4_collider c;
    int i;
    m.incompressible = !(n & 2);
    d.scheme = GS4_PARTITIONED;
    d.sharp_gradients = 0;
    d.solver_tolerance = (gs4_real)1e-12;
    for (i = 0; i < 6; i++) d.walls[i] = i & 1 ? GS4_WALL_SLIP : GS4_WALL_SEPARATE;
    memset(&c, 0, sizeof c);
    c.shape = symmetry_body(GS4_SHAPE_SPHERE);
    c.contact = GS4_WALL_SEPARATE;
    c.velocity = at(0.2, 0.3, -0.2);
    c.angular_velocity = at(1, -2, 1.5);
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_add_collider(w, &c);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 0);
    symmetry_edit(w, symmetry_stir, NULL);
}

static void test_partitioned_bodies_symmetry(void)
{
    int n;
    /* in float the half in which dx/dt is kept rounds more than the check allows */
    if (sizeof(gs4_real) == 4) return;
    for (n = 0; n < 8; n += test_slow ? 1 : 3)
        symmetry_check("partitioned_bodies", symmetry_partitioned_bodies, n, 3);
}

static gs4_sim *bodies_splash(int threads)
{
    gs4_sim_desc d = partitioned_cube(12);
    const gs4_material m = partitioned_liquid(2);
    const gs4_fill f = scene_fill(at(0.5, -2, 0.3));
    gs4_collider c;
    gs4_sim *sim;
    memset(&c, 0, sizeof c);
    d.gravity = at(0, -5, 0);
    d.threads = threads;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    c.shape = gs4_sphere(at(0.5, 0.1, 0.5), (gs4_real)0.25);
    c.contact = GS4_WALL_SEPARATE;
    c.angular_velocity = at(0, 3, 1);
    c.pivot = at(0.5, 0.1, 0.5);
    gs4_add_collider(sim, &c);
    gs4_add_particles(sim, gs4_sphere(at(0.45, 0.65, 0.5), (gs4_real)0.22), &f);
    return sim;
}

/* The same bits for any number of threads, and from a checkpoint. */
static void test_partitioned_bodies_bits(void)
{
    const char *path = "gs4mpm-test-bodies.state";
    gs4_sim *a = bodies_splash(1), *b = bodies_splash(3);
    CHECK_RESULT(a, gs4_advance(a, (gs4_real)0.15), GS4_OK);
    CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.15), GS4_OK);
    CHECK(gs4_state_hash(a) == gs4_state_hash(b));
    CHECK_RESULT(a, gs4_save(a, path), GS4_OK);
    gs4_destroy(b);
    b = bodies_splash(1);
    CHECK_RESULT(b, gs4_load(b, path), GS4_OK);
    remove(path);
    CHECK_RESULT(a, gs4_advance(a, (gs4_real)0.05), GS4_OK);
    CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.05), GS4_OK);
    CHECK(gs4_state_hash(a) == gs4_state_hash(b));
    gs4_destroy(a);
    gs4_destroy(b);
}

/* Liquid on a slippery plane whose normal is off two axes of the grid, a flat block of 12 x 4 x 12
 * cells: its acceleration downhill over g sin(tilt). */
static double bodies_slide(double tilt, double turn, double lift, gs4_integrator how)
{
    enum {
        ACROSS = 24,
        HIGH = 8
    }; /* particles */
    const double s = 0.5 / 16, g = 1, time = 0.3;
    const double n[3] = { sin(tilt) * cos(turn), cos(tilt), sin(tilt) * sin(turn) };
    const double along[3] = { cos(tilt) * cos(turn), -sin(tilt), cos(tilt) * sin(turn) };
    const double side[3] = { -sin(turn), 0, cos(turn) };
    const gs4_material m = partitioned_liquid(1);
    static gs4_real points[3 * ACROSS * ACROSS * HIGH];
    gs4_sim_desc d = partitioned_cube(24);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_collider plane;
    gs4_stats q;
    gs4_sim *sim;
    int i, c;
    d.cell_size = (gs4_real)(2 * s);
    d.integrator = how;
    d.gravity = at(0, -g, 0);
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    memset(&plane, 0, sizeof plane);
    plane.contact = GS4_WALL_SLIP;
    plane.shape = gs4_plane(at(0.75 + lift * n[0], 0.75 + lift * n[1], 0.75 + lift * n[2]),
                            at(n[0], n[1], n[2]));
    CHECK_RESULT(sim, gs4_add_collider(sim, &plane), GS4_OK);
    for (i = 0; i < ACROSS * ACROSS * HIGH; i++) {
        const double x = (i % ACROSS - ACROSS / 2 + 0.5) * s, up = (i / ACROSS % HIGH + 0.5) * s;
        const double z = (i / (ACROSS * HIGH) - ACROSS / 2 + 0.5) * s;
        for (c = 0; c < 3; c++)
            points[3 * i + c] = (gs4_real)(0.75 + x * along[c] + (up + lift) * n[c] + z * side[c]);
    }
    CHECK_RESULT(sim,
                 gs4_add_points(sim, points, ACROSS * ACROSS * HIGH, (gs4_real)(s * s * s), &f),
                 GS4_OK);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)time), GS4_OK);
    q = gs4_get_stats(sim);
    gs4_destroy(sim);
    return (q.momentum[0] * along[0] + q.momentum[1] * along[1] + q.momentum[2] * along[2]) / q.mass
           / (g * time * sin(tilt));
}

/* Within 1 %; small blocks are held by their edges, of 4 x 3 cells by up to 5 %. */
static void test_partitioned_bodies_slope(void)
{
    int k;
    for (k = 0; k < 6; k++) {
        const gs4_integrator how = k % 2 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
        const double r = bodies_slide(0.25 + 0.12 * k, 0.35 + 0.2 * k, 0.01 * k, how);
        if (test_filter[0]) printf("%.4f of g sin\n", r);
        CHECK_CLOSE(r, 1, 0.01);
    }
}

/* Steady flow along sticky bodies whose surfaces lie anywhere in cells: in a slit or pipe under
 * g = 1, or in a ring around a cylinder that turns with 1/s. Lengths in half the width, or of the
 * outer radius; viscosity 1. */
enum {
    STICKY_SLIT,
    STICKY_PIPE,
    STICKY_RING
};

typedef struct sticky_flow {
    gs4_scheme scheme;
    gs4_liquid liquid;
    int kind, along, cells; /* axis of the flow, or of the cylinders; cells a length */
    double high, wide;      /* the middle from the corner of a cell, in cells */
    double centre[3], time;
} sticky_flow;

/* Of p from the axis, or from the middle of a slit. */
static double sticky_radius(const sticky_flow *k, const double p[3], double arm[2])
{
    const int b = (k->along + 1) % 3, c = (k->along + 2) % 3;
    arm[0] = p[b] - k->centre[b];
    arm[1] = k->kind == STICKY_SLIT ? 0 : p[c] - k->centre[c];
    return hypot(arm[0], arm[1]);
}

static double sticky_place(gs4_vec3 p, void *user)
{
    const double x[3] = { (double)p.x, (double)p.y, (double)p.z };
    double arm[2];
    return sticky_radius((const sticky_flow *)user, x, arm);
}

static gs4_real sticky_outside(gs4_vec3 p, void *user)
{
    return (gs4_real)(1 - sticky_place(p, user));
}

static gs4_real sticky_inside(gs4_vec3 p, void *user)
{
    return (gs4_real)(sticky_place(p, user) - 0.5);
}

static gs4_real sticky_liquid(gs4_vec3 p, void *user)
{
    const double r = sticky_place(p, user);
    return (gs4_real)(((const sticky_flow *)user)->kind == STICKY_RING ? fmax(r - 1, 0.5 - r)
                                                                       : r - 1);
}

static void sticky_bodies(gs4_sim *sim, sticky_flow *k)
{
    gs4_collider body;
    double spin[3] = { 0, 0, 0 };
    memset(&body, 0, sizeof body);
    body.contact = GS4_WALL_STICK;
    body.shape = gs4_sdf(sticky_outside, k, at(-9, -9, -9), at(9, 9, 9));
    CHECK(gs4_add_collider(sim, &body) >= 0);
    if (k->kind != STICKY_RING) return;
    spin[k->along] = 1;
    body.shape = gs4_sdf(sticky_inside, k, at(-9, -9, -9), at(9, 9, 9));
    body.pivot = at(k->centre[0], k->centre[1], k->centre[2]);
    body.angular_velocity = at(spin[0], spin[1], spin[2]);
    CHECK(gs4_add_collider(sim, &body) >= 0);
}

/* Flux, or angular momentum, over that of the law at the same particles: u = (1 - r^2)/4 in a pipe,
 * (1 - r^2)/2 in a slit, and (1/r - r)/3 around the cylinder. */
static double sticky_measure(const sticky_flow *k, gs4_sim *sim)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    const int b = (k->along + 1) % 3, c = (k->along + 2) % 3;
    double flow = 0, law = 0;
    int i;
    for (i = 0; i < x.count; i++) {
        const gs4_real *p = x.data + i * x.stride, *u = v.data + i * v.stride;
        const double place[3] = { (double)p[0], (double)p[1], (double)p[2] };
        double arm[2];
        const double r = sticky_radius(k, place, arm);
        if (k->kind == STICKY_RING) {
            flow += arm[0] * (double)u[c] - arm[1] * (double)u[b];
            law += (1 - r * r) / 3;
        } else {
            flow += (double)u[k->along];
            law += (1 - r * r) / (k->kind == STICKY_PIPE ? 4 : 2);
        }
    }
    return flow / law;
}

static double sticky_run(sticky_flow k)
{
    const double h = 1.0 / k.cells;
    const int b = (k.along + 1) % 3, c = (k.along + 2) % 3;
    gs4_material m = scene_liquid(1, 1, 0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double down[3] = { 0, 0, 0 }, r;
    gs4_sim_desc d;
    gs4_sim *sim;
    int i;
    memset(&d, 0, sizeof d);
    m.incompressible = 1;
    m.liquid = k.liquid;
    if (k.liquid == GS4_OLDROYD_B) {
        m.local_fraction = (gs4_real)0.3;
        m.relaxation_time = (gs4_real)0.5;
    }
    d.scheme = k.scheme;
    d.cell_size = (gs4_real)h;
    d.solver_tolerance = (gs4_real)1e-6;
    d.max_dt = (gs4_real)0.1;
    for (i = 0; i < 6; i++) d.walls[i] = i / 2 == k.along ? GS4_WALL_PERIODIC : GS4_WALL_SLIP;
    d.cells[k.along] = 4;
    d.cells[b] = d.cells[c] = 2 * k.cells + 8;
    if (k.kind == STICKY_SLIT) {
        d.cells[c] = 4;
        d.walls[2 * c] = d.walls[2 * c + 1] = GS4_WALL_PERIODIC;
    }
    down[k.along] = k.kind != STICKY_RING;
    d.gravity = at(down[0], down[1], down[2]);
    k.centre[k.along] = 0;
    k.centre[b] = (k.cells + 4 + k.high) * h;
    k.centre[c] = (k.cells + 4 + k.wide) * h;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    sticky_bodies(sim, &k);
    f.material = gs4_add_material(sim, &m);
    CHECK(gs4_add_particles(sim, gs4_sdf(sticky_liquid, &k, at(-1, -1, -1), at(9, 9, 9)), &f) > 0);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)k.time), GS4_OK);
    r = sticky_measure(&k, sim);
    gs4_destroy(sim);
    if (test_filter[0])
        printf("scheme %d liquid %d kind %d, %d cells at %g %g along %d: %.4f\n", (int)k.scheme,
               (int)k.liquid, k.kind, k.cells, k.high, k.wide, k.along, r);
    return r;
}

static sticky_flow sticky_of(int kind, int along, int cells, double high, double wide)
{
    sticky_flow k;
    memset(&k, 0, sizeof k);
    k.scheme = GS4_SEMI_IMPLICIT;
    k.kind = kind;
    k.along = along;
    k.cells = cells;
    k.high = high;
    k.wide = wide;
    k.time = kind == STICKY_SLIT ? 2.5 : 1.2; /* 6 times that of the slowest mode, or more */
    return k;
}

/* In the solve they are where they should be to second order: bounds fall to a quarter as cells do
 * to a half, in pipes, whose places in cells matter more, to a half. */
static void test_semi_bodies_flow(void)
{
    static const double place[3][2] = { { 0.3, 0.1 }, { 0.2, 0.7 }, { 0, 0 } };
    static const double within[3] = { 0.02, 0.025, 0.03 };
    int kind, along, p;
    for (kind = 0; kind < 3; kind++)
        for (p = 0; p < 3; p++) {
            const int cells = kind == STICKY_RING ? 8 : 4;
            for (along = 0; along < 3; along++)
                if (kind != STICKY_RING || along == p)
                    CHECK_CLOSE(sticky_run(sticky_of(kind, along, cells, place[p][0], place[p][1])),
                                1, within[kind]);
            CHECK_CLOSE(sticky_run(sticky_of(kind, p, 2 * cells, place[p][0], place[p][1])), 1,
                        within[kind] / (kind == STICKY_PIPE ? 2 : 4));
        }
}

/* Where the stress is of particles they are so to first order, and on average. */
static void test_partitioned_bodies_flow(void)
{
    int along;
    for (along = 0; along < 3; along++) {
        sticky_flow k = sticky_of(STICKY_PIPE, along, 6, 0.2, 0.7);
        k.scheme = GS4_PARTITIONED;
        CHECK_CLOSE(sticky_run(k), 1, 0.1);
    }
}

/* Known stress goes with the rates at the surface. */
static void test_semi_bodies_viscoelastic(void)
{
    int along;
    for (along = 0; along < 3; along++) {
        sticky_flow k = sticky_of(STICKY_PIPE, along, 6, 0.2, 0.7);
        k.liquid = GS4_OLDROYD_B;
        k.time = 4;
        CHECK_CLOSE(sticky_run(k), 1, 0.05);
    }
}

static void run_partitioned_bodies(void)
{
    RUN_FULL(test_partitioned_bodies_let_go);
    RUN_FULL(test_partitioned_bodies_thrown);
    RUN_FULL_ONCE(test_partitioned_bodies_leave);
    RUN_FULL(test_partitioned_bodies_rest);
    RUN_FULL(test_partitioned_bodies_thin);
    RUN_FULL_ONCE(test_partitioned_bodies_slope);
    RUN_FULL_ONCE(test_partitioned_bodies_flow);
    RUN_FULL_ONCE(test_semi_bodies_flow);
    RUN_FULL_ONCE(test_semi_bodies_viscoelastic);
    RUN_FULL(test_partitioned_bodies_symmetry);
    RUN_FULL(test_partitioned_bodies_bits);
}
