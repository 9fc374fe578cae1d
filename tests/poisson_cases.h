/* Problems for the elliptic solver, shared by tests and bench: pools, walls, sprays, rooms,
 * pores. Include after gs4mpm.h. Cells of size 1; x fastest; noise as right-hand side. */
#ifndef POISSON_CASES_H
#define POISSON_CASES_H
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct poisson_case {
    gs4_poisson_desc desc;
    uint8_t *kind;
    gs4_real *diagonal, *coefficient[3], *rhs, *x;
    size_t count, faces[3];
    uint64_t random;
} poisson_case;

static const char *const poisson_names[] = { "P1", "P2", "P3", "P4", "P5", "P4r",
                                             "T1", "T2", "T3", "T4", "T5", "T6" };
#define POISSON_CASES 12

/* xorshift: 0 to 1 */
static double poisson_random(uint64_t *s)
{
    *s ^= *s << 13;
    *s ^= *s >> 7;
    *s ^= *s << 17;
    return (double)(*s >> 11) * (1.0 / 9007199254740992.0);
}

static void poisson_free(poisson_case *p)
{
    int a;
    free(p->kind);
    free(p->diagonal);
    free(p->rhs);
    free(p->x);
    for (a = 0; a < 3; a++) free(p->coefficient[a]);
    memset(p, 0, sizeof *p);
}

static gs4_real *poisson_array(size_t n)
{
    gs4_real *v = (gs4_real *)calloc(n, sizeof *v);
    if (!v) exit(3);
    return v;
}

/* A box of n0 x n1 x n2 cells of one kind, x 0, noise on the right. */
static poisson_case poisson_box(int n0, int n1, int n2, gs4_cell kind)
{
    poisson_case p;
    size_t i;
    memset(&p, 0, sizeof p);
    p.desc.cells[0] = n0;
    p.desc.cells[1] = n1;
    p.desc.cells[2] = n2;
    p.desc.cell_size = 1;
    p.desc.tolerance = (gs4_real)1e-8;
    p.random = 88172645463325252u;
    p.count = (size_t)n0 * (size_t)n1 * (size_t)n2;
    for (i = 0; i < 3; i++)
        p.faces[i] = p.count / (size_t)p.desc.cells[i] * (size_t)(p.desc.cells[i] + 1);
    p.kind = (uint8_t *)malloc(p.count);
    if (!p.kind) exit(3);
    memset(p.kind, kind, p.count);
    p.rhs = poisson_array(p.count);
    p.x = poisson_array(p.count);
    for (i = 0; i < p.count; i++) p.rhs[i] = (gs4_real)(2 * poisson_random(&p.random) - 1);
    p.desc.kind = p.kind;
    return p;
}

static void poisson_shell(poisson_case *p, gs4_cell kind)
{
    const int *n = p->desc.cells;
    int i, j, k;
    for (k = 0; k < n[2]; k++)
        for (j = 0; j < n[1]; j++)
            for (i = 0; i < n[0]; i++)
                if (!i || !j || !k || i == n[0] - 1 || j == n[1] - 1 || k == n[2] - 1)
                    p->kind[((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0] + (size_t)i] =
                        (uint8_t)kind;
}

/* A wavy pool with a submerged cylinder, and a drop that touches a pillar: 36 % of the cells. */
static gs4_cell poisson_pool(double x, double y, double z)
{
    const double pillar = hypot(x - 0.75, y - 0.5), pipe = hypot(x - 0.3, z - 0.16);
    if (pillar < 0.06 || pipe < 0.08) return GS4_CELL_SOLID;
    if (sqrt((x - 0.6) * (x - 0.6) + (y - 0.5) * (y - 0.5) + (z - 0.72) * (z - 0.72)) < 0.13)
        return GS4_CELL_LIQUID;
    return z < 0.38 + 0.05 * sin(9 * x) * cos(7 * y) ? GS4_CELL_LIQUID : GS4_CELL_AIR;
}

/* Rooms of m^3 cells behind walls of one; most have a door of one cell, some none, and the air
 * is behind a few. */
static gs4_cell poisson_rooms(poisson_case *p, int i, int j, int k)
{
    const int m = 9, a[3] = { i % m, j % m, k % m };
    const int walls = (a[0] == 0) + (a[1] == 0) + (a[2] == 0);
    const uint64_t room = (uint64_t)(i / m) * 73856093u ^ (uint64_t)(j / m) * 19349663u
                          ^ (uint64_t)(k / m) * 83492791u;
    uint64_t s = (room + 1) * 0x9e3779b97f4a7c15u;
    (void)p;
    (void)poisson_random(&s);
    if (walls == 0)
        return poisson_random(&s) < 0.1 && a[0] == 4 && a[1] == 4 && a[2] == 4 ? GS4_CELL_AIR
                                                                               : GS4_CELL_LIQUID;
    return walls == 1 && (s >> 20) % 4 && a[0] + a[1] + a[2] == 8 && (a[0] == 4 || a[1] == 4)
               ? GS4_CELL_LIQUID
               : GS4_CELL_SOLID;
}

static gs4_cell poisson_kind(poisson_case *p, const char *name, int i, int j, int k)
{
    const int *n = p->desc.cells;
    const double x = (i + 0.5) / n[0], y = (j + 0.5) / n[1], z = (k + 0.5) / n[2];
    if (name[0] == 'P')
        return name[1] == '1' || name[1] == '5' ? GS4_CELL_LIQUID : poisson_pool(x, y, z);
    switch (name[1]) {
    case '1':
        return i == n[0] / 2 + 1 && (j != n[1] / 3 || k != n[2] / 3) ? GS4_CELL_SOLID
                                                                     : GS4_CELL_LIQUID;
    case '2':
        return poisson_random(&p->random) < 0.15 || i % 8 == 3 || (k % 12 == 5 && j > 4)
                   ? GS4_CELL_LIQUID
                   : GS4_CELL_AIR;
    case '3': return poisson_rooms(p, i, j, k);
    case '4': return j % 2 && (j / 2 % 2 ? i > 0 : i < n[0] - 1) ? GS4_CELL_SOLID : GS4_CELL_LIQUID;
    case '5':
        return poisson_random(&p->random) < 0.3     ? GS4_CELL_SOLID
               : poisson_random(&p->random) < 0.002 ? GS4_CELL_AIR
                                                    : GS4_CELL_LIQUID;
    }
    /* T6: a plate, about two cells thick and tilted, with a hole */
    {
        const double d = x + 0.3 * y - 0.15 * z - 0.55, hole = hypot(y - 0.4, z - 0.6);
        return fabs(d) * n[0] < 1.05 && hole > 1.2 / n[0] ? GS4_CELL_SOLID : GS4_CELL_LIQUID;
    }
}

/* coefficient 2 / (rho_i + rho_j) on all faces */
static void poisson_density(poisson_case *p, const double *rho)
{
    const int *n = p->desc.cells;
    const size_t step[3] = { 1, (size_t)n[0], (size_t)n[0] * (size_t)n[1] };
    int a, i[3];
    for (a = 0; a < 3; a++) {
        size_t face = 0;
        int m[3];
        memcpy(m, n, sizeof m);
        m[a]++;
        p->desc.coefficient[a] = p->coefficient[a] = poisson_array(p->faces[a]);
        for (i[2] = 0; i[2] < m[2]; i[2]++)
            for (i[1] = 0; i[1] < m[1]; i[1]++)
                for (i[0] = 0; i[0] < m[0]; i[0]++, face++) {
                    const size_t at =
                        (size_t)i[0] + (size_t)i[1] * step[1] + (size_t)i[2] * step[2];
                    p->coefficient[a][face] =
                        i[a] && i[a] < n[a] ? (gs4_real)(2 / (rho[at] + rho[at - step[a]])) : 0;
                }
    }
}

static poisson_case poisson_make(const char *name, int n)
{
    poisson_case p = poisson_box(n, n, n, GS4_CELL_LIQUID);
    size_t at = 0;
    int i, j, k;
    for (k = 0; k < n; k++)
        for (j = 0; j < n; j++)
            for (i = 0; i < n; i++, at++) p.kind[at] = (uint8_t)poisson_kind(&p, name, i, j, k);
    if (strcmp(name, "P1") == 0) poisson_shell(&p, GS4_CELL_AIR);
    if (strcmp(name, "T4") == 0) p.kind[0] = GS4_CELL_AIR;
    if (strcmp(name, "T6") == 0)
        for (i = 0; i < n; i++) p.kind[p.count - 1 - (size_t)i] = GS4_CELL_AIR;
    if (strcmp(name, "P3") == 0) {
        int a;
        p.desc.diagonal = p.diagonal = poisson_array(p.count);
        for (at = 0; at < p.count; at++) {
            p.diagonal[at] = 1;
            if (p.kind[at] == GS4_CELL_AIR) p.kind[at] = GS4_CELL_SOLID;
        }
        for (a = 0; a < 3; a++) {
            p.desc.coefficient[a] = p.coefficient[a] = poisson_array(p.faces[a]);
            for (at = 0; at < p.faces[a]; at++) p.coefficient[a][at] = 10;
        }
    }
    if (strncmp(name, "P4", 2) == 0) {
        double *rho = (double *)malloc(p.count * sizeof *rho);
        if (!rho) exit(3);
        for (at = 0, k = 0; k < n; k++)
            for (j = 0; j < n; j++)
                for (i = 0; i < n; i++, at++) {
                    const double x = (i + 0.5) / n, y = (j + 0.5) / n, z = (k + 0.5) / n;
                    const int blob = sin(11 * x + 1) * sin(13 * y + 2) * sin(17 * z + 3) > 0.2;
                    rho[at] = name[2] == 'r' ? pow(1000, poisson_random(&p.random))
                              : blob         ? 1000
                                             : 1;
                }
        poisson_density(&p, rho);
        free(rho);
    }
    return p;
}

/* (A x)_i from the definition, with the x of the air; `diagonal` of A and sum |a_ij x_j| where
 * asked for. */
static double poisson_row(const poisson_case *p, const int i[3], const double *x, double *diagonal,
                          double *size)
{
    const int *n = p->desc.cells;
    const size_t step[3] = { 1, (size_t)n[0], (size_t)n[0] * (size_t)n[1] };
    const size_t at = (size_t)i[0] + (size_t)i[1] * step[1] + (size_t)i[2] * step[2];
    const double h2 = (double)p->desc.cell_size * (double)p->desc.cell_size;
    double d = p->diagonal ? (double)p->diagonal[at] : 0, sum = d * x[at], all = fabs(sum);
    int a, side;
    for (a = 0; a < 3; a++)
        for (side = 0; side < 2; side++) {
            const size_t other = side ? at + step[a] : at - step[a];
            const size_t m0 = (size_t)(n[0] + (a == 0)), m1 = (size_t)(n[1] + (a == 1));
            const size_t face =
                (size_t)(i[0] + (a == 0 && side))
                + m0 * ((size_t)(i[1] + (a == 1 && side)) + m1 * (size_t)(i[2] + (a == 2 && side)));
            double c;
            if ((side ? i[a] + 1 >= n[a] : i[a] == 0) || p->kind[other] == GS4_CELL_SOLID) continue;
            c = (p->coefficient[a] ? (double)p->coefficient[a][face] : 1) / h2;
            d += c;
            sum += c * (x[at] - x[other]);
            all += c * (fabs(x[at]) + fabs(x[other]));
        }
    if (diagonal) *diagonal = d;
    if (size) *size = all;
    return sum;
}

#define POISSON_EACH(p, i, at)                                      \
    for (at = 0, i[2] = 0; i[2] < (p)->desc.cells[2]; i[2]++)       \
        for (i[1] = 0; i[1] < (p)->desc.cells[1]; i[1]++)           \
            for (i[0] = 0; i[0] < (p)->desc.cells[0]; i[0]++, at++) \
                if ((p)->kind[at] == GS4_CELL_LIQUID)

/* Takes the mean of v off in every part of the liquid with neither air nor diagonal, by
 * flooding; gives their number. */
static int poisson_take_means(const poisson_case *p, double *v)
{
    const int *n = p->desc.cells;
    const size_t step[3] = { 1, (size_t)n[0], (size_t)n[0] * (size_t)n[1] };
    size_t *queue = (size_t *)malloc((p->count + 1) * sizeof *queue), start, head, tail;
    char *seen = (char *)calloc(p->count + 1, 1);
    int pockets = 0;
    if (!queue || !seen) exit(3);
    for (start = 0; start < p->count; start++) {
        int held = 0, a, side;
        double sum = 0;
        if (seen[start] || p->kind[start] != GS4_CELL_LIQUID) continue;
        queue[0] = start;
        seen[start] = 1;
        for (head = 0, tail = 1; head < tail; head++) {
            const size_t at = queue[head];
            const size_t i[3] = { at % (size_t)n[0], at / step[1] % (size_t)n[1], at / step[2] };
            held |= p->diagonal && p->diagonal[at] > 0;
            sum += v[at];
            for (a = 0; a < 3; a++)
                for (side = 0; side < 2; side++) {
                    const size_t other = side ? at + step[a] : at - step[a];
                    const size_t m0 = (size_t)(n[0] + (a == 0)), m1 = (size_t)(n[1] + (a == 1));
                    const size_t face =
                        i[0] + (a == 0 && side)
                        + m0 * (i[1] + (a == 1 && side) + m1 * (i[2] + (a == 2 && side)));
                    if (side ? i[a] + 1 >= (size_t)n[a] : i[a] == 0) continue;
                    if (p->kind[other] == GS4_CELL_SOLID
                        || (p->coefficient[a] && !(p->coefficient[a][face] > 0)))
                        continue;
                    if (p->kind[other] == GS4_CELL_AIR) {
                        held = 1;
                        continue;
                    }
                    if (!seen[other]) {
                        seen[other] = 1;
                        queue[tail++] = other;
                    }
                }
        }
        if (held) continue;
        pockets++;
        for (head = 0; head < tail; head++) v[queue[head]] -= sum / (double)tail;
    }
    free(queue);
    free(seen);
    return pockets;
}

static double *poisson_doubles(const gs4_real *v, size_t n)
{
    double *d = (double *)malloc((n + 1) * sizeof *d);
    size_t i;
    if (!d) exit(3);
    for (i = 0; i < n; i++) d[i] = v ? (double)v[i] : 0;
    return d;
}

/* |rhs - A x| / |rhs with what flows in from the air|, means of pockets taken off; `bound`: what
 * rounding x to gs4_real may add. */
static double poisson_residual(const poisson_case *p, const gs4_real *x, double *bound)
{
    double *v = poisson_doubles(x, p->count), *b = poisson_doubles(p->rhs, p->count),
           *air = poisson_doubles(x, p->count);
    double above = 0, below = 0, rounding = 0;
    size_t at;
    int i[3];
    poisson_take_means(p, b);
    for (at = 0; at < p->count; at++)
        if (p->kind[at] == GS4_CELL_LIQUID) air[at] = 0;
    POISSON_EACH(p, i, at)
    {
        double size;
        const double r = b[at] - poisson_row(p, i, v, NULL, &size),
                     whole = b[at] - poisson_row(p, i, air, NULL, NULL);
        above += r * r;
        below += whole * whole;
        rounding += size * size;
    }
    free(v);
    free(b);
    free(air);
    if (bound)
        *bound =
            below > 0 ? sqrt(rounding / below) * (sizeof(gs4_real) == 8 ? 2.3e-16 : 1.2e-7) : 0;
    return below > 0 ? sqrt(above / below) : sqrt(above);
}
#endif
