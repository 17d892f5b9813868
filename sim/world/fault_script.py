"""Faults of a fleet in virtual time: as data, as text, and chosen at random.

The syntax of a fault is KIND:ROBOT@SECONDS[:NUMBER] or coordinator-KIND@SECONDS[:NUMBER], as for
real processes (fault_text.py); seconds are counted from the GO of the first epoch.

Decides: which kinds of faults there are in virtual time, and how likely each is.  Must not know:
their effects (strikes.py).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from random import Random
from typing import Final, NamedTuple

from coordinator.base.errors import InputError
from sim.world.fault_text import KINDS as PROCESS_KINDS
from sim.world.fault_text import Fault, not_one_of

MOST_FAULTS: Final = 4

_FORM: Final = re.compile(
    r"(?P<kind>[a-z-]+)(:(?P<robot>[^@:]+))?@(?P<time>-?\d+(\.\d+)?)(:(?P<value>-?\d+(\.\d+)?))?"
)
_SOON: Final = 6.0
"""Half of the faults follow the one before within this time [s], so that they begin while the
fleet freezes, plans or arms."""


class VirtualKind(NamedTuple):
    """The number that may follow the time in a fault text.

    `number` is its name ("": there is no number), `default` its value if it is left out (None: it
    is required), `least` and `most` are its limits.  Campaigns choose it at random from the range
    `drawn`, or use the default with the probability `lasting`.
    """

    number: str = ""
    default: float | None = 0.0
    least: float = 0.0
    most: float = math.inf
    drawn: tuple[float, float] = (0.0, 0.0)
    lasting: float = 0.0


KINDS: Final = {
    "kill": VirtualKind(),
    "restart": VirtualKind("SECONDS", 3.0, drawn=(0.1, 8.0)),
    "hang": VirtualKind("SECONDS", math.inf, drawn=(0.1, 8.0), lasting=0.5),
    "slow": VirtualKind("SHARE", None, most=1.0, drawn=(0.2, 0.98)),
    "stall": VirtualKind("SECONDS", math.inf, drawn=(0.1, 6.0), lasting=0.2),
    "skid": VirtualKind("METRES", 0.1, -10.0, 10.0, drawn=(0.02, 0.15)),
    "cut": VirtualKind("SECONDS", None, drawn=(0.2, 10.0)),
    "corrupt": VirtualKind("SECONDS", 3.0, drawn=(0.5, 5.0)),
    "clock-pause": VirtualKind("SECONDS", None, drawn=(0.1, 8.0)),
    "clock-jump": VirtualKind("SECONDS", None, -1e6, 1e6, drawn=(0.1, 8.0)),
    "driver-error": VirtualKind(),
    "coordinator-hang": VirtualKind("SECONDS", 5.0, drawn=(0.1, 6.0)),
    "coordinator-restart": VirtualKind("SECONDS", 3.0, drawn=(0.5, 6.0)),
}

USUAL: Final = tuple(name for name in KINDS if name not in ("restart", "coordinator-restart"))
"""The kinds that campaigns use by default: a robot's new program needs somebody to admit it, and a
restarted coordinator needs a log to resume from."""


def read_faults(texts: Sequence[str], robots: Sequence[str]) -> list[Fault]:
    """Parse faults; raises InputError with one line for each invalid fault."""
    problems = [(text, _problem(text, robots)) for text in texts]
    wrong = [f"--fault {text}: {problem}" for text, problem in problems if problem]
    if wrong:
        raise InputError(wrong)
    return [_fault(text) for text in texts]


def write_fault(fault: Fault) -> str:
    """Return the text that parses to this fault."""
    return fault.written(KINDS[fault.kind].default)


def fault_help() -> str:
    """Return the forms of all faults, for the help of a command."""
    return ", ".join(form_of(name) for name in KINDS)


def form_of(name: str) -> str:
    """Return the syntax of a fault of this kind."""
    kind = KINDS[name]
    whose = "" if _is_coordinators(name) else ":ROBOT"
    number = f":{kind.number}" if kind.default is None else f"[:{kind.number}]"
    return f"{name}{whose}@SECONDS{number if kind.number else ''}"


def known_kinds(text: str) -> tuple[str, ...]:
    """Parse a comma-separated list of kinds; raises InputError that names unknown ones."""
    names = tuple(name.strip() for name in text.split(","))
    unknown = [name for name in names if name not in KINDS]
    if unknown:
        known = ", ".join(KINDS)
        raise InputError([f"--faults {name!r}: is not one of {known}" for name in unknown])
    return names


def draw_faults(
    dice: Random, robots: Sequence[str], finish: float, kinds: Sequence[str]
) -> list[Fault]:
    """Return 1 to MOST_FAULTS random faults of these kinds for a plan that ends at `finish` [s]."""
    faults: list[Fault] = []
    for _ in range(dice.randint(1, MOST_FAULTS)):
        time = dice.uniform(0.0, 1.05 * finish)
        if faults and dice.random() < 0.5:
            time = faults[-1].time + dice.uniform(0.0, _SOON)
        name = dice.choice(tuple(kinds))
        robot = "" if _is_coordinators(name) else dice.choice(tuple(robots))
        faults.append(Fault(name, robot, round(time, 2), _value(dice, name)))
    return sorted(faults, key=lambda fault: fault.time)


def _value(dice: Random, name: str) -> float:
    kind = KINDS[name]
    if kind.drawn == (0.0, 0.0) or dice.random() < kind.lasting:
        return kind.default or 0.0
    value = round(dice.uniform(*kind.drawn), 2)
    return -value if kind.least < 0.0 and dice.random() < 0.5 else value


def _is_coordinators(name: str) -> bool:
    return name.startswith("coordinator-")


def _fault(text: str) -> Fault:
    found = _FORM.fullmatch(text)
    assert found is not None
    value = KINDS[found["kind"]].default if found["value"] is None else float(found["value"])
    assert value is not None
    return Fault(found["kind"], found["robot"] or "", float(found["time"]), value)


def _problem(text: str, robots: Sequence[str]) -> str:
    """Return what is wrong with a fault text; empty if nothing is."""
    found = _FORM.fullmatch(text)
    name = found["kind"] if found else text.split(":")[0].split("@")[0]
    kind = KINDS.get(name)
    if kind is None:
        return not_one_of(name, KINDS, "run" if name in PROCESS_KINDS else "")
    form = f"is not of the form {form_of(name)}"
    if found is None or (found["robot"] is None) != _is_coordinators(name):
        return form
    given = found["value"]
    if (given is not None and not kind.number) or (given is None and kind.default is None):
        return form
    if found["time"].startswith("-"):
        return f"{found['time']} s is before the first GO; the time is 0 or more"
    if found["robot"] is not None and found["robot"] not in robots:
        return f"there is no robot {found['robot']}; the robots are {', '.join(robots)}"
    if given is not None and not kind.least <= float(given) <= kind.most:
        return f"{kind.number} {given} is not within {kind.least:g} to {kind.most:g}"
    return ""
