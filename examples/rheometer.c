/* rheometer.c - flow curves of three liquids from one material point each, as CSV and chart.
 *     cc -O3 -march=native examples/rheometer.c -Iexamples -I. -lm -o rheometer
 *     ./rheometer                         rheometer.csv and rheometer.svg in out/ (--out DIR)
 *
 * Shows gs4_point_step and gs4_point_stress: the code that particles run, without a simulation
 * around it. Against the rate from 0.01 to 100 /s: viscosity and normal stress differences N1 =
 * s_xx - s_yy and -N2 = s_zz - s_yy in steady shear, viscosity in steady uniaxial stretching,
 * and the viscosity while shear at 10 /s starts. Newtonian: constants, and three times as much
 * in stretching. Oldroyd-B: N1 = 2 G0 (lambda rate)^2, no N2, no steady stretching above 1 / (2
 * lambda). Pom-Pom: thins, overshoots, and hardens in stretching before it thins. */
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "chart.h"
#include <sys/stat.h>

enum {
    MATERIALS = 3,
    PANELS = 5,
    RATES = 33
};
static const char *const names[MATERIALS] = { "Newtonian", "Oldroyd-B", "Pom-Pom" };
static const char *const keys[PANELS] = { "shear_viscosity", "N1", "minus_N2", "stretch_viscosity",
                                          "startup_viscosity" };
static const chart_plane planes[PANELS] = {
    { "viscosity in shear, Pa s", "rate, 1/s", 60, 45, 280, 225, -2, 2, -1, 2 },
    { "N1 in shear, Pa", "rate, 1/s", 415, 45, 280, 225, -2, 2, -2, 5 },
    { "-N2 in shear, Pa", "rate, 1/s", 770, 45, 280, 225, -2, 2, -4, 2 },
    { "viscosity in stretching, Pa s", "rate, 1/s", 60, 355, 280, 225, -2, 2, 0, 3 },
    { "viscosity when shear of 10 /s starts, Pa s", "s", 415, 355, 280, 225, -2, 2, -1, 2 }
};

static void need(int result)
{
    if (result >= 0) return;
    fprintf(stderr, "rheometer: %s\n", gs4_last_error(NULL));
    exit(1);
}

/* Flows at velocity gradient L for a time and leaves Cauchy stress (without pressure) in s. */
static void flow(const gs4_material *m, gs4_point *p, const gs4_real L[9], double time, int steps,
                 gs4_real s[6])
{
    for (int i = 0; i < steps; ++i) need(gs4_point_step(m, p, L, (gs4_real)(time / steps), 0, 0));
    need(gs4_point_stress(m, p, L, s));
}

/* Steady flow at each rate, in shear or in stretching, into the panels' curves. */
static void sweep(const gs4_material *m, chart_curve curves[PANELS])
{
    for (int i = 0; i < RATES; ++i) {
        const double rate = pow(10, -2 + 4.0 * i / (RATES - 1)),
                     lambda = (double)m->relaxation_time;
        const gs4_real r = (gs4_real)rate, shear[9] = { 0, r, 0, 0, 0, 0, 0, 0, 0 },
                       stretch[9] = { r, 0, 0, 0, -r / 2, 0, 0, 0, -r / 2 };
        const double time = 20 * (lambda > 0 ? lambda : 1);
        const int steps = 2000 + (int)(50 * time * rate);
        gs4_point p = { { 0 }, { 0 }, { 0 }, 0 }, q = p;
        gs4_real s[6];
        flow(m, &p, shear, time, steps, s);
        chart_add(&curves[0], rate, (double)s[3] / rate);
        if (lambda > 0) chart_add(&curves[1], rate, (double)(s[0] - s[1]));
        if (m->anisotropy > 0) chart_add(&curves[2], rate, (double)(s[2] - s[1]));
        /* it would stretch for ever */
        if (m->liquid == GS4_OLDROYD_B && 2 * lambda * rate > 0.98) continue;
        flow(m, &q, stretch, time * (m->liquid == GS4_OLDROYD_B ? 1 / (1 - 2 * lambda * rate) : 1),
             steps, s);
        chart_add(&curves[3], rate, (double)(s[0] - s[1]) / rate);
    }
}

static void start_up(const gs4_material *m, chart_curve *c)
{
    const gs4_real L[9] = { 0, 10, 0, 0, 0, 0, 0, 0, 0 };
    gs4_point p = { { 0 }, { 0 }, { 0 }, 0 };
    gs4_real s[6];
    for (double t = 0, next = 0.01; c->count < 41; next *= pow(10, 0.075)) {
        flow(m, &p, L, next - t, 40, s);
        t = next;
        chart_add(c, t, (double)s[3] / 10);
    }
}

/* Five charts, of the material's curves against rates or seconds. */
static void draw(FILE *f, chart_curve curves[MATERIALS][PANELS])
{
    static const char *const colours[MATERIALS] = { "#bbb", "#06c", "#c40" };
    chart_begin(f, 1080, 640);
    for (int k = 0; k < PANELS; ++k) {
        chart_axes(f, &planes[k]);
        for (int m = 0; m < MATERIALS; ++m)
            chart_draw(f, &planes[k], &curves[m][k], colours[m], m ? 2.5 : 6.0);
    }
    for (int m = 0; m < MATERIALS; ++m)
        fprintf(f,
                "<path d='M800 %dh40' stroke='%s' stroke-width='2.5'/><text x='850' y='%d' "
                "font-size='14'>%s</text>\n",
                420 + 30 * m, colours[m], 425 + 30 * m, names[m]);
    chart_end(f);
}

static FILE *open_in(const char *directory, const char *name)
{
    char path[1024];
    FILE *f;
    sprintf(path, "%.900s/%s", directory, name);
    f = fopen(path, "w");
    if (f) return f;
    perror(path);
    exit(1);
}

int main(int argc, char **argv)
{
    static chart_curve curves[MATERIALS][PANELS];
    const char *out = argc == 3 && !strcmp(argv[1], "--out") ? argv[2] : "out";
    gs4_material m = { 0 };
    FILE *f;
    if (argc != 1 && out != argv[argc - 1]) {
        fputs("usage: rheometer [--out DIR]\n", stderr);
        return 2;
    }
    mkdir(out, 0777);
    f = open_in(out, "rheometer.csv");
    fputs("quantity,material,x,y\n", f);
    for (int i = 0; i < MATERIALS; ++i) {
        m.density = 1000;
        m.viscosity = 10;
        m.liquid = (gs4_liquid)i;
        /* G0 = 9.5 Pa */
        if (i > 0) {
            m.local_fraction = (gs4_real)0.05;
            m.relaxation_time = 1;
        }
        if (i == 2) {
            m.stretch_time = (gs4_real)0.5;
            m.anisotropy = (gs4_real)0.3;
            m.arms = 4;
        }
        sweep(&m, curves[i]);
        start_up(&m, &curves[i][4]);
        for (int k = 0; k < PANELS; ++k)
            for (int j = 0; j < curves[i][k].count; ++j)
                fprintf(f, "%s,%s,%.6g,%.6g\n", keys[k], names[i], curves[i][k].x[j],
                        curves[i][k].y[j]);
    }
    fclose(f);
    f = open_in(out, "rheometer.svg");
    draw(f, curves);
    return fclose(f) != 0;
}
