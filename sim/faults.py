"""Faults for real processes, as asked for on the command line.

Decides: what a fault text means.  KIND:ROBOT@SECONDS for a robot, KIND@SECONDS for the coordinator;
seconds count from GO.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from coordinator.errors import InputError

SIGNALS: Final = {
    "kill": signal.SIGKILL,
    "hang": signal.SIGSTOP,
    "coordinator-kill": signal.SIGKILL,
    "coordinator-hang": signal.SIGSTOP,
}

_FORM: Final = re.compile(r"(?P<kind>[a-z-]+)(:(?P<robot>[^@:]+))?@(?P<time>\d+(\.\d+)?)")


@dataclass(frozen=True)
class Fault:
    """A signal to one process at a time [s since GO]; robot "" is the coordinator."""

    kind: str
    robot: str
    time: float

    @property
    def signal(self) -> signal.Signals:
        """The signal that makes it happen."""
        return SIGNALS[self.kind]


def parse_faults(texts: Sequence[str], robots: Sequence[str]) -> list[Fault]:
    """Read fault texts, in order of time; InputError with a line per text that is wrong."""
    faults, problems = [], []
    for text in texts:
        found = _FORM.fullmatch(text)
        kind = found["kind"] if found else text.split(":")[0].split("@")[0]
        if kind not in SIGNALS:
            problems.append(f"--fault {text}: {kind!r} is none of {', '.join(SIGNALS)}")
        elif found is None or (found["robot"] is None) != kind.startswith("coordinator"):
            form = f"{kind}@SECONDS" if kind.startswith("coordinator") else f"{kind}:ROBOT@SECONDS"
            problems.append(f"--fault {text}: is not of the form {form}")
        elif found["robot"] is not None and found["robot"] not in robots:
            problems.append(
                f"--fault {text}: no robot {found['robot']}; there are {', '.join(robots)}"
            )
        else:
            faults.append(Fault(kind, found["robot"] or "", float(found["time"])))
    if problems:
        raise InputError(problems)
    return sorted(faults, key=lambda fault: fault.time)
