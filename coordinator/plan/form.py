"""The form of a plan file: which fields it states, and values of which kind.

Decides: the wording of a missing field and of a value of another kind.  Must not know: files, or
which values of the right kind a plan may have (checks.py).  msgspec stops at the first such fault;
this module finds all of them, and converts the parts that have none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Any, Final, get_args, get_origin

import msgspec

from coordinator.plan.checks import parts_problems
from coordinator.plan.document import Floor, PlanDocument, RobotPlan

_WORDS: Final[Mapping[object, str]] = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "true or false",
}


def all_problems(value: object) -> list[str]:
    """Return all problems of a plan's JSON, as far as its parts have the form of a plan."""
    problems = list(_faults("", value, PlanDocument))
    if not isinstance(value, dict):
        return problems
    kinds = {field.name: field.type for field in msgspec.structs.fields(PlanDocument)}
    sound = {
        name: msgspec.convert(value[name], kind)
        for name, kind in kinds.items()
        if name in value and name != "robots" and not list(_faults(name, value[name], kind))
    }
    robots = value.get("robots")
    parts: list[RobotPlan | None] = [
        None if list(_faults("", robot, RobotPlan)) else msgspec.convert(robot, RobotPlan)
        for robot in (robots if isinstance(robots, list) else [None])
    ]
    floor = sound.get("workspace")
    return problems + parts_problems(sound, parts, floor if isinstance(floor, Floor) else None)


def _faults(where: str, value: object, kind: Any) -> Iterator[str]:  # noqa: ANN401
    """Yield a line for each field that is missing or of another kind; `kind`: a type."""
    origin, inner = get_origin(kind), get_args(kind)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        if not isinstance(value, dict):
            yield _line(where, value, "a table")
            return
        for field in msgspec.structs.fields(kind):
            name = f"{where}.{field.name}" if where else field.name
            if field.name in value:
                yield from _faults(name, value[field.name], field.type)
            elif field.required:
                yield f"{name}: is missing"
    elif origin is UnionType:
        if value is not None:
            yield from _faults(where, value, inner[0])
    elif origin is list:
        if not isinstance(value, list):
            yield _line(where, value, "a list")
            return
        for index, item in enumerate(value):
            yield from _faults(_item(where, index, item), item, inner[0])
    else:
        try:
            msgspec.convert(value, kind)
        except msgspec.ValidationError:
            yield _line(where, value, _words(kind))


def _item(where: str, index: int, item: object) -> str:
    """Return the name of a list's item: a robot is named by its id."""
    name = item.get("id") if where == "robots" and isinstance(item, dict) else None
    return f"{where}[{name if isinstance(name, str) and name.isprintable() else index}]"


def _words(kind: Any) -> str:  # noqa: ANN401
    if kind in _WORDS:
        return _WORDS[kind]
    if get_origin(kind) is tuple:
        return f"a list of {len(get_args(kind))} numbers"
    if get_origin(kind) is dict:
        return "a table of numbers"
    return " or ".join(map(repr, get_args(kind)))


def _line(where: str, value: object, wanted: str) -> str:
    from coordinator.scenario.checks import show  # loads NumPy

    return f"{where or 'file'}: is {show(value)}, must be {wanted}"
