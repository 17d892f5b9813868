"""The configuration of a router for fleets with keys, as zenohd reads it (JSON5).

protocol/access.py decides who may do what; protocol/zenoh_transport.py decides how the link is
encrypted.

Decides: which fleets may share a router, and what the file looks like.  Must not know: the
register, where the file is kept.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from coordinator.base.errors import InputError
from coordinator.scenario.model import Scenario
from protocol.access import access_control, router_rights
from protocol.badge import Badge
from protocol.key_files import KeyFiles
from protocol.zenoh_transport import router_settings


def meeting_fleets(
    scenarios: Iterable[Scenario], joiners: Iterable[str] = ()
) -> dict[str, list[str]]:
    """Return each fleet's robots; scenarios with the same name belong to the same fleet.

    `joiners`: robots that may join any of the fleets; those of a scenario stay in their own.
    Raises InputError if a robot's name is in two scenarios' fleets, because its key would be valid
    in both.
    """
    homes: dict[str, str] = {}
    fleets: dict[str, list[str]] = {}
    problems: dict[str, None] = {}
    for scenario in scenarios:
        robots = fleets.setdefault(scenario.name, [])
        for robot in (one.id for one in scenario.robots):
            home = homes.setdefault(robot, scenario.name)
            if home != scenario.name:
                both = f"is in the fleets {home} and {scenario.name}"
                problems[
                    f"{robot}: {both}; at one router, a name and its key may be in one fleet only"
                ] = None
            elif robot not in robots:
                robots.append(robot)
    if problems:
        raise InputError(list(problems))
    free = [robot for robot in joiners if robot not in homes]
    return {fleet: [*robots, *free] for fleet, robots in fleets.items()}


def router_file(
    endpoint: str, files: KeyFiles, fleets: Mapping[str, Collection[str]], badges: Iterable[Badge]
) -> bytes:
    """Return the configuration, which names the router's `files` by absolute paths.

    `badges` are the parties with valid certificates; each gets the rights of its role in its fleet.
    """
    pairs = ((badge, router_rights(fleets, badge)) for badge in badges)
    access = access_control((badge, right) for badge, right in pairs if right is not None)
    settings = _nested(router_settings(endpoint, files, access))
    head = (
        f"// zenohd --config THIS_FILE, for {'the fleet' if len(fleets) == 1 else 'the fleets'} "
        f"{', '.join(fleets)}.\n"
        "// Written by `splinefleet keys router`.  After a key was made or revoked or a robot was\n"
        "// added, write it again and restart the router.  Who is not named here may do nothing.\n"
    )
    return (head + json.dumps(settings, indent=2) + "\n").encode()


def _nested(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings whose names are paths ("a/b") as nested objects."""
    whole: dict[str, Any] = {}
    for path, value in settings.items():
        *parts, last = path.split("/")
        inner = whole
        for part in parts:
            inner = inner.setdefault(part, {})
        inner[last] = value
    return whole
