/* ${about}
 *
 *     cc -std=c99 -O2 -ffp-contract=off -fPIC -shared ${name}_fmu.c -lm -o ${name}.so
 *
 * What an instance keeps, and what both versions of the interface do with it. A tick computes its
 * outputs and what follows; it is done on a copy as soon as an output is read, again if an input has
 * changed since, and taken over when time goes on. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "${name}.c"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#define TOKEN "${token}"
#define DT ${dt}
#define KEPT offsetof(struct ${name}, arena) /* local arrays are needed within a tick only */
#define LONGEST 200

enum owner { TIME, INPUT, OUTPUT, PARAMETER };

/* Where the numbers of each variable are, by value reference. */
static const struct variable {
    enum owner owner;
    size_t offset, count;
} variables[] = {
    {TIME, 0, 1},
${variables}
};
static const unsigned variable_count = (unsigned)(sizeof variables / sizeof variables[0]);
static const double starts[] = {${starts}}; /* of the inputs */

/* All that a later tick depends on. */
struct state {
    char token[sizeof TOKEN];
    int64_t tick;
    struct ${name}_inputs in;
    struct ${name}_parameters parameters;
    unsigned char before[KEPT]; /* the simulation before the tick */
};

struct model {
    struct state now;
    struct ${name}_outputs out;
    double time;
    int computed, stopped; /* the tick is done with these inputs; run.stop ends the run there */
    int debug;
    void *environment, *log;
    char instance[LONGEST];
    struct ${name} after; /* the simulation after the tick, once it is computed */
};

static void say(const struct model *m, const char *text);

static void model_reset(struct model *m)
{
    ${name}_init(&m->after);
    memset(&m->now, 0, sizeof m->now);
    memcpy(m->now.token, TOKEN, sizeof TOKEN);
    memcpy(&m->now.in, starts, sizeof starts < sizeof m->now.in ? sizeof starts : sizeof m->now.in);
    m->now.parameters = m->after.parameters;
    memcpy(m->now.before, &m->after, KEPT);
    m->time = 0.0;
    m->computed = m->stopped = 0;
}

static struct model *model_new(const char *instance, const char *token)
{
    struct model *m = token && strcmp(token, TOKEN) == 0 ? calloc(1, sizeof *m) : NULL;
    if (!m) return NULL;
    if (instance) strncpy(m->instance, instance, LONGEST - 1);
    model_reset(m);
    return m;
}

/* Do the tick, if it is not done; whether it was possible. */
static int model_compute(struct model *m)
{
    if (m->computed) return 1;
    memcpy(&m->after, m->now.before, KEPT);
    m->after.parameters = m->now.parameters;
    const int failure = ${name}_step(&m->after, &m->now.in, &m->out);
    m->stopped = failure == ${stopped};
    m->computed = !failure || m->stopped;
    if (!m->computed) {
        char text[LONGEST];
        snprintf(text, sizeof text, "at t = %g: %s", m->time, ${name}_message(failure));
        say(m, text);
    }
    return m->computed;
}

/* Go on to the last tick that is not later than a time; 0 if a tick fails or the run ends. */
static int model_advance(struct model *m, double until)
{
    const int64_t last = (int64_t)floor(until / DT + 1e-6);
    while (m->now.tick < last) {
        if (!model_compute(m) || m->stopped) return 0;
        memcpy(m->now.before, &m->after, KEPT);
        m->computed = 0;
        m->now.tick++;
        m->time = (double)m->now.tick * DT;
    }
    return 1;
}

static int model_begins_at(struct model *m, double start)
{
    if (fabs(start) < 1e-9 * DT) return 1;
    say(m, "the start time must be 0");
    return 0;
}

/* The numbers of a variable; of one that is set, the tick is not done any more if they differ. */
static double *model_place(struct model *m, unsigned reference)
{
    if (reference >= variable_count) {
        say(m, "there is no variable with this value reference");
        return NULL;
    }
    const struct variable v = variables[reference];
    unsigned char *const owners[] = {
        (unsigned char *)&m->time, (unsigned char *)&m->now.in,
        (unsigned char *)&m->out, (unsigned char *)&m->now.parameters,
    };
    return (double *)(void *)(owners[v.owner] + v.offset);
}

static int model_get(struct model *m, const unsigned *references, size_t n, double *values, size_t room)
{
    for (size_t i = 0; i < n; i++) {
        const double *const place = model_place(m, references[i]);
        if (!place) return 0;
        const struct variable v = variables[references[i]];
        if (v.owner == OUTPUT && !model_compute(m)) return 0;
        if (v.count > room) return 0;
        memcpy(values, place, v.count * sizeof *values);
        values += v.count;
        room -= v.count;
    }
    return 1;
}

static int model_set(
    struct model *m, const unsigned *references, size_t n, const double *values, size_t room)
{
    for (size_t i = 0; i < n; i++) {
        double *const place = model_place(m, references[i]);
        if (!place) return 0;
        const struct variable v = variables[references[i]];
        if (v.owner == TIME || v.owner == OUTPUT) {
            say(m, "an output cannot be set");
            return 0;
        }
        if (v.count > room) return 0;
        if (memcmp(place, values, v.count * sizeof *values) != 0) m->computed = 0;
        memcpy(place, values, v.count * sizeof *values);
        values += v.count;
        room -= v.count;
    }
    return 1;
}

static int model_save(const struct model *m, void **state)
{
    if (!*state) *state = malloc(sizeof m->now);
    if (!*state) return 0;
    memcpy(*state, &m->now, sizeof m->now);
    return 1;
}

static int model_restore(struct model *m, const void *state)
{
    if (!state || memcmp(state, TOKEN, sizeof TOKEN) != 0) {
        say(m, "the state is of another model");
        return 0;
    }
    memcpy(&m->now, state, sizeof m->now);
    m->time = (double)m->now.tick * DT;
    m->computed = m->stopped = 0;
    return 1;
}

static int model_serialize(const void *state, unsigned char *bytes, size_t size)
{
    if (size < sizeof(struct state)) return 0;
    memcpy(bytes, state, sizeof(struct state));
    return 1;
}

static int model_deserialize(struct model *m, const unsigned char *bytes, size_t size, void **state)
{
    if (size != sizeof(struct state) || memcmp(bytes, TOKEN, sizeof TOKEN) != 0) {
        say(m, "the state is of another model");
        return 0;
    }
    if (!*state) *state = malloc(sizeof(struct state));
    if (!*state) return 0;
    memcpy(*state, bytes, sizeof(struct state));
    return 1;
}
