"""The firmware on a machine whose floats are float32: every result rounded, literals included."""

from __future__ import annotations

import ast
import builtins
import ctypes
import math
import operator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from protocol.curve import Curve
from protocol.phases import ARMED, DONE, GO, HOLD, NO_FAULT
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from robot_agent.core.agent import Agent
from sim.world.body import SimulatedBody
from tests.robot_agent.core.rides import ENOUGH, MS, RULES, motion_along, winding_path
from tests.robot_agent.core.test_firmware import FIRMWARE

ROOT = Path(__file__).parents[3]
PERIOD = 20 * MS
BOOTED = 40 * 86_400 * 1000 * MS
"""The robot has been up for 40 days, a time that a float32 tells to 0.25 s."""

EPOCH = 1_760_000_000 * 1000 * MS
"""The coordinator's clock counts from 1970: a float32 tells it to 128 s."""


class Single(float):
    """A float32; every operation with it gives one."""

    def __new__(cls, value=0.0):
        return super().__new__(cls, ctypes.c_float(value).value)


def _rounded(name: str):
    operation = getattr(operator, name)

    def forward(self, other):
        return Single(operation(float(self), float(Single(other))))

    def backward(self, other):
        return Single(operation(float(Single(other)), float(self)))

    return forward, backward


def _rounded_sign(name: str):
    operation = getattr(operator, name)
    return lambda self: Single(operation(float(self)))


for _name in ("add", "sub", "mul", "truediv", "pow"):
    _forward, _backward = _rounded(_name)
    setattr(Single, f"__{_name}__", _forward)
    setattr(Single, f"__r{_name}__", _backward)
for _name in ("neg", "abs", "pos"):
    setattr(Single, f"__{_name}__", _rounded_sign(_name))


def divide(a, b):
    """Divide as a float32 machine divides integers too: both are rounded first."""
    return Single(a) / Single(b)


class Rounding(ast.NodeTransformer):
    """Makes literals singles and divisions single divisions."""

    def visit_Constant(self, node):
        if not isinstance(node.value, float):
            return node
        return ast.Call(func=ast.Name(id="Single", ctx=ast.Load()), args=[node], keywords=[])

    def visit_BinOp(self, node):
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div):
            return node
        called = ast.Name(id="divide", ctx=ast.Load())
        return ast.Call(func=called, args=[node.left, node.right], keywords=[])

    def visit_AugAssign(self, node):
        assert not isinstance(node.op, ast.Div)
        return self.generic_visit(node)


def _single_function(function):
    return lambda *values: Single(function(*(float(Single(value)) for value in values)))


def _single_math() -> SimpleNamespace:
    names = {name: getattr(math, name) for name in dir(math) if not name.startswith("_")}
    return SimpleNamespace(
        **{
            name: _single_function(value) if callable(value) else Single(value)
            for name, value in names.items()
        }
    )


def _single_array(_kind: str, values: list) -> list:
    """Stand in for array("f")."""
    return [Single(value) for value in values]


def single_firmware() -> dict[str, SimpleNamespace]:
    """Return the firmware's modules, by name, made for float32."""
    modules = {"math": _single_math(), "array": SimpleNamespace(array=_single_array)}
    sources = {name.removesuffix(".py").replace("/", "."): ROOT / name for name in FIRMWARE}

    def load(name, *_rest):
        if name == "robot_agent.core":  # a module that is imported from its package
            return SimpleNamespace(transitions=load("robot_agent.core.transitions"))
        if name not in modules:
            tree = ast.fix_missing_locations(Rounding().visit(ast.parse(sources[name].read_text())))
            space = {"__builtins__": inside, "__name__": name, "Single": Single, "divide": divide}
            exec(compile(tree, name, "exec"), space)
            modules[name] = SimpleNamespace(**space)
        return modules[name]

    inside = {**vars(builtins), "__import__": load}
    for name in sources:
        load(name)
    return modules


FLOAT32 = single_firmware()


def singles(values: list) -> list:
    return [Single(value) for value in values]


def spline_of(path) -> np.ndarray:
    """Return places (m, 2) along a path, by SciPy."""
    degree, knots, xs, ys, weights = path
    lifted = np.column_stack((xs, ys, np.ones(len(xs)))) * np.array(weights)[:, None]
    places = BSpline(knots, lifted, degree)(np.linspace(0.0, knots[-1], 100_001))
    return places[:, :2] / places[:, 2:]


def ride(agent, number, rules, path, motion, speed):
    """Drive a plan from 2 s before its departure; returns plan times [s], places and phases."""
    degree, *numbers = path
    line = Timeline(*motion)
    departs = round(line.t0[0] * 1e9)
    start, seen = EPOCH + 2000 * MS - departs, []
    body = SimulatedBody(math.inf if rules[1] == 0 else rules[1] / 1000.0)
    agent.hear_command(7, 1, 1, 1, HOLD, 0, EPOCH, 0, False, BOOTED)
    single = (*(number(part) for part in motion[:4]), *number(motion[4:]))
    agent.hear_plan(7, 1, 0, 0, rules, (degree, *(number(part) for part in numbers)), single)
    assert agent.ride is not None
    agent.clock.ask(BOOTED)
    agent.hear_clock(7, BOOTED, EPOCH + MS, EPOCH + MS, BOOTED + 2 * MS)
    pose = agent.ride.follower.start_pose()
    body.place(*map(float, pose))
    agent.tick(BOOTED + 3 * MS, *pose)
    assert agent.phase == ARMED
    for tick in range((2500 * MS + round(line.finish * 1e9) - departs) // PERIOD):
        now = BOOTED + tick * PERIOD
        if tick % 5 == 0:
            said = now + EPOCH - BOOTED
            agent.hear_command(7, 1, 2 + tick, 1, GO, start, said, ENOUGH, False, now)
        if tick % 100 == 0:
            agent.clock.ask(now)
            agent.hear_clock(7, now, now + EPOCH - BOOTED, now + EPOCH - BOOTED, now)
        body.step(now)
        agent.tick(now, *number(body.pose()))
        assert agent.drive_speed <= 1.05 * speed
        body.drive(
            float(agent.drive_speed), float(agent.drive_curvature), float(agent.drive_distance)
        )
        seen.append(((now + EPOCH - BOOTED - start) / 1e9, body.x, body.y, agent.phase))
    assert agent.fault == NO_FAULT
    return np.array(seen)


@pytest.fixture(scope="module")
def plans():
    document = plan_scenario(read_scenario(ROOT / "examples" / "paper_five_real.toml"), effort=0)
    return {driven.id: unpack_plan(driven.plan) for driven in drive(document)}


def check(parts, speed) -> None:
    """Both precisions drive the plan; what they do is the same, and what was asked for."""
    rules, path, motion = parts
    single = FLOAT32["robot_agent.core.agent"].Agent(Single(speed), PERIOD)
    rows = ride(single, singles, rules, path, motion, speed)
    assert type(single.ride.follower.s) is Single
    assert type(single.drive_speed) is Single
    twin = ride(Agent(speed, PERIOD), list, rules, path, motion, speed)
    track = rules[0] / 1000.0
    line = spline_of(path)
    assert cKDTree(line).query(rows[:, 1:3])[0].max() < track
    assert math.dist(rows[-1, 1:3], line[-1]) < track
    arrived, arrived_twin = (seen[seen[:, 3] == DONE][0, 0] for seen in (rows, twin))
    assert arrived == pytest.approx(arrived_twin, abs=3 * PERIOD / 1e9)
    assert arrived == pytest.approx(Timeline(*motion).finish, abs=0.1)
    assert np.hypot(*(rows - twin)[:, 1:3].T).max() < 0.1 * track


def test_every_result_is_rounded():
    third = Single(1.0) / 3
    assert (type(third), float(third)) == (Single, float(np.float32(1.0) / np.float32(3.0)))
    assert type(2.0 * third) is type(third**0.5) is type(-third) is type(abs(third)) is Single
    assert divide(2**24 + 1, 1) == 2**24
    assert type(FLOAT32["math"].sqrt(2)) is Single


@pytest.mark.parametrize("robot", ["R1", "R2"])
def test_a_robot_with_single_precision_drives_a_plan_of_the_paper_as_another_does(plans, robot):
    check(plans[robot], 0.7)


def test_a_robot_with_single_precision_drives_a_large_plan_an_hour_after_go():
    path = winding_path("ffflffrfff", step=8.0)
    length = Curve(*path).length
    motion = motion_along(length, 2.0, 1.0, [(0.0, 3600.0), (30.0, 3625.0)])
    check(((RULES[0], 1000, RULES[2]), path, motion), 2.1)
