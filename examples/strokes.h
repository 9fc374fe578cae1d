/* strokes.h - letters and a logo as paths of a pen, for letters.c and print3d.c.
 * MIT licence, as gs4mpm.h. */
#ifndef STROKES_H
#define STROKES_H
#include <math.h>

enum {
    STROKE_POINTS = 128
};

/* x and y of its corners in heights of the letter, y up, one after the other. */
typedef struct stroke {
    int points;
    double path[2 * STROKE_POINTS];
} stroke;

/* G, S, 4, M, P: about 0.74 wide */
static const stroke stroke_letters[5] = {
    { 10, { 0.62, 0.84, 0.50, 0.97, 0.22, 0.97, 0.06, 0.80, 0.06, 0.20,
            0.22, 0.03, 0.50, 0.03, 0.64, 0.18, 0.64, 0.46, 0.40, 0.46 } },
    { 12, { 0.62, 0.84, 0.50, 0.97, 0.20, 0.97, 0.06, 0.84, 0.06, 0.66, 0.20, 0.53,
            0.50, 0.47, 0.64, 0.34, 0.64, 0.16, 0.50, 0.03, 0.20, 0.03, 0.06, 0.16 } },
    { 4, { 0.50, 0.03, 0.50, 0.97, 0.04, 0.34, 0.68, 0.34 } },
    { 5, { 0.06, 0.03, 0.06, 0.97, 0.40, 0.45, 0.74, 0.97, 0.74, 0.03 } },
    { 7, { 0.06, 0.03, 0.06, 0.97, 0.46, 0.97, 0.62, 0.84, 0.62, 0.62, 0.46, 0.48, 0.06, 0.48 } }
};

/* A star of five rounded points, one of them up, as high as 1.14 letters. It begins on the right
 * and ends a little beyond that, so that its ends fuse. */
static stroke stroke_star(void)
{
    stroke star = { 0, { 0 } };
    for (; star.points <= 82; ++star.points) {
        const double angle = 2 * 3.14159265358979 / 80 * (star.points + 21),
                     r = 0.5 + 0.13 * cos(5 * angle);
        star.path[2 * star.points] = 0.36 + r * sin(angle);
        star.path[2 * star.points + 1] = 0.5 + r * cos(angle);
    }
    return star;
}

/* How long a stroke is, and where it is after `s` of that: x, y in `at`, which may be NULL. */
static double stroke_walk(const stroke *drawn, double s, double at[2])
{
    double length = 0;
    for (int i = 0; i + 1 < drawn->points; ++i) {
        const double *a = drawn->path + 2 * i, side = hypot(a[2] - a[0], a[3] - a[1]);
        if (at && (s >= length || !i)) {
            const double f = fmax(0, fmin(1, (s - length) / side));
            at[0] = a[0] + f * (a[2] - a[0]);
            at[1] = a[1] + f * (a[3] - a[1]);
        }
        length += side;
    }
    return length;
}

#endif
