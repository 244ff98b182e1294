/* Equations as an FMU of FMI 2.0 for model exchange. Macros contain the model: N states, START values, F derivatives,
   NZ event indicators Z, the handler EVENT, the time NEXT of the next event, a request for Event Mode AFTER a step, the
   end OVER, and the output Y. With PARTIAL it returns directional derivatives. Derivatives and indicators are not defined
   where UNDEFINED. It rejects calls that do not belong to its mode, and times after the next time event.
   Value references: 0 to N - 1 states, 10 to 9 + N derivatives, 20 u (continuous), 21 d (discrete), 22 y, 23 events,
   24 steps. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))

enum { SETUP, EVENT_MODE, CONTINUOUS };
typedef struct {
    double x[N + 1], t, u, d, next, count;
    int mode, events, steps, first;
} Instance;

static void derivatives(const Instance *i, double *dx) {
    const double *x = i->x, t = i->t, u = i->u, d = i->d, count = i->count;
    (void)x, (void)t, (void)u, (void)d, (void)count;
    F;
}

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *s) { (void)c, (void)on, (void)n, (void)s; return 0; }
EXPORT int fmi2Reset(void *c) {
    Instance fresh = {.x = START, .next = HUGE_VAL, .first = 1};
    *(Instance *)c = fresh;
    return 0;
}
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *path, const void *f, int v, int on) {
    (void)name, (void)guid, (void)path, (void)f, (void)v, (void)on;
    void *c = type == 0 ? malloc(sizeof(Instance)) : NULL;
    if (c) fmi2Reset(c);
    return c;
}
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetupExperiment(void *c, int has, double tol, double start, int stops, double stop) {
    (void)has, (void)tol, (void)stops, (void)stop;
    ((Instance *)c)->t = start;
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { ((Instance *)c)->mode = EVENT_MODE; return 0; }
EXPORT int fmi2Terminate(void *c) { return ((Instance *)c)->mode == SETUP ? 3 : 0; }
EXPORT int fmi2GetReal(void *c, const unsigned *r, size_t n, double *v) {
    Instance *i = c;
    double dx[N + 1], t = i->t, u = i->u, d = i->d;
    const double *x = i->x;
    (void)t, (void)u, (void)d, (void)x;
    derivatives(i, dx);
    for (size_t k = 0; k < n; k++) v[k] = r[k] < N ? i->x[r[k]] : r[k] < 20 ? dx[r[k] - 10] : r[k] == 20 ? i->u : r[k] == 21 ? i->d : Y;
    return 0;
}
EXPORT int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *v) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        if (r[k] == 20) i->u = v[k];
        else if (r[k] == 21 && i->mode != CONTINUOUS) i->d = v[k];
        else if (r[k] < N && i->mode == SETUP) i->x[r[k]] = v[k];
        else return 3;
    }
    return 0;
}
EXPORT int fmi2GetInteger(void *c, const unsigned *r, size_t n, int *v) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) v[k] = r[k] == 23 ? i->events : i->steps;
    return 0;
}
EXPORT int fmi2SetInteger(void *c, const unsigned *r, size_t n, const int *v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
EXPORT int fmi2GetBoolean(void *c, const unsigned *r, size_t n, int *v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
EXPORT int fmi2SetBoolean(void *c, const unsigned *r, size_t n, const int *v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
EXPORT int fmi2GetString(void *c, const unsigned *r, size_t n, const char **v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
EXPORT int fmi2SetString(void *c, const unsigned *r, size_t n, const char *const *v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
EXPORT int fmi2GetFMUstate(void *c, void **s) {
    if (!*s) *s = malloc(sizeof(Instance));
    memcpy(*s, c, sizeof(Instance));
    return 0;
}
EXPORT int fmi2SetFMUstate(void *c, void *s) { memcpy(c, s, sizeof(Instance)); return 0; }
EXPORT int fmi2FreeFMUstate(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned *z, size_t nz, const unsigned *k, size_t nk, const double *dk, double *dz) {
    const double *x = ((Instance *)c)->x;
    (void)x;
    for (size_t i = 0; i < nz; i++) {
        dz[i] = 0;
        for (size_t j = 0; j < nk; j++) {
            int row = z[i] - 10, column = k[j];
            (void)row, (void)column;
            dz[i] += (PARTIAL) * dk[j];
        }
    }
    return 0;
}
EXPORT int fmi2SetTime(void *c, double t) {
    Instance *i = c;
    if (i->mode == SETUP || t > i->next) return 3;
    i->t = t;
    return 0;
}
EXPORT int fmi2SetContinuousStates(void *c, const double *x, size_t n) {
    Instance *i = c;
    if (i->mode != CONTINUOUS || n != N) return 3;
    memcpy(i->x, x, n * sizeof(double));
    return 0;
}
EXPORT int fmi2GetContinuousStates(void *c, double *x, size_t n) { memcpy(x, ((Instance *)c)->x, n * sizeof(double)); return n == N ? 0 : 3; }
EXPORT int fmi2GetNominalsOfContinuousStates(void *c, double *x, size_t n) {
    (void)c;
    for (size_t k = 0; k < n; k++) x[k] = 1;
    return 0;
}
EXPORT int fmi2GetDerivatives(void *c, double *dx, size_t n) {
    const double *x = ((Instance *)c)->x;
    (void)x;
    if (((Instance *)c)->mode != CONTINUOUS || n != N) return 3;
    derivatives(c, dx);
    return UNDEFINED ? 2 : 0;
}
EXPORT int fmi2GetEventIndicators(void *c, double *z, size_t n) {
    const double *x = ((Instance *)c)->x, u = ((Instance *)c)->u;
    (void)x, (void)u;
    if (n != NZ) return 3;
    Z;
    return UNDEFINED ? 2 : 0;
}
EXPORT int fmi2EnterEventMode(void *c) {
    Instance *i = c;
    if (i->mode != CONTINUOUS) return 3;
    i->mode = EVENT_MODE, i->first = 1;
    return 0;
}
typedef struct { int needed, terminate, nominals, states, defined; double next; } Info;
EXPORT int fmi2NewDiscreteStates(void *c, Info *info) {
    Instance *i = c;
    if (i->mode != EVENT_MODE) return 3;
    double *x = i->x, t = i->t, u = i->u, d = i->d, before = x[0];
    (void)t, (void)u, (void)d;
    Info out = {i->first, 0, 0, 0, 0, 0};
    if (i->first) {
        i->events++, i->first = 0;
        EVENT;
    }
    out.terminate = OVER;
    out.states = x[0] != before;
    i->next = NEXT;
    out.defined = i->next < HUGE_VAL, out.next = i->next;
    *info = out;
    return 0;
}
EXPORT int fmi2EnterContinuousTimeMode(void *c) {
    Instance *i = c;
    if (i->mode != EVENT_MODE) return 3;
    i->mode = CONTINUOUS;
    return 0;
}
EXPORT int fmi2CompletedIntegratorStep(void *c, int final, int *enter, int *terminate) {
    Instance *i = c;
    const double *x = i->x, t = i->t, count = i->count;
    (void)final, (void)x, (void)t, (void)count;
    if (i->mode != CONTINUOUS) return 3;
    i->steps++;
    *enter = AFTER, *terminate = 0;
    return 0;
}
