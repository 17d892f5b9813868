/* Numbers: limits, rounding, seconds. */

#include "core.h"

SHARED sf_real sf_least(sf_real a, sf_real b) { return b < a ? b : a; }
SHARED sf_real sf_most(sf_real a, sf_real b) { return b > a ? b : a; }

sf_real sf_positive(sf_real value) { return sf_most(value, R(0)); }

SHARED sf_real sf_clamp(sf_real value, sf_real low, sf_real high) {
    return sf_least(sf_most(value, low), high);
}

sf_real sf_within(sf_real value, sf_real most) { return sf_clamp(value, -most, most); }

int64_t sf_floor_ratio(int64_t a, int64_t b) {
    int64_t ratio = a / b;
    return a % b < 0 ? ratio - 1 : ratio;
}

#ifdef SF_DOUBLE
#define LARGEST 9.2e18
#define UNIT 6755399441055744.0 /* 1.5 * 2^52: beside it only whole numbers are left */
#else
#define LARGEST 2.1e9f
#define UNIT 12582912.0f /* 1.5 * 2^23 */
#endif

/* The order of the limits makes one of NaN. */
SHARED sf_int sf_whole(sf_real value) { return (sf_int)sf_clamp(-LARGEST, value, LARGEST); }

sf_int sf_milli(sf_real value) { return sf_whole((R(1000) * value + UNIT) - UNIT); }

sf_real sf_seconds_of_ns(int64_t ns) { return (sf_real)ns / R(1e9); }

#include "core_end.h"
