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

/* Numbers that may be changed between two steps; init sets them. */
struct ${name}_parameters {
${parameters}
};

/* What blocks have computed. */
${signals}
struct ${name} {
    int64_t tick;
    int failure; /* 0: none; see ${name}_message */
    struct ${name}_parameters parameters;
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

#endif
"""
)

SOURCE = Template(
    r"""/* ${about} */

#include "${name}.h"

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
    const int64_t ended = ticks(&c->signals, &places, &ctx, c->tick, c->tick + 1, 0, 1);
    if (ended) c->failure = failed(&ctx, ended);
    if (ended && ended != ${stopped}) return c->failure;
${checks}
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
    r"""/* Replays ${ticks} recorded ticks through ${name}.c and compares every output.
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
#define TOLERANCE ${tolerance} /* of the difference, divided by 1 + |recorded value| */

${tables}
static const char *const labels[${count}] = {${labels}};
static double largest[${count}];
static struct ${name} controller;

static void compare(int output, double found, double recorded)
{
    double difference = fabs(found - recorded) / (1.0 + fabs(recorded));
    if (isinf(recorded) && found == recorded) difference = 0.0;
    if (!(difference <= largest[output])) largest[output] = difference;
}

int main(void)
{
    struct ${name}_inputs in;
    struct ${name}_outputs out;
    int wrong = 0;
    ${name}_init(&controller);
    for (int tick = 0; tick < TICKS; tick++) {
${gives}
        const int failure = ${name}_step(&controller, &in, &out);
        if (failure && !(failure == ${stopped} && tick + 1 == TICKS)) { /* a run may end itself */
            printf("tick %d: %s\n", tick, ${name}_message(failure));
            return 1;
        }
${compares}
    }
    for (int i = 0; i < ${count}; i++) {
        const int bad = !(largest[i] <= TOLERANCE);
        printf("%s %s: largest difference %.3g\n", bad ? "WRONG" : "fine", labels[i], largest[i]);
        wrong += bad;
    }
    printf("%d ticks, tolerance %.3g: %s\n", TICKS, TOLERANCE, wrong ? "WRONG" : "fine");
    fflush(stdout);
    return wrong != 0;
}
"""
)
