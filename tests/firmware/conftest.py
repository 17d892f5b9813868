"""The host programs that the tests run, each built once and kept by content."""

from __future__ import annotations

import pytest

from tests.firmware.building import AS_PYTHON, IN_FLOAT, IN_PARTS, host


@pytest.fixture(scope="session")
def exact_core():
    return host(*AS_PYTHON)


@pytest.fixture(scope="session")
def float_core():
    return host(*IN_FLOAT)


@pytest.fixture(scope="session")
def robot_core():
    return host(*IN_PARTS)
