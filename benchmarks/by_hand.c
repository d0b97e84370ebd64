/* Loops that know one diagram and nothing else: the yardstick of the compiled engine.
 *
 * case_a : two populations, each in one fused pass; those that wake or spike are listed, without
 *          branches, and computed from the list; what the next tick decodes is summed while the
 *          weights learn. With VECTOR, expm1 and log1p are polynomials that a compiler turns into
 *          vector instructions; without, the C library's.
 * tracking : the control part alone. gains : a chain of factors.
 */

#include <math.h>
#include <stdint.h>
#include <string.h>

#define TAU_RC 0.02
#define TAU_REF 0.002
#define TURN 6.283185307179586

#ifdef VECTOR
/* After FreeBSD's s_expm1.c and s_log1p.c, with selections in the place of branches. */
#define LN2_HIGH 6.93147180369123816490e-01
#define LN2_LOW 1.90821492927058770002e-10
#define WHOLE 6755399441055744.0 /* 1.5 2^52: numbers added to it are rounded to whole ones */

static inline double of_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static inline uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double vector_expm1(double x)
{
    const double k = (x * 1.4426950408889634 + WHOLE) - WHOLE;
    const double high = x - k * LN2_HIGH, low = k * LN2_LOW, r = high - low;
    const double c = (high - r) - low, half = 0.5 * r, square = r * half;
    const double p = 1.0 + square * (-3.33333333333331316428e-02 + square * (
        1.58730158725481460165e-03 + square * (-7.93650757867487942473e-05 + square * (
        4.00821782732936239552e-06 + square * -2.01099218183624371326e-07))));
    const double t = 3.0 - p * half;
    const double e = (r * (square * ((p - t) / (6.0 - r * t)) - c) - c) - square;
    const double scale = of_bits(bits_of(k + (WHOLE + 1023.0)) << 52);
    return scale * (r - e) + (scale - 1.0);
}

static inline double vector_log1p(double x)
{
    const double u = 1.0 + x;
    const uint64_t bits = bits_of(u) + (UINT64_C(0x3ff00000 - 0x3fe6a09e) << 32);
    const double k = of_bits((bits >> 52) | UINT64_C(0x4330000000000000)) - (4503599627370496.0 + 1023.0);
    const double m = of_bits((bits & UINT64_C(0xfffffffffffff)) + (UINT64_C(0x3fe6a09e) << 32));
    const double lost = k >= 2.0 ? 1.0 - (u - x) : x - (u - 1.0);
    const double f = k == 0.0 ? x : m - 1.0, c = k == 0.0 ? 0.0 : lost / u;
    const double half = 0.5 * f * f, s = f / (2.0 + f), z = s * s, w = z * z;
    const double even = w * (3.999999999940941908e-01 + w * (
        2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    const double odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * (
        1.818357216161805012e-01 + w * 1.479819860510658591e-01)));
    return s * (half + (odd + even)) + (k * LN2_LOW + c) - half + f + k * LN2_HIGH;
}

#define EXPM1 vector_expm1
#define LOG1P vector_log1p
#else
#define EXPM1 expm1
#define LOG1P log1p
#endif

/* What both populations share: gamma is kappa dt / n, kick the jump of an activity by a spike. */
struct step {
    int64_t n;
    double dt, fade, kick, whole;
    double *restrict current, *restrict value;
    int64_t *restrict few;
};

/* Neurons that wake or spike in this step, from the list of the first `count` of them. */
static void seldom(const struct step *p, int64_t count, double *restrict voltage,
                   double *restrict refractory, double *restrict activity)
{
    const double dt = p->dt, kick = p->kick;
    const double *restrict current = p->current;
    double *restrict value = p->value;
    int64_t *restrict few = p->few;
#ifdef VECTOR
    int64_t spiking = 0;
    for (int64_t k = 0; k < count; k++) {
        const double left = refractory[few[k]];
        value[k] = left > 0.0 && left < dt ? (left - dt) / TAU_RC : 0.0;
    }
    for (int64_t k = 0; k < count; k++) value[k] = EXPM1(value[k]);
    for (int64_t k = 0; k < count; k++) {
        const int64_t i = few[k];
        double v = voltage[i] - (current[i] - voltage[i]) * value[k];
        v = v > 0.0 ? v : 0.0;
        voltage[i] = v > 1.0 ? 0.0 : v;
        few[spiking] = i;
        value[spiking] = (1.0 - v) / (current[i] - 1.0);
        spiking += v > 1.0;
    }
    for (int64_t k = 0; k < spiking; k++) value[k] = TAU_REF + dt + TAU_RC * LOG1P(value[k]);
    for (int64_t k = 0; k < spiking; k++) {
        refractory[few[k]] = value[k];
        activity[few[k]] += kick;
    }
#else
    (void)value;
    for (int64_t k = 0; k < count; k++) {
        const int64_t i = few[k];
        if (refractory[i] > 0.0 && refractory[i] < dt) {
            const double rise = EXPM1((refractory[i] - dt) / TAU_RC);
            const double v = voltage[i] - (current[i] - voltage[i]) * rise;
            voltage[i] = v > 0.0 ? v : 0.0;
        }
        if (voltage[i] > 1.0) {
            refractory[i] = TAU_REF + dt + TAU_RC * LOG1P((1.0 - voltage[i]) / (current[i] - 1.0));
            voltage[i] = 0.0;
            activity[i] += kick;
        }
    }
#endif
}

/* One step of a population for its signal, which is its error, too; returns what it decodes. */
static double population(const struct step *p, double signal, double gamma,
                         const double *restrict encoder, const double *restrict bias,
                         double *restrict voltage, double *restrict refractory,
                         double *restrict activity, double *restrict weight)
{
    const int64_t n = p->n;
    const double dt = p->dt, fade = p->fade, whole = p->whole;
    double *restrict current = p->current;
    int64_t *restrict few = p->few, count = 0;
    for (int64_t i = 0; i < n; i++) {
        const double left = refractory[i] - dt, j = encoder[i] * signal + bias[i];
        const double v = voltage[i] - (j - voltage[i]) * (left <= 0.0 ? whole : 0.0);
        refractory[i] = left;
        current[i] = j;
        voltage[i] = v > 0.0 ? v : 0.0;
        activity[i] *= fade;
        /* By selections: gcc makes no vectors of '|' of comparisons of doubles as an integer. */
        few[i] = v > 1.0 ? 1 : left > 0.0 ? left < dt : 0;
    }
    for (int64_t i = 0; i < n; i++) {
        const int64_t marked = few[i];
        few[count] = i;
        count += marked;
    }
    seldom(p, count, voltage, refractory, activity);

    const double slope = gamma * signal;
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int64_t i = 0;
    for (; i + 4 <= n; i += 4) {
        for (int64_t k = 0; k < 4; k++) {
            weight[i + k] -= slope * activity[i + k];
            sum[k] += weight[i + k] * activity[i + k];
        }
    }
    for (; i < n; i++) {
        weight[i] -= slope * activity[i];
        sum[0] += weight[i] * activity[i];
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Filters of silent neurons would become denormal numbers. */
static void flush(double *restrict x, int64_t n)
{
    for (int64_t i = 0; i < n; i++) x[i] = fabs(x[i]) < 1e-140 ? 0.0 : x[i];
}

/* numbers : x, y, theta, dt, forward, the gains (2, 3), kappa (2), tau of the synapse.
 * encoders, bias, voltage : (2, n). work : 9 n numbers that are 0, as are n of few.
 * path : (samples, 3). poses : (ticks, 3), what the run was. */
void case_a(const double *numbers, int64_t every, const double *path, int64_t samples,
            int64_t window, int64_t n, const double *encoders, const double *bias, double *voltage,
            double *work, int64_t *few, double *poses, int64_t ticks)
{
    double x = numbers[0], y = numbers[1], theta = numbers[2];
    const double dt = numbers[3], forward = numbers[4], *gain = numbers + 5;
    const double pass_on = -expm1(-dt / numbers[13]);
    const double gamma[2] = {numbers[11] * dt / (double)n, numbers[12] * dt / (double)n};
    double *refractory = work, *activity = work + 2 * n, *weight = work + 4 * n;
    const struct step step = {n, dt, 1.0 - pass_on, pass_on / dt, EXPM1(-dt / TAU_RC),
                              work + 6 * n, work + 7 * n, few};
    double held[2] = {0.0, 0.0}, signal[2] = {0.0, 0.0}, decoded[2] = {0.0, 0.0};
    int64_t last = -1;
    for (int64_t tick = 0; tick < ticks; tick++) {
        poses[3 * tick] = x, poses[3 * tick + 1] = y, poses[3 * tick + 2] = theta;
        if (tick % every == 0) {
            const int64_t first = last < window ? 0 : last - window;
            const int64_t end = last < 0 || last + window >= samples ? samples : last + window + 1;
            double least = INFINITY;
            for (int64_t i = first; i < end; i++) {
                const double dx = path[3 * i] - x, dy = path[3 * i + 1] - y;
                const double square = dx * dx + dy * dy;
                if (square < least) least = square, last = i;
            }
            const double *r = path + 3 * last, dx = x - r[0], dy = y - r[1];
            const double c = cos(r[2]), s = sin(r[2]), heading = remainder(theta - r[2], TURN);
            const double along = c * dx + s * dy, lateral = c * dy - s * dx;
            held[0] = forward - (gain[0] * along + gain[1] * lateral + gain[2] * heading);
            held[1] = -(gain[3] * along + gain[4] * lateral + gain[5] * heading);
            signal[0] = sqrt(dx * dx + dy * dy), signal[1] = heading;
        }
        double v = held[0] + decoded[0], omega = held[1] + decoded[1];
        if (fabs(omega) > 1.0) v /= fabs(omega), omega = copysign(1.0, omega);
        const double half = 0.25 * dt * omega;
        const double chord = dt * v * (half != 0.0 ? sin(half) / half : 1.0);
        x += chord * cos(theta + half);
        y += chord * sin(theta + half);
        theta += 2.0 * half;
        for (int64_t k = 0; k < 2; k++) {
            const int64_t at = k * n;
            decoded[k] = population(&step, signal[k], gamma[k], encoders + at, bias + at,
                                    voltage + at, refractory + at, activity + at, weight + at);
        }
        if (tick % 128 == 0) flush(voltage, 2 * n), flush(activity, 4 * n);
    }
}

/* numbers : x, y, theta, dt, the gains (2, 3). poses : (ticks, 3). */
void tracking(const double *numbers, double *poses, int64_t ticks)
{
    double x = numbers[0], y = numbers[1], theta = numbers[2];
    const double dt = numbers[3], *k = numbers + 4;
    for (int64_t tick = 0; tick < ticks; tick++) {
        poses[3 * tick] = x, poses[3 * tick + 1] = y, poses[3 * tick + 2] = theta;
        const double dy = y - 1.0, heading = remainder(theta, TURN);
        double v = 1.0 - (k[1] * dy + k[2] * heading);
        double omega = -(k[4] * dy + k[5] * heading);
        if (fabs(omega) > 1.0) v /= fabs(omega), omega = copysign(1.0, omega);
        x += dt * v * cos(theta);
        y += dt * v * sin(theta);
        theta += dt * 0.5 * omega;
    }
}

/* What a chain of factors makes of 1, recorded at every 100th tick. */
void gains(const double *factors, int64_t n, double *recorded, int64_t ticks)
{
    for (int64_t tick = 0; tick < ticks; tick++) {
        double x = 1.0;
        for (int64_t i = 0; i < n; i++) x = factors[i] * x;
        if (tick % 100 == 0) recorded[tick / 100] = x;
    }
}
