"""Differences between values of JSON: they make the one of the other, and are small."""

import json

from hypothesis import given
from hypothesis import strategies as st

from coordinator.desk.differences import difference
from tests.oracle_differences import changed

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(2, 5) | st.sampled_from(["a", "b"]),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.sampled_from("abc"), inner),
    max_leaves=20,
)


@given(VALUES, VALUES)
def test_a_difference_makes_the_new_value_of_the_old_one(old, new):
    told = json.loads(json.dumps(difference(old, new)))
    before = json.dumps(old)
    got = changed(old, told)
    assert json.dumps(got, sort_keys=True) == json.dumps(new, sort_keys=True)
    assert json.dumps(old) == before


@given(st.lists(st.lists(st.integers(), min_size=1), min_size=3, unique_by=tuple), st.data())
def test_a_list_that_moves_on_tells_what_left_and_what_came(items, data):
    drop = data.draw(st.integers(0, len(items) - 2))
    new = [*items[drop:], [10**9, 1, 2, 3, 4, 5, 6, 7]]
    told = difference(items, new)
    assert changed(items, told) == new
    assert told == ["[", drop, {}, new[-1:]]


def test_nothing_new_is_nothing_and_only_what_is_new_is_told():
    assert difference([1, 2], [1, 2]) is None
    assert difference({"a": {"b": 1, "c": [1]}}, {"a": {"b": 2, "c": [1]}}) == [
        "{",
        {"a": ["{", {"b": ["=", 2]}, []]},
        [],
    ]
