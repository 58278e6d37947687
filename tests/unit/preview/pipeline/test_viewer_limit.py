"""Who may begin a handshake: strangers without the passphrase keep no viewer out."""

from collections.abc import Callable
from typing import Any

import pytest

from preview.pipeline.viewer_limit import (
    HANDSHAKE_S,
    HANDSHAKES_OF_HOST,
    HANDSHAKES_OF_STRANGERS,
    REPEATS,
    ViewerLimit,
)
from tests.support.clock import Clock

LIMIT = 4


class Address:
    """A socket address, as GStreamer hands it over."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port

    def get_address(self) -> Any:
        return self

    def to_string(self) -> str:
        return self._host

    def get_port(self) -> int:
        return self._port


class Listener:
    """A sink whose callers come as the test says."""

    def __init__(self) -> None:
        self.clock = Clock()
        self._slots: dict[str, Callable[..., Any]] = {}
        self.limit = ViewerLimit(self, LIMIT, self.clock)

    def set_property(self, name: str, value: object) -> None:
        assert (name, value) == ("authentication", True)

    def connect(self, signal: str, slot: Callable[..., Any]) -> None:
        self._slots[signal] = slot

    def calls(self, host: str, port: int = 1) -> bool:
        return bool(self._slots["caller-connecting"](self, Address(host, port), ""))

    def joins(self, host: str, port: int = 1) -> bool:
        """Whether a viewer with the right passphrase gets in."""
        admitted = self.calls(host, port)
        if admitted:
            self._slots["caller-added"](self, 0, Address(host, port))
        return admitted

    def leaves(self, host: str, port: int = 1) -> None:
        self._slots["caller-removed"](self, 0, Address(host, port))


@pytest.fixture
def listener() -> Listener:
    return Listener()


def test_viewers_beyond_the_limit_are_refused_and_counted(listener: Listener) -> None:
    assert [listener.joins(f"10.0.0.{number}") for number in range(LIMIT + 2)] == [True] * LIMIT + [False] * 2
    assert (listener.limit.take_refused(), listener.limit.take_refused()) == (2, 0)
    listener.leaves("10.0.0.1")
    assert listener.joins("10.0.0.9")


def test_a_request_that_arrives_once_more_after_its_viewer_has_connected_takes_no_place(
    listener: Listener,
) -> None:
    for number in range(LIMIT):
        assert listener.joins(f"10.0.0.{number}")
        assert listener.calls(f"10.0.0.{number}")
    listener.leaves("10.0.0.1")
    assert listener.joins("10.0.0.9")
    assert not listener.joins("10.0.0.8")


def test_one_host_without_the_passphrase_keeps_no_viewer_out(listener: Listener) -> None:
    """It begins handshakes from all ports it has, again and again."""
    for second in range(20):
        admitted = sum(listener.calls("10.0.9.9", 1000 + port) for port in range(200))
        assert admitted <= HANDSHAKES_OF_HOST
        if second < LIMIT:
            assert listener.joins(f"10.0.0.{second}")
        listener.clock.now_s += 1.0


def test_many_hosts_without_it_keep_out_no_viewer_of_a_host_that_has_watched(listener: Listener) -> None:
    assert listener.joins("10.0.0.1")
    listener.leaves("10.0.0.1")
    admitted = sum(listener.calls(f"10.1.{host}.1", port) for host in range(200) for port in range(4))
    assert admitted <= HANDSHAKES_OF_STRANGERS
    assert not listener.calls("10.0.0.2"), "a host that was never here has to wait"
    assert [listener.joins("10.0.0.1", port) for port in range(LIMIT + 1)] == [True] * LIMIT + [False]
    listener.leaves("10.0.0.1", 0)
    listener.clock.now_s += HANDSHAKE_S
    assert listener.joins("10.0.0.2"), "until theirs have ended"


def test_a_viewer_that_repeats_its_request_is_one(listener: Listener) -> None:
    assert all(listener.calls("10.0.0.1") for _ in range(5))
    assert listener.joins("10.0.0.1")
    assert [listener.joins("10.0.0.1", port) for port in range(2, LIMIT + 2)] == [True] * (LIMIT - 1) + [
        False
    ]


def test_one_that_repeats_it_without_end_is_refused(listener: Listener) -> None:
    """Each may be another connection for SRT, which keeps its buffers for a while."""
    assert sum(listener.calls("10.0.0.1") for _ in range(1000)) == REPEATS


def test_viewers_of_known_hosts_that_come_together_do_not_exceed_the_limit(listener: Listener) -> None:
    assert listener.joins("10.0.0.1")
    assert [listener.calls("10.0.0.1", port) for port in range(2, 2 + LIMIT)] == [True] * (LIMIT - 1) + [
        False
    ]
