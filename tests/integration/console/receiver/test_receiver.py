"""The receiver against real SRT and real codecs; the test sends every frame itself."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.receiver.address import StreamAddress
from console.receiver.delivery import DeliveryChoice
from console.receiver.errors import (
    StreamEndedError,
    StreamRefusedError,
    UndecodableError,
)
from console.receiver.options import ReceiverOptions
from tests.support.free import free_udp_port
from tests.support.receiver import NoFrameError, Receiver, show_the_first
from tests.support.streams import SrtSender, encode
from tests.support.waiting import wait_until
from tests.support.whole_pictures import WholePictures

pytestmark = pytest.mark.gst

PATIENCE_S = 20
NINE_FRAMES_NS = 280_000_000
"""At 30 frames per second, less than the demultiplexer corrects their times by."""


@pytest.fixture
def port() -> int:
    return free_udp_port()


@pytest.fixture
def sender(port: int) -> Iterator[SrtSender]:
    with SrtSender(port) as sender:
        yield sender


def viewer(port: int, queue_size: int = 2, delivery: DeliveryChoice = DeliveryChoice.AUTO) -> Receiver:
    """A test that sends by hand sends slowly, which looks like age."""
    options = ReceiverOptions(delivery=delivery, max_age_s=1000)
    return Receiver(StreamAddress("127.0.0.1", port, latency_ms=20), queue_size=queue_size, options=options)


def joined(sender: SrtSender) -> None:
    assert sender.viewer_joined.wait(PATIENCE_S), "the viewer did not get through"
    sender.viewer_joined.clear()


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_a_frame_does_not_wait_for_the_next_one(sender: SrtSender, port: int, codec: str) -> None:
    pieces = encode(codec, 12)
    with viewer(port) as receiver:
        frames = [show_the_first(pieces[0], sender, receiver)]
        for piece in pieces[1:]:
            sender.send(piece)
            frames.append(receiver.next_frame(PATIENCE_S))
    for frame in frames:
        assert (frame.width, frame.height, frame.codec) == (320, 240, codec)
    assert WholePictures(b"".join(pieces)).numbers(frames) == list(range(12))


def test_frames_differ_and_times_grow(sender: SrtSender, port: int) -> None:
    pieces = encode("h264", 10)
    with viewer(port, queue_size=10) as receiver:
        joined(sender)
        for piece in pieces:
            sender.send(piece)
        frames = [receiver.next_frame(PATIENCE_S) for _ in pieces]
    assert len({frame.read() for frame in frames}) == 10
    times_ns = [frame.pts_ns for frame in frames if frame.pts_ns is not None]
    assert len(times_ns) == 10
    assert times_ns == sorted(set(times_ns))


def test_a_slow_caller_gets_the_newest_frames(sender: SrtSender, port: int) -> None:
    pieces = encode("h264", 10)
    with viewer(port, queue_size=1) as receiver:
        first = show_the_first(pieces[0], sender, receiver)
        for piece in pieces[1:]:
            sender.send(piece)
        newest = receiver.next_frame(PATIENCE_S)
        while (newest.pts_ns or 0) < (first.pts_ns or 0) + NINE_FRAMES_NS:
            newest = receiver.next_frame(PATIENCE_S)


def test_the_codec_may_change_under_the_connection(sender: SrtSender, port: int) -> None:
    with viewer(port, queue_size=30) as receiver:
        joined(sender)
        for codec in ("h264", "h265", "h264"):
            pieces = encode(codec, 10)
            for piece in pieces:
                sender.send(piece)
            while receiver.next_frame(PATIENCE_S).codec != codec:
                pass


def test_the_end_is_reported(port: int) -> None:
    pieces = encode("h264", 3)
    with SrtSender(port) as sender, viewer(port, queue_size=3) as receiver:
        show_the_first(pieces[0], sender, receiver)
        for piece in pieces[1:]:
            sender.send(piece)
            receiver.next_frame(PATIENCE_S)
        sender.close()
        with pytest.raises(StreamEndedError, match=f"srt://127.0.0.1:{port} ended"):
            receiver.next_frame(PATIENCE_S)


def test_there_is_no_listener(port: int) -> None:
    with viewer(port) as receiver:
        with pytest.raises(NoFrameError, match="within 0"):
            receiver.next_frame(0.1)
        with pytest.raises(StreamRefusedError, match=f"no SRT listener answers at srt://127.0.0.1:{port}"):
            receiver.next_frame(PATIENCE_S)


def test_connected_but_nothing_sent(sender: SrtSender, port: int) -> None:
    with viewer(port) as receiver:
        joined(sender)
        with pytest.raises(NoFrameError, match="no frame"):
            receiver.next_frame(0.2)


@pytest.mark.parametrize(
    ("given", "message"),
    [("", "asks for a passphrase"), ("a wrong passphrase", "did not accept the passphrase")],
)
def test_the_passphrase_does_not_fit(port: int, given: str, message: str) -> None:
    address = StreamAddress("127.0.0.1", port, latency_ms=20, passphrase=given)
    with SrtSender(port, passphrase="the right one"), Receiver(address) as receiver:
        with pytest.raises(StreamRefusedError, match=message) as caught:
            receiver.next_frame(PATIENCE_S)
        assert "wrong" not in str(caught.value)


def test_the_passphrase_fits(port: int) -> None:
    piece = encode("h264", 1)[0]
    address = StreamAddress("127.0.0.1", port, latency_ms=20, passphrase="the right one")
    with SrtSender(port, passphrase="the right one") as sender, Receiver(address) as receiver:
        assert show_the_first(piece, sender, receiver).width == 320


def test_a_name_is_called_where_the_robot_listens(sender: SrtSender, port: int) -> None:
    """The name localhost is an IPv6 address, too, without a listener."""
    with Receiver(StreamAddress("localhost", port, latency_ms=20)) as receiver:
        assert show_the_first(encode("h264", 1)[0], sender, receiver).width == 320


def test_an_unknown_host_is_reported(port: int) -> None:
    with (
        Receiver(StreamAddress("robot.invalid", port, latency_ms=20)) as receiver,
        pytest.raises(StreamRefusedError, match=r"srt://robot\.invalid"),
    ):
        receiver.next_frame(PATIENCE_S)


def test_a_stream_of_another_codec_is_named(sender: SrtSender, port: int) -> None:
    pieces = encode("mpeg4", 5)
    with viewer(port) as receiver:
        joined(sender)
        for piece in pieces:
            sender.send(piece)
        with pytest.raises(UndecodableError, match="video/mpeg"):
            receiver.next_frame(PATIENCE_S)


def test_garbage_makes_no_frame_and_does_no_harm(sender: SrtSender, port: int) -> None:
    pieces = encode("h264", 5)
    with viewer(port) as receiver:
        joined(sender)
        sender.send(bytes(range(256)) * 50)
        with pytest.raises(NoFrameError):
            receiver.next_frame(0.3)
        for piece in pieces:
            sender.send(piece)
        assert receiver.next_frame(PATIENCE_S).width == 320


def test_nothing_is_left_behind(sender: SrtSender, port: int) -> None:
    piece = encode("h264", 1)[0]

    def one_visit() -> None:
        with viewer(port) as receiver:
            joined(sender)
            wait_until(lambda: shows(receiver), "the frame is shown", PATIENCE_S)

    def shows(receiver: Receiver) -> bool:
        """Sends the frame again each time: a viewer whose handshake was slow has dialled anew and lost it."""
        sender.send(piece)
        try:
            receiver.next_frame(1.0)
        except NoFrameError:
            return False
        return True

    one_visit()
    threads, files = threading.active_count(), open_files()
    for _ in range(10):
        one_visit()
    wait_until(lambda: threading.active_count() <= threads, "the receiver's threads are gone")
    # libsrt keeps the sockets of closed connections for some seconds.
    wait_until(lambda: open_files() <= files, "the receiver's sockets are gone")


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))
