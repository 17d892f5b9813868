"""Many runs of a campaign on several processes, or on whatever else an executor has.

Decides: which seeds are under way, and that a crash of the code under test is an outcome too.
Must not know: what a run consists of.
"""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, resource_tracker
from typing import Final

from coordinator.base.interrupts import held_back
from coordinator.scenario.model import Scenario
from sim.campaigns.campaign import Outcome, Wish, run_seed
from sim.campaigns.latencies import Latencies
from sim.world.fault_text import Fault

_MOST_AHEAD: Final = 1_000
"""How many runs are handed out at a time: an executor keeps something for each."""


def run_all(
    scenario: Scenario,
    seeds: Iterable[int],
    wish: Wish,
    faults: Sequence[Fault] | None,
    executor: Executor,
) -> Generator[Outcome]:
    """Yield the outcomes of all seeds in order."""
    waiting: deque[Future[Outcome]] = deque()
    for seed in seeds:
        with held_back():
            waiting.append(executor.submit(attempt, scenario, seed, wish, faults))
        if len(waiting) > _MOST_AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


@contextmanager
def processes(jobs: int) -> Generator[Executor]:
    """Return a context with an executor of so many processes; an error ends them at once."""
    with _executor(jobs) as pool:
        try:
            yield pool
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
