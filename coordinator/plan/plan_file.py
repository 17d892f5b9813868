"""plan.json: a plan document written to JSON, read back and checked.

Decides: the file's encoding, and the wording of errors about a file that cannot be read.  Must not
know: which values a plan may have (checks.py, references.py).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import msgspec

from coordinator.base.errors import InputError
from coordinator.plan.checks import find_problems
from coordinator.plan.document import FORMAT, PlanDocument
from coordinator.plan.references import find_wrong_names
from coordinator.scenario.file_kinds import kind_of, wrong_kind

_MOST_DIGITS: Final = 300
_PLAN: Final = FORMAT[: FORMAT.index("/") + 1]


def plan_name(epoch: int) -> str:
    """Return the name under which a plan is attached to a log."""
    return f"plan-{epoch}.json"


def is_plan_name(name: str) -> bool:
    """Return whether an attachment of this name is a plan.

    If an epoch has several, the last one counts.
    """
    return name.startswith("plan-") and name.endswith(".json")


def to_json(document: PlanDocument) -> bytes:
    """Return the document as indented JSON."""
    return msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n"


def from_json(text: bytes, name: str = "plan") -> PlanDocument:
    """Parse and check plan.json; raises InputError naming the file and every bad field."""
    try:
        document = msgspec.json.decode(text, type=PlanDocument)
    except msgspec.ValidationError as error:
        found = _all_problems(text) or [str(error)]
        raise InputError([f"{name}: {problem}" for problem in found]) from None
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise InputError([f"{name}: {error}"]) from None
    if document.format != FORMAT:
        later = "; a later splinefleet wrote it" if document.format.startswith(_PLAN) else ""
        raise InputError([f"{name}: format is {document.format!r}, must be {FORMAT!r}{later}"])
    problems = find_problems(document) + find_wrong_names(document)
    if problems:
        raise InputError([f"{name}: {problem}" for problem in problems])
    return document


def _all_problems(text: bytes) -> list[str]:
    """Return all problems of a document with a field of another kind; none if Python fails."""
    from coordinator.plan.form import all_problems

    try:
        return all_problems(json.loads(text, parse_int=_whole))
    except (ValueError, RecursionError):
        return []


def _whole(digits: str) -> float:
    """Return a whole number; infinity for one that no float comes near."""
    return int(digits) if len(digits) < _MOST_DIGITS else float(digits)


def read(path: Path) -> PlanDocument:
    """Read a plan file; raises InputError when it cannot be read or understood."""
    try:
        text = path.read_bytes()
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
    try:
        return from_json(text, str(path))
    except InputError:
        found = kind_of(text)
        if found is None or found == "plan":
            raise
        raise InputError([wrong_kind(str(path), found, "plan")]) from None
