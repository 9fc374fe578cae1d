/* What a liquid occupies: gs4_stats.occupied_volume, and that flow does not change it. */

/* A lattice of n[0] x n[1] x n[2] particles, `spacing` apart, from `low` on, each of the volume
 * `own` at rest; of those that are beyond the end of a periodic axis, their place inside. */
static void volume_lattice(gs4_sim *sim, gs4_vec3 low, const int n[3], double spacing, double own)
{
    const gs4_sim_desc d = gs4_get_desc(sim);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const double from[3] = { (double)low.x, (double)low.y, (double)low.z };
    const int count = n[0] * n[1] * n[2];
    gs4_real *x = (gs4_real *)malloc(3 * (size_t)count * sizeof *x);
    int i, a;
    for (i = 0; i < count; i++) {
        const int k[3] = { i % n[0], i / n[0] % n[1], i / n[0] / n[1] };
        for (a = 0; a < 3; a++) {
            const double size = d.cells[a] * (double)d.cell_size,
                         p = from[a] + (k[a] + 0.5) * spacing;
            x[3 * i + a] =
                (gs4_real)(d.walls[2 * a] == GS4_WALL_PERIODIC && p >= size ? p - size : p);
        }
    }
    CHECK(gs4_add_points(sim, x, count, (gs4_real)own, &f) == count);
    free(x);
}

/* Blocks at all offsets from the grid, in the midst, against walls of each kind and across a
 * periodic seam, 6 % denser and 10 % sparser than at rest: each occupies what its lattice does. */
static void test_volume_of_blocks(void)
{
    static const double packing[3] = { 1, 1.06, 0.9 };
    static const gs4_wall walls[4] = { GS4_WALL_STICK, GS4_WALL_SLIP, GS4_WALL_SEPARATE,
                                       GS4_WALL_PERIODIC };
    const int n[3] = { 20, 14, 10 };
    const gs4_material m = scene_liquid(1000, 0.1, 10);
    int i;
    for (i = 0; i < 4 * 3 * 11; i++) {
        gs4_sim_desc d = scene_cube(20);
        const double h = 1.0 / 20, spacing = h / 2, exact = n[0] * n[1] * n[2] * pow(spacing, 3);
        const int wall = i % 4, seam = walls[wall] == GS4_WALL_PERIODIC;
        const double off = i / 12 * 0.1 * h;
        gs4_sim *sim;
        d.walls[0] = d.walls[1] = walls[wall];
        sim = physics_create(&d, &m);
        volume_lattice(sim,
                       at(seam     ? 15 * h + off
                          : i / 12 ? 4 * h + off
                                   : 0,
                          5 * h + 0.7 * off, 6 * h + off),
                       n, spacing, packing[i / 4 % 3] * pow(spacing, 3));
        CHECK_CLOSE(gs4_get_stats(sim).occupied_volume / exact, 1, 1e-5);
        gs4_destroy(sim);
    }
}

/* Balls of 12 cells across, as they are filled; spray and films thinner than a cell occupy what
 * they do at rest; nothing does nothing; what an edit threw out of the grid is not known. */
static void test_volume_of_others(void)
{
    const gs4_material m = scene_liquid(1000, 0.1, 10);
    const gs4_fill f = scene_fill(at(0, 0, 0));
    const double h = 1.0 / 24, exact = 4 * 3.14159265358979 / 3 * pow(6 * h, 3);
    const int film[3] = { 20, 1, 20 };
    gs4_sim_desc d = scene_cube(24);
    gs4_edit e;
    gs4_sim *sim;
    int i;
    for (i = 0; i < 10; i++) {
        sim = physics_create(&d, &m);
        CHECK(gs4_get_stats(sim).occupied_volume == 0);
        CHECK(
            gs4_add_particles(
                sim, gs4_sphere(at(12 * h + 0.1 * i * h, 12 * h + 0.03 * i * h, 12 * h), 6 * h), &f)
            > 0);
        CHECK_CLOSE(gs4_get_stats(sim).occupied_volume / exact, 1, 0.01);
        gs4_destroy(sim);
    }
    sim = physics_create(&d, &m);
    volume_lattice(sim, at(2 * h, 7.3 * h, 3 * h), film, h / 2, pow(h / 2, 3));
    CHECK_CLOSE(gs4_get_stats(sim).occupied_volume / (400 * pow(h / 2, 3)), 1, 1e-5);
    e = gs4_edit_particles(sim, GS4_FIELD_POSITION);
    e.data[0] = -1;
    CHECK(gs4_get_stats(sim).occupied_volume == -1);
    e.data[0] = (gs4_real)NAN;
    CHECK(gs4_get_stats(sim).occupied_volume == -1);
    gs4_destroy(sim);
}

static void run_volume(void)
{
    RUN(test_volume_of_blocks);
    RUN(test_volume_of_others);
}
