/* Numbers: limits, rounding, seconds.  Saturates where an integer would overflow. */

#include "core.h"

sf_real sf_least(sf_real a, sf_real b) { return b < a ? b : a; }
sf_real sf_most(sf_real a, sf_real b) { return b > a ? b : a; }

int64_t sf_sum(int64_t a, int64_t b) {
    if (b > 0 && a > INT64_MAX - b) return INT64_MAX;
    if (b < 0 && a < INT64_MIN - b) return INT64_MIN;
    return a + b;
}

int64_t sf_difference(int64_t a, int64_t b) {
    if (b < 0 && a > INT64_MAX + b) return INT64_MAX;
    if (b > 0 && a < INT64_MIN + b) return INT64_MIN;
    return a - b;
}

int64_t sf_floor_ratio(int64_t a, int64_t b) {
    int64_t ratio = a / b;
    return a % b < 0 ? ratio - 1 : ratio;
}

#ifdef SF_DOUBLE
typedef int64_t whole;
#define LARGEST 9.2e18
#else
typedef int32_t whole; /* Conversions to 64 bits take double arithmetic in some libraries. */
#define LARGEST 2.1e9f
#endif

SHARED int64_t sf_whole(sf_real value) {
    if (!(value > -LARGEST)) return (int64_t)-LARGEST;
    if (value > LARGEST) return (int64_t)LARGEST;
    return (whole)value;
}

SHARED int64_t sf_floor(sf_real value) {
    int64_t number = sf_whole(value);
    return (sf_real)number > value ? number - 1 : number;
}

int64_t sf_nearest(sf_real value) {
    int64_t below = sf_floor(value);
    sf_real part = value - (sf_real)below;
    bool up = part > R(0.5) || (part == R(0.5) && below % 2 != 0);
    return up ? below + 1 : below;
}

#ifdef SF_DOUBLE
sf_real sf_seconds_of_ns(int64_t ns) { return (double)ns / 1e9; }
sf_real sf_seconds_of_ms(int64_t ms) { return (double)ms / 1000.0; }
#else
/* A 64-bit integer in two parts, each of which the processor converts by itself. */
sf_real sf_seconds_of_ns(int64_t ns) {
    if (ns > ((int64_t)1 << 50)) return 1.125e6f;
    if (ns < -((int64_t)1 << 50)) return -1.125e6f;
    return (float)(int32_t)(ns >> 20) * 1.048576e-3f + (float)(int32_t)(ns & 0xFFFFF) * 1e-9f;
}

sf_real sf_seconds_of_ms(int64_t ms) {
    if (ms > INT32_MAX) return 2.1e6f;
    if (ms < INT32_MIN) return -2.1e6f;
    return (float)(int32_t)ms / 1000.0f;
}
#endif
