/* Error against dt, after figure 11 of "GS4 viscoelastic MPM" (2021). A drop of Oldroyd-B, radius
 * 3.84 cells, strains and turns so little that no cell becomes liquid or air. For seven decades of
 * steps it takes three ends T, each 1/256 of the one before; up to the longest it moves at an
 * eighth of the speed, so that one step there is stable. Beside it the same with little viscosity,
 * as in tests/test_semi_viscoelastic.c, and a drop that falls on a sticky floor (Re 4.8, 7.7 cells
 * across), where cells do become liquid and air.
 *   cc -O3 -march=native bench/order.c -I. -Iexamples -lm -o order
 *   ./order [--steps N] [--out FILE]   ten minutes; most steps to an end, 512; 64: three minutes
 * Error: rms over particles, by what the run has changed, against the limit of the same scheme, to
 * which its last halving of dt points; `limit` is how far the one before points from there. Of the
 * drop that falls it is against the finest run, and `limit` is what the last halving changes.
 * Order: of what two halvings change, from this dt on. CSV on standard output, order.svg. */
#define GS4_DOUBLE
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"
#include "chart.h"

enum {
    METHODS = 4,
    SCENES = 5,
    FALLS = 4, /* the last of them */
    FIELDS = 3,
    MOST = 2400,
    RUNS = 16
};
static const struct {
    const char *name, *colour;
    gs4_scheme scheme;
    gs4_integrator integrator;
} methods[METHODS] = { { "semi-implicit backward Euler", "#c33", GS4_SEMI_IMPLICIT,
                         GS4_INTEGRATOR_BACKWARD_EULER },
                       { "explicit GS4", "#26c", GS4_EXPLICIT, GS4_INTEGRATOR_GS4 },
                       { "partitioned GS4", "#d80", GS4_PARTITIONED, GS4_INTEGRATOR_GS4 },
                       { "semi-implicit GS4", "#292", GS4_SEMI_IMPLICIT, GS4_INTEGRATOR_GS4 } };
/* End in h^2/nu, nu = mu/rho in all; rate of strain, 1/s, or speed; c0 of the explicit scheme. */
static const struct {
    const char *name;
    double time, viscosity, rate, relaxation_time, sound_speed;
} scenes[SCENES] = { { "T 256", 256, 1000, 0.002, 1, 16 },
                     { "T 1", 1, 1000, 0.016, 1, 16 },
                     { "T 1/256", 1.0 / 256, 1000, 0.016, 1, 16 },
                     { "thin", 0.008 * 0.256, 1, 2, 0.1, 2 },
                     { "falls", 12.8, 1000, 10, 0.1, 40 } };
static const gs4_field fields[FIELDS] = { GS4_FIELD_POSITION, GS4_FIELD_VELOCITY,
                                          GS4_FIELD_STRESS };
static const int parts[FIELDS] = { 3, 3, 6 };
static const double h = 1.0 / 16;
typedef struct state {
    double y[FIELDS][6 * MOST];
    int refused;
} state;
static chart_curve curves[SCENES][METHODS][FIELDS];
static double euler[RUNS][FIELDS]; /* errors of backward Euler */

static gs4_sim *begin(int scene, int method)
{
    const double rate = scenes[scene].rate;
    gs4_sim_desc d = scene_cube(16);
    gs4_material m = scene_liquid(1000, scenes[scene].viscosity, 0);
    gs4_fill f = scene_fill(at(0, -rate, 0));
    gs4_sim *sim = NULL;
    gs4_view x;
    gs4_edit v;
    int i;
    for (i = 0; i < 6; i++) d.walls[i] = scene == FALLS && i == 2 ? GS4_WALL_STICK : GS4_WALL_OPEN;
    d.cells[0] = d.cells[2] = 20;
    d.origin = at(-10 * h, (scene == FALLS ? -5.5 : -8) * h, -10 * h); /* x rounds least at 0 */
    d.gravity.y = scene == FALLS ? -39 : 0;
    d.scheme = methods[method].scheme;
    d.integrator = methods[method].integrator;
    d.solver_tolerance = scene == FALLS ? 1e-9 : 1e-12;
    m.liquid = GS4_OLDROYD_B;
    m.local_fraction = 0.5;
    m.relaxation_time = scenes[scene].relaxation_time;
    m.incompressible = d.scheme != GS4_EXPLICIT;
    if (!m.incompressible) m.sound_speed = scenes[scene].sound_speed;
    if (gs4_create(&d, &sim) < 0 || gs4_add_material(sim, &m) < 0
        || gs4_add_particles(sim, gs4_sphere(at(0, 0, 0), 3.84 * h), &f) > MOST) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    if (scene == FALLS) return sim;
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    for (i = 0; i < v.count; i++) {
        const gs4_real *p = x.data + i * x.stride;
        v.data[i * v.stride] = rate * (p[0] - 2 * p[1]);
        v.data[i * v.stride + 1] = rate * (2 * p[0] - 0.5 * p[1] + 0.2 * p[2]);
        v.data[i * v.stride + 2] = rate * (-0.5 * p[2]);
    }
    return sim;
}

static int run(int scene, int method, int steps, state *out)
{
    const double time = scenes[scene].time * h * h / (scenes[scene].viscosity / 1000);
    gs4_sim *sim = begin(scene, method);
    const int count = gs4_get_stats(sim).particles;
    int i, result = 0;
    for (i = 0; i < steps && result == 0; i++) result = gs4_step(sim, time / steps);
    if (result < 0)
        printf("# %s, %s, %d steps: refused in step %d, by %s\n", scenes[scene].name,
               methods[method].name, steps, i, gs4_limit_name(sim));
    out->refused = result < 0;
    for (i = 0; i < FIELDS; i++) scene_by_id(sim, fields[i], out->y[i]);
    gs4_destroy(sim);
    return count;
}

/* rms of a + share (a - b) - c */
static double apart(const double *a, const double *b, double share, const double *c, int n)
{
    double sum = 0;
    int i;
    for (i = 0; i < n; i++) sum += pow(a[i] + share * (a[i] - b[i]) - c[i], 2);
    return sqrt(sum / n);
}

static void series(int scene, int method, int last)
{
    static state r[RUNS], start;
    const double share = scene == FALLS ? 0 : method ? 1.0 / 3 : 1;
    const int count = run(scene, method, 0, &start);
    int k, q, i;
    if (!method) memset(euler, 0, sizeof euler);
    for (k = 0; k <= last; k++) run(scene, method, 1 << k, &r[k]);
    for (k = 0; k < last - (scene == FALLS); k++) {
        if (r[k].refused || r[last - 2].refused) continue;
        printf("%s,%s,%d,%.3g", scenes[scene].name, methods[method].name, 1 << k,
               scenes[scene].time / (1 << k));
        for (q = 0; q < FIELDS; q++) {
            const int n = count * parts[q];
            const double *a = r[last].y[q], *b = r[last - 1].y[q], *c = r[last - 2].y[q],
                         changed = apart(a, b, share, start.y[q], n),
                         error = apart(a, b, share, r[k].y[q], n) / changed;
            double past[6 * MOST];
            for (i = 0; i < n; i++) past[i] = b[i] + share * (b[i] - c[i]);
            printf(",%.2e,%.0e,", error, apart(a, b, share, past, n) / changed);
            if (k < last - 1)
                printf("%.2f", log2(apart(r[k].y[q], a, 0, r[k + 1].y[q], n)
                                    / apart(r[k + 1].y[q], a, 0, r[k + 2].y[q], n)));
            if (!method) euler[k][q] = error;
            if (euler[k][q] > 0) printf(",%.1f", euler[k][q] / error);
            if (!(euler[k][q] > 0)) putchar(',');
            chart_add(&curves[scene][method][q], scenes[scene].time / (1 << k), error);
        }
        puts("");
    }
    fflush(stdout);
}

/* A field in the scenes from first to last, and lines of slope 1 and 2. */
static void draw_plane(FILE *f, const chart_plane *p, int field, int first, int last)
{
    int s, k, i;
    chart_axes(f, p);
    for (k = 1; k <= 2; k++) {
        const double x = pow(10, p->x_last - 2), y = pow(10, p->y_first + 0.5);
        const chart_curve c = { { x, 30 * x }, { y, y * pow(30, k) }, 2 };
        chart_draw(f, p, &c, "#888", 1);
        fprintf(f, "<text x='%.1f' y='%.1f' fill='#888'>%d</text>\n", chart_x(p, log10(c.x[1])) + 4,
                chart_y(p, log10(c.y[1])) + 4, k);
    }
    for (s = first; s <= last; s++) {
        if (curves[s][0][field].count)
            fprintf(f, "<text x='%.1f' y='%.1f' text-anchor='end'>%s</text>\n",
                    chart_x(p, log10(curves[s][0][field].x[0])) + 4, p->top + p->height - 6,
                    scenes[s].name);
        for (k = 0; k < METHODS; k++) {
            const chart_curve *c = &curves[s][k][field];
            chart_draw(f, p, c, methods[k].colour, 2);
            for (i = 0; i < c->count; i++)
                fprintf(f, "<circle cx='%.1f' cy='%.1f' r='2.5' fill='%s'/>\n",
                        chart_x(p, log10(c->x[i])), chart_y(p, log10(c->y[i])), methods[k].colour);
        }
    }
}

static void draw(const char *path)
{
    static const char *const titles[2][2] = { { "position: a drop that strains and turns",
                                                "with little viscosity; one that falls" },
                                              { "velocity", "velocity" } };
    FILE *f = fopen(path, "w");
    int q, k;
    if (!f) {
        printf("# %s could not be written\n", path);
        return;
    }
    chart_begin(f, 880, 720);
    for (q = 0; q < 2; q++) {
        const chart_plane
            left = { titles[q][0], "nu dt/h^2", 55, 40 + 330.0 * q, 420, 260, -5, 3, -8, 0 },
            right = { titles[q][1], "nu dt/h^2", 540, 40 + 330.0 * q, 320, 260, -6, 1, -8, 0 };
        draw_plane(f, &left, q, 0, 2);
        draw_plane(f, &right, q, 3, FALLS);
    }
    for (k = 0; k < METHODS; k++)
        fprintf(f, "<text x='%d' y='705' fill='%s'>%s</text>\n", 55 + 210 * k, methods[k].colour,
                methods[k].name);
    chart_end(f);
    fclose(f);
}

int main(int count, char **values)
{
    const char *out = "order.svg";
    int last = 9, i, k;
    for (i = 1; i + 1 < count; i += 2) {
        if (strcmp(values[i], "--steps") == 0) last = (int)log2(atof(values[i + 1]));
        if (strcmp(values[i], "--out") == 0) out = values[i + 1];
    }
    if (last < 3 || last > 12) {
        puts("8 to 4096 steps");
        return 1;
    }
    bench_machine(stdout);
    puts("scene,method,steps,nu_dt_h2,x,limit,order,euler_over_it,v,limit,order,euler_over_it,"
         "stress,limit,order,euler_over_it");
    for (i = 0; i < SCENES; i++)
        for (k = 0; k < METHODS; k++) /* the longest is stable from 512 steps on but for two */
            series(i, k, last + (i == 0 && (k == 1 || k == 2) ? 3 : 0));
    draw(out);
    return 0;
}
