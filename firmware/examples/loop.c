/* The order of things in a tick: hear, measure, decide, drive, speak. */

#include "loop.h"

void sf_loop_begin(sf_loop *loop, const sf_robot *robot, const sf_driver *driver, const sf_link *link) {
    loop->driver = driver;
    loop->link = link;
    sf_init(&loop->agent, robot);
}

static void hear(sf_loop *loop, int64_t now_ns) {
    const sf_link *link = loop->link;
    int64_t heard_ns = now_ns;
    size_t length = 0;
    for (int most = 16; most > 0; most--) {
        int kind = link->receive(link->link, loop->other, sizeof loop->other, &length, &heard_ns);
        if (kind == SF_NOTHING) return;
        const uint8_t *bytes = loop->other;
        if (kind == SF_PLAN) { /* It stays where it is until it has been read. */
            if (sf_is_reading(&loop->agent) || length > sizeof loop->plan) continue;
            for (size_t i = 0; i < length; i++) loop->plan[i] = loop->other[i];
            bytes = loop->plan;
        }
        /* When an answer about the time arrived matters; a Command counts from this tick on. */
        sf_hear(&loop->agent, kind, bytes, length, kind == SF_CLOCK ? heard_ns : now_ns);
    }
}

bool sf_loop_tick(sf_loop *loop, int64_t now_ns) {
    sf_agent *agent = &loop->agent;
    const sf_driver *driver = loop->driver;
    sf_real x = 0, y = 0, heading = 0;
    hear(loop, now_ns);
    if (!driver->is_well(driver->base)) sf_driver_failed(agent, now_ns);
    if (!driver->pose(driver->base, &x, &y, &heading)) x = (sf_real)(0.0f / 0.0f);
    sf_tick(agent, now_ns, x, y, heading);
    if (agent->drive_turn < 0 || agent->drive_turn > 0)
        driver->turn(driver->base, agent->drive_turn);
    else
        driver->drive(driver->base, agent->drive_speed, agent->drive_curvature, agent->drive_distance);
    size_t length;
    int kind;
    while ((kind = sf_speak(agent, now_ns, loop->sent, &length)) != SF_NOTHING)
        loop->link->send(loop->link->link, kind, loop->sent, length);
    return !sf_may_leave(agent);
}
