/* Steps just below the limit stay bounded and steps above it are refused, for every member of
 * the family; and extremes of everything at once: a step is taken or refused with a sentence,
 * numbers stay finite, energy does not come from nowhere. */

static double stability_random(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (double)(*state >> 8) / 16777216.0 - 0.5;
}

static void stability_stir(gs4_sim *sim, double speed, uint32_t seed)
{
    gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    int i, c;
    for (i = 0; i < v.count; i++)
        for (c = 0; c < 3; c++)
            v.data[(size_t)i * (size_t)v.stride + (size_t)c] +=
                (gs4_real)(speed * stability_random(&seed));
}

/* m h^2/8 C:C of all, what of kinetic energy is in velocity gradients that particles carry (J). */
static double stability_gradient_energy(gs4_sim *sim)
{
    const gs4_view m = gs4_particles(sim, GS4_FIELD_MASS);
    const double h = (double)sim->desc.cell_size;
    double sum = 0;
    int i, k;
    for (i = 0; i < m.count && sim->particles.with_gradient; i++)
        for (k = 0; k < 9; k++) {
            const double C = (double)sim->particles.gradient[GS4I_GRADIENT_REALS * i + k];
            sum += (double)m.data[(size_t)i * (size_t)m.stride] * h * h / 8 * C * C;
        }
    return sum;
}

/* Kinetic and, of the Tait equation, compressive: V0 (rho0 c0^2 / 7) (J^-6/6 + J - 7/6), J. */
static double stability_energy(gs4_sim *sim, double sound_speed)
{
    const gs4_view J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    double sum = gs4_get_stats(sim).kinetic_energy + stability_gradient_energy(sim);
    int i;
    for (i = 0; i < J.count; i++) {
        const double j = (double)J.data[(size_t)i * (size_t)J.stride];
        sum += (double)m.data[(size_t)i * (size_t)m.stride] * sound_speed * sound_speed / 7
               * (pow(j, -6) / 6 + j - 7.0 / 6);
    }
    return sum;
}

/* The velocity gradients that particles carry are found in the first step. */
static void stability_settle(gs4_sim *sim)
{
    if (sim->particles.with_gradient)
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(1e-4 * (double)gs4_stable_dt(sim))), GS4_OK);
}

/* Nodes that particles reach, over particles: the share of what is stirred at random that nodes can
 * have a say in, as they have that many degrees of freedom. 0.05 is three standard deviations of
 * the share for 1400 particles. */
static double stability_seen(gs4_sim *sim)
{
    static char reached[20 * 20 * 20];
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const int n = sim->desc.cells[0];
    int i, k, nodes = 0;
    memset(reached, 0, sizeof reached);
    for (i = 0; i < x.count; i++) {
        const gs4_real *at = x.data + (size_t)i * (size_t)x.stride;
        for (k = 0; k < 27; k++)
            reached[(((int)(at[2] / sim->desc.cell_size) + k / 9 - 1) * n
                     + (int)(at[1] / sim->desc.cell_size) + k / 3 % 3 - 1)
                        * n
                    + (int)(at[0] / sim->desc.cell_size) + k % 3 - 1] = 1;
    }
    for (i = 0; i < n * n * n; i++) nodes += reached[i];
    return (double)nodes / x.count + 0.05;
}

/* What energy, over that at the start, can be of a body that was stirred and is left alone, by
 * `before`. At most 1, as none is given; 0.001 is for rounding and the time between velocity and
 * stress. At least, with GS4 and without decay, what nodes have no say in. Symplectic Euler keeps
 * that only which nodes see. So there this is the most, and the least is that of momentum. */
typedef struct stability_bounds {
    double least, most;
} stability_bounds;

static stability_bounds stability_before(gs4_sim *sim, double energy)
{
    const gs4_view v = gs4_particles(sim, GS4_FIELD_VELOCITY),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    double p[3] = { 0, 0, 0 }, mass = 0;
    stability_bounds b;
    int i, c;
    b.least = 1 - stability_seen(sim);
    b.most = 1.001;
    if (sim->desc.integrator == GS4_INTEGRATOR_GS4) return b;
    for (i = 0; i < v.count; i++) {
        const double one = (double)m.data[(size_t)i * (size_t)m.stride];
        for (c = 0; c < 3; c++)
            p[c] += one * (double)v.data[(size_t)i * (size_t)v.stride + (size_t)c];
        mass += one;
    }
    b.most = 1 - b.least;
    b.least = 0.999 * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / (2 * mass * energy);
    return b;
}

/* A jittered drop, 7 cells across, stirred by c0/1000: what 0.95 of the limit makes of its energy
 * in `steps` steps. */
static void stability_growth(gs4_integrator integrator, double rho, double spurious,
                             double viscosity, int steps)
{
    gs4_sim_desc d = scene_cube(16);
    gs4_material m = scene_liquid(1000, viscosity, 10);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    stability_bounds bounds;
    double start, most = 0;
    uint64_t hash;
    int i, result;
    d.integrator = integrator;
    d.rho_inf = (gs4_real)rho;
    d.rho_inf_spurious = (gs4_real)spurious;
    if (integrator == GS4_INTEGRATOR_GS4) d.flip_decay_time = INFINITY;
    sim = physics_create(&d, &m);
    f.jitter = 1;
    f.random_seed = 5;
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)(3.5 / 16)), &f) > 0);
    stability_stir(sim, 0.01, 1);
    stability_settle(sim);
    start = stability_energy(sim, 10);
    bounds = stability_before(sim, start);
    for (i = 0; i < steps && most < 100; i++) {
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.95 * (double)gs4_stable_dt(sim))), GS4_OK);
        most = fmax(most, stability_energy(sim, 10) / start);
        if (i % 100) continue;
        hash = gs4_state_hash(sim);
        result = gs4_step(sim, (gs4_real)(1.5 * (double)gs4_stable_dt(sim)));
        CHECK(result == GS4_ERROR_ARGUMENT || result == GS4_ERROR_UNSTABLE);
        CHECK(gs4_state_hash(sim) == hash);
    }
    if (test_filter[0])
        printf("integrator %d, rho %g %g, viscosity %g: energy at most %.4f, at the end %.4f of "
               "what it was\n",
               (int)integrator, rho, spurious, viscosity, most, stability_energy(sim, 10) / start);
    CHECK_BETWEEN(most, bounds.least, bounds.most);
    CHECK_BETWEEN(stability_energy(sim, 10) / start, bounds.least, bounds.most);
    gs4_destroy(sim);
}

static void test_stability(void)
{
    static const double family[5][2] = { { 0, 0 }, { 0.5, 0 }, { 1, 0 }, { 0.5, 0.5 }, { 1, 0.5 } };
    const int steps = test_slow ? 3000 : test_full ? 300 : 100;
    int i, k;
    for (k = 0; k < (test_slow ? 3 : 1); k++) {
        /* sound, both, viscosity limit the step */
        const double viscosity = k == 0 ? 0 : k == 1 ? 30 : 3000;
        for (i = 0; i < 5; i++)
            stability_growth(GS4_INTEGRATOR_GS4, family[i][0], family[i][1], viscosity, steps);
        stability_growth(GS4_INTEGRATOR_SYMPLECTIC_EULER, 0, 0, viscosity, steps);
        scene_sharp = 1;
        for (i = test_slow ? 0 : 4; i < 5; i++)
            stability_growth(GS4_INTEGRATOR_GS4, family[i][0], family[i][1], viscosity, steps);
        scene_sharp = 0;
        scene_affine = 1;
        for (i = 0; i < 5; i++)
            stability_growth(GS4_INTEGRATOR_GS4, family[i][0], family[i][1], viscosity, steps);
        scene_affine = 0;
    }
}

/* What is sharpened is what is full, by the densest of the materials: else nodes that hold
 * little would be, too, and swing ever more. */
static void test_stability_of_two_densities(void)
{
    gs4_sim_desc d = scene_cube(20);
    gs4_material heavy = scene_liquid(2000, 0, 10), light = scene_liquid(50, 0, 10);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    stability_bounds bounds;
    double start, most = 0;
    int i;
    d.sharp_gradients = 1;
    d.flip_decay_time = INFINITY;
    d.rho_inf = 1;
    sim = physics_create(&d, &heavy);
    CHECK(gs4_add_material(sim, &light) == 1);
    f.jitter = 1;
    f.random_seed = 5;
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.38, 0.5, 0.5), (gs4_real)0.15), &f) > 0);
    stability_stir(sim, 0.01, 1);
    start = gs4_get_stats(sim).kinetic_energy;
    bounds = stability_before(sim, start);
    for (i = 0; i < (test_full ? 900 : 300) && most < 100; i++) {
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.95 * (double)gs4_stable_dt(sim))), GS4_OK);
        most = fmax(most, gs4_get_stats(sim).kinetic_energy / start);
    }
    if (test_filter[0])
        printf("two densities, sharpened: energy at most %.3f of what it was\n", most);
    CHECK_BETWEEN(most, bounds.least, bounds.most);
    CHECK_BETWEEN(gs4_get_stats(sim).kinetic_energy / start, bounds.least, bounds.most);
    gs4_destroy(sim);
}

/* --- extremes --------------------------------------------------------------------------------- */

typedef struct stability_scene {
    /* of cells a second, towards the floor */
    double viscosity, sound_speed, gravity, cell_size, flight;
    gs4_integrator integrator;
    gs4_wall floor;
} stability_scene;

/* The one of the 5 x 4^3 x 2 x 2 x 3 combinations that has this number. */
static stability_scene stability_choose(int number)
{
    static const double viscosities[5] = { 0, 1e-3, 1, 1e3, 1e6 }, sounds[4] = { 0.1, 1, 1e2, 1e4 };
    static const double gravities[4] = { 0, 9.81, 1e3, 1e5 }, sizes[4] = { 1e-6, 1e-3, 1, 1e3 };
    static const gs4_wall floors[3] = { GS4_WALL_STICK, GS4_WALL_SLIP, GS4_WALL_SEPARATE };
    stability_scene s;
    s.viscosity = viscosities[number % 5];
    number /= 5;
    s.sound_speed = sounds[number % 4];
    number /= 4;
    s.gravity = gravities[number % 4];
    number /= 4;
    s.cell_size = sizes[number % 4];
    number /= 4;
    s.flight = number % 2 ? 1000 : 0;
    number /= 2;
    s.integrator = physics_integrators[number % 2];
    number /= 2;
    s.floor = floors[number];
    return s;
}

/* What is wrong after call i, which gave `result`, or NULL. The last is gs4_advance, which must
 * find its way unless the floor is hit faster than sound. */
static const char *stability_fault(gs4_sim *sim, const stability_scene *s, int i, int result,
                                   double energy)
{
    const double h = s->cell_size, speed2 = s->flight * h * s->flight * h + 4 * s->gravity * h;
    if (result > 0 || (result < 0 && !gs4_last_error(sim)[0]))
        return "neither taken nor refused with a sentence";
    if (i == 20 && result < 0 && speed2 < s->sound_speed * s->sound_speed) return "gives up";
    if (!physics_is_finite(sim)) return "not finite";
    if (s->gravity == 0 && !(stability_energy(sim, s->sound_speed) < 1.001 * energy))
        return "energy from nowhere";
    return NULL;
}

/* 4 cells across, one cell above the floor: 20 steps and one gs4_advance of as long as 20 of its
 * own would be. Returns its fault. */
static const char *stability_try(const stability_scene *s, int number, int *refused)
{
    const double h = s->cell_size;
    gs4_sim_desc d = scene_cube(10);
    gs4_material m = scene_liquid(1000, s->viscosity, s->sound_speed);
    gs4_fill f = scene_fill(at(0, -s->flight * h, 0));
    gs4_sim *sim;
    const char *fault = NULL;
    double energy;
    int i, result;
    d.cell_size = (gs4_real)h;
    d.gravity.y = (gs4_real)-s->gravity;
    d.integrator = s->integrator;
    d.walls[2] = s->floor;
    sim = physics_create(&d, &m);
    f.jitter = (gs4_real)0.7;
    f.random_seed = (uint32_t)number;
    CHECK(gs4_add_particles(sim, gs4_sphere(at(5 * h, 3 * h, 5 * h), (gs4_real)(2 * h)), &f) > 0);
    stability_stir(sim, 1e-2 * (s->sound_speed + s->flight * h), 1);
    energy = stability_energy(sim, s->sound_speed);
    for (i = 0; i < 21 && !fault; i++) {
        const double limit = (double)gs4_stable_dt(sim);
        result = i < 20 ? gs4_step(sim, (gs4_real)(0.95 * limit))
                        : gs4_advance(sim, (gs4_real)(10 * limit));
        if (result < 0) ++*refused;
        fault = stability_fault(sim, s, i, result, energy);
    }
    if (fault)
        printf("    call %d of 21 gave %d (%s), %llu steps, energy %.3g of what it was\n", i,
               result, result < 0 ? gs4_last_error(sim) : "",
               (unsigned long long)gs4_get_stats(sim).steps,
               stability_energy(sim, s->sound_speed) / energy);
    gs4_destroy(sim);
    return fault;
}

/* A step, and what fades in two to ten times as long, whose cubed rates no float holds. On a
 * lattice of two a cell velocities that alternate have no momentum at any node, so that all of them
 * fades: as exp(-t/decay), but for an error of second order. */
static void test_tiny_step(void)
{
    static const double decays[2] = { 2e-15, 1e-14 }, errors[2] = { 0.05, 0.005 };
    const gs4_material m = scene_liquid(1000, 1, 10);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    int i, k, step;
    for (k = 0; k < 2; k++) {
        gs4_sim_desc d = scene_cube(4);
        gs4_view x;
        gs4_edit v;
        gs4_sim *sim;
        for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_PERIODIC;
        d.flip_decay_time = (gs4_real)decays[k];
        sim = physics_create(&d, &m);
        CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f) == 512);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (i = 0; i < v.count; i++)
            v.data[(size_t)i * (size_t)v.stride] =
                (gs4_real)((int)(8 * x.data[(size_t)i * (size_t)x.stride]) & 1 ? 0.1 : -0.1);
        for (step = 1; step <= 20; step++) {
            const double exact = exp(-1e-15 * step / decays[k]);
            double left;
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-15), GS4_OK);
            left = (double)gs4_get_stats(sim).max_speed / 0.1;
            if (test_filter[0]) printf("step %d: %.6f, exact %.6f\n", step, left, exact);
            CHECK_CLOSE(left, exact, errors[k]);
        }
        gs4_destroy(sim);
    }
}

/* A block of 8 cm on a slippery floor, let go at t = 0. With u = e (x/2, -y, z/2) its weight does
 * the work m g e H/2, its kinetic energy is 3/16 m e^2 H^2 and viscosity takes 3 nu m e^2: so e
 * goes to g H/(6 nu) as 1 - exp(-8 nu t/H^2). What fades within a step of dt acts as nu = h^2/(4
 * dt) at most. So it sinks at least as far as such a block, and no further than without nu. */
static void stability_collapses(gs4_sim *sim)
{
    const double H = 0.08, g = 9.81, h = 0.01, rho = 1000, c = 10,
                 dt = 0.5 * (double)gs4_stable_dt(sim), nu = 1 / rho + h * h / (4 * dt),
                 slow = H * H / (8 * nu), most = g * H / (6 * nu);
    const gs4_stats s = gs4_get_stats(sim);
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const double e = most * (1 - exp(-s.time / slow)), least = H / 2 * (most * s.time - e * slow),
                 furthest = g * s.time * s.time / 3, energy = s.kinetic_energy / s.mass;
    double fell = H / 2;
    int i;
    for (i = 0; i < x.count; i++)
        fell -= (double)x.data[(size_t)i * (size_t)x.stride + 1] / x.count;
    if (test_filter[0])
        printf("t %.4f: fell %.5f, %.5f to %.5f; energy %.5f, %.5f to %.5f; J %.4f to %.4f\n",
               s.time, fell, least, furthest, energy, 3.0 / 16 * e * e * H * H, g * fell,
               (double)s.min_volume_ratio, (double)s.max_volume_ratio);
    CHECK_BETWEEN(fell, least, furthest);
    CHECK_BETWEEN(energy, 3.0 / 16 * e * e * H * H, g * fell);
    /* at most twice the weight of what is above, as of one let go at once */
    CHECK_BETWEEN(s.min_volume_ratio, 1 - 2.4 * g * H / (c * c), 1 - 0.4 * g * H / (c * c));
    CHECK_BETWEEN(s.max_volume_ratio, 1, 1 + g * H / (c * c));
}

/* Motion that fades within a step leaves no rate behind that a longer step would blow up: a drop
 * that hits the floor gains nothing, and a block that sinks under its weight goes on sinking when
 * steps of a thousandth come between. */
static void test_short_decay(void)
{
    static const double decays[3] = { 1e-5, 1e-7, 1e-30 },
                        rhos[3][2] = { { 0, 0 }, { 0.6, 0.1 }, { 1, 0.5 } };
    int k, i, wall, rho;
    for (rho = 0; rho < 3; rho++)
        for (k = test_full ? 0 : rho; k < (test_full ? 3 : rho + 1); k++) {
            gs4_sim_desc d = scene_cube(16);
            gs4_material m = scene_liquid(1000, 0.1, 20);
            gs4_fill f = scene_fill(at(1, -5, 0));
            gs4_sim *sim;
            gs4_stats after;
            double energy;
            d.cell_size = (gs4_real)0.01;
            d.gravity = at(0, -9.81, 0);
            d.flip_decay_time = (gs4_real)decays[k];
            d.rho_inf = (gs4_real)rhos[rho][0];
            d.rho_inf_spurious = (gs4_real)rhos[rho][1];
            m.solid = GS4_NEO_HOOKEAN;
            m.shear_modulus = 10000;
            for (wall = 0; wall < 2; wall++) {
                d.walls[2] = wall ? GS4_WALL_SLIP : GS4_WALL_STICK;
                sim = physics_create(&d, &m);
                CHECK(gs4_add_particles(sim, gs4_sphere(at(0.08, 0.02, 0.08), 0.01), &f) > 0);
                energy = gs4_get_stats(sim).kinetic_energy;
                for (i = 0; i < 5; i++) {
                    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.004), GS4_OK);
                    /* a slip wall leaves momentum along it: 1 m/s of sqrt(26) */
                    after = gs4_get_stats(sim);
                    CHECK_BETWEEN(after.kinetic_energy / energy, wall ? 0.99 / 26 : 0, 0.3);
                    CHECK_BETWEEN(after.momentum[0] / after.mass, wall ? 0.99 : 0, 1.001);
                }
                gs4_destroy(sim);
            }
            m = scene_liquid(1000, 1, 10);
            f = scene_fill(at(0, 0, 0));
            f.jitter = (gs4_real)0.5;
            sim = physics_create(&d, &m);
            CHECK(gs4_add_particles(sim, gs4_box(at(0.04, 0, 0.04), at(0.12, 0.08, 0.12)), &f) > 0);
            for (i = 0; i < 8; i++) {
                CHECK_RESULT(
                    sim,
                    gs4_advance(sim, i & 1 ? (gs4_real)1e-3 * gs4_stable_dt(sim) : (gs4_real)0.01),
                    GS4_OK);
                stability_collapses(sim);
            }
            gs4_destroy(sim);
        }
}

static gs4_real stability_viscosity(gs4_real T, gs4_real rate, void *user)
{
    (void)T;
    (void)rate;
    return *(const gs4_real *)user;
}

/* Viscosity alone limits the step, dt ~ 1/mu, and is higher once the step is under way: up to a
 * quarter is let pass, more is refused and nothing has happened. */
static void test_thickening_within_a_step(void)
{
    static const double rise[4] = { 1, 1.24, 1.26, 100 };
    gs4_real viscosity = 1;
    int i, k;
    for (k = 0; k < 2; k++) {
        gs4_sim_desc d = scene_cube(8);
        gs4_material m = scene_liquid(1, 0, 1e-4);
        const gs4_fill f = scene_fill(at(1e-3, 0, 0));
        gs4_sim *sim;
        d.integrator = physics_integrators[k];
        m.viscosity_law = GS4_VISCOSITY_CALLBACK;
        m.viscosity_fn = stability_viscosity;
        m.viscosity_user = &viscosity;
        viscosity = 1;
        sim = physics_create(&d, &m);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.75, 0.75)), &f) > 0);
        for (i = 0; i < 4; i++) {
            gs4_real dt;
            uint64_t before;
            viscosity = 1;
            CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim)), GS4_OK);
            dt = gs4_stable_dt(sim);
            before = gs4_state_hash(sim);
            viscosity = (gs4_real)rise[i];
            CHECK_RESULT(sim, gs4_step(sim, dt), rise[i] < 1.25 ? GS4_OK : GS4_ERROR_UNSTABLE);
            CHECK((gs4_state_hash(sim) == before) == (rise[i] > 1.25));
            if (rise[i] > 1.25) CHECK(strstr(gs4_last_error(sim), "viscosity rose during"));
        }
        gs4_destroy(sim);
    }
}

/* What thickens in shear says little of its limit at rest: gs4_advance finds it. */
static void test_thickening(void)
{
    gs4_sim_desc d = scene_cube(8);
    gs4_material m = scene_liquid(1000, 0, 0);
    const gs4_fill f = scene_fill(at(0, -0.1, 0));
    gs4_sim *sim;
    d.cell_size = (gs4_real)0.001;
    d.gravity = at(0, -9.81, 0);
    d.ambient_temperature = 140;
    m.viscosity_law = GS4_VISCOSITY_CROSS_WLF;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.002, 0.001, 0.002), at(0.006, 0.005, 0.006)), &f)
          > 0);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)1e-4), GS4_OK);
    gs4_destroy(sim);
}

/* A nozzle that travels into the domain finds room for what it gives, whether max_particles is
 * set or not. */
static void test_nozzle_from_outside(void)
{
    int count[2], k, i;
    for (k = 0; k < 2; k++) {
        gs4_sim_desc d = scene_cube(16);
        const gs4_material m = scene_liquid(1000, 1, 0);
        gs4_emitter e;
        gs4_sim *sim;
        memset(&e, 0, sizeof e);
        d.cell_size = (gs4_real)0.01;
        d.max_particles = k ? 200000 : 0;
        sim = physics_create(&d, &m);
        e.shape = gs4_box(at(-0.08, 0.06, 0.06), at(0.001, 0.10, 0.10));
        e.travel = at(1, 0, 0);
        e.fill.velocity = at(2, 0, 0);
        CHECK(gs4_add_emitter(sim, &e) >= 0);
        for (i = 0; i < 30; i++) CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim)), GS4_OK);
        count[k] = gs4_get_stats(sim).particles;
        gs4_destroy(sim);
    }
    CHECK(count[0] > 0 && count[0] == count[1]);
}

/* 64 of the combinations, spread over them by the golden section; with --slow all. */
static void test_extremes(void)
{
    /* once more with sharpened gradients */
    const int all = 5 * 4 * 4 * 4 * 2 * 2 * 3, count = test_slow ? 2 * all : test_full ? 64 : 32;
    int i, refused = 0;
    for (i = 0; i < count; i++) {
        const int number = test_slow ? i % all : (int)((long)i * 2371 % all),
                  sharp = test_slow ? i >= all : i % 4 == 3;
        const stability_scene s = stability_choose(number);
        const char *fault;
        if (test_slow && sharp && s.integrator != GS4_INTEGRATOR_GS4) continue;
        scene_sharp = sharp && s.integrator == GS4_INTEGRATOR_GS4;
        fault = stability_try(&s, number, &refused);
        CHECK(fault == NULL);
        if (fault)
            printf("    %d: %s: viscosity %g, sound %g, gravity %g, cells of %g, flight %g, "
                   "integrator %d, floor %d, sharpened %d\n",
                   number, fault, s.viscosity, s.sound_speed, s.gravity, s.cell_size, s.flight,
                   (int)s.integrator, (int)s.floor, scene_sharp);
    }
    scene_sharp = 0;
    if (test_filter[0]) printf("%d scenes, %d of %d calls refused\n", count, refused, 21 * count);
}

/* Velocities (a x, b y, c z) + (0, s x, 0) + (v, 0, 0) of the nodes of a tile, cells of 1/2 m, mass
 * beside them; do they prove that a step of 0.1 s is safe? */
static gs4_real stability_tile[4 * 512 + 16];

static int stability_slopes(gs4_sim *sim, double a, double b, double c, double s, double v)
{
    int i;
    memset(sim, 0, sizeof *sim);
    sim->grid.h = (gs4_real)0.5;
    sim->integrator.dt = (gs4_real)0.1;
    for (i = 0; i < 512; i++) {
        const double x = 0.5 * (i % 8 - 3.5), y = 0.5 * (i / 8 % 8 - 3.5), z = 0.5 * (i / 64 - 3.5);
        stability_tile[4 * i] = (gs4_real)(a * x + v);
        stability_tile[4 * i + 1] = (gs4_real)(b * y + s * x);
        stability_tile[4 * i + 2] = (gs4_real)(c * z);
        stability_tile[4 * i + 3] = 1;
    }
    return gs4i_slopes_are_safe(sim, ~(uint64_t)0, stability_tile);
}

/* The second lemma of the manual's SAFETY: |div u| dt < 0.2 and |u_a| dt < h, neither more nor
 * less. */
static void test_safe_slopes(void)
{
    static gs4_sim sim;
    const double under = 1.99, over = 2.01; /* 0.2 / dt */
    uint32_t state = 1;
    int i, k;
    for (i = -1; i <= 1; i += 2) {
        CHECK(stability_slopes(&sim, i * under, 0, 0, 0, 0));
        CHECK(!stability_slopes(&sim, i * over, 0, 0, 0, 0));
        CHECK(!stability_slopes(&sim, 0, i * over, 0, 0, 0));
        CHECK(!stability_slopes(&sim, 0, 0, i * over, 0, 0));
        CHECK(stability_slopes(&sim, under / 3, under / 3, i * under / 3, 0, 0));
        CHECK(!stability_slopes(&sim, over / 3, over / 3, i * over / 3, 0, 0));
        CHECK(stability_slopes(&sim, 0, 0, 0, 2.8, 0)); /* shear, beyond what div u may be */
        CHECK(stability_slopes(&sim, 0, 0, 0, 0, i * 4.99));
        CHECK(!stability_slopes(&sim, 0, 0, 0, 0, i * 5.01));
    }
    stability_slopes(&sim, 0, 0, 0, 0, 4);
    memset(stability_tile + 4 * 200, 0, 4 * sizeof *stability_tile); /* nothing is there */
    CHECK(gs4i_slopes_are_safe(&sim, ~(uint64_t)0, stability_tile));
    stability_tile[4 * 200 + 3] = 1;
    CHECK(!gs4i_slopes_are_safe(&sim, ~(uint64_t)0, stability_tile));
    CHECK(gs4i_slopes_are_safe(&sim, ~((uint64_t)1 << 25), stability_tile)); /* not touched */
    stability_slopes(&sim, 0, 0, 0, 0, 4);
    stability_tile[4 * 100 + 1] = (gs4_real)NAN;
    CHECK(!gs4i_slopes_are_safe(&sim, ~(uint64_t)0, stability_tile));
    for (k = 0; k < 20; k++) { /* what it lets pass is so, for particles of any place */
        gs4_real x[4 * GS4I_BATCH];
        gs4i_frame frame = { { 0, 0, 0 }, { 0, 0, 0 }, 2 };
        gs4i_lanes at[4];
        gs4i_stencils s;
        gs4i_local g;
        int n;
        stability_slopes(&sim, 0, 0, 0, 0, 0);
        for (i = 0; i < 512 * 4; i++)
            if (i % 4 < 3) stability_tile[i] = (gs4_real)stability_random(&state);
        for (sim.integrator.dt = 1; !gs4i_slopes_are_safe(&sim, ~(uint64_t)0, stability_tile);)
            sim.integrator.dt *= (gs4_real)0.97;
        for (i = 0; i < 3; i++) {
            const int cell = 4 + (int)floor(6 * stability_random(&state));
            for (n = 0; n < GS4I_BATCH; n++)
                x[4 * n + i] = (gs4_real)(0.5 * (cell + 0.5 + stability_random(&state)));
        }
        for (n = 0; n < GS4I_BATCH; n++) x[4 * n + 3] = 1;
        gs4i_to_lanes(x, GS4I_BATCH, at);
        gs4i_stencils_at(&s, &frame, at);
        gs4i_gather_cell(stability_tile + 4 * s.base[0], &s, 1, &g);
        for (n = 0; n < GS4I_BATCH; n++)
            CHECK(fabs((double)(((gs4_real *)g.L[0][0])[n] + ((gs4_real *)g.L[1][1])[n]
                                + ((gs4_real *)g.L[2][2])[n])
                       * (double)sim.integrator.dt)
                  < 0.2001);
    }
}

/* S7 leaves particles of a block by cell, whatever they have, so that batches are full. */
static void test_cells_together(void)
{
    int k, i, o;
    for (k = 0; k < 2; k++) {
        gs4_sim_desc d = scene_cube(16);
        gs4_material m = scene_liquid(1000, 1, 10);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        gs4_edit v;
        const gs4_real *x;
        static double mass[32768];
        d.integrator = k ? GS4_INTEGRATOR_SYMPLECTIC_EULER : GS4_INTEGRATOR_GS4;
        d.max_particles = 32768;
        f.jitter = 1;
        f.random_seed = 3;
        CHECK(gs4_create(&d, &sim) == GS4_OK);
        CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
        CHECK_RESULT(sim, gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f), 0);
        v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        x = sim->particles.position;
        for (i = 0; i < v.count; i++) {
            v.data[(size_t)i * (size_t)v.stride] = (gs4_real)(3 * ((double)x[4 * i + 2] - 0.5));
            v.data[(size_t)i * (size_t)v.stride + 2] = (gs4_real)(3 * (0.5 - (double)x[4 * i]));
            sim->particles.position[4 * i + 3] *= (gs4_real)(1 + 1e-3 * (i % 7));
            mass[sim->particles.id[i]] = (double)x[4 * i + 3];
        }
        for (i = 0; i < 40; i++)
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.5 * gs4_stable_dt(sim)), GS4_OK);
        for (o = 0; o < sim->grid.occupied; o++)
            for (i = sim->grid.first[o]; i < sim->grid.first[o + 1]; i++) {
                CHECK(mass[sim->particles.id[i]] == (double)x[4 * i + 3]);
                CHECK(i == sim->grid.first[o]
                      || sim->particles.order[i - 1] <= sim->particles.order[i]);
            }
        gs4_destroy(sim);
    }
}

static gs4_real stability_shear_rate(gs4_real T, gs4_real rate, void *user)
{
    (void)T;
    (void)user;
    return rate;
}

/* The rim of a collider that turns, of every shape, counts in the limit of a step, as far as the
 * domain reaches; and where that is slow, the angle does: sqrt(2) w dt <= 1. */
static gs4_real stability_any_distance(gs4_vec3 p, void *user)
{
    (void)user;
    return (gs4_real)fabs((double)p.x - 0.5) - (gs4_real)0.1;
}

static gs4_shape stability_shape(int i)
{
    static const gs4_real vertices[12] = { (gs4_real)0.5, (gs4_real)0.5, (gs4_real)0.5,
                                           (gs4_real)0.8, (gs4_real)0.5, (gs4_real)0.5,
                                           (gs4_real)0.5, (gs4_real)0.9, (gs4_real)0.5,
                                           (gs4_real)0.5, (gs4_real)0.5, (gs4_real)0.9 };
    static const int triangles[12] = { 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3 };
    switch (i) {
    case 0: return gs4_box(at(0.2, 0.1, 0.5), at(0.6, 0.3, 0.55));
    case 1: return gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.2); /* turns into itself */
    case 2: return gs4_sphere(at(0.5, 0.8, 0.4), (gs4_real)0.1);
    case 3: return gs4_cylinder(at(0.5, 0.6, 0.2), at(0.5, 0.6, 0.4), (gs4_real)0.15);
    case 4: return gs4_mesh(vertices, 4, triangles, 4);
    case 5: return gs4_sdf(stability_any_distance, NULL, at(0.4, 0.4, 0.4), at(0.6, 0.5, 0.6));
    case 6: return gs4_sdf(stability_any_distance, NULL, at(-9, -9, -9), at(9, 9, 9));
    case 7: return gs4_plane(at(0.5, 0.1, 0.5), at(0, 1, 0));
    default: return gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.01);
    }
}

static void test_stability_of_turning(void)
{
    /* farthest from the axis along z through (0.5, 0.5); cells are 1/8, so at the least the angle
     * counts as much as a rim at sqrt(2)/8 */
    const double far[9] = { 0.5,           0.2,       0.4,       0.25, sqrt(0.3 * 0.3 + 0.4 * 0.4),
                            sqrt(2) * 0.1, sqrt(0.5), sqrt(0.5), 0.01 };
    const double tiny = sizeof(gs4_real) == 8 ? 1e-12 : 2e-6;
    int i, w, later;
    for (i = 0; i < 9; i++)
        for (w = 0; w < 6; w++)
            for (later = 0; later < 2; later++) {
                gs4_sim_desc d = scene_cube(8);
                const gs4_material m = scene_liquid(1000, 0, 1e-3),
                                   by_default = scene_liquid(1000, 0, 0);
                const double turn = pow(10, w) * (w % 2 ? 1 : -1),
                             rim = fmax(far[i], sqrt(2) / 8) * fabs(turn);
                gs4_collider c;
                gs4_sim *sim;
                memset(&c, 0, sizeof c);
                c.shape = stability_shape(i);
                c.pivot = at(0.5, 0.5, 0.5);
                if (!later) c.angular_velocity.z = (gs4_real)turn;
                CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
                CHECK(gs4_add_collider(sim, &c) == 0);
                if (later)
                    CHECK_RESULT(sim, gs4_move_collider(sim, 0, at(0, 0, 0), at(0, 0, turn)), 0);
                CHECK_CLOSE(gs4_stable_dt(sim) * rim * 8, 1, tiny);
                CHECK(gs4_add_material(sim, &by_default) == 1);
                CHECK_CLOSE(sim->constants[1].sound_speed / (10 * far[i] * fabs(turn)), 1, tiny);
                gs4_destroy(sim);
            }
}

/* A blade turns in a liquid, its rim at any speed: gs4_advance goes on for half a turn. With
 * symplectic Euler, which knows no sub-grid velocity, the liquid is no faster than the nodes that
 * the blade holds, up to 3/4 of a cell before it, and what falls. */
static void stability_blade(int integrator, gs4_wall contact, double rim)
{
    gs4_sim_desc d = scene_cube(10);
    const gs4_material m = scene_liquid(1000, 0.1, 0);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const double w = rim / 0.305;
    gs4_collider c;
    gs4_sim *sim;
    memset(&c, 0, sizeof c);
    d.gravity.y = (gs4_real)-9.81;
    d.integrator = physics_integrators[integrator];
    sim = physics_create(&d, &m);
    c.shape = gs4_box(at(0.2, 0.05, 0.45), at(0.8, 0.5, 0.55));
    c.pivot = at(0.5, 0, 0.5);
    c.contact = contact;
    c.angular_velocity.y = (gs4_real)w;
    CHECK(gs4_add_collider(sim, &c) == 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 0.3, 1)), &f) > 0);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)(3 / w)), GS4_OK);
    if (test_filter[0])
        printf("blade, integrator %d, contact %d, rim at %g: %llu steps, liquid at %.3f of it\n",
               integrator, (int)contact, rim, (unsigned long long)gs4_get_stats(sim).steps,
               (double)gs4_get_stats(sim).max_speed / rim);
    /* what is before the outer half of the blade cannot be slower than half of its rim */
    CHECK_BETWEEN((double)gs4_get_stats(sim).max_speed / rim, 0.5,
                  integrator ? 1.02 * (1 + 0.075 * w / rim) + 30 / w / rim : 1e9);
    gs4_destroy(sim);
}

static void test_stability_of_blades(void)
{
    int i, k;
    for (i = 0; i < 2; i++)
        for (k = test_slow ? 0 : 4 - i; k < (test_slow ? 5 : 5 - i); k++) {
            stability_blade(i, GS4_WALL_STICK, pow(10, k));
            stability_blade(i, k % 2 ? GS4_WALL_SLIP : GS4_WALL_SEPARATE, pow(10, k));
        }
}

/* What sets the limit, in scenes that one thing rules. */
static void test_stability_names(void)
{
    static const struct {
        gs4_scheme scheme;
        double viscosity, sound_speed, speed, gravity, max_dt, relaxation, G;
        const char *name;
    } scenes[] = {
        { GS4_EXPLICIT, 0, 10, 0, 1, 0, 0, 0, "sound" },
        { GS4_EXPLICIT, 1000, 10, 0, 1, 0, 0, 0, "viscosity" },
        { GS4_EXPLICIT, 1, 10, 0, 1, 0, 0, 1e7, "elasticity" },
        { GS4_EXPLICIT, 0, 1e-3, 5, 1, 0, 0, 0, "flow" },
        { GS4_EXPLICIT, 1e-3, 1, 0, 1, 0, 1e-7, 0, "elasticity" },
        { GS4_EXPLICIT, 0, 10, 0, 1, 1e-5, 0, 0, "max_dt" },
        { GS4_PARTITIONED, 0, 10, 0, 1, 0, 0, 0, "surface" },
        { GS4_PARTITIONED, 1000, 10, 0, 1, 0, 0, 0, "viscosity" },
        { GS4_SEMI_IMPLICIT, 0, 10, 0, 1, 0, 0, 0, "surface" },
        { GS4_SEMI_IMPLICIT, 1e6, 10, 0, 1, 0, 0, 0, "flow" },
        { GS4_SEMI_IMPLICIT, 1e6, 10, 0, 0, 0, 0, 0, "none" },
        { GS4_SEMI_IMPLICIT, 1e-3, 1, 0, 1, 0, 1e-7, 0, "relaxation" }, /* Pom-Pom */
    };
    size_t i;
    for (i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        gs4_sim_desc d = scene_cube(8);
        gs4_material m = scene_liquid(1000, scenes[i].viscosity, scenes[i].sound_speed);
        const gs4_fill f = scene_fill(at(scenes[i].speed, 0, 0));
        gs4_sim *sim;
        d.scheme = scenes[i].scheme;
        d.gravity = at(0, -scenes[i].gravity, 0);
        d.max_dt = (gs4_real)scenes[i].max_dt;
        if (scenes[i].relaxation > 0) {
            m.liquid = GS4_OLDROYD_B;
            m.local_fraction = (gs4_real)0.5;
            m.relaxation_time = (gs4_real)scenes[i].relaxation;
            if (scenes[i].scheme == GS4_SEMI_IMPLICIT) {
                m.liquid = GS4_POM_POM;
                m.stretch_time = 2 * m.relaxation_time;
                m.arms = 4;
            }
        }
        if (scenes[i].G > 0) {
            m.solid = GS4_NEO_HOOKEAN;
            m.shear_modulus = (gs4_real)scenes[i].G;
        }
        CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
        CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.4, 0.4, 0.4), at(0.6, 0.6, 0.6)), &f) > 0);
        if (strcmp(gs4_limit_name(sim), scenes[i].name) != 0)
            printf("%d: %s instead of %s\n", (int)i, gs4_limit_name(sim), scenes[i].name);
        CHECK(strcmp(gs4_limit_name(sim), scenes[i].name) == 0);
        gs4_destroy(sim);
    }
    CHECK(strcmp(gs4_limit_name(NULL), "none") == 0);
}

/* The limit of a step where one thing rules it, by hand: fall, speed and fall, sound of what is
 * compressed. And what that stands on: default speeds of sound, the shear rate of a gradient. */
static void test_stability_by_hand(void)
{
    const double g = 10, h = 1.0 / 8, tiny = sizeof(gs4_real) == 8 ? 1e-12 : 2e-6;
    int axis, i, moves;
    for (axis = 0; axis < 3; axis++)
        for (moves = 0; moves < 2; moves++) {
            const double v = moves ? 0.7 : 0;
            gs4_sim_desc d = scene_cube(8);
            const gs4_material m = scene_liquid(1000, 0, 1e-3),
                               by_default = scene_liquid(1000, 0, 0);
            const gs4_fill f =
                scene_fill(at(axis == 0 ? v : 0, axis == 1 ? v : 0, axis == 2 ? v : 0));
            gs4_collider c;
            gs4_sim *sim;
            d.cells[axis] = 16;
            d.gravity = at(axis == 0 ? g : 0, axis == 1 ? -g : 0, axis == 2 ? g : 0);
            CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
            CHECK(gs4_add_particles(sim, gs4_box(at(0.4, 0.4, 0.4), at(0.6, 0.6, 0.6)), &f) > 0);
            CHECK_CLOSE(gs4_stable_dt(sim) * (v + sqrt(v * v + 2 * g * h)) / (2 * h), 1, tiny);
            /* (v^2 + 2 g times the height)^(1/2), ten times */
            CHECK(gs4_add_material(sim, &by_default) == 1);
            CHECK_CLOSE(sim->constants[1].sound_speed / (10 * sqrt(v * v + 2 * g * 16 * h)), 1,
                        tiny);
            memset(&c, 0, sizeof c);
            c.shape = gs4_sphere(at(0.1, 0.1, 0.1), (gs4_real)0.05);
            c.velocity = at(0, 0, axis - 3.0);
            CHECK(gs4_add_collider(sim, &c) == 0);
            CHECK_CLOSE(gs4_stable_dt(sim) * (3 - axis + sqrt((3 - axis) * (3 - axis) + 2 * g * h))
                            / (2 * h),
                        1, tiny);
            gs4_destroy(sim);
        }
    /* a liquid that turns, for Euler, which knows its gradient from the start: |L| = sqrt(2) w */
    for (axis = 0; axis < 3; axis++) {
        gs4_sim_desc d = scene_cube(8);
        const gs4_material m = scene_liquid(1000, 0, 1e-3);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
        f.angular_velocity = at(axis == 0 ? 50 : 0, axis == 1 ? 50 : 0, axis == 2 ? 50 : 0);
        CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.5, 0.5, 0.5), at(0.625, 0.625, 0.625)), &f) == 8);
        CHECK_CLOSE(gs4_stable_dt(sim) * 50 * sqrt(2.0), 1, 3 * tiny);
        gs4_destroy(sim);
    }
    /* symplectic Euler: (om dt)^2 + 2 d dt = 4, om = sqrt(12) c/h, d = 16 nu/h^2 */
    for (i = 0; i < 3; i++) {
        const double c = i == 1 ? 1e-6 : 3, nu = i == 2 ? 0 : 0.05, dt_h = 16 * nu / (h * h);
        gs4_sim_desc d = scene_cube(8);
        const gs4_material m = scene_liquid(10, 10 * nu, c);
        const gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        double dt;
        d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
        CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.4, 0.4, 0.4), at(0.6, 0.6, 0.6)), &f) > 0);
        dt = (double)gs4_stable_dt(sim);
        CHECK_CLOSE((12 * c * c * dt / (h * h) + 2 * dt_h) * dt / 4, 1, 3 * tiny);
        gs4_destroy(sim);
    }
    for (i = 0; i < 2; i++) {
        const double J = i ? 0.9 : 1.1;
        const gs4_sim_desc d = scene_cube(8);
        const gs4_material m = scene_liquid(1000, 0, 20);
        const gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_sim *sim;
        double before;
        int n;
        CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.4, 0.4, 0.4), at(0.6, 0.6, 0.6)), &f) > 0);
        before = (double)gs4_stable_dt(sim);
        for (n = 0; n < sim->particles.count; n++) sim->particles.velocity[4 * n + 3] = (gs4_real)J;
        /* c = c0 / J^3 by (3) */
        CHECK_CLOSE(gs4_stable_dt(sim) / before, J * J * J, 10 * tiny);
        gs4_destroy(sim);
    }
    for (i = 0; i < 9; i++) {
        gs4i_material_constants constants;
        gs4i_gradient L;
        memset(&constants, 0, sizeof constants);
        memset(L, 0, sizeof L);
        constants.varies = 1;
        constants.viscosity_fn = stability_shear_rate;
        ((gs4_real *)(void *)L[i / 3][i % 3])[0] = 3;
        /* sqrt(2 D:D): 3 in shear, 2 * 3 in a stretch along one axis over sqrt(2) */
        CHECK_CLOSE(gs4i_viscosity_of(&constants, 0, L, 0), i % 4 ? 3 : 3 * sqrt(2.0), 3 * tiny);
    }
}
