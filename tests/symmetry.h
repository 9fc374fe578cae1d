/* A scene and its images under the symmetries of a cube: axes permuted, mirrored, or both. Space
 * has no preferred axis, so each image must do what the scene does, particle by particle, up to
 * rounding. A scene is written once, in its own coordinates; the functions below put it into a
 * simulation through a map. Include after test.h and scenes.h. */
#ifndef SYMMETRY_H
#define SYMMETRY_H

/* Component i of the image of a vector is sign[i] times its component axis[i]. */
typedef struct symmetry_map {
    int axis[3], sign[3];
} symmetry_map;

enum {
    SYMMETRY_SHAPES = 4,
    SYMMETRY_VERTICES = 12,
    SYMMETRY_TRIANGLES = 20
};

/* A simulation that is being built through a map, and the shapes that it points to. */
typedef struct symmetry_world {
    symmetry_map map;
    gs4_sim *sim;
    void (*half_way)(struct symmetry_world *w); /* called after half of the steps, or NULL */
    int shapes, has_mesh;
    struct symmetry_shape {
        symmetry_map map;
        gs4_shape is;
        gs4_real vertices[3 * SYMMETRY_VERTICES];
        int triangles[3 * SYMMETRY_TRIANGLES];
    } shape[SYMMETRY_SHAPES];
} symmetry_world;

/* Element n of 48: six permutations, eight sets of mirrors each; the first 6 have no mirrors. */
static symmetry_map symmetry_element(int n)
{
    static const int permutations[6][3] = { { 0, 1, 2 }, { 1, 2, 0 }, { 2, 0, 1 },
                                            { 1, 0, 2 }, { 2, 1, 0 }, { 0, 2, 1 } };
    symmetry_map m;
    int i;
    for (i = 0; i < 3; i++) {
        m.axis[i] = permutations[n % 6][i];
        m.sign[i] = n / 6 >> i & 1 ? -1 : 1;
    }
    return m;
}

/* -1 for maps that turn a right hand into a left one */
static int symmetry_determinant(const symmetry_map *m)
{
    const int odd = (m->axis[0] + 1) % 3 != m->axis[1];
    return (odd ? -1 : 1) * m->sign[0] * m->sign[1] * m->sign[2];
}

static gs4_vec3 symmetry_vector(const symmetry_map *m, gs4_vec3 v)
{
    const gs4_real from[3] = { v.x, v.y, v.z };
    gs4_vec3 to;
    to.x = (gs4_real)m->sign[0] * from[m->axis[0]];
    to.y = (gs4_real)m->sign[1] * from[m->axis[1]];
    to.z = (gs4_real)m->sign[2] * from[m->axis[2]];
    return to;
}

/* Angular velocities. */
static gs4_vec3 symmetry_pseudovector(const symmetry_map *m, gs4_vec3 w)
{
    const gs4_real d = (gs4_real)symmetry_determinant(m);
    w.x *= d;
    w.y *= d;
    w.z *= d;
    return symmetry_vector(m, w);
}

/* From the image back to the scene. */
static gs4_vec3 symmetry_back(const symmetry_map *m, gs4_vec3 v)
{
    const gs4_real from[3] = { v.x, v.y, v.z };
    gs4_real to[3];
    int i;
    for (i = 0; i < 3; i++) to[m->axis[i]] = (gs4_real)m->sign[i] * from[i];
    v.x = to[0];
    v.y = to[1];
    v.z = to[2];
    return v;
}

/* Side 0 to 5 of the image, in the order of gs4_sim_desc's walls: the scene's side it is. */
static int symmetry_side(const symmetry_map *m, int side)
{
    const int i = side / 2;
    return 2 * m->axis[i] + (m->sign[i] > 0 ? side & 1 : !(side & 1));
}

static gs4_sim_desc symmetry_desc(const symmetry_map *m, const gs4_sim_desc *scene)
{
    const gs4_real origin[3] = { scene->origin.x, scene->origin.y, scene->origin.z };
    gs4_sim_desc d = *scene;
    gs4_real low[3];
    int i;
    for (i = 0; i < 3; i++) {
        const int a = m->axis[i];
        d.cells[i] = scene->cells[a];
        low[i] = m->sign[i] > 0 ? origin[a]
                                : -(origin[a] + (gs4_real)scene->cells[a] * scene->cell_size);
    }
    d.origin = at((double)low[0], (double)low[1], (double)low[2]);
    d.gravity = symmetry_vector(m, scene->gravity);
    for (i = 0; i < 6; i++) {
        const int from = symmetry_side(m, i);
        d.walls[i] = scene->walls[from];
        d.wall_temperature[i] = scene->wall_temperature[from];
        d.wall_is_isothermal[i] = scene->wall_is_isothermal[from];
    }
    return d;
}

static gs4_real symmetry_distance(gs4_vec3 p, void *user)
{
    const struct symmetry_shape *s = (const struct symmetry_shape *)user;
    return s->is.distance(symmetry_back(&s->map, p), s->is.user);
}

/* Vertices mapped; triangles turned over where the map turns hands, to stay counter-clockwise.
 * The library samples the distance of a mesh on a lattice that begins 6.49 spacings below it and
 * ends 6.51 above or more: that no sample has a vertex in its row. So mirror images of a mesh
 * are sampled elsewhere (apart by up to 5e-4 of the box in `bodies`); they are left out. */
static gs4_shape symmetry_mesh(struct symmetry_shape *s)
{
    const int over = symmetry_determinant(&s->map) < 0;
    int i;
    CHECK(s->is.vertex_count <= SYMMETRY_VERTICES && s->is.triangle_count <= SYMMETRY_TRIANGLES);
    for (i = 0; i < s->is.vertex_count; i++) {
        const gs4_real *v = s->is.vertices + 3 * i;
        const gs4_vec3 p = symmetry_vector(&s->map, at((double)v[0], (double)v[1], (double)v[2]));
        s->vertices[3 * i] = p.x;
        s->vertices[3 * i + 1] = p.y;
        s->vertices[3 * i + 2] = p.z;
    }
    for (i = 0; i < s->is.triangle_count; i++) {
        const int *t = s->is.triangles + 3 * i;
        s->triangles[3 * i] = t[0];
        s->triangles[3 * i + 1] = t[1 + over];
        s->triangles[3 * i + 2] = t[2 - over];
    }
    return gs4_mesh(s->vertices, s->is.vertex_count, s->triangles, s->is.triangle_count);
}

static gs4_shape symmetry_shape(symmetry_world *w, gs4_shape shape)
{
    const gs4_vec3 a = symmetry_vector(&w->map, shape.a), b = symmetry_vector(&w->map, shape.b);
    const gs4_vec3 low = at(fmin((double)a.x, (double)b.x), fmin((double)a.y, (double)b.y),
                            fmin((double)a.z, (double)b.z)),
                   high = at(fmax((double)a.x, (double)b.x), fmax((double)a.y, (double)b.y),
                             fmax((double)a.z, (double)b.z));
    struct symmetry_shape *s;
    switch (shape.kind) {
    case GS4_SHAPE_BOX: return gs4_box(low, high);
    case GS4_SHAPE_SPHERE: return gs4_sphere(a, shape.radius);
    case GS4_SHAPE_CYLINDER: return gs4_cylinder(a, b, shape.radius);
    case GS4_SHAPE_PLANE: return gs4_plane(a, b);
    case GS4_SHAPE_SDF:
    case GS4_SHAPE_MESH:
    case GS4_SHAPE_NONE: break;
    }
    CHECK(w->shapes < SYMMETRY_SHAPES);
    s = &w->shape[w->shapes++];
    s->map = w->map;
    s->is = shape;
    w->has_mesh |= shape.kind == GS4_SHAPE_MESH;
    return shape.kind == GS4_SHAPE_SDF ? gs4_sdf(symmetry_distance, s, low, high)
                                       : symmetry_mesh(s);
}

static void symmetry_create(symmetry_world *w, const gs4_sim_desc *scene)
{
    const gs4_sim_desc d = symmetry_desc(&w->map, scene);
    CHECK_RESULT(NULL, gs4_create(&d, &w->sim), GS4_OK);
}

static gs4_fill symmetry_fill(const symmetry_map *m, gs4_fill f)
{
    f.velocity = symmetry_vector(m, f.velocity);
    f.angular_velocity = symmetry_pseudovector(m, f.angular_velocity);
    return f;
}

static void symmetry_add_particles(symmetry_world *w, gs4_shape shape, const gs4_fill *fill)
{
    const gs4_fill f = symmetry_fill(&w->map, *fill);
    CHECK_RESULT(w->sim, gs4_add_particles(w->sim, symmetry_shape(w, shape), &f), GS4_OK);
}

static void symmetry_add_points(symmetry_world *w, const gs4_real *xyz, int count, gs4_real volume,
                                const gs4_fill *fill)
{
    const gs4_fill f = symmetry_fill(&w->map, *fill);
    gs4_real *points = (gs4_real *)malloc(3 * (size_t)count * sizeof *points);
    int i;
    for (i = 0; i < count; i++) {
        const gs4_real *v = xyz + 3 * i;
        const gs4_vec3 p = symmetry_vector(&w->map, at((double)v[0], (double)v[1], (double)v[2]));
        points[3 * i] = p.x;
        points[3 * i + 1] = p.y;
        points[3 * i + 2] = p.z;
    }
    CHECK_RESULT(w->sim, gs4_add_points(w->sim, points, count, volume, &f), GS4_OK);
    free(points);
}

static void symmetry_add_collider(symmetry_world *w, const gs4_collider *collider)
{
    gs4_collider c = *collider;
    c.shape = symmetry_shape(w, c.shape);
    c.velocity = symmetry_vector(&w->map, c.velocity);
    c.angular_velocity = symmetry_pseudovector(&w->map, c.angular_velocity);
    c.pivot = symmetry_vector(&w->map, c.pivot);
    CHECK_RESULT(w->sim, gs4_add_collider(w->sim, &c), GS4_OK);
}

static void symmetry_move_collider(symmetry_world *w, int collider, gs4_vec3 velocity,
                                   gs4_vec3 spin)
{
    CHECK_RESULT(w->sim,
                 gs4_move_collider(w->sim, collider, symmetry_vector(&w->map, velocity),
                                   symmetry_pseudovector(&w->map, spin)),
                 GS4_OK);
}

static void symmetry_move_emitter(symmetry_world *w, int emitter, gs4_vec3 travel)
{
    CHECK_RESULT(w->sim, gs4_move_emitter(w->sim, emitter, symmetry_vector(&w->map, travel)),
                 GS4_OK);
}

static void symmetry_add_emitter(symmetry_world *w, const gs4_emitter *emitter)
{
    gs4_emitter e = *emitter;
    e.shape = symmetry_shape(w, e.shape);
    e.fill = symmetry_fill(&w->map, e.fill);
    e.travel = symmetry_vector(&w->map, e.travel);
    CHECK_RESULT(w->sim, gs4_add_emitter(w->sim, &e), GS4_OK);
}

/* Velocities, and temperatures where there is heat, of all particles as functions of the place. */
typedef gs4_vec3 (*symmetry_velocity_fn)(gs4_vec3 p);
typedef double (*symmetry_temperature_fn)(gs4_vec3 p);

static void symmetry_edit(symmetry_world *w, symmetry_velocity_fn velocity,
                          symmetry_temperature_fn temperature)
{
    const gs4_view x = gs4_particles(w->sim, GS4_FIELD_POSITION);
    gs4_edit v = gs4_edit_particles(w->sim, GS4_FIELD_VELOCITY), T;
    int i;
    memset(&T, 0, sizeof T);
    if (temperature) T = gs4_edit_particles(w->sim, GS4_FIELD_TEMPERATURE);
    for (i = 0; i < x.count; i++) {
        const gs4_real *q = x.data + (size_t)i * (size_t)x.stride;
        const gs4_vec3 p = symmetry_back(&w->map, at((double)q[0], (double)q[1], (double)q[2]));
        if (velocity) {
            const gs4_vec3 u = symmetry_vector(&w->map, velocity(p));
            gs4_real *to = v.data + (size_t)i * (size_t)v.stride;
            to[0] = u.x;
            to[1] = u.y;
            to[2] = u.z;
        }
        if (temperature) T.data[(size_t)i * (size_t)T.stride] = (gs4_real)temperature(p);
    }
}

/* --- comparing -------------------------------------------------------------------------------- */

/* All numbers of all particles in the coordinates of the scene, 29 a particle. */
enum {
    SYMMETRY_FIELDS = GS4_FIELD_PRESSURE + 1,
    SYMMETRY_NUMBERS = 29
};
typedef struct symmetry_state {
    int count, ids;
    double *numbers;
    int *id, *with_id; /* of a particle; the particle that has it, -1: none */
    int first[SYMMETRY_FIELDS], components[SYMMETRY_FIELDS];
    double stable_dt, mass, energy, heat, volume, momentum[3], spin[3];
} symmetry_state;

/* out_ab += sign_i sign_j m_ij, a = axis[i], b = axis[j]: R^T m R */
static void symmetry_tensor_back(const symmetry_map *map, double m[3][3], double out[3][3])
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            out[map->axis[i]][map->axis[j]] = map->sign[i] * map->sign[j] * m[i][j];
}

/* One value of a field, which its number of components says the kind of. */
static void symmetry_value_back(const symmetry_map *map, const gs4_real *v, int components,
                                double *out)
{
    static const int symmetric[9] = { 0, 3, 4, 3, 1, 5, 4, 5, 2 };
    double m[3][3], to[3][3];
    int i;
    if (components == 1) {
        out[0] = (double)v[0];
        return;
    }
    if (components == 3) {
        for (i = 0; i < 3; i++) out[map->axis[i]] = map->sign[i] * (double)v[i];
        return;
    }
    for (i = 0; i < 9; i++) m[i / 3][i % 3] = (double)v[components == 6 ? symmetric[i] : i];
    symmetry_tensor_back(map, m, to);
    for (i = 0; i < 9; i++) out[components == 6 ? symmetric[i] : i] = to[i / 3][i % 3];
}

static symmetry_state symmetry_look(symmetry_world *w)
{
    const gs4_stats stats = gs4_get_stats(w->sim);
    const int hand = symmetry_determinant(&w->map);
    symmetry_state s;
    int f, i, at_number = 0;
    memset(&s, 0, sizeof s);
    s.count = stats.particles;
    s.numbers = (double *)calloc((size_t)s.count + 1, SYMMETRY_NUMBERS * sizeof(double));
    s.id = (int *)malloc(((size_t)s.count + 1) * sizeof(int));
    for (i = 0; i < s.count; i++) {
        s.id[i] = (int)gs4_particle_ids(w->sim)[i];
        s.ids = s.id[i] >= s.ids ? s.id[i] + 1 : s.ids;
    }
    s.with_id = (int *)malloc(((size_t)s.ids + 1) * sizeof(int));
    for (i = 0; i < s.ids; i++) s.with_id[i] = -1;
    for (i = 0; i < s.count; i++) s.with_id[s.id[i]] = i;
    for (f = 0; f < SYMMETRY_FIELDS; f++) {
        const gs4_view v = gs4_particles(w->sim, (gs4_field)f);
        s.first[f] = at_number;
        if (!v.data) continue;
        s.components[f] = v.components;
        for (i = 0; i < s.count; i++)
            symmetry_value_back(&w->map, v.data + (size_t)i * (size_t)v.stride, v.components,
                                s.numbers + SYMMETRY_NUMBERS * i + at_number);
        at_number += v.components;
    }
    CHECK(at_number <= SYMMETRY_NUMBERS);
    s.stable_dt = (double)gs4_stable_dt(w->sim);
    s.mass = stats.mass;
    s.energy = stats.kinetic_energy;
    s.heat = stats.thermal_energy;
    s.volume = stats.volume;
    for (i = 0; i < 3; i++) {
        s.momentum[w->map.axis[i]] = w->map.sign[i] * stats.momentum[i];
        s.spin[w->map.axis[i]] = hand * w->map.sign[i] * stats.angular_momentum[i];
    }
    return s;
}

static void symmetry_forget(symmetry_state *s)
{
    free(s->numbers);
    free(s->id);
    free(s->with_id);
}

static double symmetry_apart(const symmetry_state *s, int i, const double *x)
{
    const double *y = s->numbers + SYMMETRY_NUMBERS * i;
    return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1])
                + (x[2] - y[2]) * (x[2] - y[2]));
}

/* The particle of `s` nearest to a place, -1 where there is none within `reach`. The one with the
 * given id is looked at first: where points were added ids agree, in shapes and mouths not. */
static int symmetry_nearest(const symmetry_state *s, const double *x, int id, double reach)
{
    const int guess = id < s->ids ? s->with_id[id] : -1;
    int i, nearest = -1;
    if (guess >= 0 && symmetry_apart(s, guess, x) < 1e-3 * reach) return guess;
    for (i = 0; i < s->count; i++) {
        const double d = symmetry_apart(s, i, x);
        if (d > reach) continue;
        reach = d;
        nearest = i;
    }
    return nearest;
}

/* What rounding is measured by: a cell a step for velocities, the box for positions, the largest
 * of its kind for the rest. */
static void symmetry_scales(const symmetry_state *s, const gs4_sim_desc *d, double dt,
                            double scale[SYMMETRY_FIELDS])
{
    const int most = d->cells[0] > d->cells[1] ? d->cells[0] : d->cells[1];
    int f, i, c;
    for (f = 0; f < SYMMETRY_FIELDS; f++) {
        scale[f] = 0;
        for (i = 0; i < s->count; i++)
            for (c = 0; c < s->components[f]; c++)
                scale[f] = fmax(scale[f], fabs(s->numbers[SYMMETRY_NUMBERS * i + s->first[f] + c]));
    }
    scale[GS4_FIELD_POSITION] =
        fmax(scale[GS4_FIELD_POSITION],
             (double)d->cell_size * (most > d->cells[2] ? most : d->cells[2]));
    scale[GS4_FIELD_VELOCITY] = fmax(scale[GS4_FIELD_VELOCITY], (double)d->cell_size / dt);
    scale[GS4_FIELD_LIQUID_FRACTION] = 1;
}

/* Largest differences of two states by field, in units of `scale`; whether every particle has a
 * mate of its own within a hundredth of a cell. */
static int symmetry_compare(const symmetry_state *a, const symmetry_state *b, double cell,
                            const double scale[SYMMETRY_FIELDS], double worst[SYMMETRY_FIELDS])
{
    char *taken = (char *)calloc((size_t)a->count + 1, 1);
    int i, f, c, alone = a->count != b->count;
    for (i = 0; i < b->count && !alone; i++) {
        const double *y = b->numbers + SYMMETRY_NUMBERS * i, *x;
        const int mate = symmetry_nearest(a, y, b->id[i], 0.01 * cell);
        if (mate < 0 || taken[mate]) {
            alone = 1;
            break;
        }
        taken[mate] = 1;
        x = a->numbers + SYMMETRY_NUMBERS * mate;
        for (f = 0; f < SYMMETRY_FIELDS; f++)
            for (c = 0; c < a->components[f]; c++) {
                const double e = fabs(x[a->first[f] + c] - y[a->first[f] + c]);
                if (e > worst[f] * scale[f]) worst[f] = e / scale[f];
            }
    }
    free(taken);
    return !alone;
}

static double symmetry_sums_apart(const symmetry_state *a, const symmetry_state *b, double speed,
                                  double size)
{
    double worst = fabs(a->stable_dt / b->stable_dt - 1);
    int i;
    worst = fmax(worst, fabs(a->mass / b->mass - 1));
    worst = fmax(worst, fabs(a->volume / b->volume - 1));
    worst = fmax(worst, fabs(a->energy - b->energy) / (a->mass * speed * speed));
    if (a->heat > 0 || a->heat < 0) worst = fmax(worst, fabs(a->heat / b->heat - 1));
    for (i = 0; i < 3; i++) {
        worst = fmax(worst, fabs(a->momentum[i] - b->momentum[i]) / (a->mass * speed));
        worst = fmax(worst, fabs(a->spin[i] - b->spin[i]) / (a->mass * speed * size));
    }
    return worst;
}

/* What rounding may come to, in units of the scales. Measured: 1.1e-13 in double, 7.4e-6 in float.
 * The most that is expected: the last bit of a sub-grid velocity, kept in half of gs4_real's
 * width, falls the other way. Of a tenth of a cell a step that is 2^-25 or 2^-9 (float) of 0.1
 * cells; boxes are five cells wide or more. */
static double symmetry_rounding(void)
{
    return (sizeof(gs4_real) == 8 ? ldexp(1, -25) : ldexp(1, -9)) * 0.1 / 5;
}

/* Builds variant `n` of a scene. */
typedef void (*symmetry_scene)(symmetry_world *w, int n);

/* Runs it; *dt is set where it is 0. 0: a step was refused. */
static int symmetry_run(symmetry_world *w, int element, symmetry_scene scene, int n, int steps,
                        double *dt)
{
    int i, result = GS4_OK;
    memset(w, 0, sizeof *w);
    w->map = symmetry_element(element);
    scene(w, n);
    if (*dt <= 0) *dt = 0.3 * (double)gs4_stable_dt(w->sim);
    for (i = 0; i < steps && result == GS4_OK; i++) {
        if (w->half_way && i == steps / 2) w->half_way(w);
        result = gs4_step(w->sim, (gs4_real)*dt);
    }
    CHECK_RESULT(w->sim, result, GS4_OK);
    return result == GS4_OK;
}

/* Image i of variant n: the permutations, the mirrors, and others that change with n; all 48 in
 * slow and full runs. 0: there is no more. */
static int symmetry_image(int i, int n, int has_mesh)
{
    if (i < 6) return i;
    if (has_mesh) return 0;
    if (test_slow || test_full) return i < 48 ? i : 0;
    if (i < 9) return 6 << (i - 6);
    return i < 11 ? 6 + (11 * n + 17 * i) % 42 : 0;
}

static void symmetry_print(const char *name, int n, const symmetry_state *s,
                           const double worst[SYMMETRY_FIELDS], double sums)
{
    static const char *const fields[SYMMETRY_FIELDS] = { "x", "v", "J", "s", "F",
                                                         "T", "l", "q", "m", "p" };
    int f;
    printf("\n  %s %d, %d particles:", name, n, s->count);
    for (f = 0; f < SYMMETRY_FIELDS; f++)
        if (s->components[f]) printf(" %s %.1e", fields[f], worst[f]);
    printf(" sums %.1e", sums);
}

/* Variant `n` and its images after `steps` steps: the same up to rounding. */
static void symmetry_check(const char *name, symmetry_scene scene, int n, int steps)
{
    static symmetry_world w;
    double scale[SYMMETRY_FIELDS], worst[SYMMETRY_FIELDS], sums = 0, dt = 0, most = 0;
    symmetry_state a;
    gs4_sim_desc d;
    int i, element, has_mesh, f, good = symmetry_run(&w, 0, scene, n, steps, &dt);
    memset(worst, 0, sizeof worst);
    a = symmetry_look(&w);
    CHECK(a.count > 0);
    d = gs4_get_desc(w.sim);
    has_mesh = w.has_mesh;
    gs4_destroy(w.sim);
    symmetry_scales(&a, &d, dt, scale);
    for (i = 1; good && (element = symmetry_image(i, n, has_mesh)) > 0; i++) {
        symmetry_state b;
        good = symmetry_run(&w, element, scene, n, steps, &dt);
        b = symmetry_look(&w);
        if (!symmetry_compare(&a, &b, (double)d.cell_size, scale, worst)) {
            printf("    %s %d: image %d has other particles\n", name, n, element);
            good = 0;
        }
        sums = fmax(sums, symmetry_sums_apart(&a, &b, scale[GS4_FIELD_VELOCITY],
                                              scale[GS4_FIELD_POSITION]));
        symmetry_forget(&b);
        gs4_destroy(w.sim);
    }
    for (f = 0; f < SYMMETRY_FIELDS; f++) most = fmax(most, worst[f]);
    good = good && most <= symmetry_rounding() && sums <= symmetry_rounding();
    if (test_filter[0] || !good) symmetry_print(name, n, &a, worst, sums);
    if (!good) printf("\n");
    CHECK(good);
    symmetry_forget(&a);
}
#endif
