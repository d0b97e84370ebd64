
/* FMI 3.0, co-simulation. */
enum { OK, WARNING, DISCARD, ERROR, FATAL };

typedef void logger(void *, int, const char *, const char *);

#define JOIN(a, b) a##b
#define PREFIXED(a, b) JOIN(a, b)
#ifdef FMI3_FUNCTION_PREFIX
#define FMI3(name) PREFIXED(FMI3_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI3(name) fmi3##name
#endif

static void say(const struct model *m, const char *text)
{
    logger *log;
    memcpy(&log, &m->log, sizeof log);
    if (log) log(m->environment, ERROR, "logStatusError", text);
}

EXPORT const char *FMI3(GetVersion)(void) { return "3.0"; }

EXPORT int FMI3(SetDebugLogging)(void *m, bool on, size_t n, const char *const categories[])
{
    (void)n, (void)categories;
    ((struct model *)m)->debug = on;
    return OK;
}

EXPORT void *FMI3(InstantiateCoSimulation)(
    const char *name, const char *token, const char *resources, bool visible, bool logging,
    bool events, bool early, const unsigned between[], size_t n, void *environment, logger *log,
    void (*update)(void))
{
    (void)resources, (void)visible, (void)early, (void)between, (void)update;
    struct model *const m = events || n ? NULL : model_new(name, token);
    if (!m) return NULL;
    m->environment = environment;
    m->debug = logging;
    memcpy(&m->log, &log, sizeof log);
    return m;
}

EXPORT void *FMI3(InstantiateModelExchange)(void) { return NULL; }
EXPORT void *FMI3(InstantiateScheduledExecution)(void) { return NULL; }
EXPORT void FMI3(FreeInstance)(void *m) { free(m); }

EXPORT int FMI3(EnterInitializationMode)(void *m, bool tolerates, double tolerance, double start, bool stops, double stop)
{
    (void)tolerates, (void)tolerance, (void)stops, (void)stop;
    return model_begins_at(m, start) ? OK : ERROR;
}

EXPORT int FMI3(ExitInitializationMode)(void *m) { return m ? OK : ERROR; }
EXPORT int FMI3(Terminate)(void *m) { return m ? OK : ERROR; }

EXPORT int FMI3(Reset)(void *m)
{
    model_reset(m);
    return OK;
}

EXPORT int FMI3(GetFloat64)(void *m, const unsigned v[], size_t n, double values[], size_t room)
{
    return model_get(m, v, n, values, room) ? OK : ERROR;
}

EXPORT int FMI3(SetFloat64)(void *m, const unsigned v[], size_t n, const double values[], size_t room)
{
    return model_set(m, v, n, values, room) ? OK : ERROR;
}

/* What this model has nothing of; the caller removes the arguments. */
#define NONE(name) EXPORT int FMI3(name)(void) { return ERROR; }
#define NO_VARIABLES(type) NONE(Get##type) NONE(Set##type)
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
NO_VARIABLES(Binary)
NO_VARIABLES(Clock)
NO_VARIABLES(IntervalDecimal)
NO_VARIABLES(IntervalFraction)
NO_VARIABLES(ShiftDecimal)
NO_VARIABLES(ShiftFraction)
NONE(GetNumberOfVariableDependencies)
NONE(GetVariableDependencies)
NONE(GetDirectionalDerivative)
NONE(GetAdjointDerivative)
NONE(EnterConfigurationMode)
NONE(ExitConfigurationMode)
NONE(EnterEventMode)
NONE(EvaluateDiscreteStates)
NONE(UpdateDiscreteStates)
NONE(EnterContinuousTimeMode)
NONE(CompletedIntegratorStep)
NONE(SetTime)
NONE(SetContinuousStates)
NONE(GetContinuousStateDerivatives)
NONE(GetEventIndicators)
NONE(GetContinuousStates)
NONE(GetNominalsOfContinuousStates)
NONE(GetNumberOfEventIndicators)
NONE(GetNumberOfContinuousStates)
NONE(EnterStepMode)
NONE(GetOutputDerivatives)
NONE(ActivateModelPartition)

EXPORT int FMI3(GetFMUState)(void *m, void **state) { return model_save(m, state) ? OK : ERROR; }
EXPORT int FMI3(SetFMUState)(void *m, void *state) { return model_restore(m, state) ? OK : ERROR; }

EXPORT int FMI3(FreeFMUState)(void *m, void **state)
{
    (void)m;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT int FMI3(SerializedFMUStateSize)(void *m, void *state, size_t *size)
{
    (void)m, (void)state;
    *size = sizeof(struct state);
    return OK;
}

EXPORT int FMI3(SerializeFMUState)(void *m, void *state, unsigned char bytes[], size_t size)
{
    (void)m;
    return model_serialize(state, bytes, size) ? OK : ERROR;
}

EXPORT int FMI3(DeserializeFMUState)(void *m, const unsigned char bytes[], size_t size, void **state)
{
    return model_deserialize(m, bytes, size, state) ? OK : ERROR;
}

EXPORT int FMI3(DoStep)(void *of, double t, double step, bool no_earlier, bool *event, bool *ends, bool *early, double *reached)
{
    struct model *const m = of;
    (void)no_earlier;
    const int done = model_advance(m, t + step);
    *event = false;
    *ends = !done && m->stopped;
    *early = false;
    *reached = *ends ? m->time : t + step;
    return done || m->stopped ? OK : ERROR;
}
