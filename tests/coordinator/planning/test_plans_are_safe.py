"""Plans of seeded scenarios, judged by the proof and by a dense sampler that knows neither."""

import pytest

from benchmarks.safety import KINDS, outcome
from tests.sweeps import seeds

SCENARIOS = 30
MOST = 24


@pytest.mark.parametrize("seed", seeds(SCENARIOS))
def test_a_scenario_is_planned_safely_or_refused_for_a_reason(seed):
    found = outcome(seed, MOST, effort=3)
    assert found.ending in ("planned", "place crossed"), f"{found.kind}: {found.said}"


def test_the_scenarios_are_of_all_kinds():
    assert len(KINDS) <= SCENARIOS
