"""The campaign of operators and faults: runs end well, and those of a damaged product do not."""

import pytest

from benchmarks.operator_campaign import run_seed, shrunk
from coordinator.fleet.authority_ends import AuthorityEnds


def test_two_seeds_end_without_a_touch_and_their_logs_are_proven():
    for seed in (206, 215):
        result = run_seed(seed, prove_each=1)
        assert result.problems == ()
        assert result.acts > 20
        assert result.script == ()


@pytest.mark.parametrize("seed", [116, 200])
def test_logs_were_judged_wrong_whose_robots_were_started_again_or_never_sent_a_course(seed):
    """A program that was not admitted spoke in a resumed log; a course was withdrawn unsent."""
    assert run_seed(seed, prove_each=1).problems == ()


def test_a_fleet_that_lets_robots_drive_on_which_were_given_up_is_found(monkeypatch):
    monkeypatch.setattr(AuthorityEnds, "_bound", lambda *_: None)
    results = (run_seed(seed, prove_each=1) for seed in (205, 200, 203))
    found = next(one for one in results if one.problems)
    assert any("which others go around" in problem for problem in found.problems)
    assert len(found.script) == found.acts > 30


def test_of_many_acts_those_that_are_needed_together_are_left():
    acts = [(float(time), None) for time in range(20)]
    needed = {acts[3], acts[11], acts[19]}
    assert set(shrunk(acts, lambda some: needed <= set(some))) == needed
