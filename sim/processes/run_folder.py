"""The folder of a run: which fleet's run it holds, and what a new run removes from it.

Decides: what may be replaced, and that a run that was refused leaves no files.  Must not know:
processes, or what is in the files except for the fleet's name.
"""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Final

from coordinator.base.console import write_file
from coordinator.base.errors import InputError
from coordinator.cli.plan_commands import make_folder
from coordinator.log.box_file import box_text
from coordinator.log.log_file import read_log
from coordinator.plan.plan_file import is_plan_name, plan_name

_OF_A_RUN: Final = ("run*.mcap", "plan*.*", "summary.json", "blackbox/*.csv*", "faults/*.txt")
"""Files that an earlier run may have left in the folder; files of two runs must not mix."""

_NAMED_IN: Final = (("scenario.json", "name"), ("plan.json", "scenario"))
_PARTS: Final = ("blackbox", "faults")


def clear_folder(folder: Path) -> None:
    """Remove what an earlier run left in a folder, and create its folder of black boxes."""
    (folder / "blackbox").mkdir(parents=True, exist_ok=True)
    _take_away(folder)
    _drop_empty(folder / "faults")


def drop_starts(folder: Path, start_ns: int) -> None:
    """Remove the .start files after a run, which only programs that are started again need.

    Boxes that count from a later GO than the first one, `start_ns`, count from that one then.
    """
    for start in folder.glob("blackbox/*.csv.start"):
        box = start.with_suffix("")
        if box.is_file():
            write_file(box, box_text(box, start_ns).encode())
        start.unlink()


def write_later_plans(folder: Path) -> None:
    """Write the plans of later epochs beside the first one; they are taken from the run's logs."""
    for log in sorted(folder.glob("run*.mcap")):
        for name, content in read_log(log).attachments.items():
            if is_plan_name(name) and name != plan_name(1):
                write_file(folder / name, content)


def fleet_of(folder: Path) -> str | None:
    """Return the name of the fleet whose run a folder holds; None when there is none."""
    for file, key in _NAMED_IN:
        with suppress(OSError, ValueError, RecursionError):
            found = json.loads((folder / file).read_bytes())
            if isinstance(found, dict) and isinstance(found.get(key), str):
                return str(found[key])
    return None


class RunFolder:
    """A folder that a run of `fleet` is about to fill."""

    def __init__(self, path: Path, fleet: str, *, force: bool) -> None:
        """Make the folder; InputError when it holds another fleet's run, unless `force` is true."""
        if path.exists() and not path.is_dir():
            raise InputError([f"--out: {path} is not a folder"])
        other = fleet_of(path)
        if other not in (None, fleet) and not force:
            raise InputError(
                [f"--out: {path} holds a run of fleet {other[:60]!r}; --force replaces it"]
            )
        self._path = path
        self._new = [one for one in (path, *path.parents) if not one.exists()]
        scenario = path / "scenario.json"
        self._scenario = scenario.read_bytes() if scenario.is_file() else None
        make_folder(path / "blackbox")

    def leave_nothing(self) -> None:
        """Remove what a run has created that was refused before any robot was started."""
        _take_away(self._path)
        scenario = self._path / "scenario.json"
        if self._scenario is None:
            scenario.unlink(missing_ok=True)
        else:
            scenario.write_bytes(self._scenario)
        for part in _PARTS:
            _drop_empty(self._path / part)
        for made in self._new:
            _drop_empty(made)


def _take_away(folder: Path) -> None:
    for pattern in _OF_A_RUN:
        for old in folder.glob(pattern):
            old.unlink()


def _drop_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
