/* A co-simulation FMU of FMI 2.0 or 3.0 (macro FMI) that imitates habits of other tools' FMUs.
   y = k u + c, yi = ui, yb = ub, ye = ue, ys = "file:us". Without a habit, `check` finds nothing.
   The parameter `habit` selects the habit, which acts in every step that ends at the time `at` or later. The macros HABIT, AT
   and TARGET are the start values of `habit`, `at` and `file`; habits of instantiation need HABIT. zoo.rs builds the FMU, and
   takes the names of the habits from the list below. */
#define _GNU_SOURCE
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#define EXPORT __attribute__((visibility("default")))

enum {
    habit_none,
    habit_error,          /* fmi2Error, with a message that has arguments */
    habit_discard,        /* fmi2Discard, without ending the simulation */
    habit_end,            /* makes the step and ends the simulation */
    habit_end_before,     /* ends the simulation at the start of this step */
    habit_strict,         /* rejects a step beyond the stop time */
    habit_nan,            /* y is NaN */
    habit_crash,          /* SIGSEGV */
    habit_hang,           /* never returns */
    habit_stranger,       /* logs with an environment that is not the importer's */
    habit_stranger_start, /* the same as habit_stranger, during instantiation */
    habit_chatter,        /* prints 500 lines during instantiation */
    habit_talk,           /* logs 500 messages in a step */
    habit_fork,           /* leaves a process behind */
    habit_write,          /* writes the file `file` */
    habit_round,          /* changes the rounding mode */
    habit_locale,         /* changes the locale */
    habit_umask,          /* changes the umask */
    habit_folder,         /* changes the working directory */
    habit_environment,    /* sets an environment variable */
    habit_reset_crash,    /* SIGSEGV in a reset before initialization; needs HABIT */
    habit_reset_nothing,  /* does nothing in a reset; needs HABIT */
    habit_traps,          /* unmasks the trap for divisions by zero, which then end the process */
    habit_daemon,         /* leaves a process behind that is in another session and has no parent */
    habit_daemon_hang,    /* the same, and never returns */
    habit_daemon_crash,   /* the same, and raises SIGSEGV */
    habit_copy,           /* forks the process, and both continue */
    habit_program,        /* starts the program `file` */
    habit_network,        /* opens a socket */
    habit_signal,         /* sends a signal to the parent process */
    habit_attributes,     /* makes the file `file` executable */
    habit_private,        /* uses allowed resources: a temporary file, a thread, a pipe, a signal to itself */
    habit_memory,         /* allocates memory without limit */
    habit_crash_strict,   /* SIGSEGV; before that, rejects termination */
    habit_chain,          /* leaves a process behind that repeatedly forks into another session and exits */
    habit_guards,         /* leaves a process behind whose child starts the next one when it ends */
    habit_headless,       /* leaves a process behind whose first thread has ended */
    habit_remove,         /* removes the working directory */
    habit_shared,         /* attaches memory that is shared with other programs */
    habit_schedule,       /* changes the priority of the parent process */
    habit_unpack,         /* makes a temporary file executable */
    habit_deep,           /* takes 400 kB of stack */
    habit_end_crash,      /* SIGSEGV in the termination */
    habit_free_crash,     /* SIGSEGV when the instance is freed */
    habit_status,         /* returns a number that is not a status */
};
#ifndef HABIT
#define HABIT habit_none
#endif
#ifndef AT
#define AT 1e9
#endif
#ifndef TARGET
#define TARGET "none"
#endif

enum { TIME, U, Y, K, C, AT_TIME, CHOICE, UI, YI, UB, YB, UE, YE, TO_FILE, US, YS };
enum { OK, WARNING, DISCARD, ERROR };

typedef struct {
    double time, u, k, c, at, stop, reached;
    int habit, ui, ub, ue, ended, has_forked, is_initialized;
    char file[512], us[512], ys[1100];
    void *environment;
    void (*log)(void);
} Instance;

static void say(Instance *i, void *environment, int status, const char *format, ...);

static void start(Instance *i) {
    Instance fresh = {.k = 1, .at = AT, .stop = INFINITY, .habit = HABIT, .ue = 1, .file = TARGET};
    fresh.environment = i->environment;
    fresh.log = i->log;
    *i = fresh;
}
/* A separate function, because the other habits must not use this much stack. */
static __attribute__((noinline)) void go_deep(void) {
    volatile char room[400000];
    for (size_t j = 0; j < sizeof room; j += 1000) room[j] = 1;
}

/* An access fault. A raise(SIGSEGV) is not enough, because the signal handler of a host in Rust returns from it. */
static void crash(void) { *(volatile int *)8 = 1; }
static int reset(Instance *i) {
    if (HABIT == habit_reset_crash && !i->is_initialized) crash();
    if (HABIT != habit_reset_nothing) start(i);
    return OK;
}
static Instance *instantiate(void *environment, void (*log)(void)) {
    Instance *i = calloc(1, sizeof *i);
    i->environment = environment;
    i->log = log;
    start(i);
    if (i->habit == habit_stranger_start) say(i, (void *)1, WARNING, "an environment that is not the importer's");
    for (int k = 0; k < 500 && i->habit == habit_chatter; k++) printf("line %d of a banner\n", k + 1);
    fflush(stdout);
    return i;
}

static void *in_a_thread(void *unused) {
    id_t thread = (id_t)syscall(SYS_gettid);
    return setpriority(PRIO_PROCESS, thread, getpriority(PRIO_PROCESS, thread)) ? "" : unused;
}
static void *sleeping(void *unused) { sleep(300); return unused; }
static int use_what_it_may(void) {
    pthread_t thread;
    void *problem;
    int ends[2];
    char path[600];
    snprintf(path, sizeof path, "%s/zoo", getenv("TMPDIR"));
    FILE *f = fopen(path, "w");
    if (!f || fputs("written by an FMU", f) < 0 || fclose(f) || remove(path)) return 1;
    f = fopen("/dev/null", "w");
    if (!f || fclose(f)) return 2;
    if (pthread_create(&thread, NULL, in_a_thread, NULL) || pthread_join(thread, &problem) || problem) return 3;
    if (pipe(ends) || close(ends[0]) || close(ends[1])) return 4;
    return raise(SIGCONT);
}

/* Makes a step from t to t + h; sets `ended` to 1 if the simulation is to end. */
static int step(Instance *i, double t, double h) {
    if (i->habit == habit_strict && t + h > i->stop) {
        say(i, i->environment, ERROR, "%.17g s is beyond the stop time %.17g s", t + h, i->stop);
        return ERROR;
    }
    i->reached = t;
    if (t + h >= i->at - 1e-9) switch (i->habit) {
    case habit_error:
        say(i, i->environment, ERROR, "it broke at %g with %d of %s", t, 7, "nine");
        return ERROR;
    case habit_discard: return DISCARD;
    case habit_end: i->time = i->reached = t + h; i->ended = 1; return DISCARD;
    case habit_end_before: i->ended = 1; return DISCARD;
    case habit_crash: case habit_crash_strict: crash(); break;
    case habit_hang: for (;;) pause();
    case habit_stranger: say(i, (void *)1, WARNING, "an environment that is not the importer's"); break;
    case habit_talk:
        for (int k = 0; k < 500; k++) say(i, i->environment, WARNING, "message %d", k + 1);
        break;
    case habit_fork:
        if (!i->has_forked && fork() == 0) { sleep(300); _exit(0); }
        i->has_forked = 1;
        break;
    case habit_write: {
        FILE *f = fopen(i->file, "w");
        if (!f) break;
        fputs("written by an FMU", f);
        fclose(f);
        break;
    }
    case habit_round: fesetround(FE_UPWARD); break;
    case habit_locale: setlocale(LC_ALL, "C.UTF-8"); break;
    case habit_umask: umask(0077); break;
    case habit_folder: if (chdir("/")) return ERROR; break;
    case habit_environment: setenv("ZOO", "1", 1); break;
    case habit_traps: feenableexcept(FE_DIVBYZERO); break;
    case habit_daemon: case habit_daemon_hang: case habit_daemon_crash:
        if (!i->has_forked && fork() == 0) {
            setsid();
            if (fork() == 0) sleep(300);
            _exit(0);
        }
        i->has_forked = 1;
        while (i->habit == habit_daemon_hang) pause();
        if (i->habit == habit_daemon_crash) raise(SIGSEGV);
        break;
    case habit_copy:
        if (!i->has_forked) fork();
        i->has_forked = 1;
        break;
    case habit_chain:
        if (!i->has_forked && fork() == 0) {
            for (time_t end = time(NULL) + 300; time(NULL) < end && !fork();) setsid();
            _exit(0);
        }
        i->has_forked = 1;
        break;
    case habit_guards:
        if (!i->has_forked && fork() == 0) {
            for (time_t end = time(NULL) + 300; time(NULL) < end;) {
                pid_t parent = getpid();
                setsid();
                if (fork()) pause();
                while (getppid() == parent) usleep(100);
            }
            _exit(0);
        }
        i->has_forked = 1;
        break;
    case habit_headless:
        if (!i->has_forked && fork() == 0) {
            pthread_t thread;
            pthread_create(&thread, NULL, sleeping, NULL);
            syscall(SYS_exit, 0);
        }
        i->has_forked = 1;
        break;
    case habit_remove: { char path[600]; if (getcwd(path, sizeof path)) rmdir(path); break; }
    case habit_shared: { void *p = shmat(-1, NULL, SHM_RDONLY); if (p != (void *)-1) shmdt(p); break; }
    case habit_schedule: setpriority(PRIO_PROCESS, (id_t)getppid(), getpriority(PRIO_PROCESS, (id_t)getppid())); break;
    case habit_unpack: {
        char path[600];
        snprintf(path, sizeof path, "%s/zoo", getenv("TMPDIR"));
        FILE *f = fopen(path, "w");
        if (!f) return ERROR;
        fchmod(fileno(f), 0755);
        fclose(f);
        chmod(path, 0755);
        break;
    }
    case habit_program: {
        /* Like system(): the program ends before the step does. */
        pid_t program = fork();
        if (program == 0) { execl(i->file, i->file, (char *)NULL); _exit(0); }
        if (program > 0) waitpid(program, NULL, 0);
        break;
    }
    case habit_deep: go_deep(); break;
    case habit_status: return -1;
    case habit_network: { int s = socket(AF_INET, SOCK_STREAM, 0); if (s >= 0) close(s); break; }
    case habit_signal: kill(getppid(), SIGCONT); break;
    case habit_attributes: chmod(i->file, 0755); break;
    case habit_private: if (use_what_it_may()) return ERROR; break;
    case habit_memory: for (;;) { char *p = malloc(1 << 24); if (!p) abort(); memset(p, 1, 1 << 24); } break;
    }
    i->time = i->reached = t + h;
    return OK;
}
static int get_real(Instance *i, unsigned r, double *v) {
    switch (r) {
    case TIME: *v = i->time; return OK;
    case U: *v = i->u; return OK;
    case Y: *v = i->habit == habit_nan && i->time >= i->at - 1e-9 ? NAN : i->k * i->u + i->c; return OK;
    case K: *v = i->k; return OK;
    case C: *v = i->c; return OK;
    case AT_TIME: *v = i->at; return OK;
    default: return ERROR;
    }
}
static int set_real(Instance *i, unsigned r, double v) {
    switch (r) {
    case U: i->u = v; return OK;
    case K: i->k = v; return OK;
    case C: i->c = v; return OK;
    case AT_TIME: i->at = v; return OK;
    default: return ERROR;
    }
}
static int get_integer(Instance *i, unsigned r, int *v) {
    switch (r) {
    case CHOICE: *v = i->habit; return OK;
    case UI: case YI: *v = i->ui; return OK;
    case UB: case YB: *v = i->ub; return OK;
    case UE: case YE: *v = i->ue; return OK;
    default: return ERROR;
    }
}
static int set_integer(Instance *i, unsigned r, int v) {
    switch (r) {
    case CHOICE: i->habit = v; return OK;
    case UI: i->ui = v; return OK;
    case UB: i->ub = v; return OK;
    /* This enumeration has gaps between its values. */
    case UE: if (v != 1 && v != 2 && v != 5) return ERROR; i->ue = v; return OK;
    default: return ERROR;
    }
}
static int get_string(Instance *i, unsigned r, const char **v) {
    snprintf(i->ys, sizeof i->ys, "%s:%s", i->file, i->us);
    *v = r == TO_FILE ? i->file : r == US ? i->us : i->ys;
    return r >= TO_FILE ? OK : ERROR;
}
static int set_string(Instance *i, unsigned r, const char *v) {
    if (r != TO_FILE && r != US) return ERROR;
    snprintf(r == US ? i->us : i->file, sizeof i->us, "%s", v);
    return OK;
}
#define COMMON(Name)                                                             \
    EXPORT void Name##FreeInstance(void *c) {                                     \
        if (((Instance *)c)->habit == habit_free_crash) crash();                 \
        free(c);                                                                 \
    }                                                                            \
    EXPORT int Name##ExitInitializationMode(void *c) {                            \
        ((Instance *)c)->is_initialized = 1;                                     \
        return OK;                                                               \
    }                                                                            \
    EXPORT int Name##Terminate(void *c) {                                         \
        if (((Instance *)c)->habit == habit_end_crash) crash();                  \
        return ((Instance *)c)->habit == habit_crash_strict ? ERROR : OK;         \
    }                                                                            \
    EXPORT int Name##Reset(void *c) { return reset(c); }
#define NONE(Name) EXPORT int Name(void) { return ERROR; }

#if FMI == 2
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *step_finished, *environment;
} Callbacks;
COMMON(fmi2)
static void say(Instance *i, void *environment, int status, const char *format, ...) {
    /* All messages have the same kinds of arguments, numbers first, so the calls below pass what the format reads. */
    va_list list;
    va_start(list, format);
    Logger log = (Logger)i->log;
    const char *category = status == ERROR ? "error" : "warning";
    if (strstr(format, "of %s")) {
        double t = va_arg(list, double);
        int n = va_arg(list, int);
        log(environment, "zoo", status, category, format, t, n, va_arg(list, const char *));
    } else if (strstr(format, "%.17g")) {
        double t = va_arg(list, double);
        log(environment, "zoo", status, category, format, t, va_arg(list, double));
    } else if (strstr(format, "%d")) {
        log(environment, "zoo", status, category, format, va_arg(list, int));
    } else {
        log(environment, "zoo", status, category, format);
    }
    va_end(list);
}
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks,
                             int visible, int logging) {
    (void)name, (void)resources, (void)visible, (void)logging;
    return type == 1 && strcmp(guid, "{zoo}") == 0 ? instantiate(callbacks->environment, (void (*)(void))callbacks->logger) : NULL;
}
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *s) { (void)c, (void)on, (void)n, (void)s; return OK; }
EXPORT int fmi2SetupExperiment(void *c, int td, double tol, double t0, int sd, double t1) {
    (void)td, (void)tol;
    ((Instance *)c)->time = t0;
    ((Instance *)c)->stop = sd ? t1 : INFINITY;
    return OK;
}
EXPORT int fmi2EnterInitializationMode(void *c) { (void)c; return OK; }
#define ACCESS(Kind, type, constant, get, set)                                                                                \
    EXPORT int fmi2Get##Kind(void *c, const unsigned *r, size_t n, type *v) {                                                  \
        for (size_t k = 0; k < n; k++) if (get(c, r[k], &v[k])) return ERROR;                                                  \
        return OK;                                                                                                            \
    }                                                                                                                         \
    EXPORT int fmi2Set##Kind(void *c, const unsigned *r, size_t n, constant v) {                                               \
        for (size_t k = 0; k < n; k++) if (set(c, r[k], v[k])) return ERROR;                                                   \
        return OK;                                                                                                            \
    }
ACCESS(Real, double, const double *, get_real, set_real)
ACCESS(Integer, int, const int *, get_integer, set_integer)
ACCESS(Boolean, int, const int *, get_integer, set_integer)
ACCESS(String, const char *, const char *const *, get_string, set_string)
EXPORT int fmi2DoStep(void *c, double t, double h, int final) { (void)final; return step(c, t, h); }
EXPORT int fmi2CancelStep(void *c) { (void)c; return ERROR; }
EXPORT int fmi2GetRealStatus(void *c, int kind, double *v) { *v = ((Instance *)c)->reached; return kind == 2 ? OK : DISCARD; }
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *v) { *v = ((Instance *)c)->ended; return kind == 3 ? OK : DISCARD; }
NONE(fmi2GetStatus) NONE(fmi2GetIntegerStatus) NONE(fmi2GetStringStatus)
NONE(fmi2SetRealInputDerivatives) NONE(fmi2GetRealOutputDerivatives) NONE(fmi2GetDirectionalDerivative)
NONE(fmi2GetFMUstate) NONE(fmi2SetFMUstate) NONE(fmi2FreeFMUstate)
NONE(fmi2SerializedFMUstateSize) NONE(fmi2SerializeFMUstate) NONE(fmi2DeSerializeFMUstate)
#else
typedef void (*LogMessage)(void *, int, const char *, const char *);
COMMON(fmi3)
static void say(Instance *i, void *environment, int status, const char *format, ...) {
    char text[500];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    ((LogMessage)i->log)(environment, status, status == ERROR ? "error" : "warning", text);
}
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool events, bool early, const unsigned *required, size_t n, void *environment,
                                         LogMessage log, void *intermediate) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)n, (void)intermediate;
    return strcmp(token, "{zoo}") == 0 ? instantiate(environment, (void (*)(void))log) : NULL;
}
EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
EXPORT int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const *s) { (void)c, (void)on, (void)n, (void)s; return OK; }
EXPORT int fmi3EnterInitializationMode(void *c, bool td, double tol, double t0, bool sd, double t1) {
    (void)td, (void)tol;
    ((Instance *)c)->time = t0;
    ((Instance *)c)->stop = sd ? t1 : INFINITY;
    return OK;
}
#define ACCESS(Kind, type, constant, number, get, set)                                                                        \
    EXPORT int fmi3Get##Kind(void *c, const unsigned *r, size_t n, type *v, size_t m) {                                        \
        number x;                                                                                                             \
        if (n != m) return ERROR;                                                                                             \
        for (size_t k = 0; k < n; k++) {                                                                                      \
            if (get(c, r[k], &x)) return ERROR;                                                                               \
            v[k] = x;                                                                                                         \
        }                                                                                                                     \
        return OK;                                                                                                            \
    }                                                                                                                         \
    EXPORT int fmi3Set##Kind(void *c, const unsigned *r, size_t n, constant v, size_t m) {                                     \
        if (n != m) return ERROR;                                                                                             \
        for (size_t k = 0; k < n; k++) if (set(c, r[k], v[k])) return ERROR;                                                   \
        return OK;                                                                                                            \
    }
ACCESS(Float64, double, const double *, double, get_real, set_real)
ACCESS(Int32, int32_t, const int32_t *, int, get_integer, set_integer)
ACCESS(Int64, int64_t, const int64_t *, int, get_integer, set_integer)
ACCESS(Boolean, bool, const bool *, int, get_integer, set_integer)
ACCESS(String, const char *, const char *const *, const char *, get_string, set_string)
EXPORT int fmi3DoStep(void *c, double t, double h, bool final, bool *event_needed, bool *terminate, bool *early, double *reached) {
    Instance *i = c;
    (void)final;
    int status = step(i, t, h);
    *event_needed = *early = false;
    *terminate = i->ended;
    *reached = i->reached;
    return i->ended ? OK : status;
}
NONE(fmi3GetFloat32) NONE(fmi3SetFloat32) NONE(fmi3GetInt8) NONE(fmi3SetInt8) NONE(fmi3GetUInt8) NONE(fmi3SetUInt8)
NONE(fmi3GetInt16) NONE(fmi3SetInt16) NONE(fmi3GetUInt16) NONE(fmi3SetUInt16) NONE(fmi3GetUInt32) NONE(fmi3SetUInt32)
NONE(fmi3GetUInt64) NONE(fmi3SetUInt64) NONE(fmi3GetBinary) NONE(fmi3SetBinary) NONE(fmi3GetClock) NONE(fmi3SetClock)
NONE(fmi3GetNumberOfVariableDependencies) NONE(fmi3GetVariableDependencies) NONE(fmi3GetFMUState) NONE(fmi3SetFMUState)
NONE(fmi3FreeFMUState) NONE(fmi3SerializedFMUStateSize) NONE(fmi3SerializeFMUState) NONE(fmi3DeserializeFMUState)
NONE(fmi3GetDirectionalDerivative) NONE(fmi3GetAdjointDerivative) NONE(fmi3EnterConfigurationMode)
NONE(fmi3ExitConfigurationMode) NONE(fmi3GetIntervalDecimal) NONE(fmi3GetIntervalFraction) NONE(fmi3GetShiftDecimal)
NONE(fmi3GetShiftFraction) NONE(fmi3SetIntervalDecimal) NONE(fmi3SetIntervalFraction) NONE(fmi3SetShiftDecimal)
NONE(fmi3SetShiftFraction) NONE(fmi3EvaluateDiscreteStates) NONE(fmi3UpdateDiscreteStates) NONE(fmi3EnterContinuousTimeMode)
NONE(fmi3CompletedIntegratorStep) NONE(fmi3SetTime) NONE(fmi3SetContinuousStates) NONE(fmi3GetContinuousStateDerivatives)
NONE(fmi3GetEventIndicators) NONE(fmi3GetContinuousStates) NONE(fmi3GetNominalsOfContinuousStates)
NONE(fmi3GetNumberOfEventIndicators) NONE(fmi3GetNumberOfContinuousStates) NONE(fmi3EnterStepMode) NONE(fmi3EnterEventMode)
NONE(fmi3GetOutputDerivatives) NONE(fmi3ActivateModelPartition)
#endif
