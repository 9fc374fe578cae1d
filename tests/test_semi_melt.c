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
        if ((int)((y + d) * parts - 0.5) > (int)(y * parts - 0.5)
            || (i == 0 && parts > 2 * MELT_PARTS))
            u[(int)((y + d) * parts - 0.5)] = sum;
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
    /* so slow that nothing moves by much until it is steady: 0.01 h a step */
    for (i = 0; i < 2 * n; i++) most = fmax(most, u[i]);
    g[along] = 0.01 / (n * most * dt);
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

static void test_semi_melt_channel(void)
{
    int n, k;
    for (k = 0; k < 3; k++)
        for (n = 8; n <= (test_full ? 64 : 16); n *= 2) {
            const double ratio = pow(10, 2 + 2 * k);
            double worst, flux = melt_channel(n, k, (k + 1) % 3, ratio, &worst);
            if (test_filter[0])
                printf("1 : %g, %d cells: flux %.4f of the exact, profile within %.4f\n", ratio, n,
                       flux, worst);
            CHECK_CLOSE(flux, 1, n < 16 ? 0.08 : 0.02);
        }
}

static void run_semi_melt(void) { RUN_FULL(test_semi_melt_channel); }
