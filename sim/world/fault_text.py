"""Faults for real processes, as written on the command line.

Decides: what a fault text means, and which acts it causes at which times [s since GO of the first
epoch].  The syntax of a robot's fault is KIND:ROBOT@SECONDS[:NUMBER], that of a coordinator's fault
is coordinator-KIND@SECONDS[:NUMBER].  Must not know: processes, links, files.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from coordinator.base.errors import InputError

Act = Literal["kill", "stop", "continue", "body", "cut", "heal", "babble", "resume"]
"""What is done to a robot or the coordinator; `body` is a line in the script of its driver."""

_LONGEST: Final = 1e6
_COORDINATOR: Final = "coordinator-"
_FORM: Final = re.compile(
    r"(?P<kind>[a-z-]+)(:(?P<robot>[^@:]+))?@(?P<time>-?\d+(\.\d+)?)(:(?P<value>-?\d+(\.\d+)?))?"
)


@dataclass(frozen=True)
class Kind:
    """One kind of fault: what it does, its first act, and the act that ends it.

    `number` names the number that may follow the time ("": there is no number); `default` is the
    value of a number that is left out (None: it is required).  The ending act follows the first act
    after `Fault.value` seconds.
    """

    does: str
    act: Act
    number: str = ""
    default: float | None = 0.0
    least: float = 0.0
    most: float = _LONGEST
    ending: Act | None = None


KINDS: Final = {
    "kill": Kind("the process ends at once", "kill"),
    "hang": Kind(
        "the process is stopped for SECONDS; without SECONDS, for ever",
        "stop",
        "SECONDS",
        math.inf,
        ending="continue",
    ),
    "slow": Kind(
        "the wheels turn at SHARE of the speed commanded", "body", "SHARE", None, most=1.0
    ),
    "stall": Kind(
        "the base does not move for SECONDS; without SECONDS, for ever", "body", "SECONDS", math.inf
    ),
    "skid": Kind(
        "the body slides METRES to its left in 0.2 s; 0.1 by default",
        "body",
        "METRES",
        0.1,
        -10.0,
        10.0,
    ),
    "cut": Kind("no network for SECONDS", "cut", "SECONDS", None, ending="heal"),
    "clock-step": Kind(
        "the wall clock jumps by SECONDS; this must change nothing",
        "body",
        "SECONDS",
        None,
        -1e9,
        1e9,
    ),
    "corrupt": Kind(
        "random bytes are sent on its keys for SECONDS; 3 by default", "babble", "SECONDS", 3.0
    ),
    "coordinator-kill": Kind("the coordinator ends at once", "kill"),
    "coordinator-hang": Kind(
        "the coordinator is stopped for SECONDS; 5 by default",
        "stop",
        "SECONDS",
        5.0,
        ending="continue",
    ),
    "coordinator-restart": Kind(
        "the coordinator ends at once and another resumes SECONDS later; 3 by default",
        "kill",
        "SECONDS",
        3.0,
        ending="resume",
    ),
}


ONLY_VIRTUAL: Final = ("restart", "clock-pause", "clock-jump", "driver-error")
"""The kinds that there are in virtual time only (fault_script.py)."""


@dataclass(frozen=True)
class Fault:
    """A fault of one kind at a time [s since GO]; robot "" is the coordinator."""

    kind: str
    robot: str
    time: float
    value: float = 0.0

    @property
    def act(self) -> Act:
        """The first act of the fault."""
        return KINDS[self.kind].act

    def written(self, default: float | None) -> str:
        """Return the text that parses to this fault; its number is left out if it is `default`."""
        whose = f":{self.robot}" if self.robot else ""
        value = "" if self.value == default else f":{self.value:g}"
        return f"{self.kind}{whose}@{self.time:g}{value}"


class Strike(NamedTuple):
    """One act of a fault and its time [s since GO]; `first`: whether this act begins the fault."""

    time: float
    act: Act
    fault: Fault
    first: bool


def parse_faults(texts: Sequence[str], robots: Sequence[str]) -> list[Fault]:
    """Parse fault texts and sort them by time; InputError with a line per invalid text."""
    faults, problems = [], []
    for text in texts:
        problem = _problem(text, robots)
        if problem:
            problems.append(f"--fault {text}: {problem}")
        else:
            faults.append(_fault(text))
    if problems:
        raise InputError(problems)
    return sorted(faults, key=lambda fault: fault.time)


def write_fault(fault: Fault) -> str:
    """Return the text that parses to this fault."""
    return fault.written(KINDS[fault.kind].default)


def strikes_of(faults: Iterable[Fault]) -> list[Strike]:
    """Return the acts of all faults in order of time."""
    strikes = []
    for fault in faults:
        strikes.append(Strike(fault.time, fault.act, fault, first=True))
        ending = KINDS[fault.kind].ending
        if ending is not None and math.isfinite(fault.value):
            strikes.append(Strike(fault.time + fault.value, ending, fault, first=False))
    return sorted(strikes, key=lambda strike: strike.time)


def fault_help() -> str:
    """Return the forms of all faults and what they do, for the help of a command."""
    return "; ".join(f"{form_of(name)} ({kind.does})" for name, kind in KINDS.items())


def form_of(name: str) -> str:
    """Return the syntax of a fault of this kind."""
    kind = KINDS[name]
    whose = "" if name.startswith(_COORDINATOR) else ":ROBOT"
    number = f":{kind.number}" if kind.default is None else f"[:{kind.number}]"
    return f"{name}{whose}@SECONDS{number if kind.number else ''}"


def _problem(text: str, robots: Sequence[str]) -> str:
    """Return what is wrong with a fault text; empty if nothing is."""
    found = _FORM.fullmatch(text)
    name = found["kind"] if found else text.split(":")[0].split("@")[0]
    kind = KINDS.get(name)
    if kind is None:
        return not_one_of(name, KINDS, "simulate" if name in ONLY_VIRTUAL else "")
    if found is None or (found["robot"] is None) != name.startswith(_COORDINATOR):
        return f"is not of the form {form_of(name)}"
    given = found["value"]
    if (given is not None and not kind.number) or (given is None and kind.default is None):
        return f"is not of the form {form_of(name)}"
    if found["time"].startswith("-"):
        return f"{found['time']} s is before the first GO; the time is 0 or more"
    if found["robot"] is not None and found["robot"] not in robots:
        return f"there is no robot {found['robot']}; the robots are {', '.join(robots)}"
    if given is not None and not kind.least <= float(given) <= kind.most:
        return f"{kind.number} {given} is not within {kind.least:g} to {kind.most:g}"
    return ""


def not_one_of(name: str, kinds: Iterable[str], command: str) -> str:
    """Return that a fault is not one of these kinds; `command`: the one that has it, if one has."""
    if command:
        return f"{name!r} is only with `{command}`; here it is one of {', '.join(kinds)}"
    return f"{name!r} is not one of {', '.join(kinds)}"


def _fault(text: str) -> Fault:
    found = _FORM.fullmatch(text)
    assert found is not None
    value = KINDS[found["kind"]].default if found["value"] is None else float(found["value"])
    assert value is not None
    return Fault(found["kind"], found["robot"] or "", float(found["time"]), value)
