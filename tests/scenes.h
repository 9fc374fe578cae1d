/* Small scenes that tests and benches share. Include after gs4mpm.h. */
#ifndef SCENES_H
#define SCENES_H

static gs4_vec3 at(double x, double y, double z)
{
    gs4_vec3 v;
    v.x = (gs4_real)x;
    v.y = (gs4_real)y;
    v.z = (gs4_real)z;
    return v;
}

static int scene_sharp;  /* the next cubes have sharpened gradients */
static int scene_affine; /* particles in the next cubes carry their velocity gradient */

/* A cube of n^3 cells, side 1, all walls slip, no gravity. */
static gs4_sim_desc scene_cube(int n)
{
    gs4_sim_desc d;
    int w;
    memset(&d, 0, sizeof d);
    d.cells[0] = d.cells[1] = d.cells[2] = n;
    d.cell_size = (gs4_real)(1.0 / n);
    d.sharp_gradients = scene_sharp;
    d.affine = scene_affine;
    for (w = 0; w < 6; w++) d.walls[w] = GS4_WALL_SLIP;
    return d;
}

static gs4_material scene_liquid(double density, double viscosity, double sound_speed)
{
    gs4_material m;
    memset(&m, 0, sizeof m);
    m.density = (gs4_real)density;
    m.viscosity = (gs4_real)viscosity;
    m.sound_speed = (gs4_real)sound_speed;
    return m;
}

static gs4_fill scene_fill(gs4_vec3 velocity)
{
    gs4_fill f;
    memset(&f, 0, sizeof f);
    f.velocity = velocity;
    return f;
}

/* Component c of a field of the particle whose id is `id`; fields are looked up by id because
 * particles are sorted. */
static void scene_by_id(const gs4_sim *sim, gs4_field field, double *out)
{
    const gs4_view v = gs4_particles(sim, field);
    const uint32_t *id = gs4_particle_ids(sim);
    int i, c;
    for (i = 0; i < v.count; i++)
        for (c = 0; c < v.components; c++)
            out[(size_t)id[i] * (size_t)v.components + (size_t)c] =
                (double)v.data[(size_t)i * (size_t)v.stride + (size_t)c];
}

/* j_l(x)/x^l, j_l the spherical Bessel function; its derivative by x is -x times that of l + 1. */
static double scene_bessel(int l, double x)
{
    double term = 1, sum = 0;
    int k;
    for (k = 1; k <= l; k++) term /= 2 * k + 1;
    for (k = 1; k < 16; k++) {
        sum += term;
        term *= -x * x / (2.0 * k * (2 * (l + k) + 1));
    }
    return sum;
}
#endif
