import socket

import pytest

from gateway.access.credential import Principal
from gateway.access.role import Role
from gateway.rpc.calls.recipient import Recipient, Recipients
from tests.support.calls import call_of


@pytest.mark.parametrize("peer", ["ipv4:127.0.0.1:4711", "ipv6:%5B::1%5D:4711", "unix:", "unix:/run/it.sock"])
def test_a_caller_on_the_robot_is_sent_to_the_loopback_and_sees_passphrase(peer: str) -> None:
    assert Recipients(None).of(call_of(peer=peer)) == Recipient(robot_host="127.0.0.1", sees_passphrase=True)


def test_a_remote_caller_is_sent_to_our_address_on_the_way_to_it() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            pytest.skip("this machine has no route out")
        ours = probe.getsockname()[0]
    found = Recipients(None).of(call_of(peer="ipv4:192.0.2.1:4711"))
    assert found == Recipient(robot_host=ours, sees_passphrase=False)


def test_the_configured_address_is_for_all() -> None:
    callers = Recipients("robot.local")
    found = callers.of(call_of(peer="ipv4:192.0.2.1:4711"))
    assert found == Recipient(robot_host="robot.local", sees_passphrase=False)
    found = callers.of(call_of(peer="ipv4:127.0.0.1:4711"))
    assert found == Recipient(robot_host="robot.local", sees_passphrase=True)


def test_a_caller_without_a_route_is_sent_to_the_hosts_name() -> None:
    # 240.0.0.0/4 is routed nowhere; where it is, the answer is an address and as good.
    host = Recipients(None).of(call_of(peer="ipv4:255.255.255.255:4711")).robot_host
    assert host == socket.gethostname() or host.count(".") == 3


def test_an_authenticated_caller_sees_the_passphrase_from_anywhere_and_no_other_does() -> None:
    callers = Recipients("robot.local")
    remote, known = call_of(peer="ipv4:192.0.2.1:4711"), call_of(peer="ipv4:192.0.2.1:4711")
    known.principal = Principal("anna", Role.VIEWER, ("a",))
    assert not callers.of(remote).sees_passphrase
    assert callers.of(known).sees_passphrase
    assert not callers.of(remote).sees_passphrase
