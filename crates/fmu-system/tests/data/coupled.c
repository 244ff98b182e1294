/* Components of coupled systems, FMI 2.0 for co-simulation. The compiler's command line defines MODEL and GUID.
   Real: 0, 1 inputs; 2, 3, 4 outputs; 5 number of steps that do not start at the end of the step before;
   6 number of steps; 7 limit of the step, above which steps are discarded. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
} Callbacks;
typedef struct {
    double real[8], slope[2], x[2], reached, start;
} Values;
typedef struct {
    Values v;
    void (*release)(void *);
} Instance;

/* S1: mass 1. Input force; outputs x1, v1. S2: mass 2 with both springs. Inputs x1, v1; outputs force, x2, v2.
   Plant: T y' + y = K u. Sensor: s = y. Controller: proportional and integral, r = 1. */
enum { S1, S2, PLANT, SENSOR, CONTROLLER };

static void derivative(const Values *v, const double *x, const double *u, double *d) {
    double force = 300 * (x[0] - u[0]) + 0.2 * (x[1] - u[1]);
    (void)v;
    d[0] = x[1];
    d[1] = MODEL == S1 ? u[0] - 100 * x[0] - 0.5 * x[1] : (-force - 200 * x[0] - 0.5 * x[1]) / 2;
}
/* Classical Runge-Kutta method with steps of at most 0.1 ms */
static void integrate(Values *v, double h) {
    int n = (int)ceil(h / 1e-4 - 1e-9);
    double s = h / n, *x = v->x;
    for (int i = 0; i < n; i++) {
        double u[3][2], k[4][2], y[2];
        for (int j = 0; j < 3; j++)
            for (int c = 0; c < 2; c++) u[j][c] = v->real[c] + v->slope[c] * s * (i + 0.5 * j);
        derivative(v, x, u[0], k[0]);
        for (int c = 0; c < 2; c++) y[c] = x[c] + 0.5 * s * k[0][c];
        derivative(v, y, u[1], k[1]);
        for (int c = 0; c < 2; c++) y[c] = x[c] + 0.5 * s * k[1][c];
        derivative(v, y, u[1], k[2]);
        for (int c = 0; c < 2; c++) y[c] = x[c] + s * k[2][c];
        derivative(v, y, u[2], k[3]);
        for (int c = 0; c < 2; c++) x[c] += s / 6 * (k[0][c] + 2 * k[1][c] + 2 * k[2][c] + k[3][c]);
    }
}
static void output(Values *v) {
    double *r = v->real;
    if (MODEL == S1) {
        r[2] = v->x[0], r[3] = v->x[1];
    } else if (MODEL == S2) {
        r[2] = 300 * (v->x[0] - r[0]) + 0.2 * (v->x[1] - r[1]);
        r[3] = v->x[0], r[4] = v->x[1];
    } else {
        r[2] = v->x[0];
    }
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging) {
    (void)name, (void)resources, (void)visible, (void)logging;
    Instance *i = type == 1 && strcmp(guid, GUID) == 0 ? callbacks->allocate(1, sizeof *i) : NULL;
    if (!i) return NULL;
    i->release = callbacks->release;
    i->v.x[0] = MODEL == S1 ? 0.1 : 0;
    i->v.real[7] = HUGE_VAL;
    output(&i->v);
    return i;
}
EXPORT void fmi2FreeInstance(void *c) { ((Instance *)c)->release(c); }
EXPORT int fmi2SetupExperiment(void *c, int td, double tol, double t0, int sd, double t1) {
    (void)td, (void)tol, (void)sd, (void)t1;
    ((Instance *)c)->v.reached = t0;
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { output(&((Instance *)c)->v); return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { output(&((Instance *)c)->v); return 0; }
EXPORT int fmi2Terminate(void *c) { (void)c; return 0; }
EXPORT int fmi2Reset(void *c) { (void)c; return 3; }
EXPORT int fmi2GetReal(void *c, const unsigned *r, size_t n, double *v) {
#ifdef NARROW /* the longest step with defined outputs */
    if (((Instance *)c)->v.reached - ((Instance *)c)->v.start > NARROW) return 2;
#endif
    for (size_t k = 0; k < n; k++) v[k] = ((Instance *)c)->v.real[r[k]];
    return 0;
}
EXPORT int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *v) {
    Values *own = &((Instance *)c)->v;
    for (size_t k = 0; k < n; k++) {
        own->real[r[k]] = v[k];
        if (r[k] < 2) own->slope[r[k]] = 0;
    }
    if (own->real[6] == 0) output(own);
    return 0;
}
EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned *r, size_t n, const int *order, const double *v) {
    for (size_t k = 0; k < n; k++) {
        if (r[k] > 1 || order[k] != 1) return 3;
        ((Instance *)c)->v.slope[r[k]] = v[k];
    }
    return 0;
}
#define NONE(Kind, type)                                                                                        \
    EXPORT int fmi2Get##Kind(void *c, const unsigned *r, size_t n, type *v) { (void)c, (void)r, (void)v; return n ? 3 : 0; } \
    EXPORT int fmi2Set##Kind(void *c, const unsigned *r, size_t n, const type *v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
NONE(Integer, int)
NONE(Boolean, int)
NONE(String, char *)

EXPORT int fmi2DoStep(void *c, double t, double h, int final) {
    (void)final;
    Values *v = &((Instance *)c)->v;
    if (v->real[6] > 0 && t != v->reached) v->real[5]++;
    if (h > v->real[7] * (1 + 1e-9)) return 2;
    v->real[6]++;
    v->start = t;
    v->reached = t + h;
    if (MODEL == PLANT) {
        double a = exp(-h / 0.05);
        v->x[0] = v->x[0] * a + 2 * v->real[0] * (1 - a);
    } else if (MODEL == SENSOR) {
        v->x[0] = v->real[0];
    } else if (MODEL == CONTROLLER) {
        double e = 1 - v->real[0];
        v->x[0] = 0.6 * e + v->x[1];
        v->x[1] += 8 * 0.01 * e;
    } else {
        integrate(v, h);
    }
    for (int k = 0; k < 2; k++) v->real[k] += v->slope[k] * h;
    output(v);
    return 0;
}
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *v) { (void)c; *v = 0; return kind == 3 ? 0 : 2; }
EXPORT int fmi2GetRealStatus(void *c, int kind, double *v) {
    const Values *own = &((Instance *)c)->v;
    *v = own->reached + own->real[7];
#ifdef NO_LAST_TIME
    return 2;
#endif
    return kind == 2 ? 0 : 2;
}
EXPORT int fmi2GetFMUstate(void *c, void **s) {
    if (!*s) *s = malloc(sizeof(Values));
    memcpy(*s, &((Instance *)c)->v, sizeof(Values));
    return 0;
}
EXPORT int fmi2SetFMUstate(void *c, void *s) { memcpy(&((Instance *)c)->v, s, sizeof(Values)); return 0; }
EXPORT int fmi2FreeFMUstate(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
