/* How far each parameter may go. Small scenes with a known answer, each judged by one number; one
 * parameter at a time leaves a normal value by decades, up to twelve each way, and the ends of the
 * range around it where the answer is right are bisected to a tenth of a decade. Then pairs.
 *   cc -O3 -march=native bench/extremes.c -I. -lm -o extremes        (-DGS4_DOUBLE for double)
 *   ./extremes [word of a line, as "heat" or "semi-implicit"]        CSV on standard output
 * Signs: . right   ~ it ran, the error is above the bound   - refused with a sentence, state kept
 *        $ more steps than the bench takes   ! not finite, state of a refused step lost, or slow
 * The map of a line has decades -12, -9, -6, -4 to 4, 6, 9, 12, the normal value between bars. */
#define _POSIX_C_SOURCE 200112L
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#include "bench.h"
#include <math.h>
#include "extremes.h"

/* Decades that one parameter goes each way, and in a pair. */
enum {
    STOPS = 7,
    PAIR = 3 /* twice that, by twos */
};
static const int decades[STOPS + 1] = { 0, 1, 2, 3, 4, 6, 9, 12 };
static const char *wanted = "";

static outcome at_decade(job j, parameter p, double decade)
{
    j.factor[p] = pow(10, decade);
    return run(&j);
}

/* The last decade that is right, and what is beyond it. */
static double edge(const job *j, parameter p, const outcome *map, int side, outcome *beyond)
{
    double right, wrong;
    int i = 0;
    while (i < STOPS && map[STOPS + side * (i + 1)].sign == '.') i++;
    if (i == STOPS) return side * decades[STOPS];
    *beyond = map[STOPS + side * (i + 1)];
    right = decades[i];
    wrong = decades[i + 1];
    while (wrong - right > 0.1) {
        const double middle = 0.5 * (right + wrong);
        const outcome o = at_decade(*j, p, side * middle);
        if (o.sign == '.')
            right = middle;
        else {
            wrong = middle;
            *beyond = o;
        }
    }
    return side * right;
}

static void print_side(const job *j, parameter p, const outcome *map, int side)
{
    outcome beyond;
    double decade;
    memset(&beyond, 0, sizeof beyond);
    if (map[STOPS].sign != '.') beyond = map[STOPS];
    decade = map[STOPS].sign == '.' ? edge(j, p, map, side, &beyond) : 0;
    printf(",%.2g", normal(j, p) * pow(10, decade));
    if (!beyond.sign) printf(",nothing to 1e%+d,", side * decades[STOPS]);
    if (beyond.sign == '~') printf(",degraded,error %.2g", beyond.error);
    if (beyond.sign == '-') printf(",refused,\"%s\"", beyond.why);
    if (beyond.sign == '$') printf(",steps,\"%s\"", beyond.why);
    if (beyond.sign == '!') printf(",WRONG,\"%s\"", beyond.why);
}

static void line(const job *j, parameter p)
{
    outcome map[2 * STOPS + 1];
    char signs[2 * STOPS + 4], name[128];
    int i, n = 0, wrong = -1;
    sprintf(name, "%s,%s,%s", scenes[j->scene].name, variants[j->variant].name, parameters[p].name);
    if (!strstr(name, wanted)) return;
    for (i = 0; i <= 2 * STOPS; i++) {
        map[i] = at_decade(*j, p, i < STOPS ? -decades[STOPS - i] : decades[i - STOPS]);
        if (i == STOPS) signs[n++] = '|';
        signs[n++] = map[i].sign;
        if (i == STOPS) signs[n++] = '|';
        if (map[i].sign == '!') wrong = i;
    }
    signs[n] = 0;
    printf("%s,%.2g,%.2g", name, normal(j, p), map[STOPS].error);
    print_side(j, p, map, -1);
    print_side(j, p, map, 1);
    printf(",%s\n", signs);
    if (wrong >= 0) printf("# WRONG at sign %d: %s\n", wrong + 1, map[wrong].why);
    fflush(stdout);
}

static void pair(const job *j, parameter p, parameter q)
{
    char name[128];
    int a, b;
    sprintf(name, "%s,%s,%s and %s", scenes[j->scene].name, variants[j->variant].name,
            parameters[p].name, parameters[q].name);
    if (!strstr(name, wanted)) return;
    printf("# %s: decades -6, -4 to 6 of the first to the right, of the second upwards\n", name);
    for (b = PAIR; b >= -PAIR; b--) {
        char signs[2 * PAIR + 2] = { 0 };
        for (a = -PAIR; a <= PAIR; a++) {
            job k = *j;
            k.factor[q] = pow(10, 2 * b);
            signs[a + PAIR] = at_decade(k, p, 2 * a).sign;
        }
        printf("# %+3d  %s\n", 2 * b, signs);
        fflush(stdout);
    }
}

/* Backward Euler for what it may change. */
static int is_in_report(int s, int v, int p)
{
    const int euler = v == PROJECTION_EULER || v == ONE_SOLVE_EULER,
              changed = p == DT || p == VISCOSITY || p == SHEAR || p == TIME;
    return scenes[s].variants >> v & 1 && scenes[s].parameters >> p & 1 && (!euler || changed);
}

int main(int count, char **values)
{
    const double start = bench_now(NULL);
    int s, v, p, i;
    if (count > 1) wanted = values[1];
    bench_machine(stdout);
    printf("# bytes of gs4_real %d\n", (int)sizeof(gs4_real));
    puts("scene,scheme,parameter,normal,error there,low,below,why,high,above,why,map");
    for (s = 0; s < SCENES; s++)
        for (v = 0; v < VARIANTS; v++)
            for (p = 0; p < PARAMETERS; p++)
                if (is_in_report(s, v, p)) {
                    const job j = usual(s, v);
                    line(&j, (parameter)p);
                }
    for (i = 0; i < PAIRS; i++) {
        const job j = usual(pairs[i].scene, pairs[i].variant);
        pair(&j, pairs[i].p, pairs[i].q);
    }
    printf("# %d runs, %.0f s\n", runs, bench_now(NULL) - start);
    return 0;
}
