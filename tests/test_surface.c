/* The surface as triangles: closed, of the right volume, place and normals, whatever the scene. */

/* What is counted of triangles. */
typedef struct triangles_count {
    int pieces, euler, open; /* open: sides that do not meet exactly one other, turned round */
    double volume, length, outside; /* cells^3; of normals, farthest from 1; out of the domain */
} triangles_count;

static int triangles_order(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static int triangles_root(int *parent, int i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static triangles_count triangles_counted(gs4_sim *sim, const gs4_triangles *t)
{
    const gs4_sim_desc d = gs4_get_desc(sim);
    const double h = (double)d.cell_size,
                 low[3] = { (double)d.origin.x, (double)d.origin.y, (double)d.origin.z };
    const int n = 3 * t->triangle_count;
    uint64_t *side = (uint64_t *)malloc((size_t)n * sizeof *side + 8);
    int *parent = (int *)malloc((size_t)t->vertex_count * sizeof *parent + 8), i, k;
    triangles_count c = { 0, 0, 0, 0, 0, 0 };
    for (i = 0; i < t->vertex_count; i++) {
        double size = 0;
        parent[i] = i;
        for (k = 0; k < 3; k++) {
            const double x = (double)t->positions[3 * i + k], end = low[k] + h * (double)d.cells[k];
            size += (double)t->normals[3 * i + k] * (double)t->normals[3 * i + k];
            c.outside = fmax(c.outside, fmax(low[k] - x, x - end) / h);
            if (!(fabs(x) < 1e30)) c.open++;
        }
        c.length = fmax(c.length, fabs(sqrt(size) - 1));
    }
    for (i = 0; i < n; i++) {
        const int a = t->triangles[i], b = t->triangles[i % 3 == 2 ? i - 2 : i + 1];
        if (a < 0 || a >= t->vertex_count || a == b) c.open++;
        side[i] = (uint64_t)a << 32 | (uint64_t)b;
        parent[triangles_root(parent, a)] = triangles_root(parent, b);
    }
    qsort(side, (size_t)n, sizeof *side, triangles_order);
    for (i = 0; i < n; i++) {
        const uint64_t back = side[i] << 32 | side[i] >> 32;
        c.open += (i > 0 && side[i] == side[i - 1])
                  || !bsearch(&back, side, (size_t)n, sizeof *side, triangles_order);
    }
    for (i = 0; i < t->triangle_count; i++) {
        double p[3][3];
        for (k = 0; k < 9; k++)
            p[k / 3][k % 3] =
                ((double)t->positions[3 * t->triangles[3 * i + k / 3] + k % 3] - low[k % 3]) / h;
        for (k = 0; k < 3; k++)
            c.volume +=
                p[0][k]
                * (p[1][(k + 1) % 3] * p[2][(k + 2) % 3] - p[1][(k + 2) % 3] * p[2][(k + 1) % 3])
                / 6;
    }
    for (i = 0; i < t->vertex_count; i++) c.pieces += parent[i] == i;
    c.euler = t->vertex_count - n / 2 + t->triangle_count;
    free(side);
    free(parent);
    return c;
}

/* Volume of the particles in cells. */
static double triangles_volume(gs4_sim *sim)
{
    const double h = (double)gs4_get_desc(sim).cell_size;
    return gs4_get_stats(sim).volume / (h * h * h);
}

/* The surface, which has so many pieces and that Euler characteristic, and encloses the volume of
 * the particles within 2 %. */
static gs4_triangles triangles_of(gs4_sim *sim, int pieces, int euler)
{
    gs4_triangles t;
    triangles_count c;
    CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_VELOCITY, &t), 0);
    c = triangles_counted(sim, &t);
    CHECK(c.open == 0);
    if (pieces >= 0) CHECK_CLOSE(c.pieces, pieces, 0);
    if (pieces >= 0) CHECK_CLOSE(c.euler, euler, 0);
    CHECK_CLOSE(c.volume / triangles_volume(sim), 1, 0.02);
    CHECK(c.length < 1e-4 && c.outside < 1e-4);
    return t;
}

/* A cube of n^3 cells of side 1/n, one liquid of 1 Pa s. */
static gs4_sim *triangles_scene(int n)
{
    const gs4_sim_desc d = scene_cube(n);
    const gs4_material m = scene_liquid(1000, 1, 30);
    gs4_sim *sim = NULL;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), 0);
    CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
    return sim;
}

static void triangles_add(gs4_sim *sim, gs4_shape shape, double spacing)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    f.spacing = (gs4_real)spacing;
    CHECK(gs4_add_particles(sim, shape, &f) > 0);
}

static void triangles_clear(gs4_sim *sim)
{
    CHECK(gs4_remove_particles(sim, gs4_box(at(-9, -9, -9), at(9, 9, 9))) > 0);
}

/* Angle in degrees between the normal of vertex i and a direction. */
static double triangles_angle(const gs4_triangles *t, int i, const double along[3])
{
    double dot = 0, size = 0;
    int k;
    for (k = 0; k < 3; k++) {
        dot += (double)t->normals[3 * i + k] * along[k];
        size += along[k] * along[k];
    }
    return acos(fmax(-1, fmin(1, dot / sqrt(size)))) * 180 / acos(-1.0);
}

/* Spheres: the radius of vertices is off by less than a fifth of a cell, whatever their size. */
static void test_surface_sphere(void)
{
    int R;
    for (R = 2; R <= 16; R *= 2) {
        const double h = 1.0 / 40, centre[3] = { 0.501, 0.503, 0.4983 };
        gs4_sim *sim = triangles_scene(40);
        gs4_triangles t;
        double off = 0, angle = 0, mean = 0;
        int i, k;
        triangles_add(sim, gs4_sphere(at(centre[0], centre[1], centre[2]), (gs4_real)(R * h)), 0);
        t = triangles_of(sim, 1, 2);
        for (i = 0; i < t.vertex_count; i++) {
            double d[3], r;
            for (k = 0; k < 3; k++) d[k] = ((double)t.positions[3 * i + k] - centre[k]) / h;
            r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            off = fmax(off, fabs(r - R));
            mean += (r - R) / t.vertex_count;
            angle = fmax(angle, triangles_angle(&t, i, d));
        }
        CHECK_BETWEEN(off, 0, 0.2);
        CHECK_BETWEEN(mean, -0.02, R > 2 ? 0.05 : 0.1);
        CHECK_BETWEEN(angle, 0, 5);
        CHECK_CLOSE(triangles_counted(sim, &t).volume / (4 * acos(-1.0) / 3 * R * R * R), 1,
                    R > 2 ? 0.01 : 0.03);
        CHECK(!t.materials[0] && t.values[0] == 0);
        gs4_surface_free(sim, &t);
        CHECK(!t.positions && !t.vertex_count);
        gs4_surface_free(sim, &t);
        gs4_destroy(sim);
    }
}

static gs4_real triangles_ring(gs4_vec3 p, void *user)
{
    const double x = (double)p.x - 0.5, y = (double)p.y - 0.5, z = (double)p.z - 0.5,
                 r = sqrt(x * x + y * y) - 0.3;
    (void)user;
    return (gs4_real)(sqrt(r * r + z * z) - 0.1);
}

static void test_surface_shapes(void)
{
    const double h = 1.0 / 32;
    gs4_sim *sim = triangles_scene(32);
    gs4_triangles t;
    triangles_count c;
    int i;
    triangles_add(sim, gs4_sdf(triangles_ring, NULL, at(0, 0, 0), at(1, 1, 1)), 0);
    t = triangles_of(sim, 1, 0);
    gs4_surface_free(sim, &t);
    triangles_clear(sim);
    /* two drops, each with its own volume */
    triangles_add(sim, gs4_sphere(at(0.3, 0.3, 0.3), (gs4_real)(6 * h)), 0);
    triangles_add(sim, gs4_sphere(at(0.7, 0.6, 0.7), (gs4_real)(3 * h)), 0);
    t = triangles_of(sim, 2, 4);
    for (i = 0; i < 3 * t.triangle_count; i += 3) /* what is left is the first */
        if (t.positions[3 * t.triangles[i]] > (gs4_real)0.55) t.triangles[i + 1] = t.triangles[i];
    c = triangles_counted(sim, &t);
    CHECK_CLOSE(c.volume / (4 * acos(-1.0) / 3 * 216), 1, 0.02);
    gs4_surface_free(sim, &t);
    triangles_clear(sim);
    /* a ball with a hollow */
    triangles_add(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)(10 * h)), 0);
    CHECK(gs4_remove_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)(4 * h))) > 0);
    t = triangles_of(sim, 2, 4);
    gs4_surface_free(sim, &t);
    triangles_clear(sim);
    CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_VELOCITY, &t), 0);
    CHECK(t.vertex_count == 0 && t.triangle_count == 0);
    gs4_surface_free(sim, &t);
    gs4_destroy(sim);
}

/* Sheets of 1.5 cells anywhere in a cell have no hole and their thickness; what is half as thick
 * has no hole either. Drops of 1.5 cells, and single particles, are there. */
static void test_surface_thin(void)
{
    const double h = 1.0 / 32;
    gs4_sim *sim = triangles_scene(32);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_triangles t;
    int i, k;
    for (k = 0; k < 48; k++) { /* from wall to wall, and not; 1.5 and 0.75 cells thick */
        const int axis = k / 8 % 3, is_wide = k < 24, layers = k & 1 ? 2 : 3, n = is_wide ? 64 : 30;
        const double up = (k & 1 ? 0.375 : 0.5) * h, z = (16 + k % 8 / 2 * 0.25) * h,
                     from = is_wide ? 0 : 8.1 * h, half = layers * up / 2,
                     tolerance = !is_wide ? 0.3
                                 : k & 1  ? 0.1
                                          : 0.05;
        gs4_real *x = (gs4_real *)malloc((size_t)(n * n * layers) * 3 * sizeof *x);
        double inner = 9, outer = 0;
        for (i = 0; i < n * n * layers; i++) {
            x[3 * i + axis] = (gs4_real)(z + (i % layers + 0.5) * up);
            x[3 * i + (axis + 1) % 3] = (gs4_real)(from + (i / layers % n + 0.5) * h / 2);
            x[3 * i + (axis + 2) % 3] = (gs4_real)(from + (i / layers / n + 0.5) * h / 2);
        }
        CHECK(gs4_add_points(sim, x, n * n * layers, (gs4_real)(h * h * up / 4), &f) > 0);
        t = triangles_of(sim, 1, 2);
        for (i = 0; i < t.vertex_count; i++) {
            const gs4_real *p = t.positions + 3 * i;
            const double y = ((double)p[axis] - z - half) / h;
            if (fabs((double)p[(axis + 1) % 3] - 0.48) > 4 * h
                || fabs((double)p[(axis + 2) % 3] - 0.48) > 4 * h)
                continue;
            inner = fmin(inner, fabs(y));
            outer = fmax(outer, fabs(y));
        }
        CHECK_BETWEEN(inner, half / h - tolerance, half / h + tolerance);
        CHECK_BETWEEN(outer, half / h - tolerance, half / h + tolerance);
        gs4_surface_free(sim, &t);
        triangles_clear(sim);
        free(x);
    }
    for (k = 0; k < 8; k++) {
        const double c = (16 + k * 0.125) * h;
        triangles_add(sim, gs4_sphere(at(c, c, c), (gs4_real)(0.75 * h)), h / 4);
        t = triangles_of(sim, 1, 2);
        for (i = 0; i < 3 * t.vertex_count; i++) CHECK(fabs((double)t.positions[i] - c) < 1.3 * h);
        gs4_surface_free(sim, &t);
        triangles_clear(sim);
    }
    for (k = 0; k < 8; k++) {
        const gs4_real p[3] = { (gs4_real)(0.5 + 0.13 * k * h), (gs4_real)0.4, (gs4_real)0.3 };
        CHECK(gs4_add_points(sim, p, 1, (gs4_real)(h * h * h / 8), &f) == 1);
        t = triangles_of(sim, 1, 2);
        for (i = 0; i < 3 * t.vertex_count; i++)
            CHECK(fabs((double)t.positions[i] - (double)p[i % 3]) < 0.5 * h);
        gs4_surface_free(sim, &t);
        triangles_clear(sim);
    }
    gs4_destroy(sim);
}

/* A box of material in a corner of the domain, and one that fills it: the surface lies in the walls
 * there, whatever they do. */
static void test_surface_walls(void)
{
    static const gs4_wall walls[] = { GS4_WALL_STICK, GS4_WALL_SLIP, GS4_WALL_SEPARATE,
                                      GS4_WALL_PERIODIC, GS4_WALL_OPEN };
    const double h = 1.0 / 13; /* blocks end within the domain */
    int w, k, i, a;
    for (w = 0; w < 5; w++)
        for (k = 0; k < 9; k++) {
            gs4_sim_desc d = scene_cube(13);
            const gs4_material m = scene_liquid(1000, 1, 30);
            gs4_sim *sim = NULL;
            gs4_triangles t;
            double low[3], high[3], off = 0;
            for (a = 0; a < 6; a++) d.walls[a] = walls[w];
            CHECK_RESULT(NULL, gs4_create(&d, &sim), 0);
            CHECK_RESULT(sim, gs4_add_material(sim, &m), 0);
            for (a = 0; a < 3; a++) {
                low[a] = k == 8 || !(k >> a & 1) ? 0 : 6 * h;
                high[a] = k == 8 || k >> a & 1 ? 1 : 7.3 * h;
            }
            triangles_add(sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])),
                          0);
            t = triangles_of(sim, w == 3 && k < 8 ? -1 : 1, 2);
            for (a = 0; a < 3; a++) {
                double least = 9, most = -9;
                for (i = 0; i < t.vertex_count; i++) {
                    least = fmin(least, (double)t.positions[3 * i + a]);
                    most = fmax(most, (double)t.positions[3 * i + a]);
                }
                if (low[a] == 0) off = fmax(off, fabs(least));
                if (high[a] == 1) off = fmax(off, fabs(most - 1));
            }
            CHECK_BETWEEN(off / h, 0, 1e-4);
            gs4_surface_free(sim, &t);
            gs4_destroy(sim);
        }
}

/* A pool that was stirred and has run for a while: normals are within 2 degrees of gravity away
 * from walls. Along each axis, both ways. */
static void test_surface_pool(void)
{
    int way, i, k;
    for (way = 0; way < (test_full ? 6 : 1); way++) {
        const int n = 20, axis = (way / 2 + 1) % 3, up = !(way & 1);
        const double h = 1.0 / n;
        gs4_sim *sim = triangles_scene(n);
        gs4_fill f = scene_fill(at(0, 0, 0));
        double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, along[3] = { 0, 0, 0 }, worst = 0;
        gs4_view x;
        gs4_edit v;
        gs4_triangles t;
        f.jitter = (gs4_real)0.4;
        along[axis] = up ? 1 : -1;
        high[axis] = up ? 7.3 * h : 1;
        low[axis] = up ? 0 : 1 - 7.3 * h;
        CHECK_RESULT(
            sim, gs4_set_gravity(sim, at(-9.81 * along[0], -9.81 * along[1], -9.81 * along[2])), 0);
        CHECK(gs4_add_particles(
                  sim, gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2])), &f)
              > 0);
        x = gs4_particles(sim, GS4_FIELD_POSITION);
        v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
        for (i = 0; i < v.count; i++) {
            const double a = (double)x.data[i * x.stride + (axis + 1) % 3] - 0.5,
                         b = (double)x.data[i * x.stride + (axis + 2) % 3] - 0.5,
                         speed = 0.7 * exp(-20 * (a * a + b * b));
            v.data[i * v.stride + (axis + 1) % 3] = (gs4_real)(-b * speed);
            v.data[i * v.stride + (axis + 2) % 3] = (gs4_real)(a * speed);
        }
        for (k = 0; k < 5; k++) {
            for (i = 0; i < 24; i++)
                CHECK_RESULT(sim, gs4_step(sim, (gs4_real)(0.8 * (double)gs4_stable_dt(sim))), 0);
            t = triangles_of(sim, 1, 2);
            for (i = 0; i < t.vertex_count; i++) {
                const double a = (double)t.positions[3 * i + (axis + 1) % 3],
                             b = (double)t.positions[3 * i + (axis + 2) % 3];
                if (fmin(fmin(a, 1 - a), fmin(b, 1 - b)) < 3 * h
                    || fabs((double)t.positions[3 * i + axis] - (up ? 0 : 1)) < 4 * h)
                    continue;
                worst = fmax(worst, triangles_angle(&t, i, along));
            }
            gs4_surface_free(sim, &t);
        }
        CHECK_BETWEEN(worst, 0, 2);
        gs4_destroy(sim);
    }
}

/* Two materials side by side: no value between theirs, and none where the other is. */
static void test_surface_materials(void)
{
    const double h = 1.0 / 24;
    gs4_sim *sim = triangles_scene(24);
    const gs4_material m = scene_liquid(500, 1, 30);
    gs4_fill f = scene_fill(at(1, 0, 0));
    gs4_triangles t;
    int i, seen[2] = { 0, 0 };
    CHECK(gs4_add_material(sim, &m) == 1);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.2, 0.2, 0.2), at(0.5, 0.8, 0.8)), &f) > 0);
    f.material = 1;
    f.velocity = at(0, 0, 3);
    CHECK(gs4_add_particles(sim, gs4_box(at(0.5, 0.2, 0.2), at(0.8, 0.8, 0.8)), &f) > 0);
    t = triangles_of(sim, 1, 2);
    for (i = 0; i < t.vertex_count; i++) {
        const double x = (double)t.positions[3 * i];
        const int material = t.materials[i];
        seen[material & 1]++;
        CHECK_CLOSE(t.values[i], material ? 3 : 1, 1e-5);
        if (fabs(x - 0.5) > 1.2 * h) CHECK(material == (x > 0.5));
    }
    CHECK(seen[0] > 200 && seen[1] > 200 && abs(seen[0] - seen[1]) < 200);
    gs4_surface_free(sim, &t);
    CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_DEFORMATION, &t), GS4_ERROR_ARGUMENT);
    CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_TEMPERATURE, &t), GS4_ERROR_ARGUMENT);
    CHECK_RESULT(sim, gs4_surface(sim, (gs4_field)99, &t), GS4_ERROR_ARGUMENT);
    CHECK_RESULT(sim, gs4_surface(sim, (gs4_field)-1, &t), GS4_ERROR_ARGUMENT);
    CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_MASS, NULL), GS4_ERROR_ARGUMENT);
    CHECK(gs4_surface(NULL, GS4_FIELD_MASS, &t) == GS4_ERROR_ARGUMENT && !t.vertex_count);
    CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_POSITION, &t), 0);
    CHECK(t.vertex_count > 0 && !t.values);
    gs4_surface_free(NULL, &t);
    gs4_surface_free(sim, NULL);
    gs4_surface_free(sim, &t);
    gs4_destroy(sim);
}

/* A scene with a body, an emitter, a drop and a column, by any scheme. */
static gs4_sim *triangles_mixed(int kind, int threads, files_memory *m)
{
    gs4_sim_desc d = scene_cube(14);
    gs4_material a = scene_liquid(1000, 2, 20), b = scene_liquid(900, 1, 20);
    gs4_collider c;
    gs4_emitter e;
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_sim *sim = NULL;
    memset(&c, 0, sizeof c);
    memset(&e, 0, sizeof e);
    d.gravity.y = (gs4_real)-9.81;
    d.threads = threads;
    if (kind == 1) d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    if (kind == 2) d.scheme = GS4_PARTITIONED;
    if (kind == 3) d.scheme = GS4_SEMI_IMPLICIT;
    if (kind == 4) d.walls[0] = d.walls[1] = GS4_WALL_PERIODIC;
    if (m) {
        d.allocator.alloc_fn = files_alloc;
        d.allocator.free_fn = files_free;
        d.allocator.user = m;
    }
    CHECK_RESULT(NULL, gs4_create(&d, &sim), 0);
    CHECK_RESULT(sim, gs4_add_material(sim, &a), 0);
    CHECK(gs4_add_material(sim, &b) == 1);
    c.shape = gs4_sphere(at(0.7, 0.15, 0.5), (gs4_real)0.12);
    c.contact = GS4_WALL_SLIP;
    CHECK_RESULT(sim, gs4_add_collider(sim, &c), 0);
    e.shape = gs4_cylinder(at(0.3, 0.9, 0.5), at(0.3, 0.97, 0.5), (gs4_real)0.1);
    e.fill.velocity = at(0, -1, 0);
    e.fill.material = 1;
    CHECK_RESULT(sim, gs4_add_emitter(sim, &e), 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(0.35, 0.5, 1)), &f) > 0);
    CHECK(gs4_add_particles(sim, gs4_sphere(at(0.8, 0.7, 0.3), (gs4_real)0.12), &f) > 0);
    return sim;
}

/* Closed by every scheme, with the same bits for any number of threads; the state and its memory
 * stay as they are. */
static void test_surface_schemes(void)
{
    int kind, k, i;
    for (kind = 0; kind < 5; kind++) {
        gs4_sim *one, *three;
        if (kind > 0 && kind < 4 && !test_full) continue;
        one = triangles_mixed(kind, 1, NULL);
        three = triangles_mixed(kind, 3, NULL);
        for (k = 0; k < 3; k++) {
            gs4_triangles t, u;
            const uint64_t hash = gs4_state_hash(one), memory = gs4_get_stats(one).memory_bytes;
            t = triangles_of(one, -1, 0);
            CHECK(gs4_state_hash(one) == hash);
            u = triangles_of(three, -1, 0);
            CHECK(t.vertex_count == u.vertex_count && t.triangle_count == u.triangle_count);
            if (t.vertex_count == u.vertex_count && t.triangle_count == u.triangle_count) {
                const size_t bytes = (size_t)t.vertex_count * 3 * sizeof(gs4_real);
                CHECK(memcmp(t.positions, u.positions, bytes) == 0);
                CHECK(memcmp(t.normals, u.normals, bytes) == 0);
                CHECK(memcmp(t.values, u.values, bytes / 3) == 0);
                CHECK(memcmp(t.materials, u.materials, (size_t)t.vertex_count) == 0);
                CHECK(memcmp(t.triangles, u.triangles, (size_t)t.triangle_count * 3 * sizeof(int))
                      == 0);
            }
            gs4_surface_free(one, &t);
            gs4_surface_free(three, &u);
            CHECK(gs4_get_stats(one).memory_bytes == memory);
            for (i = 0; i < 10; i++) {
                const gs4_real dt = (gs4_real)(0.5 * (double)gs4_stable_dt(one));
                CHECK_RESULT(one, gs4_step(one, dt), 0);
                CHECK_RESULT(three, gs4_step(three, dt), 0);
            }
            CHECK(gs4_state_hash(one) == gs4_state_hash(three));
        }
        gs4_destroy(one);
        gs4_destroy(three);
    }
}

/* Memory refused at every place: a code, nothing lost, and the state as it was. */
static void test_surface_memory(void)
{
    files_memory m;
    gs4_sim *sim;
    gs4_triangles t;
    uint64_t hash;
    long before, live, k;
    int r = -1, write;
    memset(&m, 0, sizeof m);
    m.fail_at = -1;
    sim = triangles_mixed(0, 1, &m);
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.01), 0);
    hash = gs4_state_hash(sim);
    live = m.live;
    for (write = 0; write < 2; write++)
        for (r = -1, k = 0; r < 0 && k < 100; k++) {
            before = m.calls;
            m.fail_at = before + k;
            r = write ? gs4_write_surface(sim, files_path("surface.ply"))
                      : gs4_surface(sim, GS4_FIELD_VELOCITY, &t);
            m.fail_at = -1;
            if (r == 0 && !write) {
                CHECK(m.live > live && t.vertex_count > 0);
                gs4_surface_free(sim, &t);
            }
            CHECK(r == 0 || (r == GS4_ERROR_MEMORY && gs4_last_error(sim)[0]));
            CHECK(m.live == live && gs4_state_hash(sim) == hash && !files_leftover());
        }
    CHECK(r == 0 && k > 10);
    remove(files_path("surface.ply"));
    gs4_destroy(sim);
    CHECK(m.live == 0 && m.wrong == 0);
}

/* The file has what the triangles have. */
static void test_surface_file(void)
{
    const char *head_end = "end_header\n", *type = sizeof(gs4_real) == 4 ? "float" : "double";
    gs4_sim *sim = triangles_mixed(0, 1, NULL);
    gs4_triangles t;
    char line[200], *data, *at_end;
    size_t bytes = 0, row = 7 * sizeof(gs4_real) + 1;
    int i, k, bad = 0;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)0.02), 0);
    t = triangles_of(sim, -1, 0);
    CHECK_RESULT(sim, gs4_write_surface(sim, files_path("surface.ply")), 0);
    data = (char *)files_read(files_path("surface.ply"), &bytes);
    at_end = data ? strstr(data, head_end) : NULL;
    CHECK(at_end != NULL);
    if (at_end) {
        at_end += strlen(head_end);
        CHECK(strncmp(data, "ply\nformat binary_little_endian 1.0\n", 36) == 0);
        sprintf(line, "element vertex %d\nproperty %s x\n", t.vertex_count, type);
        CHECK(strstr(data, line) != NULL);
        sprintf(line,
                "property %s nz\nproperty %s speed\nproperty uchar material\n"
                "element face %d\nproperty list uchar int vertex_indices\n",
                type, type, t.triangle_count);
        CHECK(strstr(data, line) != NULL);
        CHECK(bytes
              == (size_t)(at_end - data) + row * (size_t)t.vertex_count
                     + 13 * (size_t)t.triangle_count);
        for (i = 0; i < t.vertex_count; i++) {
            gs4_real x[7];
            memcpy(x, at_end + row * (size_t)i, sizeof x);
            for (k = 0; k < 3; k++)
                bad += x[k] != t.positions[3 * i + k] || x[k + 3] != t.normals[3 * i + k];
            bad += x[6] != t.values[i] || at_end[row * (size_t)i + row - 1] != (char)t.materials[i];
        }
        at_end += row * (size_t)t.vertex_count;
        for (i = 0; i < t.triangle_count; i++)
            bad += at_end[13 * (size_t)i] != 3
                   || memcmp(at_end + 13 * (size_t)i + 1, t.triangles + 3 * i, 12) != 0;
        CHECK(bad == 0);
    }
    free(data);
    gs4_surface_free(sim, &t);
    remove(files_path("surface.ply"));
    CHECK_RESULT(sim, gs4_write_surface(sim, NULL), GS4_ERROR_ARGUMENT);
    CHECK_RESULT(sim, gs4_write_surface(sim, files_path("none/such/file")), GS4_ERROR_IO);
    if (files_exists("/dev/full"))
        CHECK_RESULT(sim, gs4_write_surface(sim, "/dev/full"), GS4_ERROR_IO);
    CHECK(gs4_write_surface(NULL, "x") == GS4_ERROR_ARGUMENT && !files_leftover());
    gs4_destroy(sim);
    sim = triangles_scene(8); /* no particles: a file without vertices */
    CHECK_RESULT(sim, gs4_write_surface(sim, files_path("surface.ply")), 0);
    remove(files_path("surface.ply"));
    gs4_destroy(sim);
}

/* Clouds of particles at random, as spray and noise are: closed all the same. */
static void test_surface_random(void)
{
    uint64_t state = 1;
    int k, i;
    for (k = 0; k < (test_full ? 60 : 12); k++) {
        const double h = 1.0 / 12;
        gs4_sim *sim = triangles_scene(12);
        const int count = 20 << k % 8;
        gs4_real *x = (gs4_real *)malloc((size_t)count * 3 * sizeof *x);
        gs4_fill f = scene_fill(at(0, 0, 0));
        gs4_triangles t;
        triangles_count c;
        for (i = 0; i < 3 * count; i++) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            x[i] = (gs4_real)(0.999 * (double)(state >> 40) / 16777216.0);
        }
        CHECK(gs4_add_points(sim, x, count, (gs4_real)(h * h * h / 8), &f) == count);
        CHECK_RESULT(sim, gs4_surface(sim, GS4_FIELD_VELOCITY, &t), 0);
        c = triangles_counted(sim, &t);
        CHECK(c.open == 0 && c.outside < 1e-4 && c.length < 1e-4);
        CHECK_CLOSE(c.volume / triangles_volume(sim), 1, 0.1);
        gs4_surface_free(sim, &t);
        gs4_destroy(sim);
        free(x);
    }
}

static void run_surface(void)
{
    files_begin();
    RUN(test_surface_sphere);
    RUN_ONCE(test_surface_shapes);
    RUN_ONCE(test_surface_thin);
    RUN_ONCE(test_surface_walls);
    RUN_ONCE(test_surface_pool);
    RUN_ONCE(test_surface_materials);
    RUN_ONCE(test_surface_schemes);
    RUN(test_surface_memory);
    RUN(test_surface_file);
    RUN_ONCE(test_surface_random);
    files_end();
}
