/* The host program on an emulated Cortex-M4F, with the core that MicroPython gets: code in RAM, not
   where it was linked, called as MicroPython calls it (firmware/micropython/native/core.c). */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../firmware/micropython/native/exchange.h"

#include "code.h" /* static const uint8_t CODE[] */

#define CPACR (*(volatile uint32_t *)0xE000ED88)
#define ELSEWHERE 36

static memory shared;
static exchange with;
static uint8_t ram[sizeof CODE + ELSEWHERE] __attribute__((aligned(16)));

static uintptr_t from_object(uintptr_t value, uintptr_t type) { return type == INT ? value >> 1 : value; }
static uintptr_t to_object(uintptr_t value, uintptr_t type) { return type == INT ? value : 0; }

static uintptr_t call(sf_agent *seen, int64_t now_ns, const void *plan, uintptr_t act) {
    void *table[] = {[FROM_OBJECT] = (void *)from_object, [TO_OBJECT] = (void *)to_object};
    void *constants[] = {table};
    void *module[] = {0, 0, 0, constants}, *function[] = {0, module};
    uintptr_t given[] = {(uintptr_t)&shared, (uintptr_t)&with, (uintptr_t)plan, act << 1 | 1};
    uintptr_t (*core)(void **, size_t, size_t, const uintptr_t *);
    core = (void *)((uintptr_t)(ram + ELSEWHERE) | 1);
    with.now_ns = now_ns;
    uintptr_t answer = core(function, 4, 0, given);
    memcpy(seen, &shared.agent, sizeof *seen);
    return answer;
}

static void native_init(sf_agent *seen, const sf_robot *robot) {
    memcpy(ram + ELSEWHERE, CODE, sizeof CODE);
    if (call(seen, 0, &with, SIZE) != sizeof shared) exit(3);
    with.speed = robot->speed_limit;
    with.kind = robot->boot;
    strcpy((char *)with.bytes, robot->id);
    memcpy(with.bytes + 40, &robot->radius, 3 * sizeof robot->radius);
    call(seen, robot->period_ns, &with, BEGIN);
}

static bool native_hear(sf_agent *seen, int kind, const uint8_t *bytes, size_t length, int64_t now_ns) {
    with.kind = (uint32_t)kind;
    with.length = (uint32_t)length;
    return call(seen, now_ns, bytes, HEAR);
}

static void native_tick(sf_agent *seen, int64_t now_ns, sf_real x, sf_real y, sf_real heading) {
    with.x = x;
    with.y = y;
    with.heading = heading;
    call(seen, now_ns, &with, TICK);
}

static int native_speak(sf_agent *seen, int64_t now_ns, uint8_t *bytes, size_t *length) {
    int kind = (int)call(seen, now_ns, &with, SPEAK);
    *length = with.length;
    memcpy(bytes, with.bytes, with.length);
    return kind;
}

static void native_failed(sf_agent *seen, int64_t now_ns) { call(seen, now_ns, &with, FAILED); }

#define sf_init native_init
#define sf_hear native_hear
#define sf_tick native_tick
#define sf_speak native_speak
#define sf_driver_failed native_failed
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
    initialise_monitor_handles();
    int code = host_main();
    fflush(stdout);
    exit(code);
}

__attribute__((section(".vectors"), used)) static const void *const VECTORS[] = {
    (void *)0x20400000, (void *)reset,
};
