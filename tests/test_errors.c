/* Every value that crosses the interface, at values that nobody should give: it is accepted and
 * the scene goes on with finite numbers, or the answer is a negative code with a sentence that
 * names the field. Nothing else. Run all with run_errors(). */
#include <limits.h>
#include <stddef.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif
#define ERR_NAN ((double)NAN)
#define ERR_INFINITY ((double)INFINITY)

/* --- a scene to do it to ---------------------------------------------------------------------- */

static gs4_sim_desc err_desc(void)
{
    gs4_sim_desc d = scene_cube(8);
    d.gravity = at(0, 0, -10);
    d.rho_inf = (gs4_real)0.5;
    return d;
}

static gs4_material err_material(void) { return scene_liquid(1000, 0.1, 10); }

static gs4_sim *err_sim_of(const gs4_sim_desc *d)
{
    const gs4_material m = err_material();
    gs4_sim *sim = NULL;
    if (gs4_create(d, &sim) == GS4_OK) gs4_add_material(sim, &m);
    return sim;
}

static gs4_sim *err_sim(void)
{
    const gs4_sim_desc d = err_desc();
    return err_sim_of(&d);
}

/* A small block of liquid in the midst of the grid, whatever the grid is. */
static int err_add_block(gs4_sim *sim)
{
    const gs4_sim_desc d = gs4_get_desc(sim);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const double h = (double)d.cell_size, x = (double)d.origin.x, y = (double)d.origin.y,
                 z = (double)d.origin.z;
    return gs4_add_particles(
        sim, gs4_box(at(x + h, y + h, z + h), at(x + 3 * h, y + 3 * h, z + 3 * h)), &f);
}

static gs4_sim *err_scene(void)
{
    gs4_sim *sim = err_sim();
    CHECK(err_add_block(sim) == 64);
    return sim;
}

/* A few steps of half the limit and one gs4_advance: each is taken, or refused with a sentence;
 * all stays finite. */
static int err_goes_on(gs4_sim *sim)
{
    int i, good = physics_is_finite(sim);
    for (i = 0; i < 4 && good; i++) {
        const gs4_real limit = gs4_stable_dt(sim),
                       dt = (gs4_real)0.5 * (limit < (gs4_real)0.01 ? limit : (gs4_real)0.01);
        const int r = i < 3 ? gs4_step(sim, dt) : gs4_advance(sim, 2 * dt);
        good = limit >= 0 && r <= 0 && (r == GS4_OK || gs4_last_error(sim)[0])
               && physics_is_finite(sim);
    }
    return good;
}

/* --- tables of fields ------------------------------------------------------------------------- */

typedef enum err_kind {
    ERR_REAL,
    ERR_INT,
    ERR_LATER /* real: all but 0 rejected */,
    ERR_LATER_INT
} err_kind;
typedef struct err_field {
    const char *name, *said;
    size_t offset;
    err_kind kind;
} err_field;
#define ERR_FIELD(type, member, said, kind)         \
    {                                               \
#member, said, offsetof(type, member), kind \
    }
#define ERR_COUNT(a) ((int)(sizeof(a) / sizeof((a)[0])))

static double err_value(int i)
{
    const int wide = sizeof(gs4_real) == 8;
    switch (i) {
    case 0: return ERR_NAN;
    case 1: return ERR_INFINITY;
    case 2: return -ERR_INFINITY;
    case 3: return -1;
    case 4: return 0;
    case 5: return 1e30;
    case 6: return -1e30;
    case 7: return wide ? 1e300 : 3e38;
    case 8: return 1e17;
    case 9: return wide ? 1e-300 : 1e-37;
    /* denormal: its reciprocal is infinite */
    case 10: return wide ? 1e-320 : 1e-44;
    default: return 1e6;
    }
}
enum {
    ERR_VALUES = 12
};

static int err_integer(int i)
{
    static const int values[] = { -1, INT_MIN, INT_MAX, 0, 1, 2, 3, 77 };
    return values[i];
}
enum {
    ERR_INTEGERS = 8
};

static void err_report(int good, const char *what, const char *field, double value, int result,
                       const char *sentence)
{
    char line[500];
    if (good) {
        test_passed++;
        return;
    }
    sprintf(line, "%.40s.%.60s = %.9g: %d, %.320s", what, field, value, result, sentence);
    test_report(0, __FILE__, __LINE__, line);
}

typedef enum err_target {
    ERR_DESC,
    ERR_MATERIAL,
    ERR_FILL,
    ERR_POINTS,
    ERR_COLLIDER,
    ERR_EMITTER
} err_target;
static const char *const err_names[] = { "gs4_sim_desc",      "gs4_material", "gs4_fill",
                                         "gs4_fill (points)", "gs4_collider", "gs4_emitter" };

/* Gives the struct to a new simulation, which is made with its particles; the answer and the
 * sentence. */
static int err_give(err_target target, const void *s, gs4_sim **out, char sentence[400])
{
    static const gs4_real xyz[3] = { (gs4_real)0.6, (gs4_real)0.6, (gs4_real)0.6 };
    gs4_sim *sim = NULL;
    int r = GS4_OK;
    if (target == ERR_DESC) {
        const gs4_material m = err_material();
        r = gs4_create((const gs4_sim_desc *)s, &sim);
        if (r == GS4_OK) {
            gs4_add_material(sim, &m);
            err_add_block(sim);
        }
    } else if (target == ERR_MATERIAL) {
        sim = NULL;
        {
            const gs4_sim_desc d = err_desc();
            gs4_create(&d, &sim);
        }
        r = gs4_add_material(sim, (const gs4_material *)s);
        /* may be refused: particles too light or too heavy */
        if (r >= 0) r = err_add_block(sim);
    } else {
        sim = err_scene();
        if (target == ERR_FILL)
            r = gs4_add_particles(sim, gs4_box(at(0.5, 0.5, 0.5), at(0.875, 0.875, 0.875)),
                                  (const gs4_fill *)s);
        if (target == ERR_POINTS)
            r = gs4_add_points(sim, xyz, 1, (gs4_real)1e-4, (const gs4_fill *)s);
        if (target == ERR_COLLIDER) r = gs4_add_collider(sim, (const gs4_collider *)s);
        if (target == ERR_EMITTER) r = gs4_add_emitter(sim, (const gs4_emitter *)s);
    }
    sprintf(sentence, "%.320s", gs4_last_error(sim));
    *out = sim;
    return r;
}

static void err_try(err_target target, const void *base, size_t size, const err_field *f,
                    double value)
{
    union {
        gs4_sim_desc d;
        gs4_material m;
        gs4_fill f;
        gs4_collider c;
        gs4_emitter e;
    } changed;
    const int integral = f->kind == ERR_INT || f->kind == ERR_LATER_INT,
              later = f->kind == ERR_LATER || f->kind == ERR_LATER_INT;
    const gs4_real real = (gs4_real)value;
    gs4_sim *sim = NULL;
    char sentence[400];
    int r;
    memcpy(&changed, base, size);
    if (integral) {
        const int i = (int)value;
        memcpy((char *)&changed + f->offset, &i, sizeof i);
    } else
        memcpy((char *)&changed + f->offset, &real, sizeof real);
    r = err_give(target, &changed, &sim, sentence);
    if (r < 0)
        err_report(r >= GS4_ERROR_ABI
                       && (strstr(sentence, f->said)
                           || (target == ERR_MATERIAL && r == GS4_ERROR_ARGUMENT
                               && strstr(sentence, "particle"))),
                   err_names[target], f->name, value, r, sentence[0] ? sentence : "no sentence");
    else
        err_report(!(later && (integral ? value != 0 : real != 0)), err_names[target], f->name,
                   value, r, "accepted though this version cannot do it");
    if (sim)
        err_report(err_goes_on(sim), err_names[target], f->name, value, r,
                   "then a number that is not finite, or an error without a sentence");
    gs4_destroy(sim);
}

/* An anisotropy of 1e6 is seconds of substeps in float. */
static int err_is_slow(const err_field *f, int v)
{
    return (double)(gs4_real)err_value(v) == 1e6 && strcmp(f->name, "anisotropy") == 0;
}

static void err_try_all(err_target target, const void *base, size_t size, const err_field *fields,
                        int count)
{
    int f, v;
    for (f = 0; f < count; f++) {
        if (fields[f].kind == ERR_INT || fields[f].kind == ERR_LATER_INT)
            for (v = 0; v < ERR_INTEGERS; v++)
                err_try(target, base, size, &fields[f], (double)err_integer(v));
        else
            for (v = 0; v < ERR_VALUES; v++)
                if (test_full || !err_is_slow(&fields[f], v))
                    err_try(target, base, size, &fields[f], err_value(v));
    }
}

#define ERR_VEC(type, member, said)                                                       \
    ERR_FIELD(type, member.x, said, ERR_REAL), ERR_FIELD(type, member.y, said, ERR_REAL), \
        ERR_FIELD(type, member.z, said, ERR_REAL)

static void test_errors_desc(void)
{
    static const err_field fields[] = {
        ERR_FIELD(gs4_sim_desc, cells[0], "cells", ERR_INT),
        ERR_FIELD(gs4_sim_desc, cells[1], "cells", ERR_INT),
        ERR_FIELD(gs4_sim_desc, cells[2], "cells", ERR_INT),
        ERR_FIELD(gs4_sim_desc, cell_size, "cell_size", ERR_REAL),
        ERR_VEC(gs4_sim_desc, origin, "origin"),
        ERR_VEC(gs4_sim_desc, gravity, "gravity"),
        ERR_FIELD(gs4_sim_desc, scheme, "scheme", ERR_INT),
        ERR_FIELD(gs4_sim_desc, rho_inf, "rho_inf", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, rho_inf_spurious, "rho_inf_spurious", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, flip_decay_time, "flip_decay_time", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, walls[0], "walls", ERR_INT),
        ERR_FIELD(gs4_sim_desc, walls[3], "walls", ERR_INT),
        ERR_FIELD(gs4_sim_desc, walls[5], "walls", ERR_INT),
        ERR_FIELD(gs4_sim_desc, wall_temperature[0], "wall_temperature", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, wall_temperature[5], "wall_temperature", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, wall_is_isothermal[0], "wall_is_isothermal", ERR_INT),
        ERR_FIELD(gs4_sim_desc, wall_is_isothermal[5], "wall_is_isothermal", ERR_INT),
        ERR_FIELD(gs4_sim_desc, ambient_temperature, "ambient_temperature", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, air_is_isothermal, "air_is_isothermal", ERR_INT),
        ERR_FIELD(gs4_sim_desc, cfl, "cfl", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, max_dt, "max_dt", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, solver_tolerance, "solver_tolerance", ERR_REAL),
        ERR_FIELD(gs4_sim_desc, solver_max_iterations, "solver_max_iterations", ERR_INT),
        ERR_FIELD(gs4_sim_desc, max_particles, "max_particles", ERR_INT),
        ERR_FIELD(gs4_sim_desc, threads, "threads", ERR_INT),
        ERR_FIELD(gs4_sim_desc, sharp_gradients, "sharp_gradients", ERR_INT),
        ERR_FIELD(gs4_sim_desc, affine, "affine", ERR_INT)
    };
    static const err_field integrator[] = { ERR_FIELD(gs4_sim_desc, integrator, "integrator",
                                                      ERR_INT) };
    gs4_sim_desc d = err_desc();
    err_try_all(ERR_DESC, &d, sizeof d, fields, ERR_COUNT(fields));
    d.rho_inf = 0;
    err_try_all(ERR_DESC, &d, sizeof d, integrator, 1);
}

static void test_errors_material(void)
{
    static const err_field fields[] = {
        ERR_FIELD(gs4_material, density, "density", ERR_REAL),
        ERR_FIELD(gs4_material, liquid, "liquid", ERR_INT),
        ERR_FIELD(gs4_material, viscosity, "viscosity", ERR_REAL),
        ERR_FIELD(gs4_material, local_fraction, "local_fraction", ERR_REAL),
        ERR_FIELD(gs4_material, relaxation_time, "relaxation_time", ERR_LATER),
        ERR_FIELD(gs4_material, stretch_time, "stretch_time", ERR_LATER),
        ERR_FIELD(gs4_material, anisotropy, "anisotropy", ERR_LATER),
        ERR_FIELD(gs4_material, arms, "arms", ERR_LATER),
        ERR_FIELD(gs4_material, viscosity_law, "viscosity", ERR_INT),
        ERR_FIELD(gs4_material, cross_wlf.a, "cross_wlf", ERR_LATER),
        ERR_FIELD(gs4_material, cross_wlf.n, "cross_wlf", ERR_LATER),
        ERR_FIELD(gs4_material, cross_wlf.d1, "cross_wlf", ERR_LATER),
        ERR_FIELD(gs4_material, cross_wlf.a1, "cross_wlf", ERR_LATER),
        ERR_FIELD(gs4_material, cross_wlf.t1, "cross_wlf", ERR_LATER),
        ERR_FIELD(gs4_material, cross_wlf.t2, "cross_wlf", ERR_LATER),
        ERR_FIELD(gs4_material, bulk_modulus, "bulk_modulus", ERR_REAL),
        ERR_FIELD(gs4_material, sound_speed, "sound_speed", ERR_REAL),
        ERR_FIELD(gs4_material, herschel_bulkley.yield_stress, "herschel_bulkley.yield_stress",
                  ERR_LATER),
        ERR_FIELD(gs4_material, herschel_bulkley.consistency, "herschel_bulkley.consistency",
                  ERR_LATER),
        ERR_FIELD(gs4_material, herschel_bulkley.index, "herschel_bulkley.index", ERR_LATER),
        ERR_FIELD(gs4_material, herschel_bulkley.creep_rate, "herschel_bulkley.creep_rate",
                  ERR_LATER),
        ERR_FIELD(gs4_material, incompressible, "incompressible", ERR_LATER_INT),
        ERR_FIELD(gs4_material, solid, "solid", ERR_INT),
        ERR_FIELD(gs4_material, shear_modulus, "shear_modulus", ERR_LATER),
        ERR_FIELD(gs4_material, yield_compression, "yield_compression", ERR_LATER),
        ERR_FIELD(gs4_material, yield_stretch, "yield_stretch", ERR_LATER),
        ERR_FIELD(gs4_material, heat_capacity, "heat_capacity", ERR_REAL),
        ERR_FIELD(gs4_material, flux_relaxation_time, "flux_relaxation_time", ERR_LATER),
        ERR_FIELD(gs4_material, fourier_fraction, "fourier_fraction", ERR_REAL),
        ERR_FIELD(gs4_material, melting_temperature, "melting_temperature", ERR_LATER),
        ERR_FIELD(gs4_material, latent_heat, "latent_heat", ERR_LATER)
    };
    static const err_field warm[] = {
        ERR_FIELD(gs4_material, heat_capacity, "heat_capacity", ERR_REAL),
        ERR_FIELD(gs4_material, conductivity, "conductivity", ERR_REAL),
        ERR_FIELD(gs4_material, flux_relaxation_time, "flux_relaxation_time", ERR_REAL),
        ERR_FIELD(gs4_material, fourier_fraction, "fourier_fraction", ERR_REAL),
        ERR_FIELD(gs4_material, melting_temperature, "melting_temperature", ERR_REAL),
        ERR_FIELD(gs4_material, latent_heat, "latent_heat", ERR_REAL),
        ERR_FIELD(gs4_material, can_melt, "can_melt", ERR_INT),
        ERR_FIELD(gs4_material, viscous_heating, "viscous_heating", ERR_INT)
    };
    static const err_field paste[] = {
        ERR_FIELD(gs4_material, herschel_bulkley.yield_stress, "herschel_bulkley", ERR_REAL),
        ERR_FIELD(gs4_material, herschel_bulkley.consistency, "herschel_bulkley", ERR_REAL),
        ERR_FIELD(gs4_material, herschel_bulkley.index, "herschel_bulkley.index", ERR_REAL),
        ERR_FIELD(gs4_material, herschel_bulkley.creep_rate, "herschel_bulkley", ERR_REAL),
        ERR_FIELD(gs4_material, viscosity, "viscosity", ERR_LATER),
        ERR_FIELD(gs4_material, liquid, "liquid", ERR_LATER_INT),
        ERR_FIELD(gs4_material, solid, "solid", ERR_LATER_INT)
    };
    static const err_field pom_pom[] = {
        ERR_FIELD(gs4_material, liquid, "liquid", ERR_INT),
        ERR_FIELD(gs4_material, viscosity, "viscosity", ERR_REAL),
        ERR_FIELD(gs4_material, local_fraction, "local_fraction", ERR_REAL),
        ERR_FIELD(gs4_material, relaxation_time, "relaxation_time", ERR_REAL),
        ERR_FIELD(gs4_material, stretch_time, "stretch_time", ERR_REAL),
        ERR_FIELD(gs4_material, anisotropy, "anisotropy", ERR_REAL),
        ERR_FIELD(gs4_material, arms, "arms", ERR_REAL)
    };
    static const err_field solid[] = {
        ERR_FIELD(gs4_material, solid, "solid", ERR_INT),
        ERR_FIELD(gs4_material, shear_modulus, "shear_modulus", ERR_REAL),
        ERR_FIELD(gs4_material, yield_compression, "yield_compression", ERR_REAL),
        ERR_FIELD(gs4_material, yield_stretch, "yield_stretch", ERR_REAL),
        ERR_FIELD(gs4_material, viscosity, "viscosity", ERR_REAL),
        ERR_FIELD(gs4_material, liquid, "liquid", ERR_INT)
    };
    static const err_field cross[] = { ERR_FIELD(gs4_material, cross_wlf.a, "cross_wlf", ERR_REAL),
                                       ERR_FIELD(gs4_material, cross_wlf.n, "cross_wlf", ERR_REAL),
                                       ERR_FIELD(gs4_material, cross_wlf.d1, "cross_wlf", ERR_REAL),
                                       ERR_FIELD(gs4_material, cross_wlf.a1, "cross_wlf", ERR_REAL),
                                       ERR_FIELD(gs4_material, cross_wlf.t1, "cross_wlf", ERR_REAL),
                                       ERR_FIELD(gs4_material, cross_wlf.t2, "cross_wlf",
                                                 ERR_REAL) };
    gs4_material m = err_material();
    err_try_all(ERR_MATERIAL, &m, sizeof m, fields, ERR_COUNT(fields));
    m.liquid = GS4_POM_POM;
    m.local_fraction = (gs4_real)0.1;
    m.relaxation_time = 1;
    m.stretch_time = (gs4_real)0.5;
    m.anisotropy = (gs4_real)0.1;
    m.arms = 4;
    err_try_all(ERR_MATERIAL, &m, sizeof m, pom_pom, ERR_COUNT(pom_pom));
    m = err_material();
    m.heat_capacity = 1000;
    m.conductivity = 1;
    m.flux_relaxation_time = (gs4_real)0.1;
    m.fourier_fraction = (gs4_real)0.5;
    m.can_melt = 1;
    m.melting_temperature = 1;
    m.latent_heat = (gs4_real)1e5;
    m.viscous_heating = 1;
    err_try_all(ERR_MATERIAL, &m, sizeof m, warm, ERR_COUNT(warm));
    m = err_material();
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1000;
    m.yield_compression = (gs4_real)0.1;
    err_try_all(ERR_MATERIAL, &m, sizeof m, solid, ERR_COUNT(solid));
    m = err_material();
    m.viscosity_law = GS4_VISCOSITY_CROSS_WLF;
    m.cross_wlf.a = 1;
    m.cross_wlf.n = (gs4_real)0.5;
    m.cross_wlf.d1 = 10;
    m.cross_wlf.a1 = 1;
    m.cross_wlf.t1 = 1;
    m.cross_wlf.t2 = -50;
    err_try_all(ERR_MATERIAL, &m, sizeof m, cross, ERR_COUNT(cross));
    m = err_material();
    m.viscosity = 0;
    m.viscosity_law = GS4_VISCOSITY_HERSCHEL_BULKLEY;
    m.herschel_bulkley.yield_stress = (gs4_real)0.5;
    m.herschel_bulkley.consistency = 1;
    m.herschel_bulkley.index = (gs4_real)0.5;
    m.herschel_bulkley.creep_rate = 1;
    err_try_all(ERR_MATERIAL, &m, sizeof m, paste, ERR_COUNT(paste));
    m = err_material();
    /* the fields that exclude each other, one at a time */
    m.sound_speed = 0;
    m.bulk_modulus = (gs4_real)1e5;
    err_try_all(ERR_MATERIAL, &m, sizeof m, fields + 15, 1);
    m.bulk_modulus = 0;
    err_try_all(ERR_MATERIAL, &m, sizeof m, fields, 4);
    err_try_all(ERR_MATERIAL, &m, sizeof m, fields + 15, 2);
}

static void test_errors_fill(void)
{
    static const err_field fields[] = { ERR_FIELD(gs4_fill, material, "fill.material", ERR_INT),
                                        ERR_FIELD(gs4_fill, spacing, "fill.spacing", ERR_REAL),
                                        ERR_VEC(gs4_fill, velocity, "velocity"),
                                        ERR_VEC(gs4_fill, angular_velocity, "angular_velocity"),
                                        ERR_FIELD(gs4_fill, temperature, "fill.temperature",
                                                  ERR_LATER),
                                        ERR_FIELD(gs4_fill, jitter, "fill.jitter", ERR_REAL),
                                        ERR_FIELD(gs4_fill, random_seed, "random_seed", ERR_INT) };
    gs4_fill f = scene_fill(at(0.1, 0, 0));
    f.jitter = (gs4_real)0.5;
    err_try_all(ERR_FILL, &f, sizeof f, fields, ERR_COUNT(fields));
    err_try_all(ERR_POINTS, &f, sizeof f, fields, ERR_COUNT(fields));
}

#define ERR_SHAPE(type)                                                                    \
    ERR_FIELD(type, shape.kind, "shape", ERR_INT), ERR_VEC(type, shape.a, "shape"),        \
        ERR_VEC(type, shape.b, "shape"), ERR_FIELD(type, shape.radius, "shape", ERR_REAL), \
        ERR_FIELD(type, shape.vertex_count, "shape", ERR_INT),                             \
        ERR_FIELD(type, shape.triangle_count, "shape", ERR_INT)

static gs4_shape err_shape(int kind)
{
    return kind == 0   ? gs4_box(at(0.2, 0.2, 0.1), at(0.6, 0.6, 0.3))
           : kind == 1 ? gs4_sphere(at(0.5, 0.5, 0.2), (gs4_real)0.2)
           : kind == 2 ? gs4_cylinder(at(0.3, 0.3, 0.2), at(0.6, 0.6, 0.3), (gs4_real)0.15)
                       : gs4_plane(at(0.5, 0.5, 0.2), at(0, 0.1, 1));
}

static void test_errors_collider(void)
{
    static const err_field fields[] = {
        ERR_SHAPE(gs4_collider),
        ERR_FIELD(gs4_collider, contact, "contact", ERR_INT),
        ERR_FIELD(gs4_collider, friction, "friction", ERR_REAL),
        ERR_VEC(gs4_collider, velocity, "velocity"),
        ERR_VEC(gs4_collider, angular_velocity, "angular_velocity"),
        ERR_VEC(gs4_collider, pivot, "pivot"),
        ERR_FIELD(gs4_collider, temperature, "temperature", ERR_REAL),
        ERR_FIELD(gs4_collider, is_isothermal, "is_isothermal", ERR_INT)
    };
    gs4_collider c;
    int kind;
    memset(&c, 0, sizeof c);
    c.contact = GS4_WALL_SEPARATE;
    c.friction = (gs4_real)0.3;
    for (kind = 0; kind < 4; kind++) {
        c.shape = err_shape(kind);
        err_try_all(ERR_COLLIDER, &c, sizeof c, fields, kind == 0 ? ERR_COUNT(fields) : 10);
    }
}

static int err_calls;
static gs4_real err_counting_sdf(gs4_vec3 p, void *user)
{
    (void)user;
    err_calls++;
    return p.x > (gs4_real)0.4 && p.x < (gs4_real)0.6 && p.y > (gs4_real)0.4 && p.y < (gs4_real)0.6
               ? (gs4_real)-0.1
               : (gs4_real)0.1;
}

/* The lattice of an emitter must be cut to the grid, or a large emitter takes for ever. Returns how
 * often the distance was asked for. */
static int err_emitter_calls(void)
{
    gs4_sim *sim = err_sim();
    gs4_emitter e;
    memset(&e, 0, sizeof e);
    e.fill = scene_fill(at(0, 0, -0.1));
    e.shape = gs4_sdf(err_counting_sdf, NULL, at(0.375, 0.375, 0), at(0.625, 0.625, 200));
    CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
    err_calls = 0;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), 0);
    gs4_destroy(sim);
    return err_calls;
}

static void test_errors_large_emitter(void) { CHECK(err_emitter_calls() < 20000); }

static void test_errors_emitter(void)
{
    static const err_field fields[] = {
        ERR_FIELD(gs4_emitter, fill.material, "fill.material", ERR_INT),
        ERR_FIELD(gs4_emitter, fill.spacing, "fill.spacing", ERR_REAL),
        ERR_VEC(gs4_emitter, fill.velocity, "velocity"),
        ERR_VEC(gs4_emitter, fill.angular_velocity, "angular_velocity"),
        ERR_FIELD(gs4_emitter, fill.temperature, "fill.temperature", ERR_LATER),
        ERR_FIELD(gs4_emitter, fill.jitter, "fill.jitter", ERR_REAL),
        ERR_VEC(gs4_emitter, travel, "travel"),
        ERR_VEC(gs4_emitter, pivot, "pivot"),
        ERR_FIELD(gs4_emitter, start, "start", ERR_REAL),
        ERR_FIELD(gs4_emitter, stop, "stop", ERR_REAL)
    };
    static const err_field shapes[] = { ERR_SHAPE(gs4_emitter) };
    gs4_emitter e;
    int kind;
    memset(&e, 0, sizeof e);
    e.fill = scene_fill(at(0, 0, -0.5));
    e.fill.jitter = (gs4_real)0.5;
    e.shape = err_shape(0);
    err_try_all(ERR_EMITTER, &e, sizeof e, fields, ERR_COUNT(fields));
    if (err_emitter_calls() >= 20000) return; /* huge shapes would take for ever */
    for (kind = 0; kind < 4; kind += test_full ? 1 : 3) {
        e.shape = err_shape(kind);
        err_try_all(ERR_EMITTER, &e, sizeof e, shapes, ERR_COUNT(shapes));
    }
}

/* --- calls ------------------------------------------------------------------------------------ */

/* A refused call: this code, a sentence with this word, and the same state. */
#define ERR_REFUSED(sim, call, code, word)                \
    do {                                                  \
        const uint64_t err_h = gs4_state_hash(sim);       \
        CHECK_RESULT(sim, call, code);                    \
        CHECK(strstr(gs4_last_error(sim), word) != NULL); \
        CHECK(gs4_state_hash(sim) == err_h);              \
    } while (0)

/* Poses that are none, of collider 0 and emitter 0. */
static void err_poses(gs4_sim *sim, const gs4_vec3 bad[6], const int ids[4])
{
    const double durations[] = { 0, -1, ERR_NAN, ERR_INFINITY,
                                 sizeof(gs4_real) == 8 ? 1e-310 : 1e-40 };
    gs4_pose pose, now;
    int i;
    CHECK_RESULT(sim, gs4_collider_pose(sim, 0, &now), GS4_OK);
    for (i = 0; i < 4; i++) {
        ERR_REFUSED(sim, gs4_collider_pose(sim, ids[i], &pose), GS4_ERROR_ARGUMENT, "collider");
        ERR_REFUSED(sim, gs4_emitter_pose(sim, ids[i], &pose), GS4_ERROR_ARGUMENT, "emitter");
        ERR_REFUSED(sim, gs4_put_emitter(sim, ids[i], &now), GS4_ERROR_ARGUMENT, "emitter");
        ERR_REFUSED(sim, gs4_move_collider_to(sim, ids[i], &now, 1), GS4_ERROR_ARGUMENT,
                    "collider");
        pose = now;
        pose.quaternion[i] = (gs4_real)(i & 1 ? ERR_NAN : ERR_INFINITY);
        ERR_REFUSED(sim, gs4_put_collider(sim, 0, &pose), GS4_ERROR_ARGUMENT, "quaternion");
        ERR_REFUSED(sim, gs4_move_emitter_to(sim, 0, &pose, 1), GS4_ERROR_ARGUMENT, "quaternion");
    }
    ERR_REFUSED(sim, gs4_collider_pose(sim, 0, NULL), GS4_ERROR_ARGUMENT, "pose");
    ERR_REFUSED(sim, gs4_put_emitter(sim, 0, NULL), GS4_ERROR_ARGUMENT, "pose");
    ERR_REFUSED(sim, gs4_move_collider_to(sim, 0, NULL, 1), GS4_ERROR_ARGUMENT, "pose");
    for (i = 0; i < 6; i++) {
        pose = now;
        pose.position = bad[i];
        ERR_REFUSED(sim, gs4_put_emitter(sim, 0, &pose), GS4_ERROR_ARGUMENT, "position");
        ERR_REFUSED(sim, gs4_move_collider_to(sim, 0, &pose, 1), GS4_ERROR_ARGUMENT, "position");
    }
    for (i = 0; i < 5; i++)
        ERR_REFUSED(sim, gs4_move_collider_to(sim, 0, &now, (gs4_real)durations[i]),
                    GS4_ERROR_ARGUMENT, "duration");
    /* nothing is the turn that is none */
    memset(pose.quaternion, 0, sizeof pose.quaternion);
    pose.position = at(0.1, 0.2, 0.3);
    CHECK_RESULT(sim, gs4_put_collider(sim, 0, &pose), GS4_OK);
    CHECK_RESULT(sim, gs4_collider_pose(sim, 0, &pose), GS4_OK);
    CHECK(pose.quaternion[0] == 1 && pose.quaternion[1] == 0);
    CHECK_RESULT(sim, gs4_put_collider(sim, 0, &now), GS4_OK);
    CHECK(gs4_collider_pose(NULL, 0, &pose) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_put_emitter(NULL, 0, &pose) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_move_emitter_to(NULL, 0, &pose, 1) == GS4_ERROR_ARGUMENT);
}

static void test_errors_calls(void)
{
    gs4_sim *sim = err_scene();
    const gs4_vec3 good = at(0, 0, 0),
                   bad[6] = { at(ERR_NAN, 0, 0),
                              at(0, ERR_INFINITY, 0),
                              at(0, 0, -ERR_INFINITY),
                              at(ERR_NAN, ERR_NAN, ERR_NAN),
                              at(sizeof(gs4_real) == 8 ? 1e300 : 1e30, 0, 0),
                              at(0, 0, sizeof(gs4_real) == 8 ? -1e300 : -1e30) };
    const double dts[] = { 0, -1, ERR_NAN, ERR_INFINITY, -ERR_INFINITY };
    static const int ids[] = { -1, 2, INT_MAX, INT_MIN };
    gs4_collider c;
    gs4_emitter e;
    int i, collider, emitter;
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    c.shape = gs4_sphere(at(0.5, 0.5, 0.8), (gs4_real)0.1);
    e.shape = gs4_box(at(0.6, 0.6, 0.6), at(0.9, 0.9, 0.9));
    e.fill = scene_fill(at(0, 0, -0.1));
    collider = gs4_add_collider(sim, &c);
    emitter = gs4_add_emitter(sim, &e);
    CHECK(collider == 0 && emitter == 0);
    for (i = 0; i < 5; i++) {
        ERR_REFUSED(sim, gs4_step(sim, (gs4_real)dts[i]), GS4_ERROR_ARGUMENT, "dt");
        if (i) ERR_REFUSED(sim, gs4_advance(sim, (gs4_real)dts[i]), GS4_ERROR_ARGUMENT, "duration");
    }
    CHECK_RESULT(sim, gs4_advance(sim, 0), 0);
    for (i = 0; i < 6; i++) {
        ERR_REFUSED(sim, gs4_move_collider(sim, collider, bad[i], good), GS4_ERROR_ARGUMENT,
                    "velocity");
        ERR_REFUSED(sim, gs4_move_collider(sim, collider, good, bad[i]), GS4_ERROR_ARGUMENT,
                    "angular_velocity");
        ERR_REFUSED(sim, gs4_move_emitter(sim, emitter, bad[i]), GS4_ERROR_ARGUMENT, "travel");
    }
    for (i = 0; i < 4; i++) {
        ERR_REFUSED(sim, gs4_move_collider(sim, ids[i], good, good), GS4_ERROR_ARGUMENT,
                    "collider");
        ERR_REFUSED(sim, gs4_move_emitter(sim, ids[i], good), GS4_ERROR_ARGUMENT, "emitter");
    }
    err_poses(sim, bad, ids);
    /* the emitter's collider */
    ERR_REFUSED(sim, gs4_move_collider(sim, 1, good, good), GS4_ERROR_ARGUMENT, "emitter");
    ERR_REFUSED(sim, gs4_move_emitter(sim, 1, good), GS4_ERROR_ARGUMENT, "emitter");
    CHECK(err_goes_on(sim));
    gs4_destroy(sim);
}

static void test_errors_points(void)
{
    gs4_sim *sim = err_scene();
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const gs4_real good[6] = { (gs4_real)0.7, (gs4_real)0.7, (gs4_real)0.7,
                               (gs4_real)0.8, (gs4_real)0.7, (gs4_real)0.7 };
    const gs4_real volume = (gs4_real)1e-4;
    int i, v;
    for (i = 0; i < 6; i++)
        for (v = 0; v < ERR_VALUES; v++) {
            gs4_real x[6];
            if (err_value(v) >= 0 && err_value(v) < 1) continue; /* inside */
            memcpy(x, good, sizeof x);
            x[i] = (gs4_real)err_value(v);
            ERR_REFUSED(sim, gs4_add_points(sim, x, 2, volume, &f), GS4_ERROR_ARGUMENT, "");
            CHECK(strstr(gs4_last_error(sim), "xyz")
                  || strstr(gs4_last_error(sim), i < 3 ? "point 0" : "point 1"));
        }
    for (v = 0; v < ERR_VALUES; v++) {
        const int r = gs4_add_points(sim, good, 2, (gs4_real)err_value(v), &f);
        CHECK(r == GS4_ERROR_ARGUMENT
              && (strstr(gs4_last_error(sim), "volume_each")
                  || strstr(gs4_last_error(sim), "particle")));
    }
    ERR_REFUSED(sim, gs4_add_points(sim, good, -1, volume, &f), GS4_ERROR_ARGUMENT, "count");
    ERR_REFUSED(sim, gs4_add_points(sim, good, INT_MIN, volume, &f), GS4_ERROR_ARGUMENT, "count");
    ERR_REFUSED(sim, gs4_add_points(sim, NULL, 2, volume, &f), GS4_ERROR_ARGUMENT, "xyz");
    ERR_REFUSED(sim, gs4_add_points(sim, good, 2, volume, NULL), GS4_ERROR_ARGUMENT, "fill");
    CHECK(gs4_add_points(sim, NULL, 0, volume, &f) == 0);
    CHECK(gs4_add_points(sim, good, 2, volume, &f) == 2);
    CHECK(gs4_get_stats(sim).particles == 66);
    CHECK(err_goes_on(sim));
    gs4_destroy(sim);
}

static void test_errors_null(void)
{
    gs4_sim_desc d = err_desc();
    gs4_sim *sim = NULL;
    gs4_material m = err_material();
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_collider c;
    gs4_emitter e;
    const gs4_real x[3] = { (gs4_real)0.5, (gs4_real)0.5, (gs4_real)0.5 };
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    c.shape = e.shape = gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.2);
    CHECK(gs4_create(NULL, &sim) == GS4_ERROR_ARGUMENT && sim == NULL && gs4_last_error(NULL)[0]);
    CHECK(gs4_create(&d, NULL) == GS4_ERROR_ARGUMENT && gs4_last_error(NULL)[0]);
    gs4_destroy(NULL);
    CHECK(gs4_last_error(NULL) != NULL);
    CHECK(gs4_get_desc(NULL).cells[0] == 0);
    CHECK(gs4_state_hash(NULL) == 0);
    CHECK(gs4_add_material(NULL, &m) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_add_particles(NULL, c.shape, &f) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_add_points(NULL, x, 1, (gs4_real)1e-4, &f) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_add_collider(NULL, &c) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_move_collider(NULL, 0, at(0, 0, 0), at(0, 0, 0)) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_add_emitter(NULL, &e) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_move_emitter(NULL, 0, at(0, 0, 0)) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_step(NULL, 1) == GS4_ERROR_ARGUMENT && gs4_advance(NULL, 1) == GS4_ERROR_ARGUMENT);
    CHECK_CLOSE(gs4_stable_dt(NULL), 0, 0);
    CHECK(gs4_particles(NULL, GS4_FIELD_POSITION).data == NULL
          && gs4_particles(NULL, GS4_FIELD_POSITION).count == 0);
    CHECK(gs4_edit_particles(NULL, GS4_FIELD_POSITION).data == NULL);
    CHECK(gs4_particle_ids(NULL) == NULL && gs4_particle_materials(NULL) == NULL);
    CHECK(gs4_get_stats(NULL).particles == 0);
    CHECK(gs4_write_ply(NULL, "x") == GS4_ERROR_ARGUMENT
          && gs4_write_raw(NULL, "x") == GS4_ERROR_ARGUMENT);
    CHECK(gs4_save(NULL, "x") == GS4_ERROR_ARGUMENT && gs4_load(NULL, "x") == GS4_ERROR_ARGUMENT);
    CHECK(gs4_material_preset(NULL, &m) == GS4_ERROR_ARGUMENT
          && gs4_material_preset("water", NULL) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_material_preset("", &m) == GS4_ERROR_ARGUMENT
          && gs4_material_preset("sand", &m) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    /* there is none yet */
    ERR_REFUSED(sim, gs4_add_particles(sim, c.shape, &f), GS4_ERROR_ARGUMENT, "material");
    ERR_REFUSED(sim, gs4_add_material(sim, NULL), GS4_ERROR_ARGUMENT, "material");
    ERR_REFUSED(sim, gs4_add_particles(sim, c.shape, NULL), GS4_ERROR_ARGUMENT, "fill");
    ERR_REFUSED(sim, gs4_add_collider(sim, NULL), GS4_ERROR_ARGUMENT, "collider");
    ERR_REFUSED(sim, gs4_add_emitter(sim, NULL), GS4_ERROR_ARGUMENT, "emitter");
    CHECK(gs4_particles(sim, GS4_FIELD_POSITION).count == 0
          && gs4_edit_particles(sim, GS4_FIELD_POSITION).count == 0);
    CHECK(err_goes_on(sim)); /* an empty scene */
    gs4_add_material(sim, &m);
    CHECK(err_add_block(sim) > 0);
    CHECK(gs4_particles(sim, GS4_FIELD_STRESS).data == NULL
          && gs4_particles(sim, (gs4_field)99).data == NULL);
    CHECK(gs4_edit_particles(sim, GS4_FIELD_MASS).data == NULL
          && gs4_edit_particles(sim, (gs4_field)99).data == NULL);
    gs4_destroy(sim);
}

static void test_errors_half_hooks(void)
{
    gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    gs4_sim *sim = NULL;
    d.allocator.user = &d;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    gs4_destroy(sim);
    d.walls[0] = GS4_WALL_PERIODIC;
    sim = NULL;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT && sim == NULL
          && strstr(gs4_last_error(NULL), "walls"));
    d = err_desc();
    d.integrator = GS4_INTEGRATOR_BACKWARD_EULER;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT && strstr(gs4_last_error(NULL), "integrator"));
    d.scheme = (gs4_scheme)(GS4_SEMI_IMPLICIT + 1);
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT && strstr(gs4_last_error(NULL), "scheme"));
    d = err_desc();
    d.rho_inf = 0;
    d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    d.affine = 1;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT && strstr(gs4_last_error(NULL), "affine"));
    d.integrator = GS4_INTEGRATOR_GS4;
    d.sharp_gradients = 1;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT && strstr(gs4_last_error(NULL), "affine"));
    d.affine = 2;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT
          && strstr(gs4_last_error(NULL), "affine is 2"));
    d.affine = 0;
    d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT
          && strstr(gs4_last_error(NULL), "sharp_gradients"));
    d.integrator = GS4_INTEGRATOR_GS4;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1000;
    ERR_REFUSED(sim, gs4_add_material(sim, &m), GS4_ERROR_ARGUMENT, "sharp_gradients");
    gs4_destroy(sim);
}

static void test_errors_strings(void)
{
    int code;
    for (code = -12; code <= 3; code++)
        CHECK(gs4_result_string(code) && gs4_result_string(code)[0]);
    for (code = GS4_ERROR_ABI; code < 0; code++)
        CHECK(strcmp(gs4_result_string(code), gs4_result_string(code + 1)) != 0);
    CHECK(gs4_result_string(INT_MIN)[0] && gs4_result_string(INT_MAX)[0]);
}

static void err_log(int level, const char *message, void *user)
{
    int *seen = (int *)user;
    if (level >= 0 && level < 3 && message && message[0])
        seen[level]++;
    else
        seen[3]++;
}

/* Every error goes to the log as well. */
static void test_errors_log(void)
{
    gs4_sim_desc d = err_desc();
    gs4_sim *sim;
    int seen[4] = { 0, 0, 0, 0 };
    d.log = err_log;
    d.log_user = seen;
    sim = err_sim_of(&d);
    CHECK(seen[2] == 0);
    gs4_step(sim, -1);
    gs4_add_material(sim, NULL);
    gs4_load(sim, "");
    CHECK(seen[2] == 3 && seen[3] == 0);
    gs4_destroy(sim);
    d.cells[0] = 3;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT && seen[2] == 4);
}

/* A round emitter that begins at a wall is within the grid: not a word. */
static void test_errors_log_of_emitters(void)
{
    gs4_sim_desc d = err_desc();
    const gs4_material m = err_material();
    int seen[4] = { 0, 0, 0, 0 }, a;
    d.log = err_log;
    d.log_user = seen;
    for (a = 0; a < 3; a++) {
        gs4_emitter e;
        gs4_sim *sim;
        memset(&e, 0, sizeof e);
        e.shape = gs4_cylinder(at(a == 0 ? 0.01 : 0.5, a == 1 ? 0.01 : 0.5, a == 2 ? 0.01 : 0.5),
                               at(a == 0 ? 0.3 : 0.5, a == 1 ? 0.3 : 0.5, a == 2 ? 0.3 : 0.5),
                               (gs4_real)0.25);
        e.fill = scene_fill(at(a == 0, a == 1, a == 2));
        CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
        CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
        CHECK(seen[1] == 0 && seen[2] == 0);
        gs4_destroy(sim);
    }
}

static gs4_real err_thickening(gs4_real T, gs4_real rate, void *user)
{
    const double *most = (const double *)user;
    (void)T;
    return (gs4_real)(rate > 0 ? *most : 0.1);
}

/* A step that gs4_advance takes a second time, shorter, is no error; one that it gives up is one,
 * not eight. */
static void test_errors_log_of_retries(void)
{
    double most = 1e6;
    gs4_material m = err_material();
    gs4_sim_desc d = err_desc();
    const gs4_fill f = scene_fill(at(0, -0.1, 0));
    gs4_sim *sim;
    int seen[4] = { 0, 0, 0, 0 };
    d.log = err_log;
    d.log_user = seen;
    d.gravity = at(0, -10, 0);
    m.viscosity_law = GS4_VISCOSITY_CALLBACK;
    m.viscosity_fn = err_thickening;
    m.viscosity_user = &most;
    CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.25, 0, 0.25), at(0.5, 0.25, 0.5)), &f) > 0);
    gs4_set_gravity(sim, at(INFINITY, 0, 0));
    CHECK(seen[2] == 1);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.001), GS4_OK);
    CHECK(seen[2] == 1 && strstr(gs4_last_error(sim), "gravity"));
    most = -1;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.001), GS4_ERROR_UNSTABLE);
    CHECK(seen[2] == 2 && strstr(gs4_last_error(sim), "viscosity"));
    gs4_destroy(sim);
}

/* --- shapes ----------------------------------------------------------------------------------- */

static gs4_real err_bad_sdf(gs4_vec3 p, void *user)
{
    (void)p;
    return (gs4_real) * (const double *)user;
}

static void err_shape_refused(gs4_sim *sim, gs4_shape shape, int as_collider)
{
    const gs4_fill f = scene_fill(at(0, 0, -0.1));
    gs4_collider c;
    gs4_emitter e;
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    c.shape = e.shape = shape;
    e.fill = f;
    ERR_REFUSED(sim, gs4_add_particles(sim, shape, &f), GS4_ERROR_ARGUMENT, "shape");
    ERR_REFUSED(sim, gs4_add_emitter(sim, &e), GS4_ERROR_ARGUMENT, "shape");
    if (as_collider) ERR_REFUSED(sim, gs4_add_collider(sim, &c), GS4_ERROR_ARGUMENT, "shape");
}

static void test_errors_shapes(void)
{
    gs4_sim *sim = err_scene();
    const gs4_vec3 p = at(0.5, 0.5, 0.5);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    double nan = ERR_NAN;
    gs4_shape none;
    memset(&none, 0, sizeof none);
    err_shape_refused(sim, none, 1);
    err_shape_refused(sim, gs4_box(p, p), 1); /* degenerate */
    err_shape_refused(sim, gs4_box(at(0.6, 0.6, 0.6), at(0.9, 0.9, 0.6)), 1);
    err_shape_refused(sim, gs4_box(at(0.9, 0.9, 0.9), at(0.6, 0.6, 0.6)), 1); /* inside out */
    err_shape_refused(sim, gs4_sphere(p, 0), 1);
    err_shape_refused(sim, gs4_sphere(p, -1), 1);
    err_shape_refused(sim, gs4_cylinder(p, p, (gs4_real)0.1), 1);
    err_shape_refused(sim, gs4_cylinder(p, at(0.6, 0.6, 0.6), 0), 1);
    err_shape_refused(sim, gs4_cylinder(p, at(0.6, 0.6, 0.6), -1), 1);
    err_shape_refused(sim, gs4_plane(p, at(0, 0, 0)), 1);
    err_shape_refused(sim, gs4_sdf(NULL, NULL, at(0, 0, 0), at(1, 1, 1)), 1);
    /* outside of the grid */
    err_shape_refused(sim, gs4_box(at(2, 2, 2), at(3, 3, 3)), 0);
    err_shape_refused(sim, gs4_box(at(-3, 0, 0), at(0, 1, 1)), 0);
    err_shape_refused(sim, gs4_sphere(at(0.5, 0.5, -1), (gs4_real)0.9), 0);
    err_shape_refused(sim, gs4_cylinder(at(0, 0, 5), at(1, 1, 5), (gs4_real)0.5), 0);
    err_shape_refused(sim, gs4_sdf(err_bad_sdf, &nan, at(2, 2, 2), at(3, 3, 3)), 0);
    /* nothing of it in the grid */
    ERR_REFUSED(sim, gs4_add_particles(sim, gs4_plane(at(0, 0, -1), at(0, 0, 1)), &f),
                GS4_ERROR_ARGUMENT, "shape");
    /* thinner than the spacing */
    ERR_REFUSED(sim, gs4_add_particles(sim, gs4_sphere(p, (gs4_real)1e-3), &f), GS4_ERROR_ARGUMENT,
                "shape");
    ERR_REFUSED(sim,
                gs4_add_particles(sim, gs4_sdf(err_bad_sdf, &nan, at(0, 0, 0), at(1, 1, 1)), &f),
                GS4_ERROR_ARGUMENT, "shape");
    ERR_REFUSED(sim, gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f),
                GS4_ERROR_ARGUMENT, "overlaps");
    ERR_REFUSED(
        sim, gs4_add_particles(sim, gs4_box(at(0.125, 0.125, 0.125), at(0.375, 0.375, 0.375)), &f),
        GS4_ERROR_ARGUMENT, "overlaps");
    CHECK(gs4_get_stats(sim).particles == 64);
    /* beside it */
    CHECK(gs4_add_particles(sim, gs4_box(at(0.375, 0.125, 0.125), at(0.625, 0.375, 0.375)), &f)
          == 64);
    CHECK(err_goes_on(sim));
    gs4_destroy(sim);
}

/* Distance to z = 0.25, with another value below it, or above it at every nth call. */
typedef struct err_floor {
    double below, now_and_then;
    int calls, every;
} err_floor;

static gs4_real err_turning_floor(gs4_vec3 p, void *user)
{
    err_floor *floor = (err_floor *)user;
    if (p.z < (gs4_real)0.25) return (gs4_real)floor->below;
    if (floor->every && ++floor->calls % floor->every == 0) return (gs4_real)floor->now_and_then;
    return p.z - (gs4_real)0.25;
}

/* A block falls on such a floor: a step that saw a distance that is not finite is refused; no
 * particle is lost or made, all stays finite, and the floor holds again where it is mended. */
static void err_fall_on(err_floor *floor, gs4_wall contact, int mended)
{
    gs4_sim *sim = err_sim();
    gs4_collider c;
    const gs4_fill f = scene_fill(at(0, 0, -0.5));
    int n, i, r = GS4_OK;
    memset(&c, 0, sizeof c);
    c.contact = contact;
    c.shape = gs4_sdf(err_turning_floor, floor, at(0, 0, 0), at(1, 1, 0.25));
    n = gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.75, 0.75)), &f);
    CHECK_RESULT(sim, gs4_add_collider(sim, &c), 0);
    for (i = 0; i < 12 && r == GS4_OK; i++) {
        r = gs4_step(sim, (gs4_real)0.5 * gs4_stable_dt(sim));
        CHECK(physics_is_finite(sim));
    }
    CHECK(gs4_get_stats(sim).particles == n);
    if (mended) {
        CHECK(r == GS4_ERROR_ARGUMENT && strstr(gs4_last_error(sim), "distance function"));
        floor->below = -0.01;
        floor->every = 0;
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
    }
    gs4_destroy(sim);
}

static void test_errors_sdf(void)
{
    const double values[] = { ERR_NAN, ERR_INFINITY, -ERR_INFINITY, -1e30, 1e30 };
    int v, contact, every;
    for (v = 0; v < 5; v++) {
        gs4_sim *sim = err_sim();
        double value = values[v];
        const gs4_fill f = scene_fill(at(0, 0, -0.1));
        gs4_emitter e;
        for (contact = 0; contact < 3; contact++)
            for (every = 0; every < 8; every++) {
                err_floor floor = { 0, 0, 0, 0 };
                floor.below = every ? -0.01 : value;
                floor.now_and_then = value;
                floor.every = every ? 7 * every * every * every : 0;
                err_fall_on(&floor, (gs4_wall)contact, v < 3 && every < 3);
            }
        memset(&e, 0, sizeof e);
        e.fill = f;
        e.shape = gs4_sdf(err_bad_sdf, &value, at(0.3, 0.3, 0.3), at(0.6, 0.6, 0.6));
        if (v != 3)
            ERR_REFUSED(sim, gs4_add_particles(sim, e.shape, &f), GS4_ERROR_ARGUMENT,
                        v < 3 ? "distance function" : "no particle");
        if (v < 3)
            ERR_REFUSED(sim, gs4_add_emitter(sim, &e), GS4_ERROR_ARGUMENT, "distance function");
        if (v == 4) ERR_REFUSED(sim, gs4_add_emitter(sim, &e), GS4_ERROR_ARGUMENT, "inside out");
        value = -1; /* good when it is added, bad later */
        if (v < 3) {
            CHECK(gs4_add_emitter(sim, &e) >= 0);
            value = values[v];
            ERR_REFUSED(sim, gs4_step(sim, (gs4_real)1e-4), GS4_ERROR_ARGUMENT,
                        "distance function");
        }
        gs4_destroy(sim);
    }
}

/* --- meshes ----------------------------------------------------------------------------------- */

static const int err_cube_triangles[36] = { 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                            2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5 };

static void err_cube_vertices(gs4_real v[24], double low, double high)
{
    int i, a;
    for (i = 0; i < 8; i++)
        for (a = 0; a < 3; a++) v[3 * i + a] = (gs4_real)(i >> a & 1 ? high : low);
}

static void test_errors_mesh(void)
{
    gs4_sim *sim = err_scene();
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_collider c;
    gs4_real v[24], flat[12] = { 0, 0, (gs4_real)0.7, 1, 0, (gs4_real)0.7,
                                 1, 1, (gs4_real)0.7, 0, 1, (gs4_real)0.7 };
    static const int flat_triangles[12] = { 0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2 };
    int t[39], i;
    memset(&c, 0, sizeof c);
    err_cube_vertices(v, 0.5, 0.875);
    err_shape_refused(sim, gs4_mesh(NULL, 8, err_cube_triangles, 12), 1);
    err_shape_refused(sim, gs4_mesh(v, 8, NULL, 12), 1);
    err_shape_refused(sim, gs4_mesh(v, 0, err_cube_triangles, 12), 1);
    err_shape_refused(sim, gs4_mesh(v, -8, err_cube_triangles, 12), 1);
    err_shape_refused(sim, gs4_mesh(v, INT_MIN, err_cube_triangles, 12), 1);
    err_shape_refused(sim, gs4_mesh(v, 8, err_cube_triangles, 0), 1);
    err_shape_refused(sim, gs4_mesh(v, 8, err_cube_triangles, -1), 1);
    err_shape_refused(sim, gs4_mesh(v, 8, err_cube_triangles, INT_MIN), 1);
    /* index 7 is out of range now */
    err_shape_refused(sim, gs4_mesh(v, 7, err_cube_triangles, 12), 1);
    err_shape_refused(sim, gs4_mesh(v, 8, err_cube_triangles, 11), 1); /* open */
    /* closed, but flat */
    err_shape_refused(sim, gs4_mesh(flat, 4, flat_triangles, 4), 1);
    /* a vertex that is no number */
    for (i = 0; i < 24; i += 5) {
        const gs4_real keep = v[i];
        v[i] = (gs4_real)ERR_NAN;
        err_shape_refused(sim, gs4_mesh(v, 8, err_cube_triangles, 12), 1);
        v[i] = (gs4_real)ERR_INFINITY;
        err_shape_refused(sim, gs4_mesh(v, 8, err_cube_triangles, 12), 1);
        v[i] = keep;
    }
    /* an index that there is not */
    for (i = 0; i < 36; i += 7) {
        static const int wrong[] = { -1, 8, INT_MAX, INT_MIN };
        int w;
        for (w = 0; w < 4; w++) {
            memcpy(t, err_cube_triangles, sizeof err_cube_triangles);
            t[i] = wrong[w];
            err_shape_refused(sim, gs4_mesh(v, 8, t, 12), 1);
        }
    }
    for (i = 0; i < 12; i++) { /* inside out */
        t[3 * i] = err_cube_triangles[3 * i];
        t[3 * i + 1] = err_cube_triangles[3 * i + 2];
        t[3 * i + 2] = err_cube_triangles[3 * i + 1];
    }
    err_shape_refused(sim, gs4_mesh(v, 8, t, 12), 1);
    CHECK(strstr(gs4_last_error(sim), "inside out") != NULL);
    /* one triangle twice */
    memcpy(t, err_cube_triangles, sizeof err_cube_triangles);
    memcpy(t + 36, err_cube_triangles, 3 * sizeof *t);
    err_shape_refused(sim, gs4_mesh(v, 8, t, 13), 1);
    /* one triangle turned */
    memcpy(t, err_cube_triangles, sizeof err_cube_triangles);
    t[0] = err_cube_triangles[1];
    t[1] = err_cube_triangles[0];
    err_shape_refused(sim, gs4_mesh(v, 8, t, 12), 1);
    CHECK(gs4_get_stats(sim).particles == 64);
    CHECK(gs4_add_particles(sim, gs4_mesh(v, 8, err_cube_triangles, 12), &f) == 216);
    err_cube_vertices(v, 0.0, 0.12);
    c.shape = gs4_mesh(v, 8, err_cube_triangles, 12);
    CHECK_RESULT(sim, gs4_add_collider(sim, &c), 0);
    CHECK(err_goes_on(sim));
    gs4_destroy(sim);
}

/* A mesh far larger than the grid must not cost more than the grid. */
static void test_errors_large_mesh(void)
{
    gs4_sim *sim = err_sim();
    gs4_collider c;
    gs4_real v[24];
    memset(&c, 0, sizeof c);
    err_cube_vertices(v, -20, 0.1);
    c.shape = gs4_mesh(v, 8, err_cube_triangles, 12);
    if (gs4_add_collider(sim, &c) >= 0) CHECK(gs4_get_stats(sim).memory_bytes < 16000000);
    gs4_destroy(sim);
}

/* --- edits ------------------------------------------------------------------------------------ */

static void test_errors_edit(void)
{
    const double wrong[] = { ERR_NAN, ERR_INFINITY, -ERR_INFINITY, 1e30, -1e30, 5, -5 };
    int field, v, c, euler;
    for (euler = 0; euler < 2; euler++)
        for (field = 0; field < 2; field++)
            for (v = 0; v < 7; v++)
                for (c = 0; c < 3; c++) {
                    gs4_sim_desc d = err_desc();
                    gs4_sim *sim;
                    gs4_edit e;
                    gs4_real keep;
                    uint64_t h;
                    if (euler) {
                        d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
                        d.rho_inf = 0;
                    }
                    sim = err_sim_of(&d);
                    err_add_block(sim);
                    /* fast is not wrong */
                    if ((field && v > 2) || (sizeof(gs4_real) == 8 && v > 2 && field)) {
                        gs4_destroy(sim);
                        continue;
                    }
                    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
                    e = gs4_edit_particles(sim, field ? GS4_FIELD_VELOCITY : GS4_FIELD_POSITION);
                    CHECK(e.count == 64 && e.components == 3);
                    keep = e.data[7 * e.stride + c];
                    e.data[7 * e.stride + c] = (gs4_real)wrong[v];
                    h = gs4_state_hash(sim);
                    CHECK(gs4_stable_dt(sim) >= 0);
                    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), GS4_ERROR_ARGUMENT);
                    CHECK(strstr(gs4_last_error(sim), "edit") != NULL);
                    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), GS4_ERROR_ARGUMENT);
                    CHECK(gs4_state_hash(sim) == h);
                    e = gs4_edit_particles(sim, field ? GS4_FIELD_VELOCITY : GS4_FIELD_POSITION);
                    e.data[7 * e.stride + c] = keep;
                    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
                    CHECK(physics_is_finite(sim) && gs4_get_stats(sim).particles == 64);
                    gs4_destroy(sim);
                }
}

/* A slip of the hand, refused and repaired, leaves no trace: not in the sound speed either,
 * which follows speeds, and not by asking for the stable step in between. */
static void test_errors_edit_repaired(void)
{
    gs4_sim_desc d = err_desc();
    gs4_material m = scene_liquid(1000, 0, 0);
    gs4_sim *sim = NULL;
    gs4_edit e;
    gs4_real before;
    gs4_create(&d, &sim);
    gs4_add_material(sim, &m);
    err_add_block(sim);
    before = gs4_stable_dt(sim);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    e.data[0] = (gs4_real)1e12;
    CHECK(gs4_stable_dt(sim) < before / 1000);
    e.data[e.stride] = (gs4_real)ERR_NAN;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-6), GS4_ERROR_ARGUMENT);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    e.data[0] = e.data[e.stride] = 0;
    CHECK_CLOSE(gs4_stable_dt(sim), before, 1e-6 * (double)before);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
    gs4_destroy(sim);
}

/* A position that is no number must not get anywhere by another way. */
/* The limit knows the speeds that an edit has brought, and what they do to a default speed of
 * sound. */
static void test_errors_limit_after_edit(void)
{
    gs4_sim_desc d = scene_cube(8);
    const gs4_material m = scene_liquid(1000, 0.001, 0);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim;
    gs4_edit e;
    int i;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.75, 0.75)), &f) > 0);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < e.count; i++) e.data[(size_t)i * (size_t)e.stride] = 1;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.9 * gs4_stable_dt(sim)), GS4_OK);
    CHECK(gs4_edit_particles(sim, GS4_FIELD_MASS).data == NULL
          && strstr(gs4_last_error(sim), "can be edited"));
    gs4_destroy(sim);
}

static void test_errors_preset(void)
{
    gs4_material m;
    CHECK(gs4_material_preset("Honey", &m) == GS4_ERROR_ARGUMENT
          && strstr(gs4_last_error(NULL), "honey"));
    CHECK(gs4_material_preset(NULL, &m) == GS4_ERROR_ARGUMENT
          && strstr(gs4_last_error(NULL), "needs a name"));
}

static void test_errors_edit_then_add(void)
{
    const double wrong[] = { ERR_NAN, ERR_INFINITY, -1e30 };
    const gs4_fill f = scene_fill(at(0, 0, 0));
    int v;
    for (v = 0; v < 3; v++) {
        gs4_sim *sim = err_scene();
        gs4_edit e = gs4_edit_particles(sim, GS4_FIELD_POSITION);
        int r;
        e.data[1] = (gs4_real)wrong[v];
        r = gs4_add_particles(sim, gs4_box(at(0.5, 0.5, 0.5), at(0.75, 0.75, 0.75)), &f);
        CHECK(r == GS4_ERROR_ARGUMENT);
        CHECK_RESULT(sim, gs4_write_ply(sim, "edit.ply"), GS4_ERROR_ARGUMENT);
        CHECK_RESULT(sim, gs4_write_raw(sim, "edit.npy"), GS4_ERROR_ARGUMENT);
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), GS4_ERROR_ARGUMENT);
        gs4_destroy(sim);
    }
}

/* A material that asks for more than the scene can have leaves nothing of itself behind: here
 * everything a particle can carry. */
static void test_errors_material_all_or_nothing(void)
{
    gs4_sim *sim = err_scene();
    gs4_material m = err_material();
    const uint64_t before = gs4_get_stats(sim).memory_bytes;
    m.liquid = GS4_OLDROYD_B;
    m.relaxation_time = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 100;
    m.can_melt = 1;
    m.heat_capacity = 1000;
    m.conductivity = 1;
    m.flux_relaxation_time = 1;
    ERR_REFUSED(sim, gs4_add_material(sim, &m), GS4_ERROR_ARGUMENT, "heat_capacity of material 0");
    CHECK(gs4_particles(sim, GS4_FIELD_STRESS).data == NULL
          && gs4_particles(sim, GS4_FIELD_DEFORMATION).data == NULL
          && gs4_particles(sim, GS4_FIELD_TEMPERATURE).data == NULL);
    CHECK(gs4_get_stats(sim).memory_bytes == before);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
    gs4_destroy(sim);
}

/* --- one point -------------------------------------------------------------------------------- */

static gs4_real err_viscosity_of_heat(gs4_real temperature, gs4_real rate, void *user)
{
    (void)rate;
    (void)user;
    return (gs4_real)((double)temperature > 100 ? ERR_NAN : (double)temperature > 50 ? -1 : 0.5);
}

/* Stress of a point at a temperature for which its material has no viscosity: said, never given.
 * And a material that can melt goes by temperature. */
static void test_errors_point(void)
{
    static const struct {
        double T;
        int r;
    } at_T[6] = { { 20, 0 }, { 60, -1 }, { 101, -1 }, { 48.4, -1 }, { 48.3, -1 }, { 100, 0 } };
    const gs4_real shear[9] = { 0, 1, 0, 0, 0, 0, 0, 0, 0 };
    gs4_real sigma[6];
    gs4_point p;
    gs4_material m;
    int i, elastic;
    for (i = 0; i < 6; i++)
        for (elastic = 0; elastic < 2; elastic++) {
            m = err_material();
            m.heat_capacity = 1;
            m.conductivity = 1;
            if (i < 3) {
                m.viscosity_law = GS4_VISCOSITY_CALLBACK;
                m.viscosity_fn = err_viscosity_of_heat;
            } else
                m.viscosity_law = GS4_VISCOSITY_CROSS_WLF;
            if (elastic) {
                m.liquid = GS4_OLDROYD_B;
                m.relaxation_time = 1;
            }
            memset(&p, 0, sizeof p);
            memset(sigma, 0, sizeof sigma);
            p.temperature = (gs4_real)at_T[i].T;
            CHECK_RESULT(NULL, gs4_point_stress(&m, &p, shear, sigma), at_T[i].r);
            if (at_T[i].r)
                CHECK(strstr(gs4_last_error(NULL), "viscosity") != NULL && (double)sigma[3] == 0);
            CHECK_RESULT(NULL, gs4_point_step(&m, &p, shear, (gs4_real)0.01, 0, 0), at_T[i].r);
            if (at_T[i].r)
                CHECK(strstr(gs4_last_error(NULL), "viscosity") != NULL
                      && (double)p.stress[3] == 0);
        }
    /* below, at and above T_m: solid, solid, liquid */
    for (i = 0; i < 3; i++) {
        const double turned = i < 2 ? 100 * 0.01 : 0.1;
        m = err_material();
        m.heat_capacity = 1;
        m.can_melt = 1;
        m.melting_temperature = 7;
        m.latent_heat = 3;
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = 100;
        memset(&p, 0, sizeof p);
        p.temperature = (gs4_real)(6 + i);
        CHECK_RESULT(NULL, gs4_point_step(&m, &p, shear, (gs4_real)0.01, 0, 0), 0);
        CHECK_RESULT(NULL, gs4_point_stress(&m, &p, shear, sigma), 0);
        CHECK_CLOSE(sigma[3], turned, 1e-3 * turned);
        CHECK_CLOSE(p.deformation[1], i < 2 ? 0.01 : 0, 1e-6);
    }
}

/* --- steps ------------------------------------------------------------------------------------ */

typedef struct err_law {
    int calls;
    gs4_real value;
} err_law;

static gs4_real err_viscosity(gs4_real temperature, gs4_real rate, void *user)
{
    err_law *law = (err_law *)user;
    (void)temperature;
    (void)rate;
    law->calls++;
    return law->value;
}

/* A drop on its way to a wall. With open walls it is fast and leaves the blocks behind it empty. */
static gs4_sim *err_moving(int euler, gs4_wall walls, err_law *law)
{
    gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    gs4_fill f = scene_fill(walls == GS4_WALL_OPEN ? at(-20, 0.3, -1) : at(1, 0.3, -1));
    gs4_sim *sim = NULL;
    int w;
    if (euler) {
        d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
        d.rho_inf = 0;
    }
    for (w = 0; w < 6; w++) d.walls[w] = walls;
    if (walls == GS4_WALL_OPEN) d.cells[0] = 24;
    if (law) {
        m.viscosity_law = GS4_VISCOSITY_CALLBACK;
        m.viscosity_fn = err_viscosity;
        m.viscosity_user = law;
    }
    gs4_create(&d, &sim);
    CHECK(gs4_add_material(sim, &m) == 0);
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.4), (gs4_real)0.35), &f) > 0);
    if (walls == GS4_WALL_OPEN)
        CHECK(gs4_add_particles(sim, gs4_sphere(at(2, 0.5, 0.4), (gs4_real)0.35), &f) > 0);
    return sim;
}

static void test_errors_refused_step(void)
{
    int euler, i;
    for (euler = 0; euler < 2; euler++) {
        gs4_sim *sim = err_moving(euler, GS4_WALL_SLIP, NULL);
        for (i = 0; i < 30; i++) {
            const gs4_real limit = gs4_stable_dt(sim);
            ERR_REFUSED(sim, gs4_step(sim, (gs4_real)1.5 * limit), GS4_ERROR_UNSTABLE, "dt");
            ERR_REFUSED(sim, gs4_step(sim, (gs4_real)1e6 * limit), GS4_ERROR_UNSTABLE, "dt");
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.7 * limit), 0);
        }
        CHECK(physics_is_finite(sim));
        gs4_destroy(sim);
    }
}

/* A viscosity that is no viscosity is found in the midst of a step, after sorting: the state is
 * as before, also where particles have just left through open walls. */
static void test_errors_viscosity_callback(void)
{
    const double wrong[] = { ERR_NAN, -1, ERR_INFINITY, -ERR_INFINITY, 1e30 };
    int euler, walls, v, i;
    for (euler = 0; euler < 2; euler++)
        for (walls = 0; walls < 2; walls++) {
            err_law law = { 0, 0 };
            gs4_sim *sim = err_moving(euler, walls ? GS4_WALL_OPEN : GS4_WALL_SLIP, &law);
            for (i = 0; i < 40; i++) {
                gs4_real dt;
                law.value = (gs4_real)0.1;
                dt = (gs4_real)0.5 * gs4_stable_dt(sim);
                if (gs4_get_stats(sim).particles == 0) break;
                for (v = 0; v < 5; v++) {
                    const int calls = law.calls;
                    law.value = (gs4_real)wrong[v];
                    ERR_REFUSED(sim, gs4_step(sim, dt), GS4_ERROR_UNSTABLE, "");
                    CHECK(gs4_last_error(sim)[0] && law.calls > calls);
                }
                law.value = (gs4_real)0.1;
                CHECK_RESULT(sim, gs4_step(sim, dt), 0);
                CHECK(physics_is_finite(sim));
            }
            law.value = (gs4_real)ERR_NAN;
            if (gs4_get_stats(sim).particles)
                CHECK(gs4_advance(sim, (gs4_real)0.01) == GS4_ERROR_UNSTABLE);
            CHECK(gs4_stable_dt(sim) > 0);
            gs4_destroy(sim);
        }
}

/* Nothing may seem to hang: a code, within a second. */
/* A viscosity of 0.1 Pa s that turns bad above a shear rate, or from one call on. */
typedef struct err_turn {
    double edge, bad;
    int calls, last_good;
} err_turn;

static gs4_real err_turning_viscosity(gs4_real temperature, gs4_real rate, void *user)
{
    err_turn *turn = (err_turn *)user;
    (void)temperature;
    return (gs4_real)((double)rate > turn->edge || turn->calls++ >= turn->last_good ? turn->bad
                                                                                    : 0.1);
}

/* A few drops that a step of half the limit moves towards the floor */
static gs4_sim *err_turning(int euler, int liquid, double local_fraction, err_turn *turn)
{
    gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    const gs4_fill f = scene_fill(at(0, 0, -6));
    gs4_sim *sim = NULL;
    if (euler) {
        d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
        d.rho_inf = 0;
    }
    m.viscosity_law = GS4_VISCOSITY_CALLBACK;
    m.viscosity_fn = err_turning_viscosity;
    m.viscosity_user = turn;
    m.liquid = (gs4_liquid)liquid;
    if (liquid) m.relaxation_time = (gs4_real)0.02;
    if (liquid) m.local_fraction = (gs4_real)local_fraction;
    if (liquid == GS4_POM_POM) {
        m.stretch_time = (gs4_real)0.01;
        m.arms = 4;
        m.anisotropy = (gs4_real)0.1;
    }
    gs4_create(&d, &sim);
    CHECK(gs4_add_material(sim, &m) == 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.4, 0.4, 0.07), at(0.6, 0.6, 0.26)), &f) > 0);
    return sim;
}

/* Until it is refused: a step that is taken leaves numbers. Returns the steps. */
static int err_turns(int euler, int liquid, double local_fraction, err_turn *turn)
{
    gs4_sim *sim = err_turning(euler, liquid, local_fraction, turn);
    int step, r = GS4_OK;
    for (step = 0; step < 60 && r == GS4_OK; step++) {
        const gs4_real limit = gs4_stable_dt(sim);
        r = gs4_step(sim, limit > 0 ? limit / 2 : (gs4_real)1e-6);
        CHECK(physics_is_finite(sim));
    }
    /* steps that are short enough for 1e17 Pa s are right */
    CHECK(r == GS4_ERROR_UNSTABLE || (r == GS4_OK && turn->bad == 1e17));
    gs4_destroy(sim);
    return step;
}

/* A viscosity that turns bad wherever it is asked for in a step. */
static void test_errors_viscosity_that_turns(void)
{
    const double wrong[] = { ERR_NAN, ERR_INFINITY, -1, 1e17 };
    int euler, liquid, whole, v;
    for (euler = 0; euler < 2; euler++)
        for (liquid = 0; liquid < 3; liquid++)
            for (whole = 0; whole < 2; whole++)
                for (v = 0; v < 4; v++) {
                    err_turn turn = { 1, 0, 0, INT_MAX };
                    int edges, first, last_good = 0;
                    turn.bad = wrong[v];
                    for (edges = 0; edges < 4; edges++, turn.edge *= 2)
                        err_turns(euler, liquid, whole ? 0 : 0.5, &turn);
                    turn.edge = 1e30;
                    first = 1;
                    while (last_good < 400 && first < 4) {
                        turn.last_good = last_good;
                        turn.calls = 0;
                        first = err_turns(euler, liquid, whole ? 0 : 0.5, &turn);
                        last_good += test_full ? 3 : 23;
                    }
                }
}

/* Work until a step is refused, of a Pom-Pom that takes too much. */
static uint64_t err_fast_pom_pom(double size, int *particles)
{
    gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim = NULL;
    gs4_edit e;
    uint64_t work;
    int i;
    d.cells[0] = d.cells[1] = d.cells[2] = 16;
    d.cell_size = (gs4_real)(1.0 / 16);
    m.liquid = GS4_POM_POM;
    m.viscosity = (gs4_real)0.01;
    m.relaxation_time = (gs4_real)1e-3;
    m.stretch_time = (gs4_real)1e-9;
    m.anisotropy = 50;
    m.arms = 2;
    gs4_create(&d, &sim);
    CHECK(gs4_add_material(sim, &m) == 0);
    *particles = gs4_add_particles(
        sim, gs4_box(at(0.25, 0.25, 0.25), at(0.25 + size, 0.25 + size, 0.25 + size)), &f);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < e.count; i++) {
        e.data[i * e.stride] = (gs4_real)(3 * (i * 7 % 5 - 2));
    }
    ERR_REFUSED(sim, gs4_step(sim, gs4_stable_dt(sim) / 2), GS4_ERROR_UNSTABLE,
                "takes more than 30 times the work");
    work = gs4i_all_reports(sim).work;
    gs4_destroy(sim);
    return work;
}

/* Anisotropy far above 1 and a stretch that relaxes a million times faster: the split gave up after
 * 20000 substeps of one particle, 63 ms. What is refused says so early, for all of its block. */
static void test_errors_fast_pom_pom(void)
{
    int few, many;
    const uint64_t one = err_fast_pom_pom(0.0625, &few), all = err_fast_pom_pom(0.25, &many);
    if (test_filter[0])
        printf("%d particles %lu, %d %lu\n", few, (unsigned long)one, many, (unsigned long)all);
    CHECK(few == 8 && many == 512);
    /* each of eight blocks may be over by a batch whose particles take all they may */
    CHECK(one > 500 && one < 8000);
    CHECK(all < GS4I_MEAN_WORK * 512 + 8 * (GS4I_SPARE_WORK + GS4I_BATCH * GS4I_WORK));
}

static void test_errors_no_end(void)
{
    static const struct {
        double h, mu, c, v, g, duration, max_dt, cfl;
    } hard[] = { { 0.125, 1e6, 10, 0, 10, 1e6, 0, 0 },  { 1e-6, 0.1, 10, 0, 10, 1e6, 0, 0 },
                 { 0.125, 0.1, 1e4, 0, 10, 1e6, 0, 0 }, { 1e-6, 1e6, 1e4, 0, 10, 1, 0, 0 },
                 { 0.125, 0, 1e4, 1e8, 0, 1e6, 0, 0 },  { 0.125, 0, 10, 1e17, 0, 1, 0, 0 },
                 { 0.125, 0, 10, 0, 10, 1, 1e-12, 0 },  { 0.125, 0, 10, 0, 10, 1, 0, 1e-12 },
                 { 0.125, 0, 10, 0, 1e17, 1e-3, 0, 0 }, { 0.125, 0, 0, 0, 1e17, 1, 0, 0 },
                 { 1e-9, 1e6, 1e6, 0, 10, 1e-3, 0, 0 }, { 0.125, 0, 1e-9, 1, 10, 1, 0, 0 } };
    int i, euler;
    for (euler = 0; euler < 2; euler++)
        for (i = 0; i < ERR_COUNT(hard); i++) {
            gs4_sim_desc d = err_desc();
            gs4_material m = scene_liquid(1000, hard[i].mu, hard[i].c);
            const gs4_fill f = scene_fill(at(hard[i].v, 0, 0));
            const double h = hard[i].h;
            const clock_t start = clock();
            gs4_sim *sim = NULL;
            int r;
            if (euler) {
                d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
                d.rho_inf = 0;
            }
            d.cell_size = (gs4_real)h;
            d.gravity = at(0, 0, -hard[i].g);
            d.max_dt = (gs4_real)hard[i].max_dt;
            d.cfl = (gs4_real)hard[i].cfl;
            CHECK(gs4_create(&d, &sim) == GS4_OK);
            CHECK(gs4_add_material(sim, &m) == 0);
            if (gs4_add_particles(sim, gs4_box(at(h, h, h), at(3 * h, 3 * h, 3 * h)), &f) > 0) {
                r = gs4_advance(sim, (gs4_real)hard[i].duration);
                err_report(r == GS4_OK ? i == ERR_COUNT(hard) - 1 : gs4_last_error(sim)[0] != 0,
                           "hard", "scene", i, r, gs4_last_error(sim));
                CHECK(physics_is_finite(sim));
                CHECK((double)(clock() - start) / CLOCKS_PER_SEC
                      < (i == ERR_COUNT(hard) - 1 ? 10 : 1));
            }
            gs4_destroy(sim);
        }
}

/* A fall of exactly this long, or a refusal by name that changes nothing. */
static int err_fall_for(gs4_real duration, int is_step)
{
    gs4_sim *sim = err_scene();
    const uint64_t hash = gs4_state_hash(sim);
    const int result = is_step ? gs4_step(sim, duration) : gs4_advance(sim, duration);
    const gs4_view v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    int i;
    for (i = 0; i < v.count && result == GS4_OK; i++)
        CHECK_CLOSE((double)v.data[(size_t)i * (size_t)v.stride + 2] / (double)duration, -10, 0.01);
    if (result != GS4_OK) {
        CHECK(result == GS4_ERROR_ARGUMENT && gs4_state_hash(sim) == hash);
        CHECK(strstr(gs4_last_error(sim), is_step ? "dt is" : "duration is"));
    }
    gs4_destroy(sim);
    return result;
}

/* Durations down to the least number there is, alike where the processor takes denormal numbers
 * for 0 and flushes results to it. */
static void test_errors_short_durations(void)
{
    double t = sizeof(gs4_real) == 8 ? 5e-324 : 1.5e-45;
    for (; t < 1e-3; t *= sizeof(gs4_real) == 8 ? 1e5 : 9.7) {
        const gs4_real duration = (gs4_real)t;
        int is_step;
        for (is_step = 0; is_step < 2; is_step++) {
            const int result = err_fall_for(duration, is_step);
            CHECK((result == GS4_OK) == (t > (sizeof(gs4_real) == 8 ? 1e-100 : 1e-18)));
#ifdef __SSE2__
            {
                const unsigned mode = _mm_getcsr();
                _mm_setcsr(mode | 0x8040);
                CHECK(err_fall_for(duration, is_step) == result);
                _mm_setcsr(mode);
            }
#endif
        }
    }
}

/* gravity 1e5 on a soft liquid: a step either moves nothing by more than two cells or is
 * refused, though all move alike. */
static void test_errors_leaps(void)
{
    enum {
        ERR_LEAPERS = 512
    };
    static double before[3 * ERR_LEAPERS], after[3 * ERR_LEAPERS];
    int euler, i, k;
    for (euler = 0; euler < 2; euler++) {
        gs4_sim_desc d = err_desc();
        const gs4_fill f = scene_fill(at(0, 0, 0));
        double far_cells = 0;
        gs4_sim *sim;
        if (euler) {
            d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
            d.rho_inf = 0;
        }
        d.cells[2] = 64;
        d.gravity = at(0, 0, -1e5);
        sim = err_sim_of(&d);
        CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 6), at(1, 1, 7)), &f) >= ERR_LEAPERS);
        for (i = 0; i < 3; i++) {
            const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
            const uint32_t *id = gs4_particle_ids(sim);
            for (k = 0; k < x.count; k++)
                if (id[k] < ERR_LEAPERS) before[id[k]] = (double)x.data[k * x.stride + 2];
            if (gs4_step(sim, (gs4_real)0.95 * gs4_stable_dt(sim)) != GS4_OK) break;
            {
                const gs4_view y = gs4_particles(sim, GS4_FIELD_POSITION);
                id = gs4_particle_ids(sim);
                for (k = 0; k < y.count; k++)
                    if (id[k] < ERR_LEAPERS) after[id[k]] = (double)y.data[k * y.stride + 2];
            }
            for (k = 0; k < ERR_LEAPERS; k++)
                far_cells = fmax(far_cells, fabs(after[k] - before[k]) / (double)d.cell_size);
        }
        CHECK(far_cells <= 2.01);
        gs4_destroy(sim);
    }
}

/* --- room ------------------------------------------------------------------------------------- */

static void test_errors_max_particles(void)
{
    gs4_sim_desc d = err_desc();
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const gs4_real x[3] = { (gs4_real)0.7, (gs4_real)0.7, (gs4_real)0.7 };
    gs4_emitter e;
    gs4_sim *sim;
    int seen[4] = { 0, 0, 0, 0 }, i;
    d.max_particles = 100;
    d.log = err_log;
    d.log_user = seen;
    sim = err_sim_of(&d);
    ERR_REFUSED(sim, gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 0.5)), &f),
                GS4_ERROR_MEMORY, "max_particles");
    CHECK(gs4_get_stats(sim).particles == 0);
    CHECK(err_add_block(sim) == 64);
    ERR_REFUSED(sim, gs4_add_particles(sim, gs4_box(at(0.5, 0.5, 0.5), at(0.75, 0.75, 0.75)), &f),
                GS4_ERROR_MEMORY, "max_particles");
    memset(&e, 0, sizeof e);
    e.shape = gs4_box(at(0.5, 0.5, 0.5), at(0.75, 0.75, 0.75));
    e.fill = scene_fill(at(0, 0, -0.5));
    CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
    for (i = 0; i < 20; i++) {
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
        CHECK(gs4_get_stats(sim).particles <= 100);
    }
    CHECK(gs4_get_stats(sim).particles == 100 && seen[1] > 0);
    ERR_REFUSED(sim, gs4_add_points(sim, x, 1, (gs4_real)1e-4, &f), GS4_ERROR_MEMORY,
                "max_particles");
    CHECK(physics_is_finite(sim));
    gs4_destroy(sim);
}

/* gs4_stable_dt knows of the particles that an emitter has just made. */
static void test_errors_limit_after_emitting(void)
{
    int euler, i;
    for (euler = 0; euler < 2; euler++) {
        gs4_sim_desc d = err_desc();
        gs4_sim *sim;
        gs4_emitter e;
        if (euler) {
            d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
            d.rho_inf = 0;
        }
        sim = err_sim_of(&d);
        memset(&e, 0, sizeof e);
        e.shape = gs4_sphere(at(0.5, 0.5, 0.7), (gs4_real)0.2);
        e.fill = scene_fill(at(0, 0, -0.001));
        CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
        for (i = 0; i < 10; i++) {
            const gs4_real limit = gs4_stable_dt(sim);
            CHECK_RESULT(
                sim,
                gs4_step(sim, (gs4_real)0.95 * (limit < (gs4_real)0.05 ? limit : (gs4_real)0.05)),
                0);
        }
        CHECK(gs4_get_stats(sim).particles > 0);
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.05), 0);
        gs4_destroy(sim);
    }
}

/* Products of sane numbers that overflow or vanish: refused, never in a view. */
static void test_errors_heavy(void)
{
    static const struct {
        double density, h, c;
    } heavy[] = { { 1e17, 1e8, 0 },
                  { 1e17, 1e9, 1e3 },
                  { 1e17, 1, 1e15 },
                  { 1e-17, 1e-9, 1 },
                  { 1e-10, 1e-6, 1e-10 } };
    int i;
    for (i = 0; i < ERR_COUNT(heavy); i++) {
        gs4_sim_desc d = err_desc();
        gs4_material m = scene_liquid(heavy[i].density, 0, heavy[i].c);
        gs4_sim *sim = NULL;
        d.cell_size = (gs4_real)heavy[i].h;
        CHECK(gs4_create(&d, &sim) == GS4_OK);
        if (gs4_add_material(sim, &m) >= 0 && err_add_block(sim) > 0)
            CHECK(err_goes_on(sim));
        else
            CHECK(gs4_last_error(sim)[0] != 0);
        gs4_destroy(sim);
    }
}

/* Numbers in sentences: six digits, rounded, as %g writes them but for the exponent. */
static void test_errors_numbers(void)
{
    static const struct {
        double value;
        const char *text;
    } number[] = { { 1.5, "1.5" },           { -2.0 / 3, "-0.666667" },
                   { 1e5 + 0.25, "100000" }, { 2345678, "2345680" },
                   { 1e7, "1e7" },           { -0.0001, "-0.0001" },
                   { -3e-5, "-3e-5" },       { 9999999.75, "1e7" },
                   { -12.5, "-12.5" } };
    size_t i;
    for (i = 0; i < sizeof number / sizeof *number; i++) {
        gs4_sim_desc d = err_desc();
        char expected[80] = "cfl is ";
        gs4_sim *sim;
        d.cfl = (gs4_real)number[i].value;
        strcat(strcat(expected, number[i].text), "; it must be a number from 0 to 1");
        CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT);
        CHECK(strcmp(gs4_last_error(NULL), expected) == 0);
    }
    for (i = 0; i < 2; i++) {
        gs4_sim *sim = err_sim();
        CHECK(gs4_move_collider(sim, i ? -12 : 34, at(0, 0, 0), at(0, 0, 0)) == GS4_ERROR_ARGUMENT);
        CHECK(strstr(gs4_last_error(sim), i ? "collider -12 does" : "collider 34 does") != NULL);
        gs4_destroy(sim);
    }
}

/* The hash of a state sees every number of every particle. */
static void test_errors_hash(void)
{
    gs4_sim *sim = err_scene();
    int k, c;
    for (k = 0; k < 2; k++)
        for (c = 0; c < 3; c++) {
            const gs4_edit e = gs4_edit_particles(sim, k ? GS4_FIELD_VELOCITY : GS4_FIELD_POSITION);
            const uint64_t before = gs4_state_hash(sim);
            gs4_real *number = e.data + (size_t)(e.count / 2) * (size_t)e.stride + (size_t)c, old;
            old = *number;
            *number += (gs4_real)0.001;
            CHECK(gs4_state_hash(sim) != before);
            *number = old;
            CHECK(gs4_state_hash(sim) == before);
        }
    gs4_destroy(sim);
}

/* Signed distances of a box and of a cylinder askew, by the distances along and across. */
static void test_errors_distances(void)
{
    const double tiny = sizeof(gs4_real) == 8 ? 1e-14 : 2e-6;
    const double half[3] = { 0.3, 0.2, 0.1 }, e[3] = { 2.0 / 3, -1.0 / 3, 2.0 / 3 },
                 u[3] = { 1.0 / 3, -2.0 / 3, -2.0 / 3 };
    const gs4_shape box = gs4_box(at(-0.3, -0.2, -0.1), at(0.3, 0.2, 0.1)),
                    cylinder = gs4_cylinder(at(0, 0, 0), at(1.5 * e[0], 1.5 * e[1], 1.5 * e[2]),
                                            (gs4_real)0.25);
    gs4_vec3 low, high;
    int i, c;
    for (i = 0; i < 125; i++) {
        const double p[3] = { 0.22 * (i % 5) - 0.4, 0.17 * (i / 5 % 5) - 0.35,
                              0.11 * (i / 25) - 0.2 };
        double outside = 0, inside = -1;
        for (c = 0; c < 3; c++) {
            const double beyond = fabs(p[c]) - half[c];
            outside += beyond > 0 ? beyond * beyond : 0;
            inside = fmax(inside, beyond);
        }
        CHECK_CLOSE(gs4i_shape_distance(&box, at(p[0], p[1], p[2])),
                    inside > 0 ? sqrt(outside) : inside, tiny);
    }
    for (i = 0; i < 49; i++) {
        const double along = 0.4 * (i % 7) - 0.4, across = 0.09 * (i / 7);
        const double cap = fabs(along - 0.75) - 0.75, side = across - 0.25;
        const double expected =
            cap > 0 && side > 0 ? sqrt(cap * cap + side * side) : fmax(cap, side);
        CHECK_CLOSE(gs4i_shape_distance(&cylinder, at(along * e[0] + across * u[0],
                                                      along * e[1] + across * u[1],
                                                      along * e[2] + across * u[2])),
                    expected, tiny);
    }
    for (i = 0; i < 3; i++) { /* a cylinder along an axis has no width beyond its ends */
        const gs4_shape along =
            gs4_cylinder(at(0, 0, 0), at(i == 0, i == 1, i == 2), (gs4_real)0.5);
        gs4i_shape_bounds(&along, &low, &high);
        CHECK(low.x == (gs4_real)(i == 0 ? 0 : -0.5) && high.x == (gs4_real)(i == 0 ? 1 : 0.5));
        CHECK(low.y == (gs4_real)(i == 1 ? 0 : -0.5) && high.y == (gs4_real)(i == 1 ? 1 : 0.5));
        CHECK(low.z == (gs4_real)(i == 2 ? 0 : -0.5) && high.z == (gs4_real)(i == 2 ? 1 : 0.5));
    }
    gs4i_shape_bounds(&cylinder, &low, &high); /* 1.5 e and 0.25 sqrt(1 - e^2) */
    CHECK_CLOSE(low.x, -0.25 * sqrt(5.0) / 3, tiny);
    CHECK_CLOSE(low.y, -0.5 - 0.25 * sqrt(8.0) / 3, tiny);
    CHECK_CLOSE(high.z, 1 + 0.25 * sqrt(5.0) / 3, tiny);
    {
        const gs4_shape ball = gs4_sphere(at(1, 2, 3), (gs4_real)0.5);
        gs4i_shape_bounds(&ball, &low, &high);
        CHECK(low.x == (gs4_real)0.5 && low.y == (gs4_real)1.5 && low.z == (gs4_real)2.5);
        CHECK(high.x == (gs4_real)1.5 && high.y == (gs4_real)2.5 && high.z == (gs4_real)3.5);
    }
}

/* Where a shape is said to be flat the half space is all that there is of it: for any point within
 * reach, and not deeper than said, its distance is that from the face. In the midst of each face it
 * is said, near edges and of thin slabs not. */
static void err_flat(const gs4_shape *s, const double p[3], double reach, double deep, int *flat,
                     double *worst)
{
    const double d = (double)gs4i_shape_distance(s, at(p[0], p[1], p[2]));
    gs4_vec3 n;
    int i;
    if (!gs4i_shape_is_flat(s, at(p[0], p[1], p[2]), (gs4_real)reach, (gs4_real)deep, &n)) return;
    ++*flat;
    for (i = 0; i < 125; i++) {
        const double r[3] = { reach * (i % 5 - 2) / 2, reach * (i / 5 % 5 - 2) / 2,
                              reach * (i / 25 - 2) / 2 },
                     there = d + (double)n.x * r[0] + (double)n.y * r[1] + (double)n.z * r[2];
        if (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] > reach * reach || there < -deep) continue;
        *worst =
            fmax(*worst,
                 fabs(there
                      - (double)gs4i_shape_distance(s, at(p[0] + r[0], p[1] + r[1], p[2] + r[2]))));
    }
}

static void test_errors_flat_shapes(void)
{
    const gs4_shape shapes[3] = { gs4_box(at(-0.5, -0.45, -0.15), at(0.5, 0.45, 0.15)),
                                  gs4_cylinder(at(-0.05, -0.1, -0.1), at(0.05, 0.1, 0.1),
                                               (gs4_real)0.5),
                                  gs4_plane(at(0.1, 0, 0), at(0.6, 0, 0.8)) };
    static const double axis[3] = { 1.0 / 3, 2.0 / 3, 2.0 / 3 }, half[3] = { 0.5, 0.45, 0.15 };
    double worst = 0;
    int k, i, size, flat[3] = { 0, 0, 0 };
    for (k = 0; k < 3; k++)
        for (size = 0; size < 4; size++)
            for (i = 0; i < 1331; i++) {
                const double p[3] = { 0.13 * (i % 11) - 0.65, 0.13 * (i / 11 % 11) - 0.65,
                                      0.13 * (i / 121) - 0.65 };
                err_flat(&shapes[k], p, size % 2 ? 0.3 : 0.1, size / 2 ? 0.25 : 0.05, &flat[k],
                         &worst);
            }
    if (test_filter[0])
        printf("flat: box %d, cylinder %d, plane %d of 5324, off by %.1e\n", flat[0], flat[1],
               flat[2], worst);
    CHECK(worst < 3e-7);
    CHECK(flat[2] == 5324);
    for (i = 0; i < 6; i++) { /* 0.02 before each face of the box, both ends of the cylinder */
        const double way = i % 2 ? 1 : -1;
        double p[3] = { 0, 0, 0 };
        int n = 0;
        p[i / 2] = way * (half[i / 2] + 0.02);
        err_flat(&shapes[0], p, 0.05, 0.05, &n, &worst);
        for (k = 0; k < 3; k++) p[k] = way * 0.17 * axis[k];
        err_flat(&shapes[1], p, 0.2, 0.1, &n, &worst);
        CHECK(n == 2);
    }
    CHECK(worst < 3e-7);
}

#ifdef GS4_PTHREADS
static void err_count_task(int index, void *context) { ((unsigned char *)context)[index]++; }
#endif

/* Threads do each task once, none twice and none beyond the last, however many there are. */
static void test_errors_pool(void)
{
#ifdef GS4_PTHREADS
    static unsigned char done[1024];
    int workers, count, i, wrong = 0;
    for (workers = 1; workers < 4; workers++) {
        gs4i_memory memory;
        gs4i_pool *pool;
        memset(&memory, 0, sizeof memory);
        memory.hook.alloc_fn = gs4i_default_alloc;
        memory.hook.free_fn = gs4i_default_free;
        pool = gs4i_pool_create(&memory, workers);
        CHECK(pool != NULL);
        for (count = 1; pool && count < 300; count += count < 150 ? 1 : 7) {
            memset(done, 0, sizeof done);
            gs4i_pool_run(pool, count, err_count_task, done);
            for (i = 0; i < 1024; i++) wrong += done[i] != (i < count);
        }
        gs4i_pool_destroy(&memory, pool, workers);
    }
    CHECK(wrong == 0);
#endif
}

/* A drop that flies 40 cells has no more nodes there than at the start: those that it leaves are
 * given back, in its box of blocks and one block around. */
static void test_errors_flight(void)
{
    int euler, i;
    for (euler = 0; euler < 2; euler++) {
        gs4_sim_desc d = scene_cube(8);
        const gs4_material m = scene_liquid(1000, 0, 10);
        const gs4_fill f = scene_fill(at(5, 0, 0));
        gs4_sim *sim;
        int most = 0;
        d.cells[0] = 56;
        d.integrator = physics_integrators[euler];
        CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_add_material(sim, &m) == 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.5, 0.25, 0.25), at(1, 0.75, 0.75)), &f) > 0);
        for (i = 0; gs4_get_stats(sim).time < 1; i++) {
            CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim) / 2), GS4_OK);
            if (gs4_get_stats(sim).active_cells > most) most = gs4_get_stats(sim).active_cells;
        }
        if (test_filter[0]) printf("integrator %d: %d cells at most\n", euler, most);
        /* along x it is in 2 blocks, or 3 by the cell that it may be ahead; and 1 on each side */
        CHECK(most <= 5 * 4 * 4 * 64);
        gs4_destroy(sim);
    }
}

/* Which members of the family there are: rho_inf_spurious <= rho_inf, and a product up to 0.98. */
static void test_errors_members(void)
{
    static const double member[6][3] = {
        { 0.3, 0.3, 1 }, { 0.3, 0.31, 0 },    { 1, 0.97, 1 },
        { 1, 0.985, 0 }, { 0.985, 0.985, 1 }, { 0.994, 0.994, 0 }
    };
    int i;
    for (i = 0; i < 6; i++) {
        gs4_sim_desc d = err_desc();
        gs4_sim *sim;
        d.rho_inf = (gs4_real)member[i][0];
        d.rho_inf_spurious = (gs4_real)member[i][1];
        CHECK((gs4_create(&d, &sim) == GS4_OK) == (member[i][2] > 0));
        CHECK(member[i][2] > 0 || strstr(gs4_last_error(NULL), "rho_inf_spurious") != NULL);
        gs4_destroy(sim);
    }
}

/* Limits, a little within and a little beyond: periodic pairs, far origins, steps, full places. */
static void test_errors_limits(void)
{
    const double far_out = 0.02 / 8 / (double)(sizeof(gs4_real) == 8 ? DBL_EPSILON : FLT_EPSILON);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const gs4_shape box = gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.75, 0.75));
    gs4_sim *sim;
    int i;
    for (i = 0; i < 6; i++) {
        gs4_sim_desc d = err_desc();
        d.walls[i] = GS4_WALL_PERIODIC;
        CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT);
    }
    for (i = 0; i < 2; i++) {
        gs4_sim_desc d = err_desc();
        d.origin = at(0, (i ? 1.1 : 0.9) * far_out, 0);
        CHECK((gs4_create(&d, &sim) == GS4_OK) == !i);
        gs4_destroy(sim);
    }
    sim = err_sim();
    CHECK(gs4_add_particles(sim, box, &f) > 0);
    CHECK(gs4_add_particles(sim, box, &f) == GS4_ERROR_ARGUMENT);
    CHECK(gs4_step(sim, (gs4_real)1.01 * gs4_stable_dt(sim)) == GS4_ERROR_UNSTABLE);
    CHECK(gs4_step(sim, gs4_stable_dt(sim)) == GS4_OK);
    gs4_destroy(sim);
}

/* What gs4_get_stats sums up, from the particles. */
static void test_errors_stats(void)
{
    gs4_fill f = scene_fill(at(1, -2, 0.5));
    double momentum[3] = { 0, 0, 0 }, angular[3] = { 0, 0, 0 }, energy = 0;
    gs4_sim *sim = err_sim();
    gs4_view x, v, m;
    gs4_stats stats;
    int i, c;
    f.angular_velocity = at(3, 1, -2);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.5, 0.5)), &f) > 0);
    /* ids count from 0 */
    for (i = 0; i < sim->particles.count; i++) energy += (double)gs4_particle_ids(sim)[i];
    CHECK(energy == 0.5 * sim->particles.count * (sim->particles.count - 1));
    energy = 0;
    stats = gs4_get_stats(sim);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    m = gs4_particles(sim, GS4_FIELD_MASS);
    for (i = 0; i < x.count; i++) {
        const gs4_real *r = x.data + (size_t)i * (size_t)x.stride,
                       *u = v.data + (size_t)i * (size_t)v.stride;
        const double mass = (double)m.data[(size_t)i * (size_t)m.stride];
        for (c = 0; c < 3; c++) {
            const int j = (c + 1) % 3, k = (c + 2) % 3;
            momentum[c] += mass * (double)u[c];
            energy += mass * (double)u[c] * (double)u[c] / 2;
            angular[c] += mass * ((double)r[j] * (double)u[k] - (double)r[k] * (double)u[j]);
        }
    }
    for (c = 0; c < 3; c++) {
        CHECK_CLOSE(stats.momentum[c], momentum[c], 1e-12 * fabs(momentum[c]));
        CHECK_CLOSE(stats.angular_momentum[c], angular[c], 1e-10 * fabs(angular[c]));
    }
    CHECK_CLOSE(stats.kinetic_energy, energy, 1e-12 * energy);
    gs4_destroy(sim);
}

/* Lists grow and keep what is in them. */
static void test_errors_growth(void)
{
    gs4_sim *sim = err_sim();
    gs4_collider c;
    int i;
    memset(&c, 0, sizeof c);
    for (i = 0; i < 20; i++) {
        gs4_material m = scene_liquid(1000 + i, 1, 10);
        CHECK(gs4_add_material(sim, &m) == 1 + i); /* err_sim has one */
        c.shape = gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)(0.125 + i));
        CHECK(gs4_add_collider(sim, &c) == i);
    }
    for (i = 0; i < 20; i++) {
        CHECK(sim->constants[1 + i].is.density == (gs4_real)(1000 + i));
        CHECK(sim->boundary.colliders[i].is.shape.radius == (gs4_real)(0.125 + i));
    }
    gs4_destroy(sim);
}

/* --- what is hardly meant, and what takes long ------------------------------------------------ */

/* A box that reaches far out gives what one gives that ends at the walls, a sphere is refused. */
static void test_errors_far_shapes(void)
{
    const double ends[] = { 1, 1e3, 1e6, 1e12, 1e17 };
    int i;
    for (i = 0; i < 5; i++) {
        const double most = ends[i], least = i ? -most : 0;
        gs4_sim *sim = err_sim();
        gs4_emitter e;
        gs4_collider c;
        memset(&e, 0, sizeof e);
        memset(&c, 0, sizeof c);
        e.shape = gs4_box(at(least, 0.75, least), at(most, most, most));
        e.fill = scene_fill(at(0, -0.5, 0));
        CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.002), 0);
        CHECK_CLOSE(gs4_get_stats(sim).particles, 16 * 16 * 4, 16 * 4); /* rows differ in phase */
        CHECK(
            gs4_add_particles(sim, gs4_box(at(least, least, least), at(most, 0.25, most)), &e.fill)
            == 16 * 16 * 4);
        c.shape = gs4_sphere(at(0.5, -most, 0.5), (gs4_real)most);
        if (most * (sizeof(gs4_real) == 8 ? DBL_EPSILON : FLT_EPSILON) < 0.005) {
            CHECK(gs4_add_collider(sim, &c) >= 0);
        } else
            ERR_REFUSED(sim, gs4_add_collider(sim, &c), GS4_ERROR_ARGUMENT, "far out");
        c.shape = gs4_box(at(least, least, least), at(most, 0.25, most));
        CHECK(gs4_add_collider(sim, &c) >= 0);
        CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.002), 0);
        gs4_destroy(sim);
    }
}

/* Temperatures written by hand melt at once, for every call: a refused one changes nothing. */
static void test_errors_melt_by_hand(void)
{
    gs4_sim *sim = NULL;
    const gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_edit e;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1000;
    m.heat_capacity = 1000;
    m.can_melt = 1;
    m.melting_temperature = 30;
    f.temperature = 20;
    gs4_create(&d, &sim);
    CHECK(gs4_add_material(sim, &m) == 0);
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.2), &f) > 0);
    e = gs4_edit_particles(sim, GS4_FIELD_TEMPERATURE);
    e.data[0] = 50;
    ERR_REFUSED(sim, gs4_step(sim, 2 * gs4_stable_dt(sim)), GS4_ERROR_UNSTABLE, "dt is");
    e = gs4_edit_particles(sim, GS4_FIELD_TEMPERATURE);
    e.data[4] = 50;
    CHECK(gs4_particles(sim, GS4_FIELD_LIQUID_FRACTION).data[4] == 1);
    ERR_REFUSED(sim, gs4_write_ply(sim, ""), GS4_ERROR_ARGUMENT, "path");
    gs4_destroy(sim);
}

static void *err_little_alloc(size_t bytes, size_t alignment, void *user)
{
    (void)user;
    return bytes < 100000000 ? gs4i_default_alloc(bytes, alignment, NULL) : NULL;
}

/* Too much is refused at once, by a sentence that says how much it is. */
static void test_errors_too_much(void)
{
    const clock_t start = clock();
    gs4_sim_desc d = err_desc();
    const gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim = NULL;
    int a;
    d.allocator.alloc_fn = err_little_alloc;
    d.allocator.free_fn = gs4i_default_free;
    for (a = 0; a < 3; a++) d.cells[a] = 4096;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(NULL), "1.08005e9") && strstr(gs4_last_error(NULL), "1e9"));
    d.cell_size = (gs4_real)1e-3;
    for (a = 0; a < 3; a++) d.cells[a] = 3992;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_MEMORY);
    CHECK(strstr(gs4_last_error(NULL), "4e9 bytes"));
    for (a = 0; a < 3; a++) d.cells[a] = 1000;
    d.max_particles = 1073741808;
    CHECK(gs4_create(&d, &sim) == GS4_ERROR_MEMORY);
    CHECK(strstr(gs4_last_error(NULL), "1.07374e9 particles need"));
    d.max_particles = 0;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    sim->desc.max_particles = 0;
    {
        const gs4_material m = err_material();
        CHECK(gs4_add_material(sim, &m) == 0);
    }
    ERR_REFUSED(sim, gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(1, 1, 1)), &f),
                GS4_ERROR_MEMORY, "about 8e9");
    {
        gs4_emitter e;
        memset(&e, 0, sizeof e);
        e.fill = scene_fill(at(0, 0, -1));
        e.shape = gs4_box(at(0, 0, 0), at(1, 1, 1));
        CHECK(gs4_add_emitter(sim, &e) == 0);
        ERR_REFUSED(sim, gs4_step(sim, (gs4_real)1e-7), GS4_ERROR_MEMORY, "about 8.0");
    }
    gs4_destroy(sim);
    CHECK((double)(clock() - start) / CLOCKS_PER_SEC < 0.5);
}

/* gs4_advance that is refused half way says what it did, and what is left. */
static void test_errors_half_way(void)
{
    err_turn turn = { 1e30, -1, 0, 1000 };
    gs4_sim *sim = err_turning(0, 0, 0, &turn);
    const double duration = 0.05;
    gs4_stats s;
    char said[40];
    CHECK(gs4_advance(sim, (gs4_real)duration) == GS4_ERROR_UNSTABLE);
    s = gs4_get_stats(sim);
    sprintf(said, "took %d steps", (int)s.steps);
    CHECK(s.steps > 2 && strstr(gs4_last_error(sim), said)
          && strstr(gs4_last_error(sim), "s are left"));
    CHECK_CLOSE(s.time + s.time_left, duration, 1e-6);
    turn.last_good = INT_MAX;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)s.time_left), 0);
    CHECK_CLOSE(gs4_get_stats(sim).time, duration, 1e-6);
    CHECK(gs4_get_stats(sim).time_left == 0);
    gs4_destroy(sim);
}

/* A callback that calls back. */
typedef struct err_calls_back {
    gs4_sim *sim;
    int calls, refused;
} err_calls_back;

static void err_call_back(err_calls_back *c)
{
    const gs4_material m = err_material();
    if (!c->sim || c->calls++) return;
    c->refused += gs4_step(c->sim, (gs4_real)1e-4) == GS4_ERROR_ARGUMENT;
    c->refused += strstr(gs4_last_error(c->sim), "callback") != NULL;
    c->refused += gs4_advance(c->sim, (gs4_real)1e-4) == GS4_ERROR_ARGUMENT;
    c->refused += gs4_add_material(c->sim, &m) == GS4_ERROR_ARGUMENT;
    c->refused += gs4_load(c->sim, "x") == GS4_ERROR_ARGUMENT;
    c->refused += gs4_edit_particles(c->sim, GS4_FIELD_VELOCITY).data == NULL;
    gs4_destroy(c->sim);
}

static gs4_real err_calling_viscosity(gs4_real temperature, gs4_real rate, void *user)
{
    (void)temperature;
    (void)rate;
    err_call_back((err_calls_back *)user);
    return (gs4_real)0.1;
}

static int err_calling_go_on(void *user)
{
    err_calls_back *c = (err_calls_back *)user;
    c->calls = c->refused = 0;
    err_call_back(c);
    return 1;
}

static void test_errors_callback_calls(void)
{
    gs4_budget b = { 0, 0, NULL, NULL };
    const gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    err_calls_back c = { NULL, 0, 0 };
    gs4_sim *sim = NULL;
    m.viscosity_law = GS4_VISCOSITY_CALLBACK;
    m.viscosity_fn = err_calling_viscosity;
    m.viscosity_user = &c;
    gs4_create(&d, &sim);
    CHECK(gs4_add_material(sim, &m) == 0);
    CHECK(err_add_block(sim) == 64);
    c.sim = sim;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), 0);
    CHECK(c.calls > 1 && c.refused == 6);
    c.calls = c.refused = 0;
    b.go_on = err_calling_go_on;
    b.user = &c;
    CHECK_RESULT(sim, gs4_advance_within(sim, (gs4_real)1e-4, &b, NULL), 0);
    CHECK(c.refused == 6);
    c.sim = NULL;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), 0);
    gs4_destroy(sim);
}

static void err_calling_log(int level, const char *message, void *user)
{
    (void)level;
    (void)message;
    err_call_back((err_calls_back *)user);
}

static double err_calling_now(void *user)
{
    err_call_back((err_calls_back *)user);
    return 0;
}

static void *err_calling_alloc(size_t bytes, size_t alignment, void *user)
{
    char *block = (char *)calloc(bytes + 2 * alignment, 1), *at = block + alignment;
    err_call_back((err_calls_back *)user);
    at += alignment - (size_t)at % alignment;
    memcpy(at - sizeof block, &block, sizeof block);
    return at;
}

static void err_calling_free(void *memory, size_t bytes, void *user)
{
    char *block;
    (void)bytes;
    err_call_back((err_calls_back *)user);
    memcpy(&block, (char *)memory - sizeof block, sizeof block);
    free(block);
}

static gs4_real err_calling_distance(gs4_vec3 x, void *user)
{
    err_call_back((err_calls_back *)user);
    return x.y;
}

/* All of the six calls were refused, from the first callback of those that there were. */
static void err_check_calls(err_calls_back *c, gs4_sim *sim, const char *sentence)
{
    CHECK(c->calls > 0);
    CHECK(c->refused == 6);
    if (sentence) CHECK(strstr(gs4_last_error(sim), sentence) != NULL);
    c->calls = c->refused = 0;
}

/* What gs4_stable_dt asks of a viscosity: a number that is none is said, and a law that calls the
 * library is refused, gs4_stable_dt itself too, or it would ask without end. */
typedef struct err_asked {
    gs4_sim *sim;
    double value;
    int calls, stable, refused;
} err_asked;

static gs4_real err_asked_viscosity(gs4_real temperature, gs4_real rate, void *user)
{
    err_asked *c = (err_asked *)user;
    (void)temperature;
    (void)rate;
    if (c->sim && c->calls++ < 100) {
        c->stable += gs4_stable_dt(c->sim) > 0;
        c->refused += gs4_step(c->sim, (gs4_real)1e-5) == GS4_ERROR_ARGUMENT;
    }
    return (gs4_real)c->value;
}

static void test_errors_stable_dt(void)
{
    const double wrong[] = { ERR_NAN, -1, ERR_INFINITY, -ERR_INFINITY,
                             sizeof(gs4_real) == 8 ? 1e120 : 1e30 };
    const gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    err_asked c = { NULL, 0.1, 0, 0, 0 };
    gs4_sim *sim = NULL;
    uint64_t hash;
    int v;
    m.viscosity_law = GS4_VISCOSITY_CALLBACK;
    m.viscosity_fn = err_asked_viscosity;
    m.viscosity_user = &c;
    gs4_create(&d, &sim);
    CHECK(gs4_add_material(sim, &m) == 0);
    CHECK(err_add_block(sim) == 64);
    hash = gs4_state_hash(sim);
    for (v = 0; v < 5; v++) {
        c.value = wrong[v];
        CHECK(gs4_stable_dt(sim) == 0);
        CHECK(strstr(gs4_last_error(sim), "must give 0 or a finite number") != NULL);
        ERR_REFUSED(sim, gs4_step(sim, (gs4_real)1e-6), GS4_ERROR_UNSTABLE, "viscosity");
        ERR_REFUSED(sim, gs4_advance(sim, (gs4_real)1e-3), GS4_ERROR_UNSTABLE, "viscosity");
    }
    c.value = 0.1;
    c.sim = sim;
    CHECK(gs4_stable_dt(sim) > 0);
    CHECK(c.calls >= 64 && c.stable == 0 && c.refused == c.calls);
    c.calls = c.refused = 0;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-5), 0);
    CHECK(c.calls > 64 && c.refused == 100);
    c.sim = NULL;
    CHECK(hash != gs4_state_hash(sim) && gs4_get_stats(sim).steps == 1);
    gs4_destroy(sim);
}

/* A clock that says nothing of use: times count as 0, and it ends a budget of seconds. */
static double err_bad_now(void *user)
{
    const double says[] = { ERR_NAN, 1e5, ERR_INFINITY, -ERR_INFINITY, 3, 7 };
    int *state = (int *)user; /* which number; from 6 on: backwards */
    return *state < 5 ? says[*state] : *state == 5 ? says[(*state)--] : -(double)(*state)++;
}

static void test_errors_clock(void)
{
    int first;
    for (first = 0; first < 7; first++) {
        gs4_sim_desc d = err_desc();
        gs4_budget b = { 0, 1, NULL, NULL };
        const gs4_material m = err_material();
        gs4_sim *sim = NULL;
        gs4_stats s;
        int state = first, i;
        d.now = err_bad_now;
        d.now_user = &state;
        gs4_create(&d, &sim);
        CHECK(gs4_add_material(sim, &m) == 0);
        CHECK(err_add_block(sim) == 64);
        for (i = 0; i < 5; i++) {
            CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-5), 0);
            if (first < 6) state = (first + i) % 6;
        }
        s = gs4_get_stats(sim);
        CHECK(s.seconds_total >= 0 && s.seconds_total < 1e6);
        CHECK(s.seconds_sort >= 0 && s.seconds_sort < 1e6);
        CHECK(s.seconds_solve >= 0 && s.seconds_solve < 1e6);
        CHECK(s.seconds_transfer >= 0 && s.seconds_transfer < 1e6);
        if (first == 0 || first == 2) {
            state = first;
            CHECK_RESULT(sim, gs4_advance_within(sim, (gs4_real)0.1, &b, NULL), 0);
            CHECK(gs4_get_stats(sim).steps == s.steps + 1 && gs4_get_stats(sim).time_left > 0);
        }
        gs4_destroy(sim);
    }
}

/* The same outside of steps: who hears of an error or a warning, a clock, an allocator, a distance.
 * The sentence of the call that failed is there afterwards. */
static void test_errors_callback_calls_outside(void)
{
    gs4_sim_desc d = err_desc();
    const gs4_material m = err_material();
    const gs4_vec3 low = { (gs4_real)0.2, 0, (gs4_real)0.2 },
                   high = { (gs4_real)0.8, (gs4_real)0.5, (gs4_real)0.8 };
    gs4_collider body;
    gs4_emitter emitter;
    err_calls_back log = { NULL, 0, 0 }, now = log, memory = log, shape = log;
    gs4_sim *sim = NULL;
    int id;
    memset(&body, 0, sizeof body);
    memset(&emitter, 0, sizeof emitter);
    d.log = err_calling_log;
    d.log_user = &log;
    d.now = err_calling_now;
    d.now_user = &now;
    d.allocator.alloc_fn = err_calling_alloc;
    d.allocator.free_fn = err_calling_free;
    d.allocator.user = &memory;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    memory.sim = sim;
    CHECK(gs4_add_material(sim, &m) == 0);
    err_check_calls(&memory, sim, NULL);
    CHECK(err_add_block(sim) == 64);
    err_check_calls(&memory, sim, NULL);
    log.sim = sim;
    CHECK(gs4_add_material(sim, NULL) == GS4_ERROR_ARGUMENT);
    err_check_calls(&log, sim, "material is NULL");
    CHECK(gs4_load(sim, "/nowhere/at/all") == GS4_ERROR_IO);
    err_check_calls(&log, sim, "could not be opened");
    CHECK(gs4_step(sim, 1000) == GS4_ERROR_UNSTABLE);
    err_check_calls(&log, sim, "largest stable step");
    now.sim = sim;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)1e-4), 0);
    err_check_calls(&now, sim, NULL);
    now.sim = NULL;
    /* that there is material inside is a warning */
    shape.sim = sim;
    body.shape = gs4_sdf(err_calling_distance, &shape, low, high);
    id = gs4_add_collider(sim, &body);
    CHECK(id == 0);
    err_check_calls(&shape, sim, NULL);
    emitter.shape = body.shape;
    emitter.fill.velocity.y = 1;
    gs4_add_emitter(sim, &emitter);
    err_check_calls(&shape, sim, NULL);
    memory.calls = memory.refused = 0;
    shape.sim = log.sim = NULL;
    gs4_destroy(sim);
    err_check_calls(&memory, NULL, NULL);
}

static double err_calling_poisson_now(void *user)
{
    gs4_poisson **p = (gs4_poisson **)user;
    gs4_real x = 0;
    if (!*p) return 0;
    CHECK(gs4_poisson_solve(*p, &x, &x, NULL) == GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(NULL), "callback") != NULL);
    gs4_poisson_destroy(*p);
    return 0;
}

/* The clock of a solver calls it. */
static void test_errors_poisson_callback_calls(void)
{
    const uint8_t kind[2] = { GS4_CELL_LIQUID, GS4_CELL_AIR };
    const gs4_real rhs[2] = { 1, 0 };
    gs4_real x[2] = { 0, 0 };
    gs4_poisson_desc d;
    gs4_poisson *p = NULL, *called = NULL;
    memset(&d, 0, sizeof d);
    d.cells[0] = 2;
    d.cells[1] = d.cells[2] = 1;
    d.cell_size = 1;
    d.kind = kind;
    d.now = err_calling_poisson_now;
    d.now_user = &called;
    CHECK(gs4_poisson_create(&d, &p) == GS4_OK);
    called = p;
    CHECK(gs4_poisson_solve(p, rhs, x, NULL) == GS4_OK);
    CHECK_CLOSE(x[0], 1, 1e-6);
    gs4_poisson_destroy(p);
}

/* An emitter that is refused has raised no default speed of sound, which its travel would. */
static void test_errors_refused_emitter(void)
{
    const gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    gs4_emitter e;
    gs4_sim *sim = NULL;
    gs4_real before;
    double value = 1e30;
    m.sound_speed = 0;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), 0);
    CHECK_RESULT(sim, gs4_set_gravity(sim, at(0, 0, -9)), 0); /* of a scene that is empty yet */
    CHECK(gs4_add_material(sim, &m) == 0 && err_add_block(sim) == 64);
    before = gs4_stable_dt(sim);
    memset(&e, 0, sizeof e);
    e.shape = gs4_sdf(err_bad_sdf, &value, at(0.3, 0.3, 0.3), at(0.6, 0.6, 0.6));
    e.travel = at(300, 0, 0);
    ERR_REFUSED(sim, gs4_add_emitter(sim, &e), GS4_ERROR_ARGUMENT, "inside out");
    CHECK(gs4_stable_dt(sim) == before);
    gs4_destroy(sim);
}

/* Counts the lines of level 1 that hold a word. */
typedef struct err_words {
    const char *word;
    int said, lines;
} err_words;

static void err_hear(int level, const char *message, void *user)
{
    err_words *w = (err_words *)user;
    if (level != 1) return;
    w->lines++;
    w->said += strstr(message, w->word) != NULL;
}

typedef enum err_trap {
    ERR_NO_TRAP,
    ERR_CUT_OFF,
    ERR_CUT_OFF_EMITTER,
    ERR_BODY_OVER_MATERIAL,
    ERR_MATERIAL_IN_BODY,
    ERR_POINTS_IN_BODY,
    ERR_BODY_OVER_EMITTER,
    ERR_THIN_EMITTER,
    ERR_STILL_EMITTER,
    ERR_SHORT_STEPS,
    ERR_COLD,
    ERR_NO_DECAY,
    ERR_TRAPS
} err_trap;

/* A scene without any trap, or with one; everything is done twice. */
static void err_walk_into(err_trap trap, err_words *words)
{
    gs4_sim_desc d = err_desc();
    gs4_material m = err_material();
    gs4_fill f = scene_fill(at(0, 0, -0.1));
    gs4_collider body;
    gs4_emitter e;
    gs4_sim *sim = NULL;
    gs4_shape low = gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.75, 0.5)),
              high = gs4_box(at(0.25, 0.25, 0.75), at(0.75, 0.75, 0.875));
    const gs4_real xyz[3] = { (gs4_real)0.2, (gs4_real)0.2, (gs4_real)0.1 };
    int twice;
    d.log = err_hear;
    d.log_user = words;
    if (trap == ERR_NO_DECAY) d.flip_decay_time = (gs4_real)ERR_INFINITY;
    if (trap == ERR_SHORT_STEPS) m.viscosity = (gs4_real)5e6; /* 1.4e-6 s, half of it by cfl */
    m.heat_capacity = 1000;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1000;
    m.can_melt = 1;
    m.melting_temperature = 30;
    f.temperature = trap == ERR_COLD ? 0 : 40;
    memset(&body, 0, sizeof body);
    memset(&e, 0, sizeof e);
    body.shape = gs4_box(at(-1, -1, -1), at(2, 2, trap == ERR_BODY_OVER_MATERIAL ? 0.4 : 0.2));
    if (trap == ERR_MATERIAL_IN_BODY) low = gs4_box(at(0.25, 0.25, 0.1), at(0.75, 0.75, 0.5));
    if (trap == ERR_CUT_OFF) low = gs4_sphere(at(0, 0.5, 0.5), (gs4_real)0.2);
    if (trap == ERR_CUT_OFF_EMITTER) high = gs4_box(at(0.25, 0.25, 0.75), at(0.75, 0.75, 1.1));
    if (trap == ERR_THIN_EMITTER) high = gs4_box(at(0.25, 0.25, 0.75), at(0.75, 0.75, 0.78));
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    if (trap == ERR_BODY_OVER_MATERIAL) CHECK(gs4_add_particles(sim, low, &f) > 0);
    for (twice = 0; twice < 2; twice++) CHECK(gs4_add_collider(sim, &body) >= 0);
    if (trap == ERR_BODY_OVER_EMITTER) {
        body.shape = gs4_sphere(at(0.5, 0.5, 0.8), (gs4_real)0.2);
        CHECK(gs4_add_collider(sim, &body) >= 0);
    }
    if (trap != ERR_BODY_OVER_MATERIAL) CHECK(gs4_add_particles(sim, low, &f) > 0);
    if (trap == ERR_POINTS_IN_BODY)
        for (twice = 0; twice < 2; twice++)
            CHECK(gs4_add_points(sim, xyz, 1, (gs4_real)1e-4, &f) == 1);
    f.angular_velocity = at(0, 0, 0);
    e.fill = f;
    e.shape = high;
    if (trap == ERR_STILL_EMITTER) e.fill.velocity = at(0, 0, 0);
    for (twice = 0; twice < 2; twice++) CHECK(gs4_add_emitter(sim, &e) >= 0);
    for (twice = 0; twice < 4; twice++)
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.4 * gs4_stable_dt(sim)), 0);
    gs4_destroy(sim);
}

/* Each says one line, once, and a scene without any says none. */
static void test_errors_traps(void)
{
    static const char *const words[ERR_TRAPS] = { "",
                                                  "cut off",
                                                  "cut off",
                                                  "inside of a collider",
                                                  "inside of a collider",
                                                  "inside of a collider",
                                                  "covers",
                                                  "thinner",
                                                  "gives nothing",
                                                  "a million steps",
                                                  "temperature 0",
                                                  "flip_decay_time" };
    int trap;
    for (trap = 0; trap < ERR_TRAPS; trap++) {
        err_words w = { NULL, 0, 0 };
        w.word = words[trap];
        err_walk_into((err_trap)trap, &w);
        err_report(w.said == (trap != ERR_NO_TRAP) && w.lines == w.said, "trap", words[trap], trap,
                   w.lines, "not said once and alone");
    }
}

static void run_errors(void)
{
    RUN(test_errors_far_shapes);
    RUN_ONCE(test_errors_melt_by_hand);
    RUN(test_errors_too_much);
    RUN_ONCE(test_errors_half_way);
    RUN_ONCE(test_errors_callback_calls);
    RUN_ONCE(test_errors_stable_dt);
    RUN_ONCE(test_errors_clock);
    RUN_ONCE(test_errors_callback_calls_outside);
    RUN_ONCE(test_errors_poisson_callback_calls);
    RUN_ONCE(test_errors_refused_emitter);
    RUN_ONCE(test_errors_traps);
    RUN(test_errors_limits);
    RUN(test_errors_stats);
    RUN(test_errors_growth);
    RUN(test_errors_members);
    RUN(test_errors_numbers);
    RUN(test_errors_hash);
    RUN(test_errors_distances);
    RUN(test_errors_flat_shapes);
    RUN(test_errors_pool);
    RUN_ONCE(test_errors_flight);
    RUN(test_errors_desc);
    RUN(test_errors_material);
    RUN_ONCE(test_errors_fill);
    RUN_FULL(test_errors_collider);
    RUN(test_errors_large_emitter);
    RUN_FULL(test_errors_emitter);
    RUN(test_errors_calls);
    RUN(test_errors_points);
    RUN(test_errors_null);
    RUN(test_errors_half_hooks);
    RUN(test_errors_strings);
    RUN(test_errors_log);
    RUN(test_errors_log_of_retries);
    RUN(test_errors_log_of_emitters);
    RUN(test_errors_shapes);
    RUN_FULL(test_errors_sdf);
    RUN(test_errors_mesh);
    RUN(test_errors_large_mesh);
    RUN(test_errors_edit);
    RUN(test_errors_edit_repaired);
    RUN(test_errors_limit_after_edit);
    RUN(test_errors_preset);
    RUN(test_errors_edit_then_add);
    RUN(test_errors_material_all_or_nothing);
    RUN(test_errors_point);
    RUN(test_errors_refused_step);
    RUN_FULL(test_errors_viscosity_callback);
    RUN_FULL(test_errors_viscosity_that_turns);
    RUN(test_errors_no_end);
    RUN_FULL(test_errors_fast_pom_pom);
    RUN(test_errors_short_durations);
    RUN(test_errors_leaps);
    RUN(test_errors_max_particles);
    RUN(test_errors_limit_after_emitting);
    RUN(test_errors_heavy);
}
