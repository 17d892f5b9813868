"""Telling scenario, plan and log files apart, to help a user who passes the wrong kind.

Decides: how the kind of a file is recognized, and the message about a wrong one.  Must not know:
what the files contain (scenario_files/scenario_reader.py, plan/document.py, log/log_file.py).
"""

from __future__ import annotations

import json
import shlex
from pathlib import Path, PurePath
from typing import Final, Literal

from coordinator.base.toml_text import toml_of
from coordinator.scenario.checks import printable

FileKind = Literal["scenario", "plan", "log"]

LOG_MAGIC: Final = b"\x89MCAP0\r\n"
"""The first bytes of every MCAP file."""


def kind_of(content: bytes) -> FileKind | None:
    """Return the kind of a file with these bytes; None if it is none of the three, or damaged."""
    if content.startswith(LOG_MAGIC):
        return "log"
    try:
        text = content.decode("utf-8-sig")
        return kind_of_document(
            json.loads(text) if text.lstrip().startswith("{") else toml_of(text)
        )
    except (ValueError, RecursionError):
        return None


def kind_of_document(document: object) -> FileKind | None:
    """Return the kind of a decoded file; None if it is neither a plan nor a scenario."""
    if not isinstance(document, dict):
        return None
    if str(document.get("format")).startswith("splinefleet.plan"):
        return "plan"
    return "scenario" if document.keys() >= {"workspace", "robots"} else None


def wrong_kind(name: str, found: FileKind, wanted: FileKind) -> str:
    """Return the message about a file of the wrong kind, with the command that would help."""
    file = shlex.quote(name)
    if found == "log":
        help_ = f"`splinefleet info {file}` tells what happened"
    elif found == "plan":
        help_ = f"`splinefleet verify {file}` proves it again, `plot` draws it"
    elif wanted == "log":
        help_ = f"`splinefleet run {file}` records one"
    else:
        path = PurePath(name)
        made = path.with_suffix(".json")
        made = path.with_name(f"{path.stem}-plan.json") if made == path else made
        help_ = f"`splinefleet plan {file} -o {shlex.quote(str(made))}` makes one"
    return f"{printable(name)} is a {found}, not a {wanted}; {printable(help_)}"


def is_log(path: Path) -> bool:
    """Return whether a path names a log: a folder, or a file by its name."""
    return path.suffix == ".mcap" or path.is_dir()
