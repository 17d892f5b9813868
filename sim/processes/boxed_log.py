"""Attaching the black boxes of a run to its log, once all of them are closed.

Decides: which log gets them: the newest one, if it was closed.  A log that was not closed is
evidence of how its coordinator ended, and remains unchanged.
"""

from __future__ import annotations

from pathlib import Path

from coordinator.base.console import write_file
from coordinator.log.blackbox_attachments import packed
from coordinator.log.recover import with_files


def newest_log(folder: Path) -> Path:
    """Return the last of a run's logs: run.mcap, run-2.mcap, ..., run-10.mcap."""
    return max(folder.glob("run*.mcap"), key=lambda path: (len(path.name), path.name))


def put_boxes(folder: Path) -> None:
    """Attach a run's black boxes to its newest log."""
    log = newest_log(folder)
    boxes = [packed(path.stem, path.read_bytes()) for path in sorted(folder.glob("blackbox/*.csv"))]
    boxed = with_files(log.read_bytes(), str(log), boxes)
    if boxed is not None:
        part = log.with_name(f".{log.name}.part")
        write_file(part, boxed)
        part.replace(log)
