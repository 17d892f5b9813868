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
