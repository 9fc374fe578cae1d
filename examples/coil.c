/* coil.c - a rope of liquid falls on a plate: Newtonian, Oldroyd-B, Pom-Pom; and on a post.
 *     cc -O3 -march=native examples/coil.c -Iexamples -I. -lm -lpthread -o coil
 *     ./coil --row 1          Newtonian; --row 2: Oldroyd-B; --row 3: Pom-Pom; pictures in out/
 *     ./coil --row 4          secondary coiling, semi-implicit: columns of turns rise and fall
 *     ./coil --scheme semi-implicit     rows 1 to 3: no step by viscosity or sound
 *
 * The materials of rows 1 to 3 are those of the GS4 paper (table 4, coiling 1 to 3; figure 2);
 * 61.25 Pa s are local in all three. The scene is that of pour_honey.c, four times as large: the
 * paper names no lengths and no density. Row 1 coils fast and narrowly, and the coils melt into
 * the heap. In rows 2 and 3 the rope is elastic for 12 s (245 Pa) and lies down in wide loops,
 * which stay and stack to a tower. These rows are explicit, where the rope stays whole and smooth.
 * With the semi-implicit scheme that of row 2, four cells thick and less, necks at 1.4 s and is
 * torn at 1.7 s, at over three times the cost. Row 2 takes a minute of processor time.
 *     Row 4 is secondary coiling (section 7.3 there; Habibi et al. 2006): 4 mm, 67.5 Pa s, 1.81 m/s
 * as after a fall of 17 cm, on a slippery post. It lands at 0.05 s and folds to a tower, which has
 * settled to 2 cm at 0.13 s, and coils. The turns stack to a column, 3.7 cm at 0.33 s, which bends
 * and lies down; one on that is 4.5 cm high at 0.66 s and has fallen to 3.2 cm at 0.74 s. What lies
 * slides off the post; a third, 3.6 cm at 0.83 s, goes over the edge with it until 0.89 s.
 *     A rope of speed U and width d turns at a = 0.78 (nu d^2/U)^(1/3) where inertia bends it. The
 * column of turns grows by V = U d/(8 a) and sinks viscously, so it can be sqrt(6 nu V/g) high: 4
 * of its widths here, where U^2/(g d) is 83. So slender a column buckles long before it is so high.
 *     Viscosity would limit explicit steps to h^2/(6 nu) = 6 us; semi-implicit ones are 80 times
 * as long. It takes 4 minutes of processor time. It is chaotic: other builds show other falls. */
#include "example.h"

typedef struct coil_scene { /* lengths in m, speed in m/s, frame time in s */
    double width, below, height, plate_radius, rope_radius, speed, frame_time;
} coil_scene;

static const coil_scene plate = { 0.34, 0.04, 0.28, 0.15, 0.017, 0.23, 1.0 / 24 };
static const coil_scene post = { 0.16 / 3, 0.056 / 3, 0.08, 0.008, 0.002, 1.81, 0.01 };

int main(int argc, char **argv)
{
    const float colours[4][3] = { { 0.93f, 0.60f, 0.10f },
                                  { 0.36f, 0.62f, 0.85f },
                                  { 0.90f, 0.50f, 0.62f },
                                  { 0.95f, 0.66f, 0.22f } };
    const coil_scene *c = &plate;
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_collider foot = { 0 };
    gs4_emitter emitter = { 0 };
    preview_solid things[2] = { { 0 } };
    gs4_sim *sim;
    double thick, mouth;
    float size;
    e.name = "coil";
    e.frames = 96;
    e.cells = 40;
    e.rows = 4;
    e.takes_scheme = 1;
    example_options(&e, argc, argv);
    if (e.row == 4) {
        c = &post;
        e.scheme = GS4_SEMI_IMPLICIT;
    }
    e.frame_time = c->frame_time;
    size = (float)((c == &post ? 0.78 : 1) * c->height / plate.height);
    thick = (c == &post ? 1 : 0.625) * c->below;
    mouth = c == &post ? 0.008 / 3 : 0.024;

    desc.cell_size = real(c->width / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * (c == &post ? 79 : 45) / 40;
    desc.origin = vec(-c->width / 2, -c->below, -c->width / 2);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    if (c == &post) desc.solver_tolerance = real(1e-3);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    sim = example_create(&e, &desc);

    liquid.density = e.row == 4 ? 1400 : 1000;
    liquid.viscosity = real(e.row == 1 ? 61.25 : e.row == 4 ? 67.5 : 3063);
    if (e.scheme)
        liquid.incompressible = 1;
    else
        liquid.sound_speed = e.row == 4 ? 23 : 12; /* ten times what anything here moves at */
    if (e.row == 2 || e.row == 3) {
        liquid.liquid = e.row == 2 ? GS4_OLDROYD_B : GS4_POM_POM;
        liquid.local_fraction = real(0.02);
        liquid.relaxation_time = real(12.25); /* G0 = 245 Pa */
    }
    if (e.row == 3) {
        liquid.stretch_time = real(11.025);
        liquid.anisotropy = 1;
        liquid.arms = 16;
    }
    example_need(sim, gs4_add_material(sim, &liquid));

    foot.shape = gs4_cylinder(vec(0, -thick, 0), vec(0, 0, 0), real(c->plate_radius));
    foot.contact = e.row == 4 ? GS4_WALL_SLIP : GS4_WALL_STICK;
    example_need(sim, gs4_add_collider(sim, &foot));

    emitter.shape =
        gs4_cylinder(vec(0, c->height, 0), vec(0, c->height + mouth, 0), real(c->rope_radius));
    emitter.fill.velocity = vec(0, -c->speed, 0);
    emitter.fill.jitter = real(0.5); /* what is symmetric has no side to fall to */
    example_need(sim, gs4_add_emitter(sim, &emitter));

    things[0].kind = PREVIEW_CYLINDER;
    things[0].a[1] = (float)-thick;
    things[0].radius = (float)c->plate_radius;
    things[0].colour[0] = 0.93f;
    things[0].colour[1] = 0.94f;
    things[0].colour[2] = 0.96f;
    things[1].kind = PREVIEW_FLOOR;
    things[1].a[1] = (float)-thick;
    e.look.solids = things;
    e.look.solid_count = 2;
    e.look.eye[0] = 0.13f * size;
    e.look.eye[1] = 0.30f * size;
    e.look.eye[2] = 0.66f * size;
    e.look.target[1] = c == &post ? 0.027f : 0.113f;
    e.look.width = 480;
    e.look.height = 540;
    e.look.palette = &colours[e.row - 1];
    e.look.palette_count = 1;
    e.look.clarity = e.row == 1 ? 0.025f : 0;
    e.look.radius = 0.29f * (float)desc.cell_size;
    while (example_frame(&e, sim)) {
    }
    gs4_destroy(sim);
    return 0;
}
