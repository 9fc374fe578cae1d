/* What a liquid occupies, by how densely its particles lie, with either scheme.
 *   A drop falls on a sticky floor (2021, figures 7 and 10): D 0.02 m, 1 m/s, Re 5, Fr 2.26;
 *   explicit with a sound speed of 0.1, 0.5, 1 and 10 m/s, partitioned with a tolerance of 1e-3 and
 *   1e-4.
 *   A column, 0.05 m high and wide, collapses in a tank twice as long, sloshes and settles: depth
 *   by the height of its centre of mass. And what the first second of water takes.
 *   cc -O3 -march=native bench/volume.c -I. -lm -o volume
 *   ./volume [--cells N] [--seconds N] [--repeats N] [--out FILE]        a minute
 * Cells over D, four fifths of it over the column; seconds until the pool is looked at; runs of the
 * first second, with 15 cells or more also of a coarser tank. CSV on standard output, the drop as a
 * chart in FILE, volume.svg. */
#define _POSIX_C_SOURCE 200112L
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"

enum {
    RUNS = 6,
    TIMES = 100,
    SHAPE_AT = 30, /* of them: figure 7 */
    REPEATS_MAX = 64
};
typedef struct run {
    const char *name, *colour;
    double sound_speed, tolerance; /* m/s, or 0: partitioned */
} run;
static const run runs[RUNS] = {
    { "explicit, c0 0.1", "#26c", 0.1, 0 },   { "explicit, c0 0.5", "#c33", 0.5, 0 },
    { "explicit, c0 1", "#292", 1, 0 },       { "explicit, c0 10", "#93c", 10, 0 },
    { "partitioned, 1e-3", "#000", 0, 1e-3 }, { "partitioned, 1e-4", "#29d", 0, 1e-4 },
};
static const double D = 0.02, H = 0.05, fall_time = 0.1, g = 9.81;

static gs4_sim *begin(gs4_sim_desc d, const run *r, double viscosity, gs4_shape shape,
                      gs4_vec3 velocity)
{
    gs4_material m = scene_liquid(1000, viscosity, r->sound_speed);
    gs4_fill f = scene_fill(velocity);
    gs4_sim *sim;
    d.gravity = at(0, -g, 0);
    if (r->tolerance > 0) {
        d.scheme = GS4_PARTITIONED;
        d.solver_tolerance = (gs4_real)r->tolerance;
        m.incompressible = 1;
    }
    if (gs4_create(&d, &sim) < 0) {
        puts(gs4_last_error(NULL));
        exit(1);
    }
    if (gs4_add_material(sim, &m) < 0 || gs4_add_particles(sim, shape, &f) < 0) {
        puts(gs4_last_error(sim));
        exit(1);
    }
    return sim;
}

/* --- the drop --------------------------------------------------------------------------------- */

typedef struct fall {
    double volume[TIMES + 1]; /* over the first */
    int times, points;
    float *slice; /* x and y of particles in the middle, in D */
} fall;

/* Particles within half a cell of the middle plane. */
static void take_slice(gs4_sim *sim, double h, double middle, fall *out)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    int i;
    out->slice = (float *)malloc(2 * (size_t)x.count * sizeof *out->slice);
    for (i = 0; out->slice && i < x.count; i++) {
        const gs4_real *p = x.data + (size_t)i * (size_t)x.stride;
        if (fabs((double)p[2] - middle) > 0.5 * h) continue;
        out->slice[2 * out->points] = (float)(((double)p[0] - middle) / D);
        out->slice[2 * out->points++ + 1] = (float)((double)p[1] / D);
    }
}

static void drop(const run *r, int n, fall *out)
{
    const double h = D / n, middle = (3 * n / 2 + 2) * h;
    gs4_sim_desc d = scene_cube(1);
    gs4_sim *sim;
    double first, least = 1, most = 1;
    int k;
    memset(out, 0, sizeof *out);
    d.cells[0] = d.cells[2] = 3 * n + 4;
    d.cells[1] = 2 * n;
    d.cell_size = (gs4_real)h;
    d.walls[2] = GS4_WALL_STICK;
    sim = begin(d, r, 4, gs4_sphere(at(middle, D, middle), (gs4_real)(D / 2)), at(0, -1, 0));
    first = gs4_get_stats(sim).occupied_volume;
    out->volume[0] = 1;
    for (k = 1; k <= TIMES; k++) {
        gs4_stats s;
        if (gs4_advance(sim, (gs4_real)(fall_time / TIMES)) < 0) {
            printf("# %s: %s\n", r->name, gs4_last_error(sim));
            break;
        }
        s = gs4_get_stats(sim);
        out->volume[out->times = k] = s.occupied_volume / first;
        least = fmin(least, out->volume[k]);
        most = fmax(most, out->volume[k]);
        if (k == SHAPE_AT) take_slice(sim, h, middle, out);
        if (k % 10 == 0)
            printf("drop,%s,%.3f,%.4f,%.4f,%.4f,%.4f,%d\n", r->name, k * fall_time / TIMES,
                   out->volume[k], least, most, s.volume * 1000 / s.mass, (int)s.steps);
    }
    fflush(stdout);
    gs4_destroy(sim);
}

/* --- the chart -------------------------------------------------------------------------------- */

/* A chart in the picture, pixels, of time from `from` to `to` (s) and volume from low to high. */
typedef struct plane {
    double left, width, from, to, low, high, step;
} plane;

static double plane_x(const plane *p, double t)
{
    return p->left + (t - p->from) / (p->to - p->from) * p->width;
}

static double plane_y(const plane *p, double v)
{
    return 330 - (v - p->low) / (p->high - p->low) * 290;
}

static void draw_plane(FILE *f, const plane *p, const fall *falls)
{
    int i, k;
    for (i = 0; i <= 5; i++) {
        const double t = p->from + i * (p->to - p->from) / 5;
        fprintf(f,
                "<path d='M%.1f 40V330' stroke='#ddd'/><text x='%.1f' y='347' "
                "text-anchor='middle'>%g</text>\n",
                plane_x(p, t), plane_x(p, t), t);
    }
    for (i = 0; p->low + i * p->step < p->high + 0.5 * p->step; i++) {
        const double v = p->low + i * p->step;
        fprintf(f,
                "<path d='M%.1f %.1fh%.1f' stroke='%s'/><text x='%.1f' y='%.1f' "
                "text-anchor='end'>%g</text>\n",
                p->left, plane_y(p, v), p->width, fabs(v - 1) < 1e-9 ? "#000" : "#ddd", p->left - 5,
                plane_y(p, v) + 4, v);
    }
    for (i = 0; i < RUNS; i++) {
        int n = 0;
        fprintf(f, "<path fill='none' stroke='%s' stroke-width='2'%s d='", runs[i].colour,
                runs[i].tolerance > 0 ? " stroke-dasharray='2 3'" : "");
        for (k = 0; k <= falls[i].times; k++) {
            const double t = k * fall_time / TIMES, v = falls[i].volume[k];
            if (t > p->from - 1e-9 && v >= p->low && v <= p->high)
                fprintf(f, "%s%.1f %.1f", n++ ? "L" : "M", plane_x(p, t), plane_y(p, v));
            else
                n = 0;
        }
        fputs("'/>\n", f);
    }
}

/* The slice of a drop, D 100 pixels. */
static void draw_slice(FILE *f, const fall *of, const char *name, double x)
{
    int i;
    fprintf(f,
            "<path d='M%g 545h220' stroke='#000'/><text x='%g' y='565' "
            "text-anchor='middle'>%s</text>\n<path stroke='#357' stroke-width='2.6' "
            "stroke-linecap='round' d='",
            x - 110, x, name);
    for (i = 0; i < of->points; i++)
        fprintf(f, "M%.1f %.1fh0", x + 100 * (double)of->slice[2 * i],
                545 - 100 * (double)of->slice[2 * i + 1]);
    fputs("'/>\n", f);
}

static int draw(const char *path, const fall *falls)
{
    static const plane whole = { 50, 300, 0, 0.1, 0, 1.2, 0.2 },
                       end = { 420, 300, 0.08, 0.1, 0.9, 1.1, 0.05 };
    FILE *f = fopen(path, "w");
    int i;
    if (!f) return -1;
    fputs("<svg xmlns='http://www.w3.org/2000/svg' width='740' height='580' "
          "font-family='sans-serif' font-size='12'>\n<rect width='740' height='580' "
          "fill='white'/>\n<text x='50' y='20'>volume of a falling drop over its first, against "
          "time (s)</text>\n",
          f);
    draw_plane(f, &whole, falls);
    draw_plane(f, &end, falls);
    for (i = 0; i < RUNS; i++)
        fprintf(f, "<text x='%d' y='%d' fill='%s'>%s</text>\n", 50 + 240 * (i % 3),
                368 + 18 * (i / 3), runs[i].colour, runs[i].name);
    fprintf(f, "<text x='50' y='418'>after %g s, in the middle:</text>\n",
            fall_time * SHAPE_AT / TIMES);
    draw_slice(f, &falls[2], runs[2].name, 135);
    draw_slice(f, &falls[3], runs[3].name, 370);
    draw_slice(f, &falls[5], runs[5].name, 605);
    fputs("</svg>\n", f);
    return fclose(f);
}

/* --- the tank --------------------------------------------------------------------------------- */

static gs4_sim *tank(const run *r, int n, double viscosity)
{
    gs4_sim_desc d = scene_cube(1);
    d.cells[0] = 2 * n;
    d.cells[1] = 2 * n;
    d.cells[2] = n / 2;
    d.cell_size = (gs4_real)(H / n);
    return begin(d, r, viscosity, gs4_box(at(-1, -1, -1), at(H, H, 1)), at(0, 0, 0));
}

/* The first second of water, seconds of the processor; into `error` the mean of |volume - 1|. */
static double first_second(const run *r, int n, double *error)
{
    gs4_sim *sim = tank(r, n, 1e-3);
    double seconds = 0;
    int i;
    *error = 0;
    for (i = 0; i < 50; i++) {
        const clock_t start = clock();
        gs4_stats s;
        if (gs4_advance(sim, (gs4_real)0.02) < 0) {
            printf("# %s: %s\n", r->name, gs4_last_error(sim));
            exit(1);
        }
        seconds += (double)(clock() - start) / CLOCKS_PER_SEC;
        s = gs4_get_stats(sim);
        *error += fabs(s.occupied_volume * 1000 / s.mass - 1) / 50;
    }
    gs4_destroy(sim);
    return seconds;
}

/* Of the stiffest explicit liquid and the partitioned one, in turn; and of that with two thirds of
 * the cells, whose volume is more exact than the explicit one's. */
static void race(int n, int repeats)
{
    const struct {
        const run *of;
        int cells;
    } racer[3] = { { &runs[3], n }, { &runs[5], n }, { &runs[5], 2 * n / 3 } };
    const int racers = 2 * n / 3 < 8 ? 2 : 3;
    double seconds[3][REPEATS_MAX], error[3], median[3];
    int i, k;
    puts("tank,run,cells,seconds_of_the_first_second,mean_volume_error");
    for (k = 0; k < repeats; k++)
        for (i = 0; i < racers; i++)
            seconds[i][k] = first_second(racer[i].of, racer[i].cells, &error[i]);
    for (i = 0; i < racers; i++) {
        median[i] = bench_median(seconds[i], repeats);
        printf("tank,%s,%d,%.3f,%.4f\n", racer[i].of->name, racer[i].cells, median[i], error[i]);
    }
    for (i = 1; i < racers; i++)
        printf("# explicit over partitioned at %d cells: %.1f times the time\n", racer[i].cells,
               median[0] / median[i]);
    fflush(stdout);
}

/* Depth and volume of the pool once it has settled, of 0.3 Pa s: water would slosh on. */
static void settle(const run *r, int n, double seconds)
{
    gs4_sim *sim = tank(r, n, 0.3);
    const int result = gs4_advance(sim, (gs4_real)seconds);
    const gs4_stats s = gs4_get_stats(sim);
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    double sum = 0;
    int i;
    if (result < 0) printf("# %s: %s\n", r->name, gs4_last_error(sim));
    for (i = 0; i < x.count; i++) sum += (double)x.data[i * x.stride + 1];
    printf("pool,%s,%g,%.4f,%.4f,%.3g,%d\n", r->name, s.time, sum / x.count / (H / 4),
           s.occupied_volume * 1000 / s.mass, sqrt(2 * s.kinetic_energy / s.mass), (int)s.steps);
    fflush(stdout);
    gs4_destroy(sim);
}

int main(int count, char **values)
{
    static fall falls[RUNS];
    const char *out = "volume.svg";
    int n = 10, repeats = 1, i;
    double seconds = 10;
    for (i = 1; i + 1 < count; i += 2) {
        if (strcmp(values[i], "--cells") == 0)
            n = atoi(values[i + 1]);
        else if (strcmp(values[i], "--seconds") == 0)
            seconds = atof(values[i + 1]);
        else if (strcmp(values[i], "--repeats") == 0)
            repeats = atoi(values[i + 1]);
        else if (strcmp(values[i], "--out") == 0)
            out = values[i + 1];
    }
    if (n < 8 || repeats < 1 || repeats > REPEATS_MAX || !(seconds > 0)) {
        puts("8 cells or more, 1 to 64 repeats, some seconds");
        return 1;
    }
    bench_machine(stdout);
    puts("drop,run,t_s,volume,least,most,volume_by_J,steps");
    for (i = 0; i < RUNS; i++) drop(&runs[i], n, &falls[i]);
    if (draw(out, falls) != 0) printf("# %s could not be written\n", out);
    puts("pool,run,t_s,depth,volume,speed,steps");
    for (i = 0; i < RUNS; i++) settle(&runs[i], 4 * n / 5, seconds);
    race(4 * n / 5, repeats);
    for (i = 0; i < RUNS; i++) free(falls[i].slice);
    return 0;
}
