/* What the stages of reference_step.h are made of, in plain C and double: what particles and nodes
 * are, rule (4), weights, laws, walls, corrections; and symplectic Euler. */
#ifndef REFERENCE_PARTS_H
#define REFERENCE_PARTS_H

typedef struct ref_particle {
    const gs4_material *is;
    double m, x[3], v[3], a[3], J, dJ; /* a = dv/dt, dJ = dJ/dt */
    double move[3], lag[3];            /* move = dx/dt = v - shift a - lag */
    double F[3][3], M[3][3];           /* solids: dF/dt = M F */
    double w[3], dw[3];                /* solids: spin, rad/s, and its rate */
    double s[3][3], ds[3][3];          /* Oldroyd-B: non-local stress and its rate */
    double sub_grid[3], noise;         /* V - v~ of this step; how much faster it decays, 1/s */
    double fades;                      /* of dJ/dt the decay, in the last step */
    double C[3][3], dC[3][3];          /* symplectic Euler, affine GS4: velocity gradient; rate */
} ref_particle;

typedef struct ref_node {
    double m, v[3], f[3];   /* mass; momentum, then velocity; force, then acceleration */
    double ag[3];           /* the acceleration that it remembers */
    double b;               /* sum w m (rho0 c0^2 / 7) (J~ - 1), then over m */
    double near;            /* symplectic Euler: mass nearest to it; b is of that alone */
    int remembers, pressed; /* has an ag; material pressed on the separating wall here */
    int folds, mirrors;     /* bit a: folds along axis a; it does so at a wall, not a period */
} ref_node;

typedef struct ref_sim {
    gs4_sim_desc d; /* as gs4_get_desc completes it */
    ref_particle *p;
    ref_node *node; /* of cells + 4 along each axis; two are behind each wall */
    int count, restart, solids, n[3];
    double h, shift, lightest, most_c0, least_rho, origin[3], g[3];
    double unpacking; /* c0/(200 h), 1/s; 0 with solids and unlike densities */
    double dt, alpha_m, alpha_f, gamma, ahead, s, before; /* of this step: ref_rule */
} ref_sim;

typedef struct ref_stencil {
    ref_node *node[27];
    double w[27], dw[27][3], r[27][3]; /* weight, its gradient, x_i - x */
} ref_stencil;

/* --- rule (4), weights ------------------------------------------------------------------------ */

/* y~ = y + ahead r. Terms implicit in y: y~ = y** + s R(y~), y** = y + before r, which is (4). */
static void ref_rule(ref_sim *s, double dt)
{
    const double r = (double)s->d.rho_inf, q = (double)s->d.rho_inf_spurious;
    s->dt = dt;
    s->alpha_m = s->restart ? 1 : (3 + r + q - r * q) / (2 * (1 + r) * (1 + q));
    s->alpha_f = s->restart ? 0.5 : 1 / (1 + r);
    s->gamma = s->restart ? 1 : 1 / (1 + q);
    s->ahead = s->alpha_f * dt;
    s->s = s->alpha_f * s->gamma * dt / s->alpha_m;
    s->before = s->ahead - s->s;
}

/* (4): dr = (R - r) / alpha_m,  y += dt r + gamma dt dr,  r += dr */
static void ref_correct(const ref_sim *s, double R, double *y, double *r)
{
    const double dr = (R - *r) / s->alpha_m;
    *y += s->dt * *r + s->gamma * s->dt * dr;
    *r += dr;
}

/* Quadratic B-splines on 27 nodes, which are cell centres; xi: from the centre of x's cell. */
static void ref_weights(const ref_sim *s, const double x[3], ref_stencil *t)
{
    double w[3][3], d[3][3], xi[3];
    int cell[3], a, i;
    for (a = 0; a < 3; a++) {
        const double q = (x[a] - s->origin[a]) / s->h;
        cell[a] = (int)floor(q);
        xi[a] = q - cell[a] - 0.5;
        w[a][0] = (0.5 - xi[a]) * (0.5 - xi[a]) / 2;
        w[a][1] = 0.75 - xi[a] * xi[a];
        w[a][2] = (0.5 + xi[a]) * (0.5 + xi[a]) / 2;
        d[a][0] = -(0.5 - xi[a]) / s->h;
        d[a][1] = -2 * xi[a] / s->h;
        d[a][2] = (0.5 + xi[a]) / s->h;
    }
    for (i = 0; i < 27; i++) {
        const int k[3] = { i % 3, i / 3 % 3, i / 9 };
        int at = 0;
        for (a = 2; a >= 0; a--) at = at * s->n[a] + cell[a] + k[a] + 1;
        t->node[i] = &s->node[at];
        t->w[i] = w[0][k[0]] * w[1][k[1]] * w[2][k[2]];
        for (a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            t->dw[i][a] = d[a][k[a]] * w[b][k[b]] * w[c][k[c]];
            t->r[i][a] = (k[a] - 1 - xi[a]) * s->h;
        }
    }
}

enum {
    REF_VELOCITY,
    REF_ACCELERATION
};

/* sum w y_i and the gradient sum y_i (x) grad w of what nodes have. */
static void ref_gather(const ref_stencil *t, int what, double y[3], double gradient[3][3])
{
    int i, c, a;
    for (c = 0; c < 3; c++) y[c] = gradient[c][0] = gradient[c][1] = gradient[c][2] = 0;
    for (i = 0; i < 27; i++)
        for (c = 0; c < 3; c++) {
            const double own = what == REF_VELOCITY ? t->node[i]->v[c] : t->node[i]->f[c];
            y[c] += t->w[i] * own;
            for (a = 0; a < 3; a++) gradient[c][a] += t->dw[i][a] * own;
        }
}

/* Smoothly from 0 where t <= 0 to 1 where t >= 1. */
static double ref_smooth(double t) { return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t); }

static double ref_trace(double A[3][3]) { return A[0][0] + A[1][1] + A[2][2]; }

/* (A B)_ij */
static double ref_product(double A[3][3], double B[3][3], int i, int j)
{
    return A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j];
}

/* --- stress ----------------------------------------------------------------------------------- */

static void ref_cofactors(double A[3][3], double C[3][3])
{
    int i;
    for (i = 0; i < 9; i++) {
        const int a = (i / 3 + 1) % 3, b = (i / 3 + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
        C[i / 3][i % 3] = A[a][c] * A[b][d] - A[a][d] * A[b][c];
    }
}

static double ref_determinant(double A[3][3])
{
    double C[3][3];
    ref_cofactors(A, C);
    return A[0][0] * C[0][0] + A[0][1] * C[0][1] + A[0][2] * C[0][2];
}

/* F <- (I - X/2)^-1 (I + X/2) F = F + (I - X/2)^-1 X F: to second order exp(X) F, and a rotation
 * stays one. */
static void ref_deform(double X[3][3], double F[3][3])
{
    double A[3][3], C[3][3], XF[3][3], det;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            A[i][j] = (i == j) - X[i][j] / 2;
            XF[i][j] = ref_product(X, F, i, j);
        }
    ref_cofactors(A, C); /* A^-1 = C^T / det A */
    det = ref_determinant(A);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            F[i][j] += (C[0][i] * XF[0][j] + C[1][i] * XF[1][j] + C[2][i] * XF[2][j]) / det;
}

/* The right-hand side of (5) for Oldroyd-B without its relaxation: L s + s L^T + 2 G0 D */
static double ref_stretched(const gs4_material *m, double L[3][3], double s[3][3], int i, int j)
{
    const double G0 =
        (1 - (double)m->local_fraction) * (double)m->viscosity / (double)m->relaxation_time;
    return ref_product(L, s, i, j) + ref_product(L, s, j, i) + G0 * (L[i][j] + L[j][i]);
}

/* S4: sigma by (2), (3), (5), (6) of J~ and, by (4) for known L~,
 *     s~ = s** + s (L~ s* + s* L~^T + 2 G0 D~ - s~ / lambda_b),  s* the predicted one
 *     F~ = (I - Y/2)^-1 (I + Y/2) F,  Y = alpha_f dt M + s (L~ - M) */
static void ref_stress(const ref_sim *s, const ref_particle *p, double L[3][3], double J,
                       double sigma[3][3])
{
    const gs4_material *m = p->is;
    const int elastic = m->liquid == GS4_OLDROYD_B, solid = m->solid == GS4_NEO_HOOKEAN;
    const double mu = (elastic ? (double)m->local_fraction : 1) * (double)m->viscosity;
    const double c0 = (double)m->sound_speed, tait = (double)m->density * c0 * c0 / 7;
    double F[3][3], Y[3][3], B[3][3], star[3][3];
    int i, j;
    memcpy(F, p->F, sizeof F);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            sigma[i][j] = mu * (L[i][j] + L[j][i]) - (i == j ? tait * (pow(J, -7) - 1) : 0);
            star[i][j] = p->s[i][j] + s->ahead * p->ds[i][j];
            Y[i][j] = s->ahead * p->M[i][j] + s->s * (L[i][j] - p->M[i][j]);
        }
    if (solid) ref_deform(Y, F);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            B[i][j] = (F[i][0] * F[j][0] + F[i][1] * F[j][1] + F[i][2] * F[j][2]) / cbrt(J * J);
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            if (solid)
                sigma[i][j] +=
                    (double)m->shear_modulus / J * (B[i][j] - (i == j ? ref_trace(B) / 3 : 0));
            if (elastic)
                sigma[i][j] +=
                    (p->s[i][j] + s->before * p->ds[i][j] + s->s * ref_stretched(m, L, star, i, j))
                    / (1 + s->s / (double)m->relaxation_time);
        }
}

/* --- walls: beyond one, node -1-k mirrors node k, or is the node a period away ---------------- */

/* The original of node i, NULL where it is not beyond that wall. */
static ref_node *ref_original(const ref_sim *s, int wall, int i)
{
    const int axis = wall / 2, n = s->d.cells[axis];
    const int stride = axis == 0 ? 1 : axis == 1 ? s->n[0] : s->n[0] * s->n[1];
    const int at = i / stride % s->n[axis] - 2;
    const int periodic = s->d.walls[wall] == GS4_WALL_PERIODIC;
    const int to = at < 0 ? (periodic ? at + n : -1 - at) : (periodic ? at - n : 2 * n - 1 - at);
    if (s->d.walls[wall] == GS4_WALL_OPEN || (wall & 1 ? at < n : at >= 0)) return NULL;
    return &s->node[i + (to - at) * stride];
}

/* Of component c in a mirror: stick odd in all, slip and separate odd in the normal one. */
static double ref_sign(const ref_sim *s, int wall, int c)
{
    const gs4_wall kind = s->d.walls[wall];
    return kind == GS4_WALL_STICK || (kind != GS4_WALL_PERIODIC && c == wall / 2) ? -1 : 1;
}

static int ref_nodes(const ref_sim *s) { return s->n[0] * s->n[1] * s->n[2]; }

/* Is node i, beyond a separating wall, in contact? Where it and its original together move into the
 * wall, or where material pressed on it in the last step. Beyond others, too: as its original in
 * those. */
static int ref_touches(const ref_sim *s, int wall, int i)
{
    const double out = wall & 1 ? 1 : -1;
    const ref_node *mirror = &s->node[i], *to;
    int other;
    for (other = 0; other < 6; other++) {
        to = other / 2 == wall / 2 ? NULL : ref_original(s, other, (int)(mirror - s->node));
        if (to) mirror = to;
    }
    to = ref_original(s, wall, (int)(mirror - s->node));
    return mirror->pressed || out * (mirror->v[wall / 2] + to->v[wall / 2]) > 0;
}

/* What reached nodes beyond a wall goes to their originals with the sign, mass with +, wall after
 * wall; separating walls come last, all that are in contact when the others are done. */
static void ref_fold_momentum(ref_sim *s)
{
    int pass, wall, i, c;
    for (pass = 0; pass < 3; pass++)
        for (wall = 0; wall < 6; wall++)
            for (i = 0; i < ref_nodes(s); i++) {
                ref_node *mirror = &s->node[i], *to = ref_original(s, wall, i);
                const int separate = s->d.walls[wall] == GS4_WALL_SEPARATE;
                if (!to || separate != (pass > 0)) continue;
                if (pass < 2 && (!separate || ref_touches(s, wall, i))) {
                    mirror->folds |= 1 << wall / 2;
                    mirror->mirrors |= s->d.walls[wall] != GS4_WALL_PERIODIC;
                }
                if (pass == 1 || !(mirror->folds >> wall / 2 & 1)) continue;
                for (c = 0; c < 3; c++) to->v[c] += ref_sign(s, wall, c) * mirror->v[c];
                to->m += mirror->m;
            }
}

/* The same of forces. One out of the domain, weight included, presses on a separating wall where
 * material does not leave with ten times its impulse in this step. */
static void ref_fold_forces(ref_sim *s)
{
    int pass, wall, i, c;
    for (pass = 0; pass < 3; pass++)
        for (wall = 0; wall < 6; wall++)
            for (i = 0; i < ref_nodes(s); i++) {
                ref_node *mirror = &s->node[i], *to = ref_original(s, wall, i);
                const int separate = s->d.walls[wall] == GS4_WALL_SEPARATE;
                const double out = wall & 1 ? 1 : -1, push = out * mirror->f[wall / 2] * s->dt;
                if (!pass && !wall) mirror->pressed = 0;
                if (!to || separate != (pass > 0)) continue;
                if (pass == 1)
                    mirror->pressed |= push > 0 && push > -0.1 * out * to->v[wall / 2] * mirror->m;
                for (c = 0; c < 3 && pass != 1 && mirror->folds >> wall / 2 & 1; c++)
                    to->f[c] += ref_sign(s, wall, c) * mirror->f[c];
                if (pass != 1 && mirror->folds >> wall / 2 & 1) to->b += mirror->b;
            }
}

/* Then they take what their originals have, walls in the reverse order. Their mass stays what
 * reached them; a period away it is that of the original. */
static void ref_fill(ref_sim *s)
{
    int wall, i, c;
    for (wall = 5; wall >= 0; wall--)
        for (i = 0; i < ref_nodes(s); i++) {
            ref_node *mirror = &s->node[i], *from = ref_original(s, wall, i);
            if (!from || !(mirror->folds >> wall / 2 & 1)) continue;
            for (c = 0; c < 3; c++) {
                mirror->v[c] = ref_sign(s, wall, c) * from->v[c];
                mirror->f[c] = ref_sign(s, wall, c) * from->f[c];
            }
            mirror->b = from->b;
            if (s->d.walls[wall] == GS4_WALL_PERIODIC) mirror->m = from->m;
        }
}

/* At last mirrors are as full as their originals, as J asks how densely particles lie, and with
 * symplectic Euler have what lies nearest to those. */
static void ref_fill_masses(ref_sim *s)
{
    int wall, i;
    for (wall = 5; wall >= 0 && s->unpacking > 0; wall--)
        for (i = 0; i < ref_nodes(s); i++) {
            ref_node *mirror = &s->node[i], *from = ref_original(s, wall, i);
            if (!from || !(mirror->folds >> wall / 2 & 1)) continue;
            mirror->m = from->m;
            mirror->near = from->near;
            if (s->d.integrator == GS4_INTEGRATOR_SYMPLECTIC_EULER) mirror->b = from->b;
        }
}

/* f = sum w m_i / (rho0 h^3) */
static double ref_filled(const ref_sim *s, const ref_stencil *t)
{
    double m = 0;
    int i;
    for (i = 0; i < 27; i++) m += t->w[i] * t->node[i]->m;
    return m / (s->least_rho * s->h * s->h * s->h);
}

/* dJ/dt where particles lie too densely: c0/(200 h) min(0, max(1.08/f, 0.9) - J). */
static double ref_unpack(const ref_sim *s, double f, double J)
{
    return s->unpacking * fmin(0, fmax(1.08 / f, 0.9) - J);
}

/* A particle that ended behind a wall is put on it and loses its velocity into it. */
static void ref_put_back(const ref_sim *s, ref_particle *p)
{
    int a;
    for (a = 0; a < 3; a++) {
        const double low = s->origin[a], high = low + s->d.cells[a] * s->h;
        const int below = p->x[a] < low;
        if (!below && p->x[a] < high) continue;
        if (s->d.walls[2 * a] == GS4_WALL_PERIODIC)
            p->x[a] += below ? high - low : low - high;
        else {
            p->x[a] = below ? low : high; /* less a few roundings there */
            p->v[a] = below ? fmax(p->v[a], 0) : fmin(p->v[a], 0);
        }
    }
}

static void ref_clear(ref_sim *s)
{
    int i, c;
    for (i = 0; i < ref_nodes(s); i++) {
        ref_node *n = &s->node[i];
        n->m = n->b = n->near = 0;
        for (c = 0; c < 3; c++) n->v[c] = n->f[c] = 0;
        n->folds = n->mirrors = 0;
    }
}

/* v_i = (m v)_i / m_i, 0 where there is next to no mass: less than eps^2 of a particle. */
static void ref_velocities(ref_sim *s)
{
    int i, c;
    ref_fold_momentum(s);
    for (i = 0; i < ref_nodes(s); i++)
        for (c = 0; c < 3; c++)
            s->node[i].v[c] *= s->node[i].m > s->lightest ? 1 / s->node[i].m : 0;
    ref_fill(s);
}

/* --- pieces of the stages --------------------------------------------------------------------- */

/* |A| dt is bounded by 1/4: the factor that makes it so. */
static double ref_bound(double squared, double dt)
{
    return squared * dt * dt > 0.0625 ? 0.25 / (sqrt(squared) * dt) : 1;
}

/* A rate k of decay as it is taken, so that the explicit (4) stays stable: k (1 + x)/(1 + x + x^2),
 * x = k dt (3 + r + q - r q)/(3.2 (1 - r q)). */
static double ref_stable(const ref_sim *s, double k)
{
    const double r = (double)s->d.rho_inf, q = (double)s->d.rho_inf_spurious;
    const double x = k * s->dt * (3 + r + q - r * q) / (3.2 * (1 - r * q));
    return k * (1 + x) / (1 + x + x * x);
}

/* k = 1 / flip_decay_time, 1/s; by default 1 / 0.5 s, and |V - v~|/h more. Where k dt > 1 it is no
 * rate: 1 - 1/(1 + s k) of V - v~ goes at once. */
static double ref_decay(const ref_sim *s, double *at_once)
{
    const double time = s->d.flip_decay_time == 0 ? 0.5 : (double)s->d.flip_decay_time;
    const double k = time < 1e30 ? 1 / time : 0; /* INFINITY: none */
    *at_once = k * s->dt > 1 ? 1 - 1 / (1 + s->s * k) : 0;
    return *at_once > 0 ? 0 : k;
}

/* How much faster particles decay as noise. */
static double ref_noise(const ref_sim *s, const double *d, double k)
{
    if (s->d.flip_decay_time != 0 || s->solids) return 0;
    return ref_stable(s, k + sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / s->h)
           - ref_stable(s, k);
}

static double ref_tait(const gs4_material *m)
{
    return (double)m->density * (double)m->sound_speed * (double)m->sound_speed / 7;
}

/* S7 for solids: M by (4) with grad u = L;  F <- (I - X/2)^-1 (I + X/2) F, X = dt (M + gamma dM),
 * then scaled to det F = J. Liquids: F = J^(1/3) I. */
static void ref_correct_deformation(const ref_sim *s, ref_particle *p, double L[3][3])
{
    double X[3][3] = { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 } }, scale;
    int i;
    if (p->is->solid == GS4_NEO_HOOKEAN) {
        for (i = 0; i < 9; i++)
            ref_correct(s, L[i / 3][i % 3], &X[i / 3][i % 3], &p->M[i / 3][i % 3]);
        ref_deform(X, p->F);
    }
    scale = cbrt(p->J / ref_determinant(p->F));
    for (i = 0; i < 9; i++) p->F[i / 3][i % 3] *= scale;
}

/* S7 for Oldroyd-B: (alpha_m + z / lambda_b) ds' = L y + y L^T + 2 G0 D - s* / lambda_b - s' with
 * z = alpha_f gamma dt, s* the predicted stress. y = s*; in a first step plus alpha_f dt s', s' of
 * now; where gamma <= 0.66 four times again with y = s* + z ds'. */
static void ref_correct_stress(const ref_sim *s, ref_particle *p, double L[3][3])
{
    const gs4_material *m = p->is;
    const double lambda = (double)m->relaxation_time, z = s->alpha_f * s->gamma * s->dt;
    double star[3][3], y[3][3], change[3][3];
    int i, j, pass;
    if (m->liquid != GS4_OLDROYD_B) return;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            star[i][j] = y[i][j] = p->s[i][j] + s->ahead * p->ds[i][j];
            if (s->restart)
                y[i][j] += s->ahead * (ref_stretched(m, L, p->s, i, j) - p->s[i][j] / lambda);
        }
    for (pass = 0; pass < (s->gamma > 0.66 ? 1 : 5); pass++) {
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++)
                change[i][j] = (ref_stretched(m, L, y, i, j) - star[i][j] / lambda - p->ds[i][j])
                               / (s->alpha_m + z / lambda);
        for (i = 0; i < 9; i++) y[i / 3][i % 3] = star[i / 3][i % 3] + z * change[i / 3][i % 3];
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            p->s[i][j] += s->dt * p->ds[i][j] + s->gamma * s->dt * change[i][j];
            p->ds[i][j] += change[i][j];
        }
}

/* S7 for solids: dw/dt = curl(A - L L)/2 - k (w - curl u/2), the last implicit in w; k that
 * of the sub-grid velocity. */
/* The same of the whole velocity gradient C, where the grid sees little at once `near` faster; and
 * accelerations by their first moments, 4/h^2 sum w acc_i (x) (x_i - x). */
static void ref_correct_affine(const ref_sim *s, ref_particle *p, const ref_stencil *t, double near,
                               double L[3][3])
{
    double at_once;
    const double k = ref_decay(s, &at_once) + p->noise + near;
    int i, c, a;
    for (c = 0; c < 3; c++)
        for (a = 0; a < 3; a++) {
            const double before = p->C[c][a] + s->before * p->dC[c][a];
            double R = -ref_product(L, L, c, a) - k * (before - L[c][a]);
            for (i = 0; i < 27; i++)
                R += 4 / (s->h * s->h) * t->w[i] * t->node[i]->f[c] * t->r[i][a];
            R /= 1 + s->s * k;
            ref_correct(s, R, &p->C[c][a], &p->dC[c][a]);
            p->C[c][a] -= at_once * (before + s->s * R - L[c][a]);
        }
}

static void ref_correct_spin(const ref_sim *s, ref_particle *p, double grad_acc[3][3],
                             double L[3][3])
{
    double at_once, seen, before, R, k = ref_decay(s, &at_once) + p->noise;
    int c;
    if (p->is->solid != GS4_NEO_HOOKEAN) return;
    for (c = 0; c < 3; c++) {
        const int y = (c + 1) % 3, z = (c + 2) % 3;
        seen = (L[z][y] - L[y][z]) / 2;
        before = p->w[c] + s->before * p->dw[c];
        R = (grad_acc[z][y] - ref_product(L, L, z, y) - grad_acc[y][z] + ref_product(L, L, y, z))
            / 2;
        R = (R - k * (before - seen)) / (1 + s->s * k);
        ref_correct(s, R, &p->w[c], &p->dw[c]);
        p->w[c] -= at_once * (before + s->s * R - seen);
    }
}

/* The lag is kept in half the width of gs4_real: 24 digits of 53, 8 of 24. */
static double ref_half(double lag)
{
    const int digits = sizeof(gs4_real) == 8 ? 24 : 8;
    int e;
    const double part = frexp(lag, &e);
    return ldexp(rint(ldexp(part, digits)), e - digits);
}

/* After an edit by hand the next step is a first step: no rates. */
static void ref_restart(ref_sim *s)
{
    int k;
    s->restart = 1;
    s->shift = 0;
    for (k = 0; k < s->count; k++) {
        ref_particle *p = &s->p[k];
        p->dJ = p->fades = 0;
        memset(p->a, 0, sizeof p->a);
        memset(p->lag, 0, sizeof p->lag);
        memset(p->M, 0, sizeof p->M);
        memset(p->dw, 0, sizeof p->dw);
        memset(p->dC, 0, sizeof p->dC);
        memset(p->ds, 0, sizeof p->ds);
    }
}

/* --- symplectic Euler: MLS-MPM with APIC ------------------------------------------------------ */

/* J goes to B = 1 + sum w b_i / (rho0 c0^2/7 sum w near_i) at the rate c0 |B - J| / h - g / c0,
 * implicit in J, where f B > 1 and one of the nodes is packed, m_i > 1.08 rho0 h^3. */
static void ref_settle(const ref_sim *s, ref_particle *p, const ref_stencil *t)
{
    const double g = sqrt(s->g[0] * s->g[0] + s->g[1] * s->g[1] + s->g[2] * s->g[2]);
    double b = 0, near = 0, most = 0, decay;
    int i;
    for (i = 0; i < 27; i++) {
        b += t->w[i] * t->node[i]->b;
        near += t->w[i] * t->node[i]->near;
        most = fmax(most, t->node[i]->m);
    }
    b = 1 + b / (ref_tait(p->is) * near);
    if (!(s->unpacking > 0 && most > 1.08 * s->least_rho * s->h * s->h * s->h)) return;
    if (!(ref_filled(s, t) * b > 1)) return;
    decay = s->dt * fmax(0, s->most_c0 * fabs(b - p->J) / s->h - g / s->most_c0);
    p->J += decay / (1 + decay) * (b - p->J);
}

/* (m v)_i = sum w [m (v + dt g) + (m C - dt J m/rho0 sigma 4/h^2) (x_i - x)], |C| dt at most 1/4;
 * v = sum w v_i,  C = sum v_i (x) grad w,  x += dt v,  J by ref_settle, then J += dt J tr C, then
 * dt ref_unpack;
 * F and s by (4) with alpha_m = alpha_f = gamma = 1 and no rates. */
static void ref_euler_step(ref_sim *s, double dt)
{
    int k, i, c, a;
    s->ahead = s->s = s->before = 0; /* stress of now */
    s->restart = 0;
    ref_clear(s);
    for (k = 0; k < s->count; k++) {
        ref_particle *p = &s->p[k];
        double sigma[3][3], squared = 0, bound;
        const double f = 4 * dt * p->J / (double)p->is->density / (s->h * s->h);
        ref_stencil t;
        ref_weights(s, p->x, &t);
        ref_stress(s, p, p->C, p->J, sigma);
        for (i = 0; i < 9; i++) squared += p->C[i / 3][i % 3] * p->C[i / 3][i % 3];
        bound = ref_bound(squared, dt);
        t.node[13]->b += p->m * ref_tait(p->is) * (p->J - 1);
        t.node[13]->near += p->m;
        for (i = 0; i < 27; i++) {
            t.node[i]->m += t.w[i] * p->m;
            for (c = 0; c < 3; c++) {
                double v = p->v[c] + dt * s->g[c];
                for (a = 0; a < 3; a++) v += (bound * p->C[c][a] - f * sigma[c][a]) * t.r[i][a];
                t.node[i]->v[c] += t.w[i] * p->m * v;
            }
        }
    }
    ref_velocities(s);
    ref_fill_masses(s);
    s->dt = dt;
    s->alpha_m = s->alpha_f = s->gamma = 1;
    for (k = 0; k < s->count; k++) {
        ref_particle *p = &s->p[k];
        ref_stencil t;
        ref_weights(s, p->x, &t);
        ref_gather(&t, REF_VELOCITY, p->v, p->C);
        for (c = 0; c < 3; c++) p->x[c] += dt * p->v[c];
        ref_settle(s, p, &t);
        p->J += dt * p->J * ref_trace(p->C);
        p->J += dt * ref_unpack(s, ref_filled(s, &t), p->J);
        memset(p->M, 0, sizeof p->M);
        memset(p->ds, 0, sizeof p->ds);
        ref_correct_deformation(s, p, p->C);
        ref_correct_stress(s, p, p->C);
        ref_put_back(s, p);
    }
}
#endif
