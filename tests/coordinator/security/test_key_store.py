"""The folder of keys on a disk: what lies where, who may read it, what is told of bad ones."""

import datetime
import os
import shutil
import stat

import pytest

from coordinator.base.errors import InputError
from coordinator.security.key_store import KeyStore
from coordinator.security.link_admission import Gate, player_access
from protocol.badge import Badge
from protocol.key_files import read_key_files
from protocol.transport import TransportError

NOW = datetime.datetime.now(datetime.UTC)
DAY = datetime.timedelta(days=1)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    store = KeyStore(tmp_path_factory.mktemp("keys") / "keys")
    before = os.umask(0)
    try:
        store.begin(NOW - 5 * DAY)
        store.issue("coordinator", ["coordinator"], NOW, 365, ["hall.local"])
        store.issue("robot", ["R1", "R2"], NOW, 365)
        store.issue("observer", ["observer", "office"], NOW, 365)
    finally:
        os.umask(before)
    return store


@pytest.fixture
def store(made, tmp_path):
    shutil.copytree(made.folder, tmp_path / "keys")
    return KeyStore(tmp_path / "keys")


def test_folders_and_files_are_their_owners_alone_whatever_the_umask(made):
    for place in [made.folder, *made.folder.rglob("*")]:
        mode = stat.S_IMODE(place.stat().st_mode)
        assert mode == (0o700 if place.is_dir() else 0o600), place
    assert not list(made.folder.rglob(".*"))


def test_a_robot_needs_its_own_folder_and_nothing_else(store, tmp_path):
    alone = tmp_path / "alone"
    shutil.copytree(store.folder / "robot/R1", alone)
    shutil.rmtree(store.folder)
    assert sorted(os.listdir(alone)) == ["authority.pem", "certificate.pem", "private.pem"]
    files = read_key_files(alone, "robot", "R1")
    assert files.badge == Badge("robot", "R1", 1)
    assert files.warning(NOW) == ""
    assert b"PRIVATE" not in files.authority.read_bytes()


def test_a_name_that_gets_another_key_has_its_files_replaced(store):
    before = read_key_files(store.folder, "robot", "R1").private.read_bytes()
    (one,) = store.issue("robot", ["R1"], NOW, 365)
    files = read_key_files(store.folder, "robot", "R1")
    assert files.badge == one.badge == Badge("robot", "R1", 2)
    assert files.private.read_bytes() != before


def test_who_expires_soon_is_warned_and_who_has_expired_is_refused(store):
    files = read_key_files(store.folder, "robot", "R1")
    assert "expires in 9 days" in files.warning(files.expires - 9.5 * DAY)
    with pytest.raises(TransportError, match="expired on"):
        read_key_files(store.folder, "robot", "R1", files.expires + DAY)
    with pytest.raises(TransportError, match="not valid before"):
        read_key_files(store.folder, "robot", "R1", NOW - 2 * DAY)


def test_any_name_will_do_in_ones_own_folder_when_none_is_asked_for(store):
    assert read_key_files(store.folder, "observer").badge.name == "observer"
    assert read_key_files(store.folder / "observer/office", "observer").badge.name == "office"
    with pytest.raises(TransportError, match="that of robot R1, not that of observer"):
        read_key_files(store.folder / "robot/R1", "observer")


def spoil_mode(own):
    (own / "private.pem").chmod(0o640)


def spoil_key(own):
    shutil.copy(own.parent / "R2/private.pem", own / "private.pem")


def spoil_name(own):
    for name in ("private.pem", "certificate.pem"):
        shutil.copy(own.parent / "R2" / name, own / name)


def spoil_authority(own):
    KeyStore(own / "other").begin(NOW)
    shutil.copy(own / "other/authority/certificate.pem", own / "authority.pem")


def spoil_bytes(own):
    (own / "certificate.pem").write_bytes(b"-----BEGIN CERTIFICATE-----\n\xff")


def spoil_swap(own):
    shutil.copy(own / "certificate.pem", own / "private.pem")


def spoil_gone(own):
    (own / "certificate.pem").unlink()


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (spoil_mode, "others may read it"),
        (spoil_key, "does not belong to"),
        (spoil_name, "that of robot R2, not that of robot R1"),
        (spoil_authority, "was not signed by"),
        (spoil_bytes, "cannot be read"),
        (spoil_swap, "does not belong to"),
        (spoil_gone, "No such file"),
        (shutil.rmtree, r"there is no folder .*R1; splinefleet keys robot R1 makes it"),
    ],
)
def test_files_that_are_not_fit_are_told_in_one_line(store, spoil, said):
    spoil(store.folder / "robot/R1")
    with pytest.raises(TransportError, match=said) as caught:
        read_key_files(store.folder, "robot", "R1")
    assert len(str(caught.value).splitlines()) == 1


def test_without_the_authority_nothing_can_be_made_but_all_can_be_revoked(store):
    (store.folder / "authority/private.pem").unlink()
    with pytest.raises(InputError, match="cannot be made without it"):
        store.issue("robot", ["R3"], NOW, 365)
    assert [one.name for one in store.revoke("robot", "R1", NOW)] == ["R1"]


def test_an_authority_is_never_replaced_by_another(store):
    before = (store.folder / "authority/private.pem").read_bytes()
    with pytest.raises(InputError, match="already"):
        store.begin(NOW)
    assert (store.folder / "authority/private.pem").read_bytes() == before


def test_keys_of_a_coordinator_that_has_lost_its_register_are_not_made_useless(store):
    shutil.rmtree(store.folder / "authority")
    (store.folder / "register.json").unlink()
    with pytest.raises(InputError, match="restore it from a copy"):
        store.register()
    with pytest.raises(InputError, match="already"):
        store.begin(NOW)


@pytest.mark.parametrize("place", ["coordinator", "robot/R1"])
def test_a_partys_own_folder_is_not_taken_for_a_fleets(store, place):
    own = KeyStore(store.folder / place)
    with pytest.raises(InputError, match="single party; name the fleet's folder"):
        Gate(own.folder, "hall", ["R1"])
    with pytest.raises(InputError, match="has the keys of a single party; name another folder"):
        own.begin(NOW)
    assert not (own.folder / "authority").exists()


def test_damaged_authority_is_told_in_one_line(store):
    (store.folder / "authority/private.pem").write_bytes(b"nothing")
    with pytest.raises(InputError, match="damaged") as caught:
        store.issue("robot", ["R3"], NOW, 365)
    assert len(caught.value.problems) == 1


def test_the_gate_lets_in_whose_key_counts_and_warns_of_robots_without(store):
    store.revoke("robot", "R1", NOW)
    gate = Gate(store.folder, "hall", ["R1", "R2", "R3"])
    subjects = {subject["id"] for subject in gate._access["subjects"]}
    assert subjects == {"robot/R2/1", "observer/observer/1", "observer/office/1"}
    assert [warning.split(":")[0] for warning in gate.warnings] == ["R1", "R3"]
    subjects = {subject["id"] for subject in player_access(store.folder)["subjects"]}
    assert subjects == {"observer/observer/1", "observer/office/1"}


@pytest.mark.parametrize(("name", "own"), [("register.json", 0o600), ("", 0o700)])
def test_a_register_that_others_may_write_or_replace_is_told(store, name, own):
    place = store.folder / name
    place.chmod(own | 0o022)
    told = f"{place}: other users may write it and undo a revocation; chmod go-w {place}"
    assert told in Gate(store.folder, "hall", ["R1"]).warnings
    place.chmod(own)
    assert Gate(store.folder, "hall", ["R1"]).warnings == []


def test_a_pipe_in_the_place_of_a_key_is_told(store):
    place = store.folder / "robot" / "R1" / "certificate.pem"
    place.unlink()
    os.mkfifo(place)
    with pytest.raises(TransportError, match="is a pipe, not a file"):
        read_key_files(store.folder, "robot", "R1")


@pytest.mark.parametrize("name", ["register.json", "authority/private.pem"])
def test_a_pipe_in_the_place_of_the_authoritys_files_is_told(store, name):
    place = store.folder / name
    place.unlink()
    os.mkfifo(place)
    with pytest.raises(InputError, match=f"{place}: is a pipe, not a file"):
        store.issue("robot", ["R9"], NOW, 365)


def test_a_number_that_a_register_from_a_copy_has_forgotten_is_not_given_again(store):
    copy = (store.folder / "register.json").read_bytes()
    store.issue("robot", ["R1"], NOW, 365)
    store.revoke("robot", "R1", NOW)
    (store.folder / "register.json").write_bytes(copy)
    (one,) = store.issue("robot", ["R1"], NOW, 365)
    assert one.badge == Badge("robot", "R1", 3)


@pytest.mark.parametrize("file", ["private.pem", "certificate.pem"])
def test_an_authority_of_two_halves_makes_no_keys(store, tmp_path, file):
    other = KeyStore(tmp_path / "other")
    other.begin(NOW)
    before = read_key_files(store.folder, "robot", "R1").private.read_bytes()
    shutil.copy(other.folder / "authority" / file, store.folder / "authority" / file)
    with pytest.raises(InputError, match="the private key is not that of the certificate"):
        store.issue("robot", ["R1"], NOW, 365)
    assert read_key_files(store.folder, "robot", "R1").private.read_bytes() == before


def test_a_partys_key_is_no_authority(store):
    for file in ("private.pem", "certificate.pem"):
        shutil.copy(store.folder / "robot/R1" / file, store.folder / "authority" / file)
    with pytest.raises(InputError, match="the certificate is not that of an authority"):
        store.issue("robot", ["R1"], NOW, 365)


def test_a_file_in_the_place_of_a_folder_and_a_key_that_is_not_made_are_told(store, tmp_path):
    file = tmp_path / "hall.toml"
    file.touch()
    for act in (lambda: KeyStore(file).begin(NOW), KeyStore(file).register):
        with pytest.raises(InputError, match="is not a folder"):
            act()
    with pytest.raises(TransportError, match=r"there is no folder .*R9; splinefleet keys robot R9"):
        read_key_files(store.folder, "robot", "R9")
