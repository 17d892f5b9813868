"""What is known of where a robot is when its fleet rests.

Decides: the facts that a new plan starts from.  Must not know: paths and floors
(replanning_input.py).
"""

from __future__ import annotations

from typing import Literal

import msgspec

from protocol.messages import Rest

State = Literal["rests", "arrived", "lost", "unfit", "overloaded"]


class Standing(msgspec.Struct, frozen=True, kw_only=True):
    """The standing of one robot: how it takes part, and where it is.

    It can drive on ("rests"), has arrived, is lost, is unfit, or cannot hold its course.

    `epoch` and `revision` say which course the places refer to.  A robot that said where it rests
    is at arc length `s` [m] of its path, `off` [m] to the left of it, turned from it by `turn`
    [rad] and `beyond` [m] past its end (negative: before its beginning).  A robot that did not say
    it (`s` is None) is where its course has it at some plan time from `since` to `until` [s], or in
    one of the `also` stretches: revision, since, until.  A robot that has come back states its
    `place`: x, y [m], heading [rad].  One that has arrived may be silent: then it gets no orders.
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
    revision: int = 0
    also: tuple[tuple[int, float, float], ...] = ()
    is_silent: bool = False


def standing_of(robot: str, rest: Rest) -> Standing:
    """Return the standing of a robot that has reported where it rests, and can drive on."""
    return Standing(
        robot=robot,
        state="rests",
        epoch=rest.epoch,
        s=rest.s_m,
        off=rest.off_mm / 1000.0,
        turn=rest.turn_mrad / 1000.0,
        beyond=rest.beyond_mm / 1000.0,
        revision=rest.revision,
    )
