"""The same plan, byte for byte, whatever the work is done on."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import pytest
from msgspec.structs import replace

from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from sim.floors.generator import generate

ROBOTS = 110
"""Enough for paths and zones to be found in parts."""


@pytest.fixture(scope="module")
def scenario():
    return generate("open", ROBOTS, 4)


@pytest.fixture(scope="module")
def alone(scenario):
    return planned(scenario, None)


def planned(scenario, executor):
    return to_json(replace(plan_scenario(scenario, effort=2, executor=executor), timing={}))


def test_threads_make_the_plan_that_one_thread_makes(scenario, alone):
    with ThreadPoolExecutor(2) as executor:
        assert planned(scenario, executor) == alone


def test_processes_make_the_plan_that_one_thread_makes(scenario, alone):
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as executor:
        assert planned(scenario, executor) == alone
