import math

import pytest

from coordinator.base.errors import InputError
from coordinator.scenario.checks import find_problems
from sim.floors.generator import CROWDED, generate

EVERY_KIND = pytest.mark.parametrize("kind", sorted(CROWDED))


@EVERY_KIND
@pytest.mark.parametrize("count", [2, 3, 8, 20])
def test_every_crowded_kind_makes_sound_scenarios(kind, count):
    for seed in range(3):
        scenario = generate(kind, count, seed)
        assert find_problems(scenario) == []
        assert len(scenario.robots) == count
        assert generate(kind, count, seed) == scenario


@EVERY_KIND
def test_another_seed_makes_another_crowd(kind):
    assert len({generate(kind, 8, seed).robots for seed in range(4)}) > 1


@EVERY_KIND
def test_crowded_kinds_have_neither_headings_nor_via_points(kind):
    with pytest.raises(InputError, match="--headings"):
        generate(kind, 3, 1, headings=True)
    with pytest.raises(InputError, match="--vias"):
        generate(kind, 3, 1, vias=1)


def test_a_dense_floor_is_covered_as_asked():
    scenario = generate("dense", 50, 1)
    width, height = scenario.workspace.boundary[2]
    covered = 50 * math.pi * 0.2**2 / (width * height)
    assert covered == pytest.approx(0.15, abs=0.005)
