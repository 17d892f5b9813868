"""Random scenarios for end-to-end tests: seeded, cluttered, of every kind that is allowed."""

from __future__ import annotations

import math
import random

from coordinator.scenario.checks import find_problems
from coordinator.scenario.model import Robot, Scenario, Workspace, usual_turn_rate


def box(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def a_robot(name, start, goal, **fields):
    """A robot with the defaults of scenario files."""
    fields = {"radius": 0.2, "max_speed": 0.8} | fields
    fields.setdefault("max_accel", fields["max_speed"])
    fields.setdefault("max_lateral_accel", fields["max_accel"])
    fields.setdefault("max_turn_rate", usual_turn_rate(fields["max_accel"]))
    return Robot(id=name, start=start, goal=goal, **fields)


def a_scenario(robots, size=(10.0, 8.0), obstacles=(), **fields):
    workspace = Workspace(boundary=box(0.0, 0.0, *size), obstacles=tuple(obstacles))
    scenario = Scenario(name="test", workspace=workspace, robots=tuple(robots), **fields)
    assert find_problems(scenario) == []
    return scenario


def random_scenario(seed, most=8, clutter=5):
    """A scenario of 2 to `most` robots that passes the checks of scenario files."""
    dice = random.Random(seed)
    size = (dice.uniform(6, 11), dice.uniform(6, 11))
    shapes = [shape for _ in range(dice.randint(0, clutter)) for shape in _obstacles(dice, size)]
    workspace = Workspace(boundary=box(0.0, 0.0, *size), obstacles=tuple(shapes))
    scenario = Scenario(
        name=f"random-{seed}",
        workspace=workspace,
        robots=(),
        tau=dice.choice(["auto", "auto", 0.2, 0.3, 0.5, 1.0, 2.0]),
        margin=dice.choice([0.02, 0.05, 0.1]),
        speed_reserve=dice.choice([0.0, 0.05]),
    )
    count, tries = dice.randint(2, most), 0
    while len(scenario.robots) < count:
        tries += 1
        if tries > 2000:
            return random_scenario(seed + 10_000, most, clutter)
        more = (*scenario.robots, _robot(dice, size, f"R{len(scenario.robots)}"))
        trial = Scenario(
            **{key: getattr(scenario, key) for key in Scenario.__struct_fields__} | {"robots": more}
        )
        if find_problems(trial) == []:
            scenario = trial
    return scenario


def _robot(dice, size, name):
    def place():
        return (dice.uniform(0, size[0]), dice.uniform(0, size[1]))

    def pose():
        return (*place(), dice.uniform(-math.pi, math.pi)) if dice.random() < 0.15 else place()

    speed = dice.uniform(0.2, 1.5)
    accel = dice.choice([math.inf, speed, 0.5, 2.0])
    return a_robot(
        name,
        pose(),
        pose(),
        via=tuple(place() for _ in range(dice.choice([0, 0, 0, 1, 2]))),
        radius=dice.choice([0.1, 0.15, 0.2, 0.3, 0.4]),
        max_speed=speed,
        max_accel=accel,
        max_lateral_accel=dice.choice([accel, 0.3, math.inf]),
        priority=dice.choice([0, 0, 1]),
        min_turn_radius=dice.choice([0.0] * 9 + [0.1]),
    )


def _obstacles(dice, size):
    """One or two polygons: boxes, triangles, walls, U and L shapes, neighbours that touch."""
    x, y = dice.uniform(0, size[0]), dice.uniform(0, size[1])
    a, b, wall = dice.uniform(0.3, 2.0), dice.uniform(0.3, 2.0), 0.2
    kind = dice.choice(("box", "triangle", "wall", "u", "l", "edge", "corner"))
    if kind == "box":
        return [box(x, y, x + a, y + b)]
    if kind == "wall":
        return [box(x, y, x + 3 * a, y + 0.05)]
    if kind == "edge":
        return [box(x, y, x + a, y + b), box(x + a, y, x + a + b, y + a)]
    if kind == "corner":
        return [box(x, y, x + a, y + b), box(x + a, y + b, x + a + b, y + b + a)]
    if kind == "triangle":
        turns = [dice.uniform(0, 2) + 2 * i for i in range(3)]
        return [tuple((x + a * math.cos(t), y + a * math.sin(t)) for t in turns)]
    if kind == "l":
        foot = ((x, y), (x + a + wall, y), (x + a + wall, y + wall))
        return [(*foot, (x + wall, y + wall), (x + wall, y + b + wall), (x, y + b + wall))]
    w, h = a + 1.0, b + 1.0
    outer = ((x, y), (x + w, y), (x + w, y + h), (x + w - wall, y + h))
    return [(*outer, (x + w - wall, y + wall), (x + wall, y + wall), (x + wall, y + h), (x, y + h))]
