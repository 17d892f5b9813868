import pytest

from protocol.endpoint import check_reach, endpoint_of, usual_endpoint
from protocol.transport import TransportError


@pytest.mark.parametrize(
    ("text", "locked", "host", "loopback"),
    [
        ("tcp/127.0.0.1:7447", False, "127.0.0.1", True),
        ("tcp/127.8.8.8:1", False, "127.8.8.8", True),
        ("tls/localhost:7447", True, "localhost", True),
        ("tls/[::1]:7447", True, "::1", True),
        ("tcp/[::]:7447", False, "::", False),
        ("tcp/0.0.0.0:7447", False, "0.0.0.0", False),
        ("tcp/192.0.2.1:7447", False, "192.0.2.1", False),
        ("tcp/localhost.example:7447", False, "localhost.example", False),
        ("tcp/127.0.0.1.example:7447", False, "127.0.0.1.example", False),
    ],
)
def test_an_endpoint_is_read_and_loopback_is_told_apart(text, locked, host, loopback):
    found = endpoint_of(text, locked)
    assert (found.host, found.is_loopback) == (host, loopback)


@pytest.mark.parametrize(
    ("text", "locked", "said"),
    [
        ("udp/127.0.0.1:1", False, "not an endpoint"),
        ("tcp/127.0.0.1:0", False, "not an endpoint"),
        ("tcp/127.0.0.1:65536", False, "not an endpoint"),
        ("tls/127.0.0.1", True, "tls/HOST:PORT"),
        ("tcp/127.0.0.1:1", True, "with --keys it is tls"),
        ("tls/127.0.0.1:1", False, "needs --keys"),
    ],
)
def test_what_is_no_endpoint_or_of_the_other_kind_is_told(text, locked, said):
    with pytest.raises(TransportError, match=said):
        endpoint_of(text, locked)


@pytest.mark.parametrize("locked", [False, True])
def test_the_usual_endpoint_is_of_its_kind_and_of_this_machine(locked):
    assert endpoint_of(usual_endpoint(locked), locked).is_loopback


def test_the_network_is_listened_to_with_keys_or_when_it_is_asked_for():
    everywhere = endpoint_of("tcp/0.0.0.0:7447")
    with pytest.raises(TransportError, match="--insecure"):
        check_reach(everywhere, locked=False, insecure=False)
    check_reach(everywhere, locked=False, insecure=True)
    check_reach(endpoint_of("tls/0.0.0.0:7447", locked=True), locked=True, insecure=False)
    check_reach(endpoint_of("tcp/127.0.0.1:7447"), locked=False, insecure=False)
