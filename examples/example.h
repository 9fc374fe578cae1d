/* example.h - what the examples share: options, the loop over frames, the progress line, files.
 * MIT licence, as gs4mpm.h.
 *
 *     int main(int argc, char **argv)
 *     {
 *         example e = {0};
 *         e.name = "drop"; e.frames = 60; e.cells = 64;       // the defaults
 *         example_options(&e, argc, argv);  // --frames N --cells N --threads N --out DIR
 *         gs4_sim *sim = example_create(&e, &desc);           // threads and clock filled in
 *         ...                            // the scene; example_need() where it can fail
 *         while (example_frame(&e, sim)) { }      // DIR/drop_0001.ply and .png and so on
 *         gs4_destroy(sim);
 *     }
 *
 * It holds the implementation of gs4mpm.h, so include it first and in one file only. It needs
 * POSIX for the clock, the threads and mkdir; the library itself needs none of it. */
#ifndef EXAMPLE_H
#define EXAMPLE_H
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#ifndef GS4_PTHREADS
#define GS4_PTHREADS
#endif
#ifndef GS4_LINKED /* the implementation is compiled here, or linked from gs4mpm.o: see README */
#define GS4MPM_IMPLEMENTATION
#endif
#include "gs4mpm.h"
#include "preview.h"
#include <errno.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

typedef enum example_colour {
    EXAMPLE_PLAIN = 0,
    EXAMPLE_MATERIAL,
    EXAMPLE_SPEED,
    EXAMPLE_TEMPERATURE,
    EXAMPLE_SETTING /* the number of the material where it is solid, look.high where liquid */
} example_colour;

/* For EXAMPLE_TEMPERATURE, where look.palette is not set: what is solid is grey, what is liquid
 * has a colour. */
static const float example_melt[6][3] = { { 0.33f, 0.42f, 0.56f }, { 0.45f, 0.49f, 0.57f },
                                          { 0.57f, 0.54f, 0.55f }, { 0.86f, 0.24f, 0.16f },
                                          { 0.97f, 0.55f, 0.13f }, { 1.00f, 0.90f, 0.42f } };

typedef struct example {
    /* files are OUT/NAME_0001.png; no `out`: the directory "out" */
    const char *name, *out;
    int frames, cells, threads; /* threads 0: two */
    /* of a table of materials: --row 1 to rows, in the names of files too; rows 0: no such
     * option */
    int row, rows;
    /* of the program: --scheme explicit, partitioned or semi-implicit, in the names of files too */
    int takes_scheme;
    gs4_scheme scheme;
    double frame_time; /* s from frame to frame; 0: 1/30 */
    /* what the pictures show: one colour, the number of the material, the speed or the
     * temperature */
    example_colour colour;
    /* EXAMPLE_TEMPERATURE: 40 % of the palette go from look.low to this, solid, 20 % from solid
     * to liquid, 40 % from this to look.high: very nearly enthalpy, which stays in order where
     * it is blurred */
    double melting;
    preview_settings look;
    int frame;   /* how many are done */
    double pace; /* s of waiting a frame, of late */
} example;

/* Numbers and vectors as the library wants them, float or double. */
static gs4_real real(double x) { return (gs4_real)x; }
static gs4_vec3 vec(double x, double y, double z)
{
    gs4_vec3 v;
    v.x = real(x);
    v.y = real(y);
    v.z = real(z);
    return v;
}

static double example_clock(void *user)
{
    struct timespec t;
    (void)user;
    return clock_gettime(CLOCK_MONOTONIC, &t) ? 0 : (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static const char *const example_schemes[3] = { "explicit", "partitioned", "semi-implicit" };

static void example_usage(const example *e, FILE *to)
{
    fprintf(to,
            "usage: %s%s%s [--frames N] [--cells N] [--threads N] [--out DIR]   (here %d frames, "
            "%d cells, %d threads, %s)\n",
            e->name, e->rows ? " [--row N]" : "",
            e->takes_scheme ? " [--scheme explicit|partitioned|semi-implicit]" : "", e->frames,
            e->cells, e->threads, e->out);
}

/* Says what is wrong and how it is meant, and leaves. */
static void example_misuse(const example *e, const char *what, const char *which)
{
    fprintf(stderr, "%s: %s%s\n", e->name, what, which);
    example_usage(e, stderr);
    exit(2);
}

static int example_number(const example *e, const char *option, const char *text, int low, int high)
{
    char *end, say[120];
    long n = strtol(text, &end, 10);
    sprintf(say, "%.20s takes a whole number from %d to %d, not ", option, low, high);
    if (end == text || *end || n < low || n > high)
        example_misuse(e, say, *text ? text : "nothing");
    return (int)n;
}

static gs4_scheme example_scheme(const example *e, const char *text)
{
    for (int i = 0; i < 3; ++i)
        if (!strcmp(text, example_schemes[i])) return (gs4_scheme)i;
    example_misuse(e, "--scheme takes explicit, partitioned or semi-implicit, not ",
                   *text ? text : "nothing");
    return GS4_EXPLICIT;
}

static void example_options(example *e, int argc, char **argv)
{
    struct stat is;
    if (!e->out) e->out = "out";
    if (!e->threads) e->threads = 2;
    if (!(e->frame_time > 0)) e->frame_time = 1.0 / 30;
    if (e->rows && !e->row) e->row = 1;
    for (int i = 1; i < argc; ++i) {
        const char *o = argv[i], *value = i + 1 < argc ? argv[i + 1] : "";
        if (!strcmp(o, "--help")) {
            example_usage(e, stdout);
            exit(0);
        }
        if (!strcmp(o, "--frames"))
            e->frames = example_number(e, o, value, 1, 9999);
        else if (!strcmp(o, "--cells"))
            e->cells = example_number(e, o, value, 8, 1024);
        else if (!strcmp(o, "--threads"))
            e->threads = example_number(e, o, value, 1, 256);
        else if (e->rows && !strcmp(o, "--row"))
            e->row = example_number(e, o, value, 1, e->rows);
        else if (e->takes_scheme && !strcmp(o, "--scheme"))
            e->scheme = example_scheme(e, value);
        else if (strcmp(o, "--out"))
            example_misuse(e, "there is no option ", o);
        else if (!*value)
            example_misuse(e, "--out takes the name of a directory", "");
        else
            e->out = value;
        ++i;
    }
    if (strlen(e->out) > 900) example_misuse(e, "the name of the directory is too long: ", e->out);
    if (mkdir(e->out, 0777) && (stat(e->out, &is) || !S_ISDIR(is.st_mode))) {
        fprintf(stderr, "%s: the directory %s cannot be made: %s\n", e->name, e->out,
                strerror(errno));
        exit(1);
    }
}

/* Passes a good result on; at an error prints the library's sentence and leaves. */
static int example_need(const gs4_sim *sim, int result)
{
    if (result >= 0) return result;
    fprintf(stderr, "\n%s: %s\n", gs4_result_string(result), gs4_last_error(sim));
    exit(1);
}

static gs4_sim *example_create(const example *e, gs4_sim_desc *desc)
{
    gs4_sim *sim = NULL;
    desc->threads = e->threads;
    if (e->takes_scheme) desc->scheme = e->scheme;
    desc->now = example_clock;
    example_need(NULL, gs4_create(desc, &sim));
    return sim;
}

static double example_share(double x, double low, double high)
{
    return fmax(0, fmin(1, (x - low) / (high - low)));
}

/* The surface with what the colour stands for. */
static gs4_triangles example_surface(const example *e, gs4_sim *sim)
{
    const gs4_field fields[] = { GS4_FIELD_POSITION, GS4_FIELD_MASS, GS4_FIELD_VELOCITY,
                                 GS4_FIELD_TEMPERATURE, GS4_FIELD_LIQUID_FRACTION };
    gs4_triangles t, liquid;
    example_need(sim, gs4_surface(sim, fields[e->colour], &t));
    if (e->colour == EXAMPLE_MATERIAL)
        for (int i = 0; i < t.vertex_count; ++i) t.values[i] = (gs4_real)t.materials[i];
    if (e->colour == EXAMPLE_SETTING)
        for (int i = 0; i < t.vertex_count; ++i)
            t.values[i] = real(t.materials[i]
                               + (double)t.values[i] * ((double)e->look.high - t.materials[i]));
    if (e->colour != EXAMPLE_TEMPERATURE) return t;
    example_need(sim, gs4_surface(sim, GS4_FIELD_LIQUID_FRACTION, &liquid)); /* the same vertices */
    for (int i = 0; i < t.vertex_count; ++i)
        t.values[i] =
            real(0.4 * example_share((double)t.values[i], (double)e->look.low, e->melting)
                 + 0.2 * (double)liquid.values[i]
                 + 0.4 * example_share((double)t.values[i], e->melting, (double)e->look.high));
    gs4_surface_free(sim, &liquid);
    return t;
}

static void example_write(const example *e, gs4_sim *sim)
{
    preview_settings look = e->look;
    gs4_triangles t;
    const char *scheme = e->scheme ? example_schemes[e->scheme] : "";
    char path[1024], row[16] = "";
    int failed = 0;
    if (!gs4_particles(sim, GS4_FIELD_POSITION).count) return;
    if (e->rows) sprintf(row, "_%d", e->row);
    sprintf(path, "%.900s/%.64s%s%s%s_%04d.ply", e->out, e->name, row, *scheme ? "_" : "", scheme,
            e->frame);
    example_need(sim, gs4_write_ply(sim, path));
    strcpy(strrchr(path, '.'), ".png");
    if (e->colour == EXAMPLE_TEMPERATURE) {
        look.low = 0;
        look.high = 1;
        if (!look.palette) {
            look.palette = example_melt;
            look.palette_count = 6;
        }
    }
    t = example_surface(e, sim);
    failed = preview_write_png(path, &look, &t);
    gs4_surface_free(sim, &t);
    if (failed) {
        fprintf(stderr, "\n%s: %s\n", path, failed == 1 ? "cannot be written" : "out of memory");
        exit(1);
    }
}

/* Simulates and writes one frame; 0 when all are done. */
static int example_frame(example *e, gs4_sim *sim)
{
    double start = example_clock(NULL), waited;
    gs4_stats before = gs4_get_stats(sim), s;
    if (e->frame == e->frames) {
        if (isatty(2)) fputc('\n', stderr);
        return 0;
    }
    example_need(sim, gs4_advance(sim, real(e->frame_time)));
    s = gs4_get_stats(sim);
    ++e->frame;
    example_write(e, sim);
    waited = example_clock(NULL) - start;
    e->pace = e->frame > 1 ? 0.7 * e->pace + 0.3 * waited : waited;
    waited = e->pace * (e->frames - e->frame);
    fprintf(stderr,
            "%s frame %d/%d   t %.3f s   dt %.2g s   %d particles   %.2f ms/step   %d:%02d left%s",
            isatty(2) ? "\r" : "", e->frame, e->frames, s.time, s.dt, s.particles,
            1e3 * (s.seconds_total - before.seconds_total) / (double)(s.steps - before.steps),
            (int)waited / 60, (int)waited % 60, isatty(2) ? "  " : "\n");
    return 1;
}

#endif
