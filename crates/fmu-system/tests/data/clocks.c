/* An FMU of FMI 3.0 for co-simulation with an output clock that ticks at events of its own, as `clocks.xml` describes it.
   `crossing` ticks in the first event after the initialization, and after a step past a multiple of 0.25 s; `time_out` is the
   time. When `trigger` ticks, `count` is incremented, and `last` becomes the input `value`. Calls that FMI 3.0.2 does not
   allow in the present state (sections 2.2.9, 2.3.5 and 4.2) are errors, as is a step without the event that it needs. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#define EXPORT __attribute__((visibility("default")))
enum { TIME, CROSSING, TRIGGER, VALUE, TIME_OUT, COUNT, LAST };
enum { INSTANTIATED, INITIALIZATION, EVENT, STEP };

typedef struct {
    int mode;
    bool is_active, fires, must_update;
    double time, value, last;
    int count;
} Instance;

static bool has_clocked(const Instance *i) {
    return i->mode == INITIALIZATION || (i->mode == EVENT && i->is_active);
}
EXPORT int fmi3GetFloat64(void *c, const unsigned *r, size_t n, double *v, size_t nv) {
    Instance *i = c;
    if (i->mode == INSTANTIATED || n != nv) return 3;
    for (size_t k = 0; k < n; k++) {
        if (r[k] == TIME || r[k] == TIME_OUT) v[k] = i->time;
        else if (r[k] == LAST && has_clocked(i)) v[k] = i->is_active ? i->value : i->last;
        else if (r[k] == VALUE && has_clocked(i)) v[k] = i->value;
        else return 3;
    }
    return 0;
}
EXPORT int fmi3SetFloat64(void *c, const unsigned *r, size_t n, const double *v, size_t nv) {
    Instance *i = c;
    if (n != nv) return 3;
    for (size_t k = 0; k < n; k++) {
        if (r[k] != VALUE || !(i->mode == INSTANTIATED || has_clocked(i))) return 3;
        i->value = v[k];
    }
    return 0;
}
EXPORT int fmi3GetInt32(void *c, const unsigned *r, size_t n, int *v, size_t nv) {
    Instance *i = c;
    if (n != 1 || nv != 1 || r[0] != COUNT || !has_clocked(i)) return 3;
    v[0] = i->count + i->is_active;
    return 0;
}
EXPORT int fmi3SetClock(void *c, const unsigned *r, size_t n, const bool *v) {
    Instance *i = c;
    if (i->mode != EVENT || n != 1 || r[0] != TRIGGER || i->is_active) return 3;
    i->is_active = i->must_update = v[0];
    return 0;
}
EXPORT int fmi3GetClock(void *c, const unsigned *r, size_t n, bool *v) {
    Instance *i = c;
    if (i->mode != EVENT || n != 1 || r[0] != CROSSING) return 3;
    v[0] = i->fires;
    return 0;
}
EXPORT int fmi3EnterEventMode(void *c) {
    Instance *i = c;
    if (i->mode != STEP) return 3;
    i->mode = EVENT;
    i->must_update = true;
    return 0;
}
EXPORT int fmi3UpdateDiscreteStates(void *c, bool *again, bool *terminate, bool *nominals, bool *states, bool *has_next,
                                    double *next) {
    Instance *i = c;
    if (i->mode != EVENT) return 3;
    if (i->is_active) i->count++, i->last = i->value;
    i->is_active = i->fires = i->must_update = false;
    *again = *terminate = *nominals = *states = *has_next = false;
    *next = 0;
    return 0;
}
EXPORT int fmi3EnterStepMode(void *c) {
    Instance *i = c;
    if (i->mode != EVENT || i->must_update) return 3;
    i->mode = STEP;
    return 0;
}
EXPORT int fmi3DoStep(void *c, double t, double h, bool final, bool *event, bool *terminate, bool *early, double *reached) {
    Instance *i = c;
    (void)final;
    if (i->mode != STEP || i->fires || fabs(t - i->time) > 1e-9) return 3;
    i->fires = floor((t + h) / 0.25 + 1e-9) > floor(t / 0.25 + 1e-9);
    *event = i->fires;
    *terminate = *early = false;
    *reached = i->time = t + h;
    return 0;
}

/* The importer loads these functions, but there are no such variables. */
#define UNUSED(name) EXPORT int name(void) { return 3; }
UNUSED(fmi3GetBoolean) UNUSED(fmi3SetBoolean) UNUSED(fmi3SetInt32) UNUSED(fmi3GetString) UNUSED(fmi3SetString)

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *required, size_t n,
                                         void *environment, void *log, void *intermediate) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)early, (void)required, (void)n;
    (void)environment, (void)log, (void)intermediate;
    return events ? calloc(1, sizeof(Instance)) : NULL;
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c, bool td, double tol, double t0, bool sd, double t1) {
    (void)td, (void)tol, (void)sd, (void)t1;
    ((Instance *)c)->mode = INITIALIZATION;
    ((Instance *)c)->time = t0;
    return 0;
}
EXPORT int fmi3ExitInitializationMode(void *c) {
    Instance *i = c;
    i->mode = EVENT;
    i->fires = i->must_update = true;
    return 0;
}
EXPORT int fmi3Terminate(void *c) { (void)c; return 0; }
EXPORT int fmi3Reset(void *c) { *(Instance *)c = (Instance){0}; return 0; }
