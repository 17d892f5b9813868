"""Many runs of a campaign on several processes.

Decides: which process runs which seed, and that a crash of the code under test is an outcome too.
Must not know: what a run consists of.
"""

from __future__ import annotations

import signal
from collections.abc import Generator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import active_children, get_context, resource_tracker

from coordinator.base.interrupts import held_back
from coordinator.scenario.model import Scenario
from sim.campaigns.campaign import Outcome, Wish, run_seed
from sim.campaigns.latencies import Latencies
from sim.world.fault_text import Fault


def run_all(
    scenario: Scenario,
    seeds: Sequence[int],
    wish: Wish,
    faults: Sequence[Fault] | None = None,
    jobs: int = 1,
) -> Generator[Outcome]:
    """Yield the outcomes of all seeds in order; closing the generator ends the processes."""
    with _executor(jobs) as pool:
        with held_back():
            futures = [pool.submit(attempt, scenario, seed, wish, faults) for seed in seeds]
        try:
            for future in futures:
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in active_children():
                process.terminate()
            raise


def attempt(
    scenario: Scenario, seed: int, wish: Wish, faults: Sequence[Fault] | None = None
) -> Outcome:
    """Run a seed; an exception of the code under test becomes a violation."""
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
    resource_tracker.ensure_running()  # its start would unblock signals, see held_back
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_obey_the_pool)


def _obey_the_pool() -> None:
    """Ignore Ctrl-C, which the parent process handles, and let the parent end this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
