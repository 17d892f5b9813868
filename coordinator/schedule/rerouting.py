"""Detours for robots that wait long, where a detour is quicker than waiting.

Decides: which robots may get a detour, and whether it is worth taking.  Must not know: how paths
and waits are found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from coordinator.motion.velocity_profile import Motion
from coordinator.schedule.conflict_zones import Zones
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track

LONG: Final = 3.0
"""Robots whose waits delay them by more than this [s] may get a detour."""

_WORTH: Final = 1.0
"""How much quicker [s] a detour has to be: it is longer, and may be in the way of other robots."""

_NO_LATER: Final = 1e-6


def latest_robots(junctions: Junctions, motions: Sequence[Motion]) -> list[tuple[int, int]]:
    """Return each robot delayed by more than LONG and the owner of its last wait, latest first."""
    late = sorted(
        (track.alone - motion.finish, index)
        for index, (track, motion) in enumerate(zip(junctions.tracks, motions, strict=True))
        if motion.finish - track.alone > LONG
    )
    found = []
    for _, index in late:
        waits = [wait for wait in motions[index].waits if wait.owner >= 0]
        if waits:
            found.append((index, max(waits, key=lambda wait: wait.depart).owner))
    return found


def quicker_by(
    junctions: Junctions, motions: Sequence[Motion], index: int, track: Track
) -> tuple[Junctions, list[Motion]] | None:
    """Return junctions and motions with a robot on another track; None if it gains too little."""
    latest = motions[index].finish - _WORTH
    if track.alone >= latest:
        return None
    fresh = junctions.with_track(index, track)
    table = Motions(fresh.lengths())
    for other, motion in enumerate(motions):
        if other != index:
            table.put(other, motion)
    found = earliest_motion(fresh, table, index, latest=latest, anywhere=False)
    if found is None:
        return None
    kept = [_renumbered(motion, junctions.zones, fresh.zones) for motion in motions]
    kept[index] = found
    return fresh, kept


def with_reasons(junctions: Junctions, motions: Sequence[Motion]) -> list[Motion]:
    """Return motions, replanned if one of their waits has lost its zone because of a detour."""
    table = Motions(junctions.lengths(), motions)
    kept = list(motions)
    for index, motion in enumerate(motions):
        if all(wait.zone >= 0 for wait in motion.waits):
            continue
        table.put(index, None)
        found = earliest_motion(
            junctions, table, index, latest=motion.finish + _NO_LATER, anywhere=False
        )
        kept[index] = motion if found is None else found
        table.put(index, kept[index])
    return kept


def _renumbered(motion: Motion, old: Zones, new: Zones) -> Motion:
    """Return a motion whose waits have their zones' new numbers, -1 for a zone that is gone."""
    waits = []
    for wait in motion.waits:
        number = -1
        if wait.zone >= 0:
            same = (new.a == old.a[wait.zone]) & (new.b == old.b[wait.zone])
            same &= (new.extent == old.extent[wait.zone]).all(axis=1)
            number = int(same.argmax()) if same.any() else -1
        owner = wait.owner if number >= 0 else -1
        waits.append(replace(wait, zone=number, owner=owner))
    return Motion(motion.limits, waits)
