/* The host program on an emulated Cortex-M4F, with its ticks counted in instructions.

   The emulator advances its time by 1 ns per instruction; SysTick counts that in steps of 40. */

#include <stdint.h>
#include <stdio.h>

#include "splinefleet.h"

#define STEP 40
#define SYSTICK ((volatile uint32_t *)0xE000E010)
#define CPACR (*(volatile uint32_t *)0xE000ED88)

static uint64_t ticks, sum, reading, readings;
static uint32_t worst, worst_reading, worst_hearing;

static uint32_t since(uint32_t before) { return ((before - SYSTICK[2]) & 0xFFFFFF) * STEP; }

static void count_tick(sf_agent *agent, int64_t now_ns, sf_real x, sf_real y, sf_real heading) {
    bool reads = sf_is_reading(agent);
    uint32_t before = SYSTICK[2];
    sf_tick(agent, now_ns, x, y, heading);
    uint32_t passed = since(before);
    if (reads) {
        readings++;
        reading += passed;
        if (passed > worst_reading) worst_reading = passed;
    } else if (agent->phase == SF_MOVING) {
        ticks++;
        sum += passed;
        if (passed > worst) worst = passed;
    }
}

static bool count_hearing(sf_agent *agent, int kind, const uint8_t *bytes, size_t length, int64_t now_ns) {
    uint32_t before = SYSTICK[2];
    bool fine = sf_hear(agent, kind, bytes, length, now_ns);
    uint32_t passed = since(before);
    if (passed > worst_hearing) worst_hearing = passed;
    return fine;
}

#define sf_tick count_tick
#define sf_hear count_hearing
#define main host_main
#include "../../firmware/examples/host.c"
#undef main

void initialise_monitor_handles(void);
void reset(void);
void _init(void);
void _fini(void);
extern char end;

void _init(void) {}
void _fini(void) {}

void reset(void) {
    CPACR |= 0xF << 20; /* the floating-point unit */
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    initialise_monitor_handles();
    int code = host_main();
    printf("instructions %u %u %u %u %u\n", (unsigned)(sum / (ticks ? ticks : 1)), (unsigned)worst,
           (unsigned)(reading / (readings ? readings : 1)), (unsigned)worst_reading,
           (unsigned)worst_hearing);
    fflush(stdout);
    exit(code);
}

__attribute__((section(".vectors"), used)) static const void *const VECTORS[] = {
    (void *)0x20400000, (void *)reset,
};
