/* What the core needs of a C library, for a module that is linked with none.

   Sine, cosine and arcus tangens are good to a few units of the last place for |x| < 10^4, in float
   and in double. */

#include "splinefleet.h"

#define R(number) ((sf_real)(number))

/* Pi / 2 in parts, of which the first ones have room for a factor. */
#ifdef SF_DOUBLE
#define NAMED(name) name
double sqrt(double);
typedef int64_t whole;
static const sf_real PARTS[3] = {1.57079632673412561417, 6.07710050630396597660e-11,
                                 2.02226624879595063154e-21};
#else
#define NAMED(name) name##f
float sqrtf(float);
typedef int32_t whole;
static const sf_real PARTS[3] = {1.5703125f, 4.8351287841796875e-4f, 3.139164786504813e-7f};
#endif

sf_real NAMED(sin)(sf_real x);
sf_real NAMED(cos)(sf_real x);
sf_real NAMED(atan2)(sf_real y, sf_real x);
void *memcpy(void *restrict to, const void *restrict from, size_t count);
void *memset(void *to, int value, size_t count);

/* Bytes are volatile so that a compiler does not make of these loops what they are. */
void *memcpy(void *restrict to, const void *restrict from, size_t count) {
    const uint8_t *in = from;
    for (volatile uint8_t *out = to; count > 0; count--) *out++ = *in++;
    return to;
}

void *memset(void *to, int value, size_t count) {
    for (volatile uint8_t *out = to; count > 0; count--) *out++ = (uint8_t)value;
    return to;
}

/* The sine of x plus so many quarters of a turn, by the series of what is left of whole quarters. */
static sf_real sine(sf_real x, whole quarters) {
    whole turned = (whole)(x * R(0.6366197723675814) + (x < R(0) ? R(-0.5) : R(0.5)));
    for (int i = 0; i < 3; i++) x -= (sf_real)turned * PARTS[i];
    quarters += turned;
    sf_real step = quarters & 1 ? R(0) : R(1), term = quarters & 1 ? R(1) : x, sum = term;
    for (int i = 0; i < 9; i++, step += R(2)) {
        term *= -x * x / ((step + R(1)) * (step + R(2)));
        sum += term;
    }
    return quarters & 2 ? -sum : sum;
}

sf_real NAMED(sin)(sf_real x) { return sine(x, 0); }
sf_real NAMED(cos)(sf_real x) { return sine(x, 1); }

/* The ratio of both, at most 1, is halved as an angle twice; a series has the rest. */
sf_real NAMED(atan2)(sf_real y, sf_real x) {
    sf_real high = x < R(0) ? -x : x, low = y < R(0) ? -y : y;
    bool steep = low > high;
    if (high == R(0) && low == R(0)) return y;
    sf_real ratio = steep ? high / low : low / high;
    for (int i = 0; i < 2; i++) ratio /= R(1) + NAMED(sqrt)(R(1) + ratio * ratio);
    sf_real sum = R(0);
    for (int i = 23; i > 0; i -= 2) sum = R(1) / (sf_real)i - sum * ratio * ratio;
    sum *= R(4) * ratio;
    if (steep) sum = R(1.5707963267948966) - sum;
    if (x < R(0)) sum = R(3.141592653589793) - sum;
    return y < R(0) ? -sum : sum;
}
