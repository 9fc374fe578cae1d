/* Error against cost: one breathing, turning drop at several steps, cells and particles a cell,
 * by both integrators and with sharpened gradients. Error: of the moments sum m v.x and sum m
 * |v|^2 at ten times, relative to a run of 96 cells a side (which takes a minute or two; there
 * GS4 and symplectic Euler differ by 0.008, with sharpened gradients by 0.02); cost: seconds.
 *   cc -O3 -march=native bench/tradeoff.c -I. -lm -o tradeoff
 *   ./tradeoff [out.svg]      CSV on standard output */
#define _POSIX_C_SOURCE 200112L
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"

enum {
    TIMES = 10,
    POINTS_MAX = 128
};
enum {
    PLAIN,
    EULER,
    DENSE,
    SHARP,
    KINDS
};
static const char *const names[KINDS] = { "gs4", "symplectic euler", "gs4", "gs4 sharpened" },
                         *const colours[KINDS] = { "#06c", "#c60", "#06c", "#0a6" };
typedef struct point {
    int kind, cells, side;
    double cfl, error, seconds;
} point;

static double run(int kind, int cells, int side, double cfl, double moments[2 * TIMES])
{
    gs4_sim_desc d = scene_cube(cells);
    gs4_material m = scene_liquid(1000, 10, 2);
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_view x;
    gs4_edit v;
    gs4_sim *sim;
    double start, seconds;
    int i, k;
    if (kind == EULER) d.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    d.cfl = (gs4_real)cfl;
    d.sharp_gradients = kind == SHARP;
    if (gs4_create(&d, &sim) < 0) {
        puts(gs4_last_error(NULL));
        exit(1);
    }
    gs4_add_material(sim, &m);
    f.spacing = (gs4_real)(1.0 / cells / side);
    gs4_add_particles(sim, gs4_sphere(at(0.5, 0.5, 0.5), (gs4_real)0.27), &f);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < v.count; i++) {
        const gs4_real *p = x.data + (size_t)i * (size_t)x.stride;
        gs4_real *u = v.data + (size_t)i * (size_t)v.stride;
        const double a = (double)p[0] - 0.5, b = (double)p[1] - 0.5, c = (double)p[2] - 0.5;
        u[0] = (gs4_real)(0.5 * a + 0.3 * b);
        u[1] = (gs4_real)(0.5 * b - 0.3 * a);
        u[2] = (gs4_real)(0.5 * c);
    }
    start = bench_now(NULL);
    for (k = 0; k < TIMES; k++) {
        gs4_view y, u;
        if (gs4_advance(sim, (gs4_real)0.06) < 0) {
            puts(gs4_last_error(sim));
            exit(1);
        }
        y = gs4_particles(sim, GS4_FIELD_POSITION);
        u = gs4_particles(sim, GS4_FIELD_VELOCITY);
        moments[2 * k] = moments[2 * k + 1] = 0;
        for (i = 0; i < y.count; i++) {
            int c;
            for (c = 0; c < 3; c++) {
                const double w = (double)u.data[i * u.stride + c];
                moments[2 * k] += w * ((double)y.data[i * y.stride + c] - 0.5) / y.count;
                moments[2 * k + 1] += w * w / y.count;
            }
        }
    }
    seconds = bench_now(NULL) - start;
    gs4_destroy(sim);
    return seconds;
}

static double distance(const double *a, const double *exact)
{
    double sum = 0, all = 0;
    int i;
    for (i = 0; i < 2 * TIMES; i++) {
        sum += (a[i] - exact[i]) * (a[i] - exact[i]);
        all += exact[i] * exact[i];
    }
    return sqrt(sum / all);
}

/* A log-log chart: seconds to the right, error upwards; colour by kind, size of the mark by
 * cells. */
static void draw(const char *path, const point *p, int n)
{
    FILE *f = fopen(path, "w");
    int i;
    if (!f) {
        puts("the chart could not be written");
        return;
    }
    fputs(
        "<svg xmlns='http://www.w3.org/2000/svg' width='720' height='460' font-family='sans-serif' "
        "font-size='13'>\n<rect width='720' height='460' fill='white'/>\n",
        f);
    for (i = -3; i <= 1; i++)
        fprintf(f,
                "<path d='M%d 40V400' stroke='#ddd'/><text x='%d' y='420' text-anchor='middle'>%g "
                "s</text>\n",
                535 + 155 * i, 535 + 155 * i, pow(10, i));
    for (i = -2; i <= 0; i++)
        fprintf(
            f,
            "<path d='M70 %dH690' stroke='#ddd'/><text x='62' y='%d' text-anchor='end'>%g</text>\n",
            40 - 180 * i, 44 - 180 * i, pow(10, i));
    for (i = 0; i < n; i++)
        fprintf(f,
                "<circle cx='%.1f' cy='%.1f' r='%.1f' fill='%s' fill-opacity='%.2f' "
                "stroke='%s'><title>%d cells, %d per cell, cfl %g: error %.2g, %.2g "
                "s</title></circle>\n",
                535 + 155 * log10(p[i].seconds), 40 - 180 * log10(p[i].error), 2 + p[i].cells / 8.0,
                colours[p[i].kind], p[i].side == 2 ? 0.55 : 0.1, colours[p[i].kind], p[i].cells,
                p[i].side * p[i].side * p[i].side, p[i].cfl, p[i].error, p[i].seconds);
    fputs("<text x='80' y='24' fill='#06c'>GS4</text><text x='130' y='24' fill='#0a6'>GS4, "
          "sharp_gradients</text><text x='290' y='24' fill='#c60'>symplectic Euler</text>"
          "<text x='380' y='446' text-anchor='middle'>size: cells a side (12 to 32); filled: 8 a "
          "cell, hollow: 27; error against seconds, one thread</text>\n</svg>\n",
          f);
    fclose(f);
}

int main(int count, char **values)
{
    static const int cells[] = { 12, 16, 24, 32 };
    static const double cfl[] = { 0.06, 0.12, 0.25, 0.5, 0.9 };
    static point points[POINTS_MAX];
    double exact[2 * TIMES], moments[2 * TIMES];
    int i, j, k, n = 0;
    run(EULER, 96, 2, 0.25, exact);
    bench_machine(stdout);
    puts("integrator,cells,particles_a_cell,cfl,error,seconds");
    for (k = 0; k < KINDS; k++)
        for (i = 0; i < 4; i++)
            for (j = 0; j < 5; j++) {
                point *p = &points[n++];
                p->kind = k;
                p->cells = cells[i];
                p->side = k == DENSE ? 3 : 2;
                p->cfl = cfl[j];
                p->seconds = run(p->kind, p->cells, p->side, p->cfl, moments);
                p->error = distance(moments, exact);
                printf("%s,%d,%d,%g,%.3g,%.3g\n", names[p->kind], p->cells,
                       p->side * p->side * p->side, p->cfl, p->error, p->seconds);
                fflush(stdout);
            }
    draw(count > 1 ? values[1] : "tradeoff.svg", points, n);
    return 0;
}
