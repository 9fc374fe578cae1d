/* The explicit algorithm as printed in "GS4 viscoelastic MPM" (2021), equations 30 to 45, for an
 * elastic bar in 1D, beside the same with rates kept on particles. rho_inf = rho_s = 0, h = 1,
 * masses and rest volumes 1/2, sigma V = V0 (F - 1) (stiffness 1). lambda3 is gamma/2, as the
 * family has it, not the printed 1/lambda5. */
enum {
    BAR_NODES = 24,
    BAR_COUNT = 24
};
typedef struct bar {
    double x[BAR_COUNT], v[BAR_COUNT], F[BAR_COUNT], a[BAR_COUNT], rate[BAR_COUNT] /* of F */;
} bar;

/* Quadratic B-splines w and their slopes g of the three nodes from the one that is returned;
 * node i is at i. */
static int bar_weights(double x, double w[3], double g[3])
{
    const int first = (int)floor(x - 0.5);
    const double d = x - first;
    w[0] = 0.5 * (1.5 - d) * (1.5 - d);
    w[1] = 0.75 - (d - 1) * (d - 1);
    w[2] = 0.5 * (d - 0.5) * (d - 0.5);
    g[0] = d - 1.5;
    g[1] = 2 - 2 * d;
    g[2] = d - 0.5;
    return first;
}

/* Equation 31: what the nodes have of y, by mass. */
static void bar_rasterise(const double *x, const double *y, double *node)
{
    double mass[BAR_NODES] = { 0 }, w[3], g[3];
    int p, i;
    memset(node, 0, BAR_NODES * sizeof *node);
    for (p = 0; p < BAR_COUNT; p++) {
        const int first = bar_weights(x[p], w, g);
        for (i = 0; i < 3; i++) {
            node[first + i] += w[i] * y[p];
            mass[first + i] += w[i];
        }
    }
    for (i = 0; i < BAR_NODES; i++)
        if (mass[i] > 0) node[i] /= mass[i];
}

/* f_i / m_i at the stage (x, F) */
static void bar_acceleration(const double *x, const double *F, double *node)
{
    double mass[BAR_NODES] = { 0 }, w[3], g[3];
    int p, i;
    memset(node, 0, BAR_NODES * sizeof *node);
    for (p = 0; p < BAR_COUNT; p++) {
        const int first = bar_weights(x[p], w, g);
        for (i = 0; i < 3; i++) {
            node[first + i] -= (F[p] - 1) * g[i];
            mass[first + i] += w[i];
        }
    }
    for (i = 0; i < BAR_NODES; i++)
        if (mass[i] > 0) node[i] /= mass[i];
}

static double bar_value(double x, const double *node)
{
    double w[3], g[3];
    const int first = bar_weights(x, w, g);
    return w[0] * node[first] + w[1] * node[first + 1] + w[2] * node[first + 2];
}

static double bar_slope(double x, const double *node)
{
    double w[3], g[3];
    const int first = bar_weights(x, w, g);
    return g[0] * node[first] + g[1] * node[first + 1] + g[2] * node[first + 2];
}

/* One step. flip < 0: rates on particles; else as printed, with this fraction of FLIP in (44). */
static void bar_step(bar *b, double dt, double flip)
{
    const double alpha_m = 1.5, alpha_f = 1, gamma = 1;
    double x[BAR_COUNT], v[BAR_COUNT], F[BAR_COUNT], v_stage[BAR_NODES], v_node[BAR_NODES],
        a_node[BAR_NODES], da[BAR_NODES];
    int p, i;
    for (p = 0; p < BAR_COUNT; p++) { /* (30) */
        x[p] = b->x[p] + alpha_f * dt * b->v[p] + 0.5 * alpha_f * dt * dt * b->a[p];
        v[p] = b->v[p] + alpha_f * dt * b->a[p];
    }
    bar_rasterise(x, v, v_stage);
    bar_rasterise(x, b->v, v_node);
    bar_rasterise(x, b->a, a_node);
    for (p = 0; p < BAR_COUNT; p++) /* (32), or (4) of the manual */
        F[p] = flip < 0 ? b->F[p] + alpha_f * dt * b->rate[p]
                        : (1 + alpha_f * dt * bar_slope(x[p], v_stage)
                           + 0.5 * alpha_f * dt * dt * bar_slope(x[p], a_node))
                              * b->F[p];
    bar_acceleration(x, F, da);
    /* (36) */
    if (flip >= 0)
        for (i = 0; i < BAR_NODES; i++) da[i] = (da[i] - a_node[i]) / alpha_m;
    for (p = 0; p < BAR_COUNT; p++) {
        const double gain =
            flip < 0 ? (bar_value(x[p], da) - b->a[p]) / alpha_m : bar_value(x[p], da);
        const double pic_a = bar_value(x[p], a_node) + bar_value(x[p], da);
        const double pic_v = bar_value(x[p], v_node) + dt * bar_value(x[p], a_node)
                             + gamma * dt * bar_value(x[p], da);
        /* (45) */
        b->x[p] += dt * b->v[p] + 0.5 * dt * dt * b->a[p] + 0.5 * gamma * dt * dt * gain;
        /* (43) */
        b->v[p] += dt * b->a[p] + gamma * dt * gain;
        b->a[p] += gain;
        if (flip < 0) {
            const double change = (bar_slope(x[p], v_stage) * F[p] - b->rate[p]) / alpha_m;
            b->F[p] += dt * b->rate[p] + gamma * dt * change;
            b->rate[p] += change;
            continue;
        }
        b->F[p] *= 1 + dt * bar_slope(x[p], v_node)
                   + 0.5 * dt * dt * (bar_slope(x[p], a_node) + gamma * bar_slope(x[p], da));
        /* (42), (44) */
        b->v[p] = flip * b->v[p] + (1 - flip) * pic_v;
        b->a[p] = flip * b->a[p] + (1 - flip) * pic_a;
    }
}

/* The bar, 12 cells long and unstrained, sets out with v = 0.1 sin: it rings. */
static void bar_run(bar *b, double time, int steps, double flip)
{
    double v_node[BAR_NODES];
    int p, i;
    memset(b, 0, sizeof *b);
    for (p = 0; p < BAR_COUNT; p++) {
        b->x[p] = 6.1 + 0.5 * p + 0.05 * sin(7.0 * p);
        b->v[p] = 0.1 * sin(acos(-1.0) * (b->x[p] - 12) / 12);
        b->F[p] = 1;
    }
    bar_rasterise(b->x, b->v, v_node);
    for (p = 0; p < BAR_COUNT; p++) b->rate[p] = bar_slope(b->x[p], v_node);
    for (i = 0; i < steps; i++) bar_step(b, time / steps, flip);
}
