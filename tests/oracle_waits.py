"""Who forces a wait: plans in which a robot leaves sooner, judged by the dense sampler."""

from msgspec.structs import replace

from coordinator.plan.plan_file import to_json
from tests.oracle_dense import closest
from tests.oracles import tracks

CLASH = -2e-3
"""Robots that are this much [m] nearer than they may be have met."""


def rests(document):
    """Every rest as (robot, number along its path, for whom, how long [s])."""
    found = []
    for robot in document.robots:
        whole = [(robot.start_yields_to, robot.start_time)] * (robot.start_time > 0.0)
        whole += [(stop.yields_to, stop.depart - stop.arrive) for stop in robot.stops]
        found += [(robot.id, number, *rest) for number, rest in enumerate(whole)]
    return found


def forced(document, name, number, other, sooner):
    """Tell whether two robots meet if the first one leaves a rest `sooner` [s]."""
    robot = document.robot(name)
    at_start = robot.start_time > 0.0
    if at_start and number == 0:
        early = replace(robot, start_time=robot.start_time - sooner)
    else:
        stops = list(robot.stops)
        k = number - at_start
        stops[k] = replace(stops[k], depart=stops[k].depart - sooner)
        early = replace(robot, stops=stops)
    pair = replace(document, robots=[early, document.robot(other)])
    return closest(tracks(to_json(pair)), document.tau, document.margin).slack < CLASH


def share(document, name, number, other, lasts, parts=12):
    """Which share of a wait [s] another robot forces, in twelfths."""
    early = [lasts * (k + 0.5) / parts for k in range(parts)]
    return sum(forced(document, name, number, other, sooner) for sooner in early) / parts
