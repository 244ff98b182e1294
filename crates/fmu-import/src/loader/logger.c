/* The logger for FMI 2.0 FMUs (FMI 2.0.4, section 2.1.5): formats the message and passes it to callbacks.rs.

   The arguments are read one by one, because some FMUs pass text that is not meant as a format. If a conversion writes, is
   not valid C, or needs a string that cannot be read, the text from there on is kept unchanged. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __linux__
#include <errno.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

/* Maximum length of a message, bytes. */
enum { MOST = 10000 };

void fmu_import_message(void *environment, const char *instance, int status, const char *category, const char *text);

/* Returns true if a string can be read up to its end or to `longest` bytes. If no argument was passed, the pointer is arbitrary. */
static int is_readable(const char *text, size_t longest) {
#ifdef __linux__
    int saved = errno, is_there = 1;
    for (const char *at = text; is_there && (size_t)(at - text) < longest; at++) {
        /* Tests a page: the system reads eight bytes, then rejects the invalid call with EINVAL. If the bytes cannot be read, it
           returns EFAULT. */
        if (at == text || (uintptr_t)at % 4096 == 0)
            is_there = syscall(SYS_rt_sigprocmask, ~0, (uintptr_t)at & ~(uintptr_t)7, NULL, 8) && errno == EINVAL;
        if (is_there && !*at) break;
    }
    errno = saved;
    return is_there;
#else
    (void)longest;
#if defined __x86_64__ || defined _M_X64
    if ((uintptr_t)text >> 47) return 0;
#endif
    /* Programs have no strings at lower addresses. */
    return (uintptr_t)text >= 65536;
#endif
}

/* Appends one conversion with its argument. Returns the number of bytes, or a negative number if the argument cannot be used. */
static int convert(char *out, size_t size, const char *conversion, char kind, const char *length, va_list *list) {
    switch (kind) {
    case 'd': case 'i':
        if (!strcmp(length, "l")) return snprintf(out, size, conversion, va_arg(*list, long));
        if (!strcmp(length, "ll")) return snprintf(out, size, conversion, va_arg(*list, long long));
        if (!strcmp(length, "z")) return snprintf(out, size, conversion, va_arg(*list, size_t));
        return snprintf(out, size, conversion, va_arg(*list, int));
    case 'u': case 'x': case 'X': case 'o':
        if (!strcmp(length, "l")) return snprintf(out, size, conversion, va_arg(*list, unsigned long));
        if (!strcmp(length, "ll")) return snprintf(out, size, conversion, va_arg(*list, unsigned long long));
        if (!strcmp(length, "z")) return snprintf(out, size, conversion, va_arg(*list, size_t));
        return snprintf(out, size, conversion, va_arg(*list, unsigned));
    case 'c': return *length ? -1 : snprintf(out, size, conversion, va_arg(*list, int));
    case 'e': case 'E': case 'f': case 'F': case 'g': case 'G': case 'a': case 'A':
        if (!strcmp(length, "L")) return snprintf(out, size, conversion, va_arg(*list, long double));
        return snprintf(out, size, conversion, va_arg(*list, double));
    case 'p': return snprintf(out, size, conversion, va_arg(*list, void *));
    case 's': {
        if (*length) return -1; /* wide characters */
        const char *text = va_arg(*list, const char *);
        const char *precision = strchr(conversion, '.');
        long longest = precision ? strtol(precision + 1, NULL, 10) : -1;
        if (text && !is_readable(text, longest < 0 ? SIZE_MAX : (size_t)longest)) return -1;
        return snprintf(out, size, conversion, text ? text : "(null)");
    }
    default: return -1;
    }
}

static void format_message(char *out, size_t size, const char *format, va_list *list) {
    size_t at = 0;
    while (*format && at + 1 < size) {
        if (*format != '%') {
            out[at++] = *format++;
            continue;
        }
        if (format[1] == '%') {
            out[at++] = '%';
            format += 2;
            continue;
        }
        /* Flags, width, precision, length, kind. A star consumes an argument. */
        char conversion[64], length[3] = "";
        size_t used = 0, n = 0;
        const char *end = format + 1;
        conversion[used++] = '%';
        while (*end && strchr("-+ #0123456789.*", *end) && used < 40) {
            if (*end == '*') used += (size_t)snprintf(conversion + used, 16, "%d", va_arg(*list, int));
            else conversion[used++] = *end;
            end++;
        }
        while (*end && strchr("hljztL", *end) && n < 2) length[n++] = conversion[used++] = *end++;
        conversion[used++] = *end;
        conversion[used] = 0;
        if (!strcmp(length, "t")) strcpy(length, "z");
        if (!strcmp(length, "j")) strcpy(length, "ll");
        int written = convert(out + at, size - at, conversion, *end, length, list);
        if (written < 0) {
            snprintf(out + at, size - at, "%s", format);
            return;
        }
        at = at + (size_t)written < size ? at + (size_t)written : size - 1;
        format = end + 1;
    }
    out[at] = 0;
}

void fmu_import_logger(void *environment, const char *instance, int status, const char *category, const char *format, ...) {
    /* Not on the stack, because threads that call an FMU may have a small stack. */
    char *text = malloc(MOST + 1);
    va_list list;
    va_start(list, format);
    if (text) *text = 0;
    if (text && format) format_message(text, MOST + 1, format, &list);
    va_end(list);
    fmu_import_message(environment, instance, status, category, text ? text : "(no memory for this message)");
    free(text);
}
