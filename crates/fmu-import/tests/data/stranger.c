/* A small hand-written FMI 2.0 FMU for co-simulation: x' = gain * u, solved with the explicit Euler method.
   The compiler's command line defines VERSION, GUID and the statement STEP.
   Real: 0 u, 1 x, 2 gain, 3 start; Integer: 0 failure, 1 count; Boolean: 0 inverted, 1 moved; String: 0 label.
   Each of the other macros adds a defect. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#define EXPORT __attribute__((visibility("default")))

typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} Callbacks;
typedef struct {
    double real[4];
    int integer[2], boolean[2];
} Values;
typedef struct {
    Values v;
    char label[32], resources[512];
    const char *name;
    const Callbacks *callbacks;
} Instance;

#if defined SHARED || defined SINGLE
static Instance shared;
static int living;
#endif

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return VERSION; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging) {
    (void)visible, (void)logging;
    if (type != 1 || strcmp(guid, GUID) != 0) {
        callbacks->logger(callbacks->environment, name, 3, "error", "wrong GUID");
        return NULL;
    }
#ifdef SINGLE
    if (living) return NULL;
    living = 1;
#endif
#ifdef SHARED
    Instance *i = &shared;
    if (!living) shared.v = (Values){{0}, {0}, {0}};
    living++;
#else
    Instance *i = callbacks->allocate(1, sizeof *i);
    if (!i) return NULL;
#endif
    i->v.real[2] = 1;
    i->name = name;
    i->callbacks = callbacks;
    snprintf(i->resources, sizeof i->resources, "%s", resources);
    return i;
}
EXPORT void fmi2FreeInstance(void *c) {
#if defined SHARED || defined SINGLE
    living--;
#endif
#ifdef SHARED
    (void)c;
#else
    ((Instance *)c)->callbacks->release(c);
#endif
}
EXPORT int fmi2SetupExperiment(void *c, int td, double tol, double t0, int sd, double t1) {
    (void)c, (void)td, (void)tol, (void)t0, (void)sd, (void)t1;
    return 0;
}
/* Statement that is executed at the start of the initialization and whenever a value is set */
#ifndef FOLLOW
#define FOLLOW (void)i
#endif
EXPORT int fmi2EnterInitializationMode(void *c) {
    Instance *i = c;
    FOLLOW;
    return 0;
}
/* Statement at the end of the initialization */
#ifndef EXIT
#define EXIT i->v.real[1] = i->v.real[3]
#endif
EXPORT int fmi2ExitInitializationMode(void *c) {
    Instance *i = c;
    EXIT;
    return 0;
}
EXPORT int fmi2Terminate(void *c) {
    Instance *i = c;
    if (i->v.integer[0] == 9) i->callbacks->logger(i->callbacks->environment, i->name, 1, "warning", "100%% done");
    return 0;
}
EXPORT int fmi2Reset(void *c) {
    Values zero = {{0, 0, 1, 0}, {0, 0}, {0, 0}};
    Instance *i = c;
#ifdef RESET_NOTHING
    (void)zero, (void)i;
#elif defined RESET_STATES
    i->v.real[1] = i->v.integer[1] = i->v.boolean[1] = 0;
#else
    i->v = zero;
#ifndef RESET_NUMBERS
    i->label[0] = 0;
#endif
#endif
    return 0;
}

#define ACCESS(Kind, type, field, count)                                                            \
    EXPORT int fmi2Get##Kind(void *c, const unsigned *r, size_t n, type *v) {                        \
        for (size_t k = 0; k < n; k++) {                                                             \
            if (r[k] >= count) return 3;                                                             \
            v[k] = ((Instance *)c)->v.field[r[k]];                                                   \
        }                                                                                            \
        return 0;                                                                                    \
    }                                                                                                \
    EXPORT int fmi2Set##Kind(void *c, const unsigned *r, size_t n, const type *v) {                  \
        Instance *i = c;                                                                             \
        for (size_t k = 0; k < n; k++) {                                                             \
            if (r[k] >= count) return 3;                                                             \
            i->v.field[r[k]] = v[k];                                                                 \
        }                                                                                            \
        FOLLOW;                                                                                      \
        return 0;                                                                                    \
    }
ACCESS(Real, double, real, 4)
ACCESS(Integer, int, integer, 2)
ACCESS(Boolean, int, boolean, 2)
EXPORT int fmi2GetString(void *c, const unsigned *r, size_t n, const char **v) {
    for (size_t k = 0; k < n; k++) v[k] = r[k] == 0 ? ((Instance *)c)->label : ((Instance *)c)->resources;
    return 0;
}
EXPORT int fmi2SetString(void *c, const unsigned *r, size_t n, const char *const *v) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        if (r[k] != 0) return 3;
        snprintf(i->label, 32, "%s", v[k]);
    }
    FOLLOW;
    return 0;
}

/* failure = 1: error at t = 0.5 with a message; 2: fatal; 3: discard; 5: pending */
EXPORT int fmi2DoStep(void *c, double t, double h, int final) {
    (void)final;
    Instance *i = c;
    STEP;
#ifdef ENDS
    if (t > ENDS) return 2;
#endif
#ifdef FIXED_STEP
    if (h < 0.0099 || h > 0.0101) return 3;
#endif
#ifdef PENDING
    return 5;
#endif
    int failure = i->v.integer[0];
    if (failure && failure < 9 && t >= 0.5) {
        i->callbacks->logger(i->callbacks->environment, i->name, 3, "error", "x left 90%% of its range");
        return failure == 1 ? 3 : failure == 2 ? 4 : failure == 3 ? 2 : failure;
    }
    double u = i->v.boolean[0] ? -i->v.real[0] : i->v.real[0];
    i->v.real[1] += h * (i->v.real[2] * u);
    i->v.integer[1] += 1;
    i->v.boolean[1] = 1;
    return 0;
}
#ifdef ENDS
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *v) { (void)c; *v = TERMINATED; return kind == 3 ? 0 : 2; }
#endif
#ifdef STATES
EXPORT int fmi2GetFMUstate(void *c, void **s) {
#ifdef NO_STATE
    return 3;
#endif
    if (!*s) *s = malloc(sizeof(Values));
    memcpy(*s, &((Instance *)c)->v, sizeof(Values));
    return 0;
}
EXPORT int fmi2SetFMUstate(void *c, void *s) {
    if (!s) return 3;
#ifdef STATE_NOTHING
    return 0;
#endif
#ifdef STATE_WITHOUT_INPUTS
    ((Values *)s)->real[0] = ((Instance *)c)->v.real[0];
#endif
    memcpy(&((Instance *)c)->v, s, sizeof(Values));
#ifdef STATE_OFF
    ((Instance *)c)->v.real[1] *= 1 + STATE_OFF;
#endif
    return 0;
}
EXPORT int fmi2FreeFMUstate(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
EXPORT int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) {
    (void)c, (void)s;
    *n = sizeof(Values);
#ifdef NO_BYTES
    return 3;
#endif
    return 0;
}
EXPORT int fmi2SerializeFMUstate(void *c, void *s, char *b, size_t n) { (void)c; memcpy(b, s, n); return 0; }
EXPORT int fmi2DeSerializeFMUstate(void *c, const char *b, size_t n, void **s) {
    (void)c;
    if (n != sizeof(Values)) return 3;
    *s = malloc(n);
    memcpy(*s, b, n);
#ifdef BYTES_WITHOUT_PARAMETERS
    ((Values *)*s)->real[2] = 1;
#endif
#ifdef BYTES_WITHOUT_STATES
    ((Values *)*s)->real[1] = 0;
#endif
    return 0;
}
/* d(x')/d(u) and d(x')/d(gain); the unknown must be x, variable 1 */
EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk,
                                        const double *dk, double *du) {
    const double *r = ((Instance *)c)->v.real;
#ifdef NO_DERIVATIVE
    return 3;
#endif
#ifdef DISCARDED_DERIVATIVE
    return 2;
#endif
    for (size_t i = 0; i < nu; i++) {
        if (u[i] != 1) return 3;
        du[i] = 0;
        for (size_t j = 0; j < nk; j++) du[i] += dk[j] * (k[j] == 0 ? r[2] : k[j] == 2 ? r[0] : 0);
    }
    return 0;
}
#endif
#ifdef SLOPES
/* Supported up to order SLOPES */
EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned *r, size_t n, const int *order, const double *v) {
    (void)c, (void)r, (void)n, (void)v;
    return order[0] > SLOPES ? 3 : 0;
}
EXPORT int fmi2GetRealOutputDerivatives(void *c, const unsigned *r, size_t n, const int *order, double *v) {
    (void)c, (void)r, (void)n;
    v[0] = 0;
    return order[0] > SLOPES ? 3 : 0;
}
#endif
