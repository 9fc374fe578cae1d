/* What an update of the stress costs and how accurate it is, at one material point: rule 1, and
 * the exponential method that takes what rule 1 does not resolve, for start-up of shear of a
 * Pom-Pom liquid (SuD of tests/xpp_reference.h: r 1.11, Q 16, alpha 0.01) up to a strain of 3 or 3
 * relaxation times, whichever comes first. Error: of the largest component of stress, against the
 * exponential method with a 16 times smaller step than the smallest here. The cost is of one
 * particle in a full batch of rule 1, of one by one in the exponential method. In double.
 *   cc -O3 -march=native bench/stress.c -I. -lm -o stress && ./stress    CSV on standard output */
#define _POSIX_C_SOURCE 200112L
#define GS4_DOUBLE
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"

#define NTH(lanes, n) (((gs4_real *)(lanes))[n]) /* of particle n of a batch */
enum {
    RULE,
    EXPONENTIAL,
    INTEGRATORS,
    FINEST = 4096
};
typedef struct setting {
    gs4i_material_constants law;
    gs4i_batch_constants laws;
    gs4i_elastic_constants elastic_laws;
    gs4i_gradient L;
    gs4i_split split;
    double gradient;
} setting;

/* lambda_b = 1, G0 = 1 */
static void set_up(setting *s, double Wi)
{
    int n;
    memset(s, 0, sizeof *s);
    s->law.is = scene_liquid(1000, 1, 10);
    s->law.is.liquid = GS4_POM_POM;
    s->law.is.relaxation_time = 1;
    s->law.is.stretch_time = 1 / 1.11109095526612;
    s->law.is.arms = 16;
    s->law.is.anisotropy = 0.01;
    gs4i_set_material_constants(&s->law, 0);
    for (n = 0; n < GS4I_BATCH; n++) {
        s->laws.of[n] = &s->law;
        NTH(s->L[0][1], n) = Wi;
    }
    gs4i_load_elastic_constants(&s->laws, &s->elastic_laws);
    s->split.inv_lambda = 1;
    s->split.stretch = 2 * 1.11109095526612;
    s->split.nu = 2.0 / 16;
    s->split.alpha = 0.01;
    s->split.patience = GS4I_PATIENCE;
    s->split.L[0][1] = Wi;
}

/* Stress after `steps` steps; updates that rule 1 handed on in *split; seconds of it all. */
static double run(setting *s, int integrator, double time, int steps, double stress[6], int *split)
{
    const double dt = time / steps, start = bench_now(NULL);
    double S[6] = { 0, 0, 0, 0, 0, 0 }, seconds;
    gs4i_elastic e;
    gs4i_elastic_count count = { 0, 0, 0 };
    int i;
    memset(&e, 0, sizeof e);
    for (i = 0; i < steps; i++) {
        gs4i_integrator rule = { 0 };
        if (integrator == RULE) {
            gs4i_family(&rule, 0, 0, i == 0);
            rule.dt = dt;
            rule.restart = i == 0;
            gs4i_correct_elastic(&s->elastic_laws, &e, &rule, s->L, GS4I_BATCH, &count);
        } else {
            s->split.work = 0;
            gs4i_split_advance(&s->split, S, dt);
        }
    }
    seconds = bench_now(NULL) - start;
    for (i = 0; i < 6; i++) stress[i] = integrator == RULE ? NTH(e.s[i], 0) : S[i];
    *split = count.split;
    return integrator == RULE ? seconds / GS4I_BATCH : seconds;
}

static double distance(const double a[6], const double exact[6])
{
    double difference = 0, size = 0;
    int i;
    for (i = 0; i < 6; i++) {
        difference = fmax(difference, fabs(a[i] - exact[i]));
        size = fmax(size, fabs(exact[i]));
    }
    return difference / size;
}

int main(void)
{
    static const char *const names[INTEGRATORS] = { "gs4", "exponential" };
    static const double rates[5] = { 0.01, 1, 10, 100, 1000 };
    int k, integrator, steps, i, repeats, handed;
    bench_machine(stdout);
    puts("integrator,Wi,steps,steps_per_relaxation_time,strain_per_step,error,ns_per_step,share_"
         "handed_on");
    for (k = 0; k < 5; k++) {
        const double Wi = rates[k], time = fmin(3, 3 / Wi);
        double exact[6], stress[6];
        setting s;
        set_up(&s, Wi);
        run(&s, EXPONENTIAL, time, 16 * FINEST, exact, &handed);
        for (integrator = 0; integrator < INTEGRATORS; integrator++)
            for (steps = 4; steps <= FINEST; steps *= 4) {
                double seconds[5];
                repeats = 1 + 4096 / steps;
                for (i = 0; i < 5; i++) {
                    int j;
                    seconds[i] = 0;
                    for (j = 0; j < repeats; j++)
                        seconds[i] += run(&s, integrator, time, steps, stress, &handed);
                }
                printf("%s,%g,%d,%.4g,%.3g,%.2g,%.0f,%.2g\n", names[integrator], Wi, steps,
                       steps / time, time * Wi / steps, distance(stress, exact),
                       1e9 * bench_median(seconds, 5) / repeats / steps,
                       (double)handed / steps / GS4I_BATCH);
                fflush(stdout);
            }
    }
    return 0;
}
