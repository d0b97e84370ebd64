/* What compiled blocks need besides math.h. Scalar functions give the bits of Python's. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#ifndef WITHOUT_JUMPS
#include <setjmp.h>
#endif

/* One run's working memory. Every member has eight bytes on 64-bit machines.
 *
 * resume    : where a failure continues; unused without jumps.
 * failure   : the number of the failure, -1 for none; index, size and axis are those of an index.
 * arena     : memory of local arrays; used bytes of its size, and the most that were ever used.
 * tick, at  : the tick, and the number of the call in it.
 */
struct context {
    void *resume;
    int64_t failure, index, size, axis;
    unsigned char *arena;
    int64_t arena_size, arena_used, arena_most;
    int64_t tick, at;
};

/* A generator of random numbers: the state of PCG64, the lower half of each number first, as NumPy
 * has it in memory. See draws.h. */
struct draws {
    uint64_t state[2], increment[2];
};

#if defined(__GNUC__) || defined(__clang__)
#define COLD __attribute__((cold, noinline, unused))
#define NORETURN __attribute__((noreturn))
#define MAYBE_UNUSED __attribute__((unused))
#define LIKELY(x) __builtin_expect(!!(x), 1)
#else
#define COLD
#define NORETURN
#define MAYBE_UNUSED
#define LIKELY(x) (x)
#endif
#define INLINE static inline MAYBE_UNUSED

/* The C library's, as the compiler does not know them (see FLAGS of the toolchain), but of one
 * argument one result: two blocks that turn by one angle take its sine once. */
#if defined(__GNUC__) || defined(__clang__)
#define OF_ARGUMENTS(name) extern double name(double) __attribute__((const))
OF_ARGUMENTS(sin);
OF_ARGUMENTS(cos);
OF_ARGUMENTS(tan);
OF_ARGUMENTS(exp);
OF_ARGUMENTS(log);
#endif
/* A function of numbers that cannot fail. As a call it would keep the loop around it from being
 * vector instructions. */
#if defined(__GNUC__) || defined(__clang__)
#define LANE static inline __attribute__((always_inline, unused))
#else
#define LANE static inline
#endif
/* Before a loop whose rounds may be done at once. */
#if defined(__clang__)
/* It says so where it does not, as at -O0. */
#pragma clang diagnostic ignored "-Wpass-failed"
#define ANY_ORDER _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define ANY_ORDER _Pragma("GCC ivdep")
#else
#define ANY_ORDER
#endif

/* Failures. A function that may fail takes ctx first, and calls fail with a number of the unit.
 *
 * In a run of a graph, fail jumps out of all blocks. In an exported controller it returns, and the
 * first failure is kept; the function goes on with any value that the rest of its statement can take
 * (no undefined conversion, no division of integers by zero). After each statement with such a call,
 * LEAVE returns from the caller, and so on up to the controller's step:
 *
 *     const int64_t at_1_ = checked(ctx, i, 3, 0, 7);
 *     LEAVE(0.0);
 *     return state_x[at_1_];
 */
#ifdef WITHOUT_JUMPS
#define LEAVE(...) if (ctx->failure >= 0) return __VA_ARGS__

static COLD void fail(struct context *ctx, int64_t failure)
{
    if (ctx->failure < 0) ctx->failure = failure;
}
#else
#define LEAVE(...)

static COLD NORETURN void fail(struct context *ctx, int64_t failure)
{
    ctx->failure = failure;
    longjmp(*(jmp_buf *)ctx->resume, 1);
}
#endif

static COLD int64_t fail_index(struct context *ctx, int64_t index, int64_t size, int64_t axis,
                               int64_t failure)
{
    if (ctx->failure < 0) {
        ctx->index = index;
        ctx->size = size;
        ctx->axis = axis;
    }
    fail(ctx, failure);
    return 0;
}

/* Bytes that local arrays begin at a multiple of: those of a vector register, or fewer where memory
 * is dear. */
#ifndef ARENA_STEP
#define ARENA_STEP 32
#endif

/* Memory for a local array, valid until the block's call ends. */
INLINE void *take(struct context *ctx, int64_t bytes, int64_t failure)
{
    bytes = (bytes + ARENA_STEP - 1) & ~(int64_t)(ARENA_STEP - 1);
    if (!LIKELY(bytes >= 0 && bytes <= ctx->arena_size - ctx->arena_used)) {
        fail_index(ctx, ctx->arena_used, bytes, 0, failure);
        return ctx->arena;
    }
    void *found = ctx->arena + ctx->arena_used;
    ctx->arena_used += bytes;
    if (ctx->arena_used > ctx->arena_most) ctx->arena_most = ctx->arena_used;
    return found;
}

/* An index as Python reads it: negative ones count from the end. */
INLINE int64_t wrapped(int64_t index, int64_t size)
{
    return index < 0 ? index + size : index;
}

INLINE int64_t checked(struct context *ctx, int64_t index, int64_t size, int64_t axis,
                       int64_t failure)
{
    if (LIKELY((uint64_t)index < (uint64_t)size)) return index;
    if (index < 0 && index + size >= 0) return index + size;
    return fail_index(ctx, index, size, axis, failure);
}

/* A bound of a slice. */
INLINE int64_t clamped(int64_t bound, int64_t size)
{
    if (bound < 0) bound += size;
    return bound < 0 ? 0 : bound > size ? size : bound;
}

INLINE int64_t not_negative(int64_t count)
{
    return count < 0 ? 0 : count;
}

/* The size of a new array along an axis. */
INLINE int64_t array_size(struct context *ctx, int64_t size, int64_t failure)
{
    if (!LIKELY(size >= 0)) {
        fail(ctx, failure);
        return 0;
    }
    return size;
}

/* The size that two axes share; an axis of size one is repeated, so it must be known to be one. */
INLINE int64_t same_size(struct context *ctx, int64_t a, int64_t b, int64_t failure)
{
    if (!LIKELY(a == b)) fail_index(ctx, a, b, 0, failure);
    return a;
}

INLINE double divide(struct context *ctx, double a, double b, int64_t failure)
{
    if (!LIKELY(b != 0.0)) fail(ctx, failure);
    return a / b;
}

/* Python's float %: the sign of the divisor. */
INLINE double modulo(double a, double b)
{
    double rest = fmod(a, b);
    if (rest != 0.0) return (b < 0.0) != (rest < 0.0) ? rest + b : rest;
    return copysign(0.0, b);
}

INLINE double modulo_checked(struct context *ctx, double a, double b, int64_t failure)
{
    if (!LIKELY(b != 0.0)) fail(ctx, failure);
    return modulo(a, b);
}

/* NumPy's %, NaN for a divisor of zero. */
INLINE double np_modulo(double a, double b)
{
    return b == 0.0 ? (double)NAN : modulo(a, b);
}

/* Python's float //, and NumPy's: a / b for a divisor of zero. */
INLINE double np_floor_divide(double a, double b)
{
    if (b == 0.0) return a / b;
    double rest = fmod(a, b), quotient = (a - rest) / b;
    if (rest != 0.0 && (b < 0.0) != (rest < 0.0)) quotient -= 1.0;
    if (quotient == 0.0) return copysign(0.0, a / b);
    double whole = floor(quotient);
    return quotient - whole > 0.5 ? whole + 1.0 : whole;
}

INLINE double floor_divide(struct context *ctx, double a, double b, int64_t failure)
{
    if (!LIKELY(b != 0.0)) fail(ctx, failure);
    return np_floor_divide(a, b);
}

/* Whole numbers: Python's have any size, so a result beyond 64 bits is a failure. NumPy's scalars
 * wrap around with a warning, its arrays in silence (the functions wrap_...). */

INLINE int64_t int_add(struct context *ctx, int64_t a, int64_t b, int64_t failure)
{
    if (!LIKELY(b < 0 ? a >= INT64_MIN - b : a <= INT64_MAX - b)) {
        fail(ctx, failure);
        return 0;
    }
    return a + b;
}

INLINE int64_t int_subtract(struct context *ctx, int64_t a, int64_t b, int64_t failure)
{
    if (!LIKELY(b < 0 ? a <= INT64_MAX + b : a >= INT64_MIN + b)) {
        fail(ctx, failure);
        return 0;
    }
    return a - b;
}

INLINE bool int_product_fits(int64_t a, int64_t b)
{
    if (LIKELY(a >= -INT32_MAX && a <= INT32_MAX && b >= -INT32_MAX && b <= INT32_MAX)) return true;
    if (a == 0 || b == 0) return true;
    if ((a == -1 && b == INT64_MIN) || (b == -1 && a == INT64_MIN)) return false;
    return (int64_t)((uint64_t)a * (uint64_t)b) / b == a;
}

INLINE int64_t int_multiply(struct context *ctx, int64_t a, int64_t b, int64_t failure)
{
    if (!LIKELY(int_product_fits(a, b))) {
        fail(ctx, failure);
        return 0;
    }
    return a * b;
}

INLINE int64_t wrap_add(int64_t a, int64_t b)
{
    return (int64_t)((uint64_t)a + (uint64_t)b);
}

INLINE int64_t wrap_subtract(int64_t a, int64_t b)
{
    return (int64_t)((uint64_t)a - (uint64_t)b);
}

INLINE int64_t wrap_multiply(int64_t a, int64_t b)
{
    return (int64_t)((uint64_t)a * (uint64_t)b);
}

INLINE int64_t int_floor_divide(struct context *ctx, int64_t a, int64_t b, int64_t failure)
{
    if (!LIKELY(b != 0 && (b != -1 || a != INT64_MIN))) {
        fail(ctx, failure);
        return 0;
    }
    int64_t quotient = a / b;
    return quotient - (a % b != 0 && (a < 0) != (b < 0));
}

INLINE int64_t int_modulo(struct context *ctx, int64_t a, int64_t b, int64_t failure)
{
    if (!LIKELY(b != 0 && (b != -1 || a != INT64_MIN))) {
        fail(ctx, failure);
        return 0;
    }
    int64_t rest = a % b;
    return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
}

INLINE int64_t int_power(struct context *ctx, int64_t base, int64_t exponent, int64_t failure)
{
    int64_t result = 1;
    bool fits = exponent >= 0;
    for (; fits && exponent > 0; exponent >>= 1) {
        if (exponent & 1) {
            fits = int_product_fits(result, base);
            if (fits) result *= base;
        }
        if (exponent > 1 && fits) {
            fits = int_product_fits(base, base);
            if (fits) base *= base;
        }
    }
    if (!LIKELY(fits)) fail(ctx, failure);
    return result;
}

INLINE int64_t shift_left(struct context *ctx, int64_t a, int64_t count, int64_t failure)
{
    if (LIKELY(count >= 0 && count < 63)) {
        int64_t shifted = (int64_t)((uint64_t)a << count);
        if (LIKELY(shifted >> count == a)) return shifted;
    }
    fail(ctx, failure);
    return 0;
}

INLINE int64_t shift_right(struct context *ctx, int64_t a, int64_t count, int64_t failure)
{
    if (!LIKELY(count >= 0)) {
        fail(ctx, failure);
        return 0;
    }
    return a >> (count < 63 ? count : 63);
}

/* A whole number as a float of the same value: Python compares and divides whole numbers exactly,
 * beyond 2**53 too. */
INLINE double exact(struct context *ctx, int64_t a, int64_t failure)
{
    if (!LIKELY(a >= -9007199254740992 && a <= 9007199254740992)) fail(ctx, failure);
    return (double)a;
}

/* A result of numbers that may be whole ones in Python: as such it has no -0.0 and is not rounded. */
INLINE double either(struct context *ctx, double a, int64_t failure)
{
    if (!LIKELY((a != 0.0 || !signbit(a)) && !(fabs(a) > 9007199254740992.0))) fail(ctx, failure);
    return a;
}

/* Functions of the math module: Python raises ValueError where a result is NaN for numbers, and
 * OverflowError where it is infinite for finite ones. */
static COLD double not_real(struct context *ctx, double result, double x, double y, int64_t failure)
{
    bool overflows = isinf(result) && isfinite(x) && isfinite(y);
    if (overflows || (isnan(result) && !isnan(x) && !isnan(y))) fail(ctx, failure);
    return result;
}

#define REAL(name) \
    INLINE double real_##name(struct context *ctx, double x, int64_t failure) \
    { \
        double result = name(x); \
        return LIKELY(isfinite(result)) ? result : not_real(ctx, result, x, 0.0, failure); \
    }
#define REAL_TWO(name) \
    INLINE double real_##name(struct context *ctx, double x, double y, int64_t failure) \
    { \
        double result = name(x, y); \
        return LIKELY(isfinite(result)) ? result : not_real(ctx, result, x, y, failure); \
    }

/* The C library's pow; a compiler would write x * x for a known exponent. */
INLINE double power(double base, double exponent)
{
    volatile double hidden = exponent;
    return pow(base, hidden);
}

REAL(sin)
REAL(cos)
REAL(tan)
REAL(asin)
REAL(acos)
REAL(sinh)
REAL(cosh)
REAL(acosh)
REAL(atanh)
REAL(exp)
REAL(exp2)
REAL(expm1)
REAL(log)
REAL(log1p)
REAL(log2)
REAL(log10)
REAL(sqrt)
REAL_TWO(fmod)
REAL_TWO(remainder)
REAL_TWO(power)

/* NumPy's power of an array by one number: some exponents have a shorter way. */
INLINE double np_power(double base, double exponent)
{
    if (exponent == 2.0) return base * base;
    if (exponent == 0.5) return sqrt(base);
    if (exponent == -1.0) return 1.0 / base;
    return power(base, exponent);
}

INLINE int64_t to_int(struct context *ctx, double x, int64_t failure)
{
    if (!LIKELY(x >= -9223372036854775808.0 && x < 9223372036854775808.0)) {
        fail(ctx, failure);
        return 0;
    }
    /* gcc takes (double)(int64_t)x for trunc(x), which is -0.0 for -0.5. */
    return x > -1.0 && x < 1.0 ? 0 : (int64_t)x;
}

/* Python's min and max of two: the first, unless the second is smaller (greater). */
INLINE double least(double a, double b)
{
    return b < a ? b : a;
}

INLINE double greatest(double a, double b)
{
    return b > a ? b : a;
}

INLINE int64_t int_least(int64_t a, int64_t b)
{
    return b < a ? b : a;
}

INLINE int64_t int_greatest(int64_t a, int64_t b)
{
    return b > a ? b : a;
}

/* NumPy's: NaN if either is; clip keeps a number that equals its bound, as -0.0. */
INLINE double np_least(double a, double b)
{
    return a < b || a != a ? a : b;
}

INLINE double np_greatest(double a, double b)
{
    return a > b || a != a ? a : b;
}

INLINE double np_clip(double x, double low, double high)
{
    double found = x >= low || x != x ? x : low;
    return found <= high || found != found ? found : high;
}

/* 2^k for whole k from -1022 to 1023. To 1.5 2^52 + 1023 is added what becomes the last bits. */
INLINE double power_of_two(double k)
{
    union { double number; uint64_t bits; } found = {k + (6755399441055744.0 + 1023.0)};
    found.bits <<= 52;
    return found.number;
}

/* The exponent of a normal number above 0: as the last bits of 2^52, since few processors convert
 * integers of 64 bits in vector instructions. */
INLINE double exponent_of(double x)
{
    union { double number; uint64_t bits; } found = {x};
    found.bits = found.bits >> 52 | UINT64_C(0x4330000000000000);
    return found.number - (4503599627370496.0 + 1023.0);
}

INLINE int64_t int_abs(struct context *ctx, int64_t a, int64_t failure)
{
    if (!LIKELY(a != INT64_MIN)) fail(ctx, failure);
    return a < 0 ? -a : a;
}

INLINE int64_t int_sign(int64_t a)
{
    return (a > 0) - (a < 0);
}

INLINE double sign_of(double a)
{
    return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : a == 0.0 ? 0.0 : a;
}

/* math.hypot of two: rounded correctly in all but very few cases, as Python's is. */
INLINE double length_of(double a, double b)
{
    double x[2] = {fabs(a), fabs(b)};
    double most = x[0] > x[1] ? x[0] : x[1];
    if (isinf(x[0]) || isinf(x[1])) return (double)INFINITY;
    if (isnan(x[0]) || isnan(x[1])) return (double)NAN;
    if (most == 0.0) return 0.0;
    int exponent;
    frexp(most, &exponent);
    if (exponent < -1022) {
        x[0] /= most;
        x[1] /= most;
        exponent = 0;
    } else {
        most = 1.0;
    }
    double scale = ldexp(1.0, -exponent), sum = 1.0, before, high, low, t, y;
    double first = 0.0, second = 0.0, third = 0.0;
    for (int i = 0; i < 2; i++) {
        y = x[i] * scale;
        t = y * 134217729.0;
        high = t - (t - y);
        low = y - high;
        y = high * high;
        before = sum;
        sum += y;
        first += (before - sum) + y;
        y = 2.0 * high * low;
        before = sum;
        sum += y;
        second += (before - sum) + y;
        third += low * low;
    }
    double root = sqrt(sum - 1.0 + (first + second + third));
    t = root * 134217729.0;
    high = t - (t - root);
    low = root - high;
    y = -high * high;
    before = sum;
    sum += y;
    first += (before - sum) + y;
    y = -2.0 * high * low;
    before = sum;
    sum += y;
    second += (before - sum) + y;
    y = -low * low;
    before = sum;
    sum += y;
    third += (before - sum) + y;
    y = sum - 1.0 + (first + second + third);
    return most * ((root + y / (2.0 * root)) / scale);
}

/* NumPy's sum of a contiguous array, in its order: eight sums at once, blocks of 128 in pairs. */
INLINE double sum_few(const double *a, int64_t n)
{
    double sum[8];
    int64_t i;
    if (n < 8) {
        double total = n > 0 ? a[0] : 0.0;
        for (i = 1; i < n; i++) total += a[i];
        return total;
    }
    for (i = 0; i < 8; i++) sum[i] = a[i];
    for (i = 8; i < n - n % 8; i += 8)
        for (int k = 0; k < 8; k++) sum[k] += a[i + k];
    double total = ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
    for (; i < n; i++) total += a[i];
    return total;
}

static MAYBE_UNUSED double sum_of(const double *a, int64_t n)
{
    /* Halves are split depth first; the left half's sum waits on a stack for the right one's. */
    struct {
        const double *a;
        int64_t n;
        double left;
        int stage;
    } stack[64];
    int depth = 0;
    double value = 0.0;
    stack[0].a = a;
    stack[0].n = n;
    stack[0].stage = 0;
    while (depth >= 0) {
        int64_t size = stack[depth].n, half = size / 2;
        half -= half % 8;
        if (stack[depth].stage == 0 && size <= 128) {
            value = sum_few(stack[depth].a, size);
            depth--;
            continue;
        }
        if (stack[depth].stage < 2) {
            int right = stack[depth].stage++;
            if (right) stack[depth].left = value;
            stack[depth + 1].a = stack[depth].a + (right ? half : 0);
            stack[depth + 1].n = right ? size - half : half;
            stack[depth + 1].stage = 0;
            depth++;
            continue;
        }
        value = stack[depth].left + value;
        depth--;
    }
    return value + 0.0; /* NumPy adds to 0: the sum of -0.0 is 0.0 */
}

INLINE void copy_numbers(double *to, const double *from, int64_t n)
{
    for (int64_t i = 0; i < n; i++) to[i] = from[i];
}
