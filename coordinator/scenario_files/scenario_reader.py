"""Scenario files: TOML or JSON to a Scenario, and a Scenario to JSON.

Decides: which keys and types a file may have, and the default of each key that is absent.  Must
not know: the workspace's keys (workspace_reader.py), ranges and geometry (scenario/checks.py) or
plans.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections import Counter
from pathlib import Path, PurePath
from typing import Final, cast, get_args

import msgspec

from coordinator.base.errors import InputError, unreadable
from coordinator.base.toml_text import toml_of
from coordinator.scenario.checks import (
    ROBOT_QUANTITIES,
    SCENARIO_QUANTITIES,
    Quantity,
    find_problems,
    key_name,
    printable,
    show,
)
from coordinator.scenario.file_kinds import LOG_MAGIC, kind_of_document, wrong_kind
from coordinator.scenario.model import (
    Link,
    Policy,
    Pose,
    Robot,
    Scenario,
    Workspace,
    usual_turn_rate,
)
from coordinator.scenario_files.orders_table import read_demand, read_orders, stated
from coordinator.scenario_files.path_table import read_path
from coordinator.scenario_files.table_reader import MOST_PRIORITY, Table
from coordinator.scenario_files.workspace_reader import read_workspace

MOST_ROBOTS: Final = 10_000
LINK_QUANTITIES: Final = {
    "delay": Quantity("s", from_least=True, most=5.0),
    "loss": Quantity(from_least=True, most=0.5),
}
SCENARIO_REQUIRED: Final = ("workspace", "robots")
ROBOT_REQUIRED: Final = ("id", "start", "radius", "max_speed")
ROBOT_REQUIRED_ON_PATH: Final = ("id", "path", "radius", "max_speed")


def read_scenario(path: Path) -> Scenario:
    """Read and check a scenario file; raises InputError with every problem, one line each."""
    try:
        text = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError([f"{printable(str(path))}: {reason}"]) from None
    return parse_scenario(text, str(path))


def parse_scenario(text: bytes, name: str) -> Scenario:
    """Parse and check a scenario; `name` is the file's path.

    Messages quote the path, its stem is the scenario's default name, and the path of a map is
    relative to its folder.  The text is JSON if `name` ends in .json or the text begins with a
    brace, otherwise TOML.  Raises InputError with every problem, as `FILE: field: what is wrong`.
    """
    file = printable(name)
    problems: list[str] = []
    if text.startswith(LOG_MAGIC):
        raise InputError([wrong_kind(name, "log", "scenario")])
    document = _load(text, name, file)
    if kind_of_document(document) == "plan":
        raise InputError([wrong_kind(name, "plan", "scenario")])
    scenario = _scenario(document, name, problems)
    problems += find_problems(scenario)
    if not problems and any(robot.path is not None for robot in scenario.robots):
        from coordinator.paths.given_path import path_problems  # loads kernels

        problems += path_problems(scenario)
    if problems:
        raise InputError([f"{file}: {problem}" for problem in problems])
    return scenario


def scenario_to_json(scenario: Scenario) -> bytes:
    """Return the scenario as JSON; `parse_scenario` reads an equal scenario back from it."""
    document = msgspec.to_builtins(scenario)
    del document["workspace"]["names"]  # Those are of robots and places while a fleet drives.
    if scenario.workspace.from_map is None:
        del document["workspace"]["from_map"]
    for robot in document["robots"]:
        robot |= {key: "inf" for key in ROBOT_QUANTITIES if math.isinf(robot[key])}
        for key in ("path",) if robot["path"] is None else ("start", "goal", "via"):
            del robot[key]
        if robot["home"] is None:
            del robot["home"]
    document["orders"] = [stated(order) for order in scenario.orders]
    document["demand"] = stated(scenario.demand) if scenario.demand is not None else None
    for key in ("orders", "demand"):
        if not document[key]:
            del document[key]
    return msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n"


def default_name(file: str) -> str:
    """Return the name of a scenario that does not state one, made from the name of its file."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", PurePath(file).stem)[:32] or "scenario"


def _load(text: bytes, name: str, file: str) -> object:
    """Return the document as plain objects; raises InputError with the line of a syntax error."""
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise InputError([f"{file}: line {line}: is not UTF-8 text"]) from None
    if not decoded.strip():
        raise InputError([f"{file}: is empty; a scenario has a workspace and robots"])
    try:
        if PurePath(name).suffix.lower() == ".json" or decoded.lstrip().startswith("{"):
            return json.loads(decoded, object_pairs_hook=_table_of_unique_keys)
        return toml_of(decoded)
    except json.JSONDecodeError as error:
        problem = f"line {error.lineno}: {error.msg}"
    except tomllib.TOMLDecodeError as error:
        problem = _toml_problem(str(error), decoded)
    except RecursionError:
        problem = "lists or tables are nested too deeply"
    except ValueError as error:
        problem = unreadable(error)
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
        raise ValueError(f"{key_name(twice)}: the key appears more than once in one table")
    return table


def _scenario(document: object, name: str, problems: list[str]) -> Scenario:
    top = Table(document, "", Scenario.__struct_fields__, SCENARIO_REQUIRED, problems)
    fields = top.numbers(SCENARIO_QUANTITIES)
    if "policy" in top.values:
        policies = get_args(Policy)
        fields["policy"] = policy = top.values["policy"]
        if policy not in policies:
            top.note("policy", f"{show(policy)} is not one of {', '.join(policies)}")
    robots = top.items("robots", "tables", MOST_ROBOTS)
    if top.values.get("robots") == []:
        top.note("robots", "is empty; at least one robot is needed")
    return Scenario(
        name=top.name("name", default_name(name)),
        workspace=read_workspace(top.values["workspace"], Path(name).parent, problems)
        if "workspace" in top.values
        else Workspace(boundary=()),
        robots=tuple(_robot(robot, f"robots[{i}]", problems) for i, robot in enumerate(robots)),
        link=_link(top.values.get("link", {}), problems),
        orders=read_orders(top),
        demand=read_demand(top),
        **fields,
    )


def _link(value: object, problems: list[str]) -> Link:
    return Link(
        **Table(value, "link", Link.__struct_fields__, (), problems).numbers(LINK_QUANTITIES)
    )


def _robot(value: object, where: str, problems: list[str]) -> Robot:
    given = isinstance(value, dict) and "path" in value
    required = ROBOT_REQUIRED_ON_PATH if given else ROBOT_REQUIRED
    table = Table(value, where, Robot.__struct_fields__, required, problems)
    fields = {"radius": math.nan, "max_speed": math.nan} | table.numbers(ROBOT_QUANTITIES)
    fields.setdefault("max_accel", fields["max_speed"])
    fields.setdefault("max_lateral_accel", fields["max_accel"])
    fields.setdefault("max_turn_rate", usual_turn_rate(fields["max_accel"]))
    fields["priority"] = table.whole("priority", -MOST_PRIORITY, MOST_PRIORITY, default=0)
    if "home" in table.values:
        fields["home"] = table.place("home", 2, 3)
    if given:
        path, start, goal = read_path(table)
        return Robot(id=table.name("id"), start=start, goal=goal, path=path, **fields)
    stand = cast(Pose, table.place("start", 2, 3))
    return Robot(
        id=table.name("id"),
        start=stand,
        goal=_goal(table, stand),
        via=table.points("via"),
        **fields,
    )


def _goal(table: Table, start: Pose) -> Pose:
    """Return a robot's goal; its start if it has none, for it then stays there."""
    if "goal" in table.values or "goal" in table.excused:
        return cast(Pose, table.place("goal", 2, 3))
    if table.values.get("via"):
        table.note("goal", "is missing; a robot with via points does not stay at its start")
    return start
