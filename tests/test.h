/* A test is a function; a check prints its place, its expression and its numbers when it fails.
 *   CHECK(condition)   CHECK_CLOSE(value, expected, tolerance)   CHECK_BETWEEN(value, low, high)
 *   CHECK_RESULT(sim, call, code)
 * Three tiers, each with all of the one before: quick (every change), --full (every merge) and
 * --slow (every night). Within a test test_full and test_slow say which; what it does grows.
 *   RUN(test)        quick, in both precisions
 *   RUN_ONCE(test)   quick in float, where double says the same again: in double with --full
 *   RUN_FULL(test)   with --full       RUN_SLOW(test)   with --slow
 *   RUN_FULL_ONCE(test)   with --full in float, where double says the same again: with --slow
 * Arguments of the program: --full, --slow, --times (seconds of each test), --stop (at the first
 * failure), and a part of a name, which runs the tests that contain it in whatever tier. */
#ifndef TEST_H
#define TEST_H
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static int test_passed, test_failed, test_slow, test_full, test_times, test_stop;
static const char *test_filter = "", *test_name = "";

static void test_report(int good, const char *file, int line, const char *what)
{
    if (good) {
        test_passed++;
        return;
    }
    test_failed++;
    printf("%s:%d: %s: failed: %s\n", file, line, test_name, what);
    fflush(stdout);
    if (test_stop) exit(1);
}

static void test_close(double value, double expected, double tolerance, const char *file, int line,
                       const char *what)
{
    const int good = fabs(value - expected) <= tolerance;
    test_report(good, file, line, what);
    if (!good)
        printf("    %.9g, expected %.9g, differs by %.3g, tolerance %.3g\n", value, expected,
               value - expected, tolerance);
}

static void test_between(double value, double low, double high, const char *file, int line,
                         const char *what)
{
    const int good = value >= low && value <= high;
    test_report(good, file, line, what);
    if (!good) printf("    %.9g, not in %.9g to %.9g\n", value, low, high);
}

#define CHECK(condition) test_report((condition) != 0, __FILE__, __LINE__, #condition)
#define CHECK_CLOSE(value, expected, tolerance)                                              \
    test_close((double)(value), (double)(expected), (double)(tolerance), __FILE__, __LINE__, \
               #value " close to " #expected)
#define CHECK_BETWEEN(value, low, high) \
    test_between((double)(value), (double)(low), (double)(high), __FILE__, __LINE__, #value)
#define CHECK_RESULT(sim, call, code)                                                        \
    do {                                                                                     \
        const int test_r = (call), test_good = (code) == 0 ? test_r >= 0 : test_r == (code); \
        test_report(test_good, __FILE__, __LINE__, #call " gives " #code);                   \
        if (!test_good) printf("    %d: %s\n", test_r, gs4_last_error(sim));                 \
    } while (0)
#define TEST_FULL_ONCE (test_slow || (test_full && sizeof(gs4_real) == 4))
#define RUN(test) test_run(test, #test, 1)
#ifdef GS4_TESTS_QUICK /* for the quick ones alone: the compiler leaves out what nothing calls */
#ifdef GS4_DOUBLE
#define RUN_ONCE(test) ((void)0)
#else
#define RUN_ONCE(test) RUN(test)
#endif
#define RUN_FULL(test) ((void)0)
#define RUN_FULL_ONCE(test) ((void)0)
#define RUN_SLOW(test) ((void)0)
#else
#define RUN_ONCE(test) test_run(test, #test, test_full || sizeof(gs4_real) == 4)
#define RUN_FULL(test) test_run(test, #test, test_full)
#define RUN_FULL_ONCE(test) test_run(test, #test, TEST_FULL_ONCE)
#define RUN_SLOW(test) test_run(test, #test, test_slow)
#endif

static void test_run(void (*test)(void), const char *name, int in_tier)
{
    const clock_t start = clock();
    if (!strstr(name, test_filter) || !(in_tier || test_filter[0])) return;
    test_name = name;
    test();
    if (test_filter[0] || test_times)
        printf("%s: %.2f s\n", name, (double)(clock() - start) / CLOCKS_PER_SEC);
    fflush(stdout);
}

static int test_finish(void)
{
    printf("%d passed, %d failed\n", test_passed, test_failed);
    return test_failed != 0;
}

static void test_arguments(int count, char **values)
{
    int i;
    for (i = 1; i < count; i++) {
        if (strcmp(values[i], "--slow") == 0)
            test_slow = test_full = 1;
        else if (strcmp(values[i], "--full") == 0)
            test_full = 1;
        else if (strcmp(values[i], "--times") == 0)
            test_times = 1;
        else if (strcmp(values[i], "--stop") == 0)
            test_stop = 1;
        else
            test_filter = values[i];
    }
}
#endif
