"""Scenario files: TOML or JSON to a Scenario, and a Scenario to JSON.

Decides: which keys and types a file may have, and what stands for a key that is absent.  Must not
know: ranges and geometry (scenario_checks.py) or plans.  A value found wrong is noted once and
becomes NaN or empty, of which later checks say nothing more: one mistake, one line.
"""

from __future__ import annotations

import difflib
import itertools
import json
import math
import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, Final, cast, get_args

import msgspec

from coordinator.errors import InputError
from coordinator.scenario import Point, Policy, Pose, Robot, Scenario, Workspace
from coordinator.scenario_checks import (
    COORDINATE,
    HEADING,
    ROBOT_QUANTITIES,
    SCENARIO_QUANTITIES,
    Quantity,
    find_problems,
    key_name,
    printable,
    show,
)
from protocol.keys import NAME

MOST_ROBOTS: Final = 10_000
MOST_PRIORITY: Final = 1_000_000
SHAPES: Final = {2: "[x, y]", 3: "[x, y, heading]", 4: "[x0, y0, x1, y1]"}

WORKSPACE_KEYS: Final = ("bounds", "boundary", "obstacles", "map", "layer")
SCENARIO_REQUIRED: Final = ("workspace", "robots")
ROBOT_REQUIRED: Final = ("id", "start", "goal", "radius", "max_speed")


def read_scenario(path: Path) -> Scenario:
    """Read and check a scenario file; raises InputError with every problem, one line each."""
    try:
        text = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError([f"{printable(str(path))}: {reason}"]) from None
    return parse_scenario(text, str(path))


def parse_scenario(text: bytes, name: str) -> Scenario:
    """Parse and check a scenario; `name` is the file's name for messages and as a default name.

    JSON when `name` ends in .json or the text begins with a brace, otherwise TOML.  Raises
    InputError with every problem, as `FILE: field: what is wrong`.
    """
    file = printable(name)
    problems: list[str] = []
    scenario = _scenario(_load(text, name, file), name, problems)
    problems += find_problems(scenario)
    if problems:
        raise InputError([f"{file}: {problem}" for problem in problems])
    return scenario


def scenario_to_json(scenario: Scenario) -> bytes:
    """Return the scenario as JSON that `parse_scenario` reads back to an equal scenario."""
    document = msgspec.to_builtins(scenario)
    for robot in document["robots"]:
        robot |= {key: "inf" for key in ROBOT_QUANTITIES if math.isinf(robot[key])}
    return msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n"


def _load(text: bytes, name: str, file: str) -> object:
    """Return the document as plain objects; raises InputError with the line of a syntax error."""
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise InputError([f"{file}: line {line}: is not UTF-8 text"]) from None
    if not decoded.strip():
        raise InputError([f"{file}: is empty, a scenario has a workspace and robots"])
    try:
        if PurePath(name).suffix.lower() == ".json" or decoded.lstrip().startswith("{"):
            return json.loads(decoded, object_pairs_hook=_table_of_unique_keys)
        return tomllib.loads(decoded)
    except json.JSONDecodeError as error:
        problem = f"line {error.lineno}: {error.msg}"
    except tomllib.TOMLDecodeError as error:
        problem = _toml_problem(str(error), decoded)
    except RecursionError:
        problem = "lists or tables are nested too deeply"
    except ValueError as error:
        problem = str(error)
    raise InputError([f"{file}: {printable(problem)}"])


def _toml_problem(message: str, text: str) -> str:
    """Put the line of a TOML syntax error first."""
    what, _, place = message.rpartition(" (at ")
    found = re.match(r"line (\d+)", place)
    return f"line {found[1] if found else len(text.splitlines())}: {what or message}"


def _table_of_unique_keys(pairs: list[tuple[str, object]]) -> dict[str, object]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"{key_name(twice)}: the key stands twice in one table")
    return table


class _Table:
    """One table of the file; hands out checked values and notes problems under its field name."""

    def __init__(
        self,
        value: object,
        where: str,
        known: Sequence[str],
        required: Sequence[str],
        problems: list[str],
    ) -> None:
        self.where = where
        self.problems = problems
        self.values: Mapping[str, object] = {}
        self.excused = set(known)
        if not isinstance(value, dict):
            problems.append(f"{where or 'file'}: {show(value)} is not a table")
            return
        self.values = {key: value[key] for key in known if key in value}
        self.excused = set()
        for key in [key for key in value if key not in known]:
            nearest = difflib.get_close_matches(key[:40], known, n=1, cutoff=0.0)[0]
            self.note(key, f"unknown key, the nearest known one is {nearest}")
            self.excused.update(difflib.get_close_matches(key[:40], known, n=1))
        for key in required:
            if key not in self.values and key not in self.excused:
                self.note(key, "is missing")

    def field(self, key: str) -> str:
        """Return the full name of a field."""
        return f"{self.where}.{key_name(key)}" if self.where else key_name(key)

    def note(self, key: str, problem: str) -> None:
        """Add a problem with a field."""
        self.problems.append(f"{self.field(key)}: {problem}")

    def numbers(self, quantities: Mapping[str, Quantity]) -> dict[str, Any]:
        """Return the numbers that are given; NaN for a bad one."""
        numbers: dict[str, Any] = {}
        for key in [key for key in quantities if key in self.values]:
            value: Any = self.values[key]
            problem = quantities[key].complaint(value)
            if problem:
                self.note(key, problem)
            numbers[key] = math.nan if problem else value if value == "auto" else float(value)
        return numbers

    def name(self, key: str, default: str = "") -> str:
        """Return a name fit for the wire's keys; the default when it is absent or bad."""
        value = self.values.get(key)
        if isinstance(value, str) and NAME.fullmatch(value):
            return value
        if key in self.values:
            self.note(key, f"{show(value)} is not a name of 1 to 32 of A-Z a-z 0-9 _ . -")
        return default

    def items(self, key: str, what: str) -> list[object]:
        """Return a list; an empty one when it is absent or bad."""
        value = self.values.get(key, [])
        if isinstance(value, list):
            return value
        self.note(key, f"{show(value)} is not a list of {what}")
        return []

    def place(self, key: str, *sizes: int) -> tuple[float, ...]:
        """Return the place that stands here, of one of the sizes; NaN when absent or bad."""
        if key not in self.values:
            return (math.nan,) * sizes[0]
        return _place(self.values[key], self.field(key), sizes, self.problems)


def _scenario(document: object, name: str, problems: list[str]) -> Scenario:
    top = _Table(document, "", Scenario.__struct_fields__, SCENARIO_REQUIRED, problems)
    fields = top.numbers(SCENARIO_QUANTITIES)
    if "policy" in top.values:
        policies = get_args(Policy)
        fields["policy"] = policy = top.values["policy"]
        if policy not in policies:
            top.note("policy", f"{show(policy)} is not one of {', '.join(policies)}")
    robots = top.items("robots", "tables")
    if top.values.get("robots") == []:
        top.note("robots", "is empty, at least one robot is needed")
    if len(robots) > MOST_ROBOTS:
        top.note("robots", f"{len(robots)} robots are more than {MOST_ROBOTS}")
        robots = []
    stem = re.sub(r"[^A-Za-z0-9_.-]", "-", PurePath(name).stem)[:32]
    return Scenario(
        name=top.name("name", stem or "scenario"),
        workspace=_workspace(top.values["workspace"], problems)
        if "workspace" in top.values
        else Workspace(boundary=()),
        robots=tuple(_robot(robot, f"robots[{i}]", problems) for i, robot in enumerate(robots)),
        **fields,
    )


def _robot(value: object, where: str, problems: list[str]) -> Robot:
    table = _Table(value, where, Robot.__struct_fields__, ROBOT_REQUIRED, problems)
    fields = {"radius": math.nan, "max_speed": math.nan} | table.numbers(ROBOT_QUANTITIES)
    fields.setdefault("max_accel", fields["max_speed"])
    fields.setdefault("max_lateral_accel", fields["max_accel"])
    if "priority" in table.values:
        fields["priority"] = priority = table.values["priority"]
        if type(priority) is not int or abs(priority) > MOST_PRIORITY:
            limit = f"an integer from -{MOST_PRIORITY} to {MOST_PRIORITY}"
            table.note("priority", f"{show(priority)} is not {limit}")
    vias = enumerate(table.items("via", "places [[x, y], ...]"))
    return Robot(
        id=table.name("id"),
        start=cast(Pose, table.place("start", 2, 3)),
        goal=cast(Pose, table.place("goal", 2, 3)),
        via=tuple(cast(Point, _place(via, f"{where}.via[{i}]", (2,), problems)) for i, via in vias),
        **fields,
    )


def _workspace(value: object, problems: list[str]) -> Workspace:
    table = _Table(value, "workspace", WORKSPACE_KEYS, (), problems)
    given, outlines = table.values.keys(), {"bounds", "boundary"}
    if given & {"map", "layer"}:
        key = "map" if "map" in given else "layer"
        table.note(key, "maps cannot be read by this version, give polygons in workspace.obstacles")
    elif outlines <= given:
        problems.append("workspace: bounds and boundary are both given, only one may be")
    elif not outlines & (given | table.excused):
        problems.append("workspace: bounds or boundary is missing, the floor needs an outline")
    boundary: tuple[Point, ...] = ()
    if "boundary" in given:
        boundary = _polygon(table.values["boundary"], "workspace.boundary", problems)
    elif "bounds" in given:
        boundary = _box(table)
    obstacles = enumerate(table.items("obstacles", "polygons [[[x, y], ...], ...]"))
    return Workspace(
        boundary=boundary if _signed_area(boundary) >= 0.0 else (boundary[0], *boundary[:0:-1]),
        obstacles=tuple(_polygon(o, f"workspace.obstacles[{i}]", problems) for i, o in obstacles),
    )


def _box(table: _Table) -> tuple[Point, ...]:
    x0, y0, x1, y1 = table.place("bounds", 4)
    for axis, low, high in (("x", x0, x1), ("y", y0, y1)):
        if low >= high:
            table.note("bounds", f"{axis}0 = {low:g} m is not below {axis}1 = {high:g} m")
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1)) if x0 < x1 and y0 < y1 else ()


def _polygon(value: object, where: str, problems: list[str]) -> tuple[Point, ...]:
    """Return the corners without repeated ones (a closing one too); empty when they are bad."""
    if not isinstance(value, list):
        problems.append(f"{where}: {show(value)} is not a list of corners [[x, y], ...]")
        return ()
    corners = [_place(corner, f"{where}[{i}]", (2,), problems) for i, corner in enumerate(value)]
    if any(math.isnan(corner[0]) for corner in corners):
        return ()
    kept = [a for a, b in itertools.pairwise([*corners, *corners[:1]]) if a != b]
    if len(kept) < 3:
        problems.append(f"{where}: {len(kept)} different corners, a polygon needs at least 3")
        return ()
    return cast(tuple[Point, ...], tuple(kept))


def _signed_area(corners: Sequence[Point]) -> float:
    """Return twice the area [m^2], positive when the corners run counter-clockwise."""
    shifted = [(x - corners[0][0], y - corners[0][1]) for x, y in corners]
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in itertools.pairwise(shifted))


def _place(
    value: object, where: str, sizes: Sequence[int], problems: list[str]
) -> tuple[float, ...]:
    """Return [x, y], [x, y, heading] or [x0, y0, x1, y1], checked; all NaN when it is bad."""
    bad = (math.nan,) * sizes[0]
    if not isinstance(value, list) or len(value) not in sizes:
        allowed = " or ".join(SHAPES[size] for size in sizes)
        problems.append(f"{where}: {show(value)} is not {allowed}")
        return bad
    quantities = [HEADING if i == 2 and len(value) == 3 else COORDINATE for i in range(len(value))]
    complaints = [q.complaint(number) for q, number in zip(quantities, value, strict=True)]
    problems += [f"{where}[{i}]: {text}" for i, text in enumerate(complaints) if text]
    return bad if any(complaints) else tuple(float(number) for number in value)
