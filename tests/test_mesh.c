/* Meshes: their sampled distance against closed forms, what is inside, and what is refused. */

#define MESH_H 0.05 /* cell; the domain is a cube of side 1 */

static const int mesh_faces[36] = { 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                    2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5 };

/* A mesh that is put together of parts. */
typedef struct mesh_parts {
    gs4_real *v;
    int *t, vertices, triangles;
} mesh_parts;

static mesh_parts mesh_begin(int vertices, int triangles)
{
    mesh_parts m;
    memset(&m, 0, sizeof m);
    m.v = (gs4_real *)malloc(3 * (size_t)vertices * sizeof *m.v);
    m.t = (int *)malloc(3 * (size_t)triangles * sizeof *m.t);
    return m;
}

static void mesh_end(mesh_parts *m)
{
    free(m->v);
    free(m->t);
}

static int mesh_vertex(mesh_parts *m, double x, double y, double z)
{
    m->v[3 * m->vertices] = (gs4_real)x;
    m->v[3 * m->vertices + 1] = (gs4_real)y;
    m->v[3 * m->vertices + 2] = (gs4_real)z;
    return m->vertices++;
}

static void mesh_triangle(mesh_parts *m, int a, int b, int c)
{
    m->t[3 * m->triangles] = a;
    m->t[3 * m->triangles + 1] = b;
    m->t[3 * m->triangles + 2] = c;
    m->triangles++;
}

/* inwards: its triangles face inwards */
static void mesh_box(mesh_parts *m, gs4_vec3 low, gs4_vec3 high, int inwards)
{
    const int first = m->vertices;
    int i;
    for (i = 0; i < 8; i++)
        mesh_vertex(m, (double)(i & 1 ? high.x : low.x), (double)(i & 2 ? high.y : low.y),
                    (double)(i & 4 ? high.z : low.z));
    for (i = 0; i < 36; i += 3)
        mesh_triangle(m, first + mesh_faces[i], first + mesh_faces[i + 1 + inwards],
                      first + mesh_faces[i + 2 - inwards]);
}

/* Round the axis y through `centre`: rings of n vertices each, from a pole to the other. */
static void mesh_of_rings(mesh_parts *m, gs4_vec3 centre, const double (*ring)[2], int rings, int n)
{
    const double two_pi = 8 * atan(1.0);
    int i, j, pole[2];
    for (i = 0; i < 2; i++)
        pole[i] = mesh_vertex(m, (double)centre.x, (double)centre.y + ring[i ? rings + 1 : 0][1],
                              (double)centre.z);
    for (j = 1; j <= rings; j++)
        for (i = 0; i < n; i++)
            mesh_vertex(m, (double)centre.x + ring[j][0] * cos(two_pi * i / n),
                        (double)centre.y + ring[j][1],
                        (double)centre.z + ring[j][0] * sin(two_pi * i / n));
    for (i = 0; i < n; i++) {
        const int next = (i + 1) % n, last = pole[1] + 1 + (rings - 1) * n;
        mesh_triangle(m, pole[0], pole[1] + 1 + next, pole[1] + 1 + i);
        mesh_triangle(m, pole[1], last + i, last + next);
        for (j = 1; j < rings; j++) {
            const int above = pole[1] + 1 + (j - 1) * n, below = above + n;
            mesh_triangle(m, above + i, above + next, below + i);
            mesh_triangle(m, below + i, above + next, below + next);
        }
    }
}

static gs4_shape mesh_shape(const mesh_parts *m)
{
    return gs4_mesh(m->v, m->vertices, m->t, m->triangles);
}

static gs4_sim *mesh_sim(double origin)
{
    gs4_sim_desc d = scene_cube(20);
    gs4_sim *sim = NULL;
    gs4_material m = scene_liquid(1000, 1, 20);
    d.cell_size = (gs4_real)MESH_H;
    d.origin = at(origin, origin, origin);
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    gs4_add_material(sim, &m);
    return sim;
}

/* The body of a mesh at rest; its id. */
static int mesh_body(gs4_sim *sim, const mesh_parts *m)
{
    gs4_collider c;
    int id;
    memset(&c, 0, sizeof c);
    c.shape = mesh_shape(m);
    id = gs4_add_collider(sim, &c);
    CHECK_RESULT(sim, id, 0);
    return id;
}

static double mesh_distance(const gs4_sim *sim, int body, gs4_vec3 p)
{
    return (double)gs4i_collider_distance(&sim->boundary.colliders[body], p);
}

static uint32_t mesh_seed = 1;

static double mesh_random(void) /* in [0, 1) */
{
    mesh_seed = mesh_seed * 1664525u + 1013904223u;
    return (double)(mesh_seed >> 8) / 16777216.0;
}

/* Is the sampled distance d that of the closed form `exact`? Samples are, within 3 cells of the
 * surface; so it is where all eight around are. Beyond, it has the sign and is not less. */
static void mesh_check(double d, double exact, double tolerance)
{
    const double band = (3 - sqrt(3.0) / 2) * MESH_H;
    if (fabs(exact) < band) {
        CHECK_CLOSE(d, exact, tolerance);
    } else {
        CHECK((d < 0) == (exact < 0));
        CHECK_BETWEEN(fabs(d), band - tolerance, fabs(exact) + tolerance);
    }
}

/* A body against the distance of `same`, anywhere in the domain as in the body's own coordinates.
 * Next to edges the samples round what is sharp: trilinear in cells of 1, the least of x, y, z is
 * t^3 where it is t along the diagonal, off by 2/sqrt(27) = 0.385 at most: 0.193 h. */
static void mesh_check_body(const gs4_sim *sim, int body, const gs4_shape *same, double tolerance)
{
    const gs4i_collider *b = &sim->boundary.colliders[body];
    const double origin = (double)sim->grid.origin.x;
    int i;
    for (i = 0; i < 2000; i++) {
        const double x = origin + mesh_random(), y = origin + mesh_random();
        const gs4_vec3 p = at(x, y, origin + mesh_random());
        mesh_check((double)gs4i_collider_distance(b, p),
                   (double)gs4i_shape_distance(same, gs4i_to_collider(b, p)), tolerance);
    }
}

static void test_mesh_box(void)
{
    const gs4_shape box = gs4_box(at(0.2, 0.3, 0.25), at(0.7, 0.8, 0.9));
    gs4_sim *sim = mesh_sim(0);
    mesh_parts m = mesh_begin(8, 12);
    double y;
    int body;
    mesh_box(&m, box.a, box.b, 0);
    body = mesh_body(sim, &m);
    mesh_check_body(sim, body, &box, 0.2 * MESH_H);
    /* where only a face is near it is exact */
    for (y = 0.36; y < 0.74; y += 0.01)
        CHECK_CLOSE(mesh_distance(sim, body, at(0.7 + 0.02, y, 0.5)), 0.02, 1e-6);
    gs4_destroy(sim);
    mesh_end(&m);
}

/* A ball of chords, which are up to r (1 - cos(pi/n)) inside of it along both angles. */
static void test_mesh_ball(void)
{
    enum {
        N = 64,
        RINGS = 31
    };
    const double r = 0.3, pi = 4 * atan(1.0), chord = r * (2 - 2 * cos(pi / N));
    const gs4_shape ball = gs4_sphere(at(0.45, 0.55, 0.5), (gs4_real)r);
    double ring[RINGS + 2][2];
    mesh_parts m = mesh_begin(N * RINGS + 2, 2 * N * RINGS);
    gs4_sim *sim = mesh_sim(0);
    int j;
    for (j = 0; j <= RINGS + 1; j++) {
        ring[j][0] = r * sin(pi * j / (RINGS + 1));
        ring[j][1] = r * cos(pi * j / (RINGS + 1));
    }
    mesh_of_rings(&m, ball.a, (const double(*)[2])ring, RINGS, N);
    CHECK(m.triangles == 2 * N * RINGS);
    /* trilinear: up to (h/2)^2 / 8 times the two curvatures, 1/(r - 3 h) where they are largest */
    mesh_check_body(sim, mesh_body(sim, &m), &ball,
                    chord + MESH_H * MESH_H / 32 * 3 / (r - 3 * MESH_H));
    gs4_destroy(sim);
    mesh_end(&m);
}

/* How many points of the lattice of fillings are in a shape of boxes, by hand. */
static int mesh_count(const gs4_shape *boxes, int count, int last_is_hollow)
{
    const double s = MESH_H / 2;
    int i, j, k, b, n = 0;
    for (i = 0; i < 40; i++)
        for (j = 0; j < 40; j++)
            for (k = 0; k < 40; k++) {
                int in = 0;
                for (b = 0; b < count; b++)
                    if (gs4i_shape_distance(&boxes[b],
                                            at((i + 0.5) * s, (j + 0.5) * s, (k + 0.5) * s))
                        < 0)
                        in = !(b == count - 1 && last_is_hollow);
                n += in;
            }
    return n;
}

/* Parts of a mesh are a union: that overlap, touch with a face or an edge, lie within each other,
 * are there twice; what faces inwards in another is a hollow. */
static void test_mesh_parts(void)
{
    const gs4_vec3 corners[][2] = {
        { at(0.1, 0.4, 0.4), at(0.9, 0.6, 0.6) },  { at(0.4, 0.3, 0.1), at(0.6, 0.7, 0.9) },
        { at(0.1, 0.2, 0.3), at(0.5, 0.7, 0.7) },  { at(0.5, 0.2, 0.3), at(0.9, 0.7, 0.7) },
        { at(0.1, 0.1, 0.3), at(0.5, 0.5, 0.7) },  { at(0.5, 0.5, 0.3), at(0.9, 0.9, 0.7) },
        { at(0.1, 0.1, 0.1), at(0.9, 0.9, 0.9) },  { at(0.3, 0.3, 0.3), at(0.6, 0.6, 0.6) },
        { at(0.2, 0.2, 0.2), at(0.6, 0.7, 0.8) },  { at(0.2, 0.2, 0.2), at(0.6, 0.7, 0.8) },
        { at(0.05, 0.1, 0.1), at(0.8, 0.9, 0.9) }, { at(0.3, 0.3, 0.3), at(0.7, 0.6, 0.6) },
    };
    int pair;
    for (pair = 0; pair < 6; pair++) {
        const gs4_fill f = scene_fill(at(0, 0, 0));
        const int hollow = pair == 5;
        gs4_sim *sim = mesh_sim(0);
        mesh_parts m = mesh_begin(16, 24);
        gs4_shape boxes[2];
        int i, body;
        for (i = 0; i < 2; i++) {
            boxes[i] = gs4_box(corners[2 * pair + i][0], corners[2 * pair + i][1]);
            mesh_box(&m, boxes[i].a, boxes[i].b, hollow && i);
        }
        CHECK(gs4_add_particles(sim, mesh_shape(&m), &f) == mesh_count(boxes, 2, hollow));
        body = mesh_body(sim, &m);
        for (i = 0; i < 1000; i++) {
            const gs4_vec3 p = at(mesh_random(), 0.05 + 0.9 * mesh_random(), mesh_random());
            const double d[2] = { (double)gs4i_shape_distance(&boxes[0], p),
                                  (double)gs4i_shape_distance(&boxes[1], p) },
                         both = hollow ? fmax(d[0], -d[1]) : fmin(d[0], d[1]);
            if (fabs(d[0]) > 0.3 * MESH_H && fabs(d[1]) > 0.3 * MESH_H)
                CHECK((mesh_distance(sim, body, p) < 0) == (both < 0));
        }
        gs4_destroy(sim);
        mesh_end(&m);
    }
}

/* A slab of any size is the same in the domain; it costs what is in there. */
static void test_mesh_table(void)
{
    double half;
    /* in float no shape reaches farther, whose distances are too coarse */
    for (half = 5; half < (sizeof(gs4_real) == 8 ? 1e7 : 1e3); half *= 100) {
        const gs4_shape box = gs4_box(at(-half, 0.1, -half), at(half, 0.4, half));
        gs4_sim *sim = mesh_sim(0);
        mesh_parts m = mesh_begin(8, 12);
        const uint64_t before = gs4_get_stats(sim).memory_bytes;
        mesh_box(&m, box.a, box.b, 0);
        mesh_check_body(sim, mesh_body(sim, &m), &box, 2e-6);
        /* 40 x 40 samples and 20 around, in 11 x 11 blocks of 8^3. Two surfaces 12 samples apart
         * have those whose midst is within 12.1: 5 layers; and what says where they are. */
        CHECK(gs4_get_stats(sim).memory_bytes - before
              <= 11 * 11 * (5 * 512 * sizeof(gs4_real) + 11 * 4) + 4 * sizeof(gs4i_collider));
        gs4_destroy(sim);
        mesh_end(&m);
    }
}

/* A large slab that travels until its edge is in the domain, turns and tilts is sampled where the
 * domain is. */
static void test_mesh_table_moves(void)
{
    static const double move[4][6] = { { 2, 0, 1.6, 0, 0, 0 },
                                       { 0, 0, 0, 0, 2, 0 },
                                       { 0, 0, 0, 0, 0, 0 },
                                       { -1, 0, 1, 0.1, 0, 0.1 } };
    const gs4_shape box = gs4_box(at(-40, 0.35, -30), at(2, 0.65, 60));
    gs4_sim *sim = mesh_sim(0);
    mesh_parts m = mesh_begin(8, 12);
    gs4_collider c;
    int i, phase, body;
    memset(&c, 0, sizeof c);
    mesh_box(&m, box.a, box.b, 0);
    c.shape = mesh_shape(&m);
    c.pivot = at(0.5, 0.5, 0.5);
    body = gs4_add_collider(sim, &c);
    CHECK_RESULT(sim, body, 0);
    for (phase = 0; phase < 4; phase++) {
        const double *v = move[phase];
        CHECK(gs4_move_collider(sim, body, at(v[0], v[1], v[2]), at(v[3], v[4], v[5])) == 0);
        for (i = 0; i < 50; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
        CHECK_RESULT(sim, gs4_step(sim, (gs4_real)1e-6), GS4_OK);
        mesh_check_body(sim, body, &box, 0.2 * MESH_H);
        CHECK(gs4_get_stats(sim).memory_bytes < 2000000 * sizeof(gs4_real));
    }
    CHECK(fabs((double)sim->boundary.colliders[body].at[0] - 0.5) > 0.4);
    gs4_destroy(sim);
    mesh_end(&m);
}

/* Vertices that no triangle has do not count: the same bits. */
static void test_mesh_stray(void)
{
    const double stray[] = { 10, -1e6, 1e30, NAN };
    gs4_sim *sim = mesh_sim(0);
    mesh_parts m = mesh_begin(9, 12);
    int i, body, body_of[4];
    mesh_box(&m, at(0.2, 0.3, 0.25), at(0.7, 0.8, 0.9), 0);
    body = mesh_body(sim, &m);
    mesh_vertex(&m, 0, 0, 0);
    for (i = 0; i < 4; i++) {
        m.v[24] = m.v[26] = (gs4_real)stray[i];
        body_of[i] = mesh_body(sim, &m);
    }
    for (i = 0; i < 1000; i++) {
        const double x = mesh_random(), y = mesh_random();
        const gs4_vec3 p = at(x, y, mesh_random());
        CHECK(mesh_distance(sim, body_of[i % 4], p) == mesh_distance(sim, body, p));
    }
    gs4_destroy(sim);
    mesh_end(&m);
}

/* Far from the origin, as maps have it. */
static void test_mesh_far(void)
{
    const double far = sizeof(gs4_real) == 8 ? 5e5 : 1000;
    const gs4_shape box =
        gs4_box(at(far + 0.25, far + 0.25, far + 0.25), at(far + 0.75, far + 0.5, far + 0.875));
    gs4_sim *sim = mesh_sim(far);
    mesh_parts m = mesh_begin(8, 12);
    mesh_box(&m, box.a, box.b, 0);
    mesh_check_body(sim, mesh_body(sim, &m), &box, 0.2 * MESH_H);
    gs4_destroy(sim);
    mesh_end(&m);
}

/* Two cones of n triangles each, base to base: every sample sees needles. With poles far away their
 * angles there are below 1e-5. */
static void mesh_cones(int n, double high)
{
    const double r = 0.4, slope = sqrt(r * r + high * high);
    const double ring[3][2] = { { 0, high }, { r, 0 }, { 0, -high } };
    gs4_sim *sim = mesh_sim(0);
    mesh_parts m = mesh_begin(n + 2, 2 * n);
    int i, body;
    mesh_of_rings(&m, at(0.5, 0.5, 0.5), (const double(*)[2])ring, 1, n);
    body = mesh_body(sim, &m);
    for (i = 0; i < 2000; i++) {
        const double x = mesh_random(), y = mesh_random();
        const gs4_vec3 p = at(x, y, mesh_random());
        const double out = hypot((double)p.x - 0.5, (double)p.z - 0.5),
                     up = fabs((double)p.y - 0.5), plane = (out * high + up * r - r * high) / slope,
                     along = (out * r - up * high + high * high) / slope / slope;
        double exact = plane;
        if (plane > 0 && along > 1) exact = hypot(out - r, up);
        if (plane > 0 && along < 0) exact = hypot(out, up - high);
        mesh_check(mesh_distance(sim, body, p), exact, 0.3 * MESH_H);
    }
    gs4_destroy(sim);
    mesh_end(&m);
}

static void test_mesh_fan(void)
{
    mesh_cones(1000, 0.3);
    mesh_cones(2000, 300);
    mesh_cones(100000, 0.3);
}

/* A box whose triangles have vertices of their own, and one with a needle of no area along an
 * edge, as T-junctions are closed with. */
static void test_mesh_soup(void)
{
    const gs4_shape box = gs4_box(at(0.2, 0.3, 0.25), at(0.7, 0.8, 0.9));
    gs4_sim *sim = mesh_sim(0);
    mesh_parts whole = mesh_begin(9, 15), soup = mesh_begin(36, 12);
    int i, middle;
    mesh_box(&whole, box.a, box.b, 0);
    for (i = 0; i < 36; i += 3) {
        int c, v[3];
        for (c = 0; c < 3; c++) {
            const gs4_real *x = whole.v + 3 * whole.t[i + c];
            v[c] = mesh_vertex(&soup, (double)x[0], (double)x[1], (double)x[2]);
        }
        mesh_triangle(&soup, v[0], v[1], v[2]);
    }
    mesh_check_body(sim, mesh_body(sim, &soup), &box, 0.2 * MESH_H);
    middle = mesh_vertex(&whole, 0.4, 0.3, 0.25); /* on edge 0 1, of triangle 0 2 1 */
    whole.t[0] = 0;
    whole.t[1] = 2;
    whole.t[2] = middle;
    mesh_triangle(&whole, middle, 2, 1);
    mesh_triangle(&whole, 0, middle, 1);
    mesh_check_body(sim, mesh_body(sim, &whole), &box, 0.2 * MESH_H);
    gs4_destroy(sim);
    mesh_end(&whole);
    mesh_end(&soup);
}

/* Triangles whose corners lie on a line are as far as the line from end to end. */
static void test_mesh_needles(void)
{
    int i, a;
    for (i = 0; i < 2000; i++) {
        static const int corners[3] = { 0, 1, 2 };
        const double middle = (1 + i % 7) / 8.0;
        double from[3], way[3], p[3], along = 0, length2 = 0, square = 0;
        gs4i_facet facet;
        gs4_real v[9];
        gs4_shape s;
        for (a = 0; a < 3; a++) {
            /* multiples of 1/8 of 1/1024: exactly on a line */
            from[a] = floor(100 * 1024 * mesh_random()) / 1024;
            way[a] = floor(100 * 1024 * mesh_random()) / 1024 - from[a];
            v[i % 3 * 3 + a] = (gs4_real)from[a];
            v[(i + 1) % 3 * 3 + a] = (gs4_real)(from[a] + middle * way[a]);
            v[(i + 2) % 3 * 3 + a] = (gs4_real)(from[a] + way[a]);
            p[a] = from[a] + mesh_random() * way[a] + mesh_random() - 0.5;
            along += (p[a] - from[a]) * way[a];
            length2 += way[a] * way[a];
        }
        along = fmax(0, fmin(along / length2, 1));
        for (a = 0; a < 3; a++) square += pow(from[a] + along * way[a] - p[a], 2);
        s = gs4_mesh(v, 3, corners, 1);
        gs4i_make_facet(&s, 0, 1, &facet);
        CHECK_CLOSE(sqrt(gs4i_facet_distance2(&facet, p)), sqrt(square), 2e-5);
    }
}

/* What the tree finds is the least of the distances of all triangles, to the bit. */
static void mesh_nearest(const gs4_shape *s)
{
    gs4i_memory memory;
    gs4i_facet_tree tree;
    gs4i_facet facet;
    int i, t, a;
    memset(&memory, 0, sizeof memory);
    memory.hook.alloc_fn = gs4i_default_alloc;
    memory.hook.free_fn = gs4i_default_free;
    CHECK(gs4i_build_facets(&memory, &tree, s, 1e-3));
    for (i = 0; i < 300; i++) {
        double p[3], least = DBL_MAX, within;
        for (a = 0; a < 3; a++) p[a] = mesh_random();
        for (t = 0; t < s->triangle_count; t++) {
            gs4i_make_facet(s, t, 1e-3, &facet);
            least = fmin(least, gs4i_facet_distance2(&facet, p));
        }
        within = least * (0.5 + i % 2);
        CHECK(gs4i_nearest2(&tree, 0, 1, p, DBL_MAX) == least);
        CHECK(gs4i_nearest2(&tree, 0, 1, p, within) == fmin(least, within));
    }
    gs4i_free_facets(&memory, &tree);
    CHECK(memory.bytes == 0);
}

/* Triangles anywhere, a third of them needles, among them twins; a fan that stands slanted. */
static void test_mesh_nearest(void)
{
    const double ring[3][2] = { { 0, 0.5 }, { 0.4, 0 }, { 0, -0.3 } };
    mesh_parts any = mesh_begin(900, 300), fan = mesh_begin(402, 800);
    gs4_shape shape;
    int i, c, n;
    for (i = 0; i < 300; i++) {
        int v[3];
        for (c = 0; c < 3; c++) {
            const double x = mesh_random(), y = mesh_random();
            v[c] = mesh_vertex(&any, x, y, mesh_random());
            if (i % 3 == 1) v[c] = v[c > 0];
            if (i % 30 == 2) v[c] = any.t[3 * (i - 1) + c];
        }
        mesh_triangle(&any, v[0], v[1], v[2]);
    }
    mesh_of_rings(&fan, at(0.5, 0.5, 0.5), (const double(*)[2])ring, 1, 400);
    for (i = 0; i < fan.vertices; i++) fan.v[3 * i] += (gs4_real)0.3 * fan.v[3 * i + 1];
    for (n = 1; n <= 300; n += 1 + n / 8 * 4) { /* leaves of every size */
        shape = mesh_shape(&any);
        shape.triangle_count = n;
        mesh_nearest(&shape);
    }
    shape = mesh_shape(&fan);
    mesh_nearest(&shape);
    mesh_end(&any);
    mesh_end(&fan);
}

static void mesh_refused(gs4_sim *sim, const mesh_parts *m, const char *a, const char *b)
{
    gs4_collider c;
    memset(&c, 0, sizeof c);
    c.shape = mesh_shape(m);
    CHECK(gs4_add_collider(sim, &c) == GS4_ERROR_ARGUMENT);
    CHECK(strstr(gs4_last_error(sim), a) && strstr(gs4_last_error(sim), b));
    if (!strstr(gs4_last_error(sim), a) || !strstr(gs4_last_error(sim), b))
        printf("    %s\n", gs4_last_error(sim));
}

static void test_mesh_refused(void)
{
    gs4_sim *sim = mesh_sim(0);
    mesh_parts m = mesh_begin(17, 26);
    int part;
    mesh_box(&m, at(0.2, 0.3, 0.25), at(0.7, 0.8, 0.9), 0);
    m.t[35] = 9;
    mesh_refused(sim, &m, "no vertex 9", "out of range");
    m.t[35] = 5;
    m.triangles = 11; /* a hole */
    mesh_refused(sim, &m, "edge of vertices 3 and", "go 0 triangles one way and 1 the other");
    m.triangles = 12;
    /* a T-junction: a vertex on an edge of triangle 0, which its neighbour has not */
    m.t[2] = mesh_vertex(&m, 0.4, 0.3, 0.25);
    mesh_triangle(&m, 8, 2, 1);
    mesh_refused(sim, &m, "edge of vertices 0 and", "T-junction");
    m.t[2] = 1;
    m.triangles = 12;
    /* two sheets back to back have none */
    m.triangles = 0;
    for (part = 0; part < 2; part++) {
        mesh_triangle(&m, 0, 1 + part, 2 - part);
        mesh_triangle(&m, 1, 3 - part, 2 + part);
    }
    mesh_refused(sim, &m, "no volume", "");
    /* nor do they far away, where places are rounded */
    for (part = 0; part < 12; part++) m.v[part] = (gs4_real)(1e6 + 5 * mesh_random());
    m.triangles = 0;
    mesh_triangle(&m, 0, 1, 2);
    mesh_triangle(&m, 1, 3, 2);
    mesh_triangle(&m, 1, 0, 2);
    mesh_triangle(&m, 2, 3, 1);
    mesh_refused(sim, &m, "no volume", "");
    /* a part alone inside out, and one that another covers in part */
    for (part = 0; part < 2; part++) {
        m.vertices = m.triangles = 0;
        mesh_box(&m, at(0.1, 0.1, 0.1), at(0.6, 0.6, 0.6), 0);
        mesh_box(&m, at(part ? 0.5 : 0.7, 0.2, 0.2), at(0.9, 0.5, 0.5), 1);
        mesh_refused(sim, &m, "a part of the mesh is inside out", "where triangle ");
        CHECK(atoi(strstr(gs4_last_error(sim), "where triangle ") + 15) >= 12);
    }
    m.vertices = m.triangles = 0;
    mesh_box(&m, at(0.1, 0.1, 0.1), at(0.9, 0.1 + 0.2 * MESH_H, 0.9), 0);
    mesh_refused(sim, &m, "thick", "0.3 cells");
    m.vertices = m.triangles = 0;
    mesh_box(&m, at(-1e9, -1e9, -1e9), at(1e9, 0.5, 1e9), 0);
    mesh_refused(sim, &m, "reaches to the coordinate 1e9", "so far out");
    CHECK(sim->boundary.collider_count == 0);
    gs4_destroy(sim);
    mesh_end(&m);
}

/* A slab of 90 m under liquid, at 30 m/s: it is sampled anew within steps. */
static int mesh_do(gs4_sim *sim, const mesh_parts *slab, int stage)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_material m = scene_liquid(1000, 1, 20);
    gs4_collider c;
    memset(&c, 0, sizeof c);
    c.shape = mesh_shape(slab);
    c.velocity = at(-30, 0, 10);
    c.contact = GS4_WALL_SLIP;
    switch (stage) {
    case 0: return gs4_add_material(sim, &m);
    case 1: return gs4_add_particles(sim, gs4_box(at(0.4, 0.35, 0.4), at(0.6, 0.5, 0.6)), &f);
    case 2: return gs4_add_collider(sim, &c);
    }
    return gs4_step(sim, (gs4_real)0.001);
}

/* Every allocation refused once: nothing has changed, and the end is the same; it is the same too
 * where a checkpoint from halfway is loaded, however the slab was sampled. */
static void test_mesh_memory(void)
{
    mesh_parts slab = mesh_begin(8, 12);
    uint64_t reference = 0;
    long k, calls = 0;
    mesh_box(&slab, at(-80, 0.1, -30), at(10, 0.35, 60), 0);
    for (k = -1; k < 0 || k < calls; k += k < 0 || test_slow ? 1 : 7) {
        gs4_sim_desc d = scene_cube(20);
        gs4_sim *sim = NULL;
        files_memory m;
        int stage, first = 0;
        memset(&m, 0, sizeof m);
        m.fail_at = k;
        d.allocator.alloc_fn = files_alloc;
        d.allocator.free_fn = files_free;
        d.allocator.user = &m;
        if (gs4_create(&d, &sim) < 0) continue;
        for (stage = 0; stage < 60; stage++) {
            const uint64_t before = gs4_state_hash(sim);
            const int r = mesh_do(sim, &slab, stage);
            if (stage == 3) first = sim->boundary.colliders[0].field.first[0];
            if (k < 0 && stage == 30) CHECK_RESULT(sim, gs4_save(sim, "mesh.save"), 0);
            if (r >= 0) continue;
            CHECK(k >= 0 && r == GS4_ERROR_MEMORY && gs4_state_hash(sim) == before);
            m.fail_at = -1;
            CHECK_RESULT(sim, mesh_do(sim, &slab, stage), 0);
        }
        CHECK(sim->boundary.colliders[0].field.first[0] > first + 3);
        if (k < 0) {
            reference = gs4_state_hash(sim);
            calls = m.calls;
            CHECK_RESULT(sim, gs4_load(sim, "mesh.save"), 0);
            for (stage = 31; stage < 60; stage++) CHECK_RESULT(sim, mesh_do(sim, &slab, stage), 0);
        }
        CHECK(gs4_state_hash(sim) == reference);
        CHECK(gs4_get_stats(sim).memory_bytes == m.bytes);
        gs4_destroy(sim);
        CHECK(m.live == 0 && m.bytes == 0 && m.wrong == 0);
    }
    remove("mesh.save");
    mesh_end(&slab);
}

/* Plates through all of a large domain: what their samples would take is said. */
static void test_mesh_too_much(void)
{
    gs4_sim_desc d = scene_cube(512);
    gs4_sim *sim = NULL;
    mesh_parts m = mesh_begin(8 * 64, 12 * 64);
    gs4_collider c;
    uint64_t before;
    int i;
    memset(&c, 0, sizeof c);
    for (i = 0; i < 64; i++) mesh_box(&m, at(0, i / 64.0, 0), at(1, (i + 0.5) / 64.0, 1), 0);
    c.shape = mesh_shape(&m);
    CHECK(gs4_create(&d, &sim) == GS4_OK);
    before = gs4_get_stats(sim).memory_bytes;
    CHECK(gs4_add_collider(sim, &c) == GS4_ERROR_MEMORY);
    CHECK(strstr(gs4_last_error(sim), "would take ") != NULL);
    /* all of (1024 + 40)^3 samples but the 20 beyond the ends, in blocks of 8 */
    CHECK_BETWEEN(atof(strstr(gs4_last_error(sim), "would take ") + 11),
                  1024.0 * 1024 * 1024 * sizeof(gs4_real),
                  1072.0 * 1072 * 1072 * sizeof(gs4_real) + 134.0 * 134 * 134 * 4 + 5e6);
    CHECK(gs4_get_stats(sim).memory_bytes - before <= 8 * sizeof(gs4i_collider));
    gs4_destroy(sim);
    mesh_end(&m);
}

static void run_mesh(void)
{
    RUN(test_mesh_box);
    RUN_ONCE(test_mesh_ball);
    RUN_FULL(test_mesh_parts);
    RUN_ONCE(test_mesh_table);
    RUN_FULL(test_mesh_table_moves);
    RUN(test_mesh_stray);
    RUN(test_mesh_far);
    RUN_FULL(test_mesh_fan);
    RUN(test_mesh_soup);
    RUN(test_mesh_needles);
    RUN_ONCE(test_mesh_nearest);
    RUN(test_mesh_refused);
    RUN_FULL(test_mesh_memory);
    RUN_ONCE(test_mesh_too_much);
}
