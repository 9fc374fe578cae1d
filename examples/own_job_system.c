/* own_job_system.c - the library runs its tasks on your threads, not on its own.
 *     cc -O3 -march=native examples/own_job_system.c -Iexamples -I. -lm -lpthread -o own_job_system
 *     ./own_job_system --threads 2        pictures and particles in out/
 *
 * The hook is one blocking call: run `count` tasks, in any order, on any threads, then return.
 * At the end the same scene runs without the hook and the two states are compared: they are the
 * same bits. */
#include "example.h"
#include <pthread.h>

enum {
    WORKERS_MAX = 64
};

/* A job system of the smallest kind: each call starts its threads, which take the next index
 * until none is left. */
typedef struct jobs {
    pthread_mutex_t lock;
    int next, count, workers;
    gs4_task_fn task;
    void *context;
} jobs;

static void *worker(void *argument)
{
    jobs *j = (jobs *)argument;
    for (;;) {
        int i;
        pthread_mutex_lock(&j->lock);
        i = j->next++;
        pthread_mutex_unlock(&j->lock);
        if (i >= j->count) return NULL;
        j->task(i, j->context);
    }
}

static void run_jobs(int count, gs4_task_fn task, void *context, void *user)
{
    jobs *j = (jobs *)user;
    pthread_t threads[WORKERS_MAX];
    int i, started = 0;
    j->next = 0;
    j->count = count;
    j->task = task;
    j->context = context;
    for (i = 1; i < j->workers && i < count; i++)
        started += pthread_create(&threads[started], NULL, worker, j) == 0;
    worker(j); /* the calling thread works, too */
    for (i = 0; i < started; i++) pthread_join(threads[i], NULL);
}

static gs4_sim *scene(const example *e, gs4_sim_desc desc)
{
    gs4_sim *sim = example_create(e, &desc);
    gs4_material syrup = { 0 };
    gs4_fill fill = { 0 };
    syrup.density = 1300;
    syrup.viscosity = 2;
    fill.material = example_need(sim, gs4_add_material(sim, &syrup));
    example_need(sim, gs4_add_particles(sim, gs4_sphere(vec(0.1, 0.12, 0.1), real(0.05)), &fill));
    return sim;
}

int main(int argc, char **argv)
{
    example e = { 0 };
    gs4_sim_desc desc = { 0 };
    jobs j;
    gs4_sim *hooked, *plain;
    uint64_t hash;
    e.name = "own_job_system";
    e.frames = 8;
    e.cells = 40;
    example_options(&e, argc, argv);
    desc.cells[0] = desc.cells[1] = desc.cells[2] = e.cells;
    desc.cell_size = real(0.2 / e.cells);
    desc.gravity = vec(0, -9.81, 0);
    pthread_mutex_init(&j.lock, NULL);
    j.workers = e.threads < WORKERS_MAX ? e.threads : WORKERS_MAX;
    desc.parallel_for = run_jobs;
    desc.parallel_user = &j;
    hooked = scene(&e, desc);
    while (example_frame(&e, hooked)) {
    }
    hash = gs4_state_hash(hooked);
    gs4_destroy(hooked);
    desc.parallel_for = NULL;
    desc.parallel_user = NULL;
    plain = scene(&e, desc);
    for (int i = 0; i < e.frames; ++i) example_need(plain, gs4_advance(plain, real(1.0 / 30)));
    printf("state with the hook %016llx, without %016llx: %s\n", (unsigned long long)hash,
           (unsigned long long)gs4_state_hash(plain),
           hash == gs4_state_hash(plain) ? "the same" : "DIFFERENT");
    gs4_destroy(plain);
    pthread_mutex_destroy(&j.lock);
    return 0;
}
