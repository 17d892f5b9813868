"""What `splinefleet keys router` writes, as Zenoh itself reads it."""

import json

import pytest
import zenoh
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.keys_commands import keys_commands
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.security.router_file import meeting_fleets
from protocol.transport import TransportError
from protocol.zenoh_transport import _COMMON, _ROUTER
from tests.system.fleet_tools import TWO_ROBOTS

YARD = TWO_ROBOTS.replace('"two"', '"yard"').replace('id = "R1"', 'id = "Y1"').replace("R2", "Y2")


def scenario(text):
    return parse_scenario(text.encode(), "site.toml")


class Site:
    """A folder with the keys of fleets `two` and `yard`, and their scenarios."""

    def __init__(self, folder):
        self.folder, self.keys, self.file = folder, folder / "keys", folder / "router.json5"
        self.scenarios = [folder / "two.toml", folder / "yard.toml"]
        for path, text in zip(self.scenarios, (TWO_ROBOTS, YARD), strict=True):
            path.write_text(text)
        self.ran("init", self.keys)
        self.ran("robot", "R1", "R2", "Y1", "Y2", "R9", "--keys", self.keys)

    def run(self, *arguments):
        return CliRunner().invoke(keys_commands, [str(one) for one in arguments])

    def ran(self, *arguments):
        done = self.run(*arguments)
        assert done.exit_code == 0, done.output or done.exception
        return done

    def router(self, *more, run=None):
        options = ["--keys", self.keys, "-o", self.file]
        return (run or self.ran)("router", *self.scenarios, *options, *more)

    def setting(self, name):
        return json.loads(zenoh.Config.from_file(str(self.file)).get_json(name))

    def subjects(self):
        return {one["id"] for one in self.setting("access_control/subjects")}


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path)


@pytest.mark.parametrize("name", [*_COMMON, *_ROUTER])
def test_zenoh_reads_the_settings_of_a_coordinator_that_routes(site, name):
    site.router("--host", "router.local", "--listen", "tls/10.0.0.7:7448")
    ours = zenoh.Config()
    ours.insert_json5(name, json.dumps((_COMMON | _ROUTER)[name]))
    assert site.setting(name) == json.loads(ours.get_json(name))
    assert site.setting("listen/endpoints") == ["tls/10.0.0.7:7448"]


def test_both_sides_show_certificates_and_the_files_are_named_where_they_lie_or_will(site):
    site.router("--host", "router.local")
    tls = site.setting("transport/link/tls")
    assert (tls["enable_mtls"], tls["close_link_on_expiration"]) == (True, True)
    assert tls["root_ca_certificate"] == str(site.keys / "router/authority.pem")
    assert tls["listen_certificate"] == str(site.keys / "router/certificate.pem")
    assert tls["listen_private_key"] == str(site.keys / "router/private.pem")
    assert tls["connect_private_key"] is None
    site.router("--files", "/etc/splinefleet/router")
    assert (
        site.setting("transport/link/tls/listen_private_key")
        == "/etc/splinefleet/router/private.pem"
    )


def test_who_is_not_of_these_fleets_and_whose_key_was_revoked_is_not_named(site):
    site.router("--host", "router.local")
    everybody = {
        "coordinator/coordinator/1", "robot/R1/1", "robot/R2/1", "robot/Y1/1", "robot/Y2/1",
        "observer/observer/1", "operator/operator/1",
    }  # fmt: skip
    assert site.setting("access_control/enabled") is True
    assert site.setting("access_control/default_permission") == "deny"
    assert site.subjects() == everybody
    told = site.ran("revoke", "R1", "--keys", site.keys).output
    assert "keys router" in told
    site.ran("robot", "R1", "--keys", site.keys)
    site.ran("revoke", "observer/observer", "--keys", site.keys)
    site.router()
    assert site.subjects() == everybody - {"robot/R1/1", "observer/observer/1"} | {"robot/R1/2"}


def test_a_host_makes_the_next_key_and_without_one_it_is_written_without_the_authority(site):
    assert "router router, key 1" in site.router("--host", "router.local").output
    before = (site.keys / "router/certificate.pem").read_bytes()
    (site.keys / "authority/private.pem").unlink()
    assert "key 2" not in site.router().output
    assert (site.keys / "router/certificate.pem").read_bytes() == before
    assert (site.keys / "router/private.pem").stat().st_mode & 0o777 == 0o600


def test_robots_without_a_key_and_a_key_that_ends_soon_are_told(site):
    site.ran("revoke", "Y2", "--keys", site.keys)
    told = site.router("--host", "router.local", "--days", 10).output
    assert "Y2: has no valid key" in told
    assert "expires in" in told


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "--host NAME"),
        (["--listen", "tcp/0.0.0.0:7447", "--host", "a"], "tls/HOST:PORT"),
        (["--keys", "nowhere", "--host", "a"], "keys init nowhere"),
    ],
)
def test_what_does_not_fit_is_told_in_one_line_and_nothing_is_written(site, options, said):
    error = site.router(*options, run=site.run).exception
    assert isinstance(error, InputError | TransportError)
    assert said in str(error)
    assert len(str(error).splitlines()) == 1
    assert not site.file.exists()
    assert not (site.keys / "router").exists()


def test_a_host_that_is_none_is_told_and_nothing_is_written(site):
    done = site.router("--host", "a b", run=site.run)
    assert done.exit_code == 2
    assert "neither a name nor an address" in done.output
    assert not site.file.exists()
    assert not (site.keys / "router").exists()


def test_a_robots_name_is_in_one_fleet_of_a_router_and_all_that_are_not_are_told():
    with pytest.raises(InputError) as caught:
        meeting_fleets([scenario(TWO_ROBOTS), scenario(TWO_ROBOTS.replace('"two"', '"yard"'))])
    assert [problem.split(":")[0] for problem in caught.value.problems] == ["R1", "R2"]


def test_scenarios_of_one_name_are_of_one_fleet():
    evening = TWO_ROBOTS.replace("R2", "R3")
    assert meeting_fleets([scenario(TWO_ROBOTS), scenario(evening), scenario(YARD)]) == {
        "two": ["R1", "R2", "R3"],
        "yard": ["Y1", "Y2"],
    }


def test_the_head_of_the_file_names_its_fleets(site):
    site.router("--host", "router.local")
    assert "for the fleets two, yard." in site.file.read_text().splitlines()[0]


def test_a_robot_that_may_join_has_its_own_rights_in_every_fleet_and_one_of_a_scenario_in_its(site):
    site.ran("robot", "R8", "Y1", "--may-join", "--keys", site.keys)
    site.router("--host", "localhost")
    rules = {one["id"]: one["key_exprs"] for one in site.setting("access_control/rules")}
    assert rules["robot/R8/1 puts"] == [
        f"splinefleet/{fleet}/{kind}/R8"
        for fleet in ("two", "yard")
        for kind in ("hello", "report", "clock")
    ]
    assert not any("/two/" in key for key in rules["robot/Y1/2 puts"])
    assert "splinefleet/two/admit/R8" in rules["operator/operator/1 puts"]
    assert not any(name.startswith("robot/R9") for name in rules)
