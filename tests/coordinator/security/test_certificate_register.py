import datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.base.errors import InputError
from coordinator.security.certificate_register import (
    FORMAT,
    Issued,
    Register,
    register_of,
    register_to_json,
)

NOW = datetime.datetime(2026, 11, 21, 12, 0, tzinfo=datetime.UTC)
DAY = datetime.timedelta(days=1)
QUICK = settings(derandomize=True, max_examples=100, database=None)


def with_next(register, name, role="robot", days=10):
    generation = register.next_generation(role, name)
    return register.added(Issued(role, name, generation, f"{generation:x}", NOW + days * DAY))


def test_a_revoked_name_counts_again_only_with_its_next_certificate():
    register = with_next(Register(FORMAT, ()), "R1")
    register, hit = register.revoked("robot", "R1", NOW)
    assert [one.generation for one in hit] == [1]
    assert register.valid(NOW) == []
    register = with_next(register, "R1")
    assert [badge.common_name for badge in register.valid(NOW)] == ["robot/R1/2"]


def test_one_certificate_of_a_name_can_be_revoked_alone():
    register = with_next(with_next(Register(FORMAT, ()), "R1"), "R1")
    register, _ = register.revoked("robot", "R1", NOW, 1)
    assert [badge.generation for badge in register.valid(NOW)] == [2]


def test_who_was_revoked_before_keeps_the_time_and_is_not_told_again():
    register, _ = with_next(Register(FORMAT, ()), "R1").revoked("robot", "R1", NOW)
    register, hit = register.revoked("robot", "R1", NOW + DAY)
    assert hit == []
    assert register.issued[0].revoked == NOW


def test_an_expired_certificate_does_not_count_and_is_found_by_its_end():
    register = with_next(with_next(Register(FORMAT, ()), "R1", days=1), "R2", days=5)
    assert [badge.name for badge in register.valid(NOW + 2 * DAY)] == ["R2"]
    assert register.expired_at(NOW + DAY).name == "R1"
    assert register.expired_at(NOW + 3 * DAY) is None
    assert with_next(register, "R3", days=1).expired_at(NOW + DAY) is None


def test_roles_of_the_same_name_have_nothing_to_do_with_each_other():
    register = with_next(with_next(Register(FORMAT, ()), "x"), "x", role="observer")
    register, _ = register.revoked("robot", "x", NOW)
    assert [badge.role for badge in register.valid(NOW)] == ["observer"]


@QUICK
@given(st.lists(st.tuples(st.sampled_from("AB"), st.booleans()), max_size=20))
def test_no_generation_is_ever_used_twice_and_only_unrevoked_ones_count(steps):
    register, expected = Register(FORMAT, ()), set()
    for name, revokes in steps:
        if revokes:
            register, _ = register.revoked("robot", name, NOW)
            expected = {one for one in expected if one[0] != name}
        else:
            expected.add((name, register.next_generation("robot", name)))
            register = with_next(register, name)
    badges = [one.badge for one in register.issued]
    assert len(set(badges)) == len(badges)
    assert {(badge.name, badge.generation) for badge in register.valid(NOW)} == expected
    assert register_of(register_to_json(register), "x") == register


def test_a_number_that_is_there_cannot_be_added_again():
    register = with_next(Register(FORMAT, ()), "R1")
    with pytest.raises(ValueError, match="robot/R1/1"):
        register.added(register.issued[0])


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"{}", b'{"format": "splinefleet.keys/1"}', b'{"issued": []}',
     b'{"issued": 3}', b'{"format": "other/1"}', b"\xff", b"[" * 10_000,
     b'{"issued": [{"role": "king", "name": "R1", "generation": 1, "serial": "1", '
     b'"expires": "2026-01-01T00:00:00Z"}]}',
     b'{"issued": [{"role": "robot", "name": "R1", "generation": 1, "serial": "1", '
     b'"expires": "2026-01-01T00:00:00"}]}',
     *(b'{"issued": [%s]}' % b", ".join(
         b'{"role": "robot", "name": "%s", "generation": %d, "serial": "1", '
         b'"expires": "2026-01-01T00:00:00Z"}' % one for one in issued)
       for issued in ([(b"R1", 1)] * 2, [(b"../R1", 1)], [(b"R1", 0)], [(b"R\\u202e1", 1)]))],
)  # fmt: skip
def test_what_is_no_register_is_told_in_one_line(content):
    with pytest.raises(InputError, match=r"register\.json") as caught:
        register_of(content, "register.json")
    assert len(caught.value.problems) == 1
