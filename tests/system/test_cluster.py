"""A cluster of real processes: a worker that is killed costs time only."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor

import distributed

from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.service.cluster import executor_on
from sim.campaigns.campaign import Wish
from sim.campaigns.pool import run_all
from tests.test_readme import ROOT

SEEDS = 8


def test_the_others_do_what_a_killed_worker_had_to_do():
    five = read_scenario(ROOT / "examples" / "paper_five.toml")
    with ThreadPoolExecutor(1) as here:
        expected = list(run_all(five, range(SEEDS), Wish(), None, here))
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1"
        ) as cluster,
        executor_on(cluster.scheduler_address) as executor,
    ):
        found = run_all(five, range(SEEDS), Wish(), None, executor)
        first = next(found)
        os.kill(cluster.workers[0].process.pid, signal.SIGKILL)
        assert [first, *found] == expected
