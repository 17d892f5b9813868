"""The same work on this machine and on a Dask cluster of two workers, each with one core.

`python -m benchmarks.cluster 300 1000 5000` plans floors of so many robots; without numbers, 300
and 1,000.  Decides: which work.  Must not know: how work is sent.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from typing import Final

import distributed
from msgspec.structs import replace

from benchmarks.campaign import WORKERS
from benchmarks.table import ROOT, Row, show
from coordinator.plan.plan_file import to_json
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.service.cluster import executor_on
from coordinator.service.kernel_setup import get_kernels_ready
from coordinator.service.planning import plan_here
from sim.campaigns.campaign import Wish
from sim.campaigns.pool import processes, run_all
from sim.floors.generator import generate

_SEEDS: Final = 200
_TASKS: Final = 1_000
_MILLION: Final = 1_000_000
_HOUR: Final = 3600.0


def plans(counts: Iterable[int], executor: Executor) -> list[Row]:
    """Plan open floors here and on the cluster; the time of each stage [s]."""
    rows: list[Row] = []
    for count in counts:
        scenario = generate("open", count, 1)
        here, there = plan_here(scenario).document, plan_here(scenario, executor=executor).document
        same = to_json(replace(here, timing={})) == to_json(replace(there, timing={}))
        for where, document in (("here", here), ("cluster", there)):
            timing = document.timing
            row: Row = {"robots": count, "where": where, "same bytes": str(same)}
            row |= {f"{stage} s": spent for stage, spent in timing.items()}
            rows.append(row | {"total s": sum(timing.values())})
    return rows


def seeds(executor: Executor) -> list[Row]:
    """Run a campaign on one process, on two, and on the cluster; and tasks that do nothing."""
    five = read_scenario(ROOT / "examples" / "paper_five.toml")
    rows: list[Row] = []
    for name, jobs in (("one process", 1), (f"{WORKERS} processes", WORKERS)):
        with processes(jobs) as pool:
            rows.append({"on": name} | _run(five, pool))
    rows.append({"on": "cluster, 2 workers"} | _run(five, executor))
    alone = float(rows[0]["s a seed"])
    for row in rows:
        row["times as fast"] = alone / float(row["s a seed"])
    return rows


def overheads(executor: Executor) -> list[Row]:
    """Return what a task costs that does nothing, in a thread and on the cluster."""
    with ThreadPoolExecutor(2) as threads:
        return [
            {"on": name, "ms a task": 1000.0 * _timed(partial(_nothing, where)) / _TASKS}
            for name, where in (("threads", threads), ("cluster", executor))
        ]


def _run(scenario: Scenario, executor: Executor) -> Row:
    """Return what a seed takes once processes have started, and what a million would."""
    list(run_all(scenario, range(2 * WORKERS), Wish(), None, executor))
    spent = _timed(lambda: list(run_all(scenario, range(_SEEDS), Wish(), None, executor)))
    each = spent / _SEEDS
    return {"seeds": _SEEDS, "s a seed": each, "h for 1,000,000": each * _MILLION / _HOUR}


def _nothing(executor: Executor) -> None:
    for future in [executor.submit(abs, -1) for _ in range(_TASKS)]:
        future.result()


def _timed(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def main() -> None:
    """Print the tables."""
    counts = [int(text) for text in sys.argv[1:]] or [300, 1_000]
    get_kernels_ready()
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1"
        ) as cluster,
        executor_on(cluster.scheduler_address) as executor,
    ):
        _nothing(executor)  # Workers load kernels with their first task.
        show("a task that does nothing", overheads(executor))
        show("seeds of a campaign", seeds(executor))
        show("plans, stage by stage", plans(counts, executor))


if __name__ == "__main__":
    main()
