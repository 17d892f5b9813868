"""What a preview of an order is made from: the desk's own picture of the fleet."""

import msgspec
import numpy as np
import pytest
import shapely

from coordinator.desk.bodies import OrderBody
from coordinator.desk.known_fleet import KnownFleet
from coordinator.desk.previews import asked_of, outlook, prepared
from coordinator.planning.planner import plan_fleet
from protocol import keys
from protocol.codec import encode
from protocol.phases import DONE, MOVING
from tests.coordinator.desk.fake_fleet import FLEET, a_command, a_report
from tests.scenarios import a_robot, a_scenario

CROSSED = [a_robot("R1", (1.0, 4.0), (2.0, 4.0)), a_robot("R2", (5.0, 3.0), (5.0, 5.0))]


@pytest.fixture
def crossing():
    """A fleet of which R1 rests and R2 was heard last 2.5 s ago, on its way; its plan."""
    plan = plan_fleet(a_scenario(CROSSED), effort=0)
    known = KnownFleet(FLEET)

    def hear(key, message, at):
        known.hear(key, encode(message), at)

    for one in plan.driven:
        hear(keys.plan(FLEET, one.id), one.plan, 0.0)
    command = msgspec.structs.replace(a_command(), headroom_ms=1_000)
    hear(keys.command(FLEET), command, 0.0)
    hear(keys.report(FLEET, "R2"), a_report(phase=MOVING), 0.0)
    later = msgspec.structs.replace(command, said_ns=2_500_000_000)
    hear(keys.command(FLEET), later, 2.5)
    done = msgspec.structs.replace(a_report(phase=DONE), stamp_ms=None)
    hear(keys.report(FLEET, "R1"), done, 2.5)
    return plan.document, known


def test_a_way_keeps_clear_of_where_a_lost_robot_may_stand(crossing):
    document, known = crossing
    asked = asked_of(document, known, OrderBody(goal=[9.0, 4.0], robot="R1"), 2.6)
    where = shapely.LineString(asked.lost["R2"])
    assert 0.5 < where.length < 2.0
    found = outlook(prepared(document), asked)
    assert found.reason == ""
    assert found.way[-1] == (9.0, 4.0)
    apart = shapely.distance(shapely.LineString(np.array(found.way)), where)
    radii = sum(one.radius for one in document.robots)
    assert radii < apart < radii + 0.5


def test_who_is_lost_gets_no_preview_but_the_reason(crossing):
    document, known = crossing
    body = OrderBody(goal=[9.0, 4.0], robot="R2")
    found = outlook(prepared(document), asked_of(document, known, body, 2.6))
    assert (found.way, found.arrives) == ([], None)
    assert found.reason == "R2 is lost until it is heard; its orders wait until then"
