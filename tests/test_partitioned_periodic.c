/* The partitioned scheme with periodic walls: exact flows, and that nothing depends on where the
 * seam is. */

static const gs4_integrator periodic_integrators[2] = { GS4_INTEGRATOR_GS4,
                                                        GS4_INTEGRATOR_BACKWARD_EULER };

/* A box of 1 along two axes and four cells along the third, all of them periodic, full of liquid:
 * u along `a` is `speed` + sin(k y) along `b`; and with `vortices` Taylor and Green's of it:
 *     u = sin(k y) cos(k x), v = -sin(k x) cos(k y),  rho (cos 2 k x + cos 2 k y)/4 = p. */
typedef struct periodic_case {
    int n, a, b, vortices;
    gs4_integrator how;
    gs4_material m;
    double speed, size;
} periodic_case;

static void periodic_velocity(const periodic_case *k, double x, double y, double v[2])
{
    const double w = 2 * acos(-1.0);
    v[0] = k->size * sin(w * y) * (k->vortices ? cos(w * x) : 1);
    v[1] = k->vortices ? -k->size * sin(w * x) * cos(w * y) : 0;
}

static gs4_sim *periodic_flow(const periodic_case *k)
{
    gs4_sim_desc d = partitioned_cube(k->n);
    gs4_fill f = scene_fill(at(0, 0, 0));
    double size[3];
    gs4_edit e;
    gs4_view x;
    gs4_sim *sim;
    int i, c;
    for (i = 0; i < 6; i++) d.walls[i] = GS4_WALL_PERIODIC;
    d.cells[3 - k->a - k->b] = 4;
    for (c = 0; c < 3; c++) size[c] = (double)d.cells[c] / k->n;
    d.integrator = k->how;
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    CHECK_RESULT(sim, gs4_add_material(sim, &k->m), 0);
    CHECK(gs4_add_particles(sim, gs4_box(at(0, 0, 0), at(size[0], size[1], size[2])), &f) > 0);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < e.count; i++) {
        double v[2];
        periodic_velocity(k, (double)x.data[i * x.stride + k->a],
                          (double)x.data[i * x.stride + k->b], v);
        e.data[i * e.stride + k->a] = (gs4_real)(k->speed + v[0]);
        e.data[i * e.stride + k->b] = (gs4_real)v[1];
    }
    return sim;
}

/* Amplitude of the flow at time t over the exact one, exp(-nu k^2 t), with vortices twice that; the
 * mean velocity, exactly constant, into `mean`. */
static double periodic_amplitude(const periodic_case *k, double t, double *mean)
{
    gs4_sim *sim = periodic_flow(k);
    const double w = 2 * acos(-1.0), nu = (double)k->m.viscosity / (double)k->m.density;
    double sum = 0, all = 0;
    gs4_view x, v;
    int i;
    CHECK_RESULT(sim, gs4_advance(sim, (gs4_real)t), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    *mean = 0;
    for (i = 0; i < x.count; i++) {
        double u[2];
        periodic_velocity(k, (double)x.data[i * x.stride + k->a] - k->speed * t,
                          (double)x.data[i * x.stride + k->b], u);
        sum += u[0] * ((double)v.data[i * v.stride + k->a] - k->speed)
               + u[1] * (double)v.data[i * v.stride + k->b];
        all += u[0] * u[0] + u[1] * u[1];
        *mean += (double)v.data[i * v.stride + k->a] / x.count;
    }
    gs4_destroy(sim);
    return sum / all / exp(-nu * w * w * (k->vortices ? 2 : 1) * t);
}

/* Shear waves and vortices that a wind carries across the seam, along every axis, in liquids that
 * compress and that do not. */
static void test_partitioned_periodic_flows(void)
{
    int n, a;
    for (n = 0; n < 16; n++)
        for (a = 0; a < (test_full ? 3 : 1); a++) {
            periodic_case k;
            double coarse, fine, mean, order;
            k.a = a;
            k.b = (a + 1 + (n & 1)) % 3;
            k.vortices = n >> 1 & 1;
            k.how = periodic_integrators[n >> 2 & 1];
            k.m = partitioned_liquid(50);
            if (n >> 3 & 1) {
                k.m.incompressible = 0;
                k.m.bulk_modulus = (gs4_real)1e6;
            }
            k.speed = 1;
            k.size = 0.1;
            k.n = 16;
            coarse = periodic_amplitude(&k, 0.1, &mean);
            CHECK_CLOSE(mean, 1, 1e-5);
            k.n = 32;
            /* of the two axes b one; both in turn */
            fine = test_full && a == 0 && (n & 1) == ((n >> 1 ^ n >> 2 ^ n >> 3) & 1)
                       ? periodic_amplitude(&k, 0.1, &mean)
                       : 1;
            order = log2(fabs(coarse - 1) / fabs(fine - 1));
            if (test_filter[0])
                printf("    axes %d %d, %s, %s, %s: %.4f %.4f, order %.2f\n", k.a, k.b,
                       k.vortices ? "vortices" : "shear", n >> 2 & 1 ? "BE" : "GS4",
                       n >> 3 & 1 ? "K 1e6" : "incompressible", coarse, fine, order);
            CHECK_BETWEEN(coarse - 1, k.vortices ? 0.025 : 0.006, k.vortices ? 0.037 : 0.011);
            if (fine != 1) CHECK_BETWEEN(order, 1.85, 2.05);
        }
}

/* A pool with a hump that runs sideways, periodic along two axes, `shift` cells further along both;
 * with `scene` of different walls, bodies and matter. Where particle i ends, less the shift, and
 * its velocity into xv. How many. */
enum {
    PERIODIC_N = 10,
    PERIODIC_MOST = 8 * PERIODIC_N * PERIODIC_N * 8,
    PERIODIC_BODY = 8,
    PERIODIC_PUDDLE = 16
};

/* A puddle, 4 x 4 cells, on a floor that separates: is p a cell beside it? There a particle of
 * eight flies, and leaves the floor if that lets it. */
static int periodic_is_rim(int scene, int down, const double p[3])
{
    int c, rim = 0;
    for (c = 0; c < 3; c++)
        if (c != down) rim |= p[c] < 0.2 || p[c] > 0.6;
    return scene & PERIODIC_PUDDLE && rim;
}

/* Is there a particle at p, spaced by half a cell? */
static int periodic_is_full(int scene, int down, const double p[3])
{
    double top = 0.4 + 0.1 * sin(2 * acos(-1.0) * p[(down + 1) % 3]), off = 0;
    int c, in = 1, even = 1;
    for (c = 0; c < 3; c++) {
        off += pow(p[c] - (c == down ? 0.2 : 0.35), 2);
        in &= c == down ? p[c] < 0.1 : p[c] > 0.1 && p[c] < 0.7;
        even &= !((int)(2 * PERIODIC_N * p[c]) & 1);
    }
    if (periodic_is_rim(scene, down, p)) return in && even;
    if (scene & PERIODIC_PUDDLE) top = 0.3;
    return p[down] < top && !(scene & PERIODIC_BODY && off < 0.15 * 0.15);
}

static gs4_wall periodic_floor(int scene)
{
    if (scene & PERIODIC_PUDDLE) return GS4_WALL_SEPARATE;
    return scene & 1 ? GS4_WALL_STICK : scene & 4 ? GS4_WALL_SEPARATE : GS4_WALL_SLIP;
}

/* A sphere that turns, three cells and more from the seam: behind that there is no image of it. */
static void periodic_bodies(gs4_sim *sim, int scene, int down, const double by[3])
{
    gs4_collider c;
    double x[3] = { 0.35, 0.35, 0.35 };
    int a;
    memset(&c, 0, sizeof c);
    x[down] = 0.2;
    for (a = 0; a < 3; a++) x[a] += by[a];
    c.shape = gs4_sphere(at(x[0], x[1], x[2]), (gs4_real)0.15);
    c.contact = scene & 1 ? GS4_WALL_STICK : GS4_WALL_SLIP;
    c.pivot = at(x[0], x[1], x[2]);
    c.angular_velocity = at(1, 2, 3);
    CHECK(gs4_add_collider(sim, &c) >= 0);
}

static int periodic_pool(int scene, int down, int shift, double xv[][6])
{
    static gs4_real xyz[3 * PERIODIC_MOST];
    static uint8_t is_rim[PERIODIC_MOST];
    gs4_sim_desc d = partitioned_cube(PERIODIC_N);
    gs4_material m = partitioned_liquid(scene & 1 ? 20 : 0);
    const double h = 1.0 / PERIODIC_N, step = shift * h;
    double by[3] = { step, step, step }, g[3] = { 0, 0, 0 };
    gs4_fill f = scene_fill(at(0, 0, 0));
    gs4_view x, v;
    gs4_edit e;
    gs4_sim *sim;
    int i, c, count = 0;
    by[down] = 0;
    g[down] = -9.81;
    d.gravity = at(g[0], g[1], g[2]);
    d.integrator = periodic_integrators[scene >> 1 & 1];
    for (i = 0; i < 6; i++) d.walls[i] = i / 2 == down ? GS4_WALL_SLIP : GS4_WALL_PERIODIC;
    d.walls[2 * down] = periodic_floor(scene);
    if (scene & 4) {
        m.incompressible = 0;
        m.bulk_modulus = (gs4_real)1e5;
    }
    for (i = 0; i < PERIODIC_MOST; i++) {
        const int n = 2 * PERIODIC_N, at_[3] = { i % n, i / n % n, i / (n * n) };
        double p[3];
        for (c = 0; c < 3; c++) p[c] = (at_[c == down ? 2 : c == (down + 1) % 3] + 0.5) * h / 2;
        if (!periodic_is_full(scene, down, p)) continue;
        is_rim[count] = (uint8_t)periodic_is_rim(scene, down, p);
        for (c = 0; c < 3; c++) {
            double q = p[c] + by[c];
            if (c != down && q >= 1) q -= 1;
            xyz[3 * count + c] = (gs4_real)q;
        }
        count++;
    }
    CHECK_RESULT(NULL, gs4_create(&d, &sim), GS4_OK);
    if (scene & PERIODIC_BODY) periodic_bodies(sim, scene, down, by);
    f.material = gs4_add_material(sim, &m);
    count = gs4_add_points(sim, xyz, count, (gs4_real)(h * h * h / 8), &f);
    CHECK(count > 0);
    e = gs4_edit_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < count; i++) {
        e.data[i * e.stride + (down + 1) % 3] = 1;
        if (is_rim[i]) e.data[i * e.stride + down] = (gs4_real)0.3;
    }
    for (i = 0; i < 12; i++) CHECK_RESULT(sim, gs4_step(sim, (gs4_real)0.01), GS4_OK);
    x = gs4_particles(sim, GS4_FIELD_POSITION);
    v = gs4_particles(sim, GS4_FIELD_VELOCITY);
    for (i = 0; i < count; i++)
        for (c = 0; c < 3; c++) {
            double *to = xv[gs4_particle_ids(sim)[i]];
            to[c] = (double)x.data[i * x.stride + c] - by[c];
            if (c != down) to[c] -= floor(to[c]);
            to[3 + c] = (double)v.data[i * v.stride + c];
        }
    gs4_destroy(sim);
    return count;
}

/* It does not matter where the seam is: under shifts by 3 and 7 cells each particle goes the same
 * way, rounding and the solver's tolerance apart. */
static void test_partitioned_periodic_seam(void)
{
    static double one[PERIODIC_MOST][6], other[PERIODIC_MOST][6];
    static const int shifts[3][2] = { { 3, 7 }, { 1, 3 }, { 4, 8 } };
    int scene, s, down, i, c;
    for (scene = 0; scene < 24; scene++)
        for (down = 0; down < 3; down++) {
            int count;
            if (!test_slow && (scene + down) % 3) continue; /* each scene along one axis */
            count = periodic_pool(scene, down, 0, one);
            for (s = 0; s < 2; s++) {
                double far = 0, fast = 0;
                CHECK(periodic_pool(scene, down, shifts[scene >> 3][s], other) == count);
                for (i = 0; i < count; i++)
                    for (c = 0; c < 3; c++) {
                        double gap = one[i][c] - other[i][c];
                        if (c != down) gap -= floor(gap + 0.5);
                        far = fmax(far, fabs(gap));
                        fast = fmax(fast, fabs(one[i][3 + c] - other[i][3 + c]));
                    }
                if (test_filter[0])
                    printf("    scene %d, down %d, shift %d: %.2g m, %.2g m/s\n", scene, down,
                           shifts[scene >> 3][s], far, fast);
                /* in float the half in which dx/dt is kept rounds: 2^-11 m/s in 0.12 s */
                CHECK_CLOSE(far, 0, sizeof(gs4_real) == 8 ? 1e-9 : 0.12 / 2048);
                CHECK_CLOSE(fast, 0, sizeof(gs4_real) == 8 ? 1e-9 : 5e-5);
            }
        }
}

static void run_partitioned_periodic(void)
{
    RUN_FULL_ONCE(test_partitioned_periodic_flows);
    RUN_FULL_ONCE(test_partitioned_periodic_seam);
}
