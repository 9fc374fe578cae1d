/* chart.h - curves against logarithmic axes as SVG. Needs libc and libm. MIT licence, as gs4mpm.h.
 *
 *     chart_begin(f, width, height);                    // pixels
 *     chart_axes(f, &axes);                             // a title, lines and numbers of the grid
 *     chart_draw(f, &axes, &curve, "#06c", 2.5);        // what lies outside is left out
 *     chart_end(f); */
#ifndef CHART_H
#define CHART_H
#include <math.h>
#include <stdio.h>

enum {
    CHART_POINTS = 64
};
typedef struct chart_curve {
    double x[CHART_POINTS], y[CHART_POINTS];
    int count;
} chart_curve;

/* Where a chart is in the picture, pixels, and what it shows: powers of ten from first to last. */
typedef struct chart_plane {
    const char *title, *x_title;
    double left, top, width, height;
    int x_first, x_last, y_first, y_last;
} chart_plane;

static void chart_add(chart_curve *c, double x, double y)
{
    c->x[c->count] = x;
    c->y[c->count++] = y;
}

static double chart_x(const chart_plane *p, double decade)
{
    return p->left + (decade - p->x_first) * p->width / (p->x_last - p->x_first);
}

static double chart_y(const chart_plane *p, double decade)
{
    return p->top + (p->y_last - decade) * (p->height / (p->y_last - p->y_first));
}

static void chart_begin(FILE *f, int width, int height)
{
    fprintf(f,
            "<svg xmlns='http://www.w3.org/2000/svg' width='%d' height='%d' "
            "font-family='sans-serif' font-size='12'>\n<rect width='%d' height='%d' "
            "fill='white'/>\n",
            width, height, width, height);
}

static void chart_axes(FILE *f, const chart_plane *p)
{
    const double bottom = p->top + p->height;
    const char *const tick = "<path d='M%g %g%c%g' stroke='#ddd'/>"
                             "<text x='%g' y='%g' text-anchor='%s'>%g</text>\n";
    fprintf(f, "<text x='%g' y='%g' font-size='14'>%s</text>\n", p->left, p->top - 12, p->title);
    for (int d = p->x_first; d <= p->x_last; ++d)
        fprintf(f, tick, chart_x(p, d), p->top, 'v', p->height, chart_x(p, d), bottom + 16,
                "middle", pow(10, d));
    for (int d = p->y_first; d <= p->y_last; ++d)
        fprintf(f, tick, p->left, chart_y(p, d), 'h', p->width, p->left - 6, chart_y(p, d) + 4,
                "end", pow(10, d));
    fprintf(f, "<text x='%g' y='%g' text-anchor='middle'>%s</text>\n", p->left + p->width / 2,
            bottom + 34, p->x_title);
}

static void chart_draw(FILE *f, const chart_plane *p, const chart_curve *c, const char *colour,
                       double thick)
{
    fprintf(f, "<path fill='none' stroke='%s' stroke-width='%g' d='", colour, thick);
    for (int i = 0, n = 0; i < c->count; ++i) {
        const double x = chart_x(p, log10(c->x[i])),
                     y = c->y[i] > 0 ? chart_y(p, log10(c->y[i])) : -1;
        if (y >= p->top && y <= p->top + p->height && x >= p->left && x <= p->left + p->width)
            fprintf(f, "%s%.1f %.1f ", n++ ? "L" : "M", x, y);
        else
            n = 0;
    }
    fputs("'/>\n", f);
}

static void chart_end(FILE *f) { fputs("</svg>\n", f); }

#endif
