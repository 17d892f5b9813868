"""Results that are kept with an object."""

import gc
import weakref

from coordinator.base.kept import kept


class Owner:
    def __init__(self, name):
        self.name = name


def test_a_result_is_found_once_per_object_and_arguments_and_goes_with_the_object():
    calls = []

    @kept
    def found(owner, *others):
        calls.append(others)
        return [owner.name, *others]

    owner, other = Owner("a"), Owner("b")
    assert found(owner, 1) is found(owner, 1)
    assert found(owner, 2) == ["a", 2]
    assert found(other, 1) == ["b", 1]
    assert calls == [(1,), (2,), (1,)]
    gone = weakref.ref(owner)
    del owner
    gc.collect()
    assert gone() is None
