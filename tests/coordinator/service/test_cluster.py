"""Work on a cluster: what is sent, which workers are trusted, and what people are told."""

import itertools
import json
import pickle
import socket
from contextlib import contextmanager

import dask
import distributed
import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

import splinefleet
from coordinator.base.errors import ClusterError, InputError
from coordinator.plan.plan_file import to_json
from coordinator.service import cluster
from coordinator.service.cluster import executor_on
from coordinator.service.planning import plan_here
from sim.floors.generator import generate
from tests.test_readme import ROOT

PAPER = str(ROOT / "examples" / "paper_five.toml")


@contextmanager
def workers(count):
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "120s"}),  # Busy machines are slow.
        distributed.LocalCluster(
            n_workers=count,
            processes=False,
            threads_per_worker=1,
            dashboard_address=":0",
            protocol="tcp://",
            host="127.0.0.1",
        ) as made,
    ):
        yield made


@pytest.fixture(scope="module")
def address():
    with workers(2) as made:
        yield made.scheduler_address


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE_S", 0.5)


class Counted:
    """A value that counts how often it is pickled."""

    def __init__(self):
        self.data, self.pickled = bytes(10_000), 0

    def __reduce__(self):
        self.pickled += 1
        return bytes, (self.data,)


def test_a_cluster_makes_the_plan_that_this_machine_makes(address):
    scenario = generate("open", 110, 4)
    here = plan_here(scenario, 2).document
    with executor_on(address) as executor:
        there = plan_here(scenario, 2, executor=executor).document
    assert to_json(replace(there, timing={})) == to_json(replace(here, timing={}))


def test_a_campaign_says_the_same_on_a_cluster(address):
    asked = ["campaign", PAPER, "--seeds", "2", "--json"]
    here = CliRunner().invoke(splinefleet.app, [*asked, "--jobs", "1"])
    there = CliRunner().invoke(splinefleet.app, [*asked, "--cluster", address])
    assert here.exit_code == there.exit_code == 0
    assert json.loads(here.stdout) == json.loads(there.stdout)


def test_what_many_tasks_take_is_sent_once(address):
    value = Counted()
    with executor_on(address) as executor:
        found = [executor.submit(len, value).result() for _ in range(5)]
    assert (found, value.pickled) == ([10_000] * 5, 1)


def test_small_values_go_with_the_task(address):
    with executor_on(address) as executor:
        assert executor.submit(divmod, 17, 5).result() == (3, 2)
        assert executor.submit(int, "11", base=2).result() == 3


def test_the_error_of_a_task_is_that_of_the_task(address):
    with executor_on(address) as executor, pytest.raises(pickle.UnpicklingError):
        executor.submit(pickle.loads, b"nothing").result()


def test_a_worker_with_other_software_is_not_trusted(address, monkeypatch):
    says = itertools.cycle(["numpy 2", "numpy 1"])
    monkeypatch.setattr(cluster, "software", lambda: next(says))
    with (
        pytest.raises(ClusterError, match="other software: numpy 1; needed: numpy 2"),
        executor_on(address) as executor,
    ):
        executor.submit(len, "abc").result()


@pytest.mark.usefixtures("impatient")
def test_a_place_where_nobody_answers_is_told():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        free = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(InputError, match=f"{free} is not .* a scheduler"), executor_on(free):
            pass


def test_the_address_of_a_worker_is_told_apart():
    with workers(1) as made:
        (worker,) = made.workers.values()
        with pytest.raises(InputError, match="scheduler: Worker"), executor_on(worker.address):
            pass


@pytest.mark.usefixtures("impatient")
def test_a_cluster_without_workers_is_told():
    with (
        workers(0) as made,
        pytest.raises(InputError, match="has no worker"),
        executor_on(made.scheduler_address),
    ):
        pass


@pytest.mark.parametrize("address", ["127.0.0.1:8786", "http://here:1", "tcp://here", "tcp://:1"])
def test_an_address_of_another_form_is_wrong_usage(address):
    result = CliRunner().invoke(splinefleet.app, ["plan", PAPER, "--cluster", address])
    assert result.exit_code == 2


def test_jobs_have_no_meaning_beside_a_cluster():
    asked = ["campaign", PAPER, "--jobs", "2", "--cluster", "tcp://127.0.0.1:1"]
    assert CliRunner().invoke(splinefleet.app, asked).exit_code == 2
