/* The partitioned scheme at free surfaces, against exact modes of a sphere; momentum there. */

/* --- natural modes of a free sphere ----------------------------------------------------------- */

/* Modes of an incompressible sphere of radius 1 without traction, of degree 2 about the z axis.
 * P = z^2 - (x^2 + y^2)/2, f = j2(k r)/(k r)^2. Torsional: v = f r x grad P, where d(j2/r)/dr = 0.
 * Spheroidal: v = curl curl (r f P) + b grad P, whose second part has the pressure k^2 nu rho b P;
 * b leaves no shear, and k no normal stress at r = 1. */
static const double surface_wave_number[2] = { 2.5011326, 2.6656222 };
#define SURFACE_POTENTIAL (-0.1665080148 / (2.6656222 * 2.6656222))

static void surface_mode(int spheroidal, const double x[3], double v[3])
{
    const double k = surface_wave_number[spheroidal], r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2],
                 P = x[2] * x[2] - (x[0] * x[0] + x[1] * x[1]) / 2,
                 grad[3] = { -x[0], -x[1], 2 * x[2] };
    const double f = scene_bessel(2, k * sqrt(r2)), df = -k * k * scene_bessel(3, k * sqrt(r2)),
                 ddf = k * k * k * k * scene_bessel(4, k * sqrt(r2)); /* (d/dr)/r, once and twice */
    int i;
    for (i = 0; i < 3; i++) /* curl curl (r f P) = grad((3 f + r f') P) + k^2 f P r */
        v[i] = spheroidal
                   ? (5 * df + r2 * ddf) * P * x[i]
                         + (3 * f + r2 * df + SURFACE_POTENTIAL) * grad[i] + k * k * f * P * x[i]
                   : f * (x[(i + 1) % 3] * grad[(i + 2) % 3] - x[(i + 2) % 3] * grad[(i + 1) % 3]);
}

/* A sphere of R cells, density 1, in a mode about axis a, with velocities of 1e-3. */
static gs4_sim *surface_sphere(const gs4_material *m, gs4_scheme scheme, int R, int spheroidal,
                               int a)
{
    const int n = 2 * R + 8;
    const double middle = 0.5 * n / R;
    gs4_sim_desc d = partitioned_cube(n);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    gs4_view x;
    gs4_edit v;
    int i, k;
    d.scheme = scheme;
    d.cell_size = (gs4_real)(1.0 / R);
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, m);
    gs4_add_particles(sim, gs4_sphere(at(middle, middle, middle), 1), &f);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < v.count; i++) {
        double p[3], u[3];
        for (k = 0; k < 3; k++) p[k] = (double)x.data[i * x.stride + (a + 1 + k) % 3] - middle;
        surface_mode(spheroidal, p, u);
        for (k = 0; k < 3; k++) v.data[i * v.stride + (a + 1 + k) % 3] = (gs4_real)(1e-3 * u[k]);
    }
    return sim;
}

/* How much of the mode it has, over that at first. */
static double surface_share(const gs4_sim *sim, int R, int spheroidal, int a)
{
    const double middle = 0.5 * (2 * R + 8) / R;
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const gs4_view v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    double sum = 0, norm = 0;
    int i, k;
    for (i = 0; i < v.count; i++) {
        double p[3], u[3];
        for (k = 0; k < 3; k++) p[k] = (double)x.data[i * x.stride + (a + 1 + k) % 3] - middle;
        surface_mode(spheroidal, p, u);
        for (k = 0; k < 3; k++) {
            sum += u[k] * (double)v.data[i * v.stride + (a + 1 + k) % 3];
            norm += 1e-3 * u[k] * u[k];
        }
    }
    return sum / norm;
}

/* Rate of decay over nu k^2, until e^-`span` is left. */
static double surface_decay(gs4_scheme scheme, int R, int spheroidal, int a, double span)
{
    const double k = surface_wave_number[spheroidal], T = span / (k * k);
    gs4_material m = scene_liquid(1, 1, 0);
    gs4_sim *sim;
    double share;
    m.incompressible = scheme == GS4_PARTITIONED;
    m.bulk_modulus = scheme == GS4_PARTITIONED ? 0 : 100;
    sim = surface_sphere(&m, scheme, R, spheroidal, a);
    partitioned_steps(sim, T, (int)ceil(T / (double)gs4_stable_dt(sim)));
    share = surface_share(sim, R, spheroidal, a);
    gs4_destroy(sim);
    if (test_filter[0])
        printf("scheme %d, %d cells, spheroidal %d, axis %d: decay %.4f\n", (int)scheme, R,
               spheroidal, a, -log(share) / span);
    return -log(share) / span;
}

/* Modes of viscous spheres decay as they should, and the finer the better. With the explicit scheme
 * the torsional one of 8 cells is 7 % too slow. */
static void test_partitioned_surface_decay(void)
{
    int a, spheroidal;
    for (spheroidal = 0; spheroidal < 2; spheroidal++) {
        double coarse = 0, fine;
        for (a = test_full ? 0 : 2; a < 3; a++) {
            coarse = surface_decay(GS4_PARTITIONED, 8, spheroidal, a, 0.5);
            CHECK_CLOSE(coarse, 1, 0.05);
        }
        if (!test_full) continue;
        if (spheroidal) continue; /* its rate does not converge yet: 1.03 */
        fine = surface_decay(GS4_PARTITIONED, 16, spheroidal, 2, 0.3);
        CHECK_CLOSE(fine, 1, 0.025);
        CHECK_BETWEEN((1 - fine) / (1 - coarse), -0.5, 0.5);
    }
    if (test_full) CHECK_CLOSE(surface_decay(GS4_EXPLICIT, 8, 0, 2, 0.5), 0.925, 0.01);
}

/* What is left of both modes after the time of e^-1/2, in n, 2 n, 4 n steps: order in time. */
static void test_partitioned_surface_order(void)
{
    int n, i;
    for (n = 0; n < 4; n++) {
        const int spheroidal = n & 1, be = n / 2;
        const double k = surface_wave_number[spheroidal], T = 0.5 / (k * k);
        gs4_material m = scene_liquid(1, 1, 0);
        double left[3], order;
        m.incompressible = 1;
        for (i = 0; i < 3; i++) {
            gs4_sim *sim = surface_sphere(&m, GS4_PARTITIONED, 6, spheroidal, 2);
            sim->desc.integrator = be ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
            partitioned_steps(sim, T, (int)ceil(T / (double)gs4_stable_dt(sim)) << i);
            left[i] = surface_share(sim, 6, spheroidal, 2);
            gs4_destroy(sim);
        }
        order = log2(fabs((left[0] - left[1]) / (left[1] - left[2])));
        if (test_filter[0])
            printf("spheroidal %d, integrator %d: order %.2f\n", spheroidal, be, order);
        CHECK_BETWEEN(order, be ? 0.85 : 1.95, be ? 1.1 : 2.25);
    }
}

/* A sphere rings for `periods` of as many steps: frequency over k sqrt(G/rho), and the most that is
 * seen of the mode in the last of them. */
static double surface_ring_of(gs4_sim *sim, int R, int spheroidal, int a, int steps, int periods,
                              double *frequency)
{
    const double period = 2 * 3.14159265358979 / surface_wave_number[spheroidal],
                 dt = period / steps;
    double before = 1, first = 0, last = 0, most = 0;
    int i, crossings = 0;
    for (i = 1; i <= periods * steps; i++) {
        double now;
        if (gs4_step(sim, (gs4_real)dt) != GS4_OK) break;
        now = surface_share(sim, R, spheroidal, a);
        if (before * now <= 0) {
            last = (i - now / (now - before)) * dt;
            if (!crossings++) first = last;
        }
        if (i > (periods - 1) * steps) most = fmax(most, fabs(now));
        before = now;
    }
    CHECK_RESULT(sim, i <= periods * steps ? GS4_ERROR_UNSTABLE : GS4_OK, GS4_OK);
    *frequency = (crossings - 1) * 0.5 * period / (last - first);
    if (test_filter[0])
        printf("%d cells, spheroidal %d, axis %d: frequency %.4f, left %.4f\n", R, spheroidal, a,
               *frequency, most);
    gs4_destroy(sim);
    return most;
}

/* Elastic spheres ring with k sqrt(G/rho), and never gain; what is left after `periods`. */
static double surface_ring(int R, int spheroidal, int a, int periods, double *frequency)
{
    const double period = 2 * 3.14159265358979 / surface_wave_number[spheroidal];
    gs4_material m = scene_liquid(1, 0, 0);
    gs4_sim *sim;
    m.incompressible = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1;
    sim = surface_sphere(&m, GS4_PARTITIONED, R, spheroidal, a);
    return surface_ring_of(sim, R, spheroidal, a,
                           (int)ceil(1.5 * period / (double)gs4_stable_dt(sim)), periods,
                           frequency);
}

static void test_partitioned_surface_ring(void)
{
    int a, spheroidal;
    double frequency;
    for (spheroidal = 0; spheroidal < 2; spheroidal++)
        for (a = test_slow ? 0 : 2; a < 3; a++) {
            CHECK_BETWEEN(surface_ring(8, spheroidal, a, a == 2 ? 3 : 1, &frequency), 0.9, 1.001);
            CHECK_CLOSE(frequency, 1, 0.05);
        }
    CHECK_BETWEEN(surface_ring(6, 0, 2, 6, &frequency), 0.9, 1.01);
}

/* --- momentum --------------------------------------------------------------------------------- */

/* Two boxes in one, askew, that are torn about; K is so small that stress alone moves them. Forces
 * on faces beyond liquid must not be lost. */
static gs4_sim *surface_torn(int elastic, int integrator)
{
    gs4_sim_desc d = partitioned_cube(16);
    gs4_material m = scene_liquid(1000, elastic ? 0 : 20, 0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    gs4_edit v;
    gs4_view x;
    int i, k;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    d.integrator = integrator ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    d.flip_decay_time = INFINITY; /* what noise loses is not given back */
    d.gravity = at(0.05, -0.1, 0.025);
    m.bulk_modulus = (gs4_real)1e-6;
    if (elastic) {
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = 1000;
    }
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    gs4_add_particles(sim, gs4_box(at(0.3, 0.32, 0.35), at(0.71, 0.57, 0.52)), &f);
    gs4_add_particles(sim, gs4_box(at(0.45, 0.57, 0.35), at(0.6, 0.69, 0.7)), &f);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++)
        for (k = 0; k < 3; k++)
            v.data[i * v.stride + k] =
                (gs4_real)(0.3 * sin(9 * (double)x.data[i * x.stride + (k + 1) % 3] + k)
                           + 0.2 * cos(13 * (double)x.data[i * x.stride + k]));
    return sim;
}

/* Momentum to rounding, angular momentum within 1e-3. */
static void test_partitioned_surface_momentum(void)
{
    const double tiny = sizeof(gs4_real) == 8 ? 1e-11 : 1e-7;
    int n, k;
    for (n = 0; n < 4; n++) {
        gs4_sim *sim = surface_torn(n & 1, n & 2);
        const gs4_stats before = gs4_get_stats(sim);
        const double scale = sqrt(2 * before.kinetic_energy * before.mass);
        gs4_stats after;
        double spin[3];
        for (k = 0; k < 3; k++) spin[k] = partitioned_spin(sim, &before, k);
        partitioned_steps(sim, 0.02, 5);
        after = gs4_get_stats(sim);
        for (k = 0; k < 3; k++) {
            static const double g[3] = { 0.05, -0.1, 0.025 };
            const double gain = after.momentum[k] - before.momentum[k] - 0.02 * g[k] * before.mass,
                         turn = partitioned_spin(sim, &after, k) - spin[k];
            if (test_filter[0])
                printf("case %d axis %d: momentum %.2e, spin %.2e\n", n, k, gain / scale,
                       turn / (0.2 * scale));
            CHECK_CLOSE(gain / scale, 0, tiny);
            CHECK_CLOSE(turn / (0.2 * scale), 0, 0.002);
        }
        CHECK_BETWEEN(after.kinetic_energy / before.kinetic_energy, 0.1, 0.97);
        gs4_destroy(sim);
    }
}

static void run_partitioned_surface(void)
{
    RUN_FULL_ONCE(test_partitioned_surface_decay);
    if (sizeof(gs4_real) == 8) RUN_FULL(test_partitioned_surface_order);
    RUN_FULL_ONCE(test_partitioned_surface_ring);
    RUN_ONCE(test_partitioned_surface_momentum);
}
