"""Conflicts that no staircase covers, compared with dense samples of random motions."""

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from coordinator.plan.staircases import NO_STAIRCASES, Staircases
from coordinator.proof import precedence
from coordinator.proof.precedence import needs_of
from coordinator.proof.precedence_kernels import uncovered
from coordinator.proof.separation_kernels import Motions
from tests.sweeps import seeds

TAU, STEP, KEEP = 0.4, 0.01, 0.3
ROUGH = 0.02
"""How far [m] a robot may drive between two samples, and so how much they may miss."""


def wander(random):
    """Return pieces (n, 7) of a robot that drives to random places, at no more than 1 m/s."""
    count = int(random.integers(1, 40))
    places = np.cumsum(random.uniform(-0.7, 0.7, (count + 1, 2)), axis=0) + random.uniform(-4, 4, 2)
    times = np.cumsum([random.uniform(0, 3), *random.uniform(1.0, 2.0, count)])
    return np.column_stack((times[:-1], times[1:], places[:-1], places[1:], np.zeros(count)))


def sampled(pieces):
    times = np.arange(pieces[0, 0], pieces[-1, 1], STEP)
    knots = np.append(pieces[:, 0], pieces[-1, 1])
    x, y = (np.interp(times, knots, np.append(pieces[:, k], pieces[-1, k + 2])) for k in (2, 3))
    return times, np.column_stack((x, y))


def least_apart(ahead, behind, need):
    """Return the least distance at times need < t_ahead < t_behind - TAU; inf if there are none."""
    (t_ahead, p), (t_behind, q) = sampled(ahead), sampled(behind)
    apart = cdist(p, q)
    counts = (t_ahead[:, None] < t_behind - TAU) & (t_ahead[:, None] > need)
    return apart[counts].min(initial=np.inf)


@pytest.mark.parametrize("seed", seeds(40))
def test_a_conflict_is_found_for_exactly_the_pairs_that_samples_show(seed):
    random = np.random.default_rng(seed)
    fleet = [wander(random) for _ in range(6)]
    first = np.cumsum([0, *map(len, fleet)])
    # Half of the ordered pairs have a staircase of one knot: all before `need` is covered.
    pairs = [pair for pair in itertools.permutations(range(6), 2) if random.random() < 0.5]
    need = {pair: int(random.integers(0, 30_000)) for pair in pairs}
    stairs = Staircases(
        int(1000 * TAU),
        np.array([ahead for _, ahead in pairs], np.int64),
        np.array([behind for behind, _ in pairs], np.int64),
        np.arange(len(pairs) + 1),
        np.zeros(len(pairs), np.int32),
        np.array([need[pair] for pair in pairs], np.int32),
    )
    motions = Motions(np.concatenate(fleet), first, np.full(6, 0.5 * KEEP), np.ones(6, np.bool_))
    found = uncovered(motions, needs_of(stairs, 6), TAU, 0, 6)
    said = {(one.behind, one.ahead) for one in found}
    sure = 0
    for behind, ahead in itertools.permutations(range(6), 2):
        from_ms = need.get((behind, ahead), -np.inf)
        apart = least_apart(fleet[ahead], fleet[behind], 0.001 * from_ms)
        if abs(apart - KEEP) > ROUGH:
            assert ((behind, ahead) in said) == (apart < KEEP), (behind, ahead, apart)
            sure += 1
    assert sure > 20
    for one in found:
        (t_a, p), (t_b, q) = sampled(fleet[one.ahead]), sampled(fleet[one.behind])
        at = p[np.abs(t_a - one.t_ahead).argmin()] - q[np.abs(t_b - one.t_behind).argmin()]
        assert np.hypot(*at) < KEEP + 2 * ROUGH


def test_parts_of_the_work_find_what_the_whole_finds():
    random = np.random.default_rng(3)
    fleet = [wander(random) for _ in range(30)]
    motions = Motions(
        np.concatenate(fleet),
        np.cumsum([0, *map(len, fleet)]),
        np.full(30, 0.5 * KEEP),
        np.ones(30, np.bool_),
    )
    needs = needs_of(NO_STAIRCASES, 30)
    whole = uncovered(motions, needs, TAU, 0, 30)
    borders = precedence._borders(30)
    assert (borders[0], borders[-1]) == (0, 30)
    with ThreadPoolExecutor(2) as threads:
        parts = [
            threads.submit(uncovered, motions, needs, TAU, *one)
            for one in itertools.pairwise(borders)
        ]
        assert [one for part in parts for one in part.result()] == whole
    assert len(whole) > 30
