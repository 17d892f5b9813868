"""A fleet in virtual time with everything that changes courses."""

from msgspec.structs import replace

from coordinator.log.log_file import logs_before, read_log
from coordinator.scenario.model import Order
from protocol.messages import GO_ON, HALT, Join, Tell
from protocol.messages import Order as Said
from sim.world.run_logs import RunLogs
from tests.sim.world.test_orders_in_time import a_world, hall, operator

ORDERS = (
    Order(id="a", goal=(8.0, 3.0), robot="R1", dwell=1.0),
    Order(id="b", goal=(1.0, 3.0), robot="R3", release=3.0, via=((5.0, 5.0),)),
    Order(id="c", goal=(8.0, 1.0), after="a"),
    Order(id="f", goal=(3.0, 1.0), robot="R3", release=4.0),  # gets its course before b is done
)
STOPPED_S = 4.0
AWAY_S = 3.0


def drive_a_day(folder):
    """The logs of a fleet with a redirect, a stop, a robot that joins, a coordinator that dies."""
    logs = RunLogs(folder)
    faults = [f"coordinator-restart@23:{AWAY_S:g}"]
    world = a_world(replace(hall(), orders=ORDERS), logs=logs, faults=faults)
    say = operator(world)
    world.run(6.0)
    say(Said(1, "d", (5.0, 6.0), "R1", now=True))
    world.run(5.0)
    say(Tell(1, HALT))
    world.run(STOPPED_S)
    say(Tell(1, GO_ON))
    world.run(2.0)
    say(Join(1, "R4", (5.0, 1.0, 0.0), 0.2, 0.5))
    world.add("R4", 0.2, 0.5, 77)
    world.run(3.0)
    say(Said(1, "e", (3.0, 4.5), "R4"))
    world.run(240.0)
    logs.close()
    assert world.fleet.is_finished
    last = read_log(logs.paths[-1])
    return [*logs_before(last, ""), last], world.blackboxes()
