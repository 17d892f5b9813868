"""Errors that one process hands to another keep all that they say."""

import pickle

import pytest

from coordinator.base.errors import InputError, PartsError, PlanError, SeveralRobotsError, TurnError


@pytest.mark.parametrize(
    "error",
    [
        InputError(["a: is no number", "b: is missing"]),
        PartsError(["R1: too long"], ["R1"]),
        PlanError("has no way", "R1", blames="R2", place=(1.0, 2.0), helps="a smaller radius"),
        TurnError("turns too tightly", 0.4, (1.0, 2.0), "a shorter robot"),
        SeveralRobotsError([PlanError("has no way", "R1"), PlanError("has no way", "R2")]),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_says_the_same_in_another_process(error):
    other = pickle.loads(pickle.dumps(error))
    assert (type(other), str(other), vars(other).keys()) == (
        type(error),
        str(error),
        vars(error).keys(),
    )
    assert "\n".join(map(str, getattr(other, "problems", ()))) in str(other)
