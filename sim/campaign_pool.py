"""Many runs of a campaign on several processes.

Decides: who runs which seed, and that a crash of the code under test is an outcome too.  Must not
know: what a run is made of.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context

from coordinator.scenario import Scenario
from sim.campaign import Outcome, Wish, run_seed
from sim.faults import Fault
from sim.latencies import Latencies


def run_all(
    scenario: Scenario,
    seeds: Sequence[int],
    wish: Wish,
    faults: Sequence[Fault] | None = None,
    jobs: int = 1,
) -> Iterator[Outcome]:
    """Yield the outcomes of all seeds in order."""
    with _executor(jobs) as pool:
        yield from pool.map(partial(attempt, scenario, wish=wish, faults=faults), seeds)


def attempt(
    scenario: Scenario, seed: int, wish: Wish, faults: Sequence[Fault] | None = None
) -> Outcome:
    """Run a seed; whatever the code under test raises is a violation."""
    with ThreadPoolExecutor(1) as thread:
        future = thread.submit(run_seed, scenario, seed, wish, faults)
        error = future.exception()
    if error is None:
        return future.result()
    return Outcome(
        seed=seed,
        faults=(),
        violations=(f"crashed: {type(error).__name__}: {error}",),
        over=True,
        touches=(),
        stuck=(),
        arrived=0,
        expected=0,
        excused={},
        said=(),
        epochs=0,
        seconds=0.0,
        latencies=Latencies(),
    )


def _executor(jobs: int) -> Executor:
    if jobs == 1:
        return ThreadPoolExecutor(1)
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
