"""Selects which robots a picture shows, and how much of each.

Decides: which robots are drawn in detail, plainly or faintly, and the index that gives a robot its
colour.  Must not know: what that looks like.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from coordinator.base.errors import InputError

Manner = Literal["detailed", "plain", "faint"]

_LISTED: Final = 8
"""At most this many robots of the plan are listed in a message about an unknown name."""
_FEW: Final = 8
"""Control polygons and combs are drawn for at most this many robots; more would hide the floor."""


@dataclass(frozen=True)
class Left:
    """A robot of the fleet that has no part in the plan, why, and where it stands [m]."""

    id: str
    why: str
    place: tuple[float, float]
    radius: float


@dataclass(frozen=True)
class View:
    """What a picture should show.

    robots: ids of the robots to draw in full, the others are faint; if empty, all are in full.
    detail: whether robots drawn in full get control polygons and curvature combs; None: only if
    these robots are few.  fleet: ids of all robots of the fleet, whose order gives each its colour;
    if empty, those of the plan.  left: the robots that have stayed behind.
    """

    robots: tuple[str, ...] = ()
    detail: bool | None = None
    fleet: tuple[str, ...] = ()
    left: tuple[Left, ...] = ()

    def places(self, ids: Sequence[str]) -> dict[str, int]:
        """Return the index of every robot that is drawn, which decides its colour."""
        names = dict.fromkeys([*self.fleet, *ids, *(one.id for one in self.left)])
        return {name: place for place, name in enumerate(names)}

    def manners(self, ids: Sequence[str]) -> dict[str, Manner]:
        """Return how each robot is drawn; raise InputError with a line for each unknown name."""
        unknown = [name for name in self.robots if name not in ids]
        if unknown:
            raise InputError([_unknown(name, ids) for name in unknown])
        chosen = self.robots or tuple(ids)
        detail = len(set(chosen)) <= _FEW if self.detail is None else self.detail
        full: Manner = "detailed" if detail else "plain"
        return {name: full if name in chosen else "faint" for name in ids}


def _unknown(name: str, ids: Sequence[str]) -> str:
    near = difflib.get_close_matches(name[:60], ids, n=1)
    listed = ", ".join([*ids[:_LISTED], *(["..."] if len(ids) > _LISTED else [])])
    other = f"the nearest name is {near[0]!r}" if near else f"it has {listed}"
    return f"--robots: the plan has no robot {name[:60]!r}; {other}"
