/* Thin films on a sticky floor: what flows down a slope, 1, 2 and 4 cells thick. */

/* Walls but the floor and what is above it are periodic, `normal` is up, flow is along the axis
 * after that. Exact: u = (g_x/nu) (H y - y^2/2), its mean g_x H^2/(3 nu). */
typedef struct film_case {
    int cells, normal;
    gs4_scheme scheme;
    gs4_integrator how;
    double noise; /* m/s, of each component of velocity at first, at most */
} film_case;

typedef struct film_result {
    double flux;   /* mean velocity over the exact one */
    double centre; /* mean height over H/2 */
    double noise;  /* rms of the velocity normal to the floor, m/s */
} film_result;

static gs4_sim *film_make(const film_case *k, double h, double nu)
{
    const int a = k->normal, b = (a + 1) % 3;
    gs4_sim_desc d = scene_cube(8);
    gs4_material m = scene_liquid(1000, 1000 * nu, k->scheme == GS4_EXPLICIT ? 10 : 0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double g[3] = { 0, 0, 0 }, size[3] = { 8 * h, 8 * h, 8 * h };
    uint64_t random = 1;
    gs4_edit v;
    gs4_sim *sim;
    int i;
    d.cell_size = (gs4_real)h;
    d.scheme = k->scheme;
    d.integrator = k->how;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_PERIODIC;
    d.walls[2 * a] = GS4_WALL_STICK;
    d.walls[2 * a + 1] = GS4_WALL_OPEN;
    g[a] = -9.81;
    g[b] = 0.981;
    d.gravity = at(g[0], g[1], g[2]);
    m.incompressible = k->scheme != GS4_EXPLICIT;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    f.jitter = (gs4_real)0.3;
    size[a] = k->cells * h;
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(size[0], size[1], size[2])), &f) > 0);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < 3 * v.count; i++)
        v.data[i / 3 * v.stride + i % 3] = (gs4_real)heat_random(&random, -k->noise, k->noise);
    return sim;
}

static film_result film_flow(const film_case *k)
{
    const double h = 0.01, nu = 0.01, H = k->cells * h, mean = 0.981 * H * H / (3 * nu);
    gs4_sim *sim = film_make(k, h, nu);
    film_result out = { 0, 0, 0 };
    gs4_view x, v;
    int i;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)(4 * H * H / nu + 0.3)), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < x.count; i++) {
        const double up = (double)v.data[i * v.stride + k->normal];
        out.flux += (double)v.data[i * v.stride + (k->normal + 1) % 3] / mean / x.count;
        out.centre += (double)x.data[i * x.stride + k->normal] / (H / 2) / x.count;
        out.noise += up * up / x.count;
    }
    out.noise = sqrt(out.noise);
    if (test_filter[0])
        printf(
            "%d cells, normal %d, scheme %d, integrator %d: flux %.3f, centre %.4f, up %.1e m/s\n",
            k->cells, k->normal, (int)k->scheme, (int)k->how, out.flux, out.centre, out.noise);
    gs4_destroy(sim);
    return out;
}

/* What the manual says that such films carry. Where they end is known to a part of a cell, and flux
 * goes by the cube of the thickness. */
static const struct film_bound {
    gs4_scheme scheme;
    gs4_integrator how;
    double flux[3][2];
} film_bounds[5] = {
    { GS4_EXPLICIT, GS4_INTEGRATOR_GS4, { { 1.15, 1.35 }, { 1.1, 1.25 }, { 1.0, 1.06 } } },
    { GS4_EXPLICIT,
      GS4_INTEGRATOR_SYMPLECTIC_EULER,
      { { 0.65, 0.85 }, { 0.7, 0.9 }, { 0.82, 0.95 } } },
    { GS4_PARTITIONED, GS4_INTEGRATOR_GS4, { { 1.6, 2.1 }, { 1.15, 1.3 }, { 1.0, 1.07 } } },
    { GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4, { { 0.6, 0.9 }, { 0.9, 1.0 }, { 0.98, 1.01 } } },
    /* affine */
    { GS4_EXPLICIT, GS4_INTEGRATOR_GS4, { { 1.15, 1.35 }, { 1.02, 1.08 }, { 0.98, 1.04 } } }
};

/* They flow as said, along every axis, and neither swell nor thin. */
static void test_film_flow(void)
{
    int n, i;
    for (n = 0; n < (TEST_FULL_ONCE ? 15 : 5); n++)
        for (i = 0; i < (TEST_FULL_ONCE ? 3 : 2); i++) {
            const struct film_bound *b = &film_bounds[n % 5];
            film_case k = { 1 << i, (n + 2) % 3, b->scheme, b->how, 0 };
            film_result r;
            scene_affine = n % 5 == 4;
            r = film_flow(&k);
            scene_affine = 0;
            CHECK_BETWEEN(r.flux, b->flux[i][0], b->flux[i][1]);
            CHECK_BETWEEN(r.centre, 0.995, 1.005);
            CHECK_BETWEEN(r.noise, 0, 0.0035); /* m/s: it lies still */
        }
}

/* What particles of a film have of their own dies out: after 0.34 s and more less than a fiftieth
 * of its energy is left, with the implicit schemes in 16 steps and more. */
static void test_film_noise(void)
{
    int n, i;
    for (n = 0; n < (test_full ? 15 : 5); n++)
        for (i = 0; i < 3; i++) {
            const struct film_bound *b = &film_bounds[n % 5];
            film_case k = { 1 << i, n % 3, b->scheme, b->how, 0.5 };
            film_result r;
            scene_affine = n % 5 == 4;
            r = film_flow(&k);
            scene_affine = 0;
            CHECK_BETWEEN(r.noise, 0, sqrt(0.02) * 0.5 / sqrt(3.0));
            CHECK_BETWEEN(r.centre, 0.99, 1.01);
        }
}

static void run_film(void)
{
    RUN_ONCE(test_film_flow);
    RUN_FULL_ONCE(test_film_noise);
}
