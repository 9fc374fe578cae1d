/* A test is a function; a check prints its place, its expression and its numbers when it fails.
 *   CHECK(condition)   CHECK_CLOSE(value, expected, tolerance)   CHECK_RESULT(sim, call, code)
 *   RUN(test)   RUN_ONCE(test)
 * Arguments of the program: a part of a name runs the tests that contain it; --slow adds the
 * long ones, --full those of a minute. */
#ifndef TEST_H
#define TEST_H
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static int test_passed, test_failed, test_slow, test_full;
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

#define CHECK(condition) test_report((condition) != 0, __FILE__, __LINE__, #condition)
#define CHECK_CLOSE(value, expected, tolerance)                                              \
    test_close((double)(value), (double)(expected), (double)(tolerance), __FILE__, __LINE__, \
               #value " close to " #expected)
#define CHECK_RESULT(sim, call, code)                                                        \
    do {                                                                                     \
        const int test_r = (call), test_good = (code) == 0 ? test_r >= 0 : test_r == (code); \
        test_report(test_good, __FILE__, __LINE__, #call " gives " #code);                   \
        if (!test_good) printf("    %d: %s\n", test_r, gs4_last_error(sim));                 \
    } while (0)
#define RUN(test)                                                                    \
    do {                                                                             \
        test_name = #test;                                                           \
        if (strstr(test_name, test_filter)) {                                        \
            const clock_t test_start = clock();                                      \
            if (test_filter[0]) {                                                    \
                printf("%s: ", test_name);                                           \
                fflush(stdout);                                                      \
            }                                                                        \
            test();                                                                  \
            if (test_filter[0])                                                      \
                printf("%.1f s\n", (double)(clock() - test_start) / CLOCKS_PER_SEC); \
        }                                                                            \
    } while (0)

/* In float only where tests are quick: what double would say again. */
#define RUN_ONCE(test)                                     \
    do {                                                   \
        if (test_slow || sizeof(gs4_real) == 4) RUN(test); \
    } while (0)

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
            test_slow = 1;
        else if (strcmp(values[i], "--full") == 0)
            test_full = 1;
        else
            test_filter = values[i];
    }
}
#endif
