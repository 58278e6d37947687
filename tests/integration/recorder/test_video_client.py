"""The client of the video tap with servers that misbehave, over real sockets."""

import asyncio
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic_ns

import pytest

from common.video_tap import MAX_PAYLOAD_BYTES, Header, Kind, encode_object
from recorder.video import tap as client
from tests.support.tap_reader import PATIENCE_S, TapRecording

INFO = encode_object(Kind.INFO, {"state": "running", "codec": "h264"})
UNIT = b"".join(b"\0\0\1" + bytes([kind]) + b"data" for kind in (7, 8, 5))


def key_frame() -> bytes:
    header = Header(Kind.ACCESS_UNIT, len(UNIT), key_frame=True, captured_ns=monotonic_ns())
    return header.encode() + UNIT


@contextmanager
def server(path: Path, *answers: Callable[[], bytes], keeps_open: bool = False) -> Iterator[None]:
    """Answers the connections in turn, the last answer for all that follow."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen()
    opened: list[socket.socket] = []

    def serve() -> None:
        with suppress(OSError):
            for number in range(1000):
                connection, _ = listener.accept()
                opened.append(connection)
                with suppress(OSError):
                    connection.sendall(answers[min(number, len(answers) - 1)]())
                if not keeps_open:
                    connection.close()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        thread.join(PATIENCE_S)
        for each in (listener, *opened):
            each.close()


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda: b"HTTP/1.1 400 Bad Request\r\n\r\n", "begins with b'HTTP'"),
        (lambda: INFO + b"\0" * 24, "begins with"),
        (
            lambda: (
                INFO[:0]
                + Header(Kind.INFO, 0).encode()[:4]
                + (MAX_PAYLOAD_BYTES + 1).to_bytes(4, "little")
                + bytes(16)
            ),
            "8388609 bytes",
        ),
        (lambda: Header(Kind.INFO, 3).encode() + b"{,}", "no JSON"),
        (lambda: INFO + Header(Kind.ACCESS_UNIT, 1, captured_ns=5).encode() + b"x", "capture time"),
        (key_frame, "before its codec"),
        (lambda: b"", "closed the connection"),
        (lambda: INFO + key_frame()[:30], "closed the connection"),
    ],
    ids=["http", "zeros", "long", "json", "clock", "order", "nothing", "half"],
)
def test_something_else_than_records_ends_the_connection_and_is_named(
    tmp_path: Path, answer: Callable[[], bytes], words: str
) -> None:
    path = tmp_path / "tap.sock"
    with server(path, answer), TapRecording(path) as recording:
        recording.wait_for(lambda: recording.tap.failures >= 2, "a second attempt")
        assert words in recording.tap.last_error
        assert recording.samples == []
    assert len(recording.losses) == 1


def test_it_recovers_from_a_bad_connection_with_a_loss(tmp_path: Path) -> None:
    path = tmp_path / "tap.sock"
    good = lambda: INFO + key_frame()  # noqa: E731
    with server(path, good, lambda: b"nonsense" * 10, good), TapRecording(path) as recording:
        recording.wait_for(lambda: len(recording.samples) >= 2, "frames of a good connection")
    assert recording.losses[0].began_ns == recording.samples[0].publish_time_ns
    assert recording.losses[0].ended_ns == recording.samples[1].publish_time_ns


def test_without_a_preview_it_waits_for_one(tmp_path: Path) -> None:
    path = tmp_path / "tap.sock"
    with TapRecording(path) as recording:
        recording.wait_for(lambda: recording.tap.failures >= 2, "failures")
        assert "the preview does not serve it" in recording.tap.last_error
        with server(path, lambda: INFO + key_frame(), keeps_open=True):
            recording.wait_for(lambda: recording.tap.connected, "a connection")
            recording.wait_for(lambda: recording.samples, "a frame")
            assert recording.tap.last_error == ""


@pytest.mark.parametrize("sent", [b"", INFO, INFO + key_frame()[:30]], ids=["nothing", "info", "half"])
def test_a_preview_that_falls_silent_is_left(
    tmp_path: Path, sent: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "FIRST_RECORD_S", 0.2)
    monkeypatch.setattr(client, "SILENCE_S", 0.2)
    path = tmp_path / "tap.sock"
    with server(path, lambda: sent, keeps_open=True), TapRecording(path) as recording:
        recording.wait_for(lambda: recording.tap.connections >= 2, "another connection")
        recording.wait_for(lambda: recording.tap.failures >= 2, "two failures")


def test_what_the_preview_says_about_missing_frames_is_a_problem_until_they_come(tmp_path: Path) -> None:
    path = tmp_path / "tap.sock"
    faulted = encode_object(Kind.INFO, {"state": "faulted", "error": "no camera at /dev/video0"})
    with (
        server(path, lambda: faulted, lambda: faulted + INFO + key_frame(), keeps_open=True),
        TapRecording(path) as recording,
    ):
        recording.wait_for(lambda: recording.tap.problem == "no camera at /dev/video0", "the preview's words")
        assert recording.tap.last_error == ""
        with TapRecording(path) as later:
            later.wait_for(lambda: later.samples, "a frame")
            assert later.tap.problem == ""


async def test_cancelled_while_it_connects_it_leaves_nothing_behind(tmp_path: Path) -> None:
    running = asyncio.create_task(client.Tap(tmp_path / "none.sock", lambda _items: None).run())
    await asyncio.sleep(0)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
