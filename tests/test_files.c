/* Memory that is refused, files that are damaged, places that cannot be written to. Run all with
 * run_files(). Files go to a folder of their own below TMPDIR or /tmp, which is removed at the
 * end. */
#if defined(__unix__) || defined(__APPLE__)
#include <sys/resource.h>
#include <sys/stat.h>
#include <signal.h>
#include <sys/wait.h>
#include <dirent.h>
#include <unistd.h>
#define FILES_UNIX 1
#ifndef __STRICT_ANSI__
#define FILES_LINKS 1 /* where unistd.h declares them */
#endif
#endif

/* --- memory that can be refused --------------------------------------------------------------- */

typedef struct files_memory {
    long calls;        /* asked so far */
    long fail_at;      /* the call, from 0, that is refused; -1: none */
    int from_there_on; /* that and all after it */
    /* blocks now; blocks given back with another size, or misaligned requests */
    long live, wrong;
    size_t bytes, most; /* now, and at most */
} files_memory;

typedef struct files_block {
    void *raw;
    size_t bytes;
} files_block;

static void *files_alloc(size_t bytes, size_t alignment, void *user)
{
    files_memory *m = (files_memory *)user;
    const long call = m->calls++;
    files_block b;
    char *p;
    if (m->fail_at >= 0 && (call == m->fail_at || (m->from_there_on && call > m->fail_at)))
        return NULL;
    if (bytes == 0 || alignment == 0 || (alignment & (alignment - 1))) m->wrong++;
    b.raw = malloc(bytes + 2 * alignment + sizeof b);
    b.bytes = bytes;
    if (!b.raw) return NULL;
    p = (char *)b.raw + sizeof b;
    p += alignment - (size_t)((uintptr_t)p & (alignment - 1));
    memcpy(p - sizeof b, &b, sizeof b);
    memset(p, 0xcd, bytes); /* zeroed is for the library to do */
    m->live++;
    m->bytes += bytes;
    if (m->bytes > m->most) m->most = m->bytes;
    return p;
}

static void files_free(void *memory, size_t bytes, void *user)
{
    files_memory *m = (files_memory *)user;
    files_block b;
    memcpy(&b, (char *)memory - sizeof b, sizeof b);
    if (b.bytes != bytes) m->wrong++;
    m->live--;
    m->bytes -= b.bytes;
    memset(memory, 0xdd, b.bytes);
    free(b.raw);
}

/* --- a folder --------------------------------------------------------------------------------- */

static char files_folder[200];

static const char *files_path(const char *name)
{
    static char path[4][600];
    static int turn;
    turn = (turn + 1) % 4;
    sprintf(path[turn], "%.190s%.300s", files_folder, name);
    return path[turn];
}

static void files_begin(void)
{
#ifdef FILES_UNIX
    const char *base = getenv("TMPDIR");
    int i;
    for (i = 0; i < 1000; i++) {
        sprintf(files_folder, "%.150s/gs4test_%ld_%d", base && *base ? base : "/tmp",
                (long)getpid(), i);
        if (mkdir(files_folder, 0755) == 0) {
            strcat(files_folder, "/");
            return;
        }
    }
#endif
    strcpy(files_folder, "");
}

static void files_end(void)
{
#ifdef FILES_UNIX
    if (!files_folder[0]) return;
    files_folder[strlen(files_folder) - 1] = 0;
    /* fails when a test, or the library, has left something there */
    CHECK(rmdir(files_folder) == 0);
#endif
}

static int files_exists(const char *path)
{
    FILE *f = fopen(path, "rb");
    if (f) fclose(f);
    return f != NULL;
}

/* Does a file that was being written lie in the folder of the tests? */
static int files_leftover(void)
{
    int found = 0;
#ifdef FILES_UNIX
    DIR *folder = opendir(files_folder);
    struct dirent *entry;
    while (folder && (entry = readdir(folder))) found |= strncmp(entry->d_name, "gs4mpm-", 7) == 0;
    if (folder) closedir(folder);
#endif
    return found;
}

static unsigned char *files_read(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    unsigned char *data = NULL;
    long n;
    *size = 0;
    if (!f) return NULL;
    fseek(f, 0, SEEK_END);
    n = ftell(f);
    rewind(f);
    if (n >= 0) data = (unsigned char *)malloc((size_t)n + 1);
    if (data) {
        *size = fread(data, 1, (size_t)n, f);
        data[*size] = 0;
    }
    fclose(f);
    return data;
}

static void files_write(const char *path, const void *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    CHECK(f != NULL);
    if (!f) return;
    CHECK(size == 0 || fwrite(data, 1, size, f) == size);
    fclose(f);
}

/* --- the scene -------------------------------------------------------------------------------- */

static const int files_triangles[36] = { 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                         2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5 };
static gs4_real files_cube[2][24];

static void files_make_cube(gs4_real v[24], gs4_vec3 low, double side)
{
    int i;
    for (i = 0; i < 8; i++) {
        v[3 * i] = low.x + (gs4_real)(i & 1 ? side : 0);
        v[3 * i + 1] = low.y + (gs4_real)(i & 2 ? side : 0);
        v[3 * i + 2] = low.z + (gs4_real)(i & 4 ? side : 0);
    }
}

/* Whether the scene has heat, and with it all that a particle can carry: a solid that melts, its
 * liquid viscoelastic; a flux that lags; a hot body, mouth and wall. */
static int files_warm;

static void files_warm_material(gs4_material *m, int which)
{
    if (!files_warm) return;
    m->heat_capacity = 1000;
    m->conductivity = (gs4_real)(which == 2 ? 0 : 100);
    m->viscous_heating = which == 4;
    if (which == 0 || which == 3) {
        m->can_melt = 1;
        m->melting_temperature = 5;
        m->latent_heat = 500;
        m->solid = GS4_FIXED_COROTATED;
        m->shear_modulus = 1000;
    }
    if (which == 1 || which == 3) {
        m->liquid = GS4_OLDROYD_B;
        m->local_fraction = (gs4_real)0.5;
        m->relaxation_time = (gs4_real)0.1;
    }
    if (which == 1 || which == 5) {
        m->flux_relaxation_time = (gs4_real)0.01;
        m->fourier_fraction = (gs4_real)0.3;
    }
}

static gs4_sim_desc files_desc(int euler)
{
    gs4_sim_desc d = scene_cube(8);
    d.gravity = at(0, 0, -10);
    d.walls[1] = GS4_WALL_SEPARATE;
    d.walls[2] = d.walls[3] = GS4_WALL_PERIODIC;
    d.walls[5] = GS4_WALL_OPEN;
    if (euler)
        d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    else {
        d.rho_inf = (gs4_real)0.6;
        d.rho_inf_spurious = (gs4_real)0.2;
        d.sharp_gradients = !files_warm;
        d.affine = files_warm;
    }
    if (files_warm) {
        d.wall_is_isothermal[0] = d.air_is_isothermal = 1;
        d.wall_temperature[0] = 50;
        d.ambient_temperature = -3;
    }
    return d;
}

enum {
    FILES_MATERIALS = 6,
    FILES_STAGES = 15
};

/* One stage of making the scene; each is all or nothing. */
static int files_build(gs4_sim *sim, int stage)
{
    gs4_material m = scene_liquid(1000, 0.1, 6);
    gs4_fill f = scene_fill(at(0.5, 0, -1));
    gs4_collider c;
    gs4_emitter e;
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    files_make_cube(files_cube[0], at(0.5, 0.5, 0.5), 0.25);
    files_make_cube(files_cube[1], at(0.7, 0.1, -0.05), 0.2);
    c.pivot = at(0.8, 0.2, 0.05);
    c.temperature = 40;
    c.is_isothermal = files_warm;
    f.temperature = (gs4_real)(files_warm ? -2 : 0);
    switch (stage) {
    case 0:
    case 1:
    case 2:
    case 3:
    case 4:
    case 5:
        m.density = (gs4_real)(1000 + 100 * stage);
        files_warm_material(&m, stage);
        return gs4_add_material(sim, &m);
    case 6:
        return gs4_add_particles(sim, gs4_box(at(0.125, 0.125, 0.125), at(0.375, 0.375, 0.375)),
                                 &f);
    case 7:
        f.material = files_warm ? 3 : 1;
        f.velocity = at(-1, 0.5, 0);
        return gs4_add_particles(sim, gs4_mesh(files_cube[0], 8, files_triangles, 12), &f);
    case 8:
        c.shape = gs4_mesh(files_cube[1], 8, files_triangles, 12);
        c.angular_velocity = at(0, 0, 1);
        return gs4_add_collider(sim, &c);
    case 9:
        c.shape = gs4_sphere(at(0.2, 0.8, 0.1), (gs4_real)0.15);
        c.contact = GS4_WALL_SEPARATE;
        c.friction = (gs4_real)0.2;
        c.velocity = at(0.1, 0, 0);
        return gs4_add_collider(sim, &c);
    case 10:
        e.shape = gs4_box(at(0.25, 0.25, 0.8), at(0.5, 0.5, 0.9));
        e.fill = f;
        e.fill.temperature *= -8;
        e.fill.velocity = at(0, 0, -1);
        e.travel = at(0.2, 0, 0);
        return gs4_add_emitter(sim, &e);
    case 11:
        e.shape = gs4_sphere(at(0.7, 0.6, 0.9), (gs4_real)0.08);
        e.fill = f;
        e.fill.velocity = at(0, 0.3, -1.5);
        e.start = (gs4_real)0.01;
        return gs4_add_emitter(sim, &e);
    case 12: c.shape = gs4_box(at(0, 0, 0), at(0.1, 0.1, 0.1)); return gs4_add_collider(sim, &c);
    case 13:
        c.shape = gs4_plane(at(0, 0, 0.02), at(0.1, 0, 1));
        c.contact = GS4_WALL_SLIP;
        return gs4_add_collider(sim, &c);
    default: {
        const gs4_real x[6] = { (gs4_real)0.5,  (gs4_real)0.5, (gs4_real)0.4,
                                (gs4_real)0.55, (gs4_real)0.5, (gs4_real)0.4 };
        f.material = 5;
        return gs4_add_points(sim, x, 2, (gs4_real)1e-4, &f);
    }
    }
}

static gs4_sim *files_scene(const gs4_sim_desc *d)
{
    gs4_sim *sim = NULL;
    int stage;
    CHECK(gs4_create(d, &sim) == GS4_OK);
    for (stage = 0; stage < FILES_STAGES; stage++) CHECK_RESULT(sim, files_build(sim, stage), 0);
    return sim;
}

static int files_steps(gs4_sim *sim, int count)
{
    int i, r = GS4_OK;
    for (i = 0; i < count && r == GS4_OK; i++) {
        const gs4_real limit = gs4_stable_dt(sim);
        r = gs4_step(sim, (gs4_real)0.5 * (limit < (gs4_real)0.01 ? limit : (gs4_real)0.01));
    }
    return r;
}

/* --- memory refused at every place ------------------------------------------------------------ */

enum {
    FILES_RUN = 5
}; /* steps of the scenario */

/* A collider at any speed that is accepted leaves numbers, of which the next step and gs4_load
 * know what to do. */
static void test_files_fast_collider(void)
{
    const double speeds[2] = { sizeof(gs4_real) == 8 ? 1e45 : 1e14,
                               sizeof(gs4_real) == 8 ? 1e90 : 1e16 };
    int i, k;
    for (k = 0; k < 2; k++) {
        gs4_sim_desc d = scene_cube(8);
        const gs4_material m = scene_liquid(1000, 0, 10);
        const gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_collider c;
        gs4_sim *sim = NULL;
        memset(&c, 0, sizeof c);
        d.cell_size = (gs4_real)0.125;
        c.shape = gs4_sphere(at(0.5, 0.5, 0.2), (gs4_real)0.2);
        c.contact = GS4_WALL_SLIP;
        c.velocity = at(speeds[k], 0, speeds[k]);
        CHECK(gs4_create(&d, &sim) == GS4_OK);
        CHECK(gs4_add_material(sim, &m) == 0);
        CHECK(gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.75, 0.75, 0.75)), &f) > 0);
        CHECK(gs4_add_collider(sim, &c) == 0);
        for (i = 0; i < 3; i++) {
            CHECK_RESULT(sim, gs4_step(sim, gs4_stable_dt(sim) / 2), GS4_OK);
            CHECK_RESULT(sim, gs4_save(sim, files_path("fast.sav")), GS4_OK);
            CHECK_RESULT(sim, gs4_load(sim, files_path("fast.sav")), GS4_OK);
        }
        gs4_destroy(sim);
    }
    remove(files_path("fast.sav"));
}

/* The grid is long, so that what is loaded may be out of reach of what was there. */
static gs4_sim_desc files_long_desc(int euler)
{
    gs4_sim_desc d = files_desc(euler);
    d.cells[0] = 32;
    return d;
}

/* One more thing to do, numbered on from the stages of files_build. */
static int files_do(gs4_sim *sim, int stage)
{
    if (stage < FILES_STAGES) return files_build(sim, stage);
    stage -= FILES_STAGES;
    if (stage < FILES_RUN) return files_steps(sim, 1);
    switch (stage - FILES_RUN) {
    case 0: return gs4_save(sim, files_path("memory.sav"));
    case 1: return gs4_write_ply(sim, files_path("memory.ply"));
    case 2: return gs4_write_raw(sim, files_path("memory.npy"));
    /* more particles, in more blocks */
    case 3: return gs4_load(sim, files_path("memory_late.sav"));
    case 4: return files_steps(sim, 1);
    case 5: return gs4_load(sim, files_path("memory.sav")); /* fewer again */
    default: return files_steps(sim, 1);
    }
}
enum {
    FILES_ALL = FILES_STAGES + FILES_RUN + 7
};

/* The whole scenario with one refusal; what was refused is done again. Returns the hash at the
 * end. */
static uint64_t files_scenario(int euler, files_memory *m, long fail_at, int from_there_on,
                               long *refused)
{
    gs4_sim_desc d = files_long_desc(euler);
    gs4_sim *sim = NULL;
    gs4_stats stats;
    uint64_t hash = 0, before;
    int stage, r;
    memset(m, 0, sizeof *m);
    m->fail_at = fail_at;
    m->from_there_on = from_there_on;
    d.allocator.alloc_fn = files_alloc;
    d.allocator.free_fn = files_free;
    d.allocator.user = m;
    *refused = 0;
    r = gs4_create(&d, &sim);
    if (r != GS4_OK) {
        CHECK(r == GS4_ERROR_MEMORY && sim == NULL && m->live == 0 && m->bytes == 0
              && gs4_last_error(NULL)[0]);
        ++*refused;
        m->fail_at = -1;
        CHECK(gs4_create(&d, &sim) == GS4_OK);
    }
    for (stage = 0; stage < FILES_ALL && sim; stage++) {
        before = gs4_state_hash(sim);
        r = files_do(sim, stage);
        if (r >= 0) continue;
        ++*refused;
        if (r != GS4_ERROR_MEMORY || !gs4_last_error(sim)[0] || gs4_state_hash(sim) != before) {
            char line[200];
            sprintf(line, "call %ld refused%s, integrator %d, stage %d: %d, hash %s", fail_at,
                    from_there_on ? " and all after it" : "", euler, stage, r,
                    gs4_state_hash(sim) == before ? "as before" : "changed");
            test_report(0, __FILE__, __LINE__, line);
        } else
            test_passed++;
        CHECK(!files_leftover());
        m->fail_at = -1;
        /* and the same again, now that there is memory */
        CHECK_RESULT(sim, files_do(sim, stage), 0);
    }
    hash = gs4_state_hash(sim);
    /* which asks for memory, and says by that where there is none */
    stats = gs4_get_stats(sim);
    *refused += stats.occupied_volume < 0;
    CHECK(stats.memory_bytes == m->bytes);
    gs4_destroy(sim);
    CHECK(m->live == 0 && m->bytes == 0 && m->wrong == 0);
    return hash;
}

static void test_files_memory(void)
{
    int which;
    for (which = 0; which < 4; which++) {
        const int euler = which % 2, warm = files_warm = which / 2;
        gs4_sim_desc d = files_long_desc(euler);
        gs4_sim *late = files_scene(&d);
        gs4_edit x;
        files_memory m;
        uint64_t reference;
        long calls, k, refused = 0;
        int i;
        CHECK_RESULT(late, files_steps(late, 10), 0);
        x = gs4_edit_particles(late, GS4_FIELD_POSITION);
        /* spread over the rest of the grid */
        for (i = 0; i < x.count; i++)
            x.data[i * x.stride] = (gs4_real)(3.9 - 2.5 * (double)x.data[i * x.stride]);
        CHECK_RESULT(late, files_steps(late, 5), 0);
        CHECK_RESULT(late, gs4_save(late, files_path("memory_late.sav")), 0);
        gs4_destroy(late);
        reference = files_scenario(euler, &m, -1, 0, &refused);
        CHECK(refused == 0);
        calls = m.calls;
        for (k = 0; k < calls; k += test_slow ? 1 : !test_full ? 37 : warm ? 5 : 1) {
            CHECK(files_scenario(euler, &m, k, 0, &refused) == reference);
            CHECK(refused == 1);
            if (k % (!test_full ? 2 : warm ? 4 : 3) && !test_slow) continue;
            CHECK(files_scenario(euler, &m, k, 1, &refused) == reference);
            CHECK(refused == 1);
        }
        remove(files_path("memory.sav"));
        remove(files_path("memory.ply"));
        remove(files_path("memory.npy"));
        remove(files_path("memory_late.sav"));
        files_warm = 0;
    }
}

/* A state somewhere else in the grid, loaded while memory is refused: what the nodes remember
 * here stays. */
static gs4_sim *files_layer(gs4_vec3 high, files_memory *m)
{
    gs4_sim_desc d = scene_cube(24);
    const gs4_material water = scene_liquid(1000, 0, 10);
    const gs4_fill f = scene_fill(at(1, 0, 0));
    gs4_sim *sim = NULL;
    memset(m, 0, sizeof *m);
    m->fail_at = -1;
    d.gravity = at(0, 0, -10);
    d.allocator.alloc_fn = files_alloc;
    d.allocator.free_fn = files_free;
    d.allocator.user = m;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &water), 0);
    CHECK_RESULT(sim, gs4_add_particles(sim, gs4_box(at(0, 0, 0), high), &f), 0);
    CHECK_RESULT(sim, files_steps(sim, 4), 0);
    return sim;
}

static void test_files_load_refused(void)
{
    files_memory m;
    gs4_sim *layer = files_layer(at(1, 1, 0.1), &m);
    uint64_t reference = 0;
    long k;
    CHECK_RESULT(layer, gs4_save(layer, files_path("layer.sav")), 0);
    gs4_destroy(layer);
    for (k = -1; k < 60; k++) {
        gs4_sim *column = files_layer(at(0.1, 0.1, 0.9), &m);
        const uint64_t hash = gs4_state_hash(column);
        int r = GS4_OK;
        if (k >= 0) {
            m.fail_at = m.calls + k;
            r = gs4_load(column, files_path("layer.sav"));
            m.fail_at = -1;
            CHECK(r == GS4_OK || (r == GS4_ERROR_MEMORY && gs4_state_hash(column) == hash));
        }
        if (r == GS4_OK && k >= 0)
            k = 1000;
        else {
            CHECK_RESULT(column, files_steps(column, 5), 0);
            if (k < 0) reference = gs4_state_hash(column);
            /* and it goes on as if nothing had been */
            else
                CHECK(gs4_state_hash(column) == reference);
        }
        gs4_destroy(column);
        CHECK(m.live == 0 && m.wrong == 0);
    }
    CHECK(k > 1000);
    remove(files_path("layer.sav"));
}

/* --- frames ----------------------------------------------------------------------------------- */

static double files_number(const unsigned char *p, const char *type)
{
    float f;
    double d;
    uint32_t u;
    if (!strcmp(type, "float") || !strcmp(type, "<f4")) {
        memcpy(&f, p, 4);
        return (double)f;
    }
    if (!strcmp(type, "double") || !strcmp(type, "<f8")) {
        memcpy(&d, p, 8);
        return d;
    }
    if (!strcmp(type, "uint") || !strcmp(type, "<u4")) {
        memcpy(&u, p, 4);
        return (double)u;
    }
    return (double)*p;
}

static size_t files_size_of(const char *type)
{
    return !strcmp(type, "uchar") || !strcmp(type, "|u1")    ? 1
           : !strcmp(type, "double") || !strcmp(type, "<f8") ? 8
                                                             : 4;
}

/* What column `name`, component c, of particle i must hold; NAN: no such column. */
static double files_expected(const gs4_sim *sim, const char *name, int c, int i)
{
    static const char *const ply[] = { "x", "y", "z", "vx", "vy", "vz" };
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    int k;
    for (k = 0; k < 6; k++)
        if (!strcmp(name, ply[k]))
            return (double)(k < 3 ? x.data[(size_t)i * (size_t)x.stride + (size_t)k]
                                  : v.data[(size_t)i * (size_t)v.stride + (size_t)k - 3]);
    if (!strcmp(name, "position")) return (double)x.data[(size_t)i * (size_t)x.stride + (size_t)c];
    if (!strcmp(name, "velocity")) return (double)v.data[(size_t)i * (size_t)v.stride + (size_t)c];
    if (!strcmp(name, "volume_ratio")) {
        const gs4_view j = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO);
        return (double)j.data[(size_t)i * (size_t)j.stride];
    }
    if (!strncmp(name, "stress_", 7) || !strncmp(name, "flux_", 5) || !strcmp(name, "stress")
        || !strcmp(name, "flux")) {
        static const char *const axes[9] = { "xx", "yy", "zz", "xy", "xz", "yz", "x", "y", "z" };
        const gs4_view s = gs4_particles(sim, name[0] == 's' ? GS4_FIELD_STRESS : GS4_FIELD_FLUX);
        for (k = name[0] == 's' ? 0 : 6; strchr(name, '_') && k < 9; k++)
            if (!strcmp(strchr(name, '_') + 1, axes[k])) c = k % 6;
        return s.data ? (double)s.data[(size_t)i * (size_t)s.stride + (size_t)c] : (double)NAN;
    }
    if (!strncmp(name, "F_", 2) || !strcmp(name, "deformation")) {
        const gs4_view F = gs4_particles(sim, GS4_FIELD_DEFORMATION);
        if (name[0] == 'F') c = 3 * (name[2] - 'x') + (name[3] - 'x');
        return F.data ? (double)F.data[(size_t)i * (size_t)F.stride + (size_t)c] : (double)NAN;
    }
    if (!strcmp(name, "temperature") || !strcmp(name, "liquid_fraction")) {
        const gs4_view T =
            gs4_particles(sim, name[0] == 't' ? GS4_FIELD_TEMPERATURE : GS4_FIELD_LIQUID_FRACTION);
        return T.data ? (double)T.data[(size_t)i * (size_t)T.stride] : (double)NAN;
    }
    if (!strcmp(name, "pressure")) {
        const gs4_view p = gs4_particles(sim, GS4_FIELD_PRESSURE);
        return p.data ? (double)p.data[(size_t)i * (size_t)p.stride] : (double)NAN;
    }
    if (!strcmp(name, "mass")) {
        const gs4_view m = gs4_particles(sim, GS4_FIELD_MASS);
        return (double)m.data[(size_t)i * (size_t)m.stride];
    }
    if (!strcmp(name, "id")) return (double)gs4_particle_ids(sim)[i];
    if (!strcmp(name, "material")) return (double)gs4_particle_materials(sim)[i];
    return (double)NAN;
}

typedef struct files_column {
    char name[40], type[16];
    int numbers;
} files_column;

/* Records behind the header against the views. */
static void files_compare(const gs4_sim *sim, const unsigned char *at_byte, size_t left,
                          const files_column *c, int columns)
{
    const int count = gs4_get_stats((gs4_sim *)(uintptr_t)sim).particles;
    size_t record = 0;
    int i, k, n, wrong = 0;
    for (k = 0; k < columns; k++) record += (size_t)c[k].numbers * files_size_of(c[k].type);
    CHECK(left == record * (size_t)count);
    if (left != record * (size_t)count) return;
    for (i = 0; i < count; i++)
        for (k = 0; k < columns; k++)
            for (n = 0; n < c[k].numbers; n++) {
                const double expected = files_expected(sim, c[k].name, n, i),
                             value = files_number(at_byte, c[k].type);
                wrong += !(value >= expected && value <= expected);
                at_byte += files_size_of(c[k].type);
            }
    CHECK(wrong == 0);
}

static void files_check_ply(const gs4_sim *sim, const char *path)
{
    size_t size;
    unsigned char *data = files_read(path, &size);
    files_column c[32];
    int columns = 0, vertices = -1, found = 0, i, k;
    char *line, *end;
    CHECK(data != NULL && size > 10 && memcmp(data, "ply\n", 4) == 0);
    if (!data) return;
    line = (char *)data + 4;
    CHECK(strncmp(line, "format binary_little_endian 1.0\n", 32) == 0);
    while ((end = strchr(line, '\n')) != NULL && columns < 32) {
        *end = 0;
        if (strcmp(line, "end_header") == 0) {
            found = 1;
            break;
        }
        if (strncmp(line, "element", 7) == 0)
            CHECK(sscanf(line, "element vertex %d", &vertices) == 1);
        if (strncmp(line, "property", 8) == 0) {
            CHECK(sscanf(line, "property %15s %39s", c[columns].type, c[columns].name) == 2);
            c[columns++].numbers = 1;
        }
        line = end + 1;
    }
    CHECK(found && vertices == gs4_get_stats((gs4_sim *)(uintptr_t)sim).particles);
    for (i = 0; i < columns; i++)
        for (k = 0; k < i; k++) CHECK(strcmp(c[i].name, c[k].name) != 0);
    CHECK(columns == (files_warm ? 30 : 10) + (sim->desc.scheme != GS4_EXPLICIT)
          && !strcmp(c[0].name, "x") && !strcmp(c[3].name, "vx") && !strcmp(c[5].name, "vz"));
    if (found)
        files_compare(sim, (unsigned char *)end + 1,
                      size - (size_t)((unsigned char *)end + 1 - data), c, columns);
    free(data);
}

static void files_check_npy(const gs4_sim *sim, const char *path)
{
    size_t size, head;
    unsigned char *data = files_read(path, &size);
    files_column c[32];
    int columns = 0, shape = -1;
    char *p, *shape_of;
    CHECK(data != NULL && size > 10 && memcmp(data, "\x93NUMPY\x01\x00", 8) == 0);
    if (!data) return;
    head = (size_t)data[8] + 256 * (size_t)data[9] + 10;
    CHECK(head % 64 == 0 && head < size + 1 && data[head - 1] == '\n');
    data[head - 1] = 0;
    p = strstr((char *)data + 10, "'descr': [");
    CHECK(p == (char *)data + 11 && strstr((char *)data + 10, "'fortran_order': False") != NULL);
    CHECK(strchr((char *)data + 10, '{') == (char *)data + 10);
    while (p && columns < 32 && (p = strstr(p, "('")) != NULL) {
        CHECK(sscanf(p, "('%39[a-z_]', '%15[a-z0-9<|]'", c[columns].name, c[columns].type) == 2);
        shape_of = strchr(strchr(p, ',') + 1, '\'') + strlen(c[columns].type) + 2;
        c[columns].numbers = strncmp(shape_of, ", (3,))", 7) == 0     ? 3
                             : strncmp(shape_of, ", (6,))", 7) == 0   ? 6
                             : strncmp(shape_of, ", (3, 3))", 9) == 0 ? 9
                                                                      : 1;
        columns++;
        p += 2;
    }
    p = strstr((char *)data + 10, "'shape': (");
    CHECK(p && sscanf(p, "'shape': (%d,)", &shape) == 1
          && shape == gs4_get_stats((gs4_sim *)(uintptr_t)sim).particles);
    CHECK(columns == (files_warm ? 11 : 6) + (sim->desc.scheme != GS4_EXPLICIT) && c[0].numbers == 3
          && c[1].numbers == 3 && c[2].numbers == 1);
    files_compare(sim, data + head, size - head, c, columns);
    free(data);
}

static void test_files_frames(void)
{
    int which;
    for (which = 0; which < 4; which++) {
        const int warm = files_warm = which / 2;
        gs4_sim_desc d = files_desc(which % 2);
        gs4_sim *sim = files_scene(&d), *empty = NULL;
        const uint64_t h = gs4_state_hash(sim);
        CHECK_RESULT(sim, gs4_write_ply(sim, files_path("a.ply")), 0);
        files_check_ply(sim, files_path("a.ply"));
        CHECK_RESULT(sim, files_steps(sim, 25), 0);
        CHECK(gs4_state_hash(sim) != h);
        /* over the one before */
        CHECK_RESULT(sim, gs4_write_ply(sim, files_path("a.ply")), 0);
        CHECK_RESULT(sim, gs4_write_raw(sim, files_path("a.npy")), 0);
        CHECK(!files_leftover());
        files_check_ply(sim, files_path("a.ply"));
        files_check_npy(sim, files_path("a.npy"));
        files_warm = 0;
        CHECK(gs4_create(&d, &empty) == GS4_OK);
        CHECK_RESULT(empty, gs4_write_ply(empty, files_path("a.ply")), 0);
        CHECK_RESULT(empty, gs4_write_raw(empty, files_path("a.npy")), 0);
        files_check_ply(empty, files_path("a.ply"));
        files_check_npy(empty, files_path("a.npy"));
        if (warm) CHECK(gs4_get_stats(sim).max_temperature > gs4_get_stats(sim).min_temperature);
        remove(files_path("a.ply"));
        remove(files_path("a.npy"));
        gs4_destroy(sim);
        gs4_destroy(empty);
    }
}

/* --- places that cannot be written to --------------------------------------------------------- */

typedef int (*files_writer)(gs4_sim *sim, const char *path);

static int files_write_with(gs4_sim *sim, int which, const char *path)
{
    static const files_writer writers[] = { gs4_write_ply, gs4_write_raw, gs4_save, gs4_load };
    return writers[which](sim, path);
}

#define FILES_REFUSED(call, code)                     \
    do {                                              \
        const uint64_t files_h = gs4_state_hash(sim); \
        CHECK_RESULT(sim, call, code);                \
        CHECK(gs4_last_error(sim)[0] != 0);           \
        CHECK(gs4_state_hash(sim) == files_h);        \
    } while (0)

static void test_files_places(void)
{
    gs4_sim_desc d = files_desc(0);
    gs4_sim *sim = files_scene(&d);
    int w;
    CHECK_RESULT(sim, files_steps(sim, 3), 0);
    for (w = 0; w < 4; w++) {
        FILES_REFUSED(files_write_with(sim, w, NULL), GS4_ERROR_ARGUMENT);
        FILES_REFUSED(files_write_with(sim, w, ""), GS4_ERROR_ARGUMENT);
        FILES_REFUSED(files_write_with(sim, w, files_path("none/such/file")), GS4_ERROR_IO);
    }
    FILES_REFUSED(gs4_load(sim, files_path("missing")), GS4_ERROR_IO);
#ifdef FILES_UNIX
    {
        struct stat s;
        char long_path[6000];
        memset(long_path, 'x', sizeof long_path);
        long_path[sizeof long_path - 1] = 0;
        CHECK(mkdir(files_path("folder"), 0755) == 0 && mkdir(files_path("full"), 0755) == 0);
        files_write(files_path("full/file"), "1234", 4);
        for (w = 0; w < 4; w++) {
            FILES_REFUSED(files_write_with(sim, w, files_path("full")), GS4_ERROR_IO);
            FILES_REFUSED(files_write_with(sim, w, files_path("folder")), GS4_ERROR_IO);
            FILES_REFUSED(files_write_with(sim, w, files_path("folder/")), GS4_ERROR_IO);
            FILES_REFUSED(files_write_with(sim, w, long_path), GS4_ERROR_IO);
            /* an empty folder is still one */
            CHECK(stat(files_path("folder"), &s) == 0 && S_ISDIR(s.st_mode));
            remove(files_path("folder"));
            mkdir(files_path("folder"), 0755);
            CHECK(!files_leftover() && rmdir(files_path("folder")) == 0);
            mkdir(files_path("folder"), 0755);
            if (files_exists("/dev/full") && w < 3)
                FILES_REFUSED(files_write_with(sim, w, "/dev/full"), GS4_ERROR_IO);
            if (files_exists("/dev/null") && w < 3)
                CHECK_RESULT(sim, files_write_with(sim, w, "/dev/null"), 0);
        }
        if (files_exists("/dev/null")) FILES_REFUSED(gs4_load(sim, "/dev/null"), GS4_ERROR_FORMAT);
        if (geteuid() != 0) {
            CHECK(chmod(files_path("folder"), 0555) == 0);
            for (w = 0; w < 3; w++)
                FILES_REFUSED(files_write_with(sim, w, files_path("folder/file")), GS4_ERROR_IO);
            CHECK(chmod(files_path("folder"), 0755) == 0);
            CHECK(!files_exists(files_path("folder/file")));
        }
        remove(files_path("full/file"));
        remove(files_path("full"));
        remove(files_path("folder"));
    }
#endif
    CHECK_RESULT(sim, files_steps(sim, 3), 0);
    gs4_destroy(sim);
}

/* The disk is full in the midst of a file, or its neighbour cannot be made: the file from before
 * is as it was. */
static void test_files_previous(void)
{
    gs4_sim_desc d = files_desc(0);
    gs4_sim *sim;
    files_memory m;
    int w;
    memset(&m, 0, sizeof m);
    m.fail_at = -1;
    d.allocator.alloc_fn = files_alloc;
    d.allocator.free_fn = files_free;
    d.allocator.user = &m;
    sim = files_scene(&d);
    CHECK_RESULT(sim, files_steps(sim, 3), 0);
    for (w = 0; w < 3; w++) {
        unsigned char *before, *after;
        size_t size = 0, size_after = 0;
        const char *path = files_path("kept");
        CHECK_RESULT(sim, files_write_with(sim, w, path), 0);
        before = files_read(path, &size);
        CHECK(size > 5000);
        CHECK_RESULT(sim, files_steps(sim, 1), 0);
        m.fail_at = m.calls;
        FILES_REFUSED(files_write_with(sim, w, path), GS4_ERROR_MEMORY);
        m.fail_at = -1;
#ifdef FILES_UNIX
        {
            static const rlim_t limits[] = { 0, 100, 4096, 5000 };
            struct rlimit old, low;
            size_t i;
            CHECK(getrlimit(RLIMIT_FSIZE, &old) == 0);
            signal(SIGXFSZ, SIG_IGN);
            for (i = 0; i < sizeof limits / sizeof limits[0]; i++) {
                low = old;
                low.rlim_cur = limits[i];
                if (setrlimit(RLIMIT_FSIZE, &low) != 0) continue;
                FILES_REFUSED(files_write_with(sim, w, path), GS4_ERROR_IO);
                CHECK(setrlimit(RLIMIT_FSIZE, &old) == 0);
                CHECK(!files_leftover());
            }
        }
#endif
        after = files_read(path, &size_after);
        CHECK(before && after && size == size_after && memcmp(before, after, size) == 0);
        free(before);
        free(after);
        CHECK_RESULT(sim, files_write_with(sim, w, path), 0);
        CHECK(!files_leftover());
        remove(path);
    }
    gs4_destroy(sim);
    CHECK(m.live == 0);
}

/* --- checkpoints ------------------------------------------------------------------------------ */

/* Saved after n steps, loaded into a new simulation, into the same one later, and saved again
 * from there: the same bits. */
static void files_continue(const gs4_sim_desc *d, int n)
{
    gs4_sim *sim = files_scene(d), *other = files_scene(d);
    size_t size = 0, size_again = 0;
    unsigned char *a, *b;
    uint64_t saved, later;
    gs4_real limit;
    CHECK_RESULT(sim, files_steps(sim, n), 0);
    saved = gs4_state_hash(sim);
    limit = gs4_stable_dt(sim);
    CHECK_RESULT(sim, gs4_save(sim, files_path("c.sav")), 0);
    CHECK(gs4_state_hash(sim) == saved && !files_leftover());
    CHECK_RESULT(sim, files_steps(sim, 20), 0);
    later = gs4_state_hash(sim);
    CHECK(later != saved);
    CHECK_RESULT(other, gs4_load(other, files_path("c.sav")), 0);
    CHECK(gs4_state_hash(other) == saved);
    CHECK_CLOSE(gs4_stable_dt(other), limit, 0);
    CHECK_RESULT(other, files_steps(other, 20), 0);
    CHECK(gs4_state_hash(other) == later);
    CHECK(gs4_get_stats(other).steps == gs4_get_stats(sim).steps);
    CHECK_CLOSE(gs4_get_stats(other).time, gs4_get_stats(sim).time, 0);
    CHECK_RESULT(sim, gs4_load(sim, files_path("c.sav")), 0); /* back in time */
    CHECK(gs4_state_hash(sim) == saved);
    CHECK_RESULT(sim, files_steps(sim, 20), 0);
    CHECK(gs4_state_hash(sim) == later);
    CHECK_RESULT(other, gs4_load(other, files_path("c.sav")), 0);
    a = files_read(files_path("c.sav"), &size);
    /* the file's own copy of itself */
    CHECK_RESULT(other, gs4_save(other, files_path("c.sav")), 0);
    b = files_read(files_path("c.sav"), &size_again);
    CHECK(size == size_again);
    free(a);
    free(b);
    remove(files_path("c.sav"));
    gs4_destroy(sim);
    gs4_destroy(other);
}

static void test_files_continue(void)
{
    static const int steps[] = { 0, 1, 2, 7, 40 };
    int which, i;
    for (which = 0; which < 4; which++)
        for (i = test_full ? 0 : 3; i < (test_full ? 5 : 4); i++) {
            const int euler = which % 2;
            gs4_sim_desc d;
            files_warm = which / 2;
            d = files_desc(euler);
            files_continue(&d, steps[i]);
            d.flip_decay_time = (gs4_real)(euler ? 0 : INFINITY);
            d.max_particles = 3000;
            if (steps[i] == 7 && (test_full || which / 2)) files_continue(&d, steps[i]);
            files_warm = 0;
        }
}

/* The sound speed that a scene has chosen for itself holds for what is frozen, too. */
static void test_files_continue_frozen(void)
{
    gs4_sim_desc d = scene_cube(8);
    gs4_material m = scene_liquid(1000, 1, 0);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim, *other;
    gs4_edit v;
    int i;
    d.gravity = at(0, -10, 0);
    m.heat_capacity = 1000;
    m.conductivity = 1;
    m.can_melt = 1;
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1000;
    f.temperature = -5;
    CHECK(gs4_create(&d, &sim) == GS4_OK && gs4_create(&d, &other) == GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    CHECK_RESULT(other, gs4_add_material(other, &m), 0);
    CHECK_RESULT(sim, gs4_add_particles(sim, gs4_box(at(0.2, 0, 0.2), at(0.7, 0.5, 0.7)), &f), 0);
    CHECK_RESULT(sim, files_steps(sim, 5), 0);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++) v.data[i * v.stride + 1] -= 20;
    CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-4), 0);
    CHECK_RESULT(sim, gs4_save(sim, files_path("f.sav")), 0);
    CHECK_RESULT(other, gs4_load(other, files_path("f.sav")), 0);
    CHECK_RESULT(sim, files_steps(sim, 20), 0);
    CHECK_RESULT(other, files_steps(other, 20), 0);
    CHECK(gs4_state_hash(sim) == gs4_state_hash(other));
    remove(files_path("f.sav"));
    gs4_destroy(sim);
    gs4_destroy(other);
}

/* After something was changed by hand, and while particles leave. */
static void test_files_continue_edited(void)
{
    int euler, i;
    for (euler = 0; euler < 2; euler++) {
        gs4_sim_desc d = files_desc(euler);
        gs4_sim *sim, *other;
        gs4_edit v;
        uint64_t h;
        d.walls[0] = d.walls[1] = GS4_WALL_OPEN;
        sim = files_scene(&d);
        other = files_scene(&d);
        CHECK_RESULT(sim, files_steps(sim, 10), 0);
        v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (i = 0; i < v.count; i += 3) v.data[i * v.stride] += (gs4_real)2;
        CHECK_RESULT(sim, gs4_move_collider(sim, 1, at(0, 0.2, 0), at(1, 0, 0)), 0);
        CHECK_RESULT(sim, gs4_move_emitter(sim, 0, at(0, 0.2, 0)), 0);
        CHECK_RESULT(sim, gs4_save(sim, files_path("e.sav")), 0);
        CHECK_RESULT(sim, files_steps(sim, 30), 0);
        h = gs4_state_hash(sim);
        CHECK_RESULT(other, gs4_load(other, files_path("e.sav")), 0);
        /* saving and loading at every step changes nothing */
        for (i = 0; i < 30; i++) {
            CHECK_RESULT(other, files_steps(other, 1), 0);
            CHECK_RESULT(other, gs4_save(other, files_path("f.sav")), 0);
            CHECK_RESULT(other, gs4_load(other, files_path("f.sav")), 0);
        }
        CHECK(gs4_state_hash(other) == h);
        remove(files_path("e.sav"));
        remove(files_path("f.sav"));
        gs4_destroy(sim);
        gs4_destroy(other);
    }
}

/* An edit that only a save has looked at, before gravity changes: default speeds of sound, which go
 * by both, are the same with and without that save. */
static void test_files_continue_gravity(void)
{
    int scheme, saved, i;
    for (scheme = GS4_EXPLICIT; scheme <= GS4_SEMI_IMPLICIT; scheme++) {
        uint64_t hash[2];
        for (saved = 0; saved < 2; saved++) {
            gs4_sim_desc d = scene_cube(8);
            const gs4_material m = scene_liquid(1000, 1, 0);
            gs4_fill f = scene_fill(at(0, 0, 0));
            gs4_sim *sim;
            gs4_edit v;
            d.gravity = at(0, -10, 0);
            d.scheme = (gs4_scheme)scheme;
            CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
            CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
            CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(0.5, 0.5, 0.5)), &f) > 0);
            v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
            for (i = 0; i < v.count; i++) v.data[i * v.stride] = 3;
            if (saved) CHECK_RESULT(sim, gs4_save(sim, files_path("g.sav")), 0);
            CHECK_RESULT(sim, gs4_set_gravity(sim, at(0, -1, 0)), GS4_OK);
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), GS4_OK);
            hash[saved] = gs4_state_hash(sim);
            gs4_destroy(sim);
        }
        CHECK(hash[0] == hash[1]);
    }
    remove(files_path("g.sav"));
}

/* An edit that was never checked must not get in by way of a file. */
static void test_files_bad_edit(void)
{
    gs4_sim_desc d = files_desc(0);
    gs4_sim *sim = files_scene(&d), *other = files_scene(&d);
    gs4_edit x;
    int r;
    CHECK_RESULT(sim, files_steps(sim, 3), 0);
    x = gs4_edit_particles(sim, GS4_FIELD_POSITION);
    x.data[1] = (gs4_real)NAN;
    r = gs4_save(sim, files_path("n.sav"));
    CHECK(r == GS4_OK || r == GS4_ERROR_ARGUMENT);
    if (r == GS4_OK) {
        r = gs4_load(other, files_path("n.sav"));
        CHECK(r == GS4_OK || (r < 0 && gs4_last_error(other)[0]));
        if (r == GS4_OK) CHECK_RESULT(other, gs4_step(other, (gs4_real)1e-4), GS4_ERROR_ARGUMENT);
    }
    remove(files_path("n.sav"));
    gs4_destroy(sim);
    gs4_destroy(other);
}

/* --- damaged checkpoints ---------------------------------------------------------------------- */

/* A small scene, so that its file can be cut at every place. */
static gs4_sim *files_small(int euler, int steps)
{
    gs4_sim_desc d = files_desc(euler);
    gs4_sim *sim = NULL;
    int stage;
    d.cells[0] = d.cells[1] = d.cells[2] = 4;
    d.cell_size = (gs4_real)0.25;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    for (stage = 0; stage < 7; stage++) CHECK_RESULT(sim, files_build(sim, stage), 0);
    CHECK_RESULT(sim, files_build(sim, 9), 0);
    CHECK_RESULT(sim, files_build(sim, 10), 0);
    CHECK_RESULT(sim, files_steps(sim, steps), 0);
    return sim;
}

/* Loading this must fail with FORMAT and change nothing. */
static void files_reject(gs4_sim *sim, uint64_t hash, const void *data, size_t size,
                         const char *what, size_t where)
{
    const char *path = files_path("bad.sav");
    int r;
    files_write(path, data, size);
    r = gs4_load(sim, path);
    if (r == GS4_ERROR_FORMAT && gs4_last_error(sim)[0] && gs4_state_hash(sim) == hash)
        test_passed++;
    else {
        char line[200];
        sprintf(line, "%.100s %lu: %d, %s", what, (unsigned long)where, r,
                gs4_state_hash(sim) == hash ? "state as before" : "state changed");
        test_report(0, __FILE__, __LINE__, line);
    }
    remove(path);
}

static void test_files_damaged(void)
{
    int which;
    for (which = 0; which < 4; which++) {
        const int euler = which % 2;
        gs4_sim *sim, *to;
        uint64_t hash;
        size_t size = 0, n, i;
        unsigned char *data, *more;
        files_warm = which / 2;
        sim = files_small(euler, 12);
        to = files_small(euler, 5);
        hash = gs4_state_hash(to);
        CHECK_RESULT(sim, gs4_save(sim, files_path("good.sav")), 0);
        data = files_read(files_path("good.sav"), &size);
        CHECK(data && size > 2000);
        for (n = 0; n < size; n += n < 600 ? 1 : n < 20000 ? 97 : 997)
            files_reject(to, hash, data, n, "cut to", n);
        for (n = 1; n <= 16; n++) files_reject(to, hash, data, size - n, "cut short by", n);
        for (i = 0; i < 300; i++) {
            const size_t at_byte = i < 60    ? i * 4
                                   : i < 100 ? size - 1 - (i - 60)
                                             : (size_t)(gs4i_mix(i) % size);
            data[at_byte] ^= (unsigned char)(1u << (i % 8));
            files_reject(to, hash, data, size, "bit flipped at byte", at_byte);
            data[at_byte] ^= (unsigned char)(1u << (i % 8));
        }
        more = (unsigned char *)malloc(size + 100);
        if (more) {
            memcpy(more, data, size);
            memset(more + size, 0, 100);
            files_reject(to, hash, more, size + 1, "longer by", 1);
            files_reject(to, hash, more, size + 100, "longer by", 100);
            memcpy(more, data + size / 2, size - size / 2);
            memcpy(more + size - size / 2, data, size / 2);
            files_reject(to, hash, more, size, "halves swapped", 0);
            for (i = 0; i < size; i++) more[i] = (unsigned char)gs4i_mix(i);
            for (n = 1; n <= size; n *= 3) files_reject(to, hash, more, n, "noise of length", n);
            memset(more, 0, size);
            files_reject(to, hash, more, size, "zeros of length", size);
            memset(more, 255, size);
            files_reject(to, hash, more, size, "ones of length", size);
            free(more);
        }
        CHECK_RESULT(sim, gs4_write_ply(sim, files_path("x.ply")), 0);
        CHECK_RESULT(to, gs4_load(to, files_path("x.ply")), GS4_ERROR_FORMAT);
        CHECK(gs4_state_hash(to) == hash);
        /* and the whole file still works */
        CHECK_RESULT(to, gs4_load(to, files_path("good.sav")), 0);
        CHECK(gs4_state_hash(to) == gs4_state_hash(sim));
        CHECK_RESULT(to, files_steps(to, 3), 0);
        free(data);
        remove(files_path("good.sav"));
        remove(files_path("x.ply"));
        gs4_destroy(sim);
        gs4_destroy(to);
        files_warm = 0;
    }
}

/* Where the pieces of a checkpoint of `sim` are, in its order, and how large: as gs4i_save writes
 * them. Returns how many there are. */
static int files_pieces(gs4_sim *sim, const unsigned char *data, size_t at[], size_t size[])
{
    const int behind[5] = { GS4I_PIECE_OCCUPIED, GS4I_PIECE_FIRST, GS4I_PIECE_BLOCKS,
                            GS4I_PIECE_REMEMBERED, GS4I_PIECE_FLAGS };
    size_t next = sizeof(gs4i_head);
    gs4i_pieces p;
    gs4i_head h;
    int k, n = 0;
    memcpy(&h, data, sizeof h);
    gs4i_piece_sizes(sim, &h, &p);
    for (k = 0; k < 3 + GS4I_STATE_ARRAYS + 5; k++, n++) {
        size[n] = p.size[k < 3                       ? k
                         : k < 3 + GS4I_STATE_ARRAYS ? GS4I_PIECE_PARTICLES + k - 3
                                                     : behind[k - 3 - GS4I_STATE_ARRAYS]];
        at[n] = next;
        next += size[n];
    }
    return n;
}

/* The checksum that the contents have now. */
static void files_sign(gs4_sim *sim, unsigned char *data)
{
    size_t at[64], size[64];
    uint64_t hash = gs4i_hash_bytes(0, data, sizeof(gs4i_head));
    const int n = files_pieces(sim, data, at, size);
    int k;
    for (k = 0; k < n; k++) hash = gs4i_hash_bytes(hash, data + at[k], size[k]);
    memcpy(data + at[n - 1] + size[n - 1], &hash, sizeof hash);
}

/* `bytes` of a good checkpoint are others, under a right checksum: refused. */
static void files_forge(gs4_sim *to, unsigned char *data, size_t whole, size_t where,
                        const void *with, size_t bytes, const char *what)
{
    unsigned char before[24], checksum[8];
    memcpy(before, data + where, bytes);
    memcpy(checksum, data + whole - 8, 8);
    memcpy(data + where, with, bytes);
    files_sign(to, data);
    files_reject(to, gs4_state_hash(to), data, whole, what, where);
    memcpy(data + where, before, bytes);
    memcpy(data + whole - 8, checksum, 8);
}

/* A bad number in place of each real of the first, a middle and the last particle, of nodes, of
 * what moves and of the head. */
static void test_files_forged(void)
{
    const gs4_real bad[] = { (gs4_real)ERR_NAN, (gs4_real)ERR_INFINITY, (gs4_real)-ERR_INFINITY };
    const double wrong[] = { ERR_NAN, ERR_INFINITY, -1e200 };
    const gs4_real far_away = (gs4_real)1e9;
    gs4_real flat[3];
    const uint8_t seven = 7;
    int euler;
    for (euler = 0; euler < 2; euler++) {
        static const int whole_numbers[3] = { 7, 8, 13 }; /* ids, materials, liquid or solid */
        size_t at[64], size[64], bytes = 0, i;
        gs4_sim *sim, *to;
        unsigned char *data;
        int n, k, v;
        files_warm = 1;
        sim = files_small(euler, 12);
        to = files_small(euler, 5);
        CHECK_RESULT(sim, gs4_save(sim, files_path("f.sav")), 0);
        data = files_read(files_path("f.sav"), &bytes);
        n = files_pieces(sim, data, at, size);
        CHECK(at[n - 1] + size[n - 1] + 8 == bytes && sim->particles.heat && sim->emitter_count
              && sim->particles.elastic && sim->particles.deformation && sim->particles.flux);
        for (k = 0; k < GS4I_STATE_ARRAYS; k++) {
            const size_t count = (size_t)sim->particles.count, each = size[3 + k] / count;
            const size_t real = k == 6 ? sizeof(gs4i_half) : sizeof(gs4_real);
            int whole = 0, which;
            for (i = 0; i < 3; i++) whole |= k == whole_numbers[i];
            for (which = 0; which < 3 && !whole && size[3 + k]; which++)
                for (i = 0; i + real <= each; i += real)
                    for (v = 0; v < 3; v++) {
#ifdef GS4_DOUBLE /* a float; the library's own are finite */
                        const gs4i_half half = (gs4i_half)bad[v];
#else
                        const gs4i_half half = gs4i_to_half(bad[v]);
#endif
                        const size_t where =
                            at[3 + k] + each * ((count - 1) * (size_t)which / 2) + i;
                        /* rows of four with three numbers */
                        if (i == 3 * real && (k < 3 || k == 6 || k == 11 || k == 12)) continue;
                        files_forge(to, data, bytes, where,
                                    k == 6 ? (const void *)&half : (const void *)&bad[v], real,
                                    "particle");
                    }
        }
        files_forge(to, data, bytes, at[3 + 3], &far_away, sizeof far_away, "position");
        files_forge(to, data, bytes, at[3 + 3] + 3 * sizeof far_away, &far_away, sizeof far_away,
                    "mass");
        files_forge(to, data, bytes, at[3 + 4] + 3 * sizeof far_away, &far_away, sizeof far_away,
                    "J");
        memset(flat, 0, sizeof flat); /* det F = 0, and -J */
        files_forge(to, data, bytes, at[3 + 14], flat, sizeof flat, "flat");
        memcpy(flat, data + at[3 + 14], sizeof flat);
        for (i = 0; i < 3; i++) flat[i] = -flat[i];
        files_forge(to, data, bytes, at[3 + 14], flat, sizeof flat, "mirrored");
        files_forge(to, data, bytes, at[3 + 8], &seven, 1, "material");
        files_forge(to, data, bytes, at[3 + 13], &seven, 1, "liquid");
        for (v = 0; v < 6 && !euler; v++) /* and in the lane of mass */
            files_forge(to, data, bytes,
                        at[n - 2] + size[n - 2] / 2 + (size_t)(v / 3 * 3) * sizeof bad[0],
                        &bad[v % 3], sizeof bad[0], "node");
        for (v = 0; v < 3; v++) {
            files_forge(to, data, bytes, at[1] + offsetof(gs4i_collider, at), &wrong[v], 8, "at");
            files_forge(to, data, bytes, at[1] + offsetof(gs4i_collider, turn), &wrong[v], 8,
                        "turn");
            files_forge(to, data, bytes, at[1] + offsetof(gs4i_collider, is.velocity), &bad[v],
                        sizeof bad[v], "velocity");
            files_forge(to, data, bytes, at[1] + offsetof(gs4i_collider, is.angular_velocity),
                        &bad[v], sizeof bad[v], "angular velocity");
            files_forge(to, data, bytes, at[2] + offsetof(gs4i_emitter, flowed), &wrong[v], 8,
                        "offset");
            files_forge(to, data, bytes, offsetof(gs4i_head, time), &wrong[v], 8, "time");
            files_forge(to, data, bytes, offsetof(gs4i_head, last_dt), &wrong[v], 8, "last dt");
            files_forge(to, data, bytes, offsetof(gs4i_head, min_mass), &wrong[v], 8, "mass");
            files_forge(to, data, bytes, offsetof(gs4i_head, max_mass), &wrong[v], 8, "heaviest");
            files_forge(to, data, bytes, offsetof(gs4i_head, top_speed), &wrong[v], 8, "speed");
            files_forge(to, data, bytes, offsetof(gs4i_head, shift), &wrong[v], 8, "shift");
            files_forge(to, data, bytes, offsetof(gs4i_head, limits.max_speed), &bad[v],
                        sizeof bad[v], "limit");
        }
        free(data);
        gs4_destroy(sim);
        gs4_destroy(to);
        remove(files_path("f.sav"));
        files_warm = 0;
    }
}

/* Blocks in another order, or twice, under a right checksum: refused, as their particles and nodes
 * would be those of others. */
static void test_files_forged_order(void)
{
    const gs4_sim_desc d = files_desc(0);
    const gs4_material m = scene_liquid(1000, 1, 10);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    size_t at_byte[64], size[64], bytes = 0;
    gs4_sim *sim[2];
    unsigned char *data;
    int k;
    for (k = 0; k < 2; k++) {
        sim[k] = physics_create(&d, &m);
        CHECK(gs4_add_particles(sim[k], gs4_box(at(0.1, 0.1, 0.1), at(0.9, 0.9, 0.9)), &f) > 0);
        CHECK_RESULT(sim[k], files_steps(sim[k], 3 + k), 0);
    }
    CHECK_RESULT(sim[0], gs4_save(sim[0], files_path("o.sav")), 0);
    data = files_read(files_path("o.sav"), &bytes);
    CHECK(data && files_pieces(sim[0], data, at_byte, size) == 3 + GS4I_STATE_ARRAYS + 5);
    for (k = 0; data && k < 3; k++) { /* occupied blocks, their first particles, blocks */
        const int piece = 3 + GS4I_STATE_ARRAYS + k;
        const size_t where = at_byte[piece] + (k == 1 ? 4 : 0);
        uint32_t two[2], swapped[2];
        CHECK(size[piece] >= 12);
        memcpy(two, data + where, sizeof two);
        swapped[0] = two[1];
        swapped[1] = two[0];
        CHECK(two[0] < two[1]);
        files_forge(sim[1], data, bytes, where, swapped, sizeof swapped, "order");
        swapped[0] = two[0];
        if (k != 1) files_forge(sim[1], data, bytes, where, swapped, sizeof swapped, "twice");
    }
    free(data);
    gs4_destroy(sim[0]);
    gs4_destroy(sim[1]);
    remove(files_path("o.sav"));
}

/* A rate that leads too far in a step: that is refused, and the state stays finite. */
static int files_refuses_step(gs4_sim *sim)
{
    return gs4_advance(sim, (gs4_real)0.01) == GS4_ERROR_UNSTABLE && physics_is_finite(sim);
}

/* Any number of a checkpoint is a bad one, under a right checksum: refused, or it goes on with
 * finite numbers. What materials have become does not come from the file. */
static void test_files_forged_anywhere(void)
{
    const uint32_t patterns[] = { 0x7fc00000u, 0x7f800000u, 0xff800000u, 0x60ad78ecu,
                                  0xffffffffu, 0x7fffffffu, 0x00000001u, 0xbf800000u };
    const size_t dense = test_full ? 4 : 92, sparse = test_slow ? 4 : 484;
    int euler;
    for (euler = 0; euler < 2; euler++) {
        size_t bytes = 0, where;
        gs4_sim *sim;
        unsigned char *data;
        files_warm = 1;
        sim = files_small(euler, 12);
        CHECK_RESULT(sim, gs4_save(sim, files_path("g.sav")), 0);
        data = files_read(files_path("g.sav"), &bytes);
        for (where = 0; where + 12 <= bytes; where += where < 9000 ? dense : sparse) {
            const uint32_t pattern = patterns[gs4i_mix(where) % 8];
            unsigned char before[4];
            memcpy(before, data + where, 4);
            memcpy(data + where, &pattern, 4);
            if (where >= sizeof(gs4i_head)) files_sign(sim, data);
            files_write(files_path("h.sav"), data, bytes);
            if (gs4_load(sim, files_path("h.sav")) == GS4_OK)
                err_report(err_goes_on(sim) || files_refuses_step(sim), "checkpoint", "byte",
                           (double)where, 0, gs4_last_error(sim));
            memcpy(data + where, before, 4);
        }
        free(data);
        gs4_destroy(sim);
        remove(files_path("g.sav"));
        remove(files_path("h.sav"));
        files_warm = 0;
    }
}

/* Something endless is no checkpoint; that can be seen before it is read whole. */
static void test_files_endless(void)
{
    gs4_sim_desc d = files_desc(0);
    gs4_sim *sim = NULL;
    files_memory m;
    unsigned char *junk = (unsigned char *)calloc(1, 6000000);
    memset(&m, 0, sizeof m);
    m.fail_at = -1;
    d.allocator.alloc_fn = files_alloc;
    d.allocator.free_fn = files_free;
    d.allocator.user = &m;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    if (junk) files_write(files_path("junk"), junk, 6000000);
    m.most = 0;
    CHECK_RESULT(sim, gs4_load(sim, files_path("junk")), GS4_ERROR_FORMAT);
    CHECK(m.most < 2000000);
    if (m.most < 2000000 && files_exists("/dev/zero"))
        CHECK_RESULT(sim, gs4_load(sim, "/dev/zero"), GS4_ERROR_FORMAT);
    gs4_destroy(sim);
    /* a file that is short says that it is long */
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    CHECK_RESULT(sim, gs4_save(sim, files_path("junk")), 0);
    {
        size_t size, at_byte = offsetof(gs4i_head, particles);
        unsigned char *data = files_read(files_path("junk"), &size);
        data[at_byte + 3] = 0x3f; /* 2^30 particles */
        files_write(files_path("junk"), data, size);
        free(data);
    }
    m.most = 0;
    CHECK_RESULT(sim, gs4_load(sim, files_path("junk")), GS4_ERROR_FORMAT);
    CHECK(m.most < 10000000);
    free(junk);
    remove(files_path("junk"));
    gs4_destroy(sim);
}

/* --- checkpoints of another scene ------------------------------------------------------------- */

static void test_files_other_desc(void)
{
    int which;
    gs4_sim_desc d = files_desc(0);
    gs4_sim *from = files_scene(&d);
    size_t size = 0;
    unsigned char *data;
    CHECK_RESULT(from, files_steps(from, 5), 0);
    CHECK_RESULT(from, gs4_save(from, files_path("d.sav")), 0);
    for (which = 0; which < 16; which++) {
        gs4_sim_desc o = files_desc(0);
        gs4_sim *sim;
        switch (which) {
        case 0: o.cells[0] = 9; break;
        case 1: o.cells[2] = 12; break;
        case 2: o.cell_size = (gs4_real)0.13; break;
        case 3: o.origin = at(0.01, 0, 0); break;
        case 4: o.gravity = at(0, 0, -9); break;
        case 5: o.walls[0] = GS4_WALL_STICK; break;
        case 6: o.walls[2] = o.walls[3] = GS4_WALL_SLIP; break;
        case 7: o.rho_inf = (gs4_real)0.7; break;
        case 8: o.rho_inf_spurious = (gs4_real)0.3; break;
        case 9: o.flip_decay_time = (gs4_real)0.2; break;
        case 10: o.wall_temperature[4] = 1; break;
        case 11: o.wall_is_isothermal[4] = 1; break;
        case 12: o.ambient_temperature = 1; break;
        case 13: o.air_is_isothermal = 1; break;
        case 14: o.sharp_gradients = o.affine = 0; break;
        default: o = files_desc(1); break; /* the other integrator */
        }
        sim = files_scene(&o);
        CHECK_RESULT(sim, files_steps(sim, 3), 0);
        FILES_REFUSED(gs4_load(sim, files_path("d.sav")), GS4_ERROR_FORMAT);
        CHECK(strstr(gs4_last_error(sim), "description") != NULL);
        CHECK_RESULT(sim, files_steps(sim, 3), 0);
        gs4_destroy(sim);
    }
    /* the other precision: the size of gs4_real stands behind magic and version */
    {
        gs4_sim *sim = files_scene(&d);
        const uint32_t other = sizeof(gs4_real) == 8 ? 4 : 8;
        data = files_read(files_path("d.sav"), &size);
        CHECK(data != NULL && size > 16);
        if (data) {
            memcpy(data + 12, &other, 4);
            files_write(files_path("d.sav"), data, size);
            free(data);
        }
        FILES_REFUSED(gs4_load(sim, files_path("d.sav")), GS4_ERROR_FORMAT);
        CHECK(strstr(gs4_last_error(sim), "precision") != NULL);
        gs4_destroy(sim);
    }
    remove(files_path("d.sav"));
    gs4_destroy(from);
}

/* Of descriptions that are else the same, too. */
static void test_files_other_integrator(void)
{
    gs4_sim_desc d = scene_cube(8);
    gs4_sim *from = files_scene(&d), *sim;
    CHECK_RESULT(from, files_steps(from, 2), 0);
    CHECK_RESULT(from, gs4_save(from, files_path("d.sav")), 0);
    d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    sim = files_scene(&d);
    FILES_REFUSED(gs4_load(sim, files_path("d.sav")), GS4_ERROR_FORMAT);
    CHECK(strstr(gs4_last_error(sim), "description") != NULL);
    remove(files_path("d.sav"));
    gs4_destroy(sim);
    gs4_destroy(from);
}

static gs4_real files_viscosity(gs4_real temperature, gs4_real rate, void *user)
{
    (void)temperature;
    (void)rate;
    (void)user;
    return (gs4_real)0.1;
}

/* A scene whose numbers of materials, colliders and emitters agree with the file, but which is
 * another one. */
static gs4_sim *files_variant(int which)
{
    const gs4_sim_desc d = files_desc(0);
    gs4_sim *sim = NULL;
    gs4_material m = scene_liquid(1000, 0.1, 6);
    gs4_collider c;
    gs4_emitter e;
    const gs4_fill f = scene_fill(at(0, 0, 0));
    int i;
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    if (which == 1) m.density = 2000;
    if (which == 2) m.viscosity = 1;
    if (which == 3) m.sound_speed = 7;
    if (which == 4) {
        m.viscosity_law = GS4_VISCOSITY_CALLBACK;
        m.viscosity_fn = files_viscosity;
    }
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    c.shape = which == 5 ? gs4_box(at(0.4, 0.4, 0), at(0.6, 0.6, 0.2))
                         : gs4_sphere(at(0.5, 0.5, 0.1), (gs4_real)(which == 6 ? 0.05 : 0.1));
    if (which == 7) c.contact = GS4_WALL_SLIP;
    e.shape = which == 8 ? gs4_sphere(at(0.5, 0.5, 0.8), (gs4_real)0.1)
                         : gs4_box(at(0.4, 0.4, 0.7), at(0.6, 0.6, 0.9));
    e.fill = scene_fill(at(0, 0, which == 9 ? -1.0 : -0.5));
    if (which == 14) c.pivot = at(0.5, 0.5, 0.1);
    if (which == 15) e.start = 1;
    if (which == 16) e.stop = 1;
    for (i = 0; i < 2; i++) {
        /* 10: in the other order */
        if ((which == 10) != (i == 1))
            CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
        else
            CHECK_RESULT(sim, gs4_add_collider(sim, &c), 0);
    }
    if (which == 11) {
        CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    }
    if (which == 12) {
        CHECK_RESULT(sim, gs4_add_collider(sim, &c), 0);
    }
    if (which == 13) {
        CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
    }
    CHECK_RESULT(sim, gs4_add_particles(sim, gs4_box(at(0.25, 0.25, 0.25), at(0.5, 0.5, 0.5)), &f),
                 0);
    CHECK_RESULT(sim, files_steps(sim, 5), 0);
    return sim;
}

/* What lies between the members of a material does not make it another one. */
static void test_files_padding(void)
{
    gs4_sim *sim[2];
    int k;
    for (k = 0; k < 2; k++) {
        const gs4_sim_desc d = files_desc(0);
        const gs4_material all = scene_liquid(1000, 0.1, 6);
        gs4_material m;
        const gs4_fill f = scene_fill(at(0, 0, 0));
        memset(&m, k ? 0xcd : 0, sizeof m);
        gs4i_copy_members(&m, &all);
        CHECK(gs4_create(&d, &sim[k]) == GS4_OK);
        CHECK_RESULT(sim[k], gs4_add_material(sim[k], &m), 0);
        CHECK_RESULT(
            sim[k], gs4_add_particles(sim[k], gs4_box(at(0.25, 0.25, 0.25), at(0.5, 0.5, 0.5)), &f),
            0);
        CHECK_RESULT(sim[k], files_steps(sim[k], 3), 0);
    }
    CHECK_RESULT(sim[0], gs4_save(sim[0], files_path("s.sav")), 0);
    CHECK_RESULT(sim[1], gs4_load(sim[1], files_path("s.sav")), 0);
    remove(files_path("s.sav"));
    gs4_destroy(sim[0]);
    gs4_destroy(sim[1]);
}

static void test_files_other_scene(void)
{
    gs4_sim *from = files_variant(0);
    int which;
    CHECK_RESULT(from, gs4_save(from, files_path("s.sav")), 0);
    for (which = 0; which < 17; which++) {
        gs4_sim *sim = files_variant(which);
        const uint64_t h = gs4_state_hash(sim);
        const int r = gs4_load(sim, files_path("s.sav"));
        char line[80];
        sprintf(line, "checkpoint loaded into variant %d of its scene: %d", which, r);
        test_report(which == 0 ? r == GS4_OK
                               : r == GS4_ERROR_FORMAT && gs4_last_error(sim)[0]
                                     && gs4_state_hash(sim) == h,
                    __FILE__, __LINE__, line);
        CHECK_RESULT(sim, files_steps(sim, 3), 0);
        gs4_destroy(sim);
    }
    /* one has heat, the other has none; the descriptions agree */
    for (which = 0; which < 2; which++) {
        gs4_sim *other;
        int stage;
        for (stage = 0; stage < 2; stage++) {
            const gs4_sim_desc d = files_desc(0);
            gs4_material m = scene_liquid(1000, 0.1, 6);
            const gs4_fill f = scene_fill(at(0, 0, 0));
            m.heat_capacity = 1000;
            m.conductivity = (gs4_real)(stage == which);
            CHECK(gs4_create(&d, &other) == GS4_OK);
            CHECK_RESULT(other, gs4_add_material(other, &m), 0);
            CHECK_RESULT(
                other,
                gs4_add_particles(other, gs4_box(at(0.25, 0.25, 0.25), at(0.5, 0.5, 0.5)), &f), 0);
            CHECK_RESULT(other, files_steps(other, 5), 0);
            if (stage == 0)
                CHECK_RESULT(other, gs4_save(other, files_path("s.sav")), 0);
            else {
                const uint64_t h = gs4_state_hash(other);
                CHECK_RESULT(other, gs4_load(other, files_path("s.sav")), GS4_ERROR_FORMAT);
                CHECK(strstr(gs4_last_error(other), "other materials") != NULL
                      && gs4_state_hash(other) == h);
            }
            gs4_destroy(other);
        }
    }
    { /* too many particles for here */
        gs4_sim_desc d = files_desc(0);
        gs4_sim *big = files_scene(&d), *sim;
        CHECK_RESULT(big, files_steps(big, 10), 0);
        CHECK_RESULT(big, gs4_save(big, files_path("s.sav")), 0);
        d.max_particles = gs4_get_stats(big).particles - 1;
        sim = files_scene(&d);
        {
            const uint64_t h = gs4_state_hash(sim);
            CHECK(gs4_load(sim, files_path("s.sav")) < 0
                  && strstr(gs4_last_error(sim), "max_particles") && gs4_state_hash(sim) == h);
        }
        gs4_destroy(sim);
        gs4_destroy(big);
    }
    remove(files_path("s.sav"));
    gs4_destroy(from);
}

#ifdef FILES_LINKS
static int files_is_link(const char *path)
{
    char text[8];
    return readlink(path, text, sizeof text) > 0;
}

/* A file of the user's beside the target stays, symbolic links stay links, and names may be as
 * long as the system has them. */
static void test_files_neighbours(void)
{
    gs4_sim *sim = files_small(0, 2);
    unsigned char *own;
    size_t size;
    int w;
    char name[260];
    memset(name, 'n', sizeof name);
    for (w = 0; w < 3; w++) {
        files_write(files_path("x.tmp"), "mine", 4);
        CHECK_RESULT(sim, files_write_with(sim, w, files_path("x")), 0);
        own = files_read(files_path("x.tmp"), &size);
        CHECK(own && size == 4 && memcmp(own, "mine", 4) == 0);
        free(own);
        name[255] = 0;
        CHECK_RESULT(sim, files_write_with(sim, w, files_path(name)), 0);
        CHECK(remove(files_path(name)) == 0);
        name[255] = 'n';
        name[256] = 0;
        FILES_REFUSED(files_write_with(sim, w, files_path(name)), GS4_ERROR_IO);
        CHECK(strstr(gs4_last_error(sim), "too long"));
        mkdir(files_path("sub"), 0755);
        FILES_REFUSED(files_write_with(sim, w, files_path("sub")), GS4_ERROR_IO);
        CHECK(strstr(gs4_last_error(sim), "folder"));
        /* links to links: where there is no file yet, and where there is one */
        CHECK(symlink("sub/second", files_path("first")) == 0);
        CHECK(symlink("../third", files_path("sub/second")) == 0);
        CHECK_RESULT(sim, files_write_with(sim, w, files_path("first")), 0);
        CHECK_RESULT(sim, files_write_with(sim, w, files_path("first")), 0);
        CHECK(files_is_link(files_path("first")) && files_is_link(files_path("sub/second")));
        CHECK(!files_is_link(files_path("third")) && files_exists(files_path("third")));
        CHECK(remove(files_path("first")) == 0
              && symlink(files_path("x"), files_path("first")) == 0);
        remove(files_path("x"));
        CHECK_RESULT(sim, files_write_with(sim, w, files_path("first")), 0);
        CHECK(files_is_link(files_path("first")) && files_exists(files_path("x")));
        CHECK(symlink("round", files_path("round")) == 0);
        FILES_REFUSED(files_write_with(sim, w, files_path("round")), GS4_ERROR_IO);
        CHECK(strstr(gs4_last_error(sim), "link"));
        CHECK(!files_leftover());
        remove(files_path("sub/second"));
        remove(files_path("x"));
        remove(files_path("x.tmp"));
        remove(files_path("first"));
        remove(files_path("third"));
        remove(files_path("round"));
        CHECK(rmdir(files_path("sub")) == 0);
    }
    gs4_destroy(sim);
}

#endif

#ifdef FILES_UNIX
/* Two programs write one file again and again while a third reads it: it is always whole. */
static void test_files_two_writers(void)
{
    gs4_sim *writer = files_small(0, 1), *reader = files_small(0, 1);
    pid_t child[2];
    int i, k, status;
    CHECK_RESULT(reader, gs4_save(reader, files_path("both")), 0);
    fflush(stdout);
    for (k = 0; k < 2; k++) {
        child[k] = fork();
        if (child[k]) continue;
        /* other contents, but the same addresses and steps: the same names are tried */
        gs4_edit_particles(writer, GS4_FIELD_VELOCITY).data[0] = (gs4_real)(0.1 * k);
        for (status = 0, i = 0; i < 200; i++)
            status |= gs4_save(writer, files_path("both")) != GS4_OK;
        _exit(status);
    }
    for (i = 0; i < 200; i++) CHECK_RESULT(reader, gs4_load(reader, files_path("both")), 0);
    for (k = 0; k < 2; k++) CHECK(waitpid(child[k], &status, 0) == child[k] && status == 0);
    CHECK(!files_leftover());
    remove(files_path("both"));
    gs4_destroy(writer);
    gs4_destroy(reader);
}
#endif

static void run_files(void)
{
    files_begin();
    RUN_FULL(test_files_memory);
    RUN(test_files_fast_collider);
    RUN_ONCE(test_files_load_refused);
    RUN_ONCE(test_files_frames);
    RUN(test_files_places);
    RUN(test_files_previous);
#ifdef FILES_LINKS
    RUN_ONCE(test_files_neighbours);
#endif
#ifdef FILES_UNIX
    RUN_ONCE(test_files_two_writers);
#endif
    RUN_FULL(test_files_continue);
    RUN(test_files_continue_frozen);
    RUN_FULL(test_files_continue_edited);
    RUN(test_files_continue_gravity);
    RUN(test_files_bad_edit);
    RUN_FULL(test_files_damaged);
    RUN_ONCE(test_files_forged);
    RUN_ONCE(test_files_forged_order);
    RUN_ONCE(test_files_forged_anywhere);
    RUN(test_files_endless);
    RUN_FULL(test_files_other_desc);
    RUN(test_files_other_integrator);
    RUN(test_files_padding);
    RUN_ONCE(test_files_other_scene);
    files_end();
}
