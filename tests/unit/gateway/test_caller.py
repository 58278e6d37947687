import socket

import pytest

from gateway.access.credential import Principal
from gateway.access.role import Role
from gateway.rpc import identity
from gateway.rpc.caller import Caller, Callers


@pytest.mark.parametrize("peer", ["ipv4:127.0.0.1:4711", "ipv6:%5B::1%5D:4711", "unix:", "unix:/run/it.sock"])
def test_a_caller_on_the_robot_is_sent_to_the_loopback_and_may_watch(peer: str) -> None:
    assert Callers(None).of(peer) == Caller(robot_host="127.0.0.1", may_watch=True)


def test_a_remote_caller_is_sent_to_our_address_on_the_way_to_it() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            pytest.skip("this machine has no route out")
        ours = probe.getsockname()[0]
    assert Callers(None).of("ipv4:192.0.2.1:4711") == Caller(robot_host=ours, may_watch=False)


def test_the_configured_address_is_for_everybody() -> None:
    callers = Callers("robot.local")
    assert callers.of("ipv4:192.0.2.1:4711") == Caller(robot_host="robot.local", may_watch=False)
    assert callers.of("ipv4:127.0.0.1:4711") == Caller(robot_host="robot.local", may_watch=True)


def test_a_caller_without_a_route_is_sent_to_the_hosts_name() -> None:
    # 240.0.0.0/4 is routed nowhere; where it is, the answer is an address and as good.
    host = Callers(None).of("ipv4:255.255.255.255:4711").robot_host
    assert host == socket.gethostname() or host.count(".") == 3


def test_who_is_known_may_watch_from_anywhere_and_nobody_else_learns_it() -> None:
    callers = Callers("robot.local")
    remote = "ipv4:192.0.2.1:4711"
    assert not callers.of(remote).may_watch
    identity.begin(Principal("anna", Role.VIEWER, ("a",)))
    try:
        assert callers.of(remote).may_watch
    finally:
        identity.begin(None)
    assert not callers.of(remote).may_watch
