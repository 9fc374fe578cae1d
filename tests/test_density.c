/* Two liquids of different density, up to 1000 to 1: rest, an exact piston, drops that fall and
 * rise, steps just below the limit. */

#define DENSITY_CELL 0.01 /* m */

/* A box of n x height x n cells of 1 cm with slip walls, gravity along -y; material 0 is light. */
static gs4_sim *density_box(gs4_sim_desc d, int n, int height, double heavy, double c_light,
                            double c_heavy, double nu)
{
    const gs4_material light = scene_liquid(1, nu, c_light),
                       dense = scene_liquid(heavy, nu * heavy, c_heavy);
    gs4_sim *sim;
    d.cells[0] = d.cells[2] = n;
    d.cells[1] = height;
    d.cell_size = (gs4_real)DENSITY_CELL;
    d.gravity = at(0, -10, 0);
    sim = physics_create(&d, &light);
    CHECK(gs4_add_material(sim, &dense) == 1);
    return sim;
}

static double density_tait(double rho, double c, double J)
{
    return rho * c * c / 7 * (pow(J, -7) - 1);
}

/* --- stability -------------------------------------------------------------------------------- */

/* Kinetic and compressive energy, materials with sound speeds c[0] and c[1]. */
static double density_energy(gs4_sim *sim, const double c[2])
{
    const gs4_view J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    const uint8_t *material = gs4_particle_materials(sim);
    double sum = gs4_get_stats(sim).kinetic_energy + stability_gradient_energy(sim);
    int i;
    for (i = 0; i < J.count; i++) {
        const double j = (double)J.data[(size_t)i * (size_t)J.stride], own = c[material[i]];
        sum += (double)m.data[(size_t)i * (size_t)m.stride] * own * own / 7
               * (pow(j, -6) / 6 + j - 7.0 / 6);
    }
    return sum;
}

/* Every particle of a full box of 6^3 cells, jittered, is heavy by chance; stirred. What 0.95 of
 * the limit makes of its energy. Heavy particles are `wide` spacings wide. */
static double density_growth(double ratio, double share, int wide, double rho, int sharp)
{
    gs4_sim_desc d = scene_cube(6);
    gs4_real *x[2];
    const double c[2] = { 10, 10 }, spacing = DENSITY_CELL / 2;
    gs4_fill f = scene_fill(at(0, 0, 0));
    int count[2] = { 0, 0 }, i, k, b, a[3];
    uint32_t seed = 12345;
    gs4_sim *sim;
    double start, most = 0;
    d.rho_inf = (gs4_real)rho;
    d.flip_decay_time = INFINITY;
    d.sharp_gradients = sharp;
    sim = density_box(d, 6, 6, ratio, c[0], c[1], 0);
    CHECK_RESULT(sim, gs4_set_gravity(sim, at(0, 0, 0)), GS4_OK);
    for (k = 0; k < 2; k++) x[k] = (gs4_real *)malloc(3 * 12 * 12 * 12 * sizeof *x[k]);
    for (i = 0; i < 12 * 12 * 12; i++) {
        a[0] = i % 12;
        a[1] = i / 12 % 12;
        a[2] = i / 144;
        k = stability_random(&seed) + 0.5 < share
            && (wide == 1 || (a[0] % 2 && a[1] % 2 && a[2] % 2));
        for (b = 0; b < 3; b++)
            x[k][3 * count[k] + b] =
                (gs4_real)((a[b] + 0.5 + 0.99 * stability_random(&seed)) * spacing);
        count[k]++;
    }
    for (k = 0; k < 2; k++) {
        f.material = k;
        CHECK(gs4_add_points(sim, x[k], count[k],
                             (gs4_real)(pow(spacing, 3) * (k ? wide * wide * wide : 1)), &f)
              == count[k]);
        free(x[k]);
    }
    stability_stir(sim, 0.01, 1);
    stability_settle(sim);
    start = density_energy(sim, c);
    for (i = 0; i < 300 && most < 100; i++) {
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.95 * (double)gs4_stable_dt(sim))), GS4_OK);
        most = fmax(most, density_energy(sim, c) / start);
    }
    if (test_filter[0])
        printf("%g to 1, %g heavy, %d wide, rho %g, sharp %d: energy at most %.4f, at the end "
               "%.4f of what it was\n",
               ratio, share, wide, rho, sharp, most, density_energy(sim, c) / start);
    CHECK(density_energy(sim, c) / start > 0.02);
    gs4_destroy(sim);
    return most;
}

/* Lone heavy particles among light ones swing by themselves, twice as fast as a liquid of their
 * own: steps just below the limit leave no more energy than there was. */
static void test_density_stability(void)
{
    static const double ratios[4] = { 1000, 100, 30, 10 };
    int i, k;
    for (i = 0; i < (test_full ? 4 : 2); i++)
        for (k = 0; k < (test_full ? 6 : 1); k++)
            CHECK(density_growth(ratios[i], k % 3 == 1 ? 0.1 : 0.01, 1 + (k % 3 == 2), k < 3, 0)
                  < 1.001);
    CHECK(density_growth(10, 0.4, 2, 1, 0) < 1.001);
    if (test_full) CHECK(density_growth(1000, 0.01, 1, 1, 1) < 1.001);
}

/* The limit of a box half full of one material while one of density `light` is declared. */
static double density_limit_of(gs4_integrator integrator, gs4_material m, double light, double c)
{
    const double h = DENSITY_CELL;
    const gs4_material other = scene_liquid(light, 0, c);
    gs4_sim_desc d = scene_cube(8);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    double dt;
    d.cell_size = (gs4_real)h;
    d.gravity = at(0, -10, 0);
    d.integrator = integrator;
    sim = physics_create(&d, &m);
    CHECK(gs4_add_material(sim, &other) == 1);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(8 * h, 4 * h, 8 * h)), &f) > 0);
    f.material = 1;
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 4 * h, 0), at(8 * h, 5 * h, 8 * h)), &f) > 0);
    dt = (double)gs4_stable_dt(sim);
    gs4_destroy(sim);
    return dt;
}

/* Where nothing is lighter the limit is what it was, in symplectic Euler always. What is stiffer
 * yet counts as it did. A denser material makes default speeds of sound of the others higher. */
static void test_density_limit(void)
{
    const double alike = sqrt(2.0 / 3) * DENSITY_CELL / 10, tiny = 1e-6,
                 lone = sqrt(4 / (1 + 3 * 8.0 / 1000)), stiff = 10 * sqrt(1000.0);
    gs4_material m = scene_liquid(1000, 0, 10);
    double dt;
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_GS4, m, 1000, 10) / alike, 1, tiny);
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_GS4, m, 1500, 1) / alike, 1, tiny);
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_GS4, m, 1, 10) / alike * lone, 1, tiny);
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_GS4, m, 1, stiff) / alike * stiff / 10, 1, tiny);
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_SYMPLECTIC_EULER, m, 1, 10) / alike,
                sqrt(4.0 / 12) / sqrt(2.0 / 3), tiny);
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1e6;
    dt = density_limit_of(GS4_INTEGRATOR_GS4, m, 1000, 10);
    CHECK(dt < 0.5 * alike);
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_GS4, m, 1, 10) / dt * lone, 1, tiny);
    /* by default: 2 g H = 1.6 */
    m = scene_liquid(1000, 0, 0);
    CHECK_CLOSE(density_limit_of(GS4_INTEGRATOR_GS4, m, 1, 0) / alike * sqrt(1.6 * 1000), 1, tiny);
}

/* The heaviest particle counts when it is gone, too, here and in what is loaded. */
static void test_density_saved(void)
{
    const double h = DENSITY_CELL;
    gs4_sim_desc d = scene_cube(8);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim[2];
    double dt;
    int i;
    for (i = 0; i < 2; i++) sim[i] = density_box(d, 8, 8, 1000, 10, 30, 0);
    f.material = 1;
    CHECK(gs4_add_particles(sim[0], gs4_box(at(0, 0, 0), at(8 * h, h, 8 * h)), &f) > 0);
    f.spacing = (gs4_real)(h / 4);
    CHECK(gs4_add_particles(sim[0], gs4_box(at(0, 4 * h, 0), at(8 * h, 5 * h, 8 * h)), &f) > 0);
    CHECK(gs4_remove_particles(sim[0], gs4_box(at(0, 0, 0), at(8 * h, h, 8 * h))) == 8 * 8 * 8);
    dt = (double)gs4_stable_dt(sim[0]);
    CHECK_CLOSE(dt * sqrt(4 / (1 + 3 * 8.0 / 1000)), sqrt(2.0 / 3) * h / 30, 1e-6 * dt);
    CHECK_RESULT(sim[0], gs4_save(sim[0], files_path("density.sav")), GS4_OK);
    CHECK_RESULT(sim[1], gs4_load(sim[1], files_path("density.sav")), GS4_OK);
    CHECK((double)gs4_stable_dt(sim[1]) == dt);
    for (i = 0; i < 2; i++) gs4_destroy(sim[i]);
}

/* --- an exact piston -------------------------------------------------------------------------- */

/* A heavy slab on a soft light gas, which it presses alike all over: y'' = p(y/gas)/(rho slab) - g.
 * How far it has come down at `time`, by Runge and Kutta. */
static double density_piston(double gas, double slab, double heavy, double c, double time)
{
    const int steps = 4000;
    const double dt = time / steps;
    double y = gas, v = 0;
    int i, k;
    for (i = 0; i < steps; i++) {
        double dy[5] = { 0 }, dv[5] = { 0 };
        for (k = 1; k < 5; k++) {
            const double ahead = k == 1 ? 0 : k == 4 ? dt : dt / 2;
            dy[k] = v + ahead * dv[k - 1];
            dv[k] = density_tait(1, c, (y + ahead * dy[k - 1]) / gas) / (heavy * slab) - 10;
        }
        y += dt / 6 * (dy[1] + 2 * dy[2] + 2 * dy[3] + dy[4]);
        v += dt / 6 * (dv[1] + 2 * dv[2] + 2 * dv[3] + dv[4]);
    }
    return gas - y;
}

/* Mean height of material `material` above where it began, m; its extremes of J and speed. */
typedef struct density_seen {
    double height, low_J, high_J, speed;
} density_seen;

static density_seen density_look(const gs4_sim *sim, int material, int axis)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY),
                   J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO);
    const uint8_t *of = gs4_particle_materials(sim);
    density_seen s = { 0, 1e9, 0, 0 };
    int i, c, n = 0;
    for (i = 0; i < x.count; i++) {
        const double j = (double)J.data[(size_t)i * (size_t)J.stride];
        if (of[i] != material) continue;
        s.height += (double)x.data[(size_t)i * (size_t)x.stride + axis];
        s.low_J = fmin(s.low_J, j);
        s.high_J = fmax(s.high_J, j);
        for (c = 0; c < 3; c++)
            s.speed = fmax(s.speed, fabs((double)v.data[(size_t)i * (size_t)v.stride + c]));
        n++;
    }
    s.height /= n;
    return s;
}

/* The centre of the slab follows the exact motion down and up again, to 0.3 cells, which is what a
 * gas of 4 cells in the end has for a surface. */
static void density_bounce(gs4_integrator integrator, double heavy, double tolerance)
{
    const double h = DENSITY_CELL, gas = 12 * h, slab = 6 * h;
    gs4_sim_desc d = scene_cube(4);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double start, deepest = 0, exact_deepest = 0, worst = 0;
    gs4_sim *sim;
    int i;
    d.integrator = integrator;
    sim = density_box(d, 4, 24, heavy, 10, 40, 1e-3);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(4 * h, gas, 4 * h)), &f) > 0);
    f.material = 1;
    CHECK(gs4_add_particles(sim, gs4_box(at(0, gas, 0), at(4 * h, gas + slab, 4 * h)), &f) > 0);
    start = density_look(sim, 1, 1).height;
    for (i = 1; i <= 8; i++) {
        const double exact = density_piston(gas, slab, heavy, 10, 0.025 * i);
        double fallen;
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.025), GS4_OK);
        fallen = start - density_look(sim, 1, 1).height;
        worst = fmax(worst, fabs(fallen - exact));
        deepest = fmax(deepest, fallen);
        exact_deepest = fmax(exact_deepest, exact);
        if (test_filter[0])
            printf("piston, integrator %d, %g to 1: at %.3f s down by %.5f m, exact %.5f\n",
                   (int)integrator, heavy, 0.025 * i, fallen, exact);
    }
    CHECK(worst < tolerance * exact_deepest);
    gs4_destroy(sim);
}

static void test_density_piston(void)
{
    density_bounce(GS4_INTEGRATOR_GS4, 1000, 0.05);
    density_bounce(GS4_INTEGRATOR_GS4, 100, 0.05);
    density_bounce(GS4_INTEGRATOR_SYMPLECTIC_EULER, 1000, 0.05);
    density_bounce(GS4_INTEGRATOR_SYMPLECTIC_EULER, 100, 0.05);
}

/* --- rest ------------------------------------------------------------------------------------- */

typedef struct density_rest {
    double speed[2]; /* over sqrt(g H), light and heavy */
    double heavy;    /* worst pressure, over that of both layers at the floor */
    double
        light; /* the same in the light one from 1.5 cells above the heavy one on, over its own */
    double between; /* and below, over that of a cell of the heavy one */
} density_rest;

/* Five cells of light on five of heavy liquid, the floor at the low or high end of an axis. */
static density_rest density_at_rest(gs4_integrator integrator, double heavy, int axis, int high)
{
    const double h = DENSITY_CELL, layer = 5 * h, c = 14, g = 10;
    gs4_sim_desc d = scene_cube(4);
    gs4_material m[2];
    density_rest r = { { 0, 0 }, 0, 0, 0 };
    gs4_view x, J;
    gs4_sim *sim;
    int i, k;
    m[0] = scene_liquid(1, 0.04, c);
    m[1] = scene_liquid(heavy, 0.04 * heavy, c);
    d.cell_size = (gs4_real)h;
    d.integrator = integrator;
    d.cells[axis] = 14;
    (&d.gravity.x)[axis] = (gs4_real)(high ? g : -g);
    sim = physics_create(&d, &m[0]);
    CHECK(gs4_add_material(sim, &m[1]) == 1);
    for (k = 0; k < 2; k++) {
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_vec3 low = at(0, 0, 0), top = at(4 * h, 4 * h, 4 * h);
        const double from = (k ? 0 : layer), to = from + layer;
        (&low.x)[axis] = (gs4_real)(high ? 14 * h - to : from);
        (&top.x)[axis] = (gs4_real)(high ? 14 * h - from : to);
        f.material = k;
        CHECK(gs4_add_particles(sim, gs4_box(low, top), &f) == 4 * 4 * 5 * 8);
    }
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.6), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO);
    for (i = 0; i < x.count; i++) {
        const double at_x = (double)x.data[(size_t)i * (size_t)x.stride + (size_t)axis],
                     y = high ? 14 * h - at_x : at_x,
                     j = (double)J.data[(size_t)i * (size_t)J.stride];
        const int of = gs4_particle_materials(sim)[i];
        const double p = density_tait((double)m[of].density, c, j),
                     exact = of ? g * layer + heavy * g * (layer - y) : g * (2 * layer - y);
        double *worst = of ? &r.heavy : y > layer + 2.5 * h ? &r.light : &r.between;
        *worst = fmax(*worst, fabs(p - exact));
    }
    r.heavy /= (1 + heavy) * g * layer;
    r.light /= g * layer;
    r.between /= g * layer;
    for (k = 0; k < 2; k++) r.speed[k] = density_look(sim, k, axis).speed / sqrt(g * 2 * layer);
    if (test_filter[0])
        printf(
            "rest, integrator %d, %g to 1, axis %d, %s: speeds %.1e %.1e, pressure off by %.2f %% "
            "in the heavy one, %.2f %% in the light one, %.2f %% between\n",
            (int)integrator, heavy, axis, high ? "high" : "low", r.speed[0], r.speed[1],
            100 * r.heavy, 100 * r.light, 100 * r.between);
    gs4_destroy(sim);
    return r;
}

static void test_density_rest(void)
{
    int i, k;
    for (k = 0; k < (test_full ? 4 : 1); k++)
        for (i = 0; i < (test_full ? 6 : 1); i++) {
            const density_rest r = density_at_rest(physics_integrators[k / 2], k % 2 ? 30 : 1000,
                                                   (i / 2 + 1) % 3, i % 2);
            CHECK(r.speed[0] < 1e-3);
            CHECK(r.speed[1] < 1e-4);
            CHECK(r.heavy < 0.02);
            CHECK(r.light < 0.06);
            CHECK(r.between < 0.85);
        }
}

/* --- drops ------------------------------------------------------------------------------------ */

typedef enum density_scene {
    DENSITY_DROP,   /* a heavy cube falls on a light pool */
    DENSITY_BUBBLE, /* a light ball rises in a heavy pool */
    DENSITY_OVER    /* a heavy layer on a light one, kicked */
} density_scene;

static gs4_sim *density_make(density_scene scene, gs4_integrator integrator, int n, double heavy,
                             double c_light, double c_heavy)
{
    const double h = DENSITY_CELL, w = n * h;
    gs4_sim_desc d = scene_cube(n);
    gs4_fill f[2];
    gs4_sim *sim;
    int k;
    memset(d.walls, 0, sizeof d.walls);
    d.integrator = integrator;
    sim = density_box(d, n, n, heavy, c_light, c_heavy, 1e-5);
    for (k = 0; k < 2; k++) {
        f[k] = scene_fill(at(0, 0, 0));
        f[k].material = k;
    }
    if (scene == DENSITY_DROP) {
        gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(w, 0.4 * w, w)), &f[0]);
        gs4_add_particles(sim, gs4_box(at(w / 4, w / 2, w / 4), at(0.75 * w, 0.9 * w, 0.75 * w)),
                          &f[1]);
    } else if (scene == DENSITY_BUBBLE) {
        const gs4_shape ball = gs4_sphere(at(w / 2, 0.35 * w, w / 2), (gs4_real)(0.25 * w));
        gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(w, 0.8 * w, w)), &f[1]);
        gs4_remove_particles(sim, ball);
        gs4_add_particles(sim, ball, &f[0]);
    } else {
        gs4_edit v;
        gs4_view x;
        int i;
        gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(w, w / 2, w)), &f[0]);
        gs4_add_particles(sim, gs4_box(at(0, w / 2, 0), at(w, 0.8 * w, w)), &f[1]);
        v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        for (i = 0; i < v.count; i++)
            v.data[(size_t)i * (size_t)v.stride + 1] =
                (gs4_real)(0.05 * cos(6.283 / w * (double)x.data[(size_t)i * (size_t)x.stride]));
    }
    return sim;
}

/* Everything: kinetic, compressive and potential, J. */
static double density_total(gs4_sim *sim, const double c[2])
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    double sum = density_energy(sim, c);
    int i;
    for (i = 0; i < x.count; i++)
        sum += 10 * (double)m.data[(size_t)i * (size_t)m.stride]
               * (double)x.data[(size_t)i * (size_t)x.stride + 1];
    return sum;
}

/* No step is refused, energy only goes, the heavy one stays as dense as it is. The light one is no
 * faster than what falls and what flies apart from its greatest pressure so far: a rarefaction of
 * (3) from J to 1 gives (c/3) (J^-3 - 1). */
static void density_falls(density_scene scene, gs4_integrator integrator, int n, double heavy,
                          const double c[2], double time)
{
    gs4_sim *sim = density_make(scene, integrator, n, heavy, c[0], c[1]);
    const double start = density_total(sim, c), fall = sqrt(2 * 10 * n * DENSITY_CELL);
    double before = start, now = start, low = 1, high = 1, fastest = 0, most = 0, low_heavy = 1,
           high_heavy = 1;
    int i, result = 0;
    for (i = 0; i < 40 && result >= 0; i++) {
        density_seen light, dense;
        result = gs4_advance(sim, (gs4_real)(time / 40));
        if (result < 0) printf("    %s\n", gs4_last_error(sim));
        light = density_look(sim, 0, 1);
        dense = density_look(sim, 1, 1);
        low = fmin(low, light.low_J);
        high = fmax(high, light.high_J);
        low_heavy = fmin(low_heavy, dense.low_J);
        high_heavy = fmax(high_heavy, dense.high_J);
        fastest = fmax(fastest, light.speed);
        now = density_total(sim, c);
        most = fmax(most, (now - before) / start);
        before = now;
        CHECK(light.speed < 2 * fall + 1.5 * c[0] / 3 * (pow(low, -3) - 1));
        CHECK(dense.speed < 3 * fall);
    }
    CHECK(result >= 0);
    CHECK(most < 1e-4);
    CHECK_BETWEEN(now / start, 0.15, 0.9999);
    CHECK(low_heavy > 0.7 && high_heavy < 1.5);
    if (test_filter[0])
        printf("scene %d, integrator %d, %g to 1, c %g %g: J %.3f to %.2f, heavy %.3f to %.2f, "
               "speed %.1f of a fall, energy at most up by %.1e, in the end %.3f\n",
               (int)scene, (int)integrator, heavy, c[0], c[1], low, high, low_heavy, high_heavy,
               fastest / fall, most, now / start);
    gs4_destroy(sim);
}

static void test_density_drops(void)
{
    static const double ratios[3] = { 1000, 100, 10 };
    const double alike[2] = { 10, 10 };
    int scene, i, k;
    density_falls(DENSITY_OVER, GS4_INTEGRATOR_GS4, 6, 100, alike, 0.1);
    if (!test_full) return;
    for (scene = 0; scene < 3; scene++)
        for (k = 0; k < 2; k++)
            for (i = 0; i < 3; i++) {
                const double soft[2] = { 10, 10 }, stiff[2] = { 10 * sqrt(ratios[i]), 10 };
                density_falls((density_scene)scene, physics_integrators[k], 6, ratios[i], soft,
                              0.2);
                if (i > 0)
                    density_falls((density_scene)scene, physics_integrators[k], 6, ratios[i], stiff,
                                  0.2);
            }
}

/* From what a dense drop has pressed soft particles fly apart until they see each other no more. */
static void test_density_far_apart(void)
{
    const double c[2] = { 10, 10 };
    density_falls(DENSITY_DROP, GS4_INTEGRATOR_GS4, 12, 1000, c, 0.25);
}

static int density_highest(const gs4_sim *sim)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i, top = 0;
    for (i = 1; i < x.count; i++)
        if (x.data[i * x.stride + 1] > x.data[top * x.stride + 1]) top = i;
    return top;
}

/* A particle far from others may have 200 times its volume, not 300. */
static void test_density_range(void)
{
    static const double J[2] = { 200, 300 };
    int i;
    for (i = 0; i < 2; i++) {
        gs4_sim *sim = density_box(scene_cube(8), 8, 8, 1000, 10, 10, 0);
        gs4_fill f = scene_fill(at(0, 0, 0));
        const double h = DENSITY_CELL;
        int top;
        CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(8 * h, 2 * h, 8 * h)), &f) > 0);
        CHECK(gs4_add_particles(sim,
                                gs4_box(at(4 * h, 6 * h, 4 * h), at(4.5 * h, 6.5 * h, 4.5 * h)), &f)
              == 1);
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-5), GS4_OK);
        top = density_highest(sim);
        sim->particles.velocity[4 * top + 3] = (gs4_real)J[i];
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), i ? GS4_ERROR_UNSTABLE : GS4_OK);
        if (i) CHECK(strstr(gs4_last_error(sim), "1/16 to 256") != NULL);
        CHECK_CLOSE(gs4_get_stats(sim).max_volume_ratio, J[i], 1e-4 * J[i]);
        gs4_destroy(sim);
    }
}

/* --- what is said ----------------------------------------------------------------------------- */

static void density_count(int level, const char *line, void *user)
{
    *(int *)user += level == 1 && strstr(line, "too soft") != NULL;
}

/* A material too soft for a denser one is said once; one that can bear it is not, nor one alone.
 * 2 g H = 1.6: 1600 Pa. */
static void test_density_soft(void)
{
    static const double c[4] = { 39.9, 40.1, 0, 1 };
    int i, k;
    for (i = 0; i < 4; i++) {
        gs4_sim_desc d = scene_cube(8);
        gs4_fill f = scene_fill(at(0, 0, 0));
        int said = 0;
        gs4_sim *sim;
        d.log = density_count;
        d.log_user = &said;
        sim = density_box(d, 8, 8, i == 3 ? 1 : 1000, c[i], 10, 0);
        for (k = 0; k < 2; k++) {
            CHECK(gs4_add_particles(sim,
                                    gs4_box(at(0, k * 2 * DENSITY_CELL, 0),
                                            at(0.02, (k * 2 + 1) * DENSITY_CELL, 0.02)),
                                    &f)
                  > 0);
            CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim)), GS4_OK);
        }
        CHECK(said == (i == 0));
        gs4_destroy(sim);
    }
}

static void run_density(void)
{
    RUN_FULL(test_density_stability);
    RUN(test_density_limit);
    RUN(test_density_saved);
    RUN(test_density_soft);
    RUN(test_density_range);
    RUN_FULL_ONCE(test_density_piston);
    RUN_FULL_ONCE(test_density_rest);
    RUN_FULL_ONCE(test_density_drops);
    RUN_SLOW(test_density_far_apart);
}
