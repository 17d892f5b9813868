"""Who came how near to whom, against fine sampling and by hand."""

import numpy as np
import pytest

from coordinator.findings.nearness import nearest_of_all


def test_two_that_pass_between_samples_are_found_where_they_are_nearest():
    times = np.array([0.0, 1.0])
    there = np.array([[0.0, 0.0], [10.0, 0.0]])
    back = np.array([[10.0, 0.1], [0.0, 0.1]])
    one, other = nearest_of_all(times, [there, back])
    assert (one.other, other.other) == (1, 0)
    assert one.distance == other.distance == pytest.approx(0.1)
    assert one.t == pytest.approx(0.5)


@pytest.mark.parametrize("seed", range(8))
def test_every_robots_nearest_is_what_fine_sampling_of_all_pairs_finds(seed):
    random = np.random.default_rng(seed)
    times = np.sort(random.uniform(0.0, 9.0, 15))
    tracks = [np.cumsum(random.normal(0.0, 0.4, (15, 2)), axis=0) for _ in range(7)]
    fine = np.union1d(np.linspace(times[0], times[-1], 20_001), times)
    dense = np.array([[np.interp(fine, times, track[:, i]) for i in (0, 1)] for track in tracks])
    for index, found in enumerate(nearest_of_all(times, tracks)):
        apart = np.hypot(*np.moveaxis(dense - dense[index], 1, 0))
        apart[index] = np.inf
        assert found.distance == pytest.approx(apart.min(), abs=2e-3)
        assert found.distance <= apart.min() + 1e-9
        at = np.argmin(np.abs(fine - found.t))
        assert apart[found.other, at] == pytest.approx(found.distance, abs=2e-3)


def test_one_alone_has_nobody_near_and_standing_ones_keep_their_distance():
    still = np.zeros((3, 2))
    assert nearest_of_all(np.arange(3.0), [still]) == []
    assert nearest_of_all(np.empty(0), [np.empty((0, 2))] * 2) == []
    (one, _) = nearest_of_all(np.arange(3.0), [still, still + 3.0])
    assert one.distance == pytest.approx(3.0 * np.sqrt(2.0))


def test_a_robot_is_near_nobody_while_it_is_not_there():
    """The second one comes from nowhere to 3 m from the first, and is nearest as it goes again."""
    times = np.arange(60.0)
    one, other = np.zeros((60, 2)), np.column_stack((np.linspace(9.0, 3.0, 60), np.ones(60)))
    other[:20] = other[40:] = np.nan
    first, second = nearest_of_all(times, [one, other])
    assert (first.other, second.other) == (1, 0)
    assert first.distance == second.distance == pytest.approx(np.hypot(*other[39]))
    assert first.t == 39.0
    other[:] = np.nan
    assert [near.other for near in nearest_of_all(times, [one, other])] == [-1, -1]
