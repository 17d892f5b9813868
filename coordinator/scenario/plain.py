"""Robots and orders as plain data, as in a coordinator's checkpoint, and back.

Decides: that places are tuples again.  Must not know: files, which values are allowed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from coordinator.scenario.model import GivenPath, Order, Pose, Robot

Plain = dict[str, Any]


def plain(item: Robot | Order) -> Plain:
    """Return a robot or an order as plain data."""
    return dict(msgspec.to_builtins(item))


def robot_of(fields: Mapping[str, Any]) -> Robot:
    """Return a robot; raise TypeError if fields are missing or unknown."""
    path = fields.get("path")
    given = None if path is None else GivenPath(**_with_tuples(path))
    return Robot(**{**_with_tuples(fields), "path": given})


def order_of(fields: Mapping[str, Any]) -> Order:
    """Return an order; raise TypeError if fields are missing or unknown."""
    return Order(**_with_tuples(fields))


def pose_of(numbers: Sequence[float]) -> Pose:
    """Return a place [m], with a heading [rad] if there are three numbers."""
    x, y, *heading = numbers
    return (x, y, heading[0]) if heading else (x, y)


def _with_tuples(fields: Mapping[str, Any]) -> Plain:
    return {name: _tuples(value) for name, value in fields.items()}


def _tuples(value: object) -> object:
    return tuple(_tuples(one) for one in value) if isinstance(value, list | tuple) else value
