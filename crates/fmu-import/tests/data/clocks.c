/* A small hand-written FMU of FMI 3.0 with clocks, for co-simulation and scheduled execution.
   Value references: 0 time, 1 every (constant, 0.5 s from 0.25 s on, priority 2), 2 timer (countdown, priority 0, can be
   deactivated), 3 varying (changing, priority 1), 4 asked (triggered, priority 3), 5 third (output), 6 u (input of
   asked), 7 sum (output of asked: adds gain u), 8 ticks (output of all input clocks), 9 gain (tunable parameter),
   10 kept (the reference of the last clock that ticked, an output without clocks).
   Every third tick of `every` makes `third` tick and starts `timer` with an interval of 0. Each tick of `varying` sets
   0.3 s and 0.7 s in turn. Each of the macros causes a defect. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))

enum { TIME, EVERY, TIMER, VARYING, ASKED, THIRD, U, SUM, TICKS, GAIN, KEPT, VARIABLES };
enum { INSTANTIATED, INITIALIZATION, EVENT, STEP, ACTIVATION, UPDATE };
enum { NOT_YET_KNOWN, UNCHANGED, CHANGED };

typedef struct {
    double time, u, sum, gain, interval[5], last[5];
    int32_t ticks, count, kept;
    bool active[6], started, announced[5];
} Values;
typedef struct {
    Values now, before;
    int mode, is_scheduled;
    bool is_evaluated;
    void *environment;
    void (*clock_update)(void *), (*lock)(void), (*unlock)(void);
} Instance;
static int instances;

static void start(Instance *i) {
    Values values = {.gain = 2, .interval = {0, 0.5, 0, 0.3, 0}, .last = {-1, -1, -1, -1, -1}};
    i->now = i->before = values;
    i->mode = INSTANTIATED;
    i->is_evaluated = false;
}
/* One tick of an input clock. */
static void tick(Instance *i, unsigned clock) {
    Values *now = &i->now;
    now->ticks++;
    now->kept = (int32_t)clock;
#ifdef NOT_DETERMINISTIC
    now->ticks += instances % 2;
#endif
    if (clock == EVERY && ++now->count % 3 == 0) {
        now->active[THIRD] = true;
        now->started = true;
        now->interval[TIMER] = 0;
#ifdef OTHER_TIMES
        now->interval[TIMER] = 0.01 * instances;
#endif
    }
#ifdef ENDLESS
    if (clock == TIMER) now->started = true;
#endif
    if (clock == VARYING) now->interval[VARYING] = 1 - now->interval[VARYING], now->announced[VARYING] = false;
    if (clock == ASKED) now->sum += now->gain * now->u;
}
/* Evaluates the active clocks from the state before the event. */
static void evaluate(Instance *i) {
    if (i->mode != EVENT || i->is_evaluated) return;
    i->is_evaluated = true;
    Values given = i->now;
    i->now = i->before;
    i->now.time = given.time, i->now.u = given.u, i->now.gain = given.gain;
    memcpy(i->now.active, given.active, sizeof given.active);
    i->now.active[THIRD] = false;
    for (unsigned clock = EVERY; clock <= ASKED; clock++)
        if (given.active[clock]) tick(i, clock);
}
static bool is_active(const Instance *i, unsigned r) {
    if (r == U || r == SUM) return i->now.active[ASKED];
    const bool *a = i->now.active;
    return r != TICKS || a[EVERY] || a[TIMER] || a[VARYING] || a[ASKED];
}
static bool may_access(const Instance *i, unsigned r, bool sets) {
    if (i->mode == INITIALIZATION || i->mode == INSTANTIATED || i->mode == ACTIVATION) return true;
    if (i->mode == UPDATE) return false;
#ifdef GETS_ANY
    if (!sets) return true;
#endif
#ifdef SETS_ANY
    if (sets) return true;
#endif
    (void)sets;
    return (r != U && r != SUM && r != TICKS) || (i->mode == EVENT && is_active(i, r));
}

typedef void (*LogMessage)(void *, int, const char *, const char *);
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
static Instance *instantiate(const char *token, void *environment) {
    if (strcmp(token, "{clocks}") != 0) return NULL;
    Instance *i = calloc(1, sizeof *i);
    start(i);
    i->environment = environment;
    instances++;
    return i;
}
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *required, size_t n,
                                         void *environment, LogMessage log, void *intermediate) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)early, (void)required, (void)n, (void)log, (void)intermediate;
    return events ? instantiate(token, environment) : NULL;
}
EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, LogMessage log,
                                               void (*clock_update)(void *), void (*lock)(void), void (*unlock)(void)) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)log;
    Instance *i = instantiate(token, environment);
    if (i) i->is_scheduled = 1, i->clock_update = clock_update, i->lock = lock, i->unlock = unlock;
    return i;
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const *s) { (void)c, (void)on, (void)n, (void)s; return 0; }
EXPORT int fmi3EnterInitializationMode(void *c, bool td, double tol, double t0, bool sd, double t1) {
    (void)td, (void)tol, (void)sd, (void)t1;
    Instance *i = c;
    i->now.time = t0;
    i->mode = INITIALIZATION;
    return 0;
}
EXPORT int fmi3ExitInitializationMode(void *c) {
    Instance *i = c;
    i->mode = i->is_scheduled ? ACTIVATION : EVENT;
    i->before = i->now;
    return 0;
}
EXPORT int fmi3Terminate(void *c) { (void)c; return 0; }
EXPORT int fmi3Reset(void *c) { start(c); return 0; }
EXPORT int fmi3EnterEventMode(void *c) {
    Instance *i = c;
    i->mode = EVENT;
    i->before = i->now;
    i->is_evaluated = false;
    return 0;
}
EXPORT int fmi3EnterStepMode(void *c) { ((Instance *)c)->mode = STEP; return 0; }
EXPORT int fmi3DoStep(void *c, double t, double h, bool final, bool *event_needed, bool *terminate, bool *early,
                      double *reached) {
    (void)final;
    Instance *i = c;
    *event_needed = *terminate = *early = false;
    *reached = i->now.time = t + h;
    return i->mode == STEP ? 0 : 3;
}
EXPORT int fmi3UpdateDiscreteStates(void *c, bool *needed, bool *terminate, bool *nominals, bool *states, bool *defined,
                                    double *time) {
    Instance *i = c;
    *needed = *terminate = *nominals = *states = *defined = false, *time = 0;
    if (i->mode != EVENT) return 3;
    evaluate(i);
    memset(i->now.active, 0, sizeof i->now.active);
    i->before = i->now;
    i->is_evaluated = false;
    return 0;
}
EXPORT int fmi3SetClock(void *c, const unsigned *r, size_t n, const bool *v) {
    Instance *i = c;
#ifdef CLOCKS_IN_STEP
    if (i->mode == STEP) return 0;
#endif
#ifdef SCHEDULED_SET_CLOCK
    if (i->mode == ACTIVATION) return 0;
#endif
    if (i->mode != EVENT) return 3;
    for (size_t k = 0; k < n; k++) {
#ifndef SETS_OUTPUT_CLOCK
        if (r[k] == THIRD) return 3;
#endif
#ifndef DEACTIVATES_ALL
        if (!v[k] && r[k] != TIMER) return 3;
#endif
#ifdef NOT_DEACTIVATED
        if (!v[k]) return 3;
#endif
#ifdef STAYS_ACTIVE
        if (!v[k]) continue;
#endif
        i->now.active[r[k]] = v[k];
    }
    i->is_evaluated = false;
    return 0;
}
EXPORT int fmi3GetClock(void *c, const unsigned *r, size_t n, bool *v) {
    Instance *i = c;
    if (i->mode != EVENT && i->mode != UPDATE && i->mode != ACTIVATION) return 3;
    evaluate(i);
    for (size_t k = 0; k < n; k++) {
        v[k] = i->now.active[r[k]];
        if (i->is_scheduled) i->now.active[r[k]] = false;
    }
    return 0;
}
EXPORT int fmi3GetIntervalDecimal(void *c, const unsigned *r, size_t n, double *v, int *q) {
    Instance *i = c;
    for (size_t k = 0; k < n; k++) {
        v[k] = i->now.interval[r[k]];
        if (r[k] == TIMER) {
            q[k] = i->now.started ? CHANGED : NOT_YET_KNOWN;
#ifdef COUNTDOWN_UNCHANGED
            q[k] = i->now.started ? CHANGED : UNCHANGED;
#endif
            i->now.started = i->before.started = false;
        } else if (r[k] == VARYING) {
            q[k] = i->now.announced[VARYING] ? UNCHANGED : CHANGED;
#ifdef CHANGING_UNCHANGED
            if (i->now.ticks > 0) q[k] = UNCHANGED;
#endif
            i->now.announced[VARYING] = i->before.announced[VARYING] = true;
        } else {
            q[k] = UNCHANGED;
#ifdef QUALIFIER
            q[k] = QUALIFIER;
#endif
#ifdef INTERVAL
            v[k] = INTERVAL;
#endif
#ifdef NO_INTERVAL
            return 3;
#endif
        }
    }
    return 0;
}
EXPORT int fmi3SetIntervalDecimal(void *c, const unsigned *r, size_t n, const double *v) {
    (void)c, (void)r, (void)n, (void)v;
#ifdef SETS_INTERVALS
    return 0;
#endif
    return 3;
}
#ifndef SHIFT
#define SHIFT 0.25
#endif
EXPORT int fmi3GetShiftDecimal(void *c, const unsigned *r, size_t n, double *v) {
    (void)c;
    for (size_t k = 0; k < n; k++) {
        if (r[k] != EVERY) return 3;
        v[k] = SHIFT;
    }
    return 0;
}
EXPORT int fmi3ActivateModelPartition(void *c, unsigned clock, double time) {
    Instance *i = c;
    if (i->mode != ACTIVATION) return 3;
#ifndef ACTIVATES_OUTPUTS
    if (clock < EVERY || clock > ASKED) return 3;
#else
    if (clock == THIRD) return 0;
#endif
#ifndef SAME_TIME
    if (time == i->now.last[clock]) return 3;
#endif
#ifndef EARLIER_TIME
    if (time < i->now.last[clock]) return 3;
#endif
    i->lock();
    i->now.last[clock] = i->now.time = time;
    tick(i, clock);
    i->before = i->now;
#ifndef LOCKED
    i->unlock();
#endif
#ifndef NO_CLOCK_UPDATE
#ifdef OTHER_ENVIRONMENT
    i->environment = NULL;
#endif
    if (i->now.active[THIRD] || i->now.started) {
        i->mode = UPDATE;
        i->clock_update(i->environment);
        i->mode = ACTIVATION;
    }
#endif
    return 0;
}
EXPORT int fmi3GetFloat64(void *c, const unsigned *r, size_t n, double *v, size_t nv) {
    Instance *i = c;
    (void)nv;
    for (size_t k = 0; k < n; k++) {
        if (!may_access(i, r[k], false)) return 3;
        evaluate(i);
        v[k] = r[k] == TIME ? i->now.time : r[k] == U ? i->now.u : r[k] == SUM ? i->now.sum : i->now.gain;
        if (r[k] == TIME || r[k] == U || r[k] == SUM || r[k] == GAIN) continue;
        return 3;
    }
    return 0;
}
EXPORT int fmi3SetFloat64(void *c, const unsigned *r, size_t n, const double *v, size_t nv) {
    Instance *i = c;
    (void)nv;
    for (size_t k = 0; k < n; k++) {
        if (!may_access(i, r[k], true) || (r[k] != U && r[k] != GAIN)) return 3;
        *(r[k] == U ? &i->now.u : &i->now.gain) = v[k];
        i->is_evaluated = false;
    }
    return 0;
}
EXPORT int fmi3GetInt32(void *c, const unsigned *r, size_t n, int32_t *v, size_t nv) {
    Instance *i = c;
    (void)nv;
    for (size_t k = 0; k < n; k++) {
        if (!may_access(i, r[k], false) || (r[k] != TICKS && r[k] != KEPT)) return 3;
        evaluate(i);
        v[k] = r[k] == TICKS ? i->now.ticks : i->now.kept;
    }
    return 0;
}
EXPORT int fmi3GetFMUState(void *c, void **s) {
    if (!*s) *s = malloc(sizeof(Instance));
    memcpy(*s, c, sizeof(Instance));
    return 0;
}
EXPORT int fmi3SetFMUState(void *c, void *s) {
    Instance *i = c;
    if (!s) return 3;
    Instance saved = *(Instance *)s;
#ifdef FORGETS_EVENT
    if (i->mode == EVENT) saved.before.count = i->before.count + 1, saved.is_evaluated = false;
#endif
    *i = saved;
    return 0;
}
EXPORT int fmi3FreeFMUState(void *c, void **s) { (void)c; free(*s); *s = NULL; return 0; }
/* Not supported */
#define NONE(Name) EXPORT int fmi3##Name(void) { return 3; }
NONE(SetInt32) NONE(GetBoolean) NONE(SetBoolean) NONE(GetString) NONE(SetString) NONE(GetFloat32) NONE(SetFloat32)
NONE(GetInt8) NONE(SetInt8) NONE(GetUInt8) NONE(SetUInt8) NONE(GetInt16) NONE(SetInt16) NONE(GetUInt16) NONE(SetUInt16)
NONE(GetUInt32) NONE(SetUInt32) NONE(GetInt64) NONE(SetInt64) NONE(GetUInt64) NONE(SetUInt64) NONE(GetBinary)
NONE(SetBinary) NONE(SerializedFMUStateSize) NONE(SerializeFMUState) NONE(DeserializeFMUState)
NONE(GetDirectionalDerivative) NONE(GetAdjointDerivative) NONE(EnterConfigurationMode) NONE(ExitConfigurationMode)
NONE(GetNumberOfVariableDependencies) NONE(GetVariableDependencies) NONE(GetIntervalFraction) NONE(GetShiftFraction)
NONE(SetIntervalFraction) NONE(SetShiftDecimal) NONE(SetShiftFraction) NONE(EvaluateDiscreteStates)
NONE(GetOutputDerivatives) NONE(SetTime) NONE(SetContinuousStates) NONE(GetContinuousStates)
NONE(GetContinuousStateDerivatives) NONE(GetEventIndicators) NONE(GetNominalsOfContinuousStates)
NONE(EnterContinuousTimeMode) NONE(CompletedIntegratorStep) NONE(GetNumberOfContinuousStates)
NONE(GetNumberOfEventIndicators)
EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
