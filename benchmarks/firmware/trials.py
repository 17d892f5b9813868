"""Trials of the C agent by seed: fleets in virtual time, and events against the Python agent.

Decides: what is measured in a trial, and what is summed up.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final
from unittest.mock import patch

import msgspec

from benchmarks.campaign import in_turn
from benchmarks.table import ROOT, Row
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.campaigns.campaign import run_seed
from sim.world.virtual_fleet import World
from tests.firmware.building import AS_PYTHON, IN_FLOAT, IN_PARTS, answers, host
from tests.firmware.c_service import CRobots
from tests.firmware.streams import Trial

TICKS: Final = 3000
_SCENARIO: Final = ROOT / "examples" / "paper_five_real.toml"
_FLEETS_STAND_ON: Final = ("coordinator", "protocol", "sim", "firmware", "tests/firmware")
_EVENTS_STAND_ON: Final = ("protocol", "robot_agent", "firmware", "tests/firmware")


class FleetTrial(msgspec.Struct):
    """What became of one fleet; lists of words."""

    arrived: int
    expected: int
    touches: list[str]
    violations: list[str]


class EventTrial(msgspec.Struct):
    """How both agents answered one stream; `apart` [mm]: the farthest that their places were."""

    events: int
    ticks: int
    differ: int
    apart: float


def fleet_trial(seed: int) -> FleetTrial:
    """Run five robots with the C core and 1 to 4 faults."""
    robots = CRobots(host(*IN_PARTS))
    with patch.object(World, "_service", robots.wrap(World._service)):
        outcome = run_seed(read_scenario(_SCENARIO), seed)
    robots.end()
    words = [[str(one) for one in found] for found in (outcome.touches, outcome.violations)]
    return FleetTrial(outcome.arrived, outcome.expected, *words)


def exact_trial(seed: int) -> EventTrial:
    """Compare the agents in double, to the last bit."""
    stream = Trial(seed).stream(TICKS)
    told = answers(host(*AS_PYTHON), stream.lines)
    pairs = list(zip(told, stream.ticks, strict=True))
    differ = sum(repr(told) != repr(expected) for told, expected in pairs)
    return EventTrial(len(stream.lines), len(pairs), differ, 0.0)


def float_trial(seed: int) -> EventTrial:
    """Compare the phases and places of the agent in float with those of the Python agent."""
    stream = Trial(seed, trouble=0.0).stream(TICKS)
    told = answers(host(*IN_FLOAT), stream.lines)
    pairs = list(zip(told, stream.ticks, strict=True))
    differ = sum(told.phase != expected.phase for told, expected in pairs)
    apart = max(abs(told.place - expected.place) for told, expected in pairs)
    return EventTrial(len(stream.lines), len(pairs), differ, 1000.0 * apart)


def fleets(seeds: Sequence[int], jobs: int, kept: Path | None) -> list[Row]:
    """Return the outcome of fleets in which every robot runs the C agent."""
    trials = in_turn(fleet_trial, seeds, jobs, kept, _FLEETS_STAND_ON)
    return [{
        "runs": len(trials),
        "arrived": sum(one.arrived for one in trials),
        "expected": sum(one.expected for one in trials),
        "touches": sum(len(one.touches) for one in trials),
        "violations": sum(len(one.violations) for one in trials),
        "seeds": " ".join(
            str(seed) for seed, one in zip(seeds, trials, strict=True)
            if one.touches or one.violations or one.arrived < one.expected
        ),
    }]  # fmt: skip


def events(seeds: Sequence[int], jobs: int, kept: Path | None) -> list[Row]:
    """Return how many events both agents were held against each other on, and what differed."""
    exact = in_turn(exact_trial, seeds, jobs, kept, _EVENTS_STAND_ON)
    close = in_turn(float_trial, seeds[: -(-len(seeds) // 10)], jobs, kept, _EVENTS_STAND_ON)
    return [
        {
            "core": core,
            "events": sum(one.events for one in trials),
            "ticks": sum(one.ticks for one in trials),
            "ticks differ": sum(one.differ for one in trials),
            "farthest apart mm": max(one.apart for one in trials),
        }
        for core, trials in (("double", exact), ("float", close))
    ]


TRIALS: Final = {"fleets": (fleets, 500), "events": (events, 300)}
"""What can be tried, and how many seeds make a whole trial: 500 fleets, a million events."""
