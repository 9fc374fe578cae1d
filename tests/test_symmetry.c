/* Every part of a step under permutations and mirrors of the axes: see symmetry.h. */
#include "symmetry.h"

/* Every scene is a box of cells of 0.1 m somewhere in space, of another size along each axis. */
static gs4_sim_desc symmetry_box(int nx, int ny, int nz, gs4_integrator integrator)
{
    gs4_sim_desc d = scene_cube(10);
    d.cells[0] = nx;
    d.cells[1] = ny;
    d.cells[2] = nz;
    d.origin = at(-0.23, 0.11, -0.35);
    d.gravity = at(2, -9, 4);
    d.integrator = integrator;
    return d;
}

static gs4_vec3 symmetry_place(double x, double y, double z)
{
    return at(-0.23 + 0.1 * x, 0.11 + 0.1 * y, -0.35 + 0.1 * z);
}

/* 0 to 1, without order */
static double symmetry_noise(int i) { return fmod(0.5 + 7919.0 * sin(1.0 + 12.9898 * i), 1); }

/* Eight particles a cell from (x y z) on, n cells along each axis, each shifted by up to a tenth
 * of their spacing. */
static void symmetry_block(symmetry_world *w, int material, const double low[3], const int n[3],
                           gs4_vec3 velocity, gs4_vec3 spin, double temperature)
{
    const int count = 8 * n[0] * n[1] * n[2];
    gs4_real *points = (gs4_real *)malloc(3 * (size_t)count * sizeof *points);
    gs4_fill f = scene_fill(velocity);
    int i;
    for (i = 0; i < count; i++) {
        const int x = i % (2 * n[0]), y = i / (2 * n[0]) % (2 * n[1]), z = i / (4 * n[0] * n[1]);
        const double shift[3] = { 0.1 * symmetry_noise(3 * i), 0.1 * symmetry_noise(3 * i + 1),
                                  0.1 * symmetry_noise(3 * i + 2) };
        const gs4_vec3 p =
            symmetry_place(low[0] + 0.5 * (x + 0.5 + shift[0]), low[1] + 0.5 * (y + 0.5 + shift[1]),
                           low[2] + 0.5 * (z + 0.5 + shift[2]));
        points[3 * i] = p.x;
        points[3 * i + 1] = p.y;
        points[3 * i + 2] = p.z;
    }
    f.material = material;
    f.angular_velocity = spin;
    f.temperature = (gs4_real)temperature;
    symmetry_add_points(w, points, count, (gs4_real)1.25e-4, &f);
    free(points);
}

static void symmetry_fill_box(symmetry_world *w, int material, int nx, int ny, int nz)
{
    const double low[3] = { 0, 0, 0 };
    const int n[3] = { nx, ny, nz };
    symmetry_block(w, material, low, n, at(0, 0, 0), at(0, 0, 0), 0);
}

/* A flow without any symmetry of its own. */
static gs4_vec3 symmetry_stir(gs4_vec3 p)
{
    const double x = (double)p.x, y = (double)p.y, z = (double)p.z;
    return at(0.3 + 0.8 * sin(7 * y + 3 * z), -0.2 + 0.6 * sin(5 * x - 4 * z + 1),
              0.1 + 0.7 * cos(6 * x + 5 * y));
}

/* The same, out through an open wall at low x. */
static gs4_vec3 symmetry_leave(gs4_vec3 p)
{
    gs4_vec3 v = symmetry_stir(p);
    v.x -= 3;
    return v;
}

static gs4_vec3 symmetry_stir_fast(gs4_vec3 p)
{
    const gs4_vec3 v = symmetry_stir(p);
    return at(5 * (double)v.x, 5 * (double)v.y, 5 * (double)v.z);
}

static double symmetry_warm(gs4_vec3 p)
{
    return 20 + 15 * sin(6 * (double)p.x - 5 * (double)p.y + 1)
           + 8 * cos(7 * (double)p.z + 3 * (double)p.y);
}

static void symmetry_material(symmetry_world *w, const gs4_material *m)
{
    CHECK_RESULT(w->sim, gs4_add_material(w->sim, m), GS4_OK);
}

/* --- exact flows of the other tests, small ---------------------------------------------------- */

static gs4_vec3 symmetry_shear(gs4_vec3 p)
{
    return at(sin(2 * acos(-1.0) * ((double)p.y - 0.11) / 0.8), 0, 0);
}

static gs4_vec3 symmetry_sound(gs4_vec3 p)
{
    return at(0.05 * sin(2 * acos(-1.0) * ((double)p.x + 0.23) / 0.6), 0, 0);
}

/* Each with GS4 and with symplectic Euler. */
static void symmetry_flow(symmetry_world *w, int n)
{
    enum {
        POISEUILLE,
        SHEAR,
        STOKES,
        COUETTE,
        COLUMN,
        FLIGHT,
        SPIN,
        SOUND
    };
    const int flow = n / 2, periodic = flow == SHEAR || flow == SOUND,
              free = flow == FLIGHT || flow == SPIN;
    /* in free flight the limit of a step is that of the flow: a cell a step, with the fall; the
     * Poiseuille flow takes the default sound speed, which depends on gravity and the domain */
    const gs4_material m = scene_liquid(1000, flow == SOUND || flow == FLIGHT ? 0 : 100,
                                        flow == FLIGHT       ? 0.1
                                        : flow == POISEUILLE ? 0
                                                             : 10);
    gs4_sim_desc d = symmetry_box(free            ? 10
                                  : flow == SOUND ? 6
                                                  : 4,
                                  free ? 9 : 8, free ? 8 : 5, physics_integrators[n % 2]);
    gs4_collider lid;
    int i;
    d.gravity = at(flow == POISEUILLE ? 4 : 0, flow == COLUMN || flow == FLIGHT ? -9.81 : 0, 0);
    for (i = 0; i < 6; i++)
        if (!free && flow != COLUMN && (i / 2 != 1 || periodic)) d.walls[i] = GS4_WALL_PERIODIC;
    if (flow == POISEUILLE || flow == STOKES || flow == COUETTE) d.walls[2] = GS4_WALL_STICK;
    if (flow == POISEUILLE) d.walls[3] = GS4_WALL_STICK;
    /* at a separating wall beside the column it would be rounding that says whether it touches */
    if (flow == COLUMN) d.walls[2] = GS4_WALL_SEPARATE;
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    if (free) {
        gs4_fill f = scene_fill(flow == FLIGHT ? at(0.3, 0.5, -0.2) : at(0, 0, 0));
        f.angular_velocity = flow == SPIN ? at(1, 2, 3) : at(0, 0, 0);
        symmetry_add_particles(w, gs4_sphere(symmetry_place(5.1, 4.6, 4.2), (gs4_real)0.19), &f);
        return;
    }
    if (flow == COUETTE) {
        memset(&lid, 0, sizeof lid);
        lid.shape = gs4_plane(symmetry_place(0, 5, 0), at(0, -1, 0));
        lid.velocity = at(1, 0, 0);
        symmetry_add_collider(w, &lid);
    }
    symmetry_fill_box(w, 0, d.cells[0], flow == COUETTE || flow == COLUMN ? 5 : 8, d.cells[2]);
    if (periodic) symmetry_edit(w, flow == SHEAR ? symmetry_shear : symmetry_sound, NULL);
    if (flow == STOKES) symmetry_edit(w, symmetry_shear, NULL);
}

static void test_symmetry_flows(void)
{
    int n;
    for (n = 0; n < 16; n++) symmetry_check("flow", symmetry_flow, n, 6);
}

/* --- walls ------------------------------------------------------------------------------------ */

/* A box full of liquid that stirs: each kind of wall beside each other. */
static void symmetry_walls(symmetry_world *w, int n)
{
    enum {
        K = GS4_WALL_STICK,
        L = GS4_WALL_SLIP,
        S = GS4_WALL_SEPARATE,
        O = GS4_WALL_OPEN,
        P = GS4_WALL_PERIODIC
    };
    static const int walls[6][6] = { { K, L, S, O, K, S }, { P, P, K, L, S, K },
                                     { L, S, P, P, O, K }, { S, K, L, K, P, P },
                                     { O, K, P, P, L, S }, { S, S, S, L, K, S } };
    const gs4_material m = scene_liquid(1000, 20, 10);
    gs4_sim_desc d = symmetry_box(6, 5, 4, physics_integrators[n / 6 == 2]);
    int i;
    for (i = 0; i < 6; i++) d.walls[i] = (gs4_wall)walls[n % 6][i];
    if (n / 6 == 1) {
        d.rho_inf = (gs4_real)0.8;
        d.rho_inf_spurious = (gs4_real)0.3;
        d.sharp_gradients = 1;
    }
    if (n % 6 == 1 && n / 6 < 2) d.flip_decay_time = INFINITY;
    d.affine = n / 6 == 3;
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_fill_box(w, 0, 6, 5, 4);
    symmetry_edit(w, n % 6 == 4 ? symmetry_leave : symmetry_stir, NULL);
}

static void test_symmetry_walls(void)
{
    int n;
    for (n = 0; n < 24; n++) symmetry_check("walls", symmetry_walls, n, 6);
}

/* --- bodies ----------------------------------------------------------------------------------- */

/* An egg that lies askew. */
static gs4_real symmetry_egg(gs4_vec3 p, void *user)
{
    const gs4_vec3 c = symmetry_place(3.6, 1.7, 3.4);
    const double x = (double)(p.x - c.x), y = (double)(p.y - c.y), z = (double)(p.z - c.z);
    (void)user;
    return (gs4_real)(sqrt(x * x + 1.2 * y * y + 1.5 * z * z + 0.3 * x * y - 0.2 * y * z) - 0.19);
}

/* By gs4_shape_kind; then a slab and a disc, whose faces are flat as far as particles can tell. */
enum {
    SYMMETRY_SLAB = GS4_SHAPE_MESH + 1,
    SYMMETRY_DISC
};

static gs4_shape symmetry_body(int kind)
{
    static const int triangles[3 * 8] = { 0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                          2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5 };
    static gs4_real vertices[3 * 6];
    static const double corner[6][3] = { { 6.5, 1.2, 3.1 }, { 1, 1.4, 3.8 },   { 3.8, 3.5, 3.3 },
                                         { 3.2, -0.5, 3 },  { 3.5, 1.3, 6.5 }, { 3.9, 1.6, 1 } };
    int i;
    for (i = 0; i < 6; i++) {
        const gs4_vec3 p = symmetry_place(corner[i][0], corner[i][1], corner[i][2]);
        vertices[3 * i] = p.x;
        vertices[3 * i + 1] = p.y;
        vertices[3 * i + 2] = p.z;
    }
    switch (kind) {
    case GS4_SHAPE_BOX: return gs4_box(symmetry_place(1.3, 1, 1.4), symmetry_place(6, 3.1, 5.3));
    case GS4_SHAPE_SPHERE: return gs4_sphere(symmetry_place(3.7, 1.2, 3.4), (gs4_real)0.21);
    case GS4_SHAPE_CYLINDER:
        return gs4_cylinder(symmetry_place(1.3, 1.1, 1.2), symmetry_place(6.1, 2, 5.4),
                            (gs4_real)0.15);
    case GS4_SHAPE_PLANE: return gs4_plane(symmetry_place(3.5, 2.9, 3.2), at(0.2, 1, -0.15));
    case GS4_SHAPE_SDF:
        return gs4_sdf(symmetry_egg, NULL, symmetry_place(1, -1, 1), symmetry_place(6, 4, 6));
    case SYMMETRY_SLAB: return gs4_box(symmetry_place(-20, -6, -20), symmetry_place(24, 3.1, 26));
    case SYMMETRY_DISC:
        return gs4_cylinder(symmetry_place(4.1, -6, 3), symmetry_place(4, 3, 3.2), (gs4_real)2);
    default: return gs4_mesh(vertices, 6, triangles, 8);
    }
}

static void symmetry_turn_back(symmetry_world *w)
{
    symmetry_move_collider(w, 0, at(-0.3, 0.1, 0.2), at(-2, 1, 0.5));
}

/* A block falls and slides on a body that moves and turns. */
static void symmetry_bodies(symmetry_world *w, int n)
{
    const int kind = GS4_SHAPE_BOX + n % 8, contact = n / 8 % 3, euler = n / 24;
    const double low[3] = { 2, 3, 2 };
    const int size[3] = { 4, 2, 3 };
    const gs4_material m = scene_liquid(1000, 20, 10);
    gs4_sim_desc d = symmetry_box(8, 7, 7, physics_integrators[euler]);
    gs4_collider c;
    memset(&c, 0, sizeof c);
    d.affine = !euler && (n + n / 8) % 2;
    c.shape = symmetry_body(kind);
    c.contact = (gs4_wall)contact;
    c.friction = (gs4_real)(contact == GS4_WALL_SEPARATE ? 0.3 : 0);
    c.velocity = at(0.4, 0.3, -0.2);
    c.angular_velocity = at(1, -2, 1.5);
    c.pivot = symmetry_place(2.6, 2, 4);
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_add_collider(w, &c);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 0);
    symmetry_edit(w, symmetry_stir, NULL);
    w->half_way = symmetry_turn_back;
}

static void test_symmetry_bodies(void)
{
    int n;
    for (n = 0; n < 48; n++) symmetry_check("bodies", symmetry_bodies, n, 6);
}

/* --- solids ----------------------------------------------------------------------------------- */

/* A solid between walls, on a sticky ball, and a liquid beside it. */
static void symmetry_solids(symmetry_world *w, int n)
{
    const double low[3] = { 1, 2, 0 }, beside[3] = { 4, 3, 1 };
    const int size[3] = { 3, 3, 3 }, other[3] = { 2, 2, 2 };
    gs4_material m = scene_liquid(1000, 2, 20);
    const gs4_material liquid = scene_liquid(800, 5, 20);
    gs4_sim_desc d = symmetry_box(7, 6, 5, physics_integrators[n & 1]);
    gs4_collider c;
    memset(&c, 0, sizeof c);
    d.affine = !(n & 1) && n / 2 % 2;
    c.shape = gs4_sphere(symmetry_place(2.4, 0.6, 1.7), (gs4_real)0.16);
    c.contact = n & 2 ? GS4_WALL_SEPARATE : GS4_WALL_STICK;
    c.friction = (gs4_real)(n & 2 ? 0.4 : 0);
    c.angular_velocity = at(1, -2, 1.5);
    c.pivot = symmetry_place(2.6, 2, 4);
    m.solid = n / 2 % 3 == 0 ? GS4_NEO_HOOKEAN : GS4_FIXED_COROTATED;
    m.shear_modulus = 3e4;
    if (n / 2 % 3 == 2) {
        m.yield_compression = (gs4_real)0.02;
        m.yield_stretch = (gs4_real)0.01;
    }
    d.walls[0] = d.walls[4] = GS4_WALL_STICK;
    d.walls[3] = GS4_WALL_SEPARATE;
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_material(w, &liquid);
    symmetry_add_collider(w, &c);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(3, -1, 2), 0);
    if (n / 6 == 0) symmetry_block(w, 1, beside, other, at(-1, 0, 0.3), at(0, 0, 0), 0);
    if (n / 6 == 1) symmetry_edit(w, symmetry_stir_fast, NULL);
}

static void test_symmetry_solids(void)
{
    int n;
    for (n = 0; n < 12; n++) symmetry_check("solids", symmetry_solids, n, 12);
}

/* --- stress ----------------------------------------------------------------------------------- */

/* Oldroyd-B and extended Pom-Pom, resolved and by the split. */
static void symmetry_stress(symmetry_world *w, int n)
{
    const double low[3] = { 0, 1, 1 };
    const int size[3] = { 2, 2, 3 };
    const int split = n / 2 % 2;
    gs4_material m = scene_liquid(1000, 40, 10);
    gs4_sim_desc d = symmetry_box(6, 5, 4, physics_integrators[n / 4 == 2]);
    d.sharp_gradients = n / 4 == 1;
    m.liquid = n % 2 ? GS4_POM_POM : GS4_OLDROYD_B;
    m.local_fraction = (gs4_real)0.3;
    m.relaxation_time = (gs4_real)(split ? 1e-3 : 0.05);
    if (n % 2) {
        m.stretch_time = (gs4_real)(split ? 3e-4 : 0.02);
        m.anisotropy = (gs4_real)0.3;
        m.arms = 4;
    }
    d.walls[0] = GS4_WALL_STICK;
    d.walls[5] = GS4_WALL_STICK;
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 0);
    symmetry_edit(w, symmetry_stir_fast, NULL);
}

static void test_symmetry_stress(void)
{
    int n;
    for (n = 0; n < 12; n++)
        if (n / 2 != 3) symmetry_check("stress", symmetry_stress, n, 4);
}

/* --- heat ------------------------------------------------------------------------------------- */

static gs4_real symmetry_thinning(gs4_real temperature, gs4_real shear_rate, void *user)
{
    (void)user;
    return (gs4_real)((60 - (double)temperature / 2) / (1 + 0.05 * (double)shear_rate));
}

/* Fourier, Cattaneo, both, with and without melting; isothermal walls, air, bodies. */
static void symmetry_heat(symmetry_world *w, int n)
{
    const int around = n / 4 % 3, flux = n % 4;
    const double low[3] = { 0, 1, 1 };
    const int size[3] = { 5, 3, 3 };
    gs4_material m = scene_liquid(1000, 40, 10);
    gs4_sim_desc d = symmetry_box(7, 6, 5, physics_integrators[n / 12]);
    gs4_collider c;
    memset(&c, 0, sizeof c);
    m.heat_capacity = 1;
    m.conductivity = 500;
    m.viscous_heating = 1;
    m.flux_relaxation_time = (gs4_real)(flux ? 0.02 : 0);
    m.fourier_fraction = (gs4_real)(flux == 2 ? 0.3 : 0);
    if (flux == 1) {
        m.viscosity_law = GS4_VISCOSITY_CALLBACK;
        m.viscosity_fn = symmetry_thinning;
    }
    if (flux == 3) {
        m.can_melt = 1;
        m.melting_temperature = 22;
        m.latent_heat = 3;
        m.solid = GS4_NEO_HOOKEAN;
        m.shear_modulus = 1e4;
    }
    d.solver_tolerance = (gs4_real)(sizeof(gs4_real) == 8 ? 1e-12 : 1e-6);
    d.walls[0] = GS4_WALL_STICK;
    d.ambient_temperature = 5;
    if (around == 0) {
        d.wall_is_isothermal[0] = d.wall_is_isothermal[4] = 1;
        d.wall_temperature[0] = 50;
        d.wall_temperature[4] = -10;
    }
    if (around == 2) {
        d.walls[0] = GS4_WALL_OPEN;
        d.walls[2] = d.walls[3] = GS4_WALL_PERIODIC;
    }
    d.air_is_isothermal = around == 1;
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    if (around < 2) {
        c.shape = gs4_box(symmetry_place(1.2, 3.9, 0.7), symmetry_place(4.1, 5.3, 3.6));
        c.contact = around ? GS4_WALL_STICK : GS4_WALL_SLIP;
        c.is_isothermal = 1;
        c.temperature = 70;
        symmetry_add_collider(w, &c);
    }
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 20);
    symmetry_edit(w, symmetry_stir, symmetry_warm);
}

static void test_symmetry_heat(void)
{
    int n;
    for (n = 0; n < 24; n++) symmetry_check("heat", symmetry_heat, n, 6);
}

/* --- emitters --------------------------------------------------------------------------------- */

static void symmetry_travel_on(symmetry_world *w)
{
    symmetry_move_emitter(w, 0, at(0.6, -0.5, -1.2));
}

/* What leaves a nozzle on its way, onto a block below it. */
static void symmetry_emitters(symmetry_world *w, int n)
{
    const double low[3] = { 1, 0, 2 };
    const int size[3] = { 4, 2, 3 };
    const gs4_material m = scene_liquid(1000, 20, 20), n2 = scene_liquid(700, 40, 15);
    const gs4_sim_desc d = symmetry_box(8, 7, 7, physics_integrators[n & 1]);
    gs4_emitter e;
    memset(&e, 0, sizeof e);
    e.shape = n & 2 ? gs4_box(symmetry_place(2.1, 4.1, 2.7), symmetry_place(4.1, 6.1, 4.2))
                    : gs4_sphere(symmetry_place(3.4, 4.8, 3.3), (gs4_real)0.1);
    e.fill.material = 1;
    e.fill.velocity = at(4.3, -5.1, 3.2);
    e.travel = at(-1.1, 0.7, 0.6);
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_material(w, &n2);
    symmetry_add_emitter(w, &e);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 0);
    symmetry_edit(w, symmetry_stir, NULL);
    w->half_way = symmetry_travel_on;
}

static void test_symmetry_emitters(void)
{
    int n;
    for (n = 0; n < 4; n++) symmetry_check("emitters", symmetry_emitters, n, 12);
}

/* --- filling ---------------------------------------------------------------------------------- */

/* Particles on the lattice in each shape, turning about its midst. */
static void symmetry_fills(symmetry_world *w, int n)
{
    static const gs4_shape_kind kinds[4] = { GS4_SHAPE_BOX, GS4_SHAPE_CYLINDER, GS4_SHAPE_SDF,
                                             GS4_SHAPE_MESH };
    const gs4_material m = scene_liquid(1000, 20, 10);
    const gs4_sim_desc d = symmetry_box(8, 6, 7, physics_integrators[n & 1]);
    gs4_fill f = scene_fill(at(0.2, 0.4, -0.3));
    f.angular_velocity = at(3, -1, 2);
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_add_particles(w, symmetry_body(kinds[n]), &f);
}

static void test_symmetry_fills(void)
{
    int n;
    for (n = 0; n < 4; n++) symmetry_check("fills", symmetry_fills, n, 4);
}

/* --- all at once ------------------------------------------------------------------------------ */

/* A solid that melts between two bodies, an Oldroyd-B liquid from a nozzle, a seam. */
static void symmetry_all(symmetry_world *w, int n)
{
    const double low[3] = { 1, 2, 0 };
    const int size[3] = { 4, 2, 3 };
    gs4_material m = scene_liquid(1000, 10, 20), melt;
    gs4_sim_desc d = symmetry_box(7, 8, 5, physics_integrators[n]);
    gs4_collider c;
    gs4_emitter e;
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    d.walls[0] = GS4_WALL_OPEN;
    d.walls[1] = GS4_WALL_SEPARATE;
    d.walls[4] = d.walls[5] = GS4_WALL_PERIODIC;
    d.wall_is_isothermal[1] = d.air_is_isothermal = 1;
    d.wall_temperature[1] = 40;
    d.ambient_temperature = 5;
    d.solver_tolerance = (gs4_real)(sizeof(gs4_real) == 8 ? 1e-12 : 1e-6);
    if (n == 0) d.rho_inf = d.rho_inf_spurious = (gs4_real)0.5;
    m.heat_capacity = 1;
    m.conductivity = 300;
    m.viscous_heating = 1;
    melt = m;
    m.can_melt = 1;
    m.melting_temperature = 21;
    m.latent_heat = 3;
    m.solid = GS4_FIXED_COROTATED;
    m.shear_modulus = 1e4;
    m.yield_stretch = (gs4_real)0.01;
    melt.liquid = GS4_OLDROYD_B;
    melt.local_fraction = (gs4_real)0.4;
    melt.relaxation_time = (gs4_real)0.05;
    melt.flux_relaxation_time = (gs4_real)0.02;
    c.shape =
        gs4_cylinder(symmetry_place(2, -0.4, 1.3), symmetry_place(5, 0.3, 3.2), (gs4_real)0.18);
    c.contact = GS4_WALL_STICK;
    c.angular_velocity = at(1, -2, 1.5);
    c.velocity = at(0.2, 0, 0.1);
    c.pivot = symmetry_place(3, 2, 1);
    c.is_isothermal = 1;
    c.temperature = 60;
    e.shape = gs4_sphere(symmetry_place(3.3, 6.1, 2.4), (gs4_real)0.1);
    e.fill.material = 1;
    e.fill.velocity = at(1.3, -5.1, 2.2);
    e.fill.temperature = 30;
    e.travel = at(-0.7, 0.1, 0.6);
    symmetry_create(w, &d);
    symmetry_material(w, &m);
    symmetry_material(w, &melt);
    symmetry_add_collider(w, &c);
    c.shape = gs4_box(symmetry_place(4.2, 1.1, 0.8), symmetry_place(6.2, 3.3, 2.9));
    c.contact = GS4_WALL_SEPARATE;
    c.friction = (gs4_real)0.3;
    c.is_isothermal = 0;
    symmetry_add_collider(w, &c);
    symmetry_add_emitter(w, &e);
    symmetry_block(w, 0, low, size, at(0, 0, 0), at(0, 0, 0), 20);
    symmetry_edit(w, symmetry_stir, symmetry_warm);
}

static void test_symmetry_all(void)
{
    int n;
    for (n = 0; n < (test_full ? 2 : 1); n++) symmetry_check("all", symmetry_all, n, 12);
}

/* --- without a simulation --------------------------------------------------------------------- */

enum {
    SYMMETRY_CELLS = 10 * 7 * 6
};
typedef struct symmetry_problem {
    gs4_real face[3][SYMMETRY_CELLS + 63], kind[SYMMETRY_CELLS], diagonal[SYMMETRY_CELLS],
        rhs[SYMMETRY_CELLS], x[SYMMETRY_CELLS];
} symmetry_problem;

/* Copies what cells have (faces -1), or the faces along an axis of the image, of which there is
 * one more: from a scene of n cells to its image, or back. */
static void symmetry_copy(const symmetry_map *m, const int n[3], int faces, gs4_real *scene,
                          gs4_real *image, int back)
{
    int size[3], to[3], i, *at_image[3], at_scene[3];
    for (i = 0; i < 3; i++) {
        size[m->axis[i]] = n[m->axis[i]] + (i == faces);
        at_image[i] = &to[i];
    }
    for (to[2] = 0; to[2] < size[m->axis[2]]; to[2]++)
        for (to[1] = 0; to[1] < size[m->axis[1]]; to[1]++)
            for (to[0] = 0; to[0] < size[m->axis[0]]; to[0]++, image++) {
                gs4_real *from;
                for (i = 0; i < 3; i++)
                    at_scene[m->axis[i]] =
                        m->sign[i] > 0 ? *at_image[i] : size[m->axis[i]] - 1 - *at_image[i];
                from = scene + (at_scene[2] * size[1] + at_scene[1]) * size[0] + at_scene[0];
                if (back)
                    *from = *image;
                else
                    *image = *from;
            }
}

/* One cell in 8 is solid, one air; one face in 16 is closed; what the diagonal adds keeps the
 * condition number below some 100. */
static void symmetry_pose(symmetry_problem *p)
{
    int i, a;
    for (i = 0; i < SYMMETRY_CELLS; i++) {
        const double r = fabs(symmetry_noise(i));
        p->kind[i] = (gs4_real)(r < 0.125  ? GS4_CELL_SOLID
                                : r < 0.25 ? GS4_CELL_AIR
                                           : GS4_CELL_LIQUID);
        p->diagonal[i] = (gs4_real)(r / 2);
        p->rhs[i] = (gs4_real)symmetry_noise(i + 1000);
        p->x[i] = (gs4_real)(r < 0.25 ? symmetry_noise(i + 2000) : 0);
    }
    for (a = 0; a < 3; a++)
        for (i = 0; i < SYMMETRY_CELLS + 63; i++) {
            const double r = fabs(symmetry_noise(i + 3000 + 1000 * a));
            p->face[a][i] = (gs4_real)(r < 1.0 / 16 ? 0 : r);
        }
}

/* A masked problem through a map. */
static void symmetry_solve(const symmetry_map *m, gs4_real *x)
{
    static symmetry_problem p, q;
    static uint8_t kind[SYMMETRY_CELLS];
    const int n[3] = { 9, 7, 6 };
    gs4_poisson *solver = NULL;
    gs4_poisson_desc d;
    int i;
    memset(&d, 0, sizeof d);
    symmetry_pose(&p);
    symmetry_copy(m, n, -1, p.kind, q.kind, 0);
    symmetry_copy(m, n, -1, p.diagonal, q.diagonal, 0);
    symmetry_copy(m, n, -1, p.rhs, q.rhs, 0);
    symmetry_copy(m, n, -1, p.x, q.x, 0);
    for (i = 0; i < 3; i++) {
        symmetry_copy(m, n, i, p.face[m->axis[i]], q.face[i], 0);
        d.coefficient[i] = q.face[i];
        d.cells[i] = n[m->axis[i]];
    }
    for (i = 0; i < n[0] * n[1] * n[2]; i++) kind[i] = (uint8_t)q.kind[i];
    d.cell_size = (gs4_real)0.5;
    d.kind = kind;
    d.diagonal = q.diagonal;
    d.tolerance = (gs4_real)(sizeof(gs4_real) == 8 ? 1e-12 : 1e-6);
    CHECK_RESULT(NULL, gs4_poisson_create(&d, &solver), GS4_OK);
    CHECK_RESULT(NULL, gs4_poisson_solve(solver, q.rhs, q.x, NULL), GS4_OK);
    gs4_poisson_destroy(solver);
    symmetry_copy(m, n, -1, x, q.x, 1);
}

/* The elliptic solver: to its tolerance times the condition number. */
static void test_symmetry_poisson(void)
{
    static gs4_real x[SYMMETRY_CELLS], y[SYMMETRY_CELLS];
    symmetry_map m = symmetry_element(0);
    double most = 0, worst = 0;
    int i, k;
    symmetry_solve(&m, x);
    for (k = 1; k < 48; k++) {
        m = symmetry_element(k);
        symmetry_solve(&m, y);
        for (i = 0; i < 9 * 7 * 6; i++) {
            most = fmax(most, fabs((double)x[i]));
            worst = fmax(worst, fabs((double)(x[i] - y[i])));
        }
    }
    if (test_filter[0]) printf("%.1e of %.1e ", worst, most);
    CHECK(most > 0);
    CHECK(worst <= (sizeof(gs4_real) == 8 ? 1e-10 : 1e-4) * most);
}

/* One material point through a map, three steps in a flow that strains and turns: its stress and
 * its deformation gradient in the coordinates of the scene. */
static void symmetry_point(const symmetry_map *m, const gs4_material *law, double out[15])
{
    static const int symmetric[6][2] = {
        { 0, 0 }, { 1, 1 }, { 2, 2 }, { 0, 1 }, { 0, 2 }, { 1, 2 }
    };
    static const double gradient[9] = { 1.3, -2.1, 0.7, 0.4, 0.9, 3.1, -1.7, 0.6, -2.4 },
                        stress[6] = { 30, -10, 20, 14, -9, 6 };
    gs4_real L[9], s[6];
    gs4_point p;
    int i, j, k;
    memset(&p, 0, sizeof p);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            L[3 * i + j] =
                (gs4_real)(m->sign[i] * m->sign[j] * gradient[3 * m->axis[i] + m->axis[j]]);
    for (k = 0; k < 6 && law->liquid != GS4_NEWTONIAN; k++) {
        const int a = m->axis[symmetric[k][0]], b = m->axis[symmetric[k][1]];
        const int sign = m->sign[symmetric[k][0]] * m->sign[symmetric[k][1]];
        p.stress[k] = (gs4_real)(sign * stress[a == b ? a : a + b + 2]);
    }
    for (k = 0; k < 3; k++)
        CHECK_RESULT(NULL, gs4_point_step(law, &p, L, (gs4_real)0.01, (gs4_real)0.5, 0), GS4_OK);
    CHECK_RESULT(NULL, gs4_point_stress(law, &p, L, s), GS4_OK);
    symmetry_value_back(m, s, 6, out);
    symmetry_value_back(m, p.deformation, 9, out + 6);
}

static void test_symmetry_points(void)
{
    double a[15], b[15];
    int law, k, i;
    for (law = 0; law < 6; law++) {
        gs4_material m = scene_liquid(1000, 40, 10);
        symmetry_map map = symmetry_element(0);
        double most[2] = { 0, 0 }, worst[2] = { 0, 0 };
        if (law < 4) {
            m.liquid = law % 2 ? GS4_POM_POM : GS4_OLDROYD_B;
            m.local_fraction = (gs4_real)0.3;
            m.relaxation_time = (gs4_real)(law < 2 ? 0.1 : 0.003);
            m.stretch_time = (gs4_real)(law < 2 ? 0.03 : 0.001);
            m.anisotropy = (gs4_real)(law % 2 ? 0.3 : 0);
            m.arms = (gs4_real)(law % 2 ? 4 : 0);
            if (law % 2 == 0) m.stretch_time = 0;
        } else {
            m.solid = law == 4 ? GS4_NEO_HOOKEAN : GS4_FIXED_COROTATED;
            m.shear_modulus = 1000;
            m.yield_stretch = (gs4_real)(law == 4 ? 0 : 0.02);
        }
        symmetry_point(&map, &m, a);
        for (k = 1; k < 48; k++) {
            map = symmetry_element(k);
            symmetry_point(&map, &m, b);
            for (i = 0; i < 15; i++) {
                most[i >= 6] = fmax(most[i >= 6], fabs(a[i]));
                worst[i >= 6] = fmax(worst[i >= 6], fabs(a[i] - b[i]));
            }
        }
        if (test_filter[0]) printf("%.1e %.1e, ", worst[0] / most[0], worst[1]);
        CHECK(worst[0] <= symmetry_rounding() * most[0] && most[0] > 0);
        CHECK(worst[1] <= symmetry_rounding());
    }
}

static void run_symmetry(void)
{
    RUN_FULL(test_symmetry_flows);
    RUN_FULL(test_symmetry_walls);
    RUN_FULL(test_symmetry_bodies);
    RUN_FULL(test_symmetry_solids);
    RUN_FULL(test_symmetry_stress);
    RUN_FULL(test_symmetry_heat);
    RUN_FULL(test_symmetry_emitters);
    RUN_ONCE(test_symmetry_fills);
    RUN_ONCE(test_symmetry_all);
    RUN_ONCE(test_symmetry_poisson);
    RUN_ONCE(test_symmetry_points);
}
