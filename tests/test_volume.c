/* What a liquid occupies: gs4_stats.occupied_volume, and that flow does not change it. */

/* A lattice of n[0] x n[1] x n[2] particles, `spacing` apart, from `low` on, each of the volume
 * `own` at rest; of those that are beyond the end of a periodic axis, their place inside. */
static void volume_lattice(gs4_sim *sim, gs4_vec3 low, const int n[3], double spacing, double own)
{
    const gs4_sim_desc d = gs4_get_desc(sim);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const double from[3] = { (double)low.x, (double)low.y, (double)low.z };
    const int count = n[0] * n[1] * n[2];
    gs4_real *x = (gs4_real *)malloc(3 * (size_t)count * sizeof *x);
    int i, a;
    for (i = 0; i < count; i++) {
        const int k[3] = { i % n[0], i / n[0] % n[1], i / n[0] / n[1] };
        for (a = 0; a < 3; a++) {
            const double size = d.cells[a] * (double)d.cell_size,
                         p = from[a] + (k[a] + 0.5) * spacing;
            x[3 * i + a] =
                (gs4_real)(d.walls[2 * a] == GS4_WALL_PERIODIC && p >= size ? p - size : p);
        }
    }
    CHECK(gs4_add_points(sim, x, count, (gs4_real)own, &f) == count);
    free(x);
}

/* Blocks at all offsets from the grid, in the midst, against walls of each kind and across a
 * periodic seam, 6 % denser and 10 % sparser than at rest: each occupies what its lattice does. */
static void test_volume_of_blocks(void)
{
    static const double packing[3] = { 1, 1.06, 0.9 };
    static const gs4_wall walls[4] = { GS4_WALL_STICK, GS4_WALL_SLIP, GS4_WALL_SEPARATE,
                                       GS4_WALL_PERIODIC };
    const int n[3] = { 20, 14, 10 };
    const gs4_material m = scene_liquid(1000, 0.1, 10);
    int i;
    for (i = 0; i < 4 * 3 * 11; i++) {
        gs4_sim_desc d = scene_cube(20);
        const double h = 1.0 / 20, spacing = h / 2, exact = n[0] * n[1] * n[2] * pow(spacing, 3);
        const int wall = i % 4, seam = walls[wall] == GS4_WALL_PERIODIC;
        const double off = i / 12 * 0.1 * h;
        gs4_sim *sim;
        d.walls[0] = d.walls[1] = walls[wall];
        sim = physics_create(&d, &m);
        volume_lattice(sim,
                       at(seam     ? 15 * h + off
                          : i / 12 ? 4 * h + off
                                   : 0,
                          5 * h + 0.7 * off, 6 * h + off),
                       n, spacing, packing[i / 4 % 3] * pow(spacing, 3));
        CHECK_CLOSE(gs4_get_stats(sim).occupied_volume / exact, 1, 1e-5);
        gs4_destroy(sim);
    }
}

/* Balls of 12 cells across, as they are filled; spray and films thinner than a cell occupy what
 * they do at rest; nothing does nothing; what an edit threw out of the grid is not known. */
static void test_volume_of_others(void)
{
    const gs4_material m = scene_liquid(1000, 0.1, 10);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const double h = 1.0 / 24, exact = 4 * 3.14159265358979 / 3 * pow(6 * h, 3);
    const int film[3] = { 20, 1, 20 };
    gs4_sim_desc d = scene_cube(24);
    gs4_edit e;
    gs4_sim *sim;
    int i;
    for (i = 0; i < 10; i++) {
        sim = physics_create(&d, &m);
        CHECK(gs4_get_stats(sim).occupied_volume == 0);
        CHECK(
            gs4_add_particles(
                sim, gs4_sphere(at(12 * h + 0.1 * i * h, 12 * h + 0.03 * i * h, 12 * h), 6 * h), &f)
            > 0);
        CHECK_CLOSE(gs4_get_stats(sim).occupied_volume / exact, 1, 0.01);
        gs4_destroy(sim);
    }
    sim = physics_create(&d, &m);
    volume_lattice(sim, at(2 * h, 7.3 * h, 3 * h), film, h / 2, pow(h / 2, 3));
    CHECK_CLOSE(gs4_get_stats(sim).occupied_volume / (400 * pow(h / 2, 3)), 1, 1e-5);
    e = gs4_edit_particles(sim, GS4_FIELD_POSITION);
    e.data[0] = -1;
    CHECK(gs4_get_stats(sim).occupied_volume == -1);
    e.data[0] = (gs4_real)NAN;
    CHECK(gs4_get_stats(sim).occupied_volume == -1);
    gs4_destroy(sim);
}

/* A closed box full of a lattice at rest, of which the grid holds `packing` times as much as fits:
 * nothing can move, and J follows exactly: J~ - e decays at c/(200 h), e = 1.08/packing, at least
 * 0.9; below 1.08 nothing is done. */
static double volume_of_packed(gs4_integrator integrator, gs4_wall wall, double packing,
                               double share)
{
    const double h = 1.0 / 6, c = 10, k = c / (200 * h), steps = 40, dt = share / (k * steps);
    const int n[3] = { 12, 12, 12 };
    const gs4_material m = scene_liquid(1000, 0.1, c);
    gs4_sim_desc d = scene_cube(6);
    gs4_stats s;
    gs4_sim *sim;
    int i;
    for (i = 0; i < 6; i++) d.walls[i] = wall;
    d.integrator = integrator;
    sim = physics_create(&d, &m);
    volume_lattice(sim, at(0, 0, 0), n, h / 2, packing * pow(h / 2, 3));
    for (i = 0; i < (int)steps; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)dt), GS4_OK);
    s = gs4_get_stats(sim);
    CHECK_CLOSE(s.max_volume_ratio - s.min_volume_ratio, 0, 2e-6);
    CHECK_CLOSE(s.max_speed, 0, 1e-4);
    gs4_destroy(sim);
    return s.max_volume_ratio;
}

static void test_volume_of_packed(void)
{
    static const gs4_wall walls[3] = { GS4_WALL_SLIP, GS4_WALL_STICK, GS4_WALL_PERIODIC };
    int i;
    for (i = 0; i < 6; i++) {
        const gs4_integrator integrator = physics_integrators[i / 3];
        const double e = exp(-0.1), aim = 1.08 / 1.15;
        CHECK_CLOSE(volume_of_packed(integrator, walls[i % 3], 1.15, 0.1), aim + (1 - aim) * e,
                    1e-4);
        CHECK_CLOSE(volume_of_packed(integrator, walls[i % 3], 1.5, 0.1), 0.9 + 0.1 * e, 1e-4);
        CHECK_CLOSE(volume_of_packed(integrator, walls[i % 3], 1.075, 0.1), 1, 1e-6);
        CHECK_CLOSE(volume_of_packed(integrator, walls[i % 3], 0.9, 0.1), 1, 1e-6);
    }
}

/* A scene of a material of 1000 kg/m^3; another of `other`, of which nothing is there: where it is
 * 1 % denser volume is not corrected, and all else is the same. */
static gs4_sim *volume_scene(const gs4_sim_desc *d, double other)
{
    gs4_material m = scene_liquid(1000, 0.1, 10);
    gs4_sim *sim = physics_create(d, &m);
    m.density = (gs4_real)other;
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 1);
    return sim;
}

/* A packed box in which J falls; once volume is not corrected any more, it stays. */
static void test_volume_stops(void)
{
    const double h = 1.0 / 6;
    const int n[3] = { 12, 12, 12 };
    gs4_material m = scene_liquid(1000, 0.1, 10);
    gs4_sim_desc d = scene_cube(6);
    gs4_sim *sim;
    double before;
    int i;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_SLIP;
    d.flip_decay_time = (gs4_real)0.5;
    sim = physics_create(&d, &m);
    volume_lattice(sim, at(0, 0, 0), n, h / 2, 1.15 * pow(h / 2, 3));
    for (i = 0; i < 10; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
    m.density = 1100;
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 1);
    for (i = 0; i < 10; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
    before = gs4_get_stats(sim).max_volume_ratio;
    CHECK(before < 0.999);
    for (i = 0; i < 10; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
    CHECK_CLOSE(gs4_get_stats(sim).max_volume_ratio, before, 2e-6);
    gs4_destroy(sim);
}

/* Waves along x in a pool 10 cells deep and 24 wide, `u` at its surface; or a drop that turns. */
static gs4_sim *volume_smooth(gs4_integrator integrator, int drop, double u, double other)
{
    const double h = 0.005;
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim_desc d = scene_cube(24);
    gs4_sim *sim;
    gs4_view x;
    gs4_edit e;
    int i;
    d.cell_size = (gs4_real)h;
    d.integrator = integrator;
    d.gravity.y = (gs4_real)(drop ? 0 : -9.81);
    d.cells[2] = drop ? 24 : 4;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_SLIP;
    sim = volume_scene(&d, other);
    CHECK(gs4_add_particles(sim,
                            drop ? gs4_sphere(at(12.2 * h, 12.1 * h, 12 * h), 6 * h)
                                 : gs4_box(at(0, 0, 0), at(24 * h, 10 * h, 4 * h)),
                            &f)
          > 0);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < e.count; i++) {
        const double q = 3.14159265358979 / 24, X = (double)x.data[i * x.stride] / h,
                     Y = (double)x.data[i * x.stride + 1] / h;
        gs4_real *v = e.data + i * e.stride;
        v[0] = (gs4_real)(u * (drop ? (12.1 - Y) / 6 : sin(q * X) * cosh(q * Y) / cosh(q * 10)));
        v[1] = (gs4_real)(u * (drop ? (X - 12.2) / 6 : -cos(q * X) * sinh(q * Y) / cosh(q * 10)));
    }
    return sim;
}

/* A drop in free flight, a pool at rest and waves in it have the same bits as without VOLUME. */
static void test_volume_of_smooth_flow(void)
{
    int i, k;
    for (i = 0; i < 6; i++) {
        const double u = i / 2 == 1 ? 0 : 0.1;
        gs4_sim *with = volume_smooth(physics_integrators[i % 2], i / 2 == 0, u, 1000),
                *none = volume_smooth(physics_integrators[i % 2], i / 2 == 0, u, 1100);
        const gs4_real dt = 0.5f * gs4_stable_dt(with);
        for (k = 0; k < (test_full ? 300 : 30); k++) {
            CHECK_RESULT(with, gs4_step(with, dt), GS4_OK);
            CHECK_RESULT(none, gs4_step(none, dt), GS4_OK);
        }
        for (k = 0; k < 3; k++) {
            static const gs4_field fields[3] = { GS4_FIELD_POSITION, GS4_FIELD_VELOCITY,
                                                 GS4_FIELD_VOLUME_RATIO };
            const gs4_view a = gs4_particles(with, fields[k]), b = gs4_particles(none, fields[k]);
            int n, c, same = a.count == b.count;
            for (n = 0; n < a.count; n++)
                for (c = 0; c < a.components; c++)
                    same &= a.data[n * a.stride + c] == b.data[n * b.stride + c];
            CHECK(same);
        }
        gs4_destroy(with);
        gs4_destroy(none);
    }
}

/* A block of 9^3 cells that turns and flies along z, 1.1 times as much as fits there. */
static gs4_sim *volume_swelling(gs4_integrator integrator, double other)
{
    const double h = 0.01;
    const int n[3] = { 18, 18, 18 };
    gs4_sim_desc d = scene_cube(18);
    gs4_sim *sim;
    gs4_edit e;
    gs4_view x;
    int i;
    d.cell_size = (gs4_real)h;
    d.integrator = integrator;
    sim = volume_scene(&d, other);
    volume_lattice(sim, at(4.5 * h, 4.7 * h, 3.4 * h), n, h / 2, 1.1 * pow(h / 2, 3));
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < e.count; i++) {
        e.data[i * e.stride] = 4 * ((gs4_real)(9.2 * h) - x.data[i * x.stride + 1]);
        e.data[i * e.stride + 1] = 4 * (x.data[i * x.stride] - (gs4_real)(9 * h));
        e.data[i * e.stride + 2] = (gs4_real)0.05;
    }
    return sim;
}

/* It swells by 1 % in a radian of free flight: its momentum stays to rounding, and the moment of
 * that within 1e-3 of what it is where nothing swells. */
static void test_volume_momentum(void)
{
    const double exact = sizeof(gs4_real) == 8 ? 1e-9 : 2e-5;
    int i, k, c;
    for (i = 0; i < 2; i++) {
        double turns[2] = { 0, 0 }, swells[2] = { 0, 0 };
        for (k = 0; k < 2; k++) {
            gs4_sim *sim = volume_swelling(physics_integrators[i], k ? 1000 : 1100);
            const gs4_stats before = gs4_get_stats(sim);
            gs4_stats after;
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.25), GS4_OK);
            after = gs4_get_stats(sim);
            for (c = 0; c < 3; c++)
                CHECK_CLOSE((after.momentum[c] - before.momentum[c]) / before.mass, 0, exact);
            turns[k] = after.angular_momentum[2] / before.angular_momentum[2];
            swells[k] = after.occupied_volume / before.occupied_volume;
            gs4_destroy(sim);
        }
        CHECK_CLOSE(turns[1], turns[0], 1e-3);
        CHECK(swells[0] < 1.001 && swells[1] > 1.006 && swells[1] < 1.02);
        if (test_filter[0])
            printf("integrator %d: moment %.5f, volume %.4f; without correction %.5f, %.4f\n", i,
                   turns[1], swells[1], turns[0], swells[0]);
    }
}

/* Kinetic energy, weight along `axis` and what compression (3) holds, over the mass: c^2/7 (J^-6/6
 * + J - 7/6). */
static double volume_energy(const gs4_sim *sim, int axis, double c)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY),
                   ratio = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO);
    double sum = 0;
    int i, a;
    for (i = 0; i < x.count; i++) {
        const double J = (double)ratio.data[i * ratio.stride];
        sum +=
            9.81 * (double)x.data[i * x.stride + axis] + c * c / 7 * (pow(J, -6) / 6 + J - 7.0 / 6);
        for (a = 0; a < 3; a++)
            sum += 0.5 * (double)v.data[i * v.stride + a] * (double)v.data[i * v.stride + a];
    }
    return sum / x.count;
}

/* Time goes on; energy never gains by more than 1e-3 of it. */
static void volume_advance(gs4_sim *sim, int axis, double time)
{
    double least = volume_energy(sim, axis, 10);
    int i, gains = 0;
    for (i = 0; i < 8; i++) {
        double now;
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)(time / 8)), GS4_OK);
        now = volume_energy(sim, axis, 10);
        gains |= now > 1.001 * least;
        least = fmin(least, now);
    }
    CHECK(!gains);
}

typedef struct volume_case {
    gs4_wall wall;
    int axis, per_cell, size[3], wide; /* of gravity; a row; along, up, across; of the column */
    double high;
    int kicks;
    double rest; /* s */
} volume_case;

/* A tank with gravity along `axis`: a column of `wide` cells of its length and `high` cells,
 * kicked along another axis again and again, or let fall. At the end it rests; the height of its
 * centre of mass over that of a full tank of its volume is to be 1 within 2 %. */
static void volume_after(gs4_integrator integrator, volume_case of)
{
    const double h = 0.005, spacing = h / of.per_cell;
    const int along = (of.axis + 1) % 3, across = (of.axis + 2) % 3;
    const gs4_material m = scene_liquid(1000, 0.1, 10);
    gs4_real g[3] = { 0, 0, 0 };
    double sum = 0;
    int n[3], i, k;
    gs4_sim_desc d = scene_cube(4);
    gs4_sim *sim;
    gs4_view x;
    d.cell_size = (gs4_real)h;
    d.cells[of.axis] = of.size[1];
    d.cells[along] = of.size[0];
    d.cells[across] = of.size[2];
    for (i = 0; i < 6; i++) d.walls[i] = of.wall;
    d.integrator = integrator;
    g[of.axis] = (gs4_real)-9.81;
    d.gravity.x = g[0];
    d.gravity.y = g[1];
    d.gravity.z = g[2];
    sim = physics_create(&d, &m);
    n[of.axis] = (int)floor(of.high * of.per_cell + 0.5);
    n[along] = of.wide * of.per_cell;
    n[across] = of.size[2] * of.per_cell;
    volume_lattice(sim, at(0, 0, 0), n, spacing, pow(spacing, 3));
    for (k = 0; k < of.kicks; k++) {
        gs4_edit e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (i = 0; i < e.count; i++)
            e.data[i * e.stride + along] += (gs4_real)(k & 1 ? -0.8 : 0.8);
        volume_advance(sim, of.axis, 0.4);
    }
    volume_advance(sim, of.axis, of.rest);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < x.count; i++) sum += (double)x.data[i * x.stride + of.axis];
    /* of the rows that there are: `high` may be no whole number of them */
    sum /= x.count * (n[of.axis] * spacing * of.wide / of.size[0] / 2);
    CHECK_CLOSE(sum, 1, 0.02);
    if (test_filter[0])
        printf(
            "%s, wall %d, axis %d, %d^3 a cell, %g high, %d kicks: depth %.4f, by the grid %.4f\n",
            integrator == GS4_INTEGRATOR_GS4 ? "GS4" : "Euler", (int)of.wall, of.axis, of.per_cell,
            of.high, of.kicks, sum,
            gs4_get_stats(sim).occupied_volume * 1000 / gs4_get_stats(sim).mass);
    gs4_destroy(sim);
}

static void test_volume_after_flow(void)
{
    static const volume_case kicks = { GS4_WALL_SLIP, 1, 2, { 12, 16, 4 }, 12, 6, 16, 1 },
                             fall = { GS4_WALL_SLIP, 1, 2, { 24, 20, 6 }, 8, 16, 0, 5 };
    volume_case of = kicks;
    int k;
    volume_after(physics_integrators[0], kicks);
    volume_after(physics_integrators[0], fall);
    if (!test_slow) return;
    for (k = 0; k < 2; k++) volume_after(physics_integrators[1], k ? fall : kicks);
    of.wall = GS4_WALL_STICK;
    for (k = 0; k < 2; k++) volume_after(physics_integrators[k], of);
    of = kicks;
    for (k = 0; k < 4; k++) {
        of.axis = k % 3;
        of.high = 6 + k * 0.25;
        volume_after(physics_integrators[0], of);
    }
    of = kicks;
    of.per_cell = 3;
    volume_after(physics_integrators[0], of);
    of = kicks;
    of.kicks = 100;
    of.rest = 60;
    volume_after(physics_integrators[0], of);
    volume_after(physics_integrators[1], of);
}

static void run_volume(void)
{
    RUN(test_volume_of_blocks);
    RUN(test_volume_of_others);
    RUN_FULL(test_volume_of_packed);
    RUN(test_volume_stops);
    RUN_FULL_ONCE(test_volume_of_smooth_flow);
    RUN_FULL(test_volume_momentum);
    RUN_FULL_ONCE(test_volume_after_flow);
}
