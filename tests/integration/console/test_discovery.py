"""Gateways found by mDNS, on this machine's loopback interface alone: real ones, false ones, floods."""

import json
import socket
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from zeroconf import ServiceInfo, Zeroconf
from zeroconf import const as dns
from zeroconf._dns import DNSPointer
from zeroconf._protocol.outgoing import DNSOutgoing

from common.advertisement import SERVICE_TYPE
from console.robots.discovery import MOST_CHANGES, MOST_ROBOTS, Discovery
from tests.support.free import free_tcp_port
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.gateway_program import gateway_program
from tests.support.guarded_program import guarded_program
from tests.support.robotctl import only_line, robotctl, robotctl_process
from tests.support.robotctl_docs import documented, holds
from tests.support.waiting import wait_until

LOOPBACK = "127.0.0.1"
ANNOUNCED_WITHIN_S = 60.0
"""On a machine that does other things as well; unloaded it takes 2 s."""
LOOPBACK_ONLY = {"advertise": True, "addresses": [LOOPBACK]}


@pytest.fixture
def attacker() -> Iterator[Zeroconf]:
    zeroconf = Zeroconf(interfaces=[LOOPBACK])
    yield zeroconf
    zeroconf.close()


def announcement(label: str, address: str = LOOPBACK, port: int = 50051, **properties: bytes) -> ServiceInfo:
    return ServiceInfo(
        SERVICE_TYPE,
        f"{label}.{SERVICE_TYPE}",
        port=port,
        properties=dict(properties),
        server=f"{label}.local.",
        parsed_addresses=[address],
    )


def announce(zeroconf: Zeroconf, *announced: ServiceInfo) -> None:
    """Announces them at the same time: each takes seconds, so that others may claim its name."""
    with ThreadPoolExecutor(len(announced)) as threads:
        deque(threads.map(zeroconf.register_service, announced), maxlen=0)


def targets(discovery: Discovery) -> set[str]:
    return {each.target for each in discovery.robots}


def test_a_gateway_is_found_from_its_start_to_its_end(tmp_path: Path) -> None:
    with Discovery([LOOPBACK]) as discovery:
        with gateway_program(tmp_path, name="lab 1 ü", sources=[], discovery=LOOPBACK_ONLY) as gateway:
            target = f"{LOOPBACK}:{gateway.port}"
            wait_until(lambda: target in targets(discovery), "it is found", ANNOUNCED_WITHIN_S)
            (robot,) = [each for each in discovery.robots if each.target == target]
            assert (robot.name, robot.tls, robot.contract) == ("lab 1 ü", False, "omniseer.gateway.v1")
            known = robotctl_process("robots", "add", "lab1", target, XDG_CONFIG_HOME=str(tmp_path))
            assert known.returncode == 0

            # A search of robotctl lasts a moment, in which an answer may be late.
            def listed() -> dict[str, Any] | None:
                ended = robotctl("robots", "discover", "--json", XDG_CONFIG_HOME=str(tmp_path))
                document: dict[str, Any] = json.loads(ended.stdout)
                return document if target in {each["target"] for each in document["robots"]} else None

            document = wait_until(listed, "a search finds it", ANNOUNCED_WITHIN_S)
            holds(documented("robots discover --json"), document, complete=True)
            (found,) = [each for each in document["robots"] if each["target"] == target]
            assert found["known_as"] == "lab1"
            wait_until(
                lambda: f"robotctl robots add lab-1 {target}" in robotctl("robots", "discover").stdout,
                "how it becomes known",
                ANNOUNCED_WITHIN_S,
            )

            def doctor_of_nowhere() -> str:
                nowhere = robotctl("doctor", "--target", f"{LOOPBACK}:{free_tcp_port()}")
                assert nowhere.returncode == 3
                return nowhere.stdout

            wait_until(
                lambda: f"lab 1 ü at {target}" in doctor_of_nowhere(), "the doctor's", ANNOUNCED_WITHIN_S
            )
        wait_until(lambda: target not in targets(discovery), "it has said goodbye", ANNOUNCED_WITHIN_S)


def test_a_guarded_gateway_is_found_with_the_login_that_it_needs(tmp_path: Path) -> None:
    with (
        Discovery([LOOPBACK]) as discovery,
        guarded_program(tmp_path, tmp_path, discovery=LOOPBACK_ONLY) as gateway,
    ):
        wait_until(lambda: gateway.target in targets(discovery), "it is found", ANNOUNCED_WITHIN_S)
        (robot,) = [each for each in discovery.robots if each.target == gateway.target]
        assert robot.tls
        wait_until(
            lambda: f"robotctl login lab-1 {gateway.target} FILE" in robotctl("robots", "discover").stdout,
            "what to type",
            ANNOUNCED_WITHIN_S,
        )


def test_a_gateway_announces_itself_only_where_that_is_configured(tmp_path: Path) -> None:
    with Discovery([LOOPBACK]) as discovery, gateway_program(tmp_path, sources=[]) as gateway:
        announced = tmp_path / "announced"
        announced.mkdir()
        with gateway_program(announced, sources=[], discovery=LOOPBACK_ONLY) as other:
            wait_until(
                lambda: f"{LOOPBACK}:{other.port}" in targets(discovery), "the other", ANNOUNCED_WITHIN_S
            )
            assert f"{LOOPBACK}:{gateway.port}" not in targets(discovery)


def test_hostile_announcements_are_harmless(attacker: Zeroconf) -> None:
    evil = b"\x1b]52;c;cm0gLXJm\x07lab\r\nfault cleared \xe2\x80\xae" + b"x" * 150
    announce(
        attacker,
        announcement("escapes", name=evil, contract=b"\x1b[2J", tls=b"1"),
        announcement("portless", port=0, name=b"portless"),
        announcement("multicast", address="224.0.0.1", name=b"multicast"),
        announcement("nowhere", address="0.0.0.0", name=b"nowhere"),  # noqa: S104  # an answer to refuse
        announcement("nothing"),
    )
    with Discovery([LOOPBACK]) as discovery:
        wait_until(lambda: len(discovery.robots) >= 1, "one is found", ANNOUNCED_WITHIN_S)
        ended = robotctl("robots", "discover")
        found = discovery.robots
    assert ended.returncode == 0
    assert all(line.isprintable() for line in ended.stdout.splitlines())
    assert {each.target for each in found} == {f"{LOOPBACK}:50051"}
    for each in found:
        assert each.name.isprintable()
        assert len(each.name) <= 63
        assert each.contract.isprintable()


@pytest.mark.parametrize("name", [f"\x1b]0;owned\x07.{SERVICE_TYPE}", "lab._other._tcp.local.", "x."])
def test_a_hostile_name_ends_no_search(
    attacker: Zeroconf, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    """One such packet ended the thread that hears of robots: none that came later was found."""
    with Discovery([LOOPBACK]) as discovery:
        out = DNSOutgoing(dns._FLAGS_QR_RESPONSE | dns._FLAGS_AA, multicast=True)
        out.add_answer_at_time(DNSPointer(SERVICE_TYPE, dns._TYPE_PTR, dns._CLASS_IN, 4500, name), 0)
        attacker.send(out)
        wait_until(lambda: discovery._changes, "it is heard", ANNOUNCED_WITHIN_S)
        announce(attacker, announcement("after", name=b"after"))
        wait_until(lambda: "after" in {each.name for each in discovery.robots}, "a robot", ANNOUNCED_WITHIN_S)
    assert capfd.readouterr().err == "", "no word of a stranger's reaches the terminal"


def test_an_announcement_from_the_network_cant_name_this_computer(attacker: Zeroconf) -> None:
    """With addresses of other interfaces, loopback addresses are left out."""
    announce(attacker, announcement("self", name=b"self"))
    with Discovery([LOOPBACK]) as discovery:
        discovery._local = False
        wait_until(lambda: "self" in {name.partition(".")[0] for name in discovery._found}, "it is heard", 10)
        wait_until(lambda: not discovery._asking, "it was asked", 10)
        assert discovery.robots == ()


def test_a_flood_fills_no_list_and_no_time() -> None:
    with Discovery([LOOPBACK]) as discovery:
        flood = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        flood.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(LOOPBACK))
        with flood:
            number = 0
            deadline_s = time.monotonic() + 30
            while not discovery.truncated and time.monotonic() < deadline_s:
                out = DNSOutgoing(dns._FLAGS_QR_RESPONSE | dns._FLAGS_AA, multicast=True)
                for _ in range(20):
                    number += 1
                    name = f"flood-{number}.{SERVICE_TYPE}"
                    out.add_answer_at_time(
                        DNSPointer(SERVICE_TYPE, dns._TYPE_PTR, dns._CLASS_IN, 4500, name), 0
                    )
                for packet in out.packets():
                    flood.sendto(packet, ("224.0.0.251", 5353))
                time.sleep(0.01)
        assert discovery.truncated
        assert len(discovery._found) <= MOST_ROBOTS
        assert len(discovery._asking) <= MOST_ROBOTS
        begin_s = time.monotonic()
    assert time.monotonic() - begin_s < 5, "the end of the search does not wait for the flood's names"
    assert MOST_CHANGES > MOST_ROBOTS


def test_an_address_to_search_from_must_be_one() -> None:
    ended = robotctl("robots", "discover", ROBOTCTL_DISCOVERY="lab1")
    assert ended.returncode == 2
    assert "'lab1', which is not an IP address" in only_line(ended.stderr)


def test_the_status_of_all_known_robots_is_one_table(tmp_path: Path) -> None:
    home = {"XDG_CONFIG_HOME": str(tmp_path)}
    assert "No robot has a name yet" in robotctl("robots", "status", **home).stdout
    with serving(GatewayDouble()) as one, serving(GatewayDouble()) as two:
        for name, port in (("one", one), ("two", two)):
            robotctl("robots", "add", name, f"{LOOPBACK}:{port}", **home)
        both = robotctl("robots", "status", **home)
        assert (both.returncode, both.stderr) == (0, "")
        assert [line.split()[0] for line in both.stdout.splitlines()] == ["robot", "one", "two"]
        robotctl("robots", "add", "gone", f"{LOOPBACK}:{free_tcp_port()}", **home)
        table = robotctl("robots", "status", "--within", "2", **home)
        document = json.loads(robotctl("robots", "status", "--json", **home).stdout)
    assert table.returncode == 3
    assert "nothing listens there" in " ".join(table.stdout.split())
    holds(documented("robots status --json"), document, complete=False)
    assert [bool(each["status"]) for each in document["robots"]] == [True, True, False]
    assert document["robots"][2]["error"]["kind"] == "unreachable"
