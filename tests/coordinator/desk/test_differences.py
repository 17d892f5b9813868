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
    assert told == ["[", list(range(drop)), {}, [[len(new) - 1, new[-1]]]]


@given(st.lists(st.integers(0, 99), unique=True, max_size=30), st.data())
def test_items_that_go_and_come_anywhere_leave_the_others_untold(numbers, data):
    old = [{"n": n, "long": "x" * 200} for n in numbers]
    goes = data.draw(st.sets(st.sampled_from(numbers))) if numbers else set()
    new = [item for item in old if item["n"] not in goes]
    at = data.draw(st.integers(0, len(new)))
    new.insert(at, {"n": 100, "long": "y"})
    told = difference(old, new)
    assert changed(old, told) == new
    if len(goes) < len(old):
        assert "xxx" not in json.dumps(told)


def test_nothing_new_is_nothing_and_only_what_is_new_is_told():
    assert difference([1, 2], [1, 2]) is None
    assert difference({"a": {"b": 1, "c": [1]}}, {"a": {"b": 2, "c": [1]}}) == [
        "{",
        {"a": ["{", {"b": ["=", 2]}, []]},
        [],
    ]
