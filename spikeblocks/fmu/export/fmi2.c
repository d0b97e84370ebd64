
/* FMI 2.0, co-simulation. */
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks;

enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };

#define JOIN(a, b) a##b
#define PREFIXED(a, b) JOIN(a, b)
#ifdef FMI2_FUNCTION_PREFIX
#define FMI2(name) PREFIXED(FMI2_FUNCTION_PREFIX, fmi2##name)
#else
#define FMI2(name) fmi2##name
#endif

static void say(const struct model *m, const char *text)
{
    /* The text as a format, since not every importer fills in "%s". */
    const callbacks *const given = m->environment;
    char format[2 * LONGEST];
    size_t n = 0;
    for (; *text && n + 2 < sizeof format; text++) {
        if (*text == '%') format[n++] = '%';
        format[n++] = *text;
    }
    format[n] = 0;
    if (given && given->logger)
        given->logger(given->environment, m->instance, ERROR, "logStatusError", format);
}

EXPORT const char *FMI2(GetTypesPlatform)(void) { return "default"; }
EXPORT const char *FMI2(GetVersion)(void) { return "2.0"; }

EXPORT int FMI2(SetDebugLogging)(void *m, int on, size_t n, const char *const categories[])
{
    (void)n, (void)categories;
    ((struct model *)m)->debug = on;
    return OK;
}

EXPORT void *FMI2(Instantiate)(const char *name, int kind, const char *token, const char *resources,
                               const callbacks *given, int visible, int logging)
{
    (void)resources, (void)visible;
    struct model *const m = kind == 1 ? model_new(name, token) : NULL;
    if (!m) return NULL;
    m->environment = (void *)given;
    m->debug = logging;
    return m;
}

EXPORT void FMI2(FreeInstance)(void *m) { free(m); }

EXPORT int FMI2(SetupExperiment)(void *m, int tolerates, double tolerance, double start, int stops, double stop)
{
    (void)tolerates, (void)tolerance, (void)stops, (void)stop;
    return model_begins_at(m, start) ? OK : ERROR;
}

EXPORT int FMI2(EnterInitializationMode)(void *m) { return m ? OK : ERROR; }
EXPORT int FMI2(ExitInitializationMode)(void *m) { return m ? OK : ERROR; }
EXPORT int FMI2(Terminate)(void *m) { return m ? OK : ERROR; }

EXPORT int FMI2(Reset)(void *m)
{
    model_reset(m);
    return OK;
}

EXPORT int FMI2(GetReal)(void *m, const unsigned v[], size_t n, double values[])
{
    return model_get(m, v, n, values, n) ? OK : ERROR;
}

EXPORT int FMI2(SetReal)(void *m, const unsigned v[], size_t n, const double values[])
{
    return model_set(m, v, n, values, n) ? OK : ERROR;
}

/* There are no variables of other types. */
#define NO_VARIABLES(type, c_type) \
    EXPORT int FMI2(Get##type)(void *m, const unsigned v[], size_t n, c_type values[]) \
    { \
        (void)m, (void)v, (void)values; \
        return n ? ERROR : OK; \
    } \
    EXPORT int FMI2(Set##type)(void *m, const unsigned v[], size_t n, const c_type values[]) \
    { \
        (void)m, (void)v, (void)values; \
        return n ? ERROR : OK; \
    }
NO_VARIABLES(Integer, int)
NO_VARIABLES(Boolean, int)
NO_VARIABLES(String, char *)

EXPORT int FMI2(GetFMUstate)(void *m, void **state) { return model_save(m, state) ? OK : ERROR; }
EXPORT int FMI2(SetFMUstate)(void *m, void *state) { return model_restore(m, state) ? OK : ERROR; }

EXPORT int FMI2(FreeFMUstate)(void *m, void **state)
{
    (void)m;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT int FMI2(SerializedFMUstateSize)(void *m, void *state, size_t *size)
{
    (void)m, (void)state;
    *size = sizeof(struct state);
    return OK;
}

EXPORT int FMI2(SerializeFMUstate)(void *m, void *state, char bytes[], size_t size)
{
    (void)m;
    return model_serialize(state, (unsigned char *)bytes, size) ? OK : ERROR;
}

EXPORT int FMI2(DeSerializeFMUstate)(void *m, const char bytes[], size_t size, void **state)
{
    return model_deserialize(m, (const unsigned char *)bytes, size, state) ? OK : ERROR;
}

EXPORT int FMI2(GetDirectionalDerivative)(void *m, const unsigned of[], size_t n, const unsigned by[],
                                          size_t k, const double known[], double found[])
{
    (void)m, (void)of, (void)n, (void)by, (void)k, (void)known, (void)found;
    return ERROR;
}

EXPORT int FMI2(SetRealInputDerivatives)(void *m, const unsigned v[], size_t n, const int order[], const double values[])
{
    (void)m, (void)v, (void)n, (void)order, (void)values;
    return ERROR;
}

EXPORT int FMI2(GetRealOutputDerivatives)(void *m, const unsigned v[], size_t n, const int order[], double values[])
{
    (void)m, (void)v, (void)n, (void)order, (void)values;
    return ERROR;
}

EXPORT int FMI2(DoStep)(void *of, double t, double step, int no_earlier)
{
    struct model *const m = of;
    (void)no_earlier;
    if (model_advance(m, t + step)) return OK;
    return m->stopped ? DISCARD : ERROR;
}

EXPORT int FMI2(CancelStep)(void *m) { return m ? ERROR : FATAL; }

EXPORT int FMI2(GetStatus)(void *m, int kind, int *value)
{
    (void)m, (void)kind;
    *value = OK;
    return DISCARD;
}

EXPORT int FMI2(GetRealStatus)(void *m, int kind, double *value)
{
    *value = ((const struct model *)m)->time;
    return kind == 2 ? OK : DISCARD; /* the last successful time */
}

EXPORT int FMI2(GetIntegerStatus)(void *m, int kind, int *value)
{
    (void)m, (void)kind;
    *value = 0;
    return DISCARD;
}

EXPORT int FMI2(GetBooleanStatus)(void *m, int kind, int *value)
{
    *value = ((const struct model *)m)->stopped;
    return kind == 3 ? OK : DISCARD; /* whether the model wants to end */
}

EXPORT int FMI2(GetStringStatus)(void *m, int kind, const char **value)
{
    (void)m, (void)kind;
    *value = "";
    return DISCARD;
}
