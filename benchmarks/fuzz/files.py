"""Fuzz targets for files that a person gives: scenarios, plans, VDA 5050 orders."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Final, get_args

import msgspec

from benchmarks.fuzz.json_mutation import mutated
from benchmarks.fuzz.target import Target, answered
from benchmarks.table import ROOT
from coordinator.base.errors import InputError
from coordinator.exchange.vda5050 import Version
from coordinator.exchange.vda5050_orders import orders_of
from coordinator.exchange.vda5050_reading import Assumed, read_order, scenario_of
from coordinator.findings.plan_facts import summarise_plan
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, to_json
from coordinator.planning.planner import plan_scenario
from coordinator.proof.verify import prove_document
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.scenario_files.toml_writer import scenario_to_toml
from coordinator.view.scene_plan import scene_of_plan

_BESIDE: Final = ROOT / "examples"

_TWO: Final = b"""
name = "two"
tau = 0.6
[link]
delay = 0.05
loss = 0.1
[workspace]
bounds = [0.0, 0.0, 4.0, 4.0]
obstacles = [[[0.1, 0.1], [0.5, 0.1], [0.5, 0.5]]]
[[robots]]
id = "R1"
start = [0.6, 2.0, 0.1]
goal = [3.4, 2.0]
via = [[1.0, 2.5]]
radius = 0.15
max_speed = 0.6
max_accel = "inf"
priority = 1
[[robots]]
id = "R2"
path.degree = 2
path.control_points = [[2.0, 0.6], [2.2, 2.0], [2.0, 3.4]]
path.knots = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
path.weights = [1.0, 0.5, 1.0]
radius = 0.15
max_speed = 0.5
home = [0.6, 3.4]
[[orders]]
id = "o1"
robot = "R1"
release = 2.0
goal = [0.6, 3.0]
[[orders]]
after = "o1"
goal = [2.0, 3.4, 0.5]
via = [[1.0, 3.0]]
dwell = 1.0
[demand]
places = [[0.6, 1.0], [0.6, 3.0], [3.4, 1.0]]
"""


def _read_twice(data: bytes, suffix: str) -> None:
    """Read a scenario, write it and read it again; the two must be equal."""
    found = parse_scenario(data, str(_BESIDE / f"fuzzed{suffix}"))
    if found.workspace.from_map is None:
        for text in (scenario_to_json(found), scenario_to_toml(found)):
            assert parse_scenario(text, "written") == found, "it is not read as it was written"


@answered
def scenario_toml(data: bytes) -> None:
    """Read a scenario in TOML."""
    _read_twice(data, ".toml")


@answered
def scenario_json(data: bytes) -> None:
    """Read a scenario in JSON."""
    _read_twice(data, ".json")


@answered
def plan(data: bytes) -> None:
    """Read a plan, prove it, and show it in every way."""
    document = from_json(data)
    prove_document(document)
    summarise_plan(document)
    scene_of_plan(document)
    orders_of(document, "2026-01-01T00:00:00.000Z")
    assert from_json(to_json(document)) == document, "it is not read as it was written"


@answered
def order(data: bytes) -> None:
    """Read a VDA 5050 order as a scenario's robot, and that scenario again."""
    problems: list[str] = []
    found = read_order(data, "order.json", problems)
    if found is None:
        assert problems, "it is refused without a message"
        raise InputError(problems)
    made = scenario_of([found], "orders", Assumed(0.3, 0.5, 0.02), None)
    parse_scenario(scenario_to_json(made), "orders.json")


@cache
def two() -> tuple[Scenario, PlanDocument]:
    """Return a scenario of two robots, and its plan."""
    scenario = parse_scenario(_TWO, "two.toml")
    return scenario, plan_scenario(scenario, effort=0)


def _toml_seeds() -> Iterator[bytes]:
    yield _TWO
    for file in sorted(_BESIDE.glob("*.toml")):
        yield file.read_bytes()


def _json_seeds() -> Iterator[bytes]:
    yield scenario_to_json(two()[0])
    yield json.dumps(msgspec.json.decode(scenario_to_json(two()[0]))).encode()


def _plan_seeds() -> Iterator[bytes]:
    yield to_json(two()[1])
    yield msgspec.json.encode(two()[1])


def _order_seeds() -> Iterator[bytes]:
    for version in get_args(Version):
        for made in orders_of(two()[1], "2026-01-01T00:00:00.000Z", version).values():
            yield msgspec.json.encode(made)


TARGETS: Final = {
    "scenario-toml": Target(scenario_toml, _toml_seeds),
    "scenario-json": Target(scenario_json, _json_seeds, mutate=mutated),
    "plan": Target(plan, _plan_seeds, mutate=mutated),
    "vda5050": Target(order, _order_seeds, mutate=mutated),
}
