/* web.c - three scenes behind functions for a web page: build.sh compiles this to wasm and puts it
 * and page.html into one file.
 *     sh examples/web/build.sh            open out/web.html in a browser, from disk or a server
 *
 * Natively it plays a scene to its end and prints the hash that the page shows there:
 *     cc -O3 -march=native examples/web/web.c -I. -lm -o web && ./web 0 24 0 0 0 10 0 2
 * with scene, cells, scheme, integrator, plain FLIP, viscosity, dt (0: the library's) and end. */
#define GS4_STATIC
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"

enum {
    POUR = 0,
    DROP,
    BOUNCE
};

static gs4_sim *sim;
static gs4_material material;
static double now;
static char said[200]; /* the last warning */

static gs4_vec3 vec(double x, double y, double z)
{
    return (gs4_vec3){ (gs4_real)x, (gs4_real)y, (gs4_real)z };
}

static void hear(int level, const char *message, void *user)
{
    (void)user;
    if (level == 1) strncpy(said, message, sizeof said - 1);
}

/* A rope of honey, 8 mm thick, falls on a plate. */
static int add_pour(void)
{
    gs4_collider plate = { 0 };
    gs4_emitter emitter = { 0 };
    plate.shape = gs4_cylinder(vec(0, -0.006, 0), vec(0, 0, 0), 0.036f);
    emitter.shape = gs4_cylinder(vec(0, 0.065, 0), vec(0, 0.071, 0), 0.004f);
    emitter.fill.velocity = vec(0, -0.11, 0);
    emitter.fill.jitter = 0.5f; /* what is symmetric has no side to fall to */
    return gs4_add_collider(sim, &plate) < 0 ? -1 : gs4_add_emitter(sim, &emitter);
}

/* A drop of 2 cm at 1 m/s, or a cube of 36 mm that turns as it falls. */
static int add_body(int scene)
{
    const gs4_vec3 low = vec(-0.018, 0.03, -0.018), high = vec(0.018, 0.066, 0.018);
    gs4_fill fill = { 0 };
    fill.velocity = vec(0, scene == DROP ? -1 : -0.5, 0);
    if (scene == DROP) return gs4_add_particles(sim, gs4_sphere(vec(0, 0.04, 0), 0.01f), &fill);
    fill.angular_velocity = vec(6, 0, 20);
    return gs4_add_particles(sim, gs4_box(low, high), &fill);
}

/* A scene anew. This and the next two return less than 0 for an error; web_error() says which. */
int web_start(int scene, int cells, int scheme, int integrator, int flip, double viscosity)
{
    static const double width[3] = { 0.08, 0.06, 0.12 }, height[3] = { 9 / 8.0, 0.9, 1 };
    static const float sound_speed[3] = { 6, 14, 14 }; /* ten times what moves there */
    gs4_sim_desc desc = { 0 };
    int result;
    gs4_destroy(sim), sim = NULL;
    now = said[0] = 0;
    desc.cell_size = (gs4_real)(width[scene] / cells);
    desc.cells[0] = desc.cells[2] = cells;
    desc.cells[1] = (int)(cells * height[scene]);
    desc.origin = vec(-width[scene] / 2, scene == POUR ? -0.01 : 0, -width[scene] / 2);
    desc.gravity = vec(0, -9.81, 0);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    if (scene != POUR) desc.walls[2] = scene == DROP ? GS4_WALL_STICK : GS4_WALL_SEPARATE;
    desc.scheme = (gs4_scheme)scheme;
    desc.integrator = (gs4_integrator)integrator;
    desc.flip_decay_time = flip ? INFINITY : 0;
    desc.max_dt = 1 / 60.0f;
    desc.log = hear;
    result = gs4_create(&desc, &sim);
    if (result < 0) return result;
    memset(&material, 0, sizeof material);
    material.density = scene == POUR ? 1420 : 1000;
    material.viscosity = (gs4_real)viscosity;
    material.incompressible = scheme != GS4_EXPLICIT && scene != BOUNCE;
    if (!material.incompressible) material.sound_speed = sound_speed[scene];
    material.solid = scene == BOUNCE ? GS4_NEO_HOOKEAN : GS4_NO_SOLID;
    material.shear_modulus = scene == BOUNCE ? 2e4f : 0;
    result = gs4_add_material(sim, &material);
    return result < 0 ? result : scene == POUR ? add_pour() : add_body(scene);
}

/* dt (s); 0: what the library finds good. */
int web_step(double dt)
{
    const gs4_budget one = { 1, 0, NULL, NULL };
    const gs4_real given = (gs4_real)dt;
    double done = given;
    const int result = dt > 0 ? gs4_step(sim, given) : gs4_advance_within(sim, 1, &one, &done);
    return now += result < 0 ? 0 : done, result;
}

int web_viscosity(double mu) { return gs4_set_viscosity(sim, 0, (gs4_real)mu); }
double web_time(void) { return now; }
uint64_t web_hash(void) { return gs4_state_hash(sim); }
const char *web_error(void) { return gs4_last_error(sim); }
const char *web_limit(void) { return gs4_limit_name(sim); }
const char *web_said(void) { return said; }

/* x y z and speed of each particle, and in `sums` what is plotted, SI. NULL: out of memory. */
const float *web_look(double sums[9])
{
    static float *points;
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   v = gs4_particles(sim, GS4_FIELD_VELOCITY),
                   J = gs4_particles(sim, GS4_FIELD_VOLUME_RATIO),
                   F = gs4_particles(sim, GS4_FIELD_DEFORMATION),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    const double c2 = pow(material.sound_speed, 2), G = material.shear_modulus / material.density;
    const gs4_stats s = gs4_get_stats(sim);
    double weight = 0, strain = 0;
    free(points);
    points = (float *)malloc((size_t)(x.count + 1) * 4 * sizeof *points);
    for (int i = 0; i < x.count && points; ++i) {
        const gs4_real *p = x.data + i * x.stride, *u = v.data + i * v.stride;
        const double mass = m.data[i * m.stride], j = J.data[i * J.stride];
        double square = 0; /* |F|^2; energies are neo-Hooke's and that of Tait's pressure */
        for (int k = 0; k < 9 && G > 0; ++k) square += pow(F.data[i * F.stride + k], 2);
        weight += mass * 9.81 * p[1];
        strain += mass * c2 / 7 * (pow(j, -6) / 6 + j - 7 / 6.0);
        if (G > 0) strain += mass * G / 2 * (square * pow(j, -2 / 3.0) - 3);
        for (int k = 0; k < 3; ++k) points[4 * i + k] = p[k];
        points[4 * i + 3] = sqrtf(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    }
    sums[0] = s.dt, sums[1] = (double)s.steps, sums[2] = s.particles;
    sums[3] = s.kinetic_energy, sums[4] = weight, sums[5] = strain;
    sums[6] = s.volume, sums[7] = s.occupied_volume, sums[8] = s.mass / material.density;
    return points;
}

#ifndef __wasm__
int main(int argc, char **argv)
{
    double a[8] = { 0, 24, 0, 0, 0, 10, 0, 2 };
    int result;
    for (int i = 1; i < argc && i <= 8; ++i) a[i - 1] = atof(argv[i]);
    result = web_start((int)a[0], (int)a[1], (int)a[2], (int)a[3], (int)a[4], a[5]);
    while (result >= 0 && now < a[7]) result = web_step(a[6]);
    printf("%s\n%016llx\n", result < 0 ? web_error() : "", (unsigned long long)web_hash());
    return result < 0;
}
#endif
