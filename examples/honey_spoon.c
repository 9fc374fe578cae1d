/* honey_spoon.c - a spoon comes up from a bowl of cold honey, which follows it and runs back.
 *     cc -O3 -march=native examples/honey_spoon.c -Iexamples -I. -lm -lpthread -o honey_spoon
 *     ./honey_spoon                      some minutes; pictures in out/
 *
 * The spoon rises in 0.8 s and tips from 0.3 to 1.2 s. A neck of honey follows it, has grown thin
 * at 0.9 s and sinks back. From 1.4 s on what is in the dish leaves it over the tip; the spoon
 * rises on, the stream grows thin, and from 2.7 s on it folds to and fro on the honey.
 *     The explicit scheme: at 40 Pa s and 6 mm a cell viscosity and sound limit it to 0.25 ms, and
 * a neck that grows thin stays whole for longer. With the semi-implicit scheme it broke to crumbs.
 * Bowl and spoon are sticky meshes. */
#include "example.h"

enum {
    AROUND = 48,
    ALONG = 40,
    BOWL = 0,
    SPOON,
    SHOWN /* the spoon where it is now, for the pictures */
};
static gs4_vec3 vertices[3][ALONG * AROUND];
static int triangles[2][3 * 2 * ALONG * AROUND], triangle_count[2];
static const double bowl_radius = 0.11, bowl_wall = 0.012, turn = 6.283185307 / AROUND;

static void put_triangle(int body, int a, int b, int c)
{
    const int corners[3] = { a, b, c };
    memcpy(triangles[body] + 3 * triangle_count[body]++, corners, sizeof corners);
}

static void join_rings(int body, int ring, int next)
{
    for (int k = 0; k < AROUND; ++k) {
        const int l = (k + 1) % AROUND, here = AROUND * ring, there = AROUND * next;
        put_triangle(body, here + k, there + l, there + k);
        put_triangle(body, here + k, here + l, there + l);
    }
}

/* A deep dish of 7 by 10 cm, then a handle that bends upwards: rings across a curve.
 * The middle of the dish is at `height`, its far end lower by the angle `tip`. */
static void make_spoon(int body, double height, double tip)
{
    const int last = AROUND * (ALONG - 1);
    double y = height - 0.048 * sin(tip), z = -0.048 * cos(tip);
    for (int i = 0; i < ALONG; ++i) {
        const double s = i * 0.0065, dish = s < 0.1 ? sqrt(fmax(0, 1 - pow(s / 0.05 - 1, 2))) : 0;
        const double thick = s < 0.09 ? 0.006 : 0.008, deep = 0.025 * dish * dish;
        const double wide = fmax(0.035 * dish, s < 0.05 ? 0.002 : 0.008);
        const double rise = tip + fmax(0, fmin(1.3, (s - 0.1) * 20));
        y += i ? 0.0065 * sin(rise) : 0;
        z += i ? 0.0065 * cos(rise) : 0;
        for (int k = 0; k < AROUND; ++k) {
            const double x = cos(turn * k), up = thick * sin(turn * k) - deep * (1 - x * x);
            vertices[body][AROUND * i + k] = vec(wide * x, y + up * cos(rise), z - up * sin(rise));
        }
        if (i && body == SPOON) join_rings(SPOON, i - 1, i);
    }
    for (int k = 1; k + 1 < AROUND && body == SPOON; ++k) { /* its ends */
        put_triangle(SPOON, 0, k + 1, k);
        put_triangle(SPOON, last, last + k, last + k + 1);
    }
}

/* Half a shell around the origin: rings on its inside and back on its outside, closed. */
static void make_bowl(void)
{
    for (int i = 0; i < ALONG; ++i) {
        const int half = ALONG / 2, is_inner = i < half;
        const double r = is_inner ? bowl_radius : bowl_radius + bowl_wall;
        const double a = 1.5707963 * (is_inner ? i + 0.02 : ALONG - 1 - i + 0.02) / (half - 0.98);
        for (int k = 0; k < AROUND; ++k)
            vertices[BOWL][AROUND * i + k] =
                vec(r * sin(a) * cos(turn * k), -r * cos(a), r * sin(a) * sin(turn * k));
        join_rings(BOWL, i, (i + 1) % ALONG);
    }
}

static gs4_real honey(gs4_vec3 p, void *user)
{
    (void)user;
    return real(
        fmax(sqrt((double)(p.x * p.x + p.y * p.y + p.z * p.z)) - bowl_radius, (double)p.y + 0.02));
}

int main(int argc, char **argv)
{
    const gs4_vec3 low = vec(-0.13, -0.13, -0.13), high = vec(0.13, 0, 0.13);
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material liquid = { 0 };
    gs4_collider body = { 0 };
    gs4_fill fill = { 0 };
    gs4_pose pose = { 0 };
    preview_solid things[3] = { { 0 } };
    gs4_sim *sim;
    e.name = "honey_spoon";
    e.frames = 66;
    e.cells = 48;
    e.frame_time = 1.0 / 20;
    example_options(&e, argc, argv);

    desc.cell_size = real(0.28 / e.cells);
    desc.cells[0] = desc.cells[2] = e.cells;
    desc.cells[1] = e.cells * 5 / 4;
    desc.origin = vec(-0.14, -0.13, -0.14);
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.8);
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_OPEN;
    sim = example_create(&e, &desc);
    liquid.density = 1400;
    liquid.viscosity = 40;
    liquid.sound_speed = 10;
    example_need(sim, gs4_add_material(sim, &liquid));
    make_bowl();
    make_spoon(SPOON, 0, 0);
    for (int i = 0; i < 2; ++i) {
        body.contact = GS4_WALL_STICK;
        body.shape = gs4_mesh(&vertices[i][0].x, ALONG * AROUND, triangles[i], triangle_count[i]);
        example_need(sim, gs4_add_collider(sim, &body)); /* its id is i */
        things[i].kind = PREVIEW_MESH;
        things[i].vertices = &vertices[i ? SHOWN : BOWL][0].x;
        things[i].vertex_count = ALONG * AROUND;
        things[i].triangles = triangles[i];
        things[i].triangle_count = triangle_count[i];
    }
    pose.position.y = real(-0.055);
    example_need(sim, gs4_put_collider(sim, SPOON, &pose));
    example_need(sim, gs4_add_particles(sim, gs4_sdf(honey, NULL, low, high), &fill));
    things[2].kind = PREVIEW_FLOOR;
    things[2].a[1] = -(float)(bowl_radius + bowl_wall);
    e.look.solids = things;
    e.look.solid_count = 3;
    e.look.eye[0] = 0.55f;
    e.look.eye[1] = 0.34f;
    e.look.eye[2] = -0.22f;
    e.look.target[1] = 0.02f;
    e.look.width = 480;
    e.look.height = 540;
    e.look.clarity = 0.012f;
    do { /* where it is at the end of a frame */
        const double t = (e.frame + 1) * e.frame_time, tip = 1.5 * fmax(0, fmin(0.9, t - 0.3));
        pose.position.y = real(-0.055 + 0.194 * fmin(t, 0.8) + 0.04 * fmax(0, fmin(1.5, t - 1.5)));
        pose.quaternion[0] = real(cos(tip / 2));
        pose.quaternion[1] = real(-sin(tip / 2));
        example_need(sim, gs4_move_collider_to(sim, SPOON, &pose, real(e.frame_time)));
        make_spoon(SHOWN, (double)pose.position.y, tip);
    } while (example_frame(&e, sim));
    gs4_destroy(sim);
    return 0;
}
