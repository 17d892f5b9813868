"""Drives a fleet by ORCA (RVO2, through pyrvo): a job as JSON on stdin, arrivals as JSON on stdout.

Run by the peers' own interpreter, which has none of our packages.  Each robot heads for the next
place of its shortest way, as RVO2's own examples do; nobody knows the others' goals.

Job: agents [{radius [m], speed [m/s], way [[x, y]]}], rings (counter-clockwise corners around
obstacles, clockwise around the floor), seconds (the simulation ends then).  Answer: arrivals [s,
null if it has not arrived], touched (how many pairs have come nearer than their radii).
"""

from __future__ import annotations

import json
import math
import random
import sys

import pyrvo

STEP = 0.1
HORIZON = 4.0
NEAR = 0.6
AT_GOAL = 0.1
NOISE = 0.01
PAD = 0.025
"""Time step and horizon [s]; a place of the way counts as passed, and the goal as reached, within
NEAR and AT_GOAL [m].  Speeds have some noise [m/s] so that robots which meet head-on do not stand.
Discs are larger by PAD [m], half the margin of our plans."""


def main() -> None:
    """Read the job, drive, and print the answer."""
    job = json.load(sys.stdin)
    agents, chance = job["agents"], random.Random(1)
    fleet = pyrvo.RVOSimulator()
    fleet.set_time_step(STEP)
    fleet.set_agent_defaults(6.0, 12, HORIZON, 2.0, 0.3, 1.0)
    for one in agents:
        number = fleet.add_agent(tuple(one["way"][0]))
        fleet.set_agent_radius(number, one["radius"] + PAD)
        fleet.set_agent_max_speed(number, one["speed"])
    for ring in job["rings"]:
        fleet.add_obstacle([tuple(corner) for corner in ring])
    fleet.process_obstacles()
    arrivals: list[float | None] = [None] * len(agents)
    ahead = [1] * len(agents)
    touched: set[tuple[int, int]] = set()
    now = 0.0
    while now < job["seconds"] and None in arrivals:
        places = [fleet.get_agent_position(number).to_tuple() for number in range(len(agents))]
        for number, one in enumerate(agents):
            way, (x, y) = one["way"], places[number]
            while ahead[number] < len(way) - 1 and math.dist(way[ahead[number]], (x, y)) < NEAR:
                ahead[number] += 1
            dx, dy = way[ahead[number]][0] - x, way[ahead[number]][1] - y
            far = math.hypot(dx, dy)
            if ahead[number] == len(way) - 1 and far < AT_GOAL and arrivals[number] is None:
                arrivals[number] = now
            pace = min(one["speed"], far / STEP) / max(far, 1e-9)
            turn = chance.uniform(0.0, 2.0 * math.pi)
            wanted = (dx * pace + NOISE * math.cos(turn), dy * pace + NOISE * math.sin(turn))
            fleet.set_agent_pref_velocity(number, wanted)
        touched |= _touching(places, [one["radius"] for one in agents])
        fleet.do_step()
        now += STEP
    json.dump({"arrivals": arrivals, "touched": len(touched)}, sys.stdout)


def _touching(places: list[tuple[float, float]], radii: list[float]) -> set[tuple[int, int]]:
    """Return the pairs of robots that are nearer to each other than their radii."""
    order = sorted(range(len(places)), key=lambda number: places[number][0])
    widest, found = 2.0 * max(radii), set()
    for k, i in enumerate(order):
        for j in order[k + 1 :]:
            if places[j][0] - places[i][0] >= widest:
                break
            if math.dist(places[i], places[j]) < radii[i] + radii[j] - 1e-6:
                found.add((min(i, j), max(i, j)))
    return found


if __name__ == "__main__":
    main()
