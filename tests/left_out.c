/* left_out.c - what is left out when the library is compiled (GS4_NO_SOLIDS and the like) is
 * refused with a sentence that names the macro, and changes nothing; what is not works as ever.
 * Prints the hash of a scene that needs none of it: the same of all builds. portability.sh
 * left_out runs it. */
#include <stdio.h>
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"

#ifdef GS4_NO_VISCOELASTIC
#define NO_VISCOELASTIC "GS4_NO_VISCOELASTIC"
#else
#define NO_VISCOELASTIC NULL
#endif
#ifdef GS4_NO_SOLIDS
#define NO_SOLIDS "GS4_NO_SOLIDS"
#else
#define NO_SOLIDS NULL
#endif
#ifdef GS4_NO_HEAT
#define NO_HEAT "GS4_NO_HEAT"
#else
#define NO_HEAT NULL
#endif
#ifdef GS4_NO_IMPLICIT
#define NO_IMPLICIT "GS4_NO_IMPLICIT"
#else
#define NO_IMPLICIT NULL
#endif
#ifdef GS4_NO_FILES
#define NO_FILES "GS4_NO_FILES"
#else
#define NO_FILES NULL
#endif

static int failures;

/* A call is refused with a sentence that names `macro`, or where that is NULL has done its work. */
static void expect(const char *what, const gs4_sim *sim, int result, const char *macro)
{
    const int good = macro ? result == GS4_ERROR_ARGUMENT && strstr(gs4_last_error(sim), macro) != 0
                           : result >= 0;
    if (good) return;
    failures++;
    fprintf(stderr, "%s: %d, %s\n", what, result, gs4_last_error(sim));
}

static gs4_sim *scene(gs4_scheme scheme, int *result)
{
    gs4_sim_desc d;
    gs4_sim *sim = NULL;
    memset(&d, 0, sizeof d);
    d.cells[0] = d.cells[1] = d.cells[2] = 16;
    d.cell_size = (gs4_real)0.01;
    d.gravity.y = (gs4_real)-9.81;
    d.scheme = scheme;
    *result = gs4_create(&d, &sim);
    return sim;
}

static gs4_material material(void)
{
    gs4_material m;
    memset(&m, 0, sizeof m);
    m.density = 1000;
    m.viscosity = 1;
    m.heat_capacity = 2000;
    return m;
}

static int drop(gs4_sim *sim, int of)
{
    const gs4_vec3 centre = { (gs4_real)0.08, (gs4_real)0.05, (gs4_real)0.08 };
    gs4_fill fill;
    memset(&fill, 0, sizeof fill);
    fill.material = of;
    return gs4_add_particles(sim, gs4_sphere(centre, (gs4_real)0.03), &fill);
}

/* One material alone falls, or is refused before it can. */
static void fall(const char *what, const gs4_material *m, const char *macro)
{
    gs4_sim *sim;
    gs4_point point;
    gs4_real L[9] = { 1, 0, 0, 0, -1, 0, 0, 0, 0 }, stress[6];
    int result, of;
    sim = scene(GS4_EXPLICIT, &result);
    of = gs4_add_material(sim, m);
    expect(what, sim, of, macro);
    if (of >= 0) {
        expect(what, sim, drop(sim, of), NULL);
        expect(what, sim, gs4_advance(sim, (gs4_real)0.1), NULL);
    }
    memset(&point, 0, sizeof point);
    point.deformation[0] = point.deformation[4] = point.deformation[8] = 1;
    result = gs4_point_step(m, &point, L, (gs4_real)1e-4, 0, 0);
    expect(what, NULL, result, macro);
    result = gs4_point_stress(m, &point, L, stress);
    expect(what, NULL, result, macro);
    gs4_destroy(sim);
}

static void try_materials(void)
{
    gs4_material m = material();
    fall("Newtonian", &m, NULL);
    m.liquid = GS4_OLDROYD_B;
    m.local_fraction = (gs4_real)0.5;
    m.relaxation_time = (gs4_real)0.1;
    fall("viscoelastic", &m, NO_VISCOELASTIC);
    m = material();
    m.solid = GS4_NEO_HOOKEAN;
    m.shear_modulus = 1e4;
    fall("solid", &m, NO_SOLIDS);
    m = material();
    m.conductivity = 1;
    fall("heat", &m, NO_HEAT);
}

int main(void)
{
    static const char *const path = "left_out.tmp";
    const gs4_scheme schemes[2] = { GS4_PARTITIONED, GS4_SEMI_IMPLICIT };
    gs4_material m = material();
    gs4_sim *sim;
    int i, result;
    for (i = 0; i < 2; i++) {
        gs4_cost cost;
        sim = scene(schemes[i], &result);
        expect("scheme", NULL, result, NO_IMPLICIT);
        gs4_destroy(sim);
        sim = scene(GS4_EXPLICIT, &result);
        gs4_add_material(sim, &m);
        drop(sim, 0);
        expect("estimate", sim, gs4_estimate(sim, schemes[i], GS4_INTEGRATOR_GS4, 0.01, &cost),
               NO_IMPLICIT);
        gs4_destroy(sim);
    }
    try_materials();
    sim = scene(GS4_EXPLICIT, &result);
    expect("create", NULL, result, NULL);
    gs4_add_material(sim, &m);
    drop(sim, 0);
    expect("advance", sim, gs4_advance(sim, (gs4_real)0.1), NULL);
    expect("gs4_write_ply", sim, gs4_write_ply(sim, path), NO_FILES);
    expect("gs4_write_raw", sim, gs4_write_raw(sim, path), NO_FILES);
    expect("gs4_write_surface", sim, gs4_write_surface(sim, path), NO_FILES);
    expect("gs4_save", sim, gs4_save(sim, path), NO_FILES);
    expect("gs4_load", sim, gs4_load(sim, path), NO_FILES);
    remove(path);
    expect("advance", sim, gs4_advance(sim, (gs4_real)0.1), NULL);
    printf("%016llx\n", (unsigned long long)gs4_state_hash(sim));
    gs4_destroy(sim);
    return failures;
}
