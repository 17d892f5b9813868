"""Who may say and hear what, decided by an oracle of its own over all keys of a small fleet."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import keys
from protocol.access import access_control, player_rights, rights_of, router_rights
from protocol.badge import ROLES, Badge, badge_of

QUICK = settings(derandomize=True, max_examples=100, database=None)
NAMES = st.from_regex(keys.NAME, fullmatch=True)

FLEET, ROBOTS = "hall", ("R1", "R2")
KINDS = (keys.hello, keys.plan, keys.report, keys.clock, keys.admit, keys.alive)
ALL_KEYS = [
    kind(fleet, robot)
    for kind, fleet, robot in itertools.product(KINDS, (FLEET, "other"), ("R1", "R2", "R3"))
] + [keys.command(FLEET), keys.command("other"), "splinefleet", "else/where", "splinefleet/hall"]

ROBOT, OBSERVER, OPERATOR = (
    Badge("robot", "R1", 2),
    Badge("observer", "o", 1),
    Badge("operator", "p", 1),
)


def matches(expression, key):
    """Tell whether a key lies within an expression of `*` and a last `**`, part by part."""
    wanted, parts = expression.split("/"), key.split("/")
    if wanted[-1] == "**":
        return parts[: len(wanted) - 1] == wanted[:-1]
    return len(wanted) == len(parts) and all(
        w in ("*", p) for w, p in zip(wanted, parts, strict=True)
    )


def allowed(config, badge, flow, message):
    """Return all keys that Zenoh would let pass, read from its configuration."""
    own = [policy for policy in config["policies"] if badge.common_name in policy["subjects"]]
    named = {name for policy in own for name in policy["rules"]}
    expressions = [
        expression
        for rule in config["rules"]
        if rule["id"] in named and flow in rule["flows"] and message in rule["messages"]
        for expression in rule["key_exprs"]
    ]
    return {key for key in ALL_KEYS if any(matches(one, key) for one in expressions)}


@pytest.fixture(scope="module")
def config():
    badges = [ROBOT, Badge("robot", "R2", 1), OBSERVER, OPERATOR]
    return access_control((badge, rights_of(FLEET, ROBOTS, badge)) for badge in badges)


def test_a_robot_says_its_own_hello_report_and_clock_and_is_alive_as_itself(config):
    own = {kind(FLEET, "R1") for kind in (keys.hello, keys.report, keys.clock)}
    assert allowed(config, ROBOT, "ingress", "put") == own
    assert allowed(config, ROBOT, "ingress", "liveliness_token") == {keys.alive(FLEET, "R1")}


def test_a_robot_is_given_its_own_plan_and_clock_and_the_command(config):
    own = {keys.plan(FLEET, "R1"), keys.clock(FLEET, "R1"), keys.command(FLEET)}
    assert allowed(config, ROBOT, "egress", "put") == own
    asked = allowed(config, ROBOT, "ingress", "declare_subscriber")
    assert asked - own == {keys.command("other")}


def test_an_observer_is_given_all_of_its_fleet_and_says_nothing(config):
    of_fleet = {
        key for key in ALL_KEYS if key == "splinefleet/hall" or key.startswith("splinefleet/hall/")
    }
    assert allowed(config, OBSERVER, "egress", "put") == of_fleet
    for message in ("put", "delete", "liveliness_token", "reply", "declare_queryable"):
        assert allowed(config, OBSERVER, "ingress", message) == set()


def test_observers_and_operators_may_ask_for_plans_and_no_robot_may_ask_or_answer(config):
    plans = {key for key in ALL_KEYS if key.startswith("splinefleet/hall/plan/")}
    for listener in (OBSERVER, OPERATOR):
        assert allowed(config, listener, "ingress", "query") == plans
        assert allowed(config, listener, "egress", "reply") == plans
    for other in (ROBOT,):
        assert allowed(config, other, "ingress", "query") == set()
        assert allowed(config, other, "egress", "reply") == set()
        assert allowed(config, other, "ingress", "reply") == set()


def test_an_operator_hears_all_and_says_admit_alone(config):
    said = {keys.admit(FLEET, robot) for robot in ROBOTS}
    assert allowed(config, OPERATOR, "ingress", "put") == said
    heard = allowed(config, OBSERVER, "egress", "put")
    assert allowed(config, OPERATOR, "egress", "put") == heard >= {keys.report(FLEET, "R1")}


def test_what_is_not_allowed_is_denied_and_a_policy_names_its_holder(config):
    assert config["enabled"]
    assert config["default_permission"] == "deny"
    assert {rule["permission"] for rule in config["rules"]} == {"allow"}
    for subject in config["subjects"]:
        assert subject["cert_common_names"] == [subject["id"]]
    assert {rule["id"] for rule in config["rules"]} == {
        name for policy in config["policies"] for name in policy["rules"]
    }
    assert all(rule["key_exprs"] for rule in config["rules"])


def test_a_robot_that_is_not_in_the_scenario_and_a_coordinator_have_no_rights():
    assert rights_of(FLEET, ROBOTS, Badge("robot", "R3", 1)) is None
    assert rights_of(FLEET, ROBOTS, Badge("coordinator", "R1", 1)) is None


COORDINATOR = Badge("coordinator", "coordinator", 1)
FAR = Badge("robot", "R3", 1)


@pytest.fixture(scope="module")
def at_router():
    fleets = {FLEET: ROBOTS, "other": ("R3",)}
    badges = [COORDINATOR, ROBOT, Badge("robot", "R2", 1), FAR, OBSERVER, OPERATOR]
    return access_control((badge, router_rights(fleets, badge)) for badge in badges)


def of_both(*kinds):
    return {
        kind(fleet, robot)
        for kind, fleet, robot in itertools.product(kinds, (FLEET, "other"), ("R1", "R2", "R3"))
    }


def test_at_a_router_a_coordinator_commands_plans_and_answers_and_poses_as_no_robot(at_router):
    commands = {keys.command(FLEET), keys.command("other")}
    said = of_both(keys.plan, keys.clock) | commands
    given = of_both(keys.hello, keys.report, keys.clock, keys.admit) | commands
    assert allowed(at_router, COORDINATOR, "ingress", "put") == said
    assert allowed(at_router, COORDINATOR, "egress", "put") == given
    assert allowed(at_router, COORDINATOR, "ingress", "declare_subscriber") == given
    assert allowed(at_router, COORDINATOR, "egress", "liveliness_token") == of_both(keys.alive)
    assert allowed(at_router, COORDINATOR, "ingress", "liveliness_token") == set()
    for flow, message in (
        ("ingress", "declare_queryable"),
        ("egress", "query"),
        ("ingress", "reply"),
    ):
        assert allowed(at_router, COORDINATOR, flow, message) == of_both(keys.plan)


def test_at_a_router_a_robot_may_what_it_may_at_a_coordinator_of_its_own_and_no_more(
    at_router, config
):
    flows = itertools.product(
        ("ingress", "egress"),
        ("put", "delete", "declare_subscriber", "liveliness_token", "query", "reply"),
    )
    for flow, message in flows:
        there = allowed(at_router, ROBOT, flow, message)
        assert there == allowed(config, ROBOT, flow, message)
        if flow == "egress" or message != "declare_subscriber":
            assert not any(key.startswith("splinefleet/other/") for key in there)
    assert allowed(at_router, FAR, "ingress", "put") == {
        kind("other", "R3") for kind in (keys.hello, keys.report, keys.clock)
    }
    assert allowed(at_router, FAR, "egress", "put") == {
        keys.plan("other", "R3"),
        keys.clock("other", "R3"),
        keys.command("other"),
    }


def test_at_a_router_observers_and_operators_are_those_of_all_its_fleets(at_router):
    assert allowed(at_router, OBSERVER, "ingress", "put") == set()
    assert of_both(*KINDS) <= allowed(at_router, OBSERVER, "egress", "put")
    admits = {keys.admit(FLEET, robot) for robot in ROBOTS} | {keys.admit("other", "R3")}
    assert allowed(at_router, OPERATOR, "ingress", "put") == admits


def test_at_a_router_a_robot_of_none_of_its_fleets_and_another_router_have_no_rights():
    assert router_rights({FLEET: ROBOTS}, FAR) is None
    assert router_rights({FLEET: ROBOTS}, Badge("router", "router", 1)) is None
    assert router_rights({}, COORDINATOR) is None


def test_where_a_log_is_played_only_observers_hear():
    assert player_rights(ROBOT) is None
    assert player_rights(OPERATOR) is None
    rights = player_rights(OBSERVER)
    assert (rights.hears, rights.puts, rights.alive) == (("**",), (), ())


def test_nobody_gets_no_policy_since_an_empty_list_of_names_would_be_everybody():
    config = access_control(())
    assert config["subjects"] == config["policies"] == config["rules"] == []
    assert config["default_permission"] == "deny"


@QUICK
@given(NAMES, NAMES, st.integers(1, 999_999_999))
def test_a_common_name_tells_role_name_and_generation_and_no_pattern(fleet, name, generation):
    for role in ROLES:
        badge = Badge(role, name, generation)
        assert badge_of(badge.common_name) == badge
        assert len(badge.common_name) <= 64
        config = access_control(
            [(badge, rights_of(fleet, [name], badge))] if role == "robot" else []
        )
        for rule in config["rules"]:
            for expression in rule["key_exprs"]:
                assert "$" not in expression
                assert expression.count("*") == (expression == keys.command("*"))


@QUICK
@given(st.text(max_size=60))
def test_no_other_text_is_a_common_name(text):
    badge = badge_of(text)
    assert badge is None or badge.common_name == text


@pytest.mark.parametrize(
    "text",
    ["", "R1", "robot/R1", "robot/R1/0", "robot/R1/01", "robot/R1/-1", "robot/*/1", "king/R1/1",
     "robot/R1/1/2", "robot/R1/1\n", "robot//1", "ROBOT/R1/1", "robot/R1/9999999999"],
)  # fmt: skip
def test_what_only_looks_like_a_common_name_is_none(text):
    assert badge_of(text) is None
