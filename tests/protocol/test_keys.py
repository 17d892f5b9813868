import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import keys

NAMES = st.from_regex(keys.NAME, fullmatch=True)
QUICK = settings(derandomize=True, max_examples=100, database=None)


@QUICK
@given(NAMES, NAMES, st.sampled_from(["hello", "plan", "report", "clock", "alive"]))
def test_a_robots_key_splits_into_what_it_was_made_of(fleet, robot, kind):
    key = getattr(keys, kind)(fleet, robot)
    assert key == f"splinefleet/{fleet}/{kind}/{robot}"
    assert keys.split(key) == (fleet, kind, robot)


@QUICK
@given(NAMES)
def test_the_command_key_has_no_robot(fleet):
    assert keys.command(fleet) == f"splinefleet/{fleet}/command"
    assert keys.split(keys.command(fleet)) == (fleet, "command", "")


@pytest.mark.parametrize(
    "key",
    [
        "",
        "/",
        "splinefleet",
        "splinefleet/f",
        "splinefleet/f/hello",
        "splinefleet/f/command/R1",
        "splinefleet/f/hello/R1/more",
        "splinefleet/f/position/R1",
        "splinefleet//hello/R1",
        "splinefleet/f/hello/",
        "other/f/hello/R1",
        "/splinefleet/f/hello/R1",
        "splinefleet/f/hello/*",
        "splinefleet/*/command",
        "splinefleet/f/hello/R 1",
        "splinefleet/f/hello/R1\n",
        "splinefleet/f/hello/Röbi",
        "splinefleet/f/hello/" + 33 * "R",
    ],
)
def test_a_key_that_is_not_ours_is_refused(key):
    assert keys.split(key) is None


@QUICK
@given(st.text(max_size=60))
def test_no_text_makes_split_raise(text):
    assert keys.split(text) is None
    keys.split(f"splinefleet/{text}")
