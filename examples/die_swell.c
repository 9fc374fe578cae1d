/* die_swell.c - two liquids are pressed out of nozzles of one width: the elastic one swells.
 *     cc -O3 -march=native examples/die_swell.c -Iexamples -I. -lm -lpthread -o die_swell
 *     ./die_swell                         pictures and particles in out/
 *
 * Left Newtonian, right Oldroyd-B of the same viscosity (local fraction 0.1), both at 0.1 m/s
 * and without weight. In a nozzle the elastic liquid is stretched along the flow, and when the
 * wall lets go it draws back: the jet grows thicker than the nozzle, the more so the larger the
 * recoverable shear S = N1/(2 tau) at the wall. Tanner's estimate (1970) is 0.13 + (1 +
 * S^2/2)^(1/6); what came out is printed beside it at the end. */
#include "example.h"

/* of the nozzles, m; through them, m/s */
static const double radius = 0.004, speed = 0.1;
/* of the nozzles, and half way from one to the other, in radii */
enum {
    LENGTH = 6,
    APART = 2
};

/* How far p is from a block with two nozzles bored through it, which end at y = 0; m. */
static gs4_real block_distance(gs4_vec3 p, void *user)
{
    const double x = fabs((double)p.x) - APART * radius,
                 into = radius - sqrt(x * x + (double)p.z * (double)p.z), below = -(double)p.y;
    (void)user;
    return real(into > 0 && below > 0 ? sqrt(into * into + below * below) : fmax(into, below));
}

/* Mean radius of the jet on one side (-1, 1) from one nozzle's radius below the mouth to two,
 * over that of the nozzle. */
static double swell(const gs4_sim *sim, int side, double density)
{
    const gs4_view x = gs4_particles(sim, GS4_FIELD_POSITION),
                   m = gs4_particles(sim, GS4_FIELD_MASS);
    double mass = 0;
    for (int i = 0; i < x.count; ++i) {
        const double y = -(double)x.data[i * x.stride + 1] / radius;
        if (y > 1 && y < 2 && (double)x.data[i * x.stride] * side > 0)
            mass += (double)m.data[i * m.stride];
    }
    return sqrt(mass / (density * 3.14159265358979 * radius)) / radius;
}

int main(int argc, char **argv)
{
    const float colours[2][3] = { { 0.25f, 0.62f, 0.86f }, { 0.93f, 0.47f, 0.24f } };
    /* S at the wall; local part of the viscosity */
    const double shear = 1.8, fraction = 0.1;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid[2] = { { 0 } };
    gs4_collider block = { 0 };
    preview_solid shown[2] = { { 0 } };
    gs4_sim *sim;
    e.name = "die_swell";
    e.frames = 40;
    e.cells = 12;
    e.frame_time = 0.005;
    example_options(&e, argc, argv);

    desc.cell_size = real(2 * radius / e.cells); /* cells across a nozzle */
    desc.cells[0] = e.cells * 4;
    desc.cells[1] = e.cells * (LENGTH + 6) / 2;
    desc.cells[2] = e.cells * 2;
    desc.origin = vec(-4 * radius, -6 * radius, -2 * radius);
    desc.cfl = real(0.8);
    /* adds 3 % to the viscosity: h^2 / (4 flip_decay_time) */
    desc.flip_decay_time = real(0.01);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    block.shape = gs4_sdf(block_distance, NULL, vec(-4 * radius, 0, -2 * radius),
                          vec(4 * radius, LENGTH * radius, 2 * radius));
    block.contact = GS4_WALL_STICK;
    example_need(sim, gs4_add_collider(sim, &block));
    for (int i = 0; i < 2; ++i) {
        const double x = (2 * i - 1) * APART * radius, top = LENGTH * radius,
                     inlet = top - 4 * (double)desc.cell_size;
        gs4_emitter pump = { 0 };
        liquid[i].density = 1000;
        liquid[i].viscosity = real(0.4);
        liquid[i].sound_speed = 6;
        if (i == 1) {
            liquid[i].liquid = GS4_OLDROYD_B;
            liquid[i].local_fraction = real(fraction);
            /* S = (1 - F) lambda 4 U / R */
            liquid[i].relaxation_time = real(shear / (1 - fraction) * radius / (4 * speed));
        }
        pump.fill.material = example_need(sim, gs4_add_material(sim, &liquid[i]));
        pump.fill.velocity = vec(0, -speed, 0);
        pump.fill.jitter = real(0.5); /* no rows that leave one by one */
        example_need(
            sim, gs4_add_particles(sim, gs4_cylinder(vec(x, 0, 0), vec(x, inlet, 0), real(radius)),
                                   &pump.fill));
        pump.shape = gs4_cylinder(vec(x, inlet, 0), vec(x, top, 0), real(radius));
        example_need(sim, gs4_add_emitter(sim, &pump));
        shown[i].kind = PREVIEW_CYLINDER;
        shown[i].a[0] = shown[i].b[0] = (float)x;
        shown[i].a[1] = (float)(0.05 * radius);
        shown[i].b[1] = (float)top;
        shown[i].radius = (float)(1.2 * radius);
        shown[i].colour[0] = 0.72f;
        shown[i].colour[1] = 0.74f;
        shown[i].colour[2] = 0.77f;
    }

    e.colour = EXAMPLE_MATERIAL;
    e.look.solids = shown;
    e.look.solid_count = 2;
    e.look.eye[2] = (float)(16 * radius);
    e.look.target[1] = e.look.eye[1] = (float)(-1 * radius);
    e.look.width = 480;
    e.look.height = 640;
    e.look.palette = colours;
    e.look.palette_count = 2;
    e.look.high = 1;
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    printf("jet over nozzle: Newtonian %.2f (Tanner %.2f), Oldroyd-B %.2f (Tanner %.2f)\n",
           swell(sim, -1, 1000), 1.13, swell(sim, 1, 1000),
           0.13 + pow(1 + shear * shear / 2, 1.0 / 6));
    gs4_destroy(sim);
    return 0;
}
