"""Key expressions: which message is sent on which key.

Decides: the names of the keys.  Must not know: what is sent on them.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

ROOT: Final = "splinefleet"
NAME: Final = re.compile(r"(?!\.+(?:/|$))[A-Za-z0-9_.-]{1,32}")
"""What a fleet's or a robot's name may be; Zenoh itself would accept nearly anything.  A name of
dots alone is refused because `.` and `..` are folders that exist already."""

_OF_A_FLEET: Final = ("command", "order", "tell", "block", "roster")
_OF_ONE: Final = ("hello", "plan", "report", "clock", "alive", "admit", "orders", "blocks")

_ORDER: Final = re.compile(r"[A-Za-z0-9_.-]{1,38}")
"""The name of an order; those of the coordinator's own, such as `leave-ROBOT`, may be longer."""

NAME_IN_WORDS: Final = "1 to 32 of A-Z a-z 0-9 _ . -, not dots alone"


def hello(fleet: str, robot: str) -> str:
    """Return the key on which a robot introduces itself."""
    return f"{ROOT}/{fleet}/hello/{robot}"


def plan(fleet: str, robot: str) -> str:
    """Return the key on which a robot gets its plan or its refusal."""
    return f"{ROOT}/{fleet}/plan/{robot}"


def command(fleet: str) -> str:
    """Return the key on which the coordinator sends its Commands."""
    return f"{ROOT}/{fleet}/command"


def report(fleet: str, robot: str) -> str:
    """Return the key on which a robot reports its state."""
    return f"{ROOT}/{fleet}/report/{robot}"


def clock(fleet: str, robot: str) -> str:
    """Return the key on which a robot asks for the time and the coordinator answers."""
    return f"{ROOT}/{fleet}/clock/{robot}"


def admit(fleet: str, robot: str) -> str:
    """Return the key on which an operator lets a robot take part again."""
    return f"{ROOT}/{fleet}/admit/{robot}"


def order(fleet: str) -> str:
    """Return the key on which operators give orders and take them back."""
    return f"{ROOT}/{fleet}/order"


def orders(fleet: str, order_id: str) -> str:
    """Return the key on which the coordinator says what became of an order."""
    return f"{ROOT}/{fleet}/orders/{order_id}"


def block(fleet: str) -> str:
    """Return the key on which operators close places and open them."""
    return f"{ROOT}/{fleet}/block"


def blocks(fleet: str, block_id: str) -> str:
    """Return the key on which the coordinator says that a place is closed."""
    return f"{ROOT}/{fleet}/blocks/{block_id}"


def roster(fleet: str) -> str:
    """Return the key on which operators take robots into the fleet and out of it."""
    return f"{ROOT}/{fleet}/roster"


def tell(fleet: str) -> str:
    """Return the key on which operators stop a fleet, let it go on, or end it."""
    return f"{ROOT}/{fleet}/tell"


def alive(fleet: str, robot: str) -> str:
    """Return the key that is alive as long as the robot's link is up; no message is put on it."""
    return f"{ROOT}/{fleet}/alive/{robot}"


@lru_cache(maxsize=1024)
def split(key: str) -> tuple[str, str, str] | None:
    """Split a key into (fleet, kind, robot, order or block); None for other keys.

    The last part is empty for keys that name neither.
    """
    parts = key.split("/")
    if len(parts) == 4 and parts[2] == "orders" and _ORDER.fullmatch(parts[3]):
        names = parts[1:2]
    else:
        names = parts[1:]
    if parts[0] != ROOT or not all(NAME.fullmatch(name) for name in names):
        return None
    if len(parts) == 3 and parts[2] in _OF_A_FLEET:
        return parts[1], parts[2], ""
    if len(parts) == 4 and parts[2] in _OF_ONE:
        return parts[1], parts[2], parts[3]
    return None


TOLD: Final = (order, tell, block, roster)
"""Keys of a fleet on which operators speak, besides `admit`."""


def fits(expression: list[str], parts: list[str]) -> bool:
    """Return whether a key's parts match an expression's; `*` matches exactly one part."""
    return len(expression) == len(parts) and all(
        wanted in ("*", part) for wanted, part in zip(expression, parts, strict=True)
    )
