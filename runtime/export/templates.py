"""The texts around what is written for each controller."""

from string import Template

HEADER = Template(
    r"""/* ${about}
 *
 * The caller owns the memory: one struct ${name} is one controller, without pointers into itself.
 * Nothing is allocated, and of the C library only math.h is used.
 */
#ifndef ${guard}
#define ${guard}

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ${upper}_DT ${dt} /* seconds between two steps */

/* Read by a step. Values that others compute at a slower rate are given on every step. */
struct ${name}_inputs {
${inputs}
};

/* Written by a step. Values of slower blocks stay as they are in between. */
struct ${name}_outputs {
${outputs}
};

/* Numbers that may be changed between two steps and act at the next one; init sets them. */
struct ${name}_parameters {
${parameters}
};

/* What blocks have computed. */
${signals}
struct ${name} {
    int64_t tick;
    int failure; /* 0: none; see ${name}_message */
${learning}    struct ${name}_parameters parameters;
    struct ${name}_signals signals;
${held}
    /* States of blocks. */
${states}
    /* Local arrays of blocks. */
${most}    int64_t arena[${arena}];
};

/* Set everything to its initial value. */
void ${name}_init(struct ${name} *c);

/* The same, but what was learnt is kept: ${learnt}. */
void ${name}_reset(struct ${name} *c);

/* One step. Returns 0, or the number of a failure. The outputs are then unchanged, and further
 * steps do nothing until init or reset. ${wrong} */
int ${name}_step(struct ${name} *c, const struct ${name}_inputs *in, struct ${name}_outputs *out);

/* What a failure means. */
const char *${name}_message(int failure);

/* Set one number of a parameter by name, as "${example}", and the index in an array, 0 of a number.
 * Returns 0; 1: there is no such parameter; 2: no such index; 3: it is out of bounds. */
int ${name}_set(struct ${name} *c, const char *parameter, int index, double value);

/* Read one. */
int ${name}_get(const struct ${name} *c, const char *parameter, int index, double *value);

/* Write everything but local arrays (${upper}_SAVED bytes) to memory, or go on from there; the
 * place needs no alignment. Load returns 0, or 1 and leaves the controller as it is: the bytes are
 * not those of this version of this controller, or damaged. */
#define ${upper}_SAVED ((int)(${head} + offsetof(struct ${name}, ${end})))
void ${name}_save(const struct ${name} *c, void *bytes);
int ${name}_load(struct ${name} *c, const void *bytes);
${weights}

#endif
"""
)

SOURCE = Template(
    r"""/* ${about} */

#include "${name}.h"

/* Local arrays of few numbers are many: multiples of 32 bytes would take half as much again. */
#define ARENA_STEP 8

${support}
@draws@
${blocks}
${declared}
${plan}
${helpers}
${tables}
/* The number of a failure. */
static int failed(const struct context *ctx, int64_t ended)
{
${first}
}

void ${name}_reset(struct ${name} *c)
{
    c->tick = 0;
    c->failure = 0;
    c->signals = (struct ${name}_signals){0};
${unmeasured}${reset}
}

void ${name}_init(struct ${name} *c)
{
${learnt}
    ${name}_reset(c);
}

struct tunable {
    const char *name;
    int at, count;
    double low, high;
    bool is_above, is_below;
};

static const struct tunable tunables[] = {
${tunables}
};

/* The parameter of a name; NULL if there is none. */
static const struct tunable *tunable_of(const char *name)
{
    for (int i = 0; i < (int)(sizeof tunables / sizeof tunables[0]); i++) {
        const char *one = tunables[i].name, *other = name;
        while (*one && *one == *other) one++, other++;
        if (*one == *other && tunables[i].count) return &tunables[i];
    }
    return NULL;
}

int ${name}_set(struct ${name} *c, const char *parameter, int index, double value)
{
    const struct tunable *const one = tunable_of(parameter);
    if (!one) return 1;
    if (index < 0 || index >= one->count) return 2;
    if (!(one->is_above ? value > one->low : value >= one->low)) return 3;
    if (!(one->is_below ? value < one->high : value <= one->high)) return 3;
    *((double *)&c->parameters + one->at + index) = value;
    return 0;
}

int ${name}_get(const struct ${name} *c, const char *parameter, int index, double *value)
{
    const struct tunable *const one = tunable_of(parameter);
    if (!one) return 1;
    if (index < 0 || index >= one->count) return 2;
    *value = *((const double *)&c->parameters + one->at + index);
    return 0;
}

/* Part of a controller's memory, from its begin. */
struct part {
    size_t begin, size;
};

static const struct part everything[] = {{0, offsetof(struct ${name}, ${end})}};
${learnt_parts}
/* The cyclic redundancy check of IEEE 802.3, of bytes. */
static uint32_t check_of(uint32_t check, const unsigned char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        check ^= bytes[i];
        for (int k = 0; k < 8; k++) check = check >> 1 ^ (check & 1u ? 0xEDB88320u : 0u);
    }
    return check;
}

/* What saved bytes begin with: which layout of which controller, and their check. */
static void head_of(unsigned char *head, uint64_t kind, uint32_t check)
{
    const uint64_t layout = UINT64_C(${digest}) ^ kind;
    for (int i = 0; i < 8; i++) head[i] = (unsigned char)(layout >> 8 * i & 0xFF);
    for (int i = 0; i < 4; i++) head[8 + i] = (unsigned char)(check >> 8 * i & 0xFF);
}

static void save_parts(
    const struct ${name} *c, void *bytes, const struct part *parts, size_t count, uint64_t kind)
{
    unsigned char *to = (unsigned char *)bytes + ${head};
    uint32_t check = 0xFFFFFFFFu;
    for (size_t i = 0; i < count; i++) {
        const unsigned char *const from = (const unsigned char *)c + parts[i].begin;
        check = check_of(check, from, parts[i].size);
        for (size_t k = 0; k < parts[i].size; k++) *to++ = from[k];
    }
    head_of(bytes, kind, check);
}

static int load_parts(
    struct ${name} *c, const void *bytes, const struct part *parts, size_t count, uint64_t kind)
{
    const unsigned char *from = (const unsigned char *)bytes + ${head};
    unsigned char head[${head}];
    size_t size = 0;
    for (size_t i = 0; i < count; i++) size += parts[i].size;
    head_of(head, kind, check_of(0xFFFFFFFFu, from, size));
    for (int i = 0; i < ${head}; i++) {
        if (head[i] != ((const unsigned char *)bytes)[i]) return 1;
    }
    for (size_t i = 0; i < count; i++) {
        unsigned char *const to = (unsigned char *)c + parts[i].begin;
        for (size_t k = 0; k < parts[i].size; k++) to[k] = *from++;
    }
    return 0;
}

void ${name}_save(const struct ${name} *c, void *bytes)
{
    save_parts(c, bytes, everything, 1, 0);
}

int ${name}_load(struct ${name} *c, const void *bytes)
{
    return load_parts(c, bytes, everything, 1, 0);
}
${learnt_functions}
int ${name}_step(struct ${name} *c, const struct ${name}_inputs *in, struct ${name}_outputs *out)
{
    if (c->failure) return c->failure;
    struct context ctx = {0};
    ctx.failure = -1;
    ctx.arena = (unsigned char *)c->arena;
    ctx.arena_size = (int64_t)sizeof c->arena;${measuring}
${inputs}
    struct ${name}_outputs made;
    const struct places places = {
${places}
    };
${before}    const int64_t ended = ticks(&c->signals, &places, &ctx, c->tick, c->tick + 1, 0, 1);
    if (ended) c->failure = failed(&ctx, ended);
    if (ended && ended != ${stopped}) return c->failure;
${after}${checks}
    *out = made;
    c->tick++;${measured}
    return c->failure;
}

const char *${name}_message(int failure)
{
    static const char *const messages[] = {
        "no failure",
${messages}
    };
    const int count = (int)(sizeof messages / sizeof messages[0]);
    return failure >= 0 && failure < count ? messages[failure] : "unknown failure";
}
"""
)

TEST = Template(
    r"""/* Replays ${covered} through ${name}.c, and compares every output on
 * ${compared} of these ticks.
 *
 * ${reason}
 *
 *     cc -std=c99 -O2 -ffp-contract=off ${name}.c ${name}_test.c -lm -o ${name}_test
 *     ./${name}_test
 */

#include <math.h>
#include <stdio.h>

#include "${name}.h"

#define TICKS ${ticks}
#define FIRST ${first} /* ticks on which outputs are compared; then on each EVERY, and the last */
#define EVERY ${every}
#define TOLERANCE ${tolerance} /* of the difference, divided by ${measure} */

${tables}
static const char *const labels[${count}] = {${labels}};
static double largest[${count}];
${ranges}static struct ${name} controller;

static void compare(int output, double found, double recorded)
{
    double difference = fabs(found - recorded) / ${scale};
    if (isinf(recorded) && found == recorded) difference = 0.0;
    if (!(difference <= largest[output])) largest[output] = difference;
}

int main(void)
{
    struct ${name}_inputs in;
    struct ${name}_outputs out;
    int wrong = 0, row = 0;
    ${name}_init(&controller);
    for (int tick = 0; tick < TICKS; tick++) {
${gives}
        const int failure = ${name}_step(&controller, &in, &out);
        if (failure && !(failure == ${stopped} && tick + 1 == TICKS)) { /* a run may end itself */
            printf("tick %d: %s\n", tick, ${name}_message(failure));
            return 1;
        }
        if (tick >= FIRST && tick % EVERY && tick + 1 < TICKS) continue;
${compares}
        row++;
    }
    for (int i = 0; i < ${count}; i++) {
        const int bad = !(largest[i] <= TOLERANCE);
        printf("%s %s: largest difference %.3g\n", bad ? "WRONG" : "fine", labels[i], largest[i]);
        wrong += bad;
    }
    printf("%d ticks, %d of them compared, tolerance %.3g: %s\n", TICKS, row, TOLERANCE,
        wrong ? "WRONG" : "fine");
    fflush(stdout);
    return wrong != 0;
}
"""
)

WEIGHTS = Template(
    r"""
/* The same of what was learnt alone, ${upper}_LEARNT bytes: ${learnt}. */
#define ${upper}_LEARNT ((int)(${head} + ${size}))
void ${name}_save_learnt(const struct ${name} *c, void *bytes);
int ${name}_load_learnt(struct ${name} *c, const void *bytes);
"""
)

LEARNT_FUNCTIONS = Template(
    r"""
void ${name}_save_learnt(const struct ${name} *c, void *bytes)
{
    save_parts(c, bytes, learnt, ${count}, 1);
}

int ${name}_load_learnt(struct ${name} *c, const void *bytes)
{
    return load_parts(c, bytes, learnt, ${count}, 1);
}
"""
)

CMAKE = Template(
    r"""# add_subdirectory() gives a target for each controller; on its own, ctest replays the runs.
cmake_minimum_required(VERSION 3.15)
project(controllers C)
set(CONTROLLERS ${names})

if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_SOURCE_DIR)
  enable_testing()
endif()
foreach(name IN LISTS CONTROLLERS)
  # Without fused multiplications and additions, whose last bits are others than the graph's.
  add_library($${name} STATIC $${name}.c)
  add_executable($${name}_test EXCLUDE_FROM_ALL $${name}_test.c)
  set_target_properties($${name} $${name}_test PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
  if(NOT MSVC)
    target_compile_options($${name} PRIVATE -ffp-contract=off)
    target_compile_options($${name}_test PRIVATE -ffp-contract=off)
    target_link_libraries($${name} PUBLIC m)
  endif()
  target_include_directories($${name} PUBLIC "$${CMAKE_CURRENT_SOURCE_DIR}")
  target_link_libraries($${name}_test PRIVATE $${name})
  if(CMAKE_SOURCE_DIR STREQUAL CMAKE_CURRENT_SOURCE_DIR)
    set_target_properties($${name}_test PROPERTIES EXCLUDE_FROM_ALL OFF)
    add_test(NAME $${name} COMMAND $${name}_test)
  endif()
endforeach()
"""
)
