/* Heat and flow in one solve of the semi-implicit scheme: viscosities that differ by up to a
 * million with temperature, and blocks that melt while the rest stands. */

enum {
    MELT_PARTS = 100000
};

/* mu = exp(-a1 (T - 100)/T) Pa s, 1 at 100 and 1/ratio at 200. */
static gs4_material melt_liquid(double stiff, double ratio)
{
    gs4_material m = partitioned_liquid(0);
    m.viscosity_law = GS4_VISCOSITY_CROSS_WLF;
    m.cross_wlf.d1 = (gs4_real)stiff;
    m.cross_wlf.a1 = (gs4_real)(2 * log(ratio));
    m.cross_wlf.t1 = 100;
    m.cross_wlf.t2 = 0;
    m.cross_wlf.n = 1;
    m.heat_capacity = 1000;
    m.conductivity = 1;
    return m;
}

static double melt_viscosity(const gs4_material *m, double y)
{
    const double T = 100 + 100 * y;
    return (double)m->cross_wlf.d1 * exp(-(double)m->cross_wlf.a1 * (T - 100) / T);
}

/* Steady flow between plates at 0 and 1 m, of 100 and of 200 degrees, with the force rho g along
 * them: mu u' = c - rho g y, u(1) = 0. Its flux, and u at the middle of `parts` layers. */
static double melt_exact(const gs4_material *m, double g, int parts, double *u)
{
    const double rho = (double)m->density, d = 1.0 / MELT_PARTS;
    double one = 0, first = 0, c, flux = 0, sum = 0;
    int i;
    for (i = 0; i < MELT_PARTS; i++) {
        const double y = (i + 0.5) * d, f = d / melt_viscosity(m, y);
        one += f;
        first += rho * g * y * f;
    }
    c = first / one;
    for (i = 0; i < MELT_PARTS; i++) {
        const double y = (i + 0.5) * d, step = d * (c - rho * g * y) / melt_viscosity(m, y);
        sum += 0.5 * step;
        flux += sum * d;
        sum += 0.5 * step;
        if (floor((y + 0.5 * d) * parts - 0.5) > floor((y - 0.5 * d) * parts - 0.5))
            u[(int)floor((y + 0.5 * d) * parts - 0.5)] = sum;
    }
    return flux;
}

/* The flux of the scheme over the exact one, in n cells; what it differs from the exact profile at
 * most, over the largest velocity. */
static double melt_channel(int n, int along, int across, double ratio, double *worst)
{
    static double u[1024];
    const gs4_material m = melt_liquid(1e3 * ratio, ratio);
    const double dt = 1, flux = melt_exact(&m, 1, 2 * n, u);
    gs4_sim_desc d = semi_cube(n);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double g[3] = { 0, 0, 0 }, size[3], sum = 0, most = 0, apart = 0;
    gs4_sim *sim;
    gs4_edit T;
    gs4_view x, v;
    int c, i;
    for (c = 0; c < 3; c++) {
        if (c != across) d.cells[c] = 4;
        d.walls[2 * c] = d.walls[2 * c + 1] = c == across ? GS4_WALL_STICK : GS4_WALL_PERIODIC;
        size[c] = (double)d.cells[c] / n;
    }
    d.wall_is_isothermal[2 * across] = d.wall_is_isothermal[2 * across + 1] = 1;
    d.wall_temperature[2 * across] = 100;
    d.wall_temperature[2 * across + 1] = 200;
    d.ambient_temperature = 150;
    d.solver_tolerance = (gs4_real)1e-6;
    d.integrator = semi_integrators[n == 16];
    /* so slow that nothing moves by much until it is steady: 0.001 h a step */
    for (i = 0; i < 2 * n; i++) most = fmax(most, u[i]);
    g[along] = 0.001 / (n * most * dt);
    d.gravity = at(g[0], g[1], g[2]);
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    f.temperature = 150;
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(size[0], size[1], size[2])), &f) > 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    T = gs4_edit_particles(sim, GS4_FIELD_TEMPERATURE);
    for (i = 0; i < x.count; i++)
        T.data[i * T.stride] = (gs4_real)(100 + 100 * (double)x.data[i * x.stride + across]);
    for (i = 0; i < 20; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)dt), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++) {
        const double own = (double)v.data[i * v.stride + along] / g[along];
        const double y = 2 * n * (double)x.data[i * x.stride + across];
        sum += own / v.count;
        apart = fmax(apart, fabs(own - u[(int)y]) / most);
    }
    *worst = apart;
    gs4_destroy(sim);
    return sum / flux;
}

/* Flux and profile converge to those of the exact solution by the square of h, across axes and
 * along others, also where cold liquid has s mu/(rho h^2) of 1e9. There mu was cut off at 1e6, and
 * of a channel of 64 cells the flux was 1.35. */
static void test_semi_melt_channel(void)
{
    int k, i;
    for (k = 0; k < (test_slow ? 6 : 3); k++) {
        const double ratio = pow(10, 2 + 2 * (k % 3));
        double flux[3], worst[3];
        for (i = 0; i < (test_slow ? 3 : 2); i++) {
            const int n = 16 << i;
            flux[i] = melt_channel(n, k % 3, (k + 1 + k / 3) % 3, ratio, &worst[i]);
            if (test_filter[0])
                printf("1 : %g, %d cells: flux %.4f of the exact, profile within %.4f\n", ratio, n,
                       flux[i], worst[i]);
        }
        CHECK_CLOSE(flux[1], 1, 0.02);
        CHECK_BETWEEN(log2((flux[0] - 1) / (flux[1] - 1)), 1.8, 2.3);
        CHECK_BETWEEN(log2(worst[0] / worst[1]), 1.6, 2.3);
        if (test_slow) CHECK_CLOSE(flux[2], 1, 0.005);
    }
}

/* A block on a sticky floor, held by a sticky wall at its back, 1e6 times softer at the front,
 * where it is hot: that slumps while heat goes on into the rest. Heat is what it was, temperatures
 * stay within those given, volume is kept, and what stays cold creeps by at most rho g H/mu H t;
 * the correction of volume, which knows no viscosity, moves it by a share of what flows. */
static void test_semi_melt_block(void)
{
    const double h = 1.0 / 24, H = 0.5, front = 0.35, back = 0.2, g = 10, end = 1, soft = 500;
    static double first[3 * 16384], last[3 * 16384];
    int turn, i, c, k;
    for (turn = 0; turn < (test_full ? 6 : 2); turn++) {
        const int a = turn % 3, down = (turn + 1) % 3, deep = (turn + 2) % 3;
        gs4_material m = melt_liquid(1e6 * soft, 1e6);
        double high[3], fall[3] = { 0, 0, 0 }, heat[2] = { 0, 0 }, coldest = 1e9, hottest = 0,
                        creep = 0, run = 0;
        gs4_sim_desc d = semi_cube(24);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        gs4_edit T;
        gs4_view x;
        gs4_stats s;
        m.conductivity = 1000; /* D = 1e-3: 0.03 m in 1 s */
        d.cells[a] = 48;
        d.cells[down] = 16;
        d.cells[deep] = 4;
        d.cfl = (gs4_real)0.8;
        d.solver_tolerance = (gs4_real)1e-6;
        for (i = 0; i < 6; i++) d.walls[i] = i / 2 == deep ? GS4_WALL_SLIP : GS4_WALL_OPEN;
        d.walls[2 * a] = d.walls[2 * down] = GS4_WALL_STICK;
        fall[down] = -g;
        d.gravity = at(fall[0], fall[1], fall[2]);
        d.ambient_temperature = 100;
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        f.material = gs4_add_material(sim, &m);
        f.temperature = 100;
        high[a] = high[down] = H;
        high[deep] = 4 * h;
        CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(high[0], high[1], high[2])), &f)
              < 16384);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        T = gs4_edit_particles(sim, GS4_FIELD_TEMPERATURE);
        for (i = 0; i < x.count; i++)
            if ((double)x.data[i * x.stride + a] > front) T.data[i * T.stride] = 200;
        scene_by_id(sim, GS4_FIELD_POSITION, first);
        sim->staggered.without_correction = turn & 1;
        for (k = 0; k < 2; k++) {
            if (k) CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)end), GS4_OK);
            T = gs4_edit_particles(sim, GS4_FIELD_TEMPERATURE);
            for (i = 0; i < T.count; i++) heat[k] += (double)T.data[i * T.stride] / T.count;
        }
        for (i = 0; i < T.count; i++) {
            coldest = fmin(coldest, (double)T.data[i * T.stride]);
            hottest = fmax(hottest, (double)T.data[i * T.stride]);
        }
        scene_by_id(sim, GS4_FIELD_POSITION, last);
        for (i = 0; i < T.count; i++) {
            run = fmax(run, last[3 * i + a]);
            for (c = 0; c < 3 && first[3 * i + a] < back; c++)
                creep = fmax(creep, fabs(last[3 * i + c] - first[3 * i + c]));
        }
        s = gs4_get_stats(sim);
        if (test_filter[0])
            printf("axis %d: %d steps, %d refused, heat %.7f, %.2f to %.2f degrees, runs to %.3f, "
                   "creeps by %.2e, volume %.4f, %d iterations\n",
                   a, (int)s.steps, (int)s.refused, heat[1] / heat[0], coldest, hottest, run, creep,
                   (double)s.occupied_volume / (H * H * 4 * h), s.viscous_iterations);
        CHECK(s.refused == 0);
        CHECK_CLOSE(heat[1] / heat[0], 1, 1e-5);
        CHECK_BETWEEN(coldest, 99.9, 100.1);
        CHECK_BETWEEN(hottest, 190, 200.1);
        CHECK_BETWEEN(run, H + 0.03, 1.5);
        CHECK_BETWEEN(creep, 0,
                      turn & 1 ? 1000 * g * H / (1e6 * soft) * H * end : 0.005 * (run - H));
        CHECK_CLOSE((double)s.occupied_volume / (H * H * 4 * h), 1, 0.05);
        gs4_destroy(sim);
    }
}

/* Elasticity of what melts limits no step, frozen or molten, whether it is there or an emitter
 * gives it: with moduli of 1 Pa and of 1e9 Pa the largest stable step is the same. */
static void test_semi_melt_limit(void)
{
    int stiff, emits;
    for (emits = 0; emits < 2; emits++) {
        double dt[2];
        for (stiff = 0; stiff < 2; stiff++) {
            gs4_sim_desc d = semi_cube(16);
            gs4_material m = partitioned_liquid(1);
            gs4_fill f = scene_fill(at(0, 0, 0));
            gs4_emitter e;
            gs4_sim *sim;
            d.gravity = at(0, -10, 0);
            CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
            m.liquid = GS4_OLDROYD_B;
            m.local_fraction = (gs4_real)0.5;
            m.relaxation_time = (gs4_real)(stiff ? 0.5e-9 : 0.5);
            m.solid = GS4_NEO_HOOKEAN;
            m.shear_modulus = (gs4_real)(stiff ? 1e9 : 1);
            m.heat_capacity = 1000;
            m.can_melt = 1;
            m.melting_temperature = 50;
            f.material = gs4_add_material(sim, &m);
            f.temperature = stiff ? 20 : 100;
            f.velocity = at(0, -1, 0);
            memset(&e, 0, sizeof e);
            e.shape = gs4_box(at(0.25, 0.5, 0.25), at(0.75, 0.75, 0.75));
            e.fill = f;
            if (emits)
                CHECK(gs4_add_emitter(sim, &e) >= 0);
            else
                CHECK(gs4_add_particles(sim, e.shape, &f) > 0);
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-3), GS4_OK);
            CHECK(strcmp(gs4_limit_name(sim), "elasticity") != 0);
            dt[stiff] = (double)gs4_stable_dt(sim);
            gs4_destroy(sim);
        }
        CHECK_CLOSE(dt[1] / dt[0], 1, 0.01);
    }
}

static void run_semi_melt(void)
{
    RUN_ONCE(test_semi_melt_limit);
    RUN_FULL(test_semi_melt_channel);
    RUN_FULL_ONCE(test_semi_melt_block);
}
