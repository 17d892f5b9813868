"""A VDA 5050 order as places that a robot is to pass; what is wrong with one is told at once."""

import json

import pytest

from coordinator.exchange.vda5050_wishes import Wished, read_wished
from protocol.messages import MOST_VIAS


def a_node(number, x, y, **more):
    position = {"x": x, "y": y, "mapId": "hall", **more.pop("position", {})}
    return {
        "nodeId": f"n{number}",
        "sequenceId": 2 * number,
        "released": True,
        "nodePosition": position,
        "actions": [],
        **more,
    }


def an_order(*nodes, **more):
    told = {"orderId": "o 1/7", "serialNumber": "R1", "nodes": list(nodes), "edges": []}
    return json.dumps(told | more).encode()


def a_wait(seconds):
    return {
        "actionType": "wait",
        "actionId": "w",
        "blockingType": "HARD",
        "actionParameters": [{"key": "duration", "value": seconds}],
    }


def problems_of(text):
    problems = []
    assert read_wished(text, "order.json", problems) is None
    return problems


def test_released_nodes_are_passed_in_sequence_and_the_last_one_is_the_goal():
    nodes = [
        a_node(2, 5.0, 1.0),
        a_node(0, 1.0, 1.0),
        a_node(1, 3.0, 1.5),
        a_node(3, 7.0, 2.0, position={"theta": 0.5}, actions=[a_wait(4.0), a_wait(1.5)]),
        a_node(4, 9.0, 9.0, released=False),
    ]
    found = read_wished(an_order(*nodes), "order.json", [])
    via = ((3.0, 1.5), (5.0, 1.0))
    assert found == Wished("o-1-7", "R1", (7.0, 2.0, 0.5), via, 5.5, 1)


def test_one_node_alone_is_the_goal():
    found = read_wished(an_order(a_node(0, 4.0, 4.0)), "order.json", [])
    assert found == Wished("o-1-7", "R1", (4.0, 4.0), (), 0.0, 0)


def test_all_that_is_wrong_is_told_by_field():
    far = a_node(0, 1e9, "a", actions=[{"actionType": "pick"}])
    told = problems_of(an_order(far, a_node(1, 1.0, 1.0), serialNumber=7))
    assert [one.split(": ")[1] for one in told] == [
        "serialNumber",
        "nodes[0].nodePosition.x",
        "nodes[0].nodePosition.y",
        "nodes[0].actions[0]",
    ]


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (b"{", "order"),
        (b"[]", "order"),
        (an_order(), "nodes"),
        (an_order(a_node(0, 1.0, 1.0, released=False)), "nodes"),
        (an_order(a_node(0, 1.0, 1.0), a_node(0, 2.0, 1.0)), "nodes[1].sequenceId"),
        (an_order(a_node(0, 1.0, 1.0), 7), "nodes[1]"),
        (an_order(a_node(0, 1.0, 1.0, nodePosition=None)), "nodes[0].nodePosition"),
        (an_order(a_node(0, 1.0, 1.0), orderId=""), "orderId"),
        (an_order(a_node(0, 1.0, 1.0, actions=[a_wait(-1)])), "nodes[0].actions[0].duration"),
        (
            an_order(a_node(0, 1.0, 1.0, actions=[a_wait(1)]), a_node(1, 2.0, 1.0)),
            "nodes[0].actions[0]",
        ),
        (an_order(*(a_node(i, float(i), 1.0) for i in range(MOST_VIAS + 3))), "nodes"),
    ],
)
def test_a_problem_names_its_field(text, field):
    told = problems_of(text)
    assert [one.split(": ")[1] for one in told] == [field]


@pytest.mark.parametrize("actions", [7, "wait", [7], {"actionType": "wait"}])
def test_odd_actions_are_told(actions):
    assert problems_of(an_order(a_node(0, 1.0, 1.0, actions=actions)))
