"""What the C text of every plan has in common.

In go the operations of a plan as lines of C (``c_plan``), in the place of the names in ``@``; out
comes the function that runs its ticks: ``@body@`` is what a tick does.
"""

from __future__ import annotations

import math

HELPERS = """
/* The plan is compiled with little optimisation; loops over long signals are worth more. */
#if defined(__GNUC__) && !defined(__clang__)
#define THOROUGH __attribute__((optimize("O3")))
#else
#define THOROUGH
#endif

static THOROUGH bool all_finite(const double *a, int64_t n)
{
    int64_t wrong = 0;
    for (int64_t i = 0; i < n; i++) wrong += !isfinite(a[i]);
    return !wrong;
}

static THOROUGH bool no_nan(const double *a, int64_t n)
{
    int64_t wrong = 0;
    for (int64_t i = 0; i < n; i++) wrong += isnan(a[i]);
    return !wrong;
}

static void set_zero(double *a, int64_t n)
{
    for (int64_t i = 0; i < n; i++) a[i] = 0.0;
}
"""
RUN = """
static int64_t ticks(struct plan *plan, const struct places *places, struct context *ctx,
                     int64_t first, int64_t last, int64_t low, int64_t high)
{
    const double dt = @dt@;
    (void)all_finite;
    (void)no_nan;
    (void)set_zero;
    (void)plan;
    (void)places;
    (void)low;
    (void)high;
    for (int64_t k = first; k < last; k++) {
        double t = (double)k * dt;
        (void)t;
        ctx->tick = k;
@body@
    }
    return 0;
}

#ifndef WITHOUT_JUMPS
int64_t run(struct plan *plan, const struct places *places, struct context *ctx, int64_t first,
            int64_t last, int64_t low, int64_t high);

/* Where a block fails, this function returns 2. It is none with all the calls: each of them would
   be a place to which setjmp may return, which takes the compiler long. */
int64_t run(struct plan *plan, const struct places *places, struct context *ctx, int64_t first,
            int64_t last, int64_t low, int64_t high)
{
    jmp_buf resume;
    ctx->resume = &resume;
    ctx->failure = -1;
    if (setjmp(resume)) return 2;
    return ticks(plan, places, ctx, first, last, low, high);
}
#endif
"""

# A step of a solver that may be too long: where a block fails in it, ``attempt`` returns 2.
ATTEMPT = """
#if defined(__GNUC__) || defined(__clang__)
#define APART __attribute__((noinline))
#else
#define APART
#endif

static APART int64_t stages(struct plan *plan, const struct places *places, struct context *ctx,
                            int64_t k, double done, double h)
{
    const double dt = @dt@;
    (void)all_finite;
    (void)no_nan;
    (void)set_zero;
    (void)plan;
    (void)places;
    double t = 0.0;
    (void)t;
@body@
    return 0;
}

static APART int64_t attempt(struct plan *plan, const struct places *places, struct context *ctx,
                             int64_t k, double done, double h)
{
    const int64_t used = ctx->arena_used;
#ifdef WITHOUT_JUMPS
    const int64_t ended = stages(plan, places, ctx, k, done, h);
#else
    jmp_buf resume;
    void *const outer = ctx->resume;
    int64_t ended = 2;
    ctx->resume = &resume;
    if (!setjmp(resume)) ended = stages(plan, places, ctx, k, done, h);
    ctx->resume = outer;
#endif
    ctx->arena_used = used;
    return ended;
}
"""


def literal(value: float) -> str:
    if math.isnan(value):
        return "(double)NAN"  # the macro is a float
    return repr(value) if math.isfinite(value) else f"{'-' * (value < 0)}INFINITY"
