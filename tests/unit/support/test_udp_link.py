"""The bad link of tests and benchmarks: what becomes of each packet."""

import socket

import pytest

from tests.support.udp_link import Direction, Impairment, Line, UdpLink

DATA = b"\x00" * 1000
CONTROL = b"\x80" + b"\x00" * 999


def lost(direction: Direction, packet: bytes, count: int = 1000) -> list[bool]:
    return [direction.arrival_s(packet, 1.0) is None for _ in range(count)]


def test_a_good_link_delivers_at_once() -> None:
    assert Direction(Impairment(), 1).arrival_s(DATA, 5.0) == 5.0


def test_delay() -> None:
    assert Direction(Impairment(delay_s=0.02), 1).arrival_s(DATA, 5.0) == pytest.approx(5.02)


def test_loss_is_random_and_repeatable() -> None:
    first = lost(Direction(Impairment(loss=0.1), 1), DATA)
    assert 60 < sum(first) < 140
    assert lost(Direction(Impairment(loss=0.1), 1), DATA) == first
    assert lost(Direction(Impairment(loss=0.1), 2), DATA) != first


def test_control_packets_have_a_loss_of_their_own() -> None:
    assert not any(lost(Direction(Impairment(loss=1.0), 1), CONTROL))
    assert all(lost(Direction(Impairment(control_loss=1.0), 1), CONTROL))
    assert not any(lost(Direction(Impairment(control_loss=1.0), 1), DATA))


def test_a_number_of_data_packets_is_lost_once() -> None:
    direction = Direction(link := Impairment(), 1)
    link.drops = 2
    assert not any(lost(direction, CONTROL, 10))
    assert lost(direction, DATA, 10) == [True] * 2 + [False] * 8


def test_packets_wait_before_the_bottleneck_until_its_queue_is_full() -> None:
    # 1000 bytes at 800 kbit/s take 10 ms each.
    direction = Direction(Impairment(rate_kbps=800, queue_s=0.035, delay_s=0.1), 1)
    arrivals = [direction.arrival_s(DATA, 1.0) for _ in range(6)]
    assert arrivals == [pytest.approx(1.0 + 0.1 + number * 0.01) for number in (1, 2, 3, 4)] + [None, None]
    assert direction.arrival_s(DATA, 2.0) == pytest.approx(2.11)


def test_with_jitter_packets_overtake_each_other() -> None:
    direction = Direction(Impairment(delay_s=0.02, jitter_s=0.01), 1)
    arrivals = [direction.arrival_s(DATA, 1.0) or 0.0 for _ in range(100)]
    assert all(1.02 <= each <= 1.03 for each in arrivals)
    assert arrivals != sorted(arrivals)
    line = Line[int](Direction(Impairment(jitter_s=0.01), 1))
    for number in range(100):
        line.send(DATA, number)
    found = line.arrived(float("inf"))
    assert found != sorted(found)
    assert sorted(found) == list(range(100))


def test_without_jitter_none_is_overtaken_also_when_the_delay_falls() -> None:
    """TCP links are made of the same parts, and their bytes must stay in order."""
    impairment = Impairment(delay_s=0.5)
    line = Line[int](Direction(impairment, 1))
    line.send(DATA, 1)
    impairment.delay_s = 0.0
    line.send(DATA, 2)
    assert line.arrived(float("inf")) == [1, 2]


def test_some_packets_come_twice() -> None:
    line = Line[int](Direction(Impairment(duplicates=0.1), 1))
    for number in range(1000):
        line.send(DATA, number)
    found = line.arrived(float("inf"))
    assert set(found) == set(range(1000))
    assert 1060 < len(found) < 1140


def test_callers_and_listener_talk_through_the_link() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(10)
        with (
            UdpLink(listener.getsockname()[1], Impairment(delay_s=0.01)) as link,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
        ):
            seen = []
            for caller in (one, other):
                caller.settimeout(10)
                caller.sendto(DATA, ("127.0.0.1", link.port))
                packet, address = listener.recvfrom(2048)
                assert packet == DATA
                listener.sendto(CONTROL, address)
                assert caller.recv(2048) == CONTROL
                seen.append(address)
            assert len(set(seen)) == 2
            assert link.bytes_to_callers == 2 * len(CONTROL)
