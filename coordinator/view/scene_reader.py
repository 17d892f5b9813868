"""Reads a plan or a log from its file into a scene.

Decides: what is read.  Must not know: what is on the page.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from coordinator.base.errors import InputError
from coordinator.findings.traffic_numbers import first_go
from coordinator.log.blackbox_attachments import unpacked
from coordinator.log.log_file import RESUMED, logs_before, read_log
from coordinator.plan.plan_file import read
from coordinator.scenario.file_kinds import is_log
from coordinator.view.scene import Scene
from coordinator.view.scene_log import scene_of_logs
from coordinator.view.scene_plan import scene_of_plan
from coordinator.view.true_tracks import ghosts_of, read_ghosts


def read_scene(source: Path) -> Scene:
    """Return the scene of a plan, or of a log with the black boxes in it or beside it.

    Raise InputError if the file is neither.
    """
    if not is_log(source):
        return scene_of_plan(read(source))
    log = read_log(source)
    logs = [*logs_before(log, str(source)), log]
    depths = range(len(logs) - 1, -1, -1)
    names = [f"{source}{f': {RESUMED}' * depth}" for depth in depths]
    scene = scene_of_logs(list(zip(names, logs, strict=True)))
    scene = msgspec.structs.replace(scene, notes=[*log.remarks, *scene.notes])
    try:
        boxes = unpacked(log.attachments)
        if boxes:
            ghosts = ghosts_of(boxes, scene.robots, f"{source}: ")
        else:
            go_ns = first_go(logs, 0)
            folder = source if source.is_dir() else source.parent
            ghosts = read_ghosts(folder / "blackbox", scene.robots, go_ns)
    except InputError as error:
        left_out = [f"without black boxes: {problem}" for problem in error.problems]
        return msgspec.structs.replace(scene, notes=[*scene.notes, *left_out])
    return msgspec.structs.replace(scene, ghosts=ghosts)
