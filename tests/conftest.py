"""Options that say how much of the sweeps is run: `--quick` (make quick), `--every` (make test)."""

from __future__ import annotations

import hypothesis
import pytest

from tests import sweeps

# Machines that run tests are loaded: how long an example takes says nothing.
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--quick",
        action="store_true",
        help="a tenth of each seed sweep, and no tests that start processes",
    )
    parser.addoption(
        "--every", type=int, default=1, metavar="N", help="each N-th seed of each seed sweep"
    )


def pytest_configure(config: pytest.Config) -> None:
    sweeps.set_step(sweeps.QUICK_STEP if config.getoption("quick") else config.getoption("every"))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("quick"):
        return
    left_out = [item for item in items if item.get_closest_marker("processes")]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if not item.get_closest_marker("processes")]
