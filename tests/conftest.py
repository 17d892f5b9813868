"""The option of the inner loop: `pytest --quick`, as `make quick` runs it."""

from __future__ import annotations

import pytest

from tests import sweeps


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--quick",
        action="store_true",
        help="a tenth of each seed sweep, and no tests that start processes",
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("quick"):
        sweeps.set_step(sweeps.QUICK_STEP)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("quick"):
        return
    left_out = [item for item in items if item.get_closest_marker("processes")]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if not item.get_closest_marker("processes")]
