"""The benchmarks: each is there to be run, and a day's work measures what it says it does."""

import importlib

import pytest

from tests.test_readme import ROOT

MODULES = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py"))


@pytest.mark.parametrize("name", [name for name in MODULES if name != "__main__"])
def test_every_benchmark_can_be_imported(name):
    importlib.import_module(f"benchmarks.{name}")


def test_a_day_of_orders_is_timed_search_by_search():
    orders = importlib.import_module("benchmarks.orders")
    row = orders.run(orders.day("open", 3, 1, per_robot=1), "open")
    assert (row["orders"], row["done"], row["touch"], row["freezes"]) == (3, 3, 0, 0)
    assert 0.0 < row["search ms"] <= row["p99 ms"]


def test_discs_on_a_map_of_movingai_are_compared_with_moves_from_cell_to_cell():
    movingai = importlib.import_module("benchmarks.movingai")
    (row,) = movingai.movingai(1, 0, ("room-32-32-4",), (4,))
    assert (row["map"], row["robots"], row["maps"], row["solved"]) == ("room-32-32-4", 4, 1, 1)
    assert 0.5 < row["ratio"] < 1.2
    assert row["last arrival [s]"] < row["sum of arrivals [s]"] < 4.0 * row["last arrival [s]"]
