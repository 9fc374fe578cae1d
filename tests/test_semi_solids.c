/* Solids under the semi-implicit scheme: their stress is in the solve. */

/* Spheres of R cells ring in steps of w_dt/w, see surface_ring_of. */
static double semi_solids_ring(int R, int spheroidal, int a, double w_dt, double rho, int periods,
                               double *frequency)
{
    gs4_material m = scene_liquid(1, 0, 0);
    gs4_sim *sim;
    m.incompressible = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1;
    sim = surface_sphere(&m, GS4_SEMI_IMPLICIT, R, spheroidal, a);
    sim->desc.rho_inf = (gs4_real)rho;
    return surface_ring_of(sim, R, spheroidal, a, (int)(2 * 3.14159265358979 / w_dt + 0.5), periods,
                           frequency);
}

/* The member (0, 0) itself is (w dt)^2/3 low, (1, 0) by a quarter of that. */
static void test_semi_solids_ring(void)
{
    double frequency;
    int n;
    for (n = 0; n < 4; n++) {
        const int spheroidal = n & 1;
        const double rho = n / 2;
        CHECK_BETWEEN(semi_solids_ring(8, spheroidal, n % 3, 0.2, rho, 1, &frequency), 0.9, 1.005);
        CHECK_CLOSE(frequency, 1, rho > 0 ? 0.03 : 0.04);
    }
    for (n = 0; n < 2 && test_slow; n++) {
        CHECK_BETWEEN(semi_solids_ring(12, n, 2, 0.2, 0, 1, &frequency), 0.9, 1.005);
        CHECK_CLOSE(frequency, 1, 0.03);
    }
}

/* Kelvin-Voigt: viscosity damps the torsional mode of a sphere, v'' + 2 z w v' + w^2 v = 0 with
 * z w = nu k^2/2, whose v is least, -exp(-z T), at T = (pi - 2 asin z)/sqrt(1 - z^2), in 1/w. */
static void test_semi_solids_kelvin(void)
{
    const double k = surface_wave_number[0], w = k, pi = 3.14159265358979, z = 0.1,
                 least = -exp(-z * (pi - 2 * asin(z)) / sqrt(1 - z * z));
    const int steps = 63;
    gs4_material m = scene_liquid(1, 0, 0);
    double amplitude[2] = { 0, 0 };
    int n, i;
    m.incompressible = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1;
    for (n = 0; n < 2; n++) {
        gs4_sim *sim;
        m.viscosity = (gs4_real)(n * 2 * z / k);
        sim = surface_sphere(&m, GS4_SEMI_IMPLICIT, 8, 0, 1);
        sim->desc.rho_inf = 1;
        for (i = 0; i < steps / 2 + 2; i++) {
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(2 * pi / w / steps)), GS4_OK);
            amplitude[n] = fmin(amplitude[n], surface_share(sim, 8, 0, 1));
        }
        gs4_destroy(sim);
    }
    if (test_filter[0])
        printf("least %.4f of that without, exact %.4f\n", amplitude[1] / amplitude[0], -least);
    CHECK_CLOSE(log(amplitude[1] / amplitude[0]) / log(-least), 1, 0.03);
}

/* A slab of n cells between two sticky walls hangs in a box that is periodic along them, in long
 * steps of backward Euler: a shear of rho g (y - H/2)/G at rest; its moment about the middle over
 * the exact one. */
static double semi_solids_slab(int n, int across, int along)
{
    const double G = 100, g = 12;
    gs4_sim_desc d = semi_cube(n);
    gs4_material m = scene_liquid(1, 0, 0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double fall[3] = { 0, 0, 0 }, exact = 0, moment = 0;
    gs4_sim *sim;
    gs4_view x, F;
    int i;
    m.incompressible = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = (gs4_real)G;
    d.integrator = GS4_INTEGRATOR_BACKWARD_EULER;
    d.solver_tolerance = 0;
    fall[along] = g;
    d.gravity = at(fall[0], fall[1], fall[2]);
    for (i = 0; i < 6; i++) d.walls[i] = i / 2 == across ? GS4_WALL_STICK : GS4_WALL_PERIODIC;
    for (i = 0; i < 3; i++)
        if (i != across) d.cells[i] = 8;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f) > 0);
    for (i = 0; i < 16; i++)
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.9 * (double)gs4_stable_dt(sim))), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    F = gs4_particles(sim, GS4_FIELD_DEFORMATION);
    for (i = 0; i < x.count; i++) {
        const double y = (double)x.data[i * x.stride + across] - 0.5;
        exact += y * y * g / G;
        moment -= y * (double)F.data[i * F.stride + 3 * along + across];
    }
    CHECK_BETWEEN(gs4_get_stats(sim).max_speed, 0, 1e-3);
    gs4_destroy(sim);
    if (test_filter[0])
        printf("%d cells across %d, along %d: %.4f of the exact\n", n, across, along,
               moment / exact);
    return moment / exact;
}

/* Walls hold solids to second order: 3.5 % at 8 cells. */
static void test_semi_solids_walls(void)
{
    int across;
    for (across = 0; across < 3; across++) {
        const double coarse = semi_solids_slab(8, across, (across + 1) % 3);
        CHECK_CLOSE(coarse, 1, 0.04);
        if (!test_slow) continue;
        CHECK_CLOSE(semi_solids_slab(8, across, (across + 2) % 3), coarse, 0.001);
        CHECK_BETWEEN((coarse - 1) / (semi_solids_slab(16, across, (across + 1) % 3) - 1), 3.5,
                      4.5);
    }
}

/* --- order in time ---------------------------------------------------------------------------- */

/* What two halvings of `steps` change of x, v and F of an elastic drop that strains and turns. */
static void semi_solids_order(const gs4_material *m, double rho, gs4_integrator how, int steps,
                              double change[3][2])
{
    static semi_elastic_run run[3];
    static double F[3][9 * SEMI_ELASTIC_MOST];
    int k, n = 0;
    for (k = 0; k < 3; k++) {
        gs4_sim_desc d = semi_cube(16);
        gs4_sim *sim;
        d.integrator = how;
        d.rho_inf = (gs4_real)rho;
        d.solver_tolerance = (gs4_real)1e-11;
        sim = partitioned_strained(d, m, 0.24);
        n = gs4_particles(sim, GS4_FIELD_POSITION).count;
        CHECK(n > 1000 && n < SEMI_ELASTIC_MOST);
        partitioned_steps(sim, 0.008, steps << k);
        scene_by_id(sim, GS4_FIELD_POSITION, run[k].x);
        scene_by_id(sim, GS4_FIELD_VELOCITY, run[k].v);
        scene_by_id(sim, GS4_FIELD_DEFORMATION, F[k]);
        gs4_destroy(sim);
    }
    for (k = 0; k < 2; k++) {
        change[0][k] = partitioned_apart(run[k].x, run[k + 1].x, 3 * n);
        change[1][k] = partitioned_apart(run[k].v, run[k + 1].v, 3 * n);
        change[2][k] = partitioned_apart(F[k], F[k + 1], 9 * n);
    }
    if (test_filter[0])
        printf("G %g, rho %g, integrator %d: order of x %.2f, of v %.2f, of F %.2f; changes %.1e "
               "%.1e %.1e\n",
               (double)m->shear_modulus, rho, (int)how, log2(change[0][0] / change[0][1]),
               log2(change[1][0] / change[1][1]), log2(change[2][0] / change[2][1]), change[0][1],
               change[1][1], change[2][1]);
}

static void test_semi_solids_order(void)
{
    static const double rho[3] = { 0, 0.5, 1 };
    double gs4[3][2], be[3][2];
    int n, k;
    gs4_material m = scene_liquid(1, 0, 0);
    if (sizeof(gs4_real) == 4) return; /* rounding is more than these errors */
    m.incompressible = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 100; /* c dt/h = .04 and less */
    for (n = 2; n >= 0; n--) {
        semi_solids_order(&m, rho[n], GS4_INTEGRATOR_GS4, 32, gs4);
        for (k = 0; k < 3; k++) CHECK_BETWEEN(log2(gs4[k][0] / gs4[k][1]), 1.9, 2.1);
    }
    /* its change from 64 steps to 128 is that of `gs4` from there on */
    semi_solids_order(&m, 0, GS4_INTEGRATOR_BACKWARD_EULER, 64, be);
    for (k = 0; k < 3; k++) CHECK_BETWEEN(log2(be[k][0] / be[k][1]), 0.9, 1.1);
    CHECK_BETWEEN(2 * be[0][0] / (4.0 / 3 * gs4[0][1]), 15, 1000);
    CHECK_BETWEEN(2 * be[1][0] / (4.0 / 3 * gs4[1][1]), 10, 1000);
}

/* --- large steps, walls and bodies ------------------------------------------------------------ */

static void test_semi_solids_beams(void)
{
    semi_check(test_partitioned_solids_energy);
    semi_check(test_partitioned_solids_seam);
}

/* Its energy, height and the most of det F/J of a solid over a floor along axis a. */
static double semi_solids_energy(gs4_sim *sim, const gs4_material *m, int a, double g,
                                 double *height, double *least)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const gs4_stats s = gs4_get_stats(sim);
    int i;
    for (*height = 0, i = 0; i < x.count; i++)
        *height += (double)x.data[i * x.stride + a] / x.count;
    solid_worst_volume(sim, least);
    return s.kinetic_energy + solid_elastic_energy(sim, m) + s.mass * g * *height;
}

/* A cube of 1e8 Pa, cells of 1 cm, falls on floors in steps of 1/240 s: free fall is exact to
 * rounding, it loses energy alone, and stays what it is. The member (1/2, 0) lets it bounce, (0, 0)
 * hardly. */
static void test_semi_solids_stiff(void)
{
    static const gs4_wall floors[3] = { GS4_WALL_SLIP, GS4_WALL_STICK, GS4_WALL_SEPARATE };
    int n, k, i;
    for (n = 0; n < (test_slow ? 12 : 3); n++) {
        const int a = n % 3, solves = n & 1;
        const double g = 9.81, dt = 1.0 / 240;
        gs4_sim_desc d = semi_cube(20);
        gs4_material m = scene_liquid(1000, 0, 0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        double low[3] = { 0.07, 0.07, 0.07 }, fall[3] = { 0, 0, 0 }, start, first, most = 0,
               energy = 0, height, least, worst = 1, bounce = 0, lowest = 1;
        int steps = 0, cycles = 0;
        gs4_sim *sim;
        m.solid = n & 2 ? GS4_FIXED_COROTATED : GS4_NEO_HOOKEAN;
        m.shear_modulus = (gs4_real)1e8;
        m.incompressible = solves;
        m.bulk_modulus = (gs4_real)(solves ? 0 : 1e9);
        d.cell_size = (gs4_real)0.01;
        d.solver_tolerance = 0;
        d.rho_inf = (gs4_real)(solves ? 0 : 0.5);
        fall[a] = -g;
        d.gravity = at(fall[0], fall[1], fall[2]);
        for (i = 0; i < 6; i++) d.walls[i] = i == 2 * a ? floors[n / 4 % 3] : GS4_WALL_OPEN;
        low[a] = 0.05;
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        CHECK(gs4_add_particles(sim,
                                gs4_box(at(low[0], low[1], low[2]),
                                        at(low[0] + 0.06, low[1] + 0.06, low[2] + 0.06)),
                                &f)
              > 0);
        first = semi_solids_energy(sim, &m, a, g, &start, &least);
        for (k = 0; k < 60; k++) {
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)dt), GS4_OK);
            energy = semi_solids_energy(sim, &m, a, g, &height, &least);
            most = fmax(most, energy / first);
            worst = fmin(worst, least);
            lowest = fmin(lowest, height);
            if (height > lowest) bounce = fmax(bounce, height - lowest);
            steps++;
            cycles += gs4_get_stats(sim).elastic_iterations;
            if (k == 14)
                CHECK_CLOSE(start - height, g * 15 * 15 * dt * dt / 2, SOLID_DOUBLE ? 1e-9 : 1e-5);
        }
        if (test_filter[0])
            printf("axis %d, model %d, floor %d, rho %.1f: energy at most %.6f, at last %.4f, "
                   "bounces %.4f, least det F/J %.6f, %.1f solves a step\n",
                   a, (int)m.solid, (int)floors[n / 4 % 3], (double)d.rho_inf, most, energy / first,
                   bounce / (start - lowest), worst, (double)cycles / steps);
        CHECK_BETWEEN(most, 0.99, 1 + (SOLID_DOUBLE ? 1e-9 : 2e-5));
        CHECK_BETWEEN(worst, 0.99, 1.01);
        CHECK_BETWEEN(cycles, 60, 600);
        CHECK_BETWEEN(lowest, 0.0275, 0.046);
        gs4_destroy(sim);
    }
}

/* A stiff cube of 8 cells turns in flight about axis a, by 0.05 a step: kinetic energy over the
 * first, at least and at most, and how far the distances of its particles from its middle change,
 * in cells. */
static void semi_solids_turn(const gs4_material *m, int a, double jitter, int steps, double out[3])
{
    static double first[3 * 8192], last[3 * 8192];
    const double h = 0.01, dt = 0.005;
    double turn[3] = { 0, 0, 0 }, start = 0, moved;
    gs4_sim_desc d = semi_cube(24);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    int i, k, count;
    d.cell_size = (gs4_real)h;
    d.solver_tolerance = 0;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, m);
    f.jitter = (gs4_real)jitter;
    turn[a] = 10;
    f.angular_velocity = at(turn[0], turn[1], turn[2]);
    count = gs4_add_particles(sim, gs4_box(at(0.08, 0.08, 0.08), at(0.16, 0.16, 0.16)), &f);
    CHECK(count == 4096);
    scene_by_id(sim, GS4_FIELD_POSITION, first);
    out[0] = out[1] = 1;
    out[2] = 0;
    for (k = 0; k <= steps; k++) {
        const double energy = gs4_get_stats(sim).kinetic_energy;
        if (!k) start = energy;
        out[0] = fmin(out[0], energy / start);
        out[1] = fmax(out[1], energy / start);
        if (k < steps) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)dt), GS4_OK);
    }
    scene_by_id(sim, GS4_FIELD_POSITION, last);
    gs4_destroy(sim);
    for (i = 0; i < count; i++) {
        double was = 0, is = 0;
        for (k = 0; k < 3; k++) {
            was += pow(first[3 * i + k] - 0.12, 2);
            is += pow(last[3 * i + k] - 0.12, 2);
        }
        moved = fabs(sqrt(is) - sqrt(was)) / h;
        out[2] = fmax(out[2], moved);
    }
}

/* Rigid motion costs hardly any energy, however stiff it is: elastic waves go 16 and 160 cells a
 * step. Where faces beyond its edges went on from one face without a slope they resisted the turn,
 * and it lost 25 % within half a radian; where those of three layers did alone, 0.5 % at 1e8 Pa.
 * Finite K, of which acc is not split, costs 0.6 % a quarter turn, by the step, whatever G. */
static void test_semi_solids_turn(void)
{
    int n;
    for (n = 0; n < (TEST_FULL_ONCE ? 6 : 1); n++) {
        const int a = (n + 2) % 3, steps = test_full ? 32 : 8;
        gs4_material m = scene_liquid(1000, 0, 0);
        double out[3];
        m.solid = n & 2 ? GS4_FIXED_COROTATED : GS4_NEO_HOOKEAN;
        m.shear_modulus = (gs4_real)(n < 3 ? 1e6 : 1e8);
        m.incompressible = n != 1;
        m.bulk_modulus = (gs4_real)(n == 1 ? 1e7 : 0);
        semi_solids_turn(&m, a, n % 2 * 0.3, steps, out);
        if (test_filter[0])
            printf("axis %d, G %g, K %g, jitter %g: energy %.5f to %.5f, moved %.5f cells\n", a,
                   (double)m.shear_modulus, (double)m.bulk_modulus, n % 2 * 0.3, out[0], out[1],
                   out[2]);
        CHECK_BETWEEN(out[0], m.incompressible ? 0.998 : 0.993, 1);
        CHECK_BETWEEN(out[1], 1, 1.002);
        CHECK_BETWEEN(out[2], 0, 0.01);
    }
}

/* Plates of 1 to 2 cells that turn and land, wherever they cut cells: every step is taken, in
 * about the iterations of a cube, and none gains energy. Where the preconditioner had no rows at
 * their surfaces, it let them bend for nothing, and no solve converged; where faces beyond a single
 * layer went on without slope, one that turned lost or gained most of its energy in a step; and
 * where only what is full is solved for, one of a cell that lies astride two falls as spray. */
static void test_semi_solids_thin(void)
{
    static const double thick[3] = { 1.5, 1.6, 2 }, off[3] = { 0.37, 0, 0.8 },
                        off_thin[3] = { 0.5, 0, 0.8 };
    const double h = 0.01, g = 9.81;
    int n, k;
    for (n = 0; n < (test_slow ? 24 : test_full ? 8 : 1); n++) {
        const int a = n % 3, is_thin = n % 4 == 3;
        gs4_sim_desc d = semi_cube(24);
        gs4_material m = scene_liquid(1000, 0, 0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        double low[3] = { 6 * h, 6 * h, 6 * h }, high[3] = { 18 * h, 18 * h, 18 * h },
               v[3] = { 0, 0, 0 }, fall[3] = { 0, 0, 0 }, first, most = 0, height, least, worst = 1;
        int iterations = 0;
        gs4_sim *sim;
        m.solid = n & 1 ? GS4_FIXED_COROTATED : GS4_NEO_HOOKEAN;
        m.shear_modulus = (gs4_real)(n / 3 % 2 ? 1e6 : 1e8);
        m.incompressible = 1;
        d.cell_size = (gs4_real)h;
        fall[a] = -g;
        d.gravity = at(fall[0], fall[1], fall[2]);
        for (k = 0; k < 6; k++) d.walls[k] = k == 2 * a ? GS4_WALL_STICK : GS4_WALL_OPEN;
        low[a] = (2.5 + (is_thin ? off_thin[n / 4 % 3] : off[n / 3 % 3])) * h;
        high[a] = low[a] + (is_thin ? 1 : thick[(n + n / 3) % 3]) * h;
        v[a] = -0.5;
        f.velocity = at(v[0], v[1], v[2]);
        v[a] = 0;
        v[(a + 1) % 3] = 4;
        f.angular_velocity = at(v[0], v[1], v[2]);
        f.jitter = (gs4_real)0.3;
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        CHECK(gs4_add_particles(
                  sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])), &f)
              > 0);
        first = semi_solids_energy(sim, &m, a, g, &height, &least);
        for (k = 0; k < 16; k++) {
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(1.0 / 240)), GS4_OK);
            most = fmax(most, semi_solids_energy(sim, &m, a, g, &height, &least) / first);
            worst = fmin(worst, least);
            iterations += gs4_get_stats(sim).viscous_iterations;
        }
        if (test_filter[0])
            printf("normal %d, %g cells, G %g: energy at most %.5f, least det F/J %.5f, %.1f "
                   "iterations a step\n",
                   a, (high[a] - low[a]) / h, (double)m.shear_modulus, most, worst,
                   iterations / 16.0);
        CHECK_BETWEEN(most, 0.5, 1.0001); /* 0.002 a turn, of which it makes 1/23 */
        CHECK_BETWEEN(worst, 0.99, 1.01);
        CHECK_BETWEEN(iterations / 16.0, 10,
                      (SOLID_DOUBLE ? 400 : 150) * (is_thin ? 1.5 : 1)); /* half as many again */
        gs4_destroy(sim);
    }
}

/* A ball 7 cells across falls through a gap of 5.6 between slippery bodies: it gets through, and
 * never has more than its energy. */
static void test_semi_solids_gap(void)
{
    int n, k;
    for (n = 0; n < (test_slow ? 6 : 1); n++) {
        const int a = (n + 1) % 3, b = (a + 1) % 3; /* down, and across the gap */
        const double g = 10;
        gs4_sim_desc d = semi_cube(16);
        gs4_material m = scene_liquid(1000, 0, 0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        double p[3] = { 0.5, 0.5, 0.5 }, fall[3] = { 0, 0, 0 }, first, most = 0, height, least,
               worst = 1;
        gs4_sim *sim;
        m.solid = n & 1 ? GS4_FIXED_COROTATED : GS4_NEO_HOOKEAN;
        m.shear_modulus = (gs4_real)1e4;
        m.incompressible = 1;
        d.cells[a] = 32;
        d.solver_tolerance = 0;
        fall[a] = -g;
        d.gravity = at(fall[0], fall[1], fall[2]);
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        p[a] = 1.4;
        CHECK(gs4_add_particles(sim, gs4_sphere(at(p[0], p[1], p[2]), (gs4_real)0.22), &f) > 0);
        for (k = 0; k < 2; k++) {
            gs4_collider c;
            double low[3] = { -1, -1, -1 }, high[3] = { 2, 2, 2 };
            memset(&c, 0, sizeof c);
            low[a] = 0.7;
            high[a] = 0.95;
            (k ? low : high)[b] = k ? 0.675 : 0.325;
            c.shape = gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]));
            c.contact = GS4_WALL_SLIP;
            CHECK(gs4_add_collider(sim, &c) >= 0);
        }
        first = semi_solids_energy(sim, &m, a, g, &height, &least);
        for (k = 0; k < 60; k++) {
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), GS4_OK);
            most = fmax(most, semi_solids_energy(sim, &m, a, g, &height, &least) / first);
            worst = fmin(worst, least);
        }
        if (test_filter[0])
            printf("down %d: energy at most %.5f, at %.3f at last, least det F/J %.4f\n", a, most,
                   height, worst);
        CHECK_BETWEEN(most, 0.9, 1 + (SOLID_DOUBLE ? 1e-9 : 2e-5));
        CHECK_BETWEEN(height, 0.1, 0.6);
        CHECK_BETWEEN(worst, 0.9, 1.1);
        gs4_destroy(sim);
    }
}

/* --- the rest of a scheme --------------------------------------------------------------------- */

/* Beside a liquid: the same bits for any number of threads and from a checkpoint; allocations
 * refused. */
static void test_semi_solids_bits(void)
{
    partitioned_with_solid = 1;
    semi_check(test_partitioned_bits);
    partitioned_with_solid = 0;
}

static void test_semi_solids_memory(void)
{
    partitioned_with_solid = 1;
    semi_check(test_partitioned_memory);
    partitioned_with_solid = 0;
}

static void run_semi_solids(void)
{
    RUN_FULL_ONCE(test_semi_solids_ring);
    RUN_FULL_ONCE(test_semi_solids_kelvin);
    RUN_FULL_ONCE(test_semi_solids_walls);
    RUN_FULL(test_semi_solids_order);
    RUN_FULL_ONCE(test_semi_solids_beams);
    RUN_FULL_ONCE(test_semi_solids_stiff);
    RUN_ONCE(test_semi_solids_turn);
    RUN_ONCE(test_semi_solids_thin);
    RUN_FULL_ONCE(test_semi_solids_gap);
    RUN_FULL(test_semi_solids_bits);
    RUN_FULL_ONCE(test_semi_solids_memory);
}
