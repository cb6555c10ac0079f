/* A host of FMI 2.0 and 3.0 that owes nothing to FMPy or thermid: loads a library by dlopen and runs it.
 *
 *   fmu_host LIBRARY VERSION cs|me TOKEN RESOURCES END STEP OUTPUTS [REF=VALUE ...]
 *
 * OUTPUTS are value references with commas. Prints the outputs at every step; for `me` it integrates by the classical Runge-Kutta method
 * with equal steps, which end at time events and, by bisection, where an event indicator changes its sign. An argument REF~VALUE makes an input swing by VALUE from step to step. The last line is the
 * mean time of a step in nanoseconds. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef int (*Call)();
static void *library, *model;
static int third;

static void *find(const char *name) {
    char full[80];
    snprintf(full, sizeof full, "fmi%d%s", third ? 3 : 2, name);
    void *found = dlsym(library, full);
    if (!found) { fprintf(stderr, "%s is missing\n", full); exit(3); }
    return found;
}
static void check(int status, const char *what) {
    if (status != 0) { fprintf(stderr, "%s: status %d\n", what, status); exit(4); }
}
static void say2(void *e, const char *n, int status, const char *category, const char *message, ...) {
    va_list more;
    va_start(more, message);
    vfprintf(stderr, message, more);
    va_end(more);
    (void)e; (void)n; (void)status; (void)category;
}
static void say3(void *e, int status, const char *category, const char *message) {
    fprintf(stderr, "%s\n", message);
    (void)e; (void)status; (void)category;
}
struct callbacks { void (*log)(void *, const char *, int, const char *, const char *, ...); void *(*allocate)(size_t, size_t); void (*release)(void *); void *finished, *environment; };
struct info { int again, end, nominals, values, defined; double next; };

static unsigned refs[64];
static int outputs;
static void put(unsigned ref, double value) {
    if (third) check(((int (*)(void *, const unsigned *, size_t, const double *, size_t))find("SetFloat64"))(model, &ref, 1, &value, 1), "set");
    else check(((int (*)(void *, const unsigned *, size_t, const double *))find("SetReal"))(model, &ref, 1, &value), "set");
}
static void show(double t) {
    double v[64];
    if (third) check(((int (*)(void *, const unsigned *, size_t, double *, size_t))find("GetFloat64"))(model, refs, outputs, v, outputs), "get");
    else check(((int (*)(void *, const unsigned *, size_t, double *))find("GetReal"))(model, refs, outputs, v), "get");
    printf("%.17g", t);
    for (int k = 0; k < outputs; ++k) printf(" %.17g", v[k]);
    printf("\n");
}
static double discrete(void) { /* until nothing changes; returns the next time event */
    double next = 1e300;
    for (bool again = true; again;) {
        if (third) {
            bool end, nominals, values, defined;
            check(((int (*)(void *, bool *, bool *, bool *, bool *, bool *, double *))find("UpdateDiscreteStates"))(model, &again, &end, &nominals, &values, &defined, &next), "update");
            if (!defined) next = 1e300;
        } else {
            struct info i;
            check(((int (*)(void *, struct info *))find("NewDiscreteStates"))(model, &i), "update");
            again = i.again;
            next = i.defined ? i.next : 1e300;
        }
    }
    check(((int (*)(void *))find("EnterContinuousTimeMode"))(model), "continuous");
    return next;
}
static int (*set_time)(void *, double), (*set_states)(void *, const double *, size_t), (*rates)(void *, double *, size_t);
static void slope(double t, const double *x, size_t n, double *to) {
    check(set_time(model, t), "time");
    check(set_states(model, x, n), "states");
    check(rates(model, to, n), "rates");
}

/* One step of the classical Runge-Kutta method, from x to z. */
static void advance(double t, double h, const double *x, double *z, size_t n) {
    double y[512], k1[512], k2[512], k3[512], k4[512];
    slope(t, x, n, k1);
    for (size_t k = 0; k < n; ++k) y[k] = x[k] + 0.5 * h * k1[k];
    slope(t + 0.5 * h, y, n, k2);
    for (size_t k = 0; k < n; ++k) y[k] = x[k] + 0.5 * h * k2[k];
    slope(t + 0.5 * h, y, n, k3);
    for (size_t k = 0; k < n; ++k) y[k] = x[k] + h * k3[k];
    slope(t + h, y, n, k4);
    for (size_t k = 0; k < n; ++k) z[k] = x[k] + h / 6.0 * (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]);
    check(set_time(model, t + h), "time");
    check(set_states(model, z, n), "states");
}
static size_t guards;
static void indicate(double *to) {
    if (guards) check(((int (*)(void *, double *, size_t))find("GetEventIndicators"))(model, to, guards), "indicators");
}
static bool passed(const double *before, const double *after) {
    for (size_t k = 0; k < guards; ++k)
        if ((before[k] < 0.0) != (after[k] < 0.0)) return true;
    return false;
}
/* Steps to `stop`, or to just behind the first change of sign of an indicator before it; returns the time reached, and whether there was one. */
static double reach(double t, double stop, const double *x, double *z, size_t n, bool *event) {
    double before[64], after[64];
    check(set_time(model, t), "time");
    check(set_states(model, x, n), "states");
    indicate(before);
    advance(t, stop - t, x, z, n);
    indicate(after);
    *event = passed(before, after);
    if (!*event) return stop;
    double low = t, high = stop;
    for (int k = 0; k < 200 && high - low > 1e-9; ++k) {
        const double middle = 0.5 * (low + high);
        advance(t, middle - t, x, z, n);
        indicate(after);
        if (passed(before, after)) high = middle;
        else low = middle;
    }
    advance(t, high - t, x, z, n);
    return high;
}

int main(int argc, char **argv) {
    if (argc < 9) return 2;
    third = !strcmp(argv[2], "3.0");
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) { fprintf(stderr, "%s\n", dlerror()); return 3; }
    const int exchange = !strcmp(argv[3], "me");
    const double end = atof(argv[6]), length = atof(argv[7]);
    for (char *at = strtok(argv[8], ","); at && outputs < 64; at = strtok(NULL, ",")) refs[outputs++] = (unsigned)atoi(at);
    static struct callbacks own = {say2, calloc, free, NULL, NULL};
    if (!third) model = ((void *(*)(const char *, int, const char *, const char *, const struct callbacks *, int, int))find("Instantiate"))("host", exchange ? 0 : 1, argv[4], argv[5], &own, 0, 0);
    else if (exchange) model = ((void *(*)(const char *, const char *, const char *, bool, bool, void *, void (*)(void *, int, const char *, const char *)))find("InstantiateModelExchange"))("host", argv[4], argv[5], false, false, NULL, say3);
    else model = ((void *(*)(const char *, const char *, const char *, bool, bool, bool, bool, const unsigned *, size_t, void *, void (*)(void *, int, const char *, const char *), void *))find("InstantiateCoSimulation"))("host", argv[4], argv[5], false, false, false, false, NULL, 0, NULL, say3, NULL);
    if (!model) return 5;
    unsigned swings = 0;
    double swing = 0.0, level = 0.0;
    for (int k = 9; k < argc; ++k) {
        char *rest;
        const unsigned ref = (unsigned)strtoul(argv[k], &rest, 10);
        if (*rest == '~') { swings = ref; sscanf(rest + 1, "%lf:%lf", &level, &swing); }
        else put(ref, atof(rest + 1));
    }
    const char *tolerance = getenv("FMU_TOLERANCE");
    const double told = tolerance ? atof(tolerance) : 0.0;
    if (third) check(((int (*)(void *, bool, double, double, bool, double))find("EnterInitializationMode"))(model, told > 0.0, told, 0.0, true, end), "begin");
    else {
        check(((int (*)(void *, int, double, double, int, double))find("SetupExperiment"))(model, told > 0.0, told, 0.0, 1, end), "setup");
        check(((int (*)(void *))find("EnterInitializationMode"))(model), "begin");
    }
    check(((int (*)(void *))find("ExitInitializationMode"))(model), "start");
    set_time = (int (*)(void *, double))find("SetTime");
    set_states = (int (*)(void *, const double *, size_t))find("SetContinuousStates");
    rates = (int (*)(void *, double *, size_t))find(third ? "GetContinuousStateDerivatives" : "GetDerivatives");
    int (*step3)(void *, double, double, bool, bool *, bool *, bool *, double *) = third ? (int (*)(void *, double, double, bool, bool *, bool *, bool *, double *))find("DoStep") : NULL;
    int (*step2)(void *, double, double, int) = third ? NULL : (int (*)(void *, double, double, int))find("DoStep");
    double x[512], z[512], next = 1e300, spent = 0.0;
    size_t n = exchange ? (size_t)atoi(getenv("FMU_STATES")) : 0;
    guards = exchange && getenv("FMU_INDICATORS") ? (size_t)atoi(getenv("FMU_INDICATORS")) : 0;
    if (n > 512 || guards > 64) return 6;
    if (exchange) next = discrete();
    show(0.0);
    long steps = 0;
    const long all = (long)(end / length + 0.5);
    for (long i = 1; i <= all; ++i) {
        double t = (i - 1) * length;
        const double to = i * length;
        struct timespec a, b;
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
        if (!exchange) {
            if (swing != 0.0) put(swings, level + (i % 2 ? swing : -swing));
            bool e, f, g;
            double reached;
            check(third ? step3(model, t, to - t, true, &e, &f, &g, &reached) : step2(model, t, to - t, 1), "step");
        }
        while (exchange && t < to) {
            const double stop = next < to ? next : to;
            bool event;
            check(((int (*)(void *, double *, size_t))find("GetContinuousStates"))(model, x, n), "states");
            t = reach(t, stop, x, z, n, &event);
            if (event || t == next) {
                check(((int (*)(void *))find("EnterEventMode"))(model), "event");
                next = discrete();
            }
        }
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
        spent += 1e9 * (double)(b.tv_sec - a.tv_sec) + (double)(b.tv_nsec - a.tv_nsec);
        ++steps;
        show(to);
    }
    fprintf(stderr, "%.1f\n", spent / (double)(steps ? steps : 1));
    ((void (*)(void *))find("FreeInstance"))(model);
    return 0;
}
