"""Plans of all kinds of floors, whole and damaged: the proof refuses what sampling finds unsafe."""

import pytest

from coordinator.planning.planner import plan_scenario
from sim.floors.generator import generate
from tests.damages import SAFE, damaged, judge

SCENES = (("open", 8, False), ("warehouse", 6, True), ("circle", 6, False), ("rooms", 6, True))
DAMAGES = 12


@pytest.mark.parametrize(("kind", "robots", "mixed"), SCENES)
def test_the_proof_and_the_dense_sampler_agree_on_whole_and_damaged_plans(kind, robots, mixed):
    document = plan_scenario(generate(kind, robots, 3, mixed=mixed))
    whole = judge(document)
    assert whole.agreed
    assert whole.slack > SAFE
    found = [made for seed in range(DAMAGES) if (made := damaged(document, seed)) is not None]
    judged = [judge(*one) for one in found]
    assert [one for one in judged if not one.agreed] == []
    assert any(one.refused for one in judged)
    assert any(not one.refused for one in judged)
