"""Ports and domains: two programs never choose the same one, and what is in use is passed over."""

import socket
import subprocess
import sys
from pathlib import Path

from tests.support.free import free_domain, free_tcp_port, free_udp_port, port_is_free, udp_port_is_free

ROOT = Path(__file__).parents[3]
EPHEMERAL = Path("/proc/sys/net/ipv4/ip_local_port_range")


def test_ports_of_two_programs_differ() -> None:
    mine = {free_tcp_port() for _ in range(50)}
    program = "from tests.support.free import free_tcp_port; print(*(free_tcp_port() for _ in range(50)))"
    others = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
    )
    assert len(mine) == 50
    assert not mine & set(map(int, others.stdout.split()))


def test_a_port_in_use_is_passed_over() -> None:
    taken = free_tcp_port() + 1
    with socket.create_server(("127.0.0.1", taken)):
        assert not port_is_free(socket.SOCK_STREAM, taken)
        assert taken not in {free_tcp_port() for _ in range(3)}
    assert port_is_free(socket.SOCK_STREAM, taken)


def test_a_udp_port_in_use_is_passed_over() -> None:
    taken = free_udp_port() + 1
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", taken))
        assert not udp_port_is_free(taken)
        assert taken not in {free_udp_port() for _ in range(3)}


def test_no_port_is_one_that_the_kernel_gives_to_outgoing_connections() -> None:
    first, last = map(int, EPHEMERAL.read_text(encoding="ascii").split())
    assert not first <= free_tcp_port() <= last


def test_a_domain_has_one_owner_at_a_time() -> None:
    with free_domain() as one, free_domain() as other:
        assert one != other


def test_a_domain_with_a_participant_is_passed_over() -> None:
    with free_domain() as domain:
        pass
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(("", 7400 + 250 * domain))
        with free_domain() as other:
            assert other != domain
