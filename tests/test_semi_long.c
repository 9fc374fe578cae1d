/* Long thin flows of the semi-implicit scheme, in steps that outlast a fall. */

enum {
    THREAD_ACROSS = 6,
    THREAD_LENGTH = 48
}; /* cells of 1 m */

/* A thread along axis a, from a sticky wall on. */
static gs4_sim *semi_thread(int a, double g, double nu)
{
    const int b = (a + 1) % 3, c = (a + 2) % 3, width = THREAD_ACROSS + 8;
    const gs4_material m = partitioned_liquid(1000 * nu);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double down[3] = { 0, 0, 0 }, low[3], high[3];
    gs4_sim_desc d;
    gs4_sim *sim;
    int i;
    memset(&d, 0, sizeof d);
    d.scheme = GS4_SEMI_IMPLICIT;
    d.cell_size = 1;
    d.cfl = (gs4_real)0.8;
    d.cells[a] = 2 * THREAD_LENGTH;
    d.cells[b] = d.cells[c] = width;
    down[a] = g;
    d.gravity = at(down[0], down[1], down[2]);
    for (i = 0; i < 6; i++) d.walls[i] = i == 2 * a ? GS4_WALL_STICK : GS4_WALL_OPEN;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    f.material = gs4_add_material(sim, &m);
    low[a] = 0;
    high[a] = THREAD_LENGTH;
    low[b] = low[c] = high[b] = high[c] = 0.5 * width;
    CHECK(gs4_add_particles(sim,
                            gs4_cylinder(at(low[0], low[1], low[2]), at(high[0], high[1], high[2]),
                                         (gs4_real)(0.5 * THREAD_ACROSS)),
                            &f)
          > 0);
    return sim;
}

/* The mean place along axis a of those particles that were between low and high, by `first`. */
static double semi_thread_mean(const gs4_sim *sim, const double *first, int a, double low,
                               double high)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
    const uint32_t *id = gs4_particle_ids(sim);
    double sum = 0;
    int i, count = 0;
    for (i = 0; i < x.count; i++)
        if (first[id[i]] > low && first[id[i]] < high) {
            sum += (double)x.data[(size_t)i * (size_t)x.stride + a];
            count++;
        }
    return sum / count;
}

/* A thread hangs and stretches under its weight. In the slender limit (Trouton; shared/reference,
 * hanging_thread), tau = t rho g L0/(3 mu), what was at xi is at
 *     x(xi) = L0/tau ln((1 - tau (1 - xi/L0))/(1 - tau)),  of which the length is x(L0),
 * and the area there is 1 - tau (1 - xi/L0) of the first: one to two diameters below the wall,
 * which holds the thread's width for about one, it halves until tau = 0.6. */
static void test_semi_thread(void)
{
    const double g = 10, nu = 1e4, unit = 3 * nu / (g * THREAD_LENGTH);
    const double from = THREAD_ACROSS, to = 2 * THREAD_ACROSS, row = 0.5;
    static double first[40 * THREAD_ACROSS * THREAD_ACROSS * THREAD_LENGTH];
    int a, k, i;
    for (a = 0; a < 3; a++) {
        gs4_sim *sim = semi_thread(a, g, nu);
        const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION);
        const uint32_t *id = gs4_particle_ids(sim);
        for (i = 0; i < x.count; i++)
            first[id[i]] = (double)x.data[(size_t)i * (size_t)x.stride + a];
        for (k = 1; k <= 6; k++) {
            const double tau = 0.1 * k;
            const double below = 1 - tau * (1 - to / THREAD_LENGTH);
            const double above = 1 - tau * (1 - from / THREAD_LENGTH);
            const double law = -log(1 - tau) / tau * THREAD_LENGTH;
            double length, area;
            CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)(0.1 * unit)), GS4_OK);
            length = semi_thread_mean(sim, first, a, THREAD_LENGTH - row, THREAD_LENGTH) + row / 2;
            area = (to - from)
                   / (semi_thread_mean(sim, first, a, to - row, to + row)
                      - semi_thread_mean(sim, first, a, from - row, from + row));
            if (test_filter[0])
                printf("axis %d, tau %g: %.4f of the length, %.4f of the area, %d steps\n", a, tau,
                       length / law, area * THREAD_LENGTH / tau * log(below / above) / (to - from),
                       (int)gs4_get_stats(sim).steps);
            CHECK_BETWEEN(length / law, 0.98, 1.02);
            CHECK_BETWEEN(area * THREAD_LENGTH / tau * log(below / above) / (to - from), 0.98,
                          1.02);
        }
        CHECK(gs4_get_stats(sim).steps < 50);
        gs4_destroy(sim);
    }
}

static void run_semi_long(void) { RUN_FULL_ONCE(test_semi_thread); }
