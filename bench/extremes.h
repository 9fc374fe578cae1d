/* Scenes of extremes.c: what they are made of, and the exact answer of each. */
#ifndef EXTREMES_SCENES_H
#define EXTREMES_SCENES_H

typedef enum parameter {
    VISCOSITY,
    DENSITY,
    BULK,
    SHEAR,
    RELAXATION,
    STRETCH,
    ANISOTROPY,
    ARMS,
    CONDUCTIVITY,
    LATENT,
    FLUX_TIME,
    RATIO,
    SPEED,
    DECAY,
    DT,
    TIME,
    ORIGIN,
    CELL,
    UNIT_LENGTH,
    UNIT_TIME,
    UNIT_MASS,
    UNIT_TEMPERATURE,
    PARAMETERS
} parameter;

/* Normal values in units of the scene. */
static const struct {
    const char *name;
    double normal;
} parameters[PARAMETERS] = { { "viscosity", 1 },
                             { "density", 1 },
                             { "bulk modulus", 100 },
                             { "shear modulus", 1 },
                             { "relaxation time", 0.01 },
                             { "stretch time", 0.005 },
                             { "anisotropy", 0.1 },
                             { "arms", 4 },
                             { "conductivity", 1 },
                             { "latent heat", 1 },
                             { "flux time", 0.1 },
                             { "density ratio", 10 },
                             { "speed", 1e-3 },
                             { "flip_decay_time", 100 },
                             { "dt", 1 },
                             { "time", 1 },
                             { "origin", 1 },
                             { "cell size alone", 1 },
                             { "unit of length", 1 },
                             { "unit of time", 1 },
                             { "unit of mass", 1 },
                             { "unit of temperature", 1 } };

enum {
    GS4_PLAIN,
    EULER,
    PROJECTION,
    PROJECTION_EULER,
    ONE_SOLVE,
    ONE_SOLVE_EULER,
    VARIANTS
};
static const struct {
    const char *name;
    gs4_scheme scheme;
    gs4_integrator integrator;
} variants[VARIANTS] = {
    { "explicit GS4", GS4_EXPLICIT, GS4_INTEGRATOR_GS4 },
    { "explicit symplectic Euler", GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER },
    { "partitioned GS4", GS4_PARTITIONED, GS4_INTEGRATOR_GS4 },
    { "partitioned backward Euler", GS4_PARTITIONED, GS4_INTEGRATOR_BACKWARD_EULER },
    { "semi-implicit GS4", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4 },
    { "semi-implicit backward Euler", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_BACKWARD_EULER }
};

typedef struct job {
    int scene, variant;
    double factor[PARAMETERS];
} job;

/* `why`: the sentence of what was refused, or what is wrong. */
typedef struct outcome {
    char sign;
    double error;
    char why[200];
} outcome;

enum {
    WAVE_NEWTON,
    WAVE_OLDROYD,
    WAVE_POM_POM,
    WAVE_NEO_HOOKEAN,
    WAVE_COROTATED,
    SPHERE_NEWTON,
    SPHERE_SOLID,
    HEAT,
    CATTANEO,
    MELT,
    POOL,
    SCENES
};

static int is_wave(int scene) { return scene <= WAVE_COROTATED; }
static int is_sphere(int scene) { return scene == SPHERE_NEWTON || scene == SPHERE_SOLID; }
static int is_elastic(int scene)
{
    return scene == WAVE_NEO_HOOKEAN || scene == WAVE_COROTATED || scene == SPHERE_SOLID;
}
static int is_thermal(int scene) { return scene == HEAT || scene == CATTANEO || scene == MELT; }
static int remembers(int scene) { return scene == WAVE_OLDROYD || scene == WAVE_POM_POM; }

/* What of each scene is varied, with which schemes; its bound,
 * of waves and spheres twice that with symplectic Euler. */
#define BIT(p) (1u << (p))
#define UNITS (BIT(UNIT_LENGTH) | BIT(UNIT_TIME) | BIT(UNIT_MASS))
#define COMMON (BIT(BULK) | BIT(DT) | BIT(ORIGIN) | BIT(CELL) | UNITS)
#define ALL_VARIANTS 63u
#define SECOND_ORDER (BIT(GS4_PLAIN) | BIT(PROJECTION) | BIT(ONE_SOLVE))
static const struct {
    const char *name;
    unsigned parameters, variants;
    double bound;
} scenes[SCENES] = {
    { "shear wave Newton",
      COMMON | BIT(VISCOSITY) | BIT(DENSITY) | BIT(SPEED) | BIT(TIME) | BIT(DECAY), ALL_VARIANTS,
      0.155 },
    { "shear wave Oldroyd-B", BIT(VISCOSITY) | BIT(RELAXATION) | BIT(DT) | BIT(BULK),
      SECOND_ORDER | BIT(EULER), 0.15 },
    { "shear wave Pom-Pom",
      BIT(VISCOSITY) | BIT(RELAXATION) | BIT(STRETCH) | BIT(ANISOTROPY) | BIT(ARMS) | BIT(DT),
      SECOND_ORDER | BIT(EULER), 0.15 },
    { "shear wave neo-Hookean", COMMON | BIT(SHEAR) | BIT(DENSITY) | BIT(SPEED) | BIT(TIME),
      ALL_VARIANTS, 0.155 },
    { "shear wave corotated", BIT(SHEAR) | BIT(BULK) | BIT(SPEED) | BIT(DT), SECOND_ORDER, 0.15 },
    { "free sphere Newton", BIT(VISCOSITY) | BIT(BULK) | BIT(DT), SECOND_ORDER | BIT(EULER), 0.25 },
    { "free sphere neo-Hookean", BIT(SHEAR) | BIT(BULK) | BIT(DT), SECOND_ORDER | BIT(EULER),
      0.25 },
    { "heat", BIT(CONDUCTIVITY) | BIT(DT) | BIT(ORIGIN) | BIT(CELL) | UNITS | BIT(UNIT_TEMPERATURE),
      SECOND_ORDER | BIT(EULER), 0.05 },
    { "heat Cattaneo", BIT(CONDUCTIVITY) | BIT(FLUX_TIME) | BIT(DT), SECOND_ORDER, 0.05 },
    { "melting", BIT(CONDUCTIVITY) | BIT(LATENT) | BIT(DT), SECOND_ORDER | BIT(EULER), 0.02 },
    { "pool of two densities", BIT(RATIO) | BIT(VISCOSITY) | BIT(BULK) | BIT(DT),
      SECOND_ORDER | BIT(EULER), 0.03 }
};

enum {
    PAIRS = 9
};
static const struct {
    int scene, variant;
    parameter p, q;
} pairs[PAIRS] = { { WAVE_NEWTON, ONE_SOLVE, VISCOSITY, DT },
                   { WAVE_NEWTON, ONE_SOLVE, VISCOSITY, CELL },
                   { WAVE_NEWTON, PROJECTION, VISCOSITY, CELL },
                   { WAVE_NEWTON, GS4_PLAIN, VISCOSITY, BULK },
                   { WAVE_NEO_HOOKEAN, ONE_SOLVE, SHEAR, BULK },
                   { WAVE_NEO_HOOKEAN, PROJECTION, SHEAR, BULK },
                   { WAVE_OLDROYD, ONE_SOLVE, RELAXATION, VISCOSITY },
                   { WAVE_POM_POM, PROJECTION, RELAXATION, STRETCH },
                   { MELT, GS4_PLAIN, CONDUCTIVITY, LATENT } };

static job usual(int scene, int variant)
{
    job j;
    int p;
    j.scene = scene;
    j.variant = variant;
    for (p = 0; p < PARAMETERS; p++) j.factor[p] = 1;
    return j;
}

/* Of the pool: of its lower, denser half. */
static double normal(const job *j, parameter p)
{
    const double pool = p == VISCOSITY ? 0.01 : p == BULK ? 10 : 1;
    return parameters[p].normal * (j->scene == POOL ? pool : 1);
}

/* --- a scene ---------------------------------------------------------------------------------- */

#define PI 3.14159265358979
/* v = f r x grad P, P = z^2 - (x^2 + y^2)/2, f = j2(k r)/(k r)^2, (j2/r)' = 0 at r = 1: the
 * torsional mode of a free sphere of radius 1. */
#define SPHERE_K 2.5011326
enum {
    WAVE_CELLS = 12,
    SPHERE_CELLS = 4,
    POOL_CELLS = 8
};

/* A job in numbers, in the units asked for. */
typedef struct trial {
    const job *j;
    gs4_sim *sim;
    gs4_sim_desc d;
    gs4_material m[2];
    double L, t, M, K;                    /* units: m, s, kg, degrees */
    double size, origin, T, dt, speed, k; /* m, m, scene's units, m/s, 1 over scene's length */
    int refused, steps;
} trial;

static double value(const trial *s, parameter p) { return parameters[p].normal * s->j->factor[p]; }

/* Time, in that of the scene, in which the mode loses much of what it has. */
static void times(trial *s)
{
    const int scene = s->j->scene;
    s->k = is_sphere(scene) ? SPHERE_K : is_thermal(scene) ? PI : 2 * PI;
    s->T = is_elastic(scene) ? 1 / s->k : scene == POOL ? 0.4 : 0.5 / (s->k * s->k);
    if (scene == MELT) s->T = 0.5;
    if (is_elastic(scene)) s->T /= sqrt(s->j->factor[SHEAR] / s->j->factor[DENSITY]);
    s->dt = s->T / 16 * s->j->factor[DT];
    s->T *= s->j->factor[TIME];
    s->k /= s->j->factor[CELL];
}

static void matter(trial *s)
{
    const int scene = s->j->scene;
    const double pressure = s->M / (s->L * s->t * s->t), density = s->M / (s->L * s->L * s->L);
    gs4_material *m = &s->m[0];
    memset(m, 0, sizeof *m);
    m->density = (gs4_real)(density * value(s, DENSITY));
    m->bulk_modulus = (gs4_real)(pressure * value(s, BULK));
    if (!is_elastic(scene) && !is_thermal(scene))
        m->viscosity = (gs4_real)(pressure * s->t * value(s, VISCOSITY));
    if (is_elastic(scene)) {
        m->solid = scene == WAVE_COROTATED ? GS4_FIXED_COROTATED : GS4_NEO_HOOKEAN;
        m->shear_modulus = (gs4_real)(pressure * value(s, SHEAR));
    }
    if (remembers(scene)) {
        m->liquid = scene == WAVE_OLDROYD ? GS4_OLDROYD_B : GS4_POM_POM;
        m->local_fraction = (gs4_real)0.5;
        m->relaxation_time = (gs4_real)(s->t * value(s, RELAXATION));
    }
    if (scene == WAVE_POM_POM) {
        m->stretch_time = (gs4_real)(s->t * value(s, STRETCH));
        m->anisotropy = (gs4_real)value(s, ANISOTROPY);
        m->arms = (gs4_real)value(s, ARMS);
    }
    if (is_thermal(scene)) {
        m->heat_capacity = (gs4_real)(s->L * s->L / (s->t * s->t * s->K));
        m->conductivity =
            (gs4_real)(s->M * s->L / (s->t * s->t * s->t * s->K) * value(s, CONDUCTIVITY));
    }
    if (scene == CATTANEO) m->flux_relaxation_time = (gs4_real)(s->t * value(s, FLUX_TIME));
    if (scene == MELT) {
        m->can_melt = 1;
        m->solid = GS4_NEO_HOOKEAN;
        m->shear_modulus = (gs4_real)pressure;
        m->latent_heat = (gs4_real)(s->L * s->L / (s->t * s->t) * value(s, LATENT));
    }
    s->m[1] = *m;
    if (scene != POOL) return;
    m->density = (gs4_real)(density * 10);
    m->bulk_modulus = (gs4_real)(pressure * normal(s->j, BULK) * s->j->factor[BULK]);
    m->viscosity = (gs4_real)(pressure * s->t * normal(s->j, VISCOSITY) * s->j->factor[VISCOSITY]);
    s->m[1] = *m;
    s->m[1].density = (gs4_real)(density * 10 / value(s, RATIO));
}

static void describe(trial *s)
{
    const int scene = s->j->scene;
    int i;
    const int n = is_sphere(scene) ? 2 * SPHERE_CELLS + 8 : scene == POOL ? POOL_CELLS : WAVE_CELLS;
    memset(&s->d, 0, sizeof s->d);
    for (i = 0; i < 3; i++) s->d.cells[i] = is_sphere(scene) || i == (scene == POOL) ? n : 4;
    s->size = s->L * s->j->factor[CELL];
    s->d.cell_size = (gs4_real)(s->size / (is_sphere(scene) ? SPHERE_CELLS : n));
    s->origin = s->size * value(s, ORIGIN);
    s->d.origin = at(s->origin, s->origin, s->origin);
    s->origin = (double)s->d.origin.x;
    s->d.scheme = variants[s->j->variant].scheme;
    s->d.integrator = variants[s->j->variant].integrator;
    for (i = 0; i < 6; i++)
        s->d.walls[i] = is_wave(scene)     ? GS4_WALL_PERIODIC
                        : is_sphere(scene) ? GS4_WALL_OPEN
                                           : GS4_WALL_SLIP;
    if (scene == POOL) s->d.gravity = at(0, -s->L / (s->t * s->t), 0);
    if (s->j->variant != EULER) s->d.flip_decay_time = (gs4_real)(s->t * value(s, DECAY));
    s->d.max_dt = (gs4_real)(s->t * s->dt);
    s->speed = s->L / s->t * value(s, SPEED);
}

/* --- modes and what is exact ------------------------------------------------------------------ */

/* What the mode is at a particle, of three components; of temperature the first. */
static void mode(const trial *s, const gs4_real *position, double u[3])
{
    const int scene = s->j->scene, n = 2 * SPHERE_CELLS + 8;
    double x[3];
    int i;
    for (i = 0; i < 3; i++) x[i] = ((double)position[i] - s->origin) / s->size;
    u[0] = u[1] = u[2] = 0;
    if (is_wave(scene)) u[1] = sin(2 * PI * x[0]);
    if (is_thermal(scene)) u[0] = scene == MELT ? (x[0] < 0.5 ? 2 : -1) : cos(PI * x[0]);
    if (!is_sphere(scene)) return;
    for (i = 0; i < 3; i++) x[i] -= 0.5 * n / SPHERE_CELLS;
    u[0] = 3 * x[1] * x[2];
    u[1] = -3 * x[0] * x[2];
    u[0] *= scene_bessel(2, SPHERE_K * sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]));
    u[1] *= scene_bessel(2, SPHERE_K * sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]));
}

/* a(T), a' = -F r a - b, tau b' = (1 - F) r a - b, a(0) = 1, b(0) = 0; tau 0: b = (1 - F) r a. */
static double relaxing(double F, double r, double tau, double T)
{
    const double p = -F * r, q = -1 / tau, middle = 0.5 * (p + q), half = 0.5 * (p - q),
                 D = half * half - (1 - F) * r / tau;
    double w, fast, slow;
    if (D < 0) {
        w = sqrt(-D);
        return exp(middle * T) * (cos(w * T) + half / w * sin(w * T));
    }
    w = sqrt(D) + 1e-300;
    fast = middle - w; /* the other by their product, or it would be a difference */
    slow = (p * q + (1 - F) * r / tau) / fast;
    return 0.5 * (exp(slow * T) * (1 + half / w) + exp(fast * T) * (1 - half / w));
}

/* What is left of the mode, over that at first; *scale: what the error is over, what it should have
 * lost by first orders, at most 1. */
static double exact(const trial *s, double *scale)
{
    const int scene = s->j->scene;
    const double k2 = s->k * s->k, rho = value(s, DENSITY),
                 nu = (is_thermal(scene) ? value(s, CONDUCTIVITY) : value(s, VISCOSITY)) / rho,
                 w = s->k * sqrt(value(s, SHEAR) / rho) * s->T, x = nu * k2 * s->T,
                 tau = value(s, scene == CATTANEO ? FLUX_TIME : RELAXATION),
                 F = scene == CATTANEO ? 0 : 0.5;
    if (is_elastic(scene)) {
        *scale = fmin(1, w * w / 2);
        return cos(w);
    }
    *scale = fmin(1, x);
    if (!remembers(scene) && scene != CATTANEO) return exp(-x);
    *scale = fmin(1, F * x + (1 - F) * x * fmin(1, s->T / (2 * tau)));
    return relaxing(F, nu * k2, tau, s->T);
}

/* --- a run ------------------------------------------------------------------------------------ */

static int runs;

static int is_good(double x) { return x - x == 0; }

static double enthalpy(const trial *s, double *low, double *high)
{
    const gs4_view T = gs4_particles(s->sim, GS4_FIELD_TEMPERATURE),
                   f = gs4_particles(s->sim, GS4_FIELD_LIQUID_FRACTION);
    double sum = 0;
    int i;
    *low = 1e300;
    *high = -1e300;
    for (i = 0; i < T.count; i++) {
        const double t = (double)T.data[i * T.stride] / s->K;
        sum += (t + value(s, LATENT) * (f.data ? (double)f.data[i * f.stride] : 0)) / T.count;
        *low = fmin(*low, t);
        *high = fmax(*high, t);
    }
    return sum;
}

/* Fills and gives the mode; the sum that the mode has of itself at first, or where the particles
 * are. A negative result of gs4_* where it is refused. */
static int begin(trial *s, double *first)
{
    const int scene = s->j->scene, n = 2 * SPHERE_CELLS + 8;
    const double o = s->origin, c = o + s->size * 0.5 * n / SPHERE_CELLS, far = 9 * s->size;
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_edit e;
    gs4_view x;
    int i, a, r;
    *first = 0;
    if ((r = gs4_create(&s->d, &s->sim)) < 0) return r;
    for (i = 0; i <= (scene == POOL); i++) {
        const double y = o + (scene == POOL && i == 0 ? 0.5 * s->size : far);
        if ((r = gs4_add_material(s->sim, &s->m[i])) < 0) return r;
        f.material = r;
        r = gs4_add_particles(s->sim,
                              is_sphere(scene) ? gs4_sphere(at(c, c, c), (gs4_real)s->size)
                                               : gs4_box(at(o, i ? o + 0.5 * s->size : o, o),
                                                         at(o + far, y, o + far)),
                              &f);
        if (r < 0) return r;
    }
    if (scene == POOL) return GS4_OK;
    e = gs4_edit_particles(s->sim, is_thermal(scene) ? GS4_FIELD_TEMPERATURE : GS4_FIELD_VELOCITY);
    x = gs4_particles(s->sim, GS4_FIELD_POSITION);
    for (i = 0; i < e.count; i++) {
        double u[3];
        mode(s, x.data + (size_t)i * (size_t)x.stride, u);
        for (a = 0; a < e.components; a++) {
            e.data[i * e.stride + a] = (gs4_real)((is_thermal(scene) ? s->K : s->speed) * u[a]);
            *first += u[a] * u[a];
        }
    }
    return e.count ? GS4_OK : GS4_ERROR_ARGUMENT;
}

static void wrong(outcome *o, const char *why)
{
    o->sign = '!';
    strncpy(o->why, why, sizeof o->why - 1);
}

static void refused(outcome *o, const gs4_sim *sim)
{
    o->sign = '-';
    strncpy(o->why, gs4_last_error(sim), sizeof o->why - 1);
    if (!o->why[0]) wrong(o, "refused without a sentence");
}

/* Steps as asked for where dt is what is varied, else as gs4_advance takes them. */
static void follow(trial *s, outcome *o)
{
    const int given = s->j->factor[DT] != 1,
              most = (s->d.scheme == GS4_EXPLICIT ? 400 : 64) * (s->j->factor[TIME] > 1 ? 4 : 1);
    const gs4_budget one = { 1, 0, NULL, NULL };
    const double stable = (double)gs4_stable_dt(s->sim) / s->t;
    double left = s->T, done = 0;
    int i;
    if (!given && stable > 0 && s->T > 0.5 * stable * most) {
        o->sign = '$';
        strncpy(o->why, gs4_limit_name(s->sim), sizeof o->why - 1);
        return;
    }
    if (given) left = s->dt * fmin(fmax(4, ceil(s->T / s->dt - 1e-9)), 16);
    s->T = left;
    for (i = 0; left > 1e-6 * s->T; i++) {
        const double before = bench_now(NULL);
        const uint64_t hash = gs4_state_hash(s->sim);
        const int r = given ? gs4_step(s->sim, (gs4_real)(s->t * s->dt))
                            : gs4_advance_within(s->sim, (gs4_real)(s->t * left), &one, &done);
        const gs4_stats now = gs4_get_stats(s->sim);
        left -= given ? s->dt : done / s->t;
        if (r < 0) {
            refused(o, s->sim);
            if (gs4_state_hash(s->sim) != hash) wrong(o, "a refused step changed the state");
            return;
        }
        if (bench_now(NULL) - before > 5) return wrong(o, "a step of more than 5 s");
        if (!is_good(now.kinetic_energy) || !is_good(now.max_speed) || !is_good(now.volume))
            return wrong(o, "not finite");
        if (i > most + 16) {
            o->sign = '$';
            strcpy(o->why, now.refused ? "steps that are refused and tried again" : "max_dt");
            return;
        }
    }
}

/* Error of a run that has ended. */
static double judge(const trial *s, double first)
{
    const int thermal = is_thermal(s->j->scene);
    const gs4_view x = gs4_particles(s->sim, GS4_FIELD_POSITION),
                   v = gs4_particles(s->sim, thermal ? GS4_FIELD_TEMPERATURE : GS4_FIELD_VELOCITY);
    double sum = 0, u[3], scale, should;
    int i, a;
    for (i = 0; i < v.count; i++) {
        mode(s, x.data + (size_t)i * (size_t)x.stride, u);
        for (a = 0; a < v.components; a++) sum += u[a] * (double)v.data[i * v.stride + a];
    }
    should = exact(s, &scale);
    return fabs(sum / (first * (thermal ? s->K : s->speed)) - should) / scale;
}

/* Heat lost or gained, and temperatures beyond those at first, over what there was. */
static double judge_melt(const trial *s, double before)
{
    double low, high;
    const double H = enthalpy(s, &low, &high);
    return fmax(fabs(H - before) / fmax(1, value(s, LATENT)), fmax(-1 - low, high - 2));
}

/* How far particles of a pool have moved, rms, over its depth. */
static double judge_pool(const trial *s, const double *start)
{
    const gs4_view x = gs4_particles(s->sim, GS4_FIELD_POSITION);
    const uint32_t *id = gs4_particle_ids(s->sim);
    double sum = 0;
    int i, a;
    for (i = 0; i < x.count; i++)
        for (a = 0; a < 3; a++)
            sum += pow((double)x.data[i * x.stride + a] - start[3 * id[i] + (unsigned)a], 2);
    return sqrt(sum / x.count) / s->size;
}

static outcome run(const job *j)
{
    trial s;
    outcome o;
    double first = 0, low, high, *start = NULL;
    int r;
    runs++;
    memset(&s, 0, sizeof s);
    memset(&o, 0, sizeof o);
    s.j = j;
    s.L = value(&s, UNIT_LENGTH);
    s.t = value(&s, UNIT_TIME);
    s.M = value(&s, UNIT_MASS);
    s.K = value(&s, UNIT_TEMPERATURE);
    times(&s);
    matter(&s);
    describe(&s);
    if ((r = begin(&s, &first)) < 0)
        refused(&o, s.sim);
    else {
        if (j->scene == MELT) first = enthalpy(&s, &low, &high);
        if (j->scene == POOL) {
            start = (double *)malloc(3 * sizeof *start * (size_t)gs4_get_stats(s.sim).particles);
            scene_by_id(s.sim, GS4_FIELD_POSITION, start);
        }
        follow(&s, &o);
        if (!o.sign) {
            o.error = j->scene == POOL   ? judge_pool(&s, start)
                      : j->scene == MELT ? judge_melt(&s, first)
                                         : judge(&s, first);
            o.sign =
                o.error <= scenes[j->scene].bound * (j->variant == EULER && j->scene < HEAT ? 2 : 1)
                    ? '.'
                    : '~';
            if (!is_good(o.error)) wrong(&o, "the answer is not finite");
        }
    }
    free(start);
    gs4_destroy(s.sim);
    return o;
}
#endif
