/* realtime.c - sixty frames a second: a budget of computing for each, and what was given up for it.
 *     cc -O3 -march=native examples/realtime.c -Iexamples -I. -lm -lpthread -o realtime
 *     ./realtime                          ten seconds; a picture of the last frame in out/
 *     ./realtime --budget 4 --scheme explicit
 *
 * Balls of water fall into a basin, four a second. A frame owes the water what has passed on the
 * clock since the last, and has 12 ms of computing for that (--budget); what does not fit waits for
 * the next. First balls are given up: each makes all later frames dearer, so none falls while
 * frames take more than 0.8 of the budget or time waits. Then time: what waits beyond a tenth of a
 * second is dropped, so that the water goes slower than the clock. Each second of the clock has a
 * line: what was simulated, was dropped and waits more than before make up that second. A step that
 * has begun is not cut off, so a frame may exceed its budget by one.
 * The partitioned scheme: one or two steps a frame. Explicit ones, with symplectic Euler, are
 * twenty here, each much shorter, so that they exceed the budget by less. */
#include "example.h"

static const double tick = 1.0 / 60, most_due = 0.1; /* s */

typedef struct record { /* of a second of the clock; times in s */
    double busy, worst, simulated, dropped;
    int ticks, frames, kept, balls, no_balls;
} record;

/* Takes `--budget MS` out of the options; s. */
static double take_budget(int *argc, char **argv)
{
    double ms = 12;
    for (int i = 1; i + 1 < *argc; ++i)
        if (!strcmp(argv[i], "--budget")) {
            ms = strtod(argv[i + 1], NULL);
            for (*argc -= 2; i < *argc; ++i) argv[i] = argv[i + 2];
        }
    return 1e-3 * ms;
}

static void print_record(const record *r, double due, int particles)
{
    printf("%5.2f s %5d of %3d %7.2f %6.2f %7.2f s %6.2f s %5.0f ms %5d of %2d %8d\n",
           r->ticks * tick, r->kept, r->ticks, 1e3 * r->busy / r->frames, 1e3 * r->worst,
           r->simulated, r->dropped, 1e3 * due, r->no_balls, r->balls + r->no_balls, particles);
}

/* A ball of water above the basin; 0 where it has no room. */
static int drop_ball(gs4_sim *sim, int tick_number)
{
    const gs4_vec3 at =
        vec(0.3 + 0.2 * sin(tick_number * 0.11), 0.34, 0.15 + 0.05 * cos(tick_number * 0.17));
    gs4_fill fill = { 0 };
    fill.velocity = vec(0, -1, 0);
    return gs4_add_particles(sim, gs4_sphere(at, real(0.05)), &fill) > 0;
}

/* Waits for the next tick after `start`, as for a display; the number of that tick. */
static int wait_for_tick(double start)
{
    const int n = 1 + (int)((example_clock(NULL) - start) / tick);
    for (double left; (left = start + n * tick - example_clock(NULL)) > 0;) {
        const struct timespec t = { 0, (long)(1e9 * left) };
        nanosleep(&t, NULL);
    }
    return n;
}

int main(int argc, char **argv)
{
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material water = { 0 };
    gs4_fill fill = { 0 };
    gs4_budget budget = { 0 };
    preview_solid room = { PREVIEW_ROOM, { 0 }, { 0.6f, 0.15f, 0.3f }, 0, { 0 }, 0, 0, 0, 0 };
    gs4_sim *sim;
    record second = { 0 };
    double due = 0, load = 0, simulated = 0, dropped = 0, begin, last;
    int n = 0, next_ball = 15;
    e.name = "realtime";
    e.frames = 600;
    e.cells = 24;
    e.takes_scheme = 1;
    e.scheme = GS4_PARTITIONED;
    budget.seconds = take_budget(&argc, argv);
    example_options(&e, argc, argv);
    if (!(budget.seconds > 0 && budget.seconds < 1))
        example_misuse(&e, "--budget takes milliseconds, below 1000", "");

    desc.cell_size = real(0.6 / e.cells);
    desc.cells[0] = e.cells;
    desc.cells[1] = e.cells * 2 / 3;
    desc.cells[2] = e.cells / 2;
    desc.gravity = vec(0, -9.81, 0);
    desc.cfl = real(0.9);
    if (e.scheme == GS4_EXPLICIT) desc.integrator = GS4_INTEGRATOR_SYMPLECTIC_EULER;
    for (int i = 0; i < 6; ++i) desc.walls[i] = GS4_WALL_SLIP;
    sim = example_create(&e, &desc);
    water.density = 1000;
    water.incompressible = e.scheme != GS4_EXPLICIT;
    water.sound_speed = real(e.scheme == GS4_EXPLICIT ? 12 : 0); /* the water goes at up to 3 */
    example_need(sim, gs4_add_material(sim, &water));
    example_need(sim, gs4_add_particles(sim, gs4_box(vec(0, 0, 0), vec(0.6, 0.05, 0.3)), &fill));

    puts("  clock  frames kept  ms: mean  worst  simulated  dropped  waits  balls left out  "
         "particles");
    last = (begin = example_clock(NULL)) - tick;
    while (e.frame++ < e.frames) {
        const double start = example_clock(NULL);
        const int before = n;
        double done, took;
        due += start - last;
        last = start;
        second.dropped += fmax(0, due - most_due);
        due = fmin(due, most_due);
        if (n >= next_ball) {
            const int falls = load < 0.8 && due < 1.5 * tick && drop_ball(sim, n);
            second.balls += falls;
            second.no_balls += !falls;
            next_ball += 15;
        }
        example_need(sim, gs4_advance_within(sim, real(due), &budget, &done));
        due = fmax(0, due - done);
        took = example_clock(NULL) - start;
        load = 0.9 * load + 0.1 * took / budget.seconds;
        second.busy += took;
        second.worst = fmax(second.worst, took);
        second.simulated += done;
        ++second.frames;
        /* here a program draws what gs4_particles(sim, GS4_FIELD_POSITION) has */
        n = wait_for_tick(begin);
        second.ticks += n - before;
        second.kept += n == before + 1;
        if (n / 60 > before / 60 || e.frame == e.frames) {
            print_record(&second, due, gs4_particles(sim, GS4_FIELD_POSITION).count);
            simulated += second.simulated;
            dropped += second.dropped;
            memset(&second, 0, sizeof second);
        }
    }
    printf("%.2f s of the clock: %.2f s simulated, %.2f s dropped\n", n * tick, simulated, dropped);
    e.frame = e.frames;
    e.look.solids = &room;
    e.look.solid_count = 1;
    e.look.eye[0] = 0.9f;
    e.look.eye[1] = 0.45f;
    e.look.eye[2] = 1.0f;
    e.look.target[0] = 0.28f;
    e.look.palette = preview_speed;
    e.colour = EXAMPLE_SPEED;
    example_write(&e, sim);
    gs4_destroy(sim);
    return 0;
}
