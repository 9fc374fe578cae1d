/* The partitioned scheme against exact and measured flows. Internals are looked at where the
 * interface does not show them. */

/* of the next scenes */
static gs4_scheme partitioned_scheme = GS4_PARTITIONED;
static int partitioned_iterations;

static gs4_sim_desc partitioned_cube(int n)
{
    gs4_sim_desc d = scene_cube(n);
    d.scheme = partitioned_scheme;
    d.sharp_gradients = 0;
    d.solver_max_iterations = partitioned_iterations;
    d.solver_tolerance = (gs4_real)(sizeof(gs4_real) == 8 ? 1e-10 : 1e-5);
    return d;
}

static gs4_material partitioned_liquid(double viscosity)
{
    gs4_material m = scene_liquid(1000, viscosity, 0);
    m.incompressible = 1;
    return m;
}

/* Advance in equal steps, or print why not. */
static int partitioned_steps(gs4_sim *sim, double time, int steps)
{
    int i, result = GS4_OK;
    for (i = 0; i < steps && result == GS4_OK; i++)
        result = gs4_step(sim, (gs4_real)(time / steps));
    CHECK_RESULT(sim, result, GS4_OK);
    return result;
}

/* Angular momentum about the axis `a` through the centre of mass. */
static double partitioned_spin(const gs4_sim *sim, const gs4_stats *s, int a)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    double at_b = 0, at_c = 0;
    int i;
    for (i = 0; i < x.count; i++) {
        at_b += (double)x.data[i * x.stride + b] / x.count;
        at_c += (double)x.data[i * x.stride + c] / x.count;
    }
    return s->angular_momentum[a] - (at_b * s->momentum[c] - at_c * s->momentum[b]);
}

/* A spinning drop falls freely: its momentum exactly, its angular momentum within 1 %. */
static void test_partitioned_flight(void)
{
    int be;
    for (be = 0; be < 2; be++) {
        gs4_sim_desc d = partitioned_cube(16);
        const gs4_material m = partitioned_liquid(0);
        gs4_fill f = scene_fill(at(0.3, 0.9, -0.2));
        double spin[3];
        gs4_stats after;
        gs4_sim *sim;
        int c;
        for (c = 0; c < 6; c++) d.walls[c] = GS4_WALL_OPEN;
        d.gravity = at(0.5, -4, 0.25);
        d.integrator = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
        f.angular_velocity = at(1, -2, 0.5);
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.22), &f);
        after = gs4_get_stats(sim);
        for (c = 0; c < 3; c++) spin[c] = partitioned_spin(sim, &after, c);
        partitioned_steps(sim, 0.2, 12);
        after = gs4_get_stats(sim);
        for (c = 0; c < 3; c++) {
            const double g = c == 0   ? 0.5
                             : c == 1 ? -4
                                      : 0.25,
                         u = c == 0   ? 0.3
                             : c == 1 ? 0.9
                                      : -0.2;
            CHECK_CLOSE(after.momentum[c] / after.mass, u + g * 0.2, 2e-4);
        }
        for (c = 0; c < 3; c++) CHECK_CLOSE(partitioned_spin(sim, &after, c) / spin[c], 1, 0.01);
        gs4_destroy(sim);
    }
}

/* A pool of the depth H, 8 particles a cell, whose floor is the low or the high side of axis a. */
static gs4_sim *partitioned_pool(gs4_sim_desc d, const gs4_material *m, int a, int down, double H)
{
    const int cells = d.cells[0], rows = (int)floor(2 * cells * H + 0.5),
              count = 4 * cells * cells * rows;
    gs4_real *points = (gs4_real *)malloc(3 * (size_t)count * sizeof *points);
    const gs4_real g = (gs4_real)(down ? -1 : 1);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    int i;
    d.gravity.x = a == 0 ? g : 0;
    d.gravity.y = a == 1 ? g : 0;
    d.gravity.z = a == 2 ? g : 0;
    for (i = 0; i < count; i++) {
        const double height = (i / (4 * cells * cells) + 0.5) * H / rows;
        points[3 * i + a] = (gs4_real)(down ? height : 1 - height);
        points[3 * i + (a + 1) % 3] = (gs4_real)((i % (2 * cells) + 0.5) / (2 * cells));
        points[3 * i + (a + 2) % 3] =
            (gs4_real)((i / (2 * cells) % (2 * cells) + 0.5) / (2 * cells));
    }
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, m);
    CHECK_RESULT(sim, gs4_add_points(sim, points, count, (gs4_real)(H / count), &f), GS4_OK);
    free(points);
    return sim;
}

/* A pool whose surface lies anywhere in a cell, under gravity along each axis, is at rest. */
static void test_partitioned_rest(void)
{
    static const double rest[4] = { 0, 0.25, 0.5, 0.8 };
    const double limit = sizeof(gs4_real) == 8 ? 1e-9 : 1e-5;
    int n;
    for (n = 0; n < 24; n += test_slow ? 1 : test_full ? 5 : 13) {
        const int a = n / 8, down = n & 1, which = n / 2 % 4, cells = 8;
        const double H = (5 + rest[which]) / cells;
        gs4_sim_desc d = partitioned_cube(cells);
        const gs4_material m = partitioned_liquid(n % 3 ? 0 : 1);
        gs4_sim *sim;
        gs4_stats s;
        int w;
        for (w = 0; w < 6; w++) d.walls[w] = (w + n) % 2 ? GS4_WALL_STICK : GS4_WALL_SLIP;
        sim = partitioned_pool(d, &m, a, down, H);
        partitioned_steps(sim, test_slow ? 2 : 0.2, test_slow ? 500 : 50);
        s = gs4_get_stats(sim);
        CHECK_BETWEEN(s.max_speed / sqrt(H), 0, limit);
        CHECK_BETWEEN(s.pressure_iterations, 1, 60);
        gs4_destroy(sim);
    }
}

/* How far, of rho g H, pressures of particles are off those of their depth; `worst` if none is
 * farther. */
static double partitioned_pressure_off(const gs4_sim *sim, int a, int down, double H, double worst)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   p = gs4_particles(sim, GS4_FIELD_PRESSURE);
    int i;
    CHECK(p.count == x.count && p.components == 1);
    for (i = 0; i < p.count; i++) {
        const double height = 0.5 + (down ? 1 : -1) * ((double)x.data[i * x.stride + a] - 0.5),
                     off = (double)p.data[i * p.stride] / (1000 * H) - (1 - height / H);
        if (fabs(off) > fabs(worst)) worst = off;
    }
    return worst;
}

/* Its pressure is that of its depth, with a ball and a box in it, whatever walls and bodies are. */
static void test_partitioned_pressure(void)
{
    static const double rest[4] = { 0, 0.25, 0.5, 0.8 };
    double worst = 0;
    int n, i;
    for (n = 0; n < 24; n += test_full ? 1 : 7) {
        const int a = n / 8, down = n & 1, cells = 12;
        const double H = (9 + rest[n / 2 % 4]) / cells;
        gs4_sim_desc d = partitioned_cube(cells);
        gs4_material m = partitioned_liquid(n % 3 ? 0 : 1);
        gs4_shape body[2];
        gs4_real c[3][3];
        gs4_sim *sim;
        for (i = 0; i < 6; i++) d.walls[i] = (i + n) % 2 ? GS4_WALL_STICK : GS4_WALL_SLIP;
        d.walls[2 * a + down] = GS4_WALL_OPEN;
        if (n % 5 == 4) {
            m.incompressible = 0;
            m.bulk_modulus = (gs4_real)1e8;
        }
        for (i = 0; i < 3; i++) {
            static const double centre[3] = { 0.3, 0.37, 0.41 }, low[3] = { 0.16, 0.55, 0.6 },
                                high[3] = { 0.44, 0.87, 0.83 };
            const int b = (a + i) % 3;
            const int turned = i == 0 && !down;
            c[0][b] = (gs4_real)(turned ? 1 - centre[i] : centre[i]);
            c[1][b] = (gs4_real)(turned ? 1 - high[i] : low[i]);
            c[2][b] = (gs4_real)(turned ? 1 - low[i] : high[i]);
        }
        body[0] = gs4_sphere(at(c[0][0], c[0][1], c[0][2]), (gs4_real)0.17);
        body[1] = gs4_box(at(c[1][0], c[1][1], c[1][2]), at(c[2][0], c[2][1], c[2][2]));
        sim = partitioned_pool(d, &m, a, down, H);
        CHECK(gs4_particles(sim, GS4_FIELD_PRESSURE).data[0] == 0);
        for (i = 0; i < 2; i++) {
            gs4_collider b;
            memset(&b, 0, sizeof b);
            b.shape = body[i];
            b.contact = (i + n / 2) % 2 ? GS4_WALL_STICK : GS4_WALL_SLIP;
            CHECK(gs4_remove_particles(sim, body[i]) > 100);
            CHECK_RESULT(sim, gs4_add_collider(sim, &b), GS4_OK);
        }
        partitioned_steps(sim, 0.2, m.incompressible ? 2 : 20);
        worst = partitioned_pressure_off(sim, a, down, H, worst);
        gs4_destroy(sim);
    }
    CHECK_BETWEEN(worst, -0.0005, 0.0005);
}

/* So is one with a ball and a box in it, which hold it or let it slide. */
static void test_partitioned_bodies_at_rest(void)
{
    const double limit = sizeof(gs4_real) == 8 ? 1e-9 : 1e-5;
    int kind;
    for (kind = GS4_WALL_STICK; kind <= GS4_WALL_SLIP; kind++) {
        const gs4_shape ball = gs4_sphere(at(0.4, 0.3, 0.45), (gs4_real)0.17),
                        box = gs4_box(at(0.66, 0.1, 0.5), at(0.9, 0.37, 0.83));
        gs4_sim_desc d = partitioned_cube(16);
        const gs4_material m = partitioned_liquid(0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_collider c;
        gs4_sim *sim;
        memset(&c, 0, sizeof c);
        d.gravity = at(0, -1, 0);
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 0.625, 2)), &f);
        gs4_remove_particles(sim, ball);
        gs4_remove_particles(sim, box);
        c.contact = (gs4_wall)kind;
        c.shape = ball;
        CHECK_RESULT(sim, gs4_add_collider(sim, &c), GS4_OK);
        c.shape = box;
        CHECK_RESULT(sim, gs4_add_collider(sim, &c), GS4_OK);
        partitioned_steps(sim, 0.1, 25);
        CHECK_BETWEEN(gs4_get_stats(sim).max_speed / sqrt(0.625), 0, limit);
        gs4_destroy(sim);
    }
}

/* Liquid on a slippery plane: its acceleration along it over g sin(angle). */
static double partitioned_slide(double angle, double viscosity)
{
    const double t[2] = { cos(angle), -sin(angle) }, n[2] = { sin(angle), cos(angle) },
                 h = 1.0 / 48;
    gs4_real points[3 * 20 * 8 * 16];
    gs4_sim_desc d = partitioned_cube(24);
    const gs4_material m = partitioned_liquid(viscosity);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_collider c;
    gs4_stats s;
    gs4_sim *sim;
    int i;
    memset(&c, 0, sizeof c);
    d.cells[2] = 8;
    d.gravity = at(0, -1, 0);
    for (i = 0; i < 4; i++) d.walls[i] = GS4_WALL_OPEN;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    c.contact = GS4_WALL_SLIP;
    c.shape = gs4_plane(at(0.5, 0.5, 0.5), at(n[0], n[1], 0));
    CHECK_RESULT(sim, gs4_add_collider(sim, &c), GS4_OK);
    for (i = 0; i < 20 * 8 * 16; i++) {
        const double along = (i % 20 - 14 + 0.5) * h, up = (i / 20 % 8 + 0.5) * h;
        points[3 * i] = (gs4_real)(0.5 + along * t[0] + up * n[0]);
        points[3 * i + 1] = (gs4_real)(0.5 + along * t[1] + up * n[1]);
        points[3 * i + 2] = (gs4_real)((i / 160 + 0.5) * h);
    }
    CHECK_RESULT(sim, gs4_add_points(sim, points, 20 * 8 * 16, (gs4_real)(h * h * h), &f), GS4_OK);
    partitioned_steps(sim, 0.2, 20);
    s = gs4_get_stats(sim);
    gs4_destroy(sim);
    return (s.momentum[0] * t[0] + s.momentum[1] * t[1]) / s.mass / (0.2 * sin(angle));
}

static const double partitioned_slopes[3] = { 0.2, 0.5, 1 };

/* A slippery plane at any angle: within 1 %. */
static void test_partitioned_slope(void)
{
    int k;
    for (k = 0; k < (test_full ? 3 : 1); k++)
        CHECK_CLOSE(partitioned_slide(partitioned_slopes[k], 0), 1, 0.01);
}

/* A standing wave in a box, half a wave long, along `across` with gravity along `down`: its first
 * velocities are those of linear theory. `frequency` over sqrt(g k tanh(k H)); what is left of the
 * amplitude after five periods is returned. */
static double partitioned_slosh(int down, int across, int steps, double *frequency)
{
    const double k = 3.14159265358979, H = 0.5, omega = sqrt(k * tanh(k * H));
    const double period = 2 * 3.14159265358979 / omega, dt = period / steps;
    gs4_sim_desc d = partitioned_cube(16);
    const gs4_material m = partitioned_liquid(0);
    gs4_real gravity[3] = { 0, 0, 0 }, low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    gs4_fill f = scene_fill(at(0, 0, 0));
    double before = 0, first = 0, last = 0, most = 0, most_first = 0;
    gs4_view x;
    gs4_edit v;
    gs4_sim *sim;
    int i, n, crossings = 0;
    d.cells[3 - down - across] = 4;
    gravity[down] = -1;
    high[down] = (gs4_real)H;
    high[3 - down - across] = (gs4_real)0.25;
    d.gravity = at(gravity[0], gravity[1], gravity[2]);
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_SLIP;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])), &f);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++) {
        const double up = k * (double)x.data[i * x.stride + down],
                     along = k * (double)x.data[i * x.stride + across];
        v.data[i * v.stride + across] = (gs4_real)(0.03 * cosh(up) / cosh(k * H) * sin(along));
        v.data[i * v.stride + down] = (gs4_real)(-0.03 * sinh(up) / cosh(k * H) * cos(along));
    }
    for (n = 0; n <= 21 * steps / 4; n++) {
        const double now = gs4_get_stats(sim).momentum[across];
        if (n && before * now <= 0) {
            last = (n - now / (now - before)) * dt;
            if (!crossings++) first = last;
        }
        if (n < steps / 4) most_first = fmax(most_first, fabs(now));
        if (n > 19 * steps / 4) most = fmax(most, fabs(now));
        before = now;
        if (gs4_step(sim, (gs4_real)dt) != GS4_OK) break;
    }
    CHECK_RESULT(sim, n <= 21 * steps / 4 ? GS4_ERROR_UNSTABLE : GS4_OK, GS4_OK);
    *frequency = (crossings - 1) * 0.5 * period / (last - first);
    gs4_destroy(sim);
    return most / most_first;
}

static void test_partitioned_sloshing(void)
{
    int down, across;
    for (down = 0; down < 3; down++)
        for (across = 0; across < 3; across++) {
            double frequency, left;
            if (down == across) continue;
            left = partitioned_slosh(down, across, 40, &frequency);
            CHECK_CLOSE(frequency, 1, 0.01);
            CHECK_BETWEEN(left, 0.97, 1);
            if (down + across == 1 && test_slow) {
                left = partitioned_slosh(down, across, 20, &frequency);
                CHECK_CLOSE(frequency, 1, 0.02);
                CHECK_BETWEEN(left, 0.85, 1);
            }
        }
}

/* Ripples of a pool whose particles lie anyhow, in steps as long as may be: they die out. */
static void test_partitioned_ripples(void)
{
    static const double members[6][2] = { { 0, 0 },   { 0.5, 0 }, { 1, 0 },
                                          { 1, 0.5 }, { 1, 0.9 }, { 0, 0 } };
    int n;
    for (n = 0; n < 6; n++) {
        const int down = n % 3, across = (down + 1) % 3, backward = n == 5;
        gs4_real gravity[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
        const gs4_material m = partitioned_liquid(0);
        gs4_sim_desc d = partitioned_cube(16);
        gs4_fill f = scene_fill(at(0, 0, 0));
        double energy, before = 0, after = 0;
        gs4_sim *sim;
        int i;
        d.cells[across] = 4;
        gravity[down] = -1;
        high[down] = (gs4_real)0.52;
        d.gravity = at(gravity[0], gravity[1], gravity[2]);
        d.rho_inf = (gs4_real)members[n][0];
        d.rho_inf_spurious = (gs4_real)members[n][1];
        if (backward) d.integrator = GS4_INTEGRATOR_BACKWARD_EULER;
        for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_SLIP;
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        f.jitter = (gs4_real)0.3;
        gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(high[0], high[1], high[2])), &f);
        for (i = 0; i < 400; i++) {
            if (gs4_step(sim, gs4_stable_dt(sim)) != GS4_OK) break;
            energy = gs4_get_stats(sim).kinetic_energy;
            if (i >= 50 && i < 100) before = fmax(before, energy);
            if (i >= 350) after = fmax(after, energy);
        }
        CHECK_RESULT(sim, i < 400 ? GS4_ERROR_UNSTABLE : GS4_OK, GS4_OK);
        CHECK_BETWEEN(after / before, 0, 0.9);
        gs4_destroy(sim);
    }
}

/* u = (sin cos, - cos sin) in a slippery box is steady without viscosity, and decays with
 * exp(-2 nu pi^2 t) with it. Amplitude over that after a time 0.4, with the vortex about axis a. */
static double partitioned_vortex(int a, int n, double nu)
{
    const double pi = acos(-1.0), nodes = exp(-2 * nu * pi * pi * 0.4);
    gs4_sim_desc d = partitioned_cube(n);
    const gs4_material m = partitioned_liquid(1000 * nu);
    gs4_fill f = scene_fill(at(0, 0, 0));
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    double sum = 0, norm = 0;
    gs4_sim *sim;
    gs4_view x, v;
    gs4_edit edit;
    int i;
    d.cells[a] = 4;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 2, 2)), &f);
    edit = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < edit.count; i++) {
        const double p = pi * (double)x.data[i * x.stride + b],
                     q = pi * (double)x.data[i * x.stride + c];
        edit.data[i * edit.stride + b] = (gs4_real)(sin(p) * cos(q));
        edit.data[i * edit.stride + c] = (gs4_real)(-cos(p) * sin(q));
    }
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.4), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++) {
        const double p = pi * (double)x.data[i * x.stride + b],
                     q = pi * (double)x.data[i * x.stride + c];
        const double u = sin(p) * cos(q), w = -cos(p) * sin(q);
        sum += u * (double)v.data[i * v.stride + b] + w * (double)v.data[i * v.stride + c];
        norm += u * u + w * w;
    }
    gs4_destroy(sim);
    return sum / norm / nodes;
}

static void test_partitioned_vortex(void)
{
    int a;
    for (a = 0; a < (test_full ? 3 : 1); a++) {
        CHECK_CLOSE(partitioned_vortex(a, 12, 0), 1, 0.005);
        CHECK_CLOSE(partitioned_vortex(a, 12, 0.05), 1, 0.03);
    }
}

/* --- order in time ---------------------------------------------------------------------------- */

enum {
    PARTITIONED_MOST = 3 * 9000
};
typedef struct partitioned_run {
    double x[PARTITIONED_MOST], v[PARTITIONED_MOST];
} partitioned_run;

/* A drop of the radius R in an open cube, which strains and turns. */
static gs4_sim *partitioned_strained(gs4_sim_desc d, const gs4_material *m, double R)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    gs4_view x;
    gs4_edit v;
    int i;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, m);
    gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)R), &f);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++) {
        const gs4_real *p = x.data + i * x.stride;
        gs4_real *u = v.data + i * v.stride;
        const double a = (double)p[0] - 0.5, b = (double)p[1] - 0.5, c = (double)p[2] - 0.5;
        u[0] = (gs4_real)(a - 2 * b);
        u[1] = (gs4_real)(2 * a - 0.5 * b + 0.2 * c);
        u[2] = (gs4_real)(-0.5 * c);
    }
    return sim;
}

/* It, for so short a time that no cell becomes liquid or air. */
static int partitioned_drop(const gs4_material *m, double rho, int be, int without_split, int steps,
                            partitioned_run *out)
{
    gs4_sim_desc d = partitioned_cube(16);
    gs4_sim *sim;
    int count;
    d.integrator = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    d.rho_inf = (gs4_real)rho;
    d.solver_tolerance = (gs4_real)1e-12;
    sim = partitioned_strained(d, m, 0.33);
    count = gs4_particles(sim, GS4_FIELD_POSITION).count;
    sim->staggered.without_split = without_split;
    partitioned_steps(sim, 0.008, steps);
    scene_by_id(sim, GS4_FIELD_POSITION, out->x);
    scene_by_id(sim, GS4_FIELD_VELOCITY, out->v);
    gs4_destroy(sim);
    return 3 * count;
}

static double partitioned_apart(const double *a, const double *b, int n)
{
    double sum = 0;
    int i;
    for (i = 0; i < n; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / n);
}

/* What two halvings change of x and v, from 8 steps on. */
static void partitioned_order(const gs4_material *m, double rho, int be, int without_split,
                              double x[2], double v[2])
{
    static partitioned_run run[3];
    int k, n = 0;
    for (k = 0; k < 3; k++) n = partitioned_drop(m, rho, be, without_split, 8 << k, &run[k]);
    for (k = 0; k < 2; k++) {
        x[k] = partitioned_apart(run[k].x, run[k + 1].x, n);
        v[k] = partitioned_apart(run[k].v, run[k + 1].v, n);
    }
}

/* Second order with GS4, first with backward Euler, whose error is 6 times as large and more; and
 * without the split of acceleration velocities hardly converge. */
static void test_partitioned_order(void)
{
    static const double rho[3] = { 0, 0.5, 1 };
    gs4_material m = partitioned_liquid(1);
    double x[2], v[2], ex[2], ev[2];
    int k;
    if (sizeof(gs4_real) == 4) return; /* rounding is more than these errors */
    for (k = 0; k < (test_full ? 3 : 1); k++) {
        partitioned_order(&m, rho[k], 0, 0, x, v);
        CHECK_BETWEEN(log(x[0] / x[1]) / log(2.0), 1.85, 2.15);
        CHECK_BETWEEN(log(v[0] / v[1]) / log(2.0), 1.85, 2.15);
    }
    if (!test_full) return;
    m.liquid = GS4_OLDROYD_B;
    m.local_fraction = (gs4_real)0.5;
    m.relaxation_time = (gs4_real)0.1;
    partitioned_order(&m, 0, 0, 0, x, v);
    CHECK_BETWEEN(log(x[0] / x[1]) / log(2.0), 1.85, 2.15);
    CHECK_BETWEEN(log(v[0] / v[1]) / log(2.0), 1.85, 2.15);
    m = partitioned_liquid(1);
    partitioned_order(&m, 0, 0, 0, x, v);
    partitioned_order(&m, 0, 1, 0, ex, ev);
    CHECK_BETWEEN(log(ex[0] / ex[1]) / log(2.0), 0.9, 1.1);
    CHECK_BETWEEN(ex[1] / x[1], 6, 1000);
    CHECK_BETWEEN(ev[1] / v[1], 6, 1000);
    partitioned_order(&m, 0, 0, 1, ex, ev);
    CHECK_BETWEEN(ev[1] / v[1], 20, 1e5);
}

/* --- a column that collapses ------------------------------------------------------------------ */

/* Martin & Moyce 1952, a = 2.25 in, columns n^2 a high, n^2 = 1 and 2: n t sqrt(g/a), where the
 * front over a is. Their time begins where the gate is away: what it is off is fitted. Theirs then
 * is 13 % slower from the first place to the last for n^2 = 1, 4 % faster for 2. */
static void partitioned_dam(int square)
{
    static const double T[2][5] = { { 0.97, 1.29, 1.62, 1.93, 2.24 },
                                    { 1.43, 1.83, 2.2, 2.51, 2.83 } },
                        Z[5] = { 1.67, 2.11, 2.56, 3, 3.44 };
    const int n = 16;
    gs4_sim_desc d = partitioned_cube(n);
    const gs4_material m = partitioned_liquid(0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double energy, there[5] = { 0 }, shift = 0, time = 0, before = 1, most = 0;
    gs4_sim *sim;
    int k = 0, i;
    d.cells[0] = 5 * n;
    d.cells[1] = 5 * n / 2;
    d.cells[2] = n / 2;
    d.gravity = at(0, -1, 0);
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(1, square, 2)), &f);
    energy = gs4_get_stats(sim).mass * 0.5 * square;
    while (k < 5 && time < 3) {
        const double step = 0.02;
        double front = 0, total;
        gs4_view x;
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)step), GS4_OK);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        for (total = 0, i = 0; i < x.count; i++) {
            front = fmax(front, (double)x.data[i * x.stride] + 0.25 / n);
            total += (double)x.data[i * x.stride + 1];
        }
        total = total * gs4_get_stats(sim).mass / x.count + gs4_get_stats(sim).kinetic_energy;
        most = fmax(most, total / energy);
        if (front >= Z[k]) {
            there[k] = sqrt(square) * (time + step * (Z[k] - before) / (front - before));
            shift += (T[square - 1][k] - there[k]) / 5;
            k++;
        }
        before = front;
        time += step;
    }
    CHECK(k == 5);
    for (k = 0; k < 5; k++) {
        if (test_filter[0])
            printf("n^2 %d, front %.2f at %.3f, measured %.3f\n", square, Z[k], there[k] + shift,
                   T[square - 1][k]);
        CHECK_CLOSE((there[k] + shift) / T[square - 1][k], 1, 0.06);
    }
    if (test_filter[0]) printf("    shift %.3f, energy at most %.5f\n", shift, most);
    CHECK_BETWEEN(shift, -0.1, 0.4);
    CHECK_BETWEEN(most, 0.999, 1.005);
    gs4_destroy(sim);
}

static void test_partitioned_dam(void)
{
    partitioned_dam(1);
    partitioned_dam(2);
}

/* --- any bulk modulus ------------------------------------------------------------------------- */

/* A drop (1000 kg/m^3, U = 1 m/s) on a slippery floor: largest |J - 1|, mean height and radius. */
static int partitioned_impact(int cells, double K, double out[3], int *iterations)
{
    gs4_sim_desc d = partitioned_cube(cells);
    gs4_material m = partitioned_liquid(20);
    gs4_fill f = scene_fill(at(0, -1, 0));
    gs4_sim *sim;
    gs4_view x;
    int i, result = GS4_OK;
    d.cells[0] = d.cells[2] = 3 * cells / 2;
    m.incompressible = !(K > 0);
    m.bulk_modulus = (gs4_real)K;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_sphere(at(0.75, 0.42, 0.75), (gs4_real)0.36), &f);
    out[0] = out[1] = out[2] = 0;
    *iterations = 0;
    for (i = 0; i < 20 && result == GS4_OK; i++) {
        gs4_stats s;
        result = gs4_advance(sim, (gs4_real)0.02);
        s = gs4_get_stats(sim);
        out[0] = fmax(out[0], fmax(s.max_volume_ratio - 1, 1 - s.min_volume_ratio));
        if (s.pressure_iterations > *iterations) *iterations = s.pressure_iterations;
    }
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++) {
        const double a = (double)x.data[i * x.stride] - 0.75,
                     b = (double)x.data[i * x.stride + 2] - 0.75;
        out[1] += (double)x.data[i * x.stride + 1] / x.count;
        out[2] += sqrt(a * a + b * b) / x.count;
    }
    if (test_filter[0])
        printf("%d cells, K %g: %d; K |J - 1| %.3f rho U^2, height %.5f, radius %.5f, %d "
               "iterations\n",
               cells, K, result, K * out[0] / 1000, out[1], out[2], *iterations);
    gs4_destroy(sim);
    return result;
}

/* From c = 3 U on the impact, whose pressure is 2.6 to 3 rho U^2 for R/(6 U), compresses by that
 * over K. From c = 10 U on the shape is that of any stiffer one. A liquid that nothing compresses
 * ends .8 % higher and .5 % narrower, half of it with twice the cells: its rates are split (P2),
 * those of finite K are not. What is as soft as its impact, K = rho U^2, has no J to hold it. */
static void test_partitioned_moduli(void)
{
    static const double slack[2][2] = { { 0.009, 0.0055 }, { 0.0045, 0.003 } };
    double soft[3], stiff[3], hard[3], K;
    int k, n, iterations, most;
    CHECK(partitioned_impact(16, 1e7, stiff, &most) == GS4_OK);
    for (K = 1e4; K < 2e8; K *= test_full ? 10 : 1e4) {
        CHECK(partitioned_impact(16, K, soft, &iterations) == GS4_OK);
        CHECK_BETWEEN(K * soft[0] / 1000, 2.5, 3.1);
        if (K > 9e4)
            for (k = 1; k < 3; k++) CHECK_CLOSE(soft[k] / stiff[k], 1, 0.0015);
        CHECK_BETWEEN(iterations, 2, most);
    }
    if (!test_full) return;
    CHECK(partitioned_impact(16, 1e3, soft, &iterations) == GS4_ERROR_UNSTABLE);
    CHECK(partitioned_impact(16, 1e11, hard, &iterations) == GS4_OK);
    for (k = 1; k < 3; k++) CHECK_CLOSE(hard[k] / stiff[k], 1, 0.0002);
    for (n = 0; n < (test_slow ? 2 : 1); n++) {
        if (n) CHECK(partitioned_impact(32, 1e7, stiff, &most) == GS4_OK);
        CHECK(partitioned_impact(16 << n, 0, hard, &iterations) == GS4_OK);
        CHECK_CLOSE(hard[0], 0, 1e-6);
        CHECK_BETWEEN(hard[1] / stiff[1] - 1, 0, slack[n][0]);
        CHECK_BETWEEN(1 - hard[2] / stiff[2], 0, slack[n][1]);
        CHECK_BETWEEN(most, 2, iterations); /* two solves of a step, and three */
    }
}

/* --- the rest --------------------------------------------------------------------------------- */

/* Everything that the scheme has, along every axis and in every mirror; of the semi-implicit one
 * that is liquids, and bodies that stick. */
static void symmetry_partitioned(symmetry_world *w, int n)
{
    static const int walls[4][6] = {
        { 0, 1, 3, 0, 1, 0 }, { 1, 0, 0, 3, 0, 1 }, { 3, 1, 1, 0, 3, 0 }, { 0, 0, 1, 1, 1, 3 }
    };
    const double low[3] = { 1, 2, 1 };
    const int size[3] = { 5, 3, 4 };
    gs4_material m = scene_liquid(1000, n & 1 ? 20 : 0, n & 2 ? 10 : 0);
    gs4_sim_desc d =
        symmetry_box(8, 7, 7, n & 4 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4);
    gs4_collider c;
    int i;
    m.incompressible = !(n & 2);
    if (n >= 8) { /* heat: Fourier, Cattaneo and melting */
        m.heat_capacity = 1;
        m.conductivity = 500;
        m.viscous_heating = 1;
        m.flux_relaxation_time = (gs4_real)(n & 1 ? 0.05 : 0);
        m.fourier_fraction = (gs4_real)(n & 1 ? 0.3 : 0);
        m.can_melt = n / 2 & 1;
        m.melting_temperature = (gs4_real)(n & 2 ? 22 : 0);
        m.latent_heat = (gs4_real)(n & 2 ? 3 : 0);
        m.solid = n & 2 ? GS4_NEO_HOOKEAN : GS4_NO_SOLID;
        m.shear_modulus = (gs4_real)(n & 2 ? 500 : 0);
        d.air_is_isothermal = n & 1;
        d.ambient_temperature = 40;
    }
    d.scheme = partitioned_scheme;
    d.solver_max_iterations = partitioned_iterations;
    d.sharp_gradients = 0;
    d.solver_tolerance = (gs4_real)(sizeof(gs4_real) == 8 ? 1e-12 : 1e-8);
    for (i = 0; i < 6; i++) {
        d.walls[i] = (gs4_wall)walls[n % 4][i];
        d.wall_is_isothermal[i] = n >= 8 && d.walls[i] != GS4_WALL_OPEN && i % 2 == n / 4 % 2;
        d.wall_temperature[i] = (gs4_real)(d.wall_is_isothermal[i] ? 5 : 0);
    }
    memset(&c, 0, sizeof c);
    c.shape = symmetry_body(GS4_SHAPE_SPHERE);
    c.contact = n & 1 ? GS4_WALL_SLIP : GS4_WALL_STICK;
    c.velocity = at(0.2, 0.3, -0.2);
    c.angular_velocity = at(1, -2, 1.5);
    c.is_isothermal = n >= 8;
    c.temperature = (gs4_real)(n >= 8 ? 60 : 0);
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_add_collider(w, &c);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 0);
    symmetry_edit(w, symmetry_stir, n >= 8 ? symmetry_warm : NULL);
}

static void test_partitioned_symmetry(void)
{
    int n;
    /* in float the half in which dx/dt is kept rounds more than the check allows */
    if (sizeof(gs4_real) == 4) return;
    for (n = 0; n < 16; n++) symmetry_check("partitioned", symmetry_partitioned, n, 3);
}

/* Scenes of this file have a solid in them, too: of the next ones. */
static int partitioned_with_solid;

static void partitioned_add_solid(gs4_sim *sim, double y, double R)
{
    gs4_material m = scene_liquid(900, 0, 0);
    gs4_fill f = scene_fill(at(-0.3, -2, 0));
    if (!partitioned_with_solid) return;
    m.incompressible = 1;
    m.solid = GS4_FIXED_COROTATED;
    m.shear_modulus = 3000;
    f.material = gs4_add_material(sim, &m);
    CHECK(f.material >= 0
          && gs4_add_particles(sim, gs4_sphere(at(0.5, y, 0.45), (gs4_real)R), &f) > 0);
}

static gs4_sim *partitioned_splash(int threads)
{
    gs4_sim_desc d = partitioned_cube(16);
    gs4_material m = partitioned_liquid(5);
    gs4_fill f = scene_fill(at(0.5, -2, 0.3));
    gs4_collider c;
    gs4_sim *sim;
    memset(&c, 0, sizeof c);
    d.gravity = at(0, -10, 0);
    d.threads = threads;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    c.shape = gs4_sphere(at(0.5, 0, 0.5), (gs4_real)0.2);
    c.angular_velocity = at(0, 3, 0);
    gs4_add_collider(sim, &c);
    gs4_add_particles(sim, gs4_sphere(at(0.45, 0.5, 0.5), (gs4_real)0.22), &f);
    partitioned_add_solid(sim, 0.84, 0.14);
    return sim;
}

/* The same bits for any number of threads, and from a checkpoint; frames have its pressure. */
static void test_partitioned_bits(void)
{
    gs4_sim *a = partitioned_splash(1), *b = partitioned_splash(1);
    CHECK_RESULT(a, gs4_advance(a, (gs4_real)0.1), GS4_OK);
#ifdef GS4_PTHREADS
    gs4_destroy(b);
    b = partitioned_splash(3);
    CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.1), GS4_OK);
    CHECK(gs4_state_hash(a) == gs4_state_hash(b));
    gs4_destroy(b);
    b = partitioned_splash(1);
#endif
    CHECK_RESULT(a, gs4_save(a, "gs4mpm-test-partitioned.state"), GS4_OK);
    CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.02), GS4_OK); /* it has a past of its own */
    CHECK_RESULT(b, gs4_load(b, "gs4mpm-test-partitioned.state"), GS4_OK);
    remove("gs4mpm-test-partitioned.state");
    CHECK(gs4_state_hash(a) == gs4_state_hash(b));
    CHECK_RESULT(a, gs4_advance(a, (gs4_real)0.05), GS4_OK);
    CHECK_RESULT(b, gs4_advance(b, (gs4_real)0.05), GS4_OK);
    CHECK(gs4_state_hash(a) == gs4_state_hash(b));
    files_warm = 0;
    CHECK_RESULT(a, gs4_write_ply(a, files_path("a.ply")), GS4_OK);
    CHECK_RESULT(a, gs4_write_raw(a, files_path("a.npy")), GS4_OK);
    if (!partitioned_with_solid) files_check_ply(a, files_path("a.ply"));
    if (!partitioned_with_solid) files_check_npy(a, files_path("a.npy"));
    remove(files_path("a.ply"));
    remove(files_path("a.npy"));
    gs4_destroy(a);
    gs4_destroy(b);
}

/* Every allocation refused once, and all from it on: the step is refused, its state is as before,
 * and the next step is as if nothing had been. */
static uint64_t partitioned_scenario(files_memory *m, long fail_at, int from_there_on)
{
    gs4_sim_desc d = partitioned_cube(8);
    const gs4_material material = partitioned_liquid(5);
    gs4_fill f = scene_fill(at(0.5, -2, 0.3));
    gs4_sim *sim;
    uint64_t hash;
    int step;
    memset(m, 0, sizeof *m);
    m->fail_at = -1;
    d.gravity = at(0, -10, 0);
    d.allocator.alloc_fn = files_alloc;
    d.allocator.free_fn = files_free;
    d.allocator.user = m;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &material);
    gs4_add_particles(sim, gs4_sphere(at(0.45, 0.4, 0.5), (gs4_real)0.3), &f);
    partitioned_add_solid(sim, 0.8, 0.2);
    m->calls = 0;
    m->fail_at = fail_at;
    m->from_there_on = from_there_on;
    for (step = 0; step < 2; step++) {
        const uint64_t before = gs4_state_hash(sim);
        if (gs4_step(sim, (gs4_real)0.002) == GS4_OK) continue;
        CHECK(fail_at >= 0 && gs4_last_error(sim)[0] && gs4_state_hash(sim) == before);
        m->fail_at = -1;
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.002), GS4_OK);
    }
    hash = gs4_state_hash(sim);
    CHECK(gs4_get_stats(sim).memory_bytes == m->bytes);
    gs4_destroy(sim);
    CHECK(m->live == 0 && m->bytes == 0 && m->wrong == 0);
    return hash;
}

static void test_partitioned_memory(void)
{
    files_memory m;
    const uint64_t reference = partitioned_scenario(&m, -1, 0);
    const long calls = m.calls;
    long k;
    CHECK(calls > 20);
    for (k = 0; k < calls; k++) {
        CHECK(partitioned_scenario(&m, k, 0) == reference);
        CHECK(partitioned_scenario(&m, k, 1) == reference);
    }
}

/* What moves and turns in a closed box that is full takes no room: it stirs, at rest at first. The
 * integral of velocity over the box is that of x_i u n over its walls, 0: liquid and body move as
 * much against each other. Here, how far that is off; kernels reach into bodies, so with h. */
static double partitioned_stirs(int cells, int is_box, gs4_wall contact)
{
    const double volume = is_box ? 0.33 * 0.42 * 0.35 : 4 / 3.0 * 3.14159265 * 0.23 * 0.23 * 0.23;
    const gs4_sim_desc d = partitioned_cube(cells);
    const gs4_material m = partitioned_liquid(0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_collider c;
    double momentum;
    gs4_sim *sim;
    memset(&c, 0, sizeof c);
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    c.shape = is_box ? gs4_box(at(0.3, 0.3, 0.3), at(0.63, 0.72, 0.65))
                     : gs4_sphere(at(0.47, 0.52, 0.5), (gs4_real)0.23);
    c.pivot = at(0.47, 0.52, 0.5);
    c.contact = contact;
    c.velocity = at(0.1, 0.03, 0);
    c.angular_velocity = at(0.3, 0, 1);
    gs4_add_collider(sim, &c);
    CHECK(gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 2, 2)), &f) > 0);
    partitioned_steps(sim, 0.2, 20);
    momentum = gs4_get_stats(sim).momentum[0];
    gs4_destroy(sim);
    return momentum / ((double)m.density * volume * 0.1) + 1;
}

static void test_partitioned_stirs(void)
{
    int n;
    for (n = 0; n < 4; n++) {
        const gs4_wall contact = n & 2 ? GS4_WALL_STICK : GS4_WALL_SLIP;
        const double coarse = partitioned_stirs(8, n & 1, contact),
                     fine = partitioned_stirs(16, n & 1, contact);
        if (n & 2)
            CHECK_BETWEEN(fine / coarse, 0, 1);
        else
            CHECK_BETWEEN(fine, -0.25, 0.25);
    }
}

/* A ball that grows into a full box cannot be; into a soft one it can. */
static void test_partitioned_piston(void)
{
    int soft;
    for (soft = 0; soft < 2; soft++) {
        const gs4_sim_desc d = partitioned_cube(8);
        gs4_material m = partitioned_liquid(0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_collider c;
        gs4_sim *sim;
        int i, result = GS4_OK;
        m.incompressible = !soft;
        m.bulk_modulus = (gs4_real)(soft ? 1e5 : 0);
        memset(&c, 0, sizeof c);
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        c.shape = gs4_plane(at(0.5, 0.75, 0.5), at(0, -1, 0));
        c.contact = GS4_WALL_SLIP;
        c.velocity = at(0, -0.1, 0);
        gs4_add_collider(sim, &c);
        gs4_add_particles(sim, gs4_box(at(-1, -1, -1), at(2, 0.75, 2)), &f);
        for (i = 0; i < 10 && result == GS4_OK; i++) result = gs4_step(sim, (gs4_real)0.02);
        if (soft) {
            CHECK_RESULT(sim, result, GS4_OK);
            CHECK_CLOSE(gs4_get_stats(sim).volume, 0.75 - 0.02, 0.01);
        } else {
            CHECK_RESULT(sim, result, GS4_ERROR_UNSTABLE);
            CHECK(strstr(gs4_last_error(sim), "closed") != NULL);
        }
        gs4_destroy(sim);
    }
}

static void partitioned_refuses(gs4_sim_desc d, const char *what)
{
    gs4_sim *sim = NULL;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(NULL), what) != NULL);
    gs4_destroy(sim);
}

/* A column `length` long falls along `axis` between two sticky walls across `across`, 1 apart, with
 * both ends free: it flows as under a pressure gradient. The steady maximum is 1/4. At the time
 * t. */
static gs4_sim *partitioned_channel(int n, gs4_integrator integrator, int axis, int across,
                                    int length, const gs4_material *m, double t)
{
    gs4_sim_desc d = partitioned_cube(n);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    double low[3] = { 0, 0, 0 }, high[3], g[3] = { 0, 0, 0 };
    gs4_sim *sim;
    int c;
    for (c = 0; c < 3; c++) {
        d.cells[c] = c == across ? n : c == axis ? (length + 1) * n : 4;
        d.walls[2 * c] = d.walls[2 * c + 1] = c == across ? GS4_WALL_STICK
                                              : c == axis ? GS4_WALL_OPEN
                                                          : GS4_WALL_SLIP;
        high[c] = (double)d.cells[c] / n;
    }
    low[axis] = 0.5;
    high[axis] = length + 0.5;
    g[axis] = -2 * (double)m->viscosity / (double)m->density;
    d.gravity = at(g[0], g[1], g[2]);
    d.integrator = integrator;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, m), 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])),
                            &f)
          > 0);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)t), GS4_OK);
    return sim;
}

/* Start-up: error (2-norm) of the velocity in the middle of the column over the steady maximum,
 *     u = 4 y (1 - y) - sum 32/(pi k)^3 sin(k pi y) exp(-k^2 pi^2 nu t), k odd, y across. */
static double partitioned_startup(int n, gs4_integrator integrator, int axis, int across)
{
    const double nu = 0.5, t = 0.1, pi = acos(-1.0);
    const gs4_material m = partitioned_liquid(1000 * nu);
    gs4_sim *sim = partitioned_channel(n, integrator, axis, across, 3, &m, t);
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    double sum = 0;
    int i, k, count = 0;
    for (i = 0; i < x.count; i++) {
        const double y = (double)x.data[i * x.stride + across];
        double u = 4 * y * (1 - y);
        if (fabs((double)x.data[i * x.stride + axis] - 2) > 0.25) continue;
        for (k = 1; k < 60; k += 2)
            u -= 32 / pow(k * pi, 3) * sin(k * pi * y) * exp(-k * k * pi * pi * nu * t);
        u += 4 * (double)v.data[i * v.stride + axis];
        sum += u * u;
        count++;
    }
    gs4_destroy(sim);
    return sqrt(sum / count);
}

/* The same of an Oldroyd-B liquid with El = lambda mu/(rho (H/2)^2) = 1 and half of its viscosity
 * local, when it is fastest in the middle: over the steady speed 1.257863, at t mu/(rho (H/2)^2) =
 * 1.336052 (Waters & King; as in test_channel_overshoot). Over the exact one. */
static double partitioned_overshoot(int n, int axis, int across, int length)
{
    gs4_material m = partitioned_liquid(500);
    double s[5] = { 0, 0, 0, 0, 0 };
    gs4_view x, v;
    gs4_sim *sim;
    int i;
    m.liquid = GS4_OLDROYD_B;
    m.local_fraction = (gs4_real)0.5;
    m.relaxation_time = (gs4_real)0.5;
    sim = partitioned_channel(n, GS4_INTEGRATOR_GS4, axis, across, length, &m, 1.336052 * 0.5);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < x.count; i++) { /* u = u0 + c (y - 1/2)^2 */
        const double y = (double)x.data[i * x.stride + across] - 0.5,
                     u = -4 * (double)v.data[i * v.stride + axis];
        if (fabs(y) > 0.07 || fabs((double)x.data[i * x.stride + axis] - (length + 1) * 0.5) > 0.25)
            continue;
        s[0] += 1;
        s[1] += y * y;
        s[2] += y * y * y * y;
        s[3] += u;
        s[4] += u * y * y;
    }
    gs4_destroy(sim);
    return (s[3] * s[2] - s[4] * s[1]) / (s[0] * s[2] - s[1] * s[1]) / 1.257863;
}

/* Ends drag less, and flow is the same everywhere: what they add goes by 1/length, and is taken off
 * by two lengths. */
static void test_partitioned_channel(void)
{
    int axis, side, be;
    double first = 0, two[2];
    for (be = 0; be < 2; be++)
        for (axis = 0; axis < 3; axis++)
            for (side = 1; side < 3; side++) {
                const gs4_integrator how = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
                const int across = (axis + side) % 3;
                const double error = partitioned_startup(8, how, axis, across);
                double order;
                if (axis == 0 && side == 1) {
                    order = log2(error / partitioned_startup(16, how, axis, across));
                    first = error;
                    if (test_filter[0])
                        printf("channel, 8 cells: error %.4f, order %.2f\n", error, order);
                    CHECK_CLOSE(error, 0, 0.025);
                    CHECK_BETWEEN(order, 1.75, 2.1);
                }
                CHECK_CLOSE(error / first, 1, 1e-3);
            }
    for (axis = 0; axis < (test_slow ? 3 : 1); axis++) {
        for (side = 0; side < 2; side++)
            two[side] = partitioned_overshoot(16, axis, (axis + 1) % 3, 3 + 4 * side);
        if (test_filter[0]) printf("    Oldroyd-B, lengths 3 and 7: %.4f %.4f\n", two[0], two[1]);
        CHECK_CLOSE((7 * two[1] - 3 * two[0]) / 4, 1, 0.006);
    }
}

/* What none of the implicit schemes has. */
static void partitioned_check_refused(gs4_sim_desc fine)
{
    gs4_sim_desc d = fine;
    d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    partitioned_refuses(d, "integrator");
    d = fine;
    d.sharp_gradients = 1;
    partitioned_refuses(d, "sharp_gradients");
    d = fine;
    d.rho_inf = d.rho_inf_spurious = 1;
    partitioned_refuses(d, "rho_inf_spurious");
    d = fine;
    d.integrator = GS4_INTEGRATOR_BACKWARD_EULER;
    d.rho_inf = (gs4_real)0.5;
    partitioned_refuses(d, "rho_inf");
}

/* What it has not is refused with a sentence. */
static void test_partitioned_refusals(void)
{
    const gs4_sim_desc fine = partitioned_cube(8);
    gs4_material m = partitioned_liquid(0);
    gs4_collider c;
    gs4_sim *sim;
    partitioned_check_refused(fine);
    CHECK_RESULT(NULL, gs4_create(&fine, &sim), GS4_OK);
    m.bulk_modulus = 1000;
    CHECK_RESULT(sim, gs4_add_material(sim, &m), GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(sim), "incompressible") != NULL);
    memset(&c, 0, sizeof c);
    c.shape = gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.2);
    c.contact = GS4_WALL_SEPARATE;
    c.friction = (gs4_real)0.3;
    CHECK_RESULT(sim, gs4_add_collider(sim, &c), GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(sim), "friction") != NULL);
    gs4_destroy(sim);
}

/* After an edit of velocities, a filling that spins and a step that is refused, all is as it was:
 * pressures of particles, too. */
static void test_partitioned_refused_step(void)
{
    const gs4_sim_desc d = partitioned_cube(12);
    const gs4_material m = partitioned_liquid(1);
    gs4_fill f = scene_fill(at(0, 0, 0));
    static double before[8 * 12 * 12 * 12], after[8 * 12 * 12 * 12];
    gs4_sim *sim;
    uint64_t hash;
    int i, count;
    f.angular_velocity = at(0, 0, 1);
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    CHECK_RESULT(sim, gs4_set_gravity(sim, at(0, -10, 0)), GS4_OK);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(0.5, 0.5, 1)), &f) > 0);
    partitioned_steps(sim, 0.02, 10);
    CHECK(gs4_edit_particles(sim, GS4_FIELD_VELOCITY).count > 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.75, 0.5, 0.25), at(1, 1, 0.75)), &f) > 0);
    hash = gs4_state_hash(sim);
    scene_by_id(sim, GS4_FIELD_PRESSURE, before);
    CHECK(gs4_step(sim, 1000 * gs4_stable_dt(sim)) < 0);
    CHECK(gs4_state_hash(sim) == hash);
    /* found unstable within the step */
    sim->desc.solver_tolerance = (gs4_real)1e-12;
    sim->desc.solver_max_iterations = 1;
    CHECK(gs4_step(sim, gs4_stable_dt(sim)) < 0);
    CHECK(gs4_state_hash(sim) == hash);
    scene_by_id(sim, GS4_FIELD_PRESSURE, after);
    count = gs4_particles(sim, GS4_FIELD_PRESSURE).count;
    for (i = 0; i < count; i++) CHECK(before[i] == after[i]);
    CHECK(before[0] > 1000);
    gs4_destroy(sim);
}

/* The steps of a heavy solid are h/(2 c), c^2 = G/rho, also among light liquid: there is no sound
 * for which single heavy particles would swing faster. */
static void test_partitioned_heavy(void)
{
    const gs4_sim_desc d = partitioned_cube(16);
    const double limit = 0.5 / 16 / 10;
    gs4_material light = scene_liquid(1, 0, 0), heavy = partitioned_liquid(0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    light.incompressible = 1;
    heavy.solid = GS4_NEO_HOOKEAN;
    heavy.shear_modulus = 100000;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &light), 0);
    CHECK_RESULT(sim, gs4_add_material(sim, &heavy), 1);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(0.5, 0.5, 0.5)), &f) > 0);
    f.material = 1;
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0.75, 0), at(0.5, 1, 0.5)), &f) > 0);
    CHECK_CLOSE(gs4_stable_dt(sim), limit, 1e-5 * limit);
    gs4_destroy(sim);
}

/* A cube that holds `packing` times what fits, in flight; 20 steps. Its kinetic energy over that at
 * the start, at the end and at most; volume by the grid. */
typedef struct partitioned_flown {
    double energy, most, volume;
} partitioned_flown;

static partitioned_flown partitioned_packed(int be, double packing, double spin, int corrected)
{
    const double side = 8.0 / 20, squeeze = cbrt(packing);
    gs4_sim_desc d = partitioned_cube(20);
    const gs4_material m = partitioned_liquid(0);
    gs4_fill f = scene_fill(at(0.5, -0.3, 0.2));
    partitioned_flown out = { 0, 0, 0 };
    double start = 0;
    gs4_sim *sim;
    gs4_edit x;
    int i, a, n;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    d.integrator = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    f.angular_velocity = at(0, spin, spin);
    f.jitter = (gs4_real)0.3;
    gs4_add_particles(sim,
                      gs4_box(at(0.3, 0.3, 0.3),
                              at(0.3 + side * squeeze, 0.3 + side * squeeze, 0.3 + side * squeeze)),
                      &f);
    x = gs4_edit_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++)
        for (a = 0; a < 3; a++) {
            gs4_real *p = x.data + i * x.stride + a;
            *p = (gs4_real)(0.3 + ((double)*p - 0.3) / squeeze);
        }
    sim->staggered.without_correction = !corrected;
    for (n = 0; n <= 20; n++) {
        const gs4_view v = gs4_particles(sim, GS4_FIELD_VELOCITY);
        double sum = 0;
        for (i = 0; i < v.count; i++)
            for (a = 0; a < 3; a++) {
                const double u = (double)v.data[i * v.stride + a];
                sum += u * u;
            }
        if (!n) start = sum;
        out.energy = sum / start;
        out.most = fmax(out.most, out.energy);
        if (n < 20) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
    }
    out.volume = gs4_get_stats(sim).occupied_volume / pow(side, 3);
    gs4_destroy(sim);
    return out;
}

/* The correction of volume moves what is packed apart, and gives it no energy: none to rounding in
 * flight; where half of the energy is that of its spin, which falls, 0.5 % more or less is left. */
static void test_partitioned_correction(void)
{
    const double rounding = sizeof(gs4_real) == 8 ? 1e-12 : 1e-5;
    static const double packings[2] = { 1.15, 1.4 };
    int be, k;
    for (be = 0; be < 2; be++)
        for (k = 0; k < 2; k++) {
            partitioned_flown with = partitioned_packed(be, packings[k], 0, 1), without;
            CHECK_CLOSE(with.energy, 1, rounding);
            CHECK_CLOSE(with.most, 1, rounding);
            with = partitioned_packed(be, packings[k], 3, 1);
            without = partitioned_packed(be, packings[k], 3, 0);
            CHECK(with.most <= 1);
            CHECK_CLOSE(with.energy, without.energy, 5e-3);
            CHECK_BETWEEN(with.volume, packings[k], packings[k] + 0.08);
            CHECK_BETWEEN(without.volume, 0.95, 1.08);
        }
}

/* A solve that does not converge is said, and the state stays: also what a first step finds. */
static void test_partitioned_not_converged(void)
{
    gs4_sim_desc d = partitioned_cube(16);
    const gs4_material m = partitioned_liquid(0);
    gs4_fill f = scene_fill(at(0.3, -1, 0));
    gs4_sim *sim;
    gs4_edit v;
    uint64_t before;
    d.solver_max_iterations = 1;
    d.solver_tolerance = (gs4_real)1e-12;
    d.gravity = at(0, -1, 0);
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_sphere(at(0.5, 0.3, 0.5), (gs4_real)0.28), &f);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    v.data[0] = 2;
    before = gs4_state_hash(sim);
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.001), GS4_ERROR_NOT_CONVERGED);
    CHECK(strstr(gs4_last_error(sim), "converge") != NULL);
    CHECK(gs4_state_hash(sim) == before);
    gs4_destroy(sim);
}

static void run_partitioned(void)
{
    RUN_ONCE(test_partitioned_flight);
    RUN_ONCE(test_partitioned_rest);
    RUN_ONCE(test_partitioned_pressure);
    RUN_FULL(test_partitioned_bodies_at_rest);
    RUN_ONCE(test_partitioned_slope);
    RUN_FULL_ONCE(test_partitioned_ripples);
    RUN_FULL_ONCE(test_partitioned_sloshing);
    RUN_FULL(test_partitioned_vortex);
    RUN(test_partitioned_order);
    RUN_FULL_ONCE(test_partitioned_dam);
    RUN_FULL(test_partitioned_moduli);
    RUN_FULL_ONCE(test_partitioned_symmetry);
    RUN_FULL(test_partitioned_stirs);
    RUN(test_partitioned_piston);
    RUN_ONCE(test_partitioned_bits);
    RUN_FULL_ONCE(test_partitioned_memory);
    RUN_FULL(test_partitioned_correction);
    RUN(test_partitioned_not_converged);
    RUN_FULL_ONCE(test_partitioned_channel);
    RUN(test_partitioned_refusals);
    RUN(test_partitioned_refused_step);
    RUN(test_partitioned_heavy);
}
