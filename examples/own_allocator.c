/* own_allocator.c - all memory comes from your functions, and stepping asks for none.
 *     cc -O3 -march=native examples/own_allocator.c -Iexamples -I. -lm -lpthread -o own_allocator
 *     ./own_allocator                     pictures and particles in out/
 *
 * Prints how often memory was asked for while the scene was made and while it ran, the peak, and
 * what is left at the end: 0. */
#include "example.h"

typedef struct counter {
    size_t live, peak;
    long calls;
} counter;

/* Aligned as asked: aligned_alloc wants a size that is a multiple of the alignment. */
static void *count_alloc(size_t bytes, size_t alignment, void *user)
{
    counter *c = (counter *)user;
    void *p = NULL;
    if (posix_memalign(&p, alignment, bytes ? bytes : 1) != 0) return NULL;
    c->calls++;
    c->live += bytes;
    if (c->live > c->peak) c->peak = c->live;
    return p;
}

static void count_free(void *memory, size_t bytes, void *user)
{
    ((counter *)user)->live -= bytes;
    free(memory);
}

int main(int argc, char **argv)
{
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    gs4_material syrup = { 0 };
    gs4_fill fill = { 0 };
    counter c = { 0, 0, 0 };
    gs4_sim *sim;
    long made;
    e.name = "own_allocator";
    e.frames = 8;
    e.cells = 40;
    example_options(&e, argc, argv);
    desc.cells[0] = desc.cells[1] = desc.cells[2] = e.cells;
    desc.cell_size = real(0.2 / e.cells);
    desc.gravity = vec(0, -9.81, 0);
    desc.allocator.alloc_fn = count_alloc;
    desc.allocator.free_fn = count_free;
    desc.allocator.user = &c;
    sim = example_create(&e, &desc);
    syrup.density = 1300;
    syrup.viscosity = 2;
    fill.material = example_need(sim, gs4_add_material(sim, &syrup));
    example_need(sim, gs4_add_particles(sim, gs4_sphere(vec(0.1, 0.06, 0.1), real(0.05)), &fill));
    made = c.calls;
    while (example_frame(&e, sim)) {
    }
    printf("allocations: %ld to make the scene, %ld while it ran and grew; peak %.1f MB\n", made,
           c.calls - made, (double)c.peak / 1e6);
    made = c.calls;
    for (int i = 0; i < 50; ++i) example_need(sim, gs4_step(sim, real(0.5) * gs4_stable_dt(sim)));
    printf("in 50 more steps: %ld\n", c.calls - made);
    gs4_destroy(sim);
    printf("left at the end: %zu bytes\n", c.live);
    return 0;
}
