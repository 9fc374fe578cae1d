/* Draws over everything at once, for the implicit schemes: fixed seeds, powers of ten evenly. A
 * step is taken, or refused with a code and a sentence and then the state stays; energy is never
 * above what was put in, nothing is lost, numbers stay finite. After test_stability.c. */
#ifndef EXTREMES_H
#define EXTREMES_H

typedef struct extremes_draw {
    uint32_t random;
    gs4_sim_desc d;
    gs4_material m[3];
    gs4_sim *sim;
    double g[3], h, speed; /* gravity; cell size; the fastest that is thrown in, cells a second */
    int materials, kind, bodies, moves, emits, particles;
    int worst;                  /* iterations of a step */
    int rounds;                 /* beside rounding its energy says nothing */
    double swing;               /* of dt */
    double start, most, stored; /* J that were put in, with what gravity may give; had at most */
    double mass, p[3], scale;   /* at the start; of momentum */
    double time, moved;         /* how far momentum is off */
} extremes_draw;

enum {
    EXTREMES_REASONS = 12
};

/* Of many draws. */
typedef struct extremes_sum {
    int draws, ended, taken, refused, above;
    double gain;
    int steps_by[EXTREMES_REASONS], draws_by[EXTREMES_REASONS]; /* refused, why */
} extremes_sum;

static double extremes_between(extremes_draw *k, double low, double high)
{
    return low + (high - low) * (stability_random(&k->random) + 0.5);
}
static int extremes_pick(extremes_draw *k, int n) { return (int)extremes_between(k, 0, n - 1e-6); }
static double extremes_power(extremes_draw *k, double low, double high)
{
    return pow(10, extremes_between(k, low, high));
}

static void extremes_begin(extremes_draw *k, uint32_t seed, double h)
{
    int i;
    memset(k, 0, sizeof *k);
    k->random = seed * 2654435769u + 12345u;
    for (i = 0; i < 4; i++) extremes_pick(k, 2);
    k->h = h;
    k->speed = -1;
    k->swing = 1;
}

/* Cells, walls, the member of the family, gravity. */
static void extremes_describe(extremes_draw *k)
{
    static const double rho[4][2] = { { 0, 0 }, { 0.5, 0 }, { 1, 0 }, { 0.5, 0.5 } };
    int a;
    k->d = partitioned_cube(8);
    for (a = 0; a < 3; a++) {
        const int periodic = extremes_pick(k, 5) == 0;
        k->d.cells[a] = 6 + extremes_pick(k, 7);
        k->d.walls[2 * a] = periodic ? GS4_WALL_PERIODIC : (gs4_wall)extremes_pick(k, 4);
        k->d.walls[2 * a + 1] = periodic ? GS4_WALL_PERIODIC : (gs4_wall)extremes_pick(k, 4);
    }
    k->d.cell_size = (gs4_real)k->h;
    a = extremes_pick(k, 8);
    k->d.integrator = a % 2 ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    if (a % 2 == 0) {
        k->d.rho_inf = (gs4_real)rho[a / 2][0];
        k->d.rho_inf_spurious = (gs4_real)rho[a / 2][1];
    }
    for (a = 0; a < 3; a++) k->g[a] = 0;
    a = extremes_pick(k, 3);
    if (extremes_pick(k, 3)) k->g[a] = -extremes_power(k, -1, 2);
    if (k->d.walls[2 * a] == GS4_WALL_PERIODIC) k->g[a] = 0;
    k->d.gravity = at(k->g[0], k->g[1], k->g[2]);
}

/* Bodies, before there is material: that is left out where they are. */
static void extremes_bodies(extremes_draw *k, gs4_shape shape[2])
{
    const double unit = 8 * k->h;
    int n, a;
    k->bodies = extremes_pick(k, 2) * extremes_pick(k, 3);
    for (n = 0; n < k->bodies; n++) {
        gs4_collider c;
        double p[3], low[3], high[3];
        const double r = unit * extremes_between(k, 0.13, 0.35);
        memset(&c, 0, sizeof c);
        for (a = 0; a < 3; a++) {
            p[a] = extremes_between(k, 0, k->h * k->d.cells[a]);
            low[a] = p[a] - unit * extremes_between(k, 0.1, 0.3);
            high[a] = p[a] + unit * extremes_between(k, 0.1, 0.3);
        }
        c.contact = (gs4_wall)extremes_pick(k, 3);
        c.shape = extremes_pick(k, 2)
                      ? gs4_sphere(at(p[0], p[1], p[2]), (gs4_real)r)
                      : gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]));
        c.pivot = at(p[0], p[1], p[2]);
        if (k->moves) {
            const double v = k->h * k->speed / 2;
            c.velocity = at(v * extremes_between(k, -1, 1), v * extremes_between(k, -1, 1),
                            v * extremes_between(k, -1, 1));
            c.angular_velocity = at(0, extremes_between(k, -1, 1) * v / r, 0);
        }
        shape[n] = c.shape;
        CHECK_RESULT(k->sim, gs4_add_collider(k->sim, &c), GS4_OK);
    }
}

/* Corners of part n, `size` the domain's. */
static void extremes_corners(extremes_draw *k, int n, int parts, const double size[3], double v[3],
                             double low[3], double high[3])
{
    const double unit = 8 * k->h;
    int a;
    for (a = 0; a < 3; a++) {
        v[a] = k->h * k->speed * extremes_between(k, -0.57, 0.57);
        low[a] = extremes_between(k, 0.05 * size[a], 0.5 * size[a]);
        high[a] = low[a] + unit * extremes_between(k, 0.3, 0.7);
        if (k->kind < 2) high[a] = (low[a] *= 1.8);
        if (k->kind == 3 || k->kind == 4) low[a] = -1 * unit;
        if (k->kind == 3 || k->kind == 4) high[a] = 9 * unit;
    }
    a = extremes_pick(k, 3);
    if (k->kind == 2) high[a] = low[a] + unit * extremes_between(k, 0.06, 0.2);
    if (parts == 2 && n == 0) high[0] = 0.5 * size[0];
    if (parts == 2 && n == 1) low[0] = 0.5 * size[0];
}

/* One particle; spray; a film; all cells full; full but for a pocket; a block; two blocks. */
static void extremes_fill(extremes_draw *k)
{
    double size[3], low[3], high[3], v[3];
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_shape body[2];
    int a, n, i, parts;
    extremes_bodies(k, body);
    k->kind = extremes_pick(k, 7);
    if (k->speed < 0) k->speed = extremes_pick(k, 4) ? extremes_power(k, -2, 3) : 0;
    parts = k->kind == 1 ? 40 : k->kind < 3 || k->kind == 5 ? 1 : 2;
    for (a = 0; a < 3; a++) size[a] = k->h * k->d.cells[a];
    for (n = 0; n < parts; n++) {
        extremes_corners(k, n, parts, size, v, low, high);
        f.material = n % k->materials;
        f.velocity = at(v[0], v[1], v[2]);
        f.jitter = (gs4_real)(extremes_pick(k, 2) * extremes_between(k, 0, 1));
        f.random_seed = k->random >> 4;
        if (k->kind < 2) {
            const gs4_real x[3] = { (gs4_real)low[0], (gs4_real)low[1], (gs4_real)low[2] };
            gs4_add_points(k->sim, x, 1, (gs4_real)(k->h * k->h * k->h / 8), &f);
        } else
            gs4_add_particles(
                k->sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])), &f);
    }
    if (k->kind == 4)
        gs4_remove_particles(k->sim,
                             gs4_sphere(at(size[0] / 2, size[1] / 2, size[2] / 2),
                                        (gs4_real)(8 * k->h * extremes_between(k, 0.1, 0.3))));
    for (i = 0; i < k->bodies; i++) gs4_remove_particles(k->sim, body[i]);
}

static double extremes_determinant(const gs4_real *F)
{
    double f[9];
    int i;
    for (i = 0; i < 9; i++) f[i] = (double)F[i];
    return solid_determinant(f);
}

/* Eigenvalues of B = (det F)^(-2/3) F F^T: with J in its place rounding of F would be energy. */
static void extremes_stretch(const gs4_real *F, double e[3])
{
    static const int row[6] = { 0, 1, 2, 0, 0, 1 }, column[6] = { 0, 1, 2, 1, 2, 2 };
    double B[6], Q[3][3];
    int i, c;
    for (i = 0; i < 6; i++)
        for (B[i] = 0, c = 0; c < 3; c++)
            B[i] += (double)F[3 * row[i] + c] * (double)F[3 * column[i] + c];
    gs4i_eigen(B, e, Q);
    for (i = 0; i < 3; i++) e[i] /= pow(extremes_determinant(F), 2.0 / 3);
}

/* Eigenvalues of c = S/G0 + I, and G0; 0 where it has none. */
static double extremes_conformation(const gs4_material *l, const gs4_real *S, double e[3])
{
    const double mu = (1 - (double)l->local_fraction) * (double)l->viscosity;
    double c[6], Q[3][3];
    int i;
    if (l->liquid == GS4_NEWTONIAN || !(mu > 0)) return 0;
    for (i = 0; i < 6; i++) c[i] = (double)S[i] * (double)l->relaxation_time / mu + (i < 3);
    gs4i_eigen(c, e, Q);
    return mu / (double)l->relaxation_time;
}

/* What a particle has stored: of solids what (6) is the derivative of, of Oldroyd-B
 * G0 (tr c - 3 - ln det c)/2. That of volume is left out: what particles of a cell differ by in J
 * no pressure sees. */
static double extremes_stored(const gs4_material *l, const gs4_real *S, const gs4_real *F)
{
    const double G = (double)l->shear_modulus;
    double sum = 0, e[3], G0;
    int i;
    if (F && l->solid) {
        extremes_stretch(F, e);
        for (i = 0; i < 3; i++)
            sum += l->solid == GS4_NEO_HOOKEAN ? 0.5 * G * (e[i] - 1)
                                               : G * pow(sqrt(fmax(e[i], 0)) - 1, 2);
        /* strain of so much is rounding */
        sum = fmax(sum - G * pow(64 * (sizeof(gs4_real) == 8 ? 1.1e-16 : 6e-8), 2), 0);
    }
    if (!S || l->liquid != GS4_OLDROYD_B) return sum;
    G0 = extremes_conformation(l, S, e);
    for (i = 0; i < 3 && G0 > 0; i++) sum += 0.5 * G0 * fmax(e[i] - 1 - log(fmax(e[i], 1e-6)), 0);
    return sum;
}

/* Kinetic energy, and of gravity, and what is stored, none at first. */
static double extremes_energy(extremes_draw *k)
{
    const gs4_view x = gs4_particles(k->sim, GS4_FIELD_POSITION),
                   m = gs4_particles(k->sim, GS4_FIELD_MASS),
                   S = gs4_particles(k->sim, GS4_FIELD_STRESS),
                   F = gs4_particles(k->sim, GS4_FIELD_DEFORMATION);
    const uint8_t *material = gs4_particle_materials(k->sim);
    double sum = gs4_get_stats(k->sim).kinetic_energy;
    int i, a;
    k->stored = 0;
    for (i = 0; i < x.count; i++) {
        const gs4_material *l = &k->m[material[i]];
        for (a = 0; a < 3; a++)
            sum -= (double)m.data[i * m.stride] * k->g[a] * (double)x.data[i * x.stride + a];
        k->stored += (double)m.data[i * m.stride] / (double)l->density
                     * extremes_stored(l, S.data ? S.data + (size_t)i * (size_t)S.stride : NULL,
                                       F.data ? F.data + (size_t)i * (size_t)F.stride : NULL);
    }
    return sum + k->stored;
}

static int extremes_is_free(const extremes_draw *k)
{
    int i, free = k->bodies == 0;
    for (i = 0; i < 6; i++)
        free &= k->d.walls[i] == GS4_WALL_OPEN || k->d.walls[i] == GS4_WALL_PERIODIC;
    return free;
}

static int extremes_is_closed(const extremes_draw *k)
{
    int i, closed = 1;
    for (i = 0; i < 6; i++) closed &= k->d.walls[i] != GS4_WALL_OPEN;
    return closed;
}

/* All fields finite, det F > 0, J > 0, S/G0 + I positive definite but for rounding. */
static int extremes_views_are_good(const extremes_draw *k)
{
    const gs4_view S = gs4_particles(k->sim, GS4_FIELD_STRESS),
                   J = gs4_particles(k->sim, GS4_FIELD_VOLUME_RATIO),
                   F = gs4_particles(k->sim, GS4_FIELD_DEFORMATION);
    const uint8_t *material = gs4_particle_materials(k->sim);
    int n, i, c, good = 1;
    for (n = GS4_FIELD_POSITION; n <= GS4_FIELD_PRESSURE; n++) {
        const gs4_view v = gs4_particles(k->sim, (gs4_field)n);
        for (i = 0; i < v.count; i++)
            for (c = 0; c < v.components; c++)
                good &= fabs((double)v.data[i * v.stride + c]) < 1e30;
    }
    for (i = 0; i < J.count; i++) good &= (double)J.data[i * J.stride] > 0;
    for (i = 0; i < F.count; i++)
        good &= extremes_determinant(F.data + (size_t)i * (size_t)F.stride) > 0;
    for (i = 0; i < S.count; i++) {
        double e[3];
        const gs4_real *one = S.data + (size_t)i * (size_t)S.stride;
        if (extremes_conformation(&k->m[material[i]], one, e) > 0)
            good &= fmin(e[0], fmin(e[1], e[2])) > -1e-5 * fmax(1, fmax(e[0], fmax(e[1], e[2])));
    }
    return good;
}

static void extremes_print(const extremes_draw *k, uint32_t seed, const char *what)
{
    int n;
    printf("draw %u: %s: kind %d, bodies %d%s, %s rho %g %g, walls %d%d%d%d%d%d, h %.2g, g %.2g, "
           "speed %.2g, swing %.2g",
           (unsigned)seed, what, k->kind, k->bodies, k->moves ? " moving" : "",
           k->d.integrator ? "BE" : "GS4", (double)k->d.rho_inf, (double)k->d.rho_inf_spurious,
           (int)k->d.walls[0], (int)k->d.walls[1], (int)k->d.walls[2], (int)k->d.walls[3],
           (int)k->d.walls[4], (int)k->d.walls[5], k->h, k->g[0] + k->g[1] + k->g[2], k->speed,
           k->swing);
    for (n = 0; n < k->materials; n++) {
        const gs4_material *l = &k->m[n];
        printf("; %s density %.1e mu %.1e K %.1e",
               l->solid    ? (l->solid == 1 ? "neo-Hookean" : "corotated")
               : l->liquid ? (l->liquid == 1 ? "Oldroyd-B" : "Pom-Pom")
                           : "liquid",
               (double)l->density, (double)l->viscosity, (double)l->bulk_modulus);
        if (l->solid) printf(" G %.1e", (double)l->shear_modulus);
        if (l->yield_stretch > 0) printf(" yields");
        if (l->liquid)
            printf(" tau %.1e F_v %.2g", (double)l->relaxation_time, (double)l->local_fraction);
        if (l->can_melt) printf(" melts");
    }
    printf("\n");
}

static const char *const extremes_reasons[EXTREMES_REASONS] = {
    "volume ratios",     "more than two cells",
    "non-local stress",  "stretched, sheared",
    "has a viscosity",   "rose during",
    "beyond the domain", "converge",
    "largest stable",    "",
    "no step",           "energy"
};

static int extremes_reason(const gs4_sim *sim)
{
    int n = 0;
    while (!strstr(gs4_last_error(sim), extremes_reasons[n])) n++;
    return n;
}

/* A step, or a shorter one where it is refused, by a half, later by an eighth; then nothing has
 * changed. 0 where so many are refused. */
static int extremes_step(extremes_draw *k, double dt, int most, extremes_sum *sum)
{
    int tries, result = GS4_OK;
    for (tries = 0; tries < most; tries++, dt /= tries < 4 ? 2 : 8) {
        const uint64_t hash = gs4_state_hash(k->sim);
        result = gs4_step(k->sim, (gs4_real)dt);
        if (result == GS4_OK) break;
        sum->refused++;
        sum->steps_by[extremes_reason(k->sim)]++;
        CHECK(result == GS4_ERROR_UNSTABLE || result == GS4_ERROR_NOT_CONVERGED);
        CHECK(gs4_last_error(k->sim)[0] != 0);
        CHECK(gs4_state_hash(k->sim) == hash);
    }
    sum->taken += result == GS4_OK;
    if (result == GS4_OK) k->time += dt;
    return result == GS4_OK;
}

/* What there is before the first step. */
static void extremes_put_in(extremes_draw *k)
{
    const gs4_stats s = gs4_get_stats(k->sim);
    int c;
    k->particles = s.particles;
    k->mass = s.mass;
    k->start = extremes_energy(k);
    k->scale = sqrt(2 * s.kinetic_energy * s.mass);
    for (c = 0; c < 3; c++) k->p[c] = s.momentum[c];
}

/* After each step; 0 where there is nothing more to see. */
static int extremes_watch(extremes_draw *k)
{
    const gs4_stats s = gs4_get_stats(k->sim);
    const double e = extremes_energy(k);
    int c;
    if (!k->emits && !k->rounds && !(k->moves && k->bodies)) k->most = fmax(k->most, e);
    if (!extremes_views_are_good(k) || k->most > 100 * k->start + 1e9) return 0;
    if (s.particles < k->particles || k->emits) return s.particles > 0 || k->emits;
    for (c = 0; c < 3 && extremes_is_free(k); c++)
        k->moved = fmax(k->moved, fabs(s.momentum[c] - k->p[c] - s.mass * k->g[c] * k->time)
                                      / (k->scale + s.mass * fabs(k->g[c]) * k->time + 1e-30));
    return 1;
}

/* What has to hold of each draw. */
static void extremes_judge(extremes_draw *k, uint32_t seed, extremes_sum *sum)
{
    const gs4_stats s = gs4_get_stats(k->sim);
    const int good = extremes_views_are_good(k);
    char text[64];
    CHECK(good);
    if (!good) extremes_print(k, seed, "fields");
    if (extremes_is_closed(k) && !k->emits) {
        CHECK(s.particles == k->particles);
        CHECK_CLOSE(s.mass / (k->mass + 1e-30), k->particles ? 1 : 0, 1e-12);
    }
    if (k->start > 0 && k->most / k->start > 1.001 && test_filter[0]) {
        sprintf(text, "energy %.4g at %g s", k->most / k->start, k->time);
        extremes_print(k, seed, text);
    }
    if (k->moved > 1e-4 && test_filter[0]) {
        sprintf(text, "momentum off by %.2e", k->moved);
        extremes_print(k, seed, text);
    }
    sum->draws++;
    sum->gain = fmax(sum->gain, k->most / (k->start + 1e-30));
    sum->above += k->most > 1.01 * k->start + 1e-30;
}

static void extremes_report(const extremes_sum *sum)
{
    int n;
    if (!test_filter[0]) return;
    printf("%d steps taken, %d refused, energy at most %.4g of what it was, %d above 1.01\n",
           sum->taken, sum->refused, sum->gain, sum->above);
    for (n = 0; n < EXTREMES_REASONS; n++)
        if (sum->steps_by[n] || sum->draws_by[n])
            printf("    \"%s\": %d steps refused, %d draws ended\n", extremes_reasons[n],
                   sum->steps_by[n], sum->draws_by[n]);
}
#endif
