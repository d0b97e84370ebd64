/* Random numbers, equal to NumPy's: PCG64 (O'Neill, PCG: a family of simple fast space-efficient
 * statistically good algorithms for random number generation, 2014; XSL RR 128/64), and the ziggurat
 * of Marsaglia and Tsang. They are in double precision in a controller in float, too. */

@tables@

INLINE void multiply_wide(uint64_t a, uint64_t b, uint64_t *high, uint64_t *low)
{
#ifdef __SIZEOF_INT128__
    __extension__ typedef unsigned __int128 wide;
    const wide product = (wide)a * b;
    *high = (uint64_t)(product >> 64);
    *low = (uint64_t)product;
#else
    const uint64_t a0 = a & 0xffffffffu, a1 = a >> 32, b0 = b & 0xffffffffu, b1 = b >> 32;
    const uint64_t middle = a1 * b0 + (a0 * b0 >> 32), other = a0 * b1 + (middle & 0xffffffffu);
    *high = a1 * b1 + (middle >> 32) + (other >> 32);
    *low = a * b;
#endif
}

INLINE uint64_t draw_bits(struct draws *random)
{
    const uint64_t factor = UINT64_C(0x4385df649fccf645), upper = UINT64_C(0x2360ed051fc65da4);
    uint64_t high, low;
    multiply_wide(random->state[0], factor, &high, &low);
    high += random->state[1] * factor + random->state[0] * upper;
    random->state[0] = low + random->increment[0];
    random->state[1] = high + random->increment[1] + (random->state[0] < low);
    const uint64_t mixed = random->state[0] ^ random->state[1];
    const unsigned turn = (unsigned)(random->state[1] >> 58);
    return mixed >> turn | mixed << (-turn & 63u);
}

INLINE double draw_uniform(struct draws *random)
{
    return (double)(draw_bits(random) >> 11) * 0x1p-53;
}

/* Of a draw outside of the layer below: the tail, or the part of a layer under the curve. */
static COLD bool normal_ends(struct draws *random, unsigned layer, uint64_t bits, double *x)
{
    const double r = 3.6541528853610087963519472518, inverse = 0.27366123732975827203338247596;
    if (layer) {
        const double height = (normal_f[layer - 1] - normal_f[layer]) * draw_uniform(random);
        return height + normal_f[layer] < exp(-0.5 * *x * *x);
    }
    for (;;) {
        const double over = -inverse * log1p(-draw_uniform(random));
        const double height = -log1p(-draw_uniform(random));
        if (height + height > over * over) {
            *x = bits >> 8 & 1 ? -(r + over) : r + over;
            return true;
        }
    }
}

INLINE double draw_normal(struct draws *random)
{
    for (;;) {
        const uint64_t drawn = draw_bits(random);
        const unsigned layer = (unsigned)(drawn & 0xff);
        const uint64_t bits = drawn >> 9 & UINT64_C(0xfffffffffffff);
        double x = (double)bits * normal_w[layer];
        if (drawn >> 8 & 1) x = -x;
        if (LIKELY(bits < normal_k[layer]) || normal_ends(random, layer, bits, &x)) return x;
    }
}

INLINE double draw_exponential(struct draws *random)
{
    for (;;) {
        const uint64_t drawn = draw_bits(random) >> 3, bits = drawn >> 8;
        const unsigned layer = (unsigned)(drawn & 0xff);
        const double x = (double)bits * exponential_w[layer], *const f = exponential_f;
        if (LIKELY(bits < exponential_k[layer])) return x;
        if (!layer) return 7.69711747013104972 - log1p(-draw_uniform(random));
        if ((f[layer - 1] - f[layer]) * draw_uniform(random) + f[layer] < exp(-x)) return x;
    }
}

