"""Shrinking keeps what fails and nothing else, by its own account of failing."""

from hypothesis import given
from hypothesis import strategies as st

from sim.campaigns.shrink import shrink
from sim.world.fault_text import Fault

FAULTS = st.lists(
    st.builds(
        Fault,
        st.sampled_from(["kill", "stall", "cut"]),
        st.sampled_from(["R1", "R2"]),
        st.floats(0.0, 30.0).map(lambda time: round(time, 2)),
        st.floats(0.1, 5.0).map(lambda value: round(value, 2)),
    ),
    max_size=5,
)


def test_of_four_faults_the_one_that_fails_is_left_with_round_numbers():
    guilty = Fault("stall", "R2", 8.37, 2.64)
    others = [Fault("kill", "R1", time) for time in (1.0, 2.0, 9.0)]
    shrunk = shrink(
        [*others, guilty], lambda faults: any(fault.kind == "stall" for fault in faults)
    )
    assert shrunk == [Fault("stall", "R2", 8.0, 3.0)]


def test_numbers_stay_sharp_where_rounding_ends_the_failure():
    def fails(faults: list[Fault]) -> bool:
        return any(8.3 < fault.time < 8.45 for fault in faults)

    assert shrink([Fault("kill", "R1", 8.37)], fails) == [Fault("kill", "R1", 8.4)]


def test_a_failure_that_needs_no_fault_is_left_with_none():
    assert shrink([Fault("kill", "R1", 1.0), Fault("cut", "R2", 2.0, 3.0)], lambda _: True) == []


@given(FAULTS, st.sampled_from(["kill", "stall", "cut"]), st.integers(1, 3))
def test_what_is_left_still_fails_and_no_fault_can_be_left_out(faults, kind, count):
    def fails(some: list[Fault]) -> bool:
        return sum(fault.kind == kind for fault in some) >= count

    if not fails(faults):
        return
    shrunk = shrink(faults, fails)
    assert fails(shrunk)
    assert all(not fails(shrunk[:i] + shrunk[i + 1 :]) for i in range(len(shrunk)))
