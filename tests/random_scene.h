/* What random scenes are made of, for tests/random_scenes.c and tests/fuzz.c: descriptions of all
 * kinds that a simulation accepts, but for what does not fit together. After gs4mpm.h.
 * Nothing is computed here that the compiler may fuse or round otherwise: lengths are whole numbers
 * of 1/64 cell, cells whole numbers of 1/4096 m, all else whole numbers over one divisor. */
#ifndef RANDOM_SCENE_H
#define RANDOM_SCENE_H
#include <math.h>
#include <string.h>

#define CELL 64 /* units of length in a cell */
#define MAX_SHAPES 64
#define MAX_BODIES 3

typedef struct octahedron {
    gs4_vec3 centre;
    gs4_real reach;
} octahedron;

typedef struct scene {
    gs4_sim *sim;
    int scale;     /* cell size, 1/4096 m */
    int origin[3]; /* of the grid, in units of length like all places below */
    int cells[3];
    int with_heat, euler, materials, bodies, emitters, refused, first_code;
    int shapes; /* what they point at must outlive the simulation */
    octahedron octahedra[MAX_SHAPES];
    gs4_real vertices[MAX_SHAPES][8][3];
} scene;

static uint32_t random_state;

static void random_begin(int seed) { random_state = (uint32_t)seed * 2654435769u + 1u; }

/* A whole number from low to high: Marsaglia's xorshift. One call a statement, always: the order of
 * arguments is the compiler's. */
static int pick(int low, int high)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return low + (int)((random_state >> 4) % (uint32_t)(high - low + 1));
}

static int one_in(int n) { return pick(1, n) == 1; }

static gs4_real number(int low, int high, int divisor)
{
    return (gs4_real)((double)pick(low, high) / divisor);
}

static gs4_vec3 vector(int most, int divisor)
{
    gs4_vec3 v;
    v.x = number(-most, most, divisor);
    v.y = number(-most, most, divisor);
    v.z = number(-most, most, divisor);
    return v;
}

/* ==== shapes ================================================================================== */

static gs4_real length(const scene *s, int units)
{
    return (gs4_real)((double)(units * s->scale) / (4096 * CELL));
}

static gs4_vec3 place(const scene *s, const int at[3])
{
    gs4_vec3 x;
    x.x = length(s, s->origin[0] + at[0]);
    x.y = length(s, s->origin[1] + at[1]);
    x.z = length(s, s->origin[2] + at[2]);
    return x;
}

/* 1.75 is above the square root of 3: never more than the distance */
static gs4_real octahedron_distance(gs4_vec3 x, void *user)
{
    const octahedron *o = (const octahedron *)user;
    const double dx = fabs((double)x.x - (double)o->centre.x),
                 dy = fabs((double)x.y - (double)o->centre.y),
                 dz = fabs((double)x.z - (double)o->centre.z);
    return (gs4_real)((dx + dy + dz - (double)o->reach) / 1.75);
}

/* A tetrahedron or a skewed brick */
static gs4_shape mesh(scene *s, const int centre[3], const int half[3])
{
    static const int four[4][3] = { { -1, -1, -1 }, { 1, 1, -1 }, { 1, -1, 1 }, { -1, 1, 1 } };
    static const int faces_of_four[4][3] = { { 0, 2, 3 }, { 0, 3, 1 }, { 0, 1, 2 }, { 1, 3, 2 } };
    static const int faces_of_eight[12][3] = { { 0, 2, 3 }, { 0, 3, 1 }, { 4, 5, 7 }, { 4, 7, 6 },
                                               { 0, 1, 5 }, { 0, 5, 4 }, { 2, 6, 7 }, { 2, 7, 3 },
                                               { 0, 4, 6 }, { 0, 6, 2 }, { 1, 3, 7 }, { 1, 7, 5 } };
    const int brick = one_in(2), skew = pick(-half[0] / 2, half[0] / 2);
    gs4_real(*v)[3] = s->vertices[s->shapes];
    int i, a;
    for (i = 0; i < (brick ? 8 : 4); i++)
        for (a = 0; a < 3; a++) {
            const int side = brick ? ((i >> a) & 1 ? 1 : -1) : four[i][a];
            const int shift = brick && a == 0 && i >= 4 ? skew : 0;
            v[i][a] = length(s, s->origin[a] + centre[a] + side * half[a] + shift);
        }
    return brick ? gs4_mesh(&v[0][0], 8, &faces_of_eight[0][0], 12)
                 : gs4_mesh(&v[0][0], 4, &faces_of_four[0][0], 4);
}

/* A plane before which most of the domain lies, with a normal that no axis has */
static gs4_shape plane(const scene *s)
{
    int at[3], a;
    const gs4_vec3 normal = vector(40, 10);
    const int positive[3] = { normal.x > 0, normal.y > 0, normal.z > 0 };
    for (a = 0; a < 3; a++) at[a] = s->cells[a] * CELL / 8 * (positive[a] ? 2 : 6);
    return gs4_plane(place(s, at), normal);
}

/* One of the kinds that have bounds, of about this half size along each axis */
static gs4_shape shape(scene *s, const int centre[3], const int half[3])
{
    const int kind = pick(0, 4);
    int low[3], high[3], a;
    gs4_shape made;
    for (a = 0; a < 3; a++) {
        const int reach = kind == 0 || (kind == 1 && a == 2) ? half[a]
                          : kind == 1                        ? pick(-half[a], half[a])
                                                             : half[0];
        low[a] = centre[a] - reach;
        high[a] = centre[a] + reach;
    }
    switch (kind) {
    case 0: made = gs4_box(place(s, low), place(s, high)); break;
    case 1: made = gs4_cylinder(place(s, low), place(s, high), length(s, half[0])); break;
    case 2: made = gs4_sphere(place(s, centre), length(s, half[0])); break;
    case 3:
        s->octahedra[s->shapes].centre = place(s, centre);
        s->octahedra[s->shapes].reach = length(s, half[0]);
        made =
            gs4_sdf(octahedron_distance, &s->octahedra[s->shapes], place(s, low), place(s, high));
        break;
    default: made = mesh(s, centre, half);
    }
    s->shapes++;
    return made;
}

/* Somewhere in the domain, this far from its walls; and a half size */
static gs4_shape shape_within(scene *s, int least, int most)
{
    int centre[3], half[3], a;
    for (a = 0; a < 3; a++) {
        half[a] = pick(least, most);
        if (2 * half[a] > s->cells[a] * CELL) half[a] = s->cells[a] * CELL / 2;
        centre[a] = pick(half[a], s->cells[a] * CELL - half[a]);
    }
    return shape(s, centre, half);
}

/* ==== the scene =============================================================================== */

/* Thins with the rate, and with distance from 0 degrees: neither line is a product and a sum */
static gs4_real viscosity_of(gs4_real temperature, gs4_real shear_rate, void *user)
{
    const double warmth = fabs((double)temperature) / 64, rate = (double)shear_rate / 128;
    (void)user;
    return (gs4_real)(3 / (1 + warmth + rate));
}

static void make_walls(scene *s, gs4_sim_desc *d)
{
    int axis, side;
    for (axis = 0; axis < 3; axis++) {
        const int periodic = one_in(5);
        for (side = 2 * axis; side < 2 * axis + 2; side++) {
            d->walls[side] = periodic ? GS4_WALL_PERIODIC : (gs4_wall)pick(0, 3);
            if (d->walls[side] >= GS4_WALL_OPEN || !one_in(3)) continue;
            d->wall_is_isothermal[side] = 1;
            d->wall_temperature[side] = number(-20, 60, 1);
        }
    }
    d->air_is_isothermal = one_in(3);
    d->ambient_temperature = number(0, 40, 1);
    s->with_heat = one_in(2);
}

static void make_desc(scene *s, gs4_sim_desc *d, int threads)
{
    int a;
    memset(d, 0, sizeof *d);
    s->scale = pick(20, 100);
    for (a = 0; a < 3; a++) {
        d->cells[a] = s->cells[a] = pick(8, 14);
        s->origin[a] = pick(-20 * CELL, 10 * CELL);
    }
    d->cell_size = length(s, CELL);
    d->origin.x = length(s, s->origin[0]);
    d->origin.y = length(s, s->origin[1]);
    d->origin.z = length(s, s->origin[2]);
    d->gravity = vector(150, 10);
    d->threads = threads;
    make_walls(s, d);
    s->euler = one_in(4);
    if (s->euler) {
        d->integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
        return;
    }
    d->rho_inf = number(0, 16, 16);
    d->rho_inf_spurious = d->rho_inf / 4;
    if (one_in(3)) d->rho_inf_spurious = 0;
    a = pick(0, 3);
    if (a == 0) d->flip_decay_time = (gs4_real)INFINITY;
    if (a == 1) d->flip_decay_time = number(1, 100, 1000);
    d->sharp_gradients = one_in(4);
    d->affine = !d->sharp_gradients && one_in(3);
}

static void make_liquid(gs4_material *m, int with_heat)
{
    const int kind = pick(0, 7);
    m->viscosity = number(1, 1000, 100);
    if (kind == 0) m->viscosity_law = GS4_VISCOSITY_CALLBACK;
    if (kind == 0) m->viscosity_fn = viscosity_of;
    if (kind == 1) {
        m->viscosity_law = GS4_VISCOSITY_CROSS_WLF;
        m->cross_wlf.a = number(1, 10, 100);
        m->cross_wlf.n = number(1, 9, 10);
        m->cross_wlf.d1 = number(1, 20, 10);
        m->cross_wlf.a1 = 2;
        m->cross_wlf.t1 = 20;
        m->cross_wlf.t2 = with_heat ? -100 : -60;
    }
    if (kind < 3) return;
    m->liquid = kind < 5 ? GS4_OLDROYD_B : GS4_POM_POM;
    m->local_fraction = kind == 3 ? 0 : number(0, 8, 16); /* 3: UCM */
    m->relaxation_time = number(1, 100, 1000);
    if (m->liquid == GS4_OLDROYD_B) return;
    m->stretch_time = number(1, 100, 2000);
    m->anisotropy = kind == 7 ? number(11, 30, 10) : number(0, 9, 10);
    m->arms = number(1, 16, 1);
}

static void make_solid(gs4_material *m)
{
    m->solid = one_in(2) ? GS4_NEO_HOOKEAN : GS4_FIXED_COROTATED;
    m->shear_modulus = number(5, 200, 1) * 100;
    if (one_in(2)) m->yield_compression = number(5, 50, 1000);
    if (one_in(2)) m->yield_stretch = number(5, 50, 1000);
}

static void make_material(const scene *s, int sharp, gs4_material *m)
{
    const int solid = !sharp && one_in(2);
    memset(m, 0, sizeof *m);
    m->density = number(500, 2000, 1);
    if (!one_in(4)) m->sound_speed = number(10, 30, 1);
    if (solid) make_solid(m);
    if (s->with_heat) {
        m->heat_capacity = number(100, 2000, 1);
        if (s->materials == 0 || one_in(2)) m->conductivity = number(1, 500, 1);
        m->viscous_heating = one_in(2);
        if (m->conductivity > 0 && one_in(2)) m->flux_relaxation_time = number(1, 50, 1000);
        if (m->flux_relaxation_time > 0) m->fourier_fraction = number(0, 8, 16);
        m->can_melt = one_in(2);
        if (m->can_melt) m->melting_temperature = number(0, 20, 1);
        if (m->can_melt && one_in(2)) m->latent_heat = number(0, 20000, 1);
    }
    if (!solid || m->can_melt)
        make_liquid(m, s->with_heat);
    else
        m->viscosity = number(0, 100, 100);
}

static void make_body(scene *s, gs4_collider *c)
{
    memset(c, 0, sizeof *c);
    c->shape = one_in(6) ? plane(s) : shape_within(s, 60, 150);
    c->contact = (gs4_wall)pick(0, 2);
    if (c->contact == GS4_WALL_SEPARATE) c->friction = number(0, 10, 10);
    if (!one_in(4)) c->velocity = vector(100, 100);
    if (!one_in(4)) c->angular_velocity = vector(300, 10);
    c->pivot = c->shape.a;
    if (c->shape.kind == GS4_SHAPE_MESH) {
        c->pivot.x = c->shape.vertices[0];
        c->pivot.y = c->shape.vertices[1];
        c->pivot.z = c->shape.vertices[2];
    }
    c->is_isothermal = one_in(2);
    c->temperature = number(-20, 60, 1);
}

static void make_fill(scene *s, gs4_fill *f)
{
    memset(f, 0, sizeof *f);
    f->material = pick(0, s->materials - 1);
    f->velocity = vector(200, 100);
    if (s->with_heat) f->temperature = number(-20, 60, 1);
    if (one_in(2)) f->jitter = number(0, 10, 20);
    f->random_seed = (uint32_t)pick(0, 1000);
    if (one_in(4)) f->spacing = length(s, pick(24, 44));
}

static void make_emitter(scene *s, gs4_emitter *e)
{
    memset(e, 0, sizeof *e);
    e->shape = shape_within(s, 48, 90);
    make_fill(s, &e->fill);
    if (one_in(2)) e->travel = vector(100, 100);
    if (one_in(3)) e->start = number(1, 5, 1000);
    if (one_in(2)) e->stop = number(6, 20, 1000);
}

/* Scenes of the partitioned scheme, without what that refuses. */
static void make_partitioned(gs4_sim_desc *d)
{
    d->scheme = GS4_PARTITIONED;
    d->integrator = one_in(3) ? GS4_INTEGRATOR_BACKWARD_EULER : GS4_INTEGRATOR_GS4;
    if (d->integrator != GS4_INTEGRATOR_GS4) d->rho_inf = d->rho_inf_spurious = 0;
    d->sharp_gradients = d->affine = 0;
}

static void make_incompressible(gs4_material *m)
{
    m->incompressible = !m->solid && one_in(2);
    if (m->incompressible) m->bulk_modulus = m->sound_speed = 0;
}

#endif
