/* A small hand-written FMU for co-simulation and model exchange. The macro FMI selects FMI 2.0 or 3.0.
   x' = -k x, x(0) = 1; when x falls to 0.5, an event adds 1 to x and to count. Co-simulation uses the exact solution
   x(t) = x(0) exp(-k t), so events are at ln(x / 0.5) / k.
   Outputs: y = x + u, w = x v (an array of 3), y32 = u / 2, not = !flag, next = mode + 1, sum = small + wide.
   Value references, the same in both versions (FMI 2.0 has the first 8 only):
   0 time, 1 x, 2 der(x), 3 k, 4 u, 5 y, 6 count, 7 crossing, 8 y32, 9 flag, 10 not, 11 label, 12 resources, 13 small,
   14 wide, 15 sum, 16 mode, 17 next, 18 v, 19 w, 20 bits. With the macro RESIZED, wide is a tunable structural parameter:
   the length of v and w, 3 at the start, at most 8. Each of the other macros causes a defect. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))

enum { TIME, X, DX, K, U, Y, COUNT, CROSSING, Y32, FLAG, NOT, LABEL, RESOURCES, SMALL, WIDE, SUM, MODE, NEXT, V, W, BITS };

typedef struct {
    double time, x, k, u, v[8];
    int count, first;
    bool flag, bits[2], below;
    int8_t small;
    uint64_t wide;
    int64_t mode;
} Values;
typedef void (*Updated)(void *environment, double time, bool set, bool get, bool finished, bool can_return, bool *returns,
                        double *at);
typedef struct {
    Values m;
    char label[32], resources[512];
    int exchange, started;
    void *environment;
    Updated updated;
    bool early, events;
    int handled;
} Instance;

static void start(Instance *i) {
    Values m = {.x = 1, .k = 2, .v = {1, 2, 3}, .bits = {true, false}, .small = 3, .wide = 7, .mode = 1, .first = 1};
#ifdef RESIZED
    m.wide = 3;
#endif
    i->m = m;
    i->label[0] = 0;
    i->started = 0;
}
static double derivative(const Instance *i) {
#ifdef NOT_FINITE
    return NAN;
#endif
#ifdef NOT_REPEATABLE
    static int calls;
    return -i->m.k * i->m.x + 1e-9 * calls++;
#endif
#ifdef OTHER_IN_EXCHANGE
    if (i->exchange) return -2 * i->m.k * i->m.x;
#endif
    return -i->m.k * i->m.x;
}
static int event(Instance *i) {
    if (i->m.x > 0.5) return 0;
    i->m.x += 1;
    i->m.count++;
    return 1;
}
static void step(Instance *i, double h) {
    while (i->m.k > 0 && i->m.x * exp(-i->m.k * h) <= 0.5) {
        double part = log(i->m.x / 0.5) / i->m.k;
        h -= part;
        i->m.x = 0.5;
        event(i);
    }
    i->m.x *= exp(-i->m.k * h);
}
/* Updates the discrete states. Results: needed again, terminate, nominals changed, states changed, time defined */
static void update(Instance *i, int out[5]) {
#ifdef FOREVER
    int again = 1;
#else
    int again = i->m.first;
#endif
    i->m.first = 0;
    out[0] = again, out[1] = 0, out[2] = 0, out[3] = event(i), out[4] = 0;
}
static double real(const Instance *i, unsigned r) {
    switch (r) {
    case TIME: return i->m.time;
    case X: return i->m.x;
    case DX: return derivative(i);
    case K: return i->m.k;
    case U: return i->m.u;
    case Y: return i->m.x + i->m.u;
    case CROSSING: return i->m.x - 0.5;
    default: return NAN;
    }
}
static int set_real(Instance *i, unsigned r, double value) {
    if (r == K) i->m.k = value;
    else if (r == U) i->m.u = value;
    else if (r == X) i->m.x = value;
    else return 3;
    return 0;
}
/* One element of d(der(x), y, w)/d(x, u, v). */
static double partial(const Instance *i, unsigned unknown, size_t row, unsigned known, size_t column) {
    if (unknown == DX) return known == X ? -i->m.k : 0;
    if (unknown == X) return known == X ? 1 : 0;
    if (unknown == Y) return known == X || known == U ? 1 : 0;
    if (unknown == Y32) return known == U ? 0.5 : 0;
    if (unknown == W) return known == X ? i->m.v[row] : known == V && row == column ? i->m.x : 0;
    return 0;
}
static size_t size(const Instance *i, unsigned r) {
#if defined RESIZED && !defined KEEPS_LENGTH
    if (r == V || r == W) return i->m.wide;
#endif
    (void)i;
    return r == V || r == W ? 3 : r == BITS ? 2 : 1;
}

/* Shared by both versions */
#define STATE(Name, Deserialize, Byte)                                                                  \
    EXPORT int Name##GetFMU##Byte##tate(void *c, void **s) {                                             \
        if (!*s) *s = malloc(sizeof(Values));                                                           \
        memcpy(*s, &((Instance *)c)->m, sizeof(Values));                                                \
        return 0;                                                                                       \
    }                                                                                                   \
    EXPORT int Name##SetFMU##Byte##tate(void *c, void *s) { return restore(c, s); }                      \
    EXPORT int Name##FreeFMU##Byte##tate(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }  \
    EXPORT int Name##SerializedFMU##Byte##tateSize(void *c, void *s, size_t *n) {                        \
        (void)c, (void)s;                                                                               \
        *n = sizeof(Values);                                                                            \
        return 0;                                                                                       \
    }                                                                                                   \
    EXPORT int Name##SerializeFMU##Byte##tate(void *c, void *s, char *b, size_t n) {                     \
        (void)c;                                                                                        \
        memcpy(b, s, n);                                                                                \
        return 0;                                                                                       \
    }                                                                                                   \
    EXPORT int Name##Deserialize(void *c, const char *b, size_t n, void **s) {                           \
        (void)c;                                                                                        \
        if (n != sizeof(Values)) return 3;                                                              \
        *s = malloc(n);                                                                                 \
        memcpy(*s, b, n);                                                                               \
        return 0;                                                                                       \
    }
static int restore(Instance *i, const void *s) {
    if (!s) return 3;
#ifdef STATE_NOTHING
    return 0;
#endif
    memcpy(&i->m, s, sizeof(Values));
    return 0;
}
/* Minimum length of an array. With the defect LEAST=0, the FMU writes to the first element of an empty array. */
#ifndef LEAST
#define LEAST 1
#endif
#define NUMBERS(Name, Get, value)                                 \
    EXPORT int Name##Get(void *c, double *v, size_t n) {           \
        Instance *i = c;                                          \
        if (n > 1 || n < LEAST) return 3;                         \
        v[0] = value;                                             \
        return 0;                                                 \
    }
#ifndef NOMINAL
#define NOMINAL 1
#endif
#define EXCHANGE(Name, Derivatives)                                              \
    EXPORT int Name##SetTime(void *c, double t) { ((Instance *)c)->m.time = t; return 0; } \
    EXPORT int Name##SetContinuousStates(void *c, const double *x, size_t n) {    \
        if (n != 1) return n < LEAST ? 3 : 0;                                    \
        ((Instance *)c)->m.x = x[0];                                             \
        return 0;                                                                \
    }                                                                            \
    NUMBERS(Name, GetContinuousStates, i->m.x)                                   \
    NUMBERS(Name, Derivatives, derivative(i))                                    \
    NUMBERS(Name, GetEventIndicators, i->m.x - 0.5)                              \
    NUMBERS(Name, GetNominalsOfContinuousStates, ((void)i, NOMINAL))             \
    EXPORT int Name##EnterEventMode(void *c) { (void)c; return 0; }               \
    EXPORT int Name##EnterContinuousTimeMode(void *c) { (void)c; return 0; }
#define COMMON(Name)                                                             \
    EXPORT void Name##FreeInstance(void *c) { free(c); }                          \
    EXPORT int Name##ExitInitializationMode(void *c) { (void)c; return 0; }       \
    EXPORT int Name##Terminate(void *c) { (void)c; return 0; }                    \
    EXPORT int Name##Reset(void *c) { start(c); return 0; }

#if FMI == 2
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} Callbacks;
typedef struct {
    int needed, terminate, nominals, states, defined;
    double time;
} EventInfo;

COMMON(fmi2)
EXCHANGE(fmi2, GetDerivatives)
STATE(fmi2, DeSerializeFMUstate, s)
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging) {
    (void)visible, (void)logging;
    if (strcmp(guid, "{decay}") != 0) {
        callbacks->logger(callbacks->environment, name, 3, "error", "wrong GUID");
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    start(i);
    i->exchange = type == 0;
    snprintf(i->resources, sizeof i->resources, "%s", resources);
    return i;
}
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *s) { (void)c, (void)on, (void)n, (void)s; return 0; }
EXPORT int fmi2SetupExperiment(void *c, int td, double tol, double t0, int sd, double t1) {
    (void)td, (void)tol, (void)sd, (void)t1;
    ((Instance *)c)->m.time = t0;
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
EXPORT int fmi2GetReal(void *c, const unsigned *r, size_t n, double *v) {
    for (size_t k = 0; k < n; k++) v[k] = real(c, r[k]);
    return 0;
}
EXPORT int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *v) {
    for (size_t k = 0; k < n; k++)
        if (set_real(c, r[k], v[k])) return 3;
    return 0;
}
EXPORT int fmi2GetInteger(void *c, const unsigned *r, size_t n, int *v) {
    for (size_t k = 0; k < n; k++) {
        if (r[k] != COUNT) return 3;
        v[k] = ((Instance *)c)->m.count;
    }
    return 0;
}
#define NOTHING(Name, type) EXPORT int fmi2##Name(void *c, const unsigned *r, size_t n, type v) { (void)c, (void)r, (void)v; return n ? 3 : 0; }
NOTHING(SetInteger, const int *)
NOTHING(GetBoolean, int *)
NOTHING(SetBoolean, const int *)
NOTHING(GetString, const char **)
NOTHING(SetString, const char *const *)
EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk,
                                        const double *dk, double *du) {
    for (size_t i = 0; i < nu; i++) {
        du[i] = 0;
        for (size_t j = 0; j < nk; j++) du[i] += dk[j] * partial(c, u[i], 0, k[j], 0);
    }
    return 0;
}
EXPORT int fmi2DoStep(void *c, double t, double h, int final) {
    (void)final;
    step(c, h);
    ((Instance *)c)->m.time = t + h;
    return 0;
}
EXPORT int fmi2NewDiscreteStates(void *c, EventInfo *info) {
    int out[5];
    update(c, out);
    EventInfo outcome = {out[0], out[1], out[2], out[3], out[4], 0};
    *info = outcome;
    return 0;
}
EXPORT int fmi2CompletedIntegratorStep(void *c, int final, int *enter, int *terminate) {
    (void)c, (void)final;
    *enter = *terminate = 0;
    return 0;
}
/* Functions for co-simulation that the tests do not use */
EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned *r, size_t n, const int *o, const double *v) { (void)c, (void)r, (void)n, (void)o, (void)v; return 3; }
EXPORT int fmi2GetRealOutputDerivatives(void *c, const unsigned *r, size_t n, const int *o, double *v) { (void)c, (void)r, (void)n, (void)o, (void)v; return 3; }
EXPORT int fmi2CancelStep(void *c) { (void)c; return 3; }
#define STATUS(Name, type) EXPORT int fmi2Get##Name(void *c, int kind, type *v) { (void)c, (void)kind, (void)v; return 2; }
STATUS(Status, int)
STATUS(RealStatus, double)
STATUS(IntegerStatus, int)
STATUS(BooleanStatus, int)
STATUS(StringStatus, const char *)
#else
typedef void (*LogMessage)(void *, int, const char *, const char *);

COMMON(fmi3)
EXCHANGE(fmi3, GetContinuousStateDerivatives)
STATE(fmi3, DeserializeFMUState, S)
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
static void *instantiate(const char *token, const char *resources, void *environment, LogMessage log) {
    if (strcmp(token, "{decay}") != 0) {
        log(environment, 3, "error", "wrong token, 100 %");
        return NULL;
    }
    Instance *i = calloc(1, sizeof *i);
    start(i);
    snprintf(i->resources, sizeof i->resources, "%s", resources ? resources : "");
    return i;
}
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *required, size_t n,
                                         void *environment, LogMessage log, void *intermediate) {
    (void)name, (void)visible, (void)logging, (void)required, (void)intermediate;
#ifdef UPDATES
    Instance *i = events ? NULL : instantiate(token, resources, environment, log);
    if (i) i->environment = environment, i->updated = (Updated)intermediate, i->early = early;
    return i;
#endif
#ifdef EVENTS
    Instance *i = n ? NULL : instantiate(token, resources, environment, log);
    if (i) i->events = events;
    return i;
#endif
    if (events || early || n) return NULL;
    return instantiate(token, resources, environment, log);
}
EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, LogMessage log) {
    (void)name, (void)visible, (void)logging;
    Instance *i = instantiate(token, resources, environment, log);
    if (i) i->exchange = 1;
    return i;
}
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
EXPORT int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const *s) { (void)c, (void)on, (void)n, (void)s; return 0; }
EXPORT int fmi3EnterInitializationMode(void *c, bool td, double tol, double t0, bool sd, double t1) {
    (void)td, (void)tol, (void)sd, (void)t1;
    ((Instance *)c)->m.time = t0;
    ((Instance *)c)->started = 1;
    return 0;
}
/* Values of each type, element by element. A reference to another type is an error. */
#ifdef ANY_COUNT
#define IS_COUNT(at, nv) true
#else
#define IS_COUNT(at, nv) (at == nv)
#endif
#define ACCESS(Name, type, get, set)                                                                              \
    EXPORT int fmi3Get##Name(void *c, const unsigned *r, size_t n, type *v, size_t nv) {                           \
        Instance *i = c;                                                                                          \
        size_t at = 0;                                                                                            \
        (void)i, (void)v;                                                                                         \
        for (size_t k = 0; k < n; k++)                                                                            \
            for (size_t e = 0; e < size(i, r[k]); e++, at++) {                                                    \
                if (at >= nv) return 3;                                                                           \
                get                                                                                               \
            }                                                                                                     \
        return IS_COUNT(at, nv) ? 0 : 3;                                                                          \
    }                                                                                                             \
    EXPORT int fmi3Set##Name(void *c, const unsigned *r, size_t n, const type *v, size_t nv) {                     \
        Instance *i = c;                                                                                          \
        size_t at = 0;                                                                                            \
        (void)i, (void)v;                                                                                         \
        for (size_t k = 0; k < n; k++)                                                                            \
            for (size_t e = 0; e < size(i, r[k]); e++, at++) {                                                    \
                if (at >= nv) return 3;                                                                           \
                set                                                                                               \
            }                                                                                                     \
        return at == nv ? 0 : 3;                                                                                  \
    }
ACCESS(Float64, double,
       { if (r[k] == V) v[at] = i->m.v[e]; else if (r[k] == W) v[at] = i->m.x * i->m.v[e];
         else { v[at] = real(i, r[k]); if (isnan(v[at]) && r[k] > CROSSING) return 3; } },
       { if (r[k] == V) i->m.v[e] = v[at]; else if (set_real(i, r[k], v[at])) return 3; })
ACCESS(Float32, float, { if (r[k] != Y32) return 3; v[at] = (float)(0.5 * i->m.u); }, { return 3; })
ACCESS(Int8, int8_t, { if (r[k] != SMALL) return 3; v[at] = i->m.small; }, { if (r[k] != SMALL) return 3; i->m.small = v[at]; })
ACCESS(UInt8, uint8_t, { return 3; }, { return 3; })
ACCESS(Int16, int16_t, { return 3; }, { return 3; })
ACCESS(UInt16, uint16_t, { return 3; }, { return 3; })
ACCESS(Int32, int32_t, { if (r[k] != COUNT) return 3; v[at] = i->m.count; }, { return 3; })
ACCESS(UInt32, uint32_t, { return 3; }, { return 3; })
ACCESS(Int64, int64_t,
       { if (r[k] == SUM) v[at] = i->m.small + (int64_t)i->m.wide; else if (r[k] == MODE) v[at] = i->m.mode;
         else if (r[k] == NEXT) v[at] = i->m.mode + 1; else return 3; },
       { if (r[k] != MODE) return 3; i->m.mode = v[at]; })
ACCESS(UInt64, uint64_t, { if (r[k] != WIDE) return 3; v[at] = i->m.wide; }, { if (r[k] != WIDE) return 3; i->m.wide = v[at]; })
ACCESS(Boolean, bool,
       { if (r[k] == FLAG) v[at] = i->m.flag; else if (r[k] == NOT) v[at] = !i->m.flag;
         else if (r[k] == BITS) v[at] = i->m.bits[e]; else return 3; },
       { if (r[k] == FLAG) i->m.flag = v[at]; else if (r[k] == BITS) i->m.bits[e] = v[at]; else return 3; })
typedef const char *Text;
ACCESS(String, Text,
       { if (r[k] == LABEL) v[at] = i->label; else if (r[k] == RESOURCES) v[at] = i->resources; else return 3; },
       { if (r[k] != LABEL) return 3; snprintf(i->label, sizeof i->label, "%s", v[at]); })
#define DERIVATIVE(Name, adjoint)                                                                                  \
    EXPORT int Name(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *seed,        \
                    size_t ns, double *out, size_t no) {                                                           \
        for (size_t o = 0; o < no; o++) out[o] = 0;                                                                \
        size_t row = 0;                                                                                            \
        for (size_t a = 0; a < nu; a++)                                                                            \
            for (size_t e = 0; e < size(c, u[a]); e++, row++) {                                                    \
                size_t column = 0;                                                                                 \
                for (size_t b = 0; b < nk; b++)                                                                    \
                    for (size_t f = 0; f < size(c, k[b]); f++, column++) {                                         \
                        size_t from = adjoint ? row : column;                                                      \
                        size_t to = adjoint ? column : row;                                                        \
                        if (from >= ns || to >= no) return 3;                                                      \
                        out[to] += seed[from] * partial(c, u[a], e, k[b], f) * SCALE(adjoint);                      \
                    }                                                                                              \
            }                                                                                                      \
        return 0;                                                                                                  \
    }
#ifdef ADJOINT_TWICE
#define SCALE(adjoint) (adjoint ? 2 : 1)
#else
#define SCALE(adjoint) 1
#endif
DERIVATIVE(fmi3GetDirectionalDerivative, 0)
DERIVATIVE(fmi3GetAdjointDerivative, 1)
// y depends on x, and on a variable and an element that tests choose.
#ifndef DEPENDENCY
#define DEPENDENCY 4
#endif
#ifndef ELEMENT
#define ELEMENT 1
#endif
EXPORT int fmi3GetNumberOfVariableDependencies(void *c, unsigned r, size_t *n) { (void)c; *n = r == 5 ? 2 : 0; return 0; }
EXPORT int fmi3GetVariableDependencies(void *c, unsigned r, size_t *own, unsigned *on, size_t *theirs, int *kinds, size_t n) {
    (void)c;
    if (r != 5 || n != 2) return n ? 3 : 0;
    own[0] = own[1] = theirs[0] = 1;
    on[0] = 1; on[1] = DEPENDENCY; theirs[1] = ELEMENT; kinds[0] = kinds[1] = 1;
    return 0;
}
EXPORT int fmi3DoStep(void *c, double t, double h, bool final, bool *event_needed, bool *terminate, bool *early,
                      double *reached) {
    (void)final;
    *event_needed = *terminate = *early = false;
#ifdef ENDS
    if (t > ENDS) *terminate = true;
#endif
#ifdef EARLY
    *early = true;
#endif
#ifdef LIMIT /* the longest step; a longer one ends after it with the flag SHORT and the status STATUS */
    if (h > LIMIT * (1 + 1e-9)) {
        step(c, LIMIT);
        *early = SHORT, *reached = ((Instance *)c)->m.time = t + LIMIT;
        return STATUS;
    }
#endif
#ifdef CRASH
    abort();
#endif
#ifdef EVENTS /* a step ends at an event that the importer handles */
    Instance *with_events = c;
    double part = log(with_events->m.x / 0.5) / with_events->m.k;
    if (with_events->events && part <= h) {
        with_events->m.x = 0.5;
        *event_needed = true, *early = part < h, *reached = with_events->m.time = t + part;
        return 0;
    }
#endif
#ifdef UPDATES /* the solver makes two steps; the times of the updates in parts of h are UPDATES and LAST */
    Instance *i = c;
    double times[] = {t + UPDATES * h, t + LAST * h}, at = 0;
    for (int k = 0; k < 2; k++) {
        bool returns = false;
        step(i, h / 2);
        i->m.time = t + (k + 1) * h / 2;
        if (!i->updated) continue;
        Values before = i->m;
        EFFECT;
        i->updated(i->environment, times[k], false, true, true, i->early && CAN_RETURN, &returns, &at);
        if (RESTORES) i->m = before;
        if (k == 0 && returns && !IGNORES) return *early = true, *reached = at, 0;
    }
    *reached = i->m.time;
    return 0;
#endif
    step(c, h);
    *reached = ((Instance *)c)->m.time = t + h;
    return 0;
}
EXPORT int fmi3UpdateDiscreteStates(void *c, bool *needed, bool *terminate, bool *nominals, bool *states, bool *defined,
                                    double *time) {
    int out[5];
    update(c, out);
    *needed = out[0], *terminate = out[1], *nominals = out[2], *states = out[3], *defined = out[4], *time = 0;
#ifdef EVENTS /* the effect of an event, and whether the next one is announced for the present */
    Instance *i = c;
    HANDLED;
    *defined = ANNOUNCES, *time = i->m.time;
#endif
    return 0;
}
EXPORT int fmi3CompletedIntegratorStep(void *c, bool final, bool *enter, bool *terminate) {
    (void)c, (void)final;
    *enter = *terminate = false;
    return 0;
}
EXPORT int fmi3GetNumberOfContinuousStates(void *c, size_t *n) {
    *n = 1;
#ifdef COUNTS_ELEMENTS
    *n = size(c, V) - 2;
#endif
    (void)c;
    return 0;
}
EXPORT int fmi3GetNumberOfEventIndicators(void *c, size_t *n) { (void)c; *n = 1; return 0; }
/* Not supported */
#define NONE(Name) EXPORT int fmi3##Name(void) { return 3; }
NONE(GetBinary) NONE(SetBinary) NONE(GetClock) NONE(SetClock) NONE(GetIntervalDecimal)
NONE(GetIntervalFraction) NONE(GetShiftDecimal) NONE(GetShiftFraction) NONE(SetIntervalDecimal) NONE(SetIntervalFraction)
NONE(SetShiftDecimal) NONE(SetShiftFraction) NONE(EvaluateDiscreteStates) NONE(GetOutputDerivatives)
#ifdef EVENTS
EXPORT int fmi3EnterStepMode(void *c) { (void)c; return 0; }
#else
NONE(EnterStepMode)
#endif
#ifdef RESIZED
EXPORT int fmi3EnterConfigurationMode(void *c) {
#ifdef ONLY_BEFORE_START
    if (((Instance *)c)->started) return 3;
#endif
    (void)c;
    return 0;
}
EXPORT int fmi3ExitConfigurationMode(void *c) { (void)c; return 0; }
#else
NONE(EnterConfigurationMode) NONE(ExitConfigurationMode)
#endif
#ifndef UNEXPORTED
NONE(ActivateModelPartition)
#endif
#endif
