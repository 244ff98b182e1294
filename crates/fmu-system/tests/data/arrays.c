/* An FMU of FMI 3.0 for co-simulation with arrays, wide integers and Binaries, as `arrays.xml` describes them. Each array is
   transferred as a whole, or the call is an error.
   t = (m k)', element by element; sum is that of t; g = 2 f; no = not b; v = -w; so = s; uo = up; qo = q; eo = e; xo is x
   with its bytes in reverse order; po = p; ys is xs with its elements swapped; ls are the lengths of names. The pointer of a Binary is valid until the next call. Each of the macros causes a
   defect. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))
enum { TIME, N, M, T, K, F, G, B, NO, W, V, S, SO, UP, UO, Q, QO, E, EO, SUM, X, XO, P, PO, XS, YS, NAMES, LS };

typedef struct {
    double time, m[6], k[6];
    float f[2];
    bool b[70];
    int64_t w[3], s;
    uint64_t up;
    int32_t q;
    int8_t e[2];
    size_t sizes[4];
    uint8_t bytes[4][16], answer[16];
    char names[2][16];
    const uint8_t *lent;
    bool has_entered;
} Instance;

static size_t size(unsigned r) {
    switch (r) {
    case M: case T: case K: return 6;
    case F: case G: case E: case EO: case XS: case YS: case NAMES: case LS: return 2;
    case B: case NO: return 70;
    case W: case V: return 3;
    default: return 1;
    }
}
static void start(Instance *i) {
    *i = (Instance){.m = {1, 2, 3, 4, 5, 6}, .k = {1, 1, 1, 1, 1, 1}, .s = 1, .up = 5000000000u, .e = {1, 2},
                    .sizes = {3, 0, 1, 2}, .bytes = {"foo", "", "1", "22"}, .names = {"a", "bc"}};
}
static double transposed(const Instance *i, size_t e) {
    size_t place = e % 2 * 3 + e / 2;
    return i->m[place] * i->k[place];
}
static double sum(const Instance *i) {
    double sum = 0;
    for (size_t e = 0; e < 6; e++) sum += transposed(i, e);
    return sum;
}
#define ACCESS(Name, in, out, get, set)                                                   \
    EXPORT int fmi3Get##Name(void *c, const unsigned *r, size_t n, out *v, size_t nv) {   \
        Instance *i = c;                                                                  \
        size_t at = 0;                                                                    \
        (void)i, (void)v;                                                                 \
        if (!i->has_entered) return 3; /* FMI 3.0.2, section 2.3.2 */                     \
        for (size_t k = 0; k < n; k++)                                                    \
            for (size_t e = 0; e < size(r[k]); e++, at++) {                               \
                if (at >= nv) return 3;                                                   \
                switch (r[k]) { get default: return 3; }                                  \
            }                                                                             \
        return at == nv ? 0 : 3;                                                          \
    }                                                                                     \
    EXPORT int fmi3Set##Name(void *c, const unsigned *r, size_t n, in *v, size_t nv) {    \
        Instance *i = c;                                                                  \
        size_t at = 0;                                                                    \
        (void)i, (void)v;                                                                 \
        for (size_t k = 0; k < n; k++)                                                    \
            for (size_t e = 0; e < size(r[k]); e++, at++) {                               \
                if (at >= nv) return 3;                                                   \
                switch (r[k]) { set default: return 3; }                                  \
            }                                                                             \
        return at == nv ? 0 : 3;                                                          \
    }
#define GET(r, value) case r: v[at] = value; break;
#define SET(r, place) case r: place = v[at]; break;
#ifndef PLACE
#define PLACE e
#endif
#ifndef WIDTH
#define WIDTH(value) value
#endif
#ifndef MOST
#define MOST 8
#endif
ACCESS(Float64, const double, double,
       GET(TIME, i->time) GET(M, i->m[e]) GET(K, i->k[e]) GET(T, transposed(i, e)) GET(SUM, sum(i)),
       SET(M, i->m[PLACE]) SET(K, i->k[e]))
ACCESS(Float32, const float, float, GET(F, i->f[e]) GET(G, 2 * i->f[e]), SET(F, i->f[e]))
ACCESS(Boolean, const bool, bool, GET(B, i->b[e]) GET(NO, !i->b[e]), SET(B, i->b[e]))
ACCESS(Int64, const int64_t, int64_t, GET(W, i->w[e]) GET(V, -i->w[e]) GET(S, i->s) GET(SO, i->s),
       SET(W, i->w[e]) case S: i->s = WIDTH(v[at]); break;)
ACCESS(UInt64, const uint64_t, uint64_t, GET(N, 2) GET(UP, i->up) GET(UO, i->up), SET(UP, i->up))
ACCESS(Int32, const int32_t, int32_t, GET(Q, i->q) GET(QO, i->q) GET(LS, (int32_t)strlen(i->names[e])), SET(Q, i->q))
ACCESS(Int8, const int8_t, int8_t, GET(E, i->e[e]) GET(EO, i->e[e]), SET(E, i->e[e]))
ACCESS(String, const char *const, const char *, GET(NAMES, i->names[e]), case NAMES: strncpy(i->names[e], v[at], 15); break;)
/* The places of x, p and xs, and of the inputs of their outputs. */
static int place(unsigned r, size_t e) {
    switch (r) {
    case X: case XO: return 0;
    case P: case PO: return 1;
    case XS: return 2 + e;
    case YS: return 3 - e;
    default: return -1;
    }
}
EXPORT int fmi3GetBinary(void *c, const unsigned *r, size_t n, size_t *sizes, const uint8_t **values, size_t nv) {
    Instance *i = c;
    size_t at = 0;
    if (!i->has_entered) return 3;
    for (size_t k = 0; k < n; k++)
        for (size_t e = 0; e < size(r[k]); e++, at++) {
            int own = place(r[k], e);
            if (own < 0 || at >= nv) return 3;
            sizes[at] = i->sizes[own];
            values[at] = sizes[at] ? i->bytes[own] : NULL;
#ifdef KEEPS
            /* Once, for the largest value: `check` frees the memory later. */
            if (i->lent) values[at] = i->lent;
            i->lent = NULL;
#endif
            if (r[k] != XO) continue;
            for (size_t b = 0; b < sizes[at]; b++) i->answer[b] = i->bytes[0][sizes[at] - 1 - b];
            values[at] = i->answer;
        }
    return at == nv ? 0 : 3;
}
EXPORT int fmi3SetBinary(void *c, const unsigned *r, size_t n, const size_t *sizes, const uint8_t *const *values, size_t nv) {
    Instance *i = c;
    size_t at = 0;
    for (size_t k = 0; k < n; k++)
        for (size_t e = 0; e < size(r[k]); e++, at++) {
            int own = place(r[k], e);
            if (own < 0 || r[k] == XO || r[k] == PO || r[k] == YS || at >= nv || sizes[at] > MOST) return 3;
            memset(i->answer, 0xee, 8);
            memcpy(i->bytes[own], values[at], i->sizes[own] = sizes[at]);
#ifdef KEEPS
            i->lent = sizes[at] == 8 ? values[at] : NULL;
#endif
        }
    return at == nv ? 0 : 3;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *required, size_t n,
                                         void *environment, void *log, void *intermediate) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)n;
    (void)environment, (void)log, (void)intermediate;
    Instance *i = malloc(sizeof *i);
    start(i);
    return i;
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c, bool td, double tol, double t0, bool sd, double t1) {
    ((Instance *)c)->has_entered = true;
    (void)td, (void)tol, (void)sd, (void)t1;
    ((Instance *)c)->time = t0;
    return 0;
}
EXPORT int fmi3ExitInitializationMode(void *c) { (void)c; return 0; }
EXPORT int fmi3Terminate(void *c) { (void)c; return 0; }
EXPORT int fmi3Reset(void *c) { start(c); return 0; }
EXPORT int fmi3DoStep(void *c, double t, double h, bool final, bool *event_needed, bool *terminate, bool *early,
                      double *reached) {
    (void)final;
    memset(((Instance *)c)->answer, 0xee, 8);
    *event_needed = *terminate = *early = false;
    *reached = ((Instance *)c)->time = t + h;
    return 0;
}
