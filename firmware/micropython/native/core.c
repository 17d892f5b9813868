/* The agent core as a module of MicroPython: one function, core(memory, exchange, plan, act).

   It is compiled to code that runs wherever it lies and has no variables of its own.  The robot is
   in `memory`, what goes in and comes out in `exchange`, the Plan that is read in `plan`: bytearrays
   of Python.  firmware/micropython/native_robot.py is the other side. */

#include "exchange.h"

enum { LEAVES = 1, READS = 2, REFUSED = 4 }; /* flags */

typedef uintptr_t (*converter)(uintptr_t value, uintptr_t type);

static void begin(memory *at, const exchange *with) {
    sf_robot *robot = &at->robot;
    uint8_t *numbers = (uint8_t *)&robot->radius; /* radius, max_speed, max_accel: copied, not computed */
    for (unsigned i = 0; i < 3 * sizeof robot->radius; i++) numbers[i] = with->bytes[40 + i];
    for (unsigned i = 0; i < sizeof at->id; i++) at->id[i] = (char)with->bytes[i];
    robot->id = at->id;
    robot->speed_limit = with->speed;
    robot->boot = with->kind;
    robot->period_ns = with->now_ns;
    sf_init(&at->agent, robot);
}

static void tick(sf_agent *agent, exchange *with) {
    sf_tick(agent, with->now_ns, with->x, with->y, with->heading);
    with->speed = agent->drive_speed;
    with->curvature = agent->drive_curvature;
    with->distance = agent->drive_distance;
    with->turn = agent->drive_turn;
    with->place = sf_place_on_path(agent);
    with->epoch = agent->epoch;
    with->revision = agent->revision;
    with->holds = agent->holds;
}

static uintptr_t act_on(memory *at, exchange *with, const uint8_t *plan, uintptr_t act) {
    sf_agent *agent = &at->agent;
    size_t length = 0;
    uintptr_t answer = 0;
    switch (act) {
    case SIZE: return sizeof *at;
    case BEGIN: begin(at, with); break;
    case HEAR:
        answer = sf_hear(agent, (int)with->kind, plan, with->length, with->now_ns);
        break;
    case TICK: tick(agent, with); break;
    case SPEAK:
        answer = (uintptr_t)sf_speak(agent, with->now_ns, with->bytes, &length);
        with->length = (uint32_t)length;
        break;
    default: sf_driver_failed(agent, with->now_ns);
    }
    with->phase = agent->phase;
    with->fault = agent->fault;
    with->flags = (uint8_t)(sf_may_leave(agent) * LEAVES +
                            sf_is_reading(agent) * READS + agent->refused * REFUSED);
    return answer;
}

/* The function object's second word leads to its module, whose fourth word are its constants, the
   first of which is MicroPython's table of functions for native code. */
__attribute__((section(".text.first"))) uintptr_t core(void **self, size_t count, size_t keywords,
                                                       const uintptr_t *given);

uintptr_t core(void **self, size_t count, size_t keywords, const uintptr_t *given) {
    void **module = self[1];
    void **table = ((void ***)module[3])[0];
    converter from = (converter)table[FROM_OBJECT], to = (converter)table[TO_OBJECT];
    (void)count;
    (void)keywords;
    uintptr_t words[4];
    for (int i = 0; i < 3; i++) words[i] = from(given[i], POINTER);
    words[3] = from(given[3], INT);
    return to(act_on((memory *)words[0], (exchange *)words[1], (uint8_t *)words[2], words[3]), INT);
}
