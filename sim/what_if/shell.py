"""The shell of a what-if: it reads a log, continues the run, and leaves the same files as any run.

Decides: which files are written, and where black boxes are looked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from coordinator.base.console import write_file
from coordinator.base.errors import InputError
from coordinator.log.blackbox_attachments import unpacked
from coordinator.log.records import Log
from sim.campaigns.campaign import run_world
from sim.judging.blackbox import Row, blackbox_text, parse_blackbox
from sim.processes.run_folder import clear_folder, write_later_plans
from sim.what_if.continuation import logs_for, world_of
from sim.what_if.history import History, read_history
from sim.world.fault_script import read_faults
from sim.world.fault_text import Fault


def carry_on(
    log: Path, until: float, folder: Path, texts: Sequence[str], seed: int
) -> tuple[str, bool]:
    """Continue a logged run from `until` [s since the first GO] and write its files to `folder`.

    Returns the fleet's name and whether the fleet counts every robot as arrived.  Raises InputError
    when the log cannot be continued, a fault is not valid, or `folder` is the log's own.
    """
    if folder.resolve() == log.parent.resolve():
        raise InputError([f"--out: {folder} is the folder of the log; name another"])
    history = read_history(log, until)
    faults = _faults(texts, history, until)
    boxes = _boxes(log, history.logs[-1], until)
    first = history.logs[0].attachments
    clear_folder(folder)
    for name, file in (("scenario.json", "scenario.json"), ("plan-1.json", "plan.json")):
        write_file(folder / file, first[name])
    with closing(logs_for(history, folder)) as logs:
        world = world_of(history, logs, boxes, faults, seed)
        run_world(world, world.mission.documents[min(world.mission.documents)])
    write_later_plans(folder)
    for name, robot in world.robots.items():
        told = [row for row in robot.written_rows() if row[0] > until or not boxes.get(name)]
        text = blackbox_text([*boxes.get(name, []), *told])
        write_file(folder / "blackbox" / f"{name}.csv", text)
    return world.fleet.name, world.fleet.members.has_arrived


def _faults(texts: Sequence[str], history: History, until: float) -> list[Fault]:
    names = sorted(history.robots)
    faults = read_faults(texts, names)
    early = [text for text, fault in zip(texts, faults, strict=True) if fault.time < until]
    if early:
        raise InputError([f"--fault {text}: is before --until {until:g} s" for text in early])
    return faults


def _boxes(path: Path, log: Log, until: float) -> dict[str, list[Row]]:
    """Return the rows up to `until` of the black boxes in the log, or else in its folder."""
    texts = unpacked(log.attachments)
    if not texts:
        beside = sorted((path.parent / "blackbox").glob("*.csv"))
        texts = {file.stem: file.read_text("ascii", "replace") for file in beside}
    found = {}
    for name, text in texts.items():
        table, phases = parse_blackbox(text, f"blackbox/{name}.csv")
        rows = zip(table.tolist(), phases, strict=True)
        found[name] = [
            (*numbers, phase, None if math.isnan(estimate) else estimate)
            for (*numbers, estimate), phase in rows
            if numbers[0] <= until
        ]
    return found
