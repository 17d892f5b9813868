"""Which files of a folder are its log, by their names and by what they resume.

Decides: how the files of a day are named, which log of a folder is meant when it holds several, and
where the black boxes of a log are looked for.
Must not know: how a log is read (log_file.py).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from coordinator.base.errors import InputError
from coordinator.log.records import Log

_FILES: Final = "run-{:04d}.mcap"
_NUMBERED: Final = re.compile(r"run-(\d{4,})\.mcap")
"""The files of a log that is a folder."""

_OF_RUN: Final = re.compile(r"run(-\d+)?\.mcap")
"""The files that `run` and `simulate` write; the other ones were put beside them."""


def numbered_files(folder: Path) -> list[Path]:
    """Return the files of a log that is a folder, run-0001.mcap and so on, in order."""
    files = [path for path in folder.glob("run-*.mcap") if _NUMBERED.fullmatch(path.name)]
    return sorted(files, key=lambda path: (len(path.name), path.name))


def next_file(folder: Path) -> Path:
    """Return the path of the next file of a log that is a folder."""
    found = (_NUMBERED.fullmatch(path.name) for path in folder.glob("run-*.mcap"))
    numbers = [int(one[1]) for one in found if one is not None]
    return folder / _FILES.format(max(numbers, default=0) + 1)


def files_of_runs(folder: Path) -> list[Path]:
    """Return the files of a log that is a folder, or else run.mcap, run-2.mcap, ..., in order."""
    runs = sorted(folder.glob("run*.mcap"), key=lambda path: (len(path.name), path.name))
    return numbered_files(folder) or runs


def other_files(folder: Path) -> list[Path]:
    """Return the MCAP files of a folder that are not files of a log that is a folder."""
    return sorted(path for path in folder.glob("*.mcap") if not _NUMBERED.fullmatch(path.name))


def newest_log(
    folder: Path, logs: Mapping[Path, Log], before: Callable[[Log], Iterable[Log]]
) -> Path | None:
    """Return the file whose log contains the logs of all other files, because it resumes them.

    Of several that no other one resumes, one with the name of a run's file is meant.  A listener's
    recordings count only in a folder that holds nothing else.  `before` returns the logs that a log
    resumes.  Returns None if there are no logs; raises InputError, with the files' names, if none
    contains all others.
    """
    own = {file: log for file, log in logs.items() if not log.is_recording} or logs
    resumed = {one.metadata.get("boot") for log in own.values() for one in before(log)} - {None}
    ends = [file for file, log in own.items() if log.metadata.get("boot") not in resumed]
    ends = [file for file in ends if _OF_RUN.fullmatch(file.name)] or ends
    if len(ends) < 2:
        return ends[0] if ends else None
    names = ", ".join(file.name for file in ends)
    problem = f"holds {len(ends)} logs, none of which contains the others: {names}"
    raise InputError([f"{folder}: {problem}; name one of them"])


def box_folders(source: Path) -> list[Path]:
    """Return the folders in which the black boxes of a log, or of a folder, are looked for.

    They are those beside the log, which may itself be a folder of numbered files.
    """
    beside = [source] if source.is_dir() else [source.parent]
    beside += [source.parent] if numbered_files(source) else []
    return [place for folder in beside for place in (folder / "blackbox", folder)]


def hint_below(folder: Path) -> str:
    """Return words for the folders in a folder that hold a log; empty if there are none."""
    found = sorted(path.parent.name for path in folder.glob(f"*/{_FILES.format(1)}"))
    return f"; a log is in {', '.join(found)}" if found else ""
