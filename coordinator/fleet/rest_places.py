"""What is known of where a robot is when its fleet rests.

Decides: the facts that a new plan starts from.  Must not know: paths and floors
(replanning_input.py).
"""

from __future__ import annotations

from typing import Final, Literal

import msgspec

State = Literal["rests", "arrived", "lost", "unfit"]

ABLE: Final[tuple[State, ...]] = ("rests", "arrived")


class Standing(msgspec.Struct, frozen=True, kw_only=True):
    """One robot: able to drive on, at its goal, not heard of, or not fit to drive.

    `epoch`: whose plan the places refer to.  A robot that said where it rests is at arc length `s`
    [m], `off` [m] left of its path, turned by `turn` [rad] and `beyond` [m] past its end (negative:
    before its beginning).  One that did not (s is None) is where the plan has it between the plan
    times `since` and `until` [s].  One that has come back says its `place`: x, y [m], heading
    [rad].
    """

    robot: str
    state: State
    epoch: int
    s: float | None = None
    off: float = 0.0
    turn: float = 0.0
    beyond: float = 0.0
    since: float = 0.0
    until: float = 0.0
    place: tuple[float, float, float] | None = None
