"""VDA 5050 states made from reports, held against what the text of the standard asks for."""

import msgspec
import pytest

from coordinator.exchange.vda5050_state import Seen, state_of
from protocol.phases import ARMED, BRAKING, DONE, FROZEN, IDLE, MOVING, OFF_PATH

STAMP = "2026-11-26T08:30:00.125Z"
REQUIRED = {
    "headerId": int,
    "timestamp": str,
    "version": str,
    "manufacturer": str,
    "serialNumber": str,
    "orderId": str,
    "orderUpdateId": int,
    "lastNodeId": str,
    "lastNodeSequenceId": int,
    "nodeStates": list,
    "edgeStates": list,
    "driving": bool,
    "actionStates": list,
    "batteryState": dict,
    "operatingMode": str,
    "errors": list,
    "safetyState": dict,
}
"""Chapter 6.10 of the standard (2.1): what every state has."""

PARTS = {
    "nodeStates": {"nodeId": str, "sequenceId": int, "released": bool},
    "edgeStates": {"edgeId": str, "sequenceId": int, "released": bool},
    "errors": {"errorType": str, "errorLevel": str},
    "information": {"infoType": str, "infoLevel": str},
    "batteryState": {"batteryCharge": float, "charging": bool},
    "safetyState": {"eStop": str, "fieldViolation": bool},
    "agvPosition": {"x": float, "y": float, "theta": float, "mapId": str},
}
GOAL = (3.0, 4.0, 0.5)


def told(phase=MOVING, fault=0, *, heard=True, order="o-1", over=False, goal=GOAL, paused=False):
    seen = Seen("R1", phase, fault, heard, order, over, goal)
    return msgspec.json.decode(msgspec.json.encode(state_of(seen, "hall", 7, STAMP, paused=paused)))


def complaints(state):
    """What a state lacks, or has of the wrong type."""
    found = [name for name, kind in REQUIRED.items() if type(state.get(name)) is not kind]
    for name, fields in PARTS.items():
        value = state.get(name, [])
        for one in value if isinstance(value, list) else [value]:
            for field, kind in fields.items():
                if type(one.get(field)) not in ((int, float) if kind is float else (kind,)):
                    found.append(f"{name}.{field}")
    return found


@pytest.mark.parametrize("phase", [IDLE, ARMED, MOVING, BRAKING, FROZEN, DONE])
@pytest.mark.parametrize("heard", [True, False])
@pytest.mark.parametrize("order", ["", "o-1"])
def test_every_state_has_what_the_standard_asks_for(phase, heard, order):
    for over in (False, True):
        assert complaints(told(phase, OFF_PATH, heard=heard, order=order, over=over)) == []


@pytest.mark.parametrize("phase", [IDLE, ARMED, MOVING, BRAKING, FROZEN])
def test_a_place_is_stated_only_at_rest_at_the_goal(phase):
    assert "agvPosition" not in told(phase)
    assert "agvPosition" not in told(DONE, heard=False)
    place = told(DONE)["agvPosition"]
    assert (place["x"], place["y"], place["theta"], place["mapId"]) == (*GOAL, "hall")


def test_an_order_has_a_way_and_a_goal_until_it_is_over():
    going, done, idle = told(), told(DONE, over=True), told(DONE, order="")
    assert [node["nodeId"] for node in going["nodeStates"]] == ["o-1-goal"]
    assert [edge["sequenceId"] for edge in going["edgeStates"]] == [1]
    assert going["driving"]
    assert (done["orderId"], done["nodeStates"], done["lastNodeId"]) == ("o-1", [], "o-1-goal")
    assert not done["driving"]
    assert (idle["orderId"], idle["lastNodeId"], idle["nodeStates"]) == ("", "", [])


def test_what_keeps_a_robot_from_its_order_is_an_error():
    assert told()["errors"] == []
    lost = told(heard=False)
    assert [one["errorType"] for one in lost["errors"]] == ["notHeard"]
    assert not lost["driving"]
    assert told(FROZEN, OFF_PATH)["errors"][0]["errorDescription"] == "off its path"
    assert told(paused=True)["paused"]
