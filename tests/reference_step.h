/* The step of gs4mpm.h once more as plain scalar code in double, one loop a stage, S1 to S8 as its
 * manual numbers them. Read ref_step at the end first, then the stages above it;
 * reference_parts.h has what they are made of.
 * tests/test_reference.c holds the kernels of the library to it, particle by particle.
 *
 * It knows walls, Newtonian and Oldroyd-B liquids and neo-Hookean solids. It knows no colliders,
 * emitters, heat, yield or sharp_gradients. |X| of a solid must stay below 1 and |L| dt of an
 * Oldroyd-B liquid below 1/4: beyond, the library takes an exponential or a split. */
#ifndef REFERENCE_STEP_H
#define REFERENCE_STEP_H
#include "reference_parts.h"

/* v~ - v at r from a particle at the stage: w~ x r, where sqrt(2) |w~| dt is bounded by 1/4; with
 * `affine` C~ r, |C~| dt as well. */
static void ref_turn(const ref_sim *s, const ref_particle *p, double turn[3][3])
{
    double squared = 0, bound;
    int c, a;
    for (c = 0; c < 3; c++) {
        const int y = (c + 1) % 3, z = (c + 2) % 3;
        turn[c][c] = 0;
        turn[z][y] = p->w[c] + s->ahead * p->dw[c];
        turn[y][z] = -turn[z][y];
    }
    for (c = 0; c < 3; c++)
        for (a = 0; a < 3; a++) {
            if (s->d.affine) turn[c][a] = p->C[c][a] + s->ahead * p->dC[c][a];
            squared += turn[c][a] * turn[c][a];
        }
    bound = ref_bound(squared, s->dt);
    for (c = 0; c < 9; c++) turn[c / 3][c % 3] *= bound;
}

/* S2, S3: x~, v~, w~ or C~ by (4);  m_i = sum w m,  (m v)_i = sum w m (v~ + w~ x (x_i - x~)) */
static void ref_scatter(ref_sim *s)
{
    int k, i, c;
    ref_clear(s);
    for (k = 0; k < s->count; k++) {
        ref_particle *p = &s->p[k];
        double x[3], v[3], turn[3][3];
        ref_stencil t;
        for (c = 0; c < 3; c++) {
            p->move[c] = p->v[c] - s->shift * p->a[c] - p->lag[c];
            x[c] = p->x[c] + s->ahead * p->move[c];
            v[c] = p->v[c] + s->ahead * p->a[c];
        }
        ref_turn(s, p, turn);
        ref_weights(s, x, &t);
        for (i = 0; i < 27; i++) {
            t.node[i]->m += t.w[i] * p->m;
            for (c = 0; c < 3; c++)
                t.node[i]->v[c] += t.w[i] * p->m
                                   * (v[c] + turn[c][0] * t.r[i][0] + turn[c][1] * t.r[i][1]
                                      + turn[c][2] * t.r[i][2]);
        }
    }
    ref_velocities(s);
}

/* S4, S5: V = sum w v_i,  L~ = sum v_i (x) grad w,  J~ = J** + s (J~ tr L~ + its last decay),
 * sigma there;  f_i = - sum J~ m / rho0 sigma grad w + sum w m (g - noise (V - v~)),
 * b_i = sum w m (rho0 c0^2/7) (J~ - 1) with J~ as predicted */
static void ref_forces(ref_sim *s)
{
    int k, i, c, a;
    for (k = 0; k < s->count; k++) {
        ref_particle *p = &s->p[k];
        double x[3], V[3], L[3][3], sigma[3][3], J, at_once;
        ref_stencil t;
        for (c = 0; c < 3; c++) x[c] = p->x[c] + s->ahead * p->move[c];
        ref_weights(s, x, &t);
        ref_gather(&t, REF_VELOCITY, V, L);
        for (c = 0; c < 3; c++) p->sub_grid[c] = V[c] - (p->v[c] + s->ahead * p->a[c]);
        p->noise = ref_noise(s, p->sub_grid, ref_decay(s, &at_once));
        J = (p->J + s->before * p->dJ + s->s * p->fades) / (1 - s->s * ref_trace(L));
        ref_stress(s, p, L, J, sigma);
        for (i = 0; i < 27; i++) {
            for (c = 0; c < 3; c++) {
                double pull = 0;
                for (a = 0; a < 3; a++) pull += sigma[c][a] * t.dw[i][a];
                t.node[i]->f[c] += t.w[i] * p->m * (s->g[c] - p->noise * p->sub_grid[c])
                                   - J * p->m / (double)p->is->density * pull;
            }
            t.node[i]->b += t.w[i] * p->m * ref_tait(p->is) * (p->J + s->ahead * p->dJ - 1);
        }
    }
    ref_fold_forces(s);
}

/* S6: acc_i = f_i / m_i,  u_i = v_i + s (acc_i - ag_i),  ag_i += (acc_i - ag_i) / alpha_m. A node
 * that was empty has ag_i = acc_i; in a first step ag_i = 0. A node filled by less than 10 % (of
 * the lightest material) gets nothing of s (acc_i - ag_i), from 43 % all; with `affine` 3 and 13 %.
 * Mirrors have no ag. */
static void ref_accelerate(ref_sim *s)
{
    int i, c;
    for (i = 0; i < ref_nodes(s); i++) {
        ref_node *n = &s->node[i];
        const double filled = n->m / (s->least_rho * s->h * s->h * s->h);
        const double part = s->restart    ? 1
                            : s->d.affine ? ref_smooth((filled - 0.03) * 10)
                                          : ref_smooth((filled - 0.1) * 3);
        n->b *= n->m > s->lightest ? 1 / n->m : 0;
        for (c = 0; c < 3; c++) {
            n->f[c] *= n->m > s->lightest ? 1 / n->m : 0;
            if (s->restart || !n->remembers) n->ag[c] = s->restart ? 0 : n->f[c];
            n->v[c] += part * s->s * (n->f[c] - n->ag[c]);
            n->ag[c] += (n->f[c] - n->ag[c]) / s->alpha_m;
        }
        n->remembers = n->m > s->lightest && !n->mirrors;
    }
    ref_fill(s);
    ref_fill_masses(s);
}

/* dJ/dt where noise decays by itself and nothing is solid: k (B - J~), B = 1 + sum w b_i / (rho0
 * c0^2/7), k = noise + c0 |B - J~| / h - g / c0, the difference at least 0. */
static double ref_volume_decay(const ref_sim *s, const ref_particle *p, double b)
{
    const double d = b / ref_tait(p->is) - (p->J + s->ahead * p->dJ - 1);
    const double g = sqrt(s->g[0] * s->g[0] + s->g[1] * s->g[1] + s->g[2] * s->g[2]);
    if (s->d.flip_decay_time != 0 || s->solids) return 0;
    return ref_stable(s, p->noise + fmax(0, s->most_c0 * fabs(d) / s->h - g / s->most_c0)) * d;
}

/* S7: A = sum w acc_i, U = sum w u_i, L = grad u;  by (4) dx/dt = U,  dJ/dt = J tr L, implicit in
 * J, its decay, and what makes room,  dv/dt = A + (fade + noise) (V - v~) + near (U - v), the
 * last implicit in v: c0/h times the weight of mirror nodes, and in spray, whose nodes are filled
 * by less than 8 % (none from 20 %), once more. */
static void ref_correct_particles(ref_sim *s)
{
    double at_once;
    const double fade = ref_stable(s, ref_decay(s, &at_once)), shift = (s->gamma - 0.5) * s->dt;
    int n, i, c;
    for (n = 0; n < s->count; n++) {
        ref_particle *p = &s->p[n];
        double x[3], U[3], A[3], L[3][3], grad_acc[3][3], near, R, filled, mirrors = 0, b = 0,
                                                                           fades;
        ref_stencil t;
        for (c = 0; c < 3; c++) x[c] = p->x[c] + s->ahead * p->move[c];
        ref_weights(s, x, &t);
        ref_gather(&t, REF_VELOCITY, U, L);
        ref_gather(&t, REF_ACCELERATION, A, grad_acc);
        for (i = 0; i < 27; i++) {
            mirrors += t.w[i] * t.node[i]->mirrors;
            b += t.w[i] * t.node[i]->b;
        }
        filled = ref_filled(s, &t);
        near = (mirrors + 1 - ref_smooth((filled - 0.08) / 0.12)) * s->most_c0 / s->h;
        for (c = 0; c < 3; c++) {
            R = A[c] + (fade + p->noise) * p->sub_grid[c]
                + near * (U[c] - p->v[c] - s->before * p->a[c]);
            ref_correct(s, R / (1 + s->s * near), &p->v[c], &p->a[c]);
            p->v[c] += at_once * p->sub_grid[c];
            ref_correct(s, U[c], &p->x[c], &p->move[c]);
            p->lag[c] = ref_half(p->v[c] - p->move[c] - shift * p->a[c]);
        }
        fades = ref_volume_decay(s, p, b) + ref_unpack(s, filled, p->J + s->ahead * p->dJ);
        R = (p->J + s->before * p->dJ + s->s * fades) / (1 - s->s * ref_trace(L)) * ref_trace(L);
        ref_correct(s, R + fades, &p->J, &p->dJ);
        p->fades = ref_half(fades);
        ref_correct_deformation(s, p, L);
        ref_correct_stress(s, p, L);
        if (s->d.affine)
            ref_correct_affine(s, p, &t, near, L);
        else
            ref_correct_spin(s, p, grad_acc, L);
        ref_put_back(s, p);
    }
    s->shift = shift;
}

static void ref_step(ref_sim *s, double dt)
{
    ref_rule(s, dt);
    ref_scatter(s);           /* S1 to S3; nothing is sorted here */
    ref_forces(s);            /* S4, S5 */
    ref_accelerate(s);        /* S6 */
    ref_correct_particles(s); /* S7, and of S8 the walls */
    s->restart = 0;
}

#endif
