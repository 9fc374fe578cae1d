/* What a second of computing buys: error against processor time of five scenes whose truth is
 * known, by all schemes, integrators and members of the GS4 family, with sharpened gradients or
 * affine, 4, 8 and 27 particles a cell, five steps and four grids.
 *     breathing drop   a compressible drop breathes and turns: moments sum v.x, sum v^2; truth: the
 *                      finest run
 *     viscous sphere   the torsional mode of degree 2 of a free sphere dies out: velocities; exact
 *     dam break        a column of water, twice as high as deep, collapses: its centre of mass;
 *                      truth: the finest run, incompressible
 *     pour             a jet of honey falls on a sticky plate: rms radius and mean height; truth:
 *                      the finest run, incompressible
 *     ringing ball     the same mode of an elastic sphere, one period: velocities; exact
 * Error: rms over eight times, relative (of a mode: to its first velocities). A finest run is off
 * by at most twice what the next coarser one differs from it by, where order is 1 or more: `bound`.
 * Explicit liquids have a sound speed of ten times the fastest flow: that counts as error, too.
 *   cc -O3 -march=native bench/tradeoff.c -I. -Iexamples -lm -o tradeoff
 *   ./tradeoff [--scene "dam break"] [--cells MOST] [--method "symplectic Euler"] > float.csv
 *   ./tradeoff --draw tradeoff.svg float.csv [double.csv]           and the fastest at 10, 3, 1 %
 *   ./tradeoff --draw-bytes bytes.svg float.csv [double.csv]        against memory; the smallest,
 *                                                                   and what double changes
 * With -DGS4_DOUBLE it is in double. A shorter step is not tried where the last one changed the
 * error by less than a fiftieth, a longer run not where the last one took 2 s: half an hour. */
#ifndef GS4_LINKED
#define GS4MPM_IMPLEMENTATION
#endif
#include "gs4mpm.h"
#include "bench.h"
#include "chart.h"

enum {
    TIMES = 8,
    GRIDS = 4,
    STEPS = 5,
    QUANTITIES = 2,
    ROWS = 6000
};

typedef struct method {
    const char *name;
    gs4_scheme scheme;
    gs4_integrator integrator;
    int particles_a_cell, sharp_gradients, affine;
    double rho_inf, rho_inf_spurious;
} method;
static const method methods[] = {
    { "explicit GS4", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 0, 0, 0 },
    { "explicit GS4", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 4, 0, 0, 0, 0 },
    { "explicit GS4", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 27, 0, 0, 0, 0 },
    { "explicit GS4 sharp", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 8, 1, 0, 0, 0 },
    { "explicit GS4 sharp", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 27, 1, 0, 0, 0 },
    { "explicit GS4 (1;0)", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 0, 1, 0 },
    { "explicit GS4 (.9;.9)", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 0, 0.9, 0.9 },
    { "explicit GS4 affine", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 1, 0, 0 },
    { "explicit GS4 affine", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 4, 0, 1, 0, 0 },
    { "explicit GS4 affine", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 27, 0, 1, 0, 0 },
    { "explicit GS4 affine (1;0)", GS4_EXPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 1, 1, 0 },
    { "symplectic Euler", GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER, 8, 0, 0, 0, 0 },
    { "symplectic Euler", GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER, 4, 0, 0, 0, 0 },
    { "symplectic Euler", GS4_EXPLICIT, GS4_INTEGRATOR_SYMPLECTIC_EULER, 27, 0, 0, 0, 0 },
    { "partitioned GS4", GS4_PARTITIONED, GS4_INTEGRATOR_GS4, 8, 0, 0, 0, 0 },
    { "partitioned GS4", GS4_PARTITIONED, GS4_INTEGRATOR_GS4, 4, 0, 0, 0, 0 },
    { "partitioned GS4", GS4_PARTITIONED, GS4_INTEGRATOR_GS4, 27, 0, 0, 0, 0 },
    { "partitioned GS4 (1;0)", GS4_PARTITIONED, GS4_INTEGRATOR_GS4, 8, 0, 0, 1, 0 },
    { "partitioned backward Euler", GS4_PARTITIONED, GS4_INTEGRATOR_BACKWARD_EULER, 8, 0, 0, 0, 0 },
    { "semi-implicit GS4", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 0, 0, 0 },
    { "semi-implicit GS4", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4, 4, 0, 0, 0, 0 },
    { "semi-implicit GS4", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4, 27, 0, 0, 0, 0 },
    { "semi-implicit GS4 (1;0)", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4, 8, 0, 0, 1, 0 },
    { "semi-implicit backward Euler", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_BACKWARD_EULER, 8, 0, 0, 0,
      0 },
};

/* What is looked at, at each time; how large the exact is, of each quantity. */
typedef struct outcome {
    double values[QUANTITIES][TIMES], seconds, bytes;
    uint64_t steps, hash;
    int failed;
} outcome;

/* s of the processor: others on the machine do not count. */
static double cpu_now(void) { return (double)clock() / CLOCKS_PER_SEC; }

static gs4_sim_desc describe(const method *m, int x, int y, int z, double h)
{
    gs4_sim_desc d = scene_cube(4);
    d.cells[0] = x;
    d.cells[1] = y;
    d.cells[2] = z;
    d.cell_size = (gs4_real)h;
    d.scheme = m->scheme;
    d.integrator = m->integrator;
    d.sharp_gradients = m->sharp_gradients;
    d.affine = m->affine;
    d.rho_inf = (gs4_real)m->rho_inf;
    d.rho_inf_spurious = (gs4_real)m->rho_inf_spurious;
    return d;
}

static gs4_fill fill_of(const method *m, double h)
{
    gs4_fill f = scene_fill(at(0, 0, 0));
    f.spacing = (gs4_real)(h / cbrt(m->particles_a_cell));
    return f;
}

/* Particles in a box from `low` to `high`, or in the ball in it; four a cell lie as in closest
 * packing, 27 and 8 on a lattice. */
static void fill(gs4_sim *sim, const method *m, double h, const double low[3], const double high[3],
                 int is_ball)
{
    const gs4_fill f = fill_of(m, h);
    const double middle = 0.5 * (low[0] + high[0]), r = 0.5 * (high[0] - low[0]);
    gs4_real *points;
    int n[3], count = 0, i, k, c;
    if (m->particles_a_cell != 4) {
        const gs4_shape ball = gs4_sphere(at(middle, middle, middle), (gs4_real)r),
                        box = gs4_box(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]));
        bench_need(sim, gs4_add_particles(sim, is_ball ? ball : box, &f));
        return;
    }
    for (c = 0; c < 3; c++) n[c] = (int)((high[c] - low[c]) / h + 0.999);
    points = (gs4_real *)malloc((size_t)n[0] * (size_t)n[1] * (size_t)n[2] * 12 * sizeof *points);
    if (!points) exit(1);
    for (i = 0; i < n[0] * n[1] * n[2]; i++)
        for (k = 0; k < 4; k++) {
            const int cell[3] = { i % n[0], i / n[0] % n[1], i / n[0] / n[1] };
            double x[3], away = 0;
            for (c = 0; c < 3; c++) {
                x[c] = low[c] + h * (cell[c] + (k == 0 || k == c + 1 ? 0.25 : 0.75));
                away += (x[c] - middle) * (x[c] - middle);
            }
            if (is_ball && away > r * r) continue;
            for (c = 0; c < 3; c++) points[3 * count + c] = (gs4_real)x[c];
            count++;
        }
    bench_need(sim, gs4_add_points(sim, points, count, (gs4_real)(h * h * h / 4), &f));
    free(points);
}

/* Give each particle the velocity that `of` has at its place from `middle`. */
static void set_velocities(gs4_sim *sim, double middle, void (*of)(const double x[3], double v[3]))
{
    const gs4_edit v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i, c;
    for (i = 0; i < v.count; i++) {
        double p[3], u[3];
        for (c = 0; c < 3; c++) p[c] = (double)x.data[i * x.stride + c] - middle;
        of(p, u);
        for (c = 0; c < 3; c++) v.data[i * v.stride + c] = (gs4_real)u[c];
    }
}

/* --- breathing drop --------------------------------------------------------------------------- */

static void drop_velocity(const double x[3], double v[3])
{
    v[0] = 0.5 * x[0] + 0.3 * x[1];
    v[1] = 0.5 * x[1] - 0.3 * x[0];
    v[2] = 0.5 * x[2];
}

static void drop(gs4_sim **sim, const method *m, int cells, double max_dt, double cfl)
{
    static const double low[3] = { 0.23, 0.23, 0.23 }, high[3] = { 0.77, 0.77, 0.77 };
    gs4_sim_desc d = describe(m, cells, cells, cells, 1.0 / cells);
    const gs4_material stuff = scene_liquid(1000, 10, 2);
    d.max_dt = (gs4_real)max_dt;
    d.cfl = (gs4_real)cfl;
    bench_need(NULL, gs4_create(&d, sim));
    bench_need(*sim, gs4_add_material(*sim, &stuff));
    fill(*sim, m, 1.0 / cells, low, high, 1);
    set_velocities(*sim, 0.5, drop_velocity);
}

static void drop_observe(const gs4_sim *sim, double time, double y[QUANTITIES])
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const gs4_view v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    int i, c;
    (void)time;
    for (i = 0; i < x.count; i++)
        for (c = 0; c < 3; c++) {
            const double w = (double)v.data[i * v.stride + c];
            y[0] += w * ((double)x.data[i * x.stride + c] - 0.5) / x.count;
            y[1] += w * w / x.count;
        }
}

/* --- modes of a sphere ------------------------------------------------------------------------ */

/* Torsional, degree 2 about z, of radius 1: f(k r) r x grad P, P = z^2 - (x^2 + y^2)/2,
 * f = j2(s)/s^2 without traction: k is the root of d(j2/s)/ds (shared/reference: 2.5011326). */
#define MODE_NUMBER 2.5011326
#define MODE_SPEED 1e-3

static void mode(const double x[3], double v[3])
{
    const double s = MODE_NUMBER * sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]),
                 f = 15 * MODE_SPEED * scene_bessel(2, s);
    v[0] = 3 * f * x[1] * x[2];
    v[1] = -3 * f * x[0] * x[2];
    v[2] = 0;
}

/* A sphere of density 1, radius 1 and R cells; waves of pressure at ten times the shear's. */
static void sphere(gs4_sim **sim, const method *m, int R, double max_dt, double cfl, double G)
{
    const int n = 2 * R + 8;
    const double middle = 0.5 * n / R, a = middle - 1, b = middle + 1, low[3] = { a, a, a },
                 high[3] = { b, b, b };
    gs4_sim_desc d = describe(m, n, n, n, 1.0 / R);
    gs4_material stuff = scene_liquid(1, G > 0 ? 0 : 1, 0);
    int i;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_OPEN;
    d.max_dt = (gs4_real)max_dt;
    d.cfl = (gs4_real)cfl;
    stuff.bulk_modulus = G > 0 ? (gs4_real)(10 * G) : 100;
    if (G > 0) {
        stuff.solid = GS4_NEO_HOOKEAN;
        stuff.shear_modulus = (gs4_real)G;
    }
    bench_need(NULL, gs4_create(&d, sim));
    bench_need(*sim, gs4_add_material(*sim, &stuff));
    fill(*sim, m, 1.0 / R, low, high, 1);
    set_velocities(*sim, middle, mode);
}

static void viscous(gs4_sim **sim, const method *m, int R, double max_dt, double cfl)
{
    sphere(sim, m, R, max_dt, cfl, 0);
}

static void elastic(gs4_sim **sim, const method *m, int R, double max_dt, double cfl)
{
    sphere(sim, m, R, max_dt, cfl, 1);
}

/* rms of v - share v_first over that of v_first */
static double mode_error(const gs4_sim *sim, double share)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const gs4_view v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    const gs4_sim_desc d = gs4_get_desc(sim);
    const double middle = 0.5 * d.cells[0] * (double)d.cell_size;
    double off = 0, all = 0;
    int i, c;
    for (i = 0; i < v.count; i++) {
        double p[3], u[3];
        for (c = 0; c < 3; c++) p[c] = (double)x.data[i * x.stride + c] - middle;
        mode(p, u);
        for (c = 0; c < 3; c++) {
            const double e = (double)v.data[i * v.stride + c] - share * u[c];
            off += e * e;
            all += u[c] * u[c];
        }
    }
    return sqrt(off / all);
}

static void viscous_observe(const gs4_sim *sim, double time, double y[QUANTITIES])
{
    y[0] = mode_error(sim, exp(-MODE_NUMBER * MODE_NUMBER * time));
}

static void elastic_observe(const gs4_sim *sim, double time, double y[QUANTITIES])
{
    y[0] = mode_error(sim, cos(MODE_NUMBER * time));
}

/* --- dam break -------------------------------------------------------------------------------- */

#define DAM_DEPTH 0.25
#define DAM_HEIGHT 0.5

static void dam(gs4_sim **sim, const method *m, int cells, double max_dt, double cfl)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { DAM_DEPTH, DAM_HEIGHT, 0.25 };
    const double h = 1.0 / cells;
    gs4_sim_desc d = describe(m, cells, cells * 5 / 8, cells / 4, h);
    gs4_material water = scene_liquid(1000, 0.001, 30); /* its front runs at 2.9 m/s */
    d.gravity = at(0, -9.81, 0);
    d.max_dt = (gs4_real)max_dt;
    d.cfl = (gs4_real)cfl;
    if (m->scheme != GS4_EXPLICIT) {
        water.incompressible = 1;
        water.sound_speed = 0;
    }
    bench_need(NULL, gs4_create(&d, sim));
    bench_need(*sim, gs4_add_material(*sim, &water));
    fill(*sim, m, h, low, high, 0);
}

static void dam_observe(const gs4_sim *sim, double time, double y[QUANTITIES])
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i, c;
    (void)time;
    for (i = 0; i < x.count; i++)
        for (c = 0; c < 2; c++) y[c] += (double)x.data[i * x.stride + c] / x.count;
    y[0] -= 0.5 * DAM_DEPTH;
    y[1] -= 0.5 * DAM_HEIGHT;
}

/* --- pour ------------------------------------------------------------------------------------- */

#define POUR_HEIGHT 0.45

static void pour(gs4_sim **sim, const method *m, int cells, double max_dt, double cfl)
{
    const double h = 1.0 / cells;
    gs4_sim_desc d = describe(m, cells, cells * 5 / 8, cells, h);
    gs4_material honey = scene_liquid(1400, 20, 30); /* lands at 3 m/s */
    gs4_emitter e;
    memset(&e, 0, sizeof e);
    d.gravity = at(0, -9.81, 0);
    d.walls[2] = GS4_WALL_STICK;
    d.max_dt = (gs4_real)max_dt;
    d.cfl = (gs4_real)cfl;
    if (m->scheme != GS4_EXPLICIT) {
        honey.incompressible = 1;
        honey.sound_speed = 0;
    }
    e.shape = gs4_cylinder(at(0.5, POUR_HEIGHT - 0.05, 0.5), at(0.5, POUR_HEIGHT + 0.05, 0.5),
                           (gs4_real)0.1);
    e.fill = fill_of(m, h);
    e.fill.velocity = at(0, -1, 0);
    bench_need(NULL, gs4_create(&d, sim));
    bench_need(*sim, gs4_add_material(*sim, &honey));
    bench_need(*sim, gs4_add_emitter(*sim, &e));
}

static void pour_observe(const gs4_sim *sim, double time, double y[QUANTITIES])
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i;
    (void)time;
    for (i = 0; i < x.count; i++) {
        const gs4_real *p = x.data + i * x.stride;
        y[0] += (pow((double)p[0] - 0.5, 2) + pow((double)p[2] - 0.5, 2)) / x.count;
        y[1] += (double)p[1] / x.count;
    }
    y[0] = sqrt(y[0]);
}

/* --- runs ------------------------------------------------------------------------------------- */

typedef struct scene {
    const char *name;
    void (*begin)(gs4_sim **, const method *, int cells, double max_dt, double cfl);
    void (*observe)(const gs4_sim *, double time, double y[QUANTITIES]);
    double end; /* s */
    int cells[GRIDS], quantities;
    int exact;       /* what is observed is the error */
    int truth, next; /* else: cells of the finest run, and of the next; its method */
    int truth_method;
} scene;
static const scene scenes[] = {
    { "breathing drop", drop, drop_observe, 0.6, { 12, 16, 24, 32 }, 2, 0, 96, 64, 11 },
    { "viscous sphere", viscous, viscous_observe, 0.16, { 4, 6, 8, 12 }, 1, 1, 0, 0, 0 },
    { "dam break", dam, dam_observe, 0.32, { 16, 24, 32, 48 }, 2, 0, 96, 64, 14 },
    { "pour", pour, pour_observe, 0.8, { 16, 24, 32, 48 }, 2, 0, 96, 64, 19 },
    { "ringing ball", elastic, elastic_observe, 2.5121, { 4, 6, 8, 12 }, 1, 1, 0, 0, 0 },
};
enum {
    SCENES = (int)(sizeof scenes / sizeof *scenes),
    METHODS = (int)(sizeof methods / sizeof *methods)
};

static outcome run(const scene *s, const method *m, int cells, int step)
{
    static const double cfl[STEPS] = { 0.9, 0.5, 0.25, 0.12, 0.06 };
    outcome o;
    gs4_sim *sim;
    int k, q;
    memset(&o, 0, sizeof o);
    s->begin(&sim, m, cells, s->end / TIMES / (1 << step), cfl[step]);
    for (k = 0; k < TIMES && !o.failed; k++) {
        const double start = cpu_now();
        double y[QUANTITIES] = { 0 };
        o.failed = gs4_advance(sim, (gs4_real)(s->end / TIMES)) < 0;
        o.seconds += cpu_now() - start;
        if (o.failed) printf("# %s\n", gs4_last_error(sim));
        s->observe(sim, s->end * (k + 1) / TIMES, y);
        for (q = 0; q < QUANTITIES; q++) o.values[q][k] = y[q];
    }
    o.steps = gs4_get_stats(sim).steps;
    o.bytes = (double)gs4_get_stats(sim).memory_bytes;
    o.hash = gs4_state_hash(sim);
    gs4_destroy(sim);
    return o;
}

static double error_of(const scene *s, const outcome *o, const outcome *truth)
{
    double error = 0;
    int k, q;
    for (q = 0; q < s->quantities; q++) {
        double sum = 0, all = 0;
        for (k = 0; k < TIMES; k++) {
            const double e = s->exact ? 0 : truth->values[q][k];
            sum += pow(o->values[q][k] - e, 2);
            all += s->exact ? 1 : e * e;
        }
        error += sum / all / s->quantities;
    }
    return sqrt(error);
}

static void print_row(const scene *s, const method *m, int cells, int step, const outcome *o,
                      double error)
{
    printf("%s,%s,%s,%d,%d,%d,%lu,", s->name, m->name, sizeof(gs4_real) == 8 ? "double" : "float",
           m->particles_a_cell, cells, step, (unsigned long)o->steps);
    if (o->failed) puts("refused,,,");
    if (!o->failed)
        printf("%.3g,%.3g,%.0f,%016llx\n", error, o->seconds, o->bytes,
               (unsigned long long)o->hash);
    fflush(stdout);
}

static void measure(const scene *s, int most_cells, const char *method)
{
    outcome truth, o;
    int i, j, k;
    memset(&truth, 0, sizeof truth);
    if (!s->exact) {
        truth = run(s, &methods[s->truth_method], s->truth, 2);
        o = run(s, &methods[s->truth_method], s->next, 2);
        printf("# bound,%s,%s,%.3g\n", s->name, sizeof(gs4_real) == 8 ? "double" : "float",
               2 * error_of(s, &o, &truth));
    }
    for (i = 0; i < METHODS; i++)
        for (j = 0; j < GRIDS && s->cells[j] <= most_cells; j++) {
            double last = 0;
            if (methods[i].sharp_gradients && s->begin == elastic) continue; /* of liquids alone */
            if (method[0] && strcmp(method, methods[i].name) != 0) continue;
            for (k = 0; k < STEPS; k++) {
                double error;
                o = run(s, &methods[i], s->cells[j], k);
                error = error_of(s, &o, &truth);
                print_row(s, &methods[i], s->cells[j], k, &o, error);
                if (o.seconds > 2 || (k > 0 && fabs(error - last) < 0.02 * error)) break;
                last = o.failed ? 0 : error;
            }
        }
}

/* --- the chart -------------------------------------------------------------------------------- */

typedef struct row {
    char scene[40], method[40], real[8];
    int particles_a_cell, cells, step;
    double error, seconds, bytes;
} row;
static row rows[ROWS];
static int row_count, by_bytes; /* what it costs: megabytes, or s */
static double bounds[SCENES];

static double cost_of(const row *r) { return by_bytes ? r->bytes * 1e-6 : r->seconds; }

static int scene_of(const char *name)
{
    int s = 0;
    while (s < SCENES && strcmp(scenes[s].name, name) != 0) s++;
    return s;
}

static void read_rows(const char *path)
{
    FILE *f = fopen(path, "r");
    char line[512], name[40];
    double bound;
    if (!f) {
        fprintf(stderr, "%s cannot be read\n", path);
        exit(1);
    }
    while (fgets(line, sizeof line, f) && row_count < ROWS) {
        row *r = &rows[row_count];
        if (sscanf(line, "# bound,%39[^,],%*[^,],%lf", name, &bound) == 2
            && scene_of(name) < SCENES)
            bounds[scene_of(name)] = fmax(bounds[scene_of(name)], bound);
        if (line[0] != '#'
            && sscanf(line, "%39[^,],%39[^,],%7[^,],%d,%d,%d,%*u,%lf,%lf,%lf", r->scene, r->method,
                      r->real, &r->particles_a_cell, &r->cells, &r->step, &r->error, &r->seconds,
                      &r->bytes)
                   == 9)
            row_count++;
    }
    fclose(f);
}

static int row_by_cost(const void *a, const void *b)
{
    const double x = cost_of((const row *)a), y = cost_of((const row *)b);
    return (x > y) - (x < y);
}

/* That of the longest of these names that a method's name begins with. */
static const char *colour_of(const char *name)
{
    static const char *const colours[][2] = {
        { "explicit GS4", "#06c" },        { "explicit GS4 sharp", "#0aa" },
        { "explicit GS4 affine", "#036" }, { "symplectic Euler", "#e70" },
        { "partitioned GS4", "#a3c" },     { "partitioned backward", "#d9e" },
        { "semi-implicit GS4", "#292" },   { "semi-implicit backward", "#c33" }
    };
    const char *best = "#000";
    size_t i, length = 0;
    for (i = 0; i < sizeof colours / sizeof *colours; i++)
        if (strncmp(name, colours[i][0], strlen(colours[i][0])) == 0
            && strlen(colours[i][0]) > length) {
            best = colours[i][1];
            length = strlen(colours[i][0]);
        }
    return best;
}

static int inside(const chart_plane *p, const row *r)
{
    const double x = log10(cost_of(r)), y = log10(r->error);
    return x >= p->x_first && x <= p->x_last && y >= p->y_first && y <= p->y_last;
}

static void draw_row(FILE *f, const chart_plane *p, const row *r)
{
    const int is_double = strcmp(r->real, "double") == 0;
    fprintf(f,
            "<circle cx='%.1f' cy='%.1f' r='%.1f' fill='%s' fill-opacity='%g' stroke='%s' "
            "stroke-opacity='.6'><title>%s, %s, %d a cell, %d cells, step %d: error %.2g, %.2g s, "
            "%.2g MB</title></circle>\n",
            chart_x(p, log10(cost_of(r))), chart_y(p, log10(r->error)),
            r->particles_a_cell == 4   ? 1.5
            : r->particles_a_cell == 8 ? 2.5
                                       : 4,
            colour_of(r->method), is_double ? 0 : 0.35, colour_of(r->method), r->method, r->real,
            r->particles_a_cell, r->cells, r->step, r->error, r->seconds, r->bytes * 1e-6);
}

/* Runs that nothing is both cheaper and more exact than, in rings. */
static void draw_front(FILE *f, const chart_plane *p, const char *name)
{
    chart_curve c;
    double least = 1e30;
    int i;
    c.count = 0;
    for (i = 0; i < row_count && c.count < CHART_POINTS; i++) {
        const row *r = &rows[i];
        if (strcmp(r->scene, name) != 0 || r->error >= least || !inside(p, r)) continue;
        least = r->error;
        chart_add(&c, cost_of(r), r->error);
        fprintf(f, "<circle cx='%.1f' cy='%.1f' r='5.5' fill='none' stroke='#000'/>\n",
                chart_x(p, log10(cost_of(r))), chart_y(p, log10(r->error)));
    }
    chart_draw(f, p, &c, "#000", 1);
}

static void draw_scene(FILE *f, int s)
{
    const chart_plane p = { scenes[s].name,
                            by_bytes ? "megabytes" : "seconds",
                            60 + 440.0 * (s % 2),
                            40 + 350.0 * (s / 2),
                            370,
                            270,
                            by_bytes ? -1 : -3,
                            2,
                            -3,
                            0 };
    int i;
    if (bounds[s] > 1e-3)
        fprintf(f, "<rect x='%g' y='%.1f' width='%g' height='%.1f' fill='#eee'/>\n", p.left,
                chart_y(&p, log10(bounds[s])), p.width,
                p.top + p.height - chart_y(&p, log10(bounds[s])));
    chart_axes(f, &p);
    for (i = 0; i < row_count; i++)
        if (strcmp(rows[i].scene, scenes[s].name) == 0 && inside(&p, &rows[i]))
            draw_row(f, &p, &rows[i]);
    draw_front(f, &p, scenes[s].name);
}

static void draw_legend(FILE *f)
{
    static const char *const names[] = { "explicit GS4",        "explicit GS4 sharp",
                                         "explicit GS4 affine", "symplectic Euler",
                                         "partitioned GS4",     "partitioned backward Euler",
                                         "semi-implicit GS4",   "semi-implicit backward Euler" };
    static const char *const notes[] = { "small, middle, large: 4, 8, 27 particles a cell",
                                         "filled: float; hollow: double",
                                         "rings: nothing is both cheaper and more exact",
                                         "grey: truth is not known better" };
    int i;
    for (i = 0; i < 8; i++)
        fprintf(f, "<text x='520' y='%d' fill='%s' font-size='14'>%s</text>\n", 766 + 22 * i,
                colour_of(names[i]), names[i]);
    for (i = 0; i < 4; i++) fprintf(f, "<text x='520' y='%d'>%s</text>\n", 940 + 18 * i, notes[i]);
    fprintf(f, "<text x='520' y='%d'>error against %s</text>\n", 940 + 18 * i,
            by_bytes ? "memory of the whole simulation" : "seconds of one thread");
}

/* The same run in double, NULL if there is none. */
static const row *in_double(const row *r)
{
    int i;
    for (i = 0; i < row_count; i++)
        if (strcmp(rows[i].real, "double") == 0 && strcmp(rows[i].scene, r->scene) == 0
            && strcmp(rows[i].method, r->method) == 0
            && rows[i].particles_a_cell == r->particles_a_cell && rows[i].cells == r->cells
            && rows[i].step == r->step)
            return &rows[i];
    return NULL;
}

/* What double changes, for each scene and scheme: medians of bytes and seconds, double over float,
 * and the largest |change of the error| over the error in float. */
static void compare_precisions(void)
{
    static const char *const schemes[] = { "explicit GS4", "symplectic Euler", "partitioned",
                                           "semi-implicit" };
    static double bytes[ROWS], seconds[ROWS];
    int s, k, i;
    puts("scene,scheme,runs,bytes double/float,seconds double/float,largest change of the error");
    for (s = 0; s < SCENES; s++)
        for (k = 0; k < 4; k++) {
            double most = 0;
            int n = 0;
            for (i = 0; i < row_count; i++) {
                const row *r = &rows[i], *d;
                if (strcmp(r->real, "float") != 0 || strcmp(r->scene, scenes[s].name) != 0
                    || strncmp(r->method, schemes[k], strlen(schemes[k])) != 0
                    || (d = in_double(r)) == NULL)
                    continue;
                bytes[n] = d->bytes / r->bytes;
                seconds[n++] = d->seconds / r->seconds;
                most = fmax(most, fabs(d->error / r->error - 1));
            }
            if (!n) continue;
            printf("%s,%s,%d,%.2f,%.2f,%.2g\n", scenes[s].name, schemes[k], n,
                   bench_median(bytes, n), bench_median(seconds, n), most);
        }
}

/* The chart, and for each scene and method the cheapest run at 10, 3 and 1 %. */
static void draw(const char *path)
{
    static const double targets[] = { 0.1, 0.03, 0.01 };
    FILE *f = fopen(path, "w");
    int s, k, i, m;
    if (!f) {
        fprintf(stderr, "%s cannot be written\n", path);
        exit(1);
    }
    qsort(rows, (size_t)row_count, sizeof *rows, row_by_cost);
    chart_begin(f, 890, 1080);
    for (s = 0; s < SCENES; s++) draw_scene(f, s);
    draw_legend(f);
    chart_end(f);
    fclose(f);
    puts("scene,error,method,real,particles a cell,cells,step,seconds,megabytes");
    for (s = 0; s < SCENES; s++)
        for (k = 0; k < 3; k++) {
            int seen[METHODS] = { 0 };
            for (i = 0; i < row_count; i++) {
                const row *r = &rows[i];
                if (strcmp(r->scene, scenes[s].name) != 0 || r->error > targets[k]) continue;
                for (m = 0; strcmp(methods[m].name, r->method) != 0;) m++;
                if (seen[m]++) continue;
                printf("%s,%g,%s,%s,%d,%d,%d,%.3g,%.3g\n", r->scene, targets[k], r->method, r->real,
                       r->particles_a_cell, r->cells, r->step, r->seconds, r->bytes * 1e-6);
            }
        }
}

int main(int count, char **values)
{
    const char *only = "", *method = "";
    int s, i, most = 1000;
    by_bytes = count > 3 && strcmp(values[1], "--draw-bytes") == 0;
    if (by_bytes || (count > 3 && strcmp(values[1], "--draw") == 0)) {
        for (i = 3; i < count; i++) read_rows(values[i]);
        draw(values[2]);
        if (by_bytes) compare_precisions();
        return 0;
    }
    for (i = 1; i + 1 < count; i += 2) {
        if (strcmp(values[i], "--scene") == 0) only = values[i + 1];
        if (strcmp(values[i], "--method") == 0) method = values[i + 1];
        if (strcmp(values[i], "--cells") == 0) most = atoi(values[i + 1]);
    }
    bench_machine(stdout);
    puts("scene,method,real,particles_a_cell,cells,step,steps,error,seconds,bytes,hash");
    for (s = 0; s < SCENES; s++)
        if (!only[0] || strcmp(only, scenes[s].name) == 0) measure(&scenes[s], most, method);
    return 0;
}
