/* An FMU of FMI 2.0, x' = k (20 - x) and an output, that does harm where its GUID says: FAULT:FUNCTION:TIME. */
#include <math.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef int (*logger_t)(void *, const char *, int, const char *, const char *, ...);
static char fault[64], where[64];
static double from, now, x, k = 0.1, heat;
static logger_t say;

static int deeper(volatile char *of) {
    volatile char room[65536];
    room[0] = of ? of[0] : 1;
    return deeper(room) + room[0];
}

/* Whether a function does harm now; most kinds of harm do not return. */
static int hit(const char *name) {
    if (strcmp(name, where) != 0 || now < from) return 0;
    if (!strcmp(fault, "segfault")) *(volatile int *)16 = 1;
    if (!strcmp(fault, "wild")) ((void (*)(void))(uintptr_t)0x123456)();
    if (!strcmp(fault, "abort")) abort();
    if (!strcmp(fault, "free")) free((void *)&x);
    if (!strcmp(fault, "overflow")) deeper(NULL);
    if (!strcmp(fault, "kill")) raise(SIGKILL);
    if (!strcmp(fault, "stop")) raise(SIGSTOP);
    if (!strcmp(fault, "hang")) for (;;) pause();
    if (!strcmp(fault, "spin")) for (volatile int turn = 1; turn;) turn = 1;
    if (!strcmp(fault, "deaf")) { signal(SIGALRM, SIG_IGN); signal(SIGTERM, SIG_IGN); signal(SIGINT, SIG_IGN); for (;;) sleep(1); }
    if (!strcmp(fault, "exit0")) exit(0);
    if (!strcmp(fault, "exit3")) exit(3);
    if (!strcmp(fault, "_exit")) _exit(7);
    if (!strcmp(fault, "eat")) for (;;) { char *more = malloc(1 << 26); more[0] = 1; }
    if (!strcmp(fault, "babble")) for (int fd = 0; fd < 30; ++fd) (void)!write(fd, "\377\377\377\377\377\377\377\377 answer", 15);
    if (!strcmp(fault, "close")) { for (int fd = 0; fd < 30; ++fd) close(fd); for (;;) pause(); }
    return 1;
}

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *place, void **callbacks, int visible, int logging) {
    (void)name; (void)type; (void)place; (void)visible; (void)logging;
    fault[0] = where[0] = 0;
    from = now = heat = 0.0;
    x = 30.0;
    sscanf(guid, "%63[^:]:%63[^:]:%lf", fault, where, &from);
    say = callbacks ? (logger_t)callbacks[0] : NULL;
    return hit("fmi2Instantiate") ? NULL : &x;
}

void fmi2FreeInstance(void *c) { (void)c; hit("fmi2FreeInstance"); }

/* What a call returns: 3 is an error, said with signs that would move a cursor. */
static int status(const char *name) {
    if (!hit(name)) return 0;
    if (!strcmp(fault, "escape") && say) say(&x, "m", 3, "error", "%s", "\033[2J\033]0;owned\007 all is well\r\n");
    return strcmp(fault, "error") && strcmp(fault, "escape") ? 0 : 3;
}

static double spoiled(const char *name, double value) {
    if (strcmp(name, where) != 0 || now < from) return value;
    if (!strcmp(fault, "nan")) return NAN;
    if (!strcmp(fault, "inf")) return INFINITY;
    return value;
}

#define PLAIN(name) int name(void *c) { (void)c; return status(#name); }
PLAIN(fmi2EnterInitializationMode)
PLAIN(fmi2ExitInitializationMode)
PLAIN(fmi2Terminate)
PLAIN(fmi2Reset)
PLAIN(fmi2EnterEventMode)
PLAIN(fmi2EnterContinuousTimeMode)

int fmi2SetupExperiment(void *c, int has, double tolerance, double start, int ends, double stop) {
    (void)c; (void)has; (void)tolerance; (void)start; (void)ends; (void)stop;
    return status("fmi2SetupExperiment");
}

int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *v) {
    (void)c;
    for (size_t i = 0; i < n; ++i) {
        if (r[i] == 0) x = v[i];
        else if (r[i] == 2) k = v[i];
        else if (r[i] == 3) heat = v[i];
        else return 3;
    }
    return status("fmi2SetReal");
}

int fmi2GetReal(void *c, const unsigned *r, size_t n, double *v) {
    (void)c;
    for (size_t i = 0; i < n; ++i) {
        if (r[i] > 3) return 3;
        v[i] = spoiled("fmi2GetReal", r[i] == 0 ? x : r[i] == 1 ? k * (20.0 - x) + heat : r[i] == 2 ? k : heat);
    }
    return status("fmi2GetReal");
}

int fmi2DoStep(void *c, double at, double step, int keep) {
    (void)c; (void)keep;
    now = at;
    x = spoiled("fmi2DoStep", 20.0 + (x - 20.0) * exp(-k * step));
    return status("fmi2DoStep");
}

int fmi2SetTime(void *c, double time) { (void)c; now = time; return status("fmi2SetTime"); }
int fmi2SetContinuousStates(void *c, const double *v, size_t n) { (void)c; (void)n; x = v[0]; return status("fmi2SetContinuousStates"); }

int fmi2GetContinuousStates(void *c, double *v, size_t n) {
    (void)c;
    if (!strcmp(fault, "wide")) for (size_t i = 0; i < 1000000; ++i) v[i] = 1e300;
    for (size_t i = 0; i < n; ++i) v[i] = x;
    return status("fmi2GetContinuousStates");
}

int fmi2GetDerivatives(void *c, double *v, size_t n) {
    (void)c;
    for (size_t i = 0; i < n; ++i) v[i] = spoiled("fmi2GetDerivatives", k * (20.0 - x) + heat);
    return status("fmi2GetDerivatives");
}

int fmi2GetEventIndicators(void *c, double *v, size_t n) {
    (void)c;
    for (size_t i = 0; i < n; ++i) v[i] = 1.0;
    return status("fmi2GetEventIndicators");
}

int fmi2GetNominalsOfContinuousStates(void *c, double *v, size_t n) {
    (void)c;
    for (size_t i = 0; i < n; ++i) v[i] = 1.0;
    return status("fmi2GetNominalsOfContinuousStates");
}

int fmi2CompletedIntegratorStep(void *c, int keep, int *enter, int *ends) {
    (void)c; (void)keep;
    *enter = *ends = 0;
    return status("fmi2CompletedIntegratorStep");
}

typedef struct { int again, ends, nominals, values, defined; double due; } events_t;
int fmi2NewDiscreteStates(void *c, events_t *events) {
    (void)c;
    memset(events, 0, sizeof *events);
    events->again = !strcmp(fault, "restless");
    events->defined = !strcmp(fault, "storm");
    events->due = now;
    return status("fmi2NewDiscreteStates");
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
#define NONE(name) int name(void) { return 3; }
NONE(fmi2SetDebugLogging) NONE(fmi2GetInteger) NONE(fmi2GetBoolean) NONE(fmi2GetString) NONE(fmi2SetInteger) NONE(fmi2SetBoolean)
NONE(fmi2SetString) NONE(fmi2GetFMUstate) NONE(fmi2SetFMUstate) NONE(fmi2FreeFMUstate) NONE(fmi2SerializedFMUstateSize)
NONE(fmi2SerializeFMUstate) NONE(fmi2DeSerializeFMUstate) NONE(fmi2GetDirectionalDerivative) NONE(fmi2SetRealInputDerivatives)
NONE(fmi2GetRealOutputDerivatives) NONE(fmi2CancelStep) NONE(fmi2GetStatus) NONE(fmi2GetRealStatus) NONE(fmi2GetIntegerStatus)
NONE(fmi2GetBooleanStatus)
#ifndef LACKING
NONE(fmi2GetStringStatus)
#endif
#ifdef CONSTRUCTED
__attribute__((constructor)) static void loaded(void) { CONSTRUCTED; }
#endif
