"""Direct delivery with the real libsrt: GStreamer's srtsink sends, a relay delays and loses."""

import errno
import os
import random
import resource
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import pairwise
from typing import Any

import pytest

from common.errors import UserError
from common.gst import Gst, stop
from console.capture_time import WRAP_TICKS, CaptureClock, ticks_to_ns
from console.receiver import decoding, libsrt, reception
from console.receiver.address import StreamAddress
from console.receiver.connection import connect
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.direct import DirectConnection
from console.receiver.errors import (
    NoPictureError,
    StreamEndedError,
    StreamError,
    StreamRefusedError,
    UndecodableError,
)
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from console.receiver.libsrt import LibsrtMissingError, LocalSocketError
from console.receiver.options import CLOSES_WITHIN_S, ReceiverOptions
from console.receiver.reorder import Delivered, Reorder
from console.receiver.transport_stream import TransportStream
from console.receiver.unit_decoder import UnitDecoder
from tests.support.free import free_udp_port
from tests.support.promise import keeps
from tests.support.receiver import NoFrameError, Receiver, show_the_first
from tests.support.stalls import Stalls
from tests.support.streams import MOVING_EVERYWHERE, SRT_PAYLOAD, SrtSender, encode
from tests.support.udp_link import Impairment, UdpLink
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.waiting import wait_until
from tests.support.whole_pictures import WholePictures, fingerprint

pytestmark = pytest.mark.gst

PATIENCE_S = 20
FRAMES = 90
FRAME_S = 1 / 30
CLOSING = 7
"""SRTS_CLOSING: that state and those after it."""
SLOW_FRAME_S = 0.1
KEY_FRAME_EVERY = 15
LOSSY = Impairment(delay_s=0.02, loss=0.02)
VERY_LOSSY = Impairment(delay_s=0.02, loss=0.06)
CLOSED_WITHIN_S = 1.0
OLDEST_S = 1.0
STEADY_FROM = 30
FIRST_PTS_NS = 3600 * 10**9
"""mpegtsmux begins an hour ahead."""
AFTERWARDS = 15
NO_ADDRESS_OF_OURS = "203.0.113.1"
"""For documentation (RFC 5737)."""
NO_FRAME = bytes([0x47, 0x1F, 0xFF, 0x10]) + bytes(184)
"""A null packet (ISO/IEC 13818-1 2.4.3.3): the stream goes on without a frame."""


@pytest.fixture(scope="module")
def pieces() -> list[bytes]:
    """Frames of several packets each, none so large that its PES packet does not say how long it is.

    Everything in them moves, so that each shows what is lacking of those before it.
    """
    made = encode("h264", FRAMES, kbps=2000, pattern=MOVING_EVERYWHERE)
    assert max(map(len, made)) < 1 << 16
    return made


@pytest.fixture(scope="module")
def whole(pieces: list[bytes]) -> WholePictures:
    """What a viewer may show of them."""
    return WholePictures(b"".join(pieces))


@pytest.fixture
def port() -> int:
    return free_udp_port()


def receiver(port: int, **options: Any) -> Receiver:
    address = StreamAddress("127.0.0.1", port, latency_ms=125)
    return Receiver(address, queue_size=2 * FRAMES, options=ReceiverOptions(**options))


def play(sender: SrtSender, pieces: list[bytes]) -> None:
    """Sends in real time."""
    begun_s = time.monotonic()
    for number, piece in enumerate(pieces):
        time.sleep(max(0.0, begun_s + number * FRAME_S - time.monotonic()))
        sender.send(piece)


def everything(viewer: Receiver, most: int = 2 * FRAMES) -> list[Frame]:
    """Returns the frames that have come, and those that come until none does for a second, `most` at most."""
    frames: list[Frame] = []
    with suppress(NoFrameError):
        while len(frames) < most:
            frames.append(viewer.next_frame(1.0))
    return frames


def watched(
    port: int, pieces: list[bytes], impairment: Impairment, **options: Any
) -> tuple[Any, list[Frame]]:
    """Plays a stream over a link; returns the final figures and all frames."""
    with (
        SrtSender(port, latency_ms=125) as sender,
        UdpLink(port, impairment) as link,
        receiver(link.port, **options) as viewer,
    ):
        assert sender.viewer_joined.wait(PATIENCE_S)
        # SRT repeats a packet when a later one shows that it was lost: after a stream's last one none would.
        play(sender, [*pieces, *[NO_FRAME] * AFTERWARDS])
        frames = everything(viewer)
        return viewer.delivery, frames


def assert_every_frame(frames: list[Frame], whole: WholePictures) -> None:
    """Each frame came once, in order and whole."""
    times_ns = [frame.pts_ns or 0 for frame in frames]
    assert len(times_ns) == FRAMES
    steps = [later - earlier for earlier, later in pairwise(times_ns)]
    assert all(abs(step / 1e9 - FRAME_S) < 0.001 for step in steps)
    assert whole.numbers(frames) == list(range(FRAMES))


def assert_none_torn(frames: list[Frame], whole: WholePictures) -> None:
    """Some frames are lacking; those that came are whole and in order."""
    numbers = [-1 if each is None else each for each in whole.numbers(frames)]
    assert -1 not in numbers, f"torn frames were shown: {numbers}"
    assert numbers == sorted(set(numbers))
    assert 0 < len(numbers) < FRAMES


@pytest.mark.parametrize(
    "impairment",
    [
        Impairment(),
        Impairment(delay_s=0.01, loss=0.03, control_loss=0.03),
        Impairment(delay_s=0.01, loss=0.1, control_loss=0.1),
        Impairment(delay_s=0.01, jitter_s=0.01, duplicates=0.05),
        Impairment(delay_s=0.01, jitter_s=0.01, duplicates=0.05, loss=0.03, control_loss=0.03),
    ],
    ids=["loopback", "20 ms, 3 %", "20 ms, 10 %", "out of order, some twice", "that, and 3 %"],
)
def test_every_frame_is_delivered(
    port: int,
    pieces: list[bytes],
    whole: WholePictures,
    impairment: Impairment,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # This machine may be busy for longer than a packet is waited for; the waiting itself has unit tests.
    monkeypatch.setattr(reception, "wait_s", lambda _rtt_ms: 3.0)
    monkeypatch.setattr(reception, "_LONGEST_WAIT_S", 3.0)  # A connection begins with it.

    def attempt() -> None:
        # In a stall of the link's own thread, its socket overflows.
        with no_stall():
            delivery, frames = watched(port, pieces, impairment, max_age_s=10)
            assert_every_frame(frames, whole)
            assert delivery.kind is DeliveryChoice.DIRECT
            assert (delivery.given_up, delivery.dropped_frames, delivery.rejoins) == (0, 0, 0)
            # What is overtaken is missing at first, too.
            assert (delivery.lost > 0) == (impairment.loss > 0 or impairment.jitter_s > 0)

    undisturbed(attempt)


def test_it_is_the_order_that_delivers_them(
    port: int, pieces: list[bytes], whole: WholePictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same without the ordering: packets do come out of their order."""
    monkeypatch.setattr(Reorder, "put", lambda _self, _number, payload, _now_s: [Delivered(0, payload)])
    loss = Impairment(delay_s=0.01, loss=0.05, control_loss=0.05)
    delivery, frames = watched(port, pieces, loss, on_picture_lost=lambda _pts: True)
    assert delivery.dropped_frames > 0
    assert_none_torn(frames, whole)


def test_no_torn_frame_is_shown_where_packets_are_given_up(
    port: int, pieces: list[bytes], whole: WholePictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reception, "wait_s", lambda _rtt_ms: 0.005)
    lost: list[int | None] = []

    def request(newest_pts: int | None) -> bool:
        lost.append(newest_pts)
        return True

    delivery, frames = watched(port, pieces, LOSSY, on_picture_lost=request)
    assert delivery.given_up > 0
    assert any(lost)
    assert_none_torn(frames, whole)


def test_without_the_withholding_torn_frames_are_shown_and_seen_to_be_torn(
    port: int, pieces: list[bytes], whole: WholePictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same link and losses: the withholding keeps them back, and the judge knows a torn frame."""
    monkeypatch.setattr(reception, "wait_s", lambda _rtt_ms: 0.005)
    monkeypatch.setattr(TransportStream, "_tear", lambda _self: None)
    delivery, frames = watched(port, pieces, VERY_LOSSY)
    assert delivery.given_up > 0
    assert None in whole.numbers(frames)


class SlowQueue(FrameQueue):
    """Takes as long for each frame as a slow decoder."""

    def __init__(self) -> None:
        super().__init__(FRAMES)
        self.frames: list[Frame] = []

    def put(self, frame: Frame) -> None:
        time.sleep(SLOW_FRAME_S)
        self.frames.append(frame)


@pytest.mark.timed
def test_a_decoder_that_is_too_slow_shows_newer_frames_and_asks_for_nothing(port: int) -> None:
    """At 10 of 30 frames per second; a key frame comes every 15."""
    pieces = encode("h264", 3 * FRAMES, kbps=500, gop=KEY_FRAME_EVERY)
    whole = WholePictures(b"".join(pieces))
    lost: list[int | None] = []

    def request(newest_pts: int | None) -> bool:
        lost.append(newest_pts)
        return True

    def longest_wait_s() -> float:
        lost.clear()
        slow = SlowQueue()
        with SrtSender(port) as sender:
            options = ReceiverOptions(max_age_s=1000, on_picture_lost=request)
            address = StreamAddress("127.0.0.1", port, latency_ms=125)
            connection = DirectConnection(address, slow, options)
            try:
                assert sender.viewer_joined.wait(PATIENCE_S)
                play(sender, pieces)
            finally:
                connection.close()
        waits_s = [frame.arrival_s - frame.received_s for frame in slow.frames if frame.received_s]
        print(f"{len(waits_s)} frames, the longest wait {max(waits_s):.2f} s")
        assert connection.delivery.dropped_frames > FRAMES
        assert connection.delivery.rejoins == 0
        assert lost == []
        assert whole.torn(map(fingerprint, slow.frames)) == 0
        return max(waits_s)

    keeps(
        # 0.6 s at most, or up to the next key frame; and the frames that the decoder has at hand.
        0.6 + KEY_FRAME_EVERY * FRAME_S + 5 * SLOW_FRAME_S,
        "s that a frame waits for a slow decoder",
        longest_wait_s,
    )


@contextmanager
def played_for_ever(sender: SrtSender, pieces: list[bytes]) -> Iterator[None]:
    """Sends these again and again, in real time."""
    done = threading.Event()

    def play_on() -> None:
        while not done.is_set():
            for piece in pieces:
                sender.send(piece)
                done.wait(FRAME_S)

    playing = threading.Thread(target=play_on, name="player")
    playing.start()
    try:
        yield
    finally:
        done.set()
        playing.join(PATIENCE_S)


def test_packets_that_never_make_a_picture_are_an_end_that_says_so(
    port: int, pieces: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No key frame comes, as over a link that loses a part of each."""
    monkeypatch.setattr(reception, "_FIRST_KEY_FRAME_S", 0.2)
    with SrtSender(port) as sender, receiver(port, on_picture_lost=lambda _pts: True) as viewer:
        assert sender.viewer_joined.wait(PATIENCE_S)
        with (
            played_for_ever(sender, pieces[1:10]),
            pytest.raises(NoPictureError, match="no whole picture for"),
        ):
            viewer.next_frame(2 * PATIENCE_S)
        assert viewer.delivery.rejoins >= 2


class HangingQueue(FrameQueue):
    """Takes no frame until it is released, as a decoder's driver that hangs."""

    def __init__(self, released: threading.Event) -> None:
        super().__init__(FRAMES)
        self._released = released

    def put(self, _frame: Frame) -> None:
        self._released.wait(2 * PATIENCE_S)


def test_a_decoder_that_hangs_over_all_connections_is_what_is_reported(
    port: int, pieces: list[bytes], stuck: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then software can take over, which no new connection makes it do."""
    monkeypatch.setattr(reception, "_FIRST_KEY_FRAME_S", 0.2)
    queue, address = HangingQueue(stuck), StreamAddress("127.0.0.1", port, latency_ms=20)
    with SrtSender(port) as sender:
        connection = DirectConnection(address, queue, ReceiverOptions(max_age_s=0.2))
        assert sender.viewer_joined.wait(PATIENCE_S)
        # A key frame with all that depend on it each second: up to then, what waits is too old.
        with played_for_ever(sender, pieces[:30]):
            end = queue.take(time.monotonic() + 2 * PATIENCE_S)
        stuck.set()
        assert connection.close()
    assert isinstance(end, UndecodableError)
    assert "frames that bring no picture" in end.what


def test_ten_viewers(port: int, pieces: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    # Ten decoders that begin at once may be slower than the stream here; what is done then has a test above.
    monkeypatch.setattr("console.receiver.decoder_queue._LONGEST_WAIT_S", PATIENCE_S)

    def attempt() -> None:
        with no_stall(), SrtSender(port) as sender, ExitStack() as stack:
            viewers = []
            for _ in range(10):
                sender.viewer_joined.clear()
                viewers.append(stack.enter_context(receiver(port, max_age_s=1000)))
                assert sender.viewer_joined.wait(PATIENCE_S)
            play(sender, [*pieces[:20], *[NO_FRAME] * AFTERWARDS])
            assert [len(everything(viewer, most=20)) for viewer in viewers] == [20] * 10

    undisturbed(attempt)


def test_a_sender_that_restarts_is_an_end_and_can_be_connected_to_again(
    port: int, pieces: list[bytes]
) -> None:
    for _ in range(2):
        with SrtSender(port) as sender, receiver(port, max_age_s=1000) as viewer:
            show_the_first(pieces[0], sender, viewer)
            sender.close()
            with pytest.raises(StreamEndedError):
                viewer.next_frame(PATIENCE_S)


@contextmanager
def closed_in_time(viewer: Receiver) -> Iterator[Receiver]:
    """Measures how long leaving takes, without the longest stall of this process meanwhile."""
    with ExitStack() as leaving:
        leaving.enter_context(viewer)
        yield viewer
        with Stalls() as stalls:
            begun_s = time.monotonic()
            leaving.close()
            took_s = time.monotonic() - begun_s
    assert took_s - stalls.longest_s < CLOSED_WITHIN_S


def test_it_stops_while_a_listener_does_not_answer() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        with closed_in_time(receiver(silent.getsockname()[1])) as viewer, pytest.raises(NoFrameError):
            viewer.next_frame(0.3)


@pytest.fixture
def stuck() -> Iterator[threading.Event]:
    """What hangs waits for it; at the end everything goes on, so that no thread is left."""
    released = threading.Event()
    yield released
    released.set()
    wait_until(
        lambda: (
            not {"receiver", "receiver-close", "resolver"} & {each.name for each in threading.enumerate()}
        ),
        "the threads end",
    )


@pytest.mark.parametrize("delivery", [DeliveryChoice.DIRECT, DeliveryChoice.SRT])
def test_a_resolver_that_hangs_delays_no_caller(
    stuck: threading.Event, monkeypatch: pytest.MonkeyPatch, delivery: DeliveryChoice
) -> None:
    monkeypatch.setattr("console.name_lookup.socket.getaddrinfo", lambda *_args, **_more: stuck.wait() and [])
    monkeypatch.setattr("console.receiver.direct._RESOLVES_WITHIN_S", 0.2)
    monkeypatch.setattr("console.receiver.srt._RESOLVES_WITHIN_S", 0.2)
    address = StreamAddress("robot.invalid", 7100, latency_ms=20)
    with (
        Receiver(address, options=ReceiverOptions(delivery=delivery)) as viewer,
        pytest.raises(StreamRefusedError, match=r"robot.invalid"),
    ):
        viewer.next_frame(PATIENCE_S)


def test_it_stops_while_a_resolver_hangs(stuck: threading.Event, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("console.name_lookup.socket.getaddrinfo", lambda *_args, **_more: stuck.wait() and [])
    address = StreamAddress("robot.invalid", 7100, latency_ms=20)
    with closed_in_time(Receiver(address)) as viewer, pytest.raises(NoFrameError):
        viewer.next_frame(0.3)


@pytest.mark.parametrize("delivery", [DeliveryChoice.DIRECT, DeliveryChoice.SRT])
def test_a_driver_that_hangs_when_it_is_stopped_is_left_behind(
    port: int,
    pieces: list[bytes],
    stuck: threading.Event,
    monkeypatch: pytest.MonkeyPatch,
    delivery: DeliveryChoice,
) -> None:
    def hang(pipeline: Any) -> None:
        assert stuck.wait(PATIENCE_S)
        stop(pipeline)

    monkeypatch.setattr("console.receiver.unit_decoder.stop", hang)
    monkeypatch.setattr("console.receiver.srt.stop", hang)
    queue = FrameQueue(FRAMES)
    with SrtSender(port) as sender:
        address = StreamAddress("127.0.0.1", port, latency_ms=20)
        connection = connect(address, queue, ReceiverOptions(delivery=delivery, max_age_s=1000))
        assert sender.viewer_joined.wait(PATIENCE_S)
        sender.send(pieces[0])
        begun_s = time.monotonic()
        assert not connection.close()
        assert time.monotonic() - begun_s < 2 * CLOSES_WITHIN_S


def test_a_listener_that_does_not_answer_is_reported() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        refused = pytest.raises(StreamRefusedError, match="no SRT listener answers")
        with receiver(silent.getsockname()[1]) as viewer, refused:
            viewer.next_frame(PATIENCE_S)


def test_it_stops_while_nothing_comes(port: int, pieces: list[bytes]) -> None:
    with SrtSender(port) as sender, closed_in_time(receiver(port)) as viewer:
        show_the_first(pieces[0], sender, viewer)
        with pytest.raises(NoFrameError):
            viewer.next_frame(0.5)


def test_hostile_datagrams_do_no_harm(port: int, pieces: list[bytes], whole: WholePictures) -> None:
    noise = random.Random(1)
    with SrtSender(port) as sender, UdpLink(port) as link, receiver(link.port, max_age_s=1000) as viewer:
        assert sender.viewer_joined.wait(PATIENCE_S)
        for piece in pieces[:20]:
            for _ in range(20):
                link.inject(noise.randbytes(noise.choice([0, 1, 15, 16, 17, 60, 1316, 1472])))
            sender.send(piece)
            assert whole.torn([fingerprint(viewer.next_frame(PATIENCE_S))]) == 0


def flipped(packet: bytes, noise: random.Random) -> bytes:
    changed = bytearray(packet)
    for _ in range(noise.randint(1, 4)):
        changed[noise.randrange(len(changed))] ^= 1 << noise.randrange(8)
    # The socket's ID: otherwise libsrt drops it before any connection sees it.
    changed[12:16] = packet[12:16]
    return bytes(changed)


def truncated(packet: bytes, noise: random.Random) -> bytes:
    return packet[: noise.randrange(16, len(packet))]


def renumbered(packet: bytes, noise: random.Random) -> bytes:
    """With the number of a packet that was not sent yet, or long ago."""
    return noise.randrange(1 << 31).to_bytes(4) + packet[4:]


def control(kind: int) -> Callable[[bytes, random.Random], bytes]:
    """Makes control packets with any content (draft-sharabayko-srt-01 3.2)."""

    def forged(packet: bytes, noise: random.Random) -> bytes:
        content = noise.randbytes(4 * noise.randrange(20))
        return (0x8000 | kind).to_bytes(2) + bytes(2) + noise.randbytes(8) + packet[12:16] + content

    return forged


@pytest.mark.parametrize(
    "forge",
    [
        pytest.param(lambda packet, _noise: packet, id="the same again"),
        pytest.param(flipped, id="bits flipped"),
        pytest.param(truncated, id="truncated"),
        pytest.param(renumbered, id="another number"),
        pytest.param(control(0), id="handshake"),
        pytest.param(control(2), id="ACK"),
        pytest.param(control(3), id="NAK"),
        pytest.param(control(5), id="shutdown"),
        pytest.param(control(7), id="drop request"),
        pytest.param(control(0x7FFF), id="user-defined"),
    ],
)
def test_forged_packets_of_the_connection_end_it_at_worst(
    port: int, pieces: list[bytes], forge: Callable[[bytes, random.Random], bytes]
) -> None:
    """Who sees an unencrypted stream can end it; the next connection is as good as any."""
    noise = random.Random(1)
    with SrtSender(port) as sender, UdpLink(port) as link:
        for attacked in (True, False):
            link.recent.clear()
            with closed_in_time(receiver(link.port, max_age_s=1000)) as viewer:
                show_the_first(pieces[0], sender, viewer)
                frames = 1
                for piece in pieces[1:30]:
                    for packet in list(link.recent)[-10:] if attacked else []:
                        link.inject(forge(packet, noise))
                    sender.send(piece)
                    try:
                        frames += viewer.next_frame(0.1 if attacked else PATIENCE_S).width == 320
                    except (StreamEndedError, NoFrameError):
                        assert attacked
                assert frames == 30 or attacked


def test_without_a_descriptor_no_socket_of_srt_is_left(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    library = libsrt.load()
    create = library.srt_create_socket

    def count() -> int:
        made.append(create())
        return made[-1]

    def exhausted(*_args: object) -> socket.socket:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(library, "srt_create_socket", count)
    monkeypatch.setattr("console.receiver.libsrt.socket.socket", exhausted)
    with pytest.raises(LocalSocketError, match="Too many open files"):
        libsrt.SrtSocket("127.0.0.1", port, 20, "")
    assert all(library.srt_getsockstate(each) >= CLOSING for each in made)


def _missing() -> None:
    raise LibsrtMissingError("libsrt is not installed")


def test_without_libsrt_the_srt_latency_applies_and_the_reason_is_given(
    port: int, pieces: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("console.receiver.libsrt.load", _missing)
    with SrtSender(port) as sender, receiver(port) as viewer:
        assert sender.viewer_joined.wait(PATIENCE_S)
        for piece in pieces[:5]:
            sender.send(piece)
        assert viewer.next_frame(PATIENCE_S).width == 320
        assert viewer.delivery == Delivery(
            kind=DeliveryChoice.SRT,
            reason="libsrt is not installed",
            remedy="Type: sudo apt-get install libsrt1.5-gnutls",
        )


@contextmanager
def no_descriptors() -> Iterator[None]:
    """This process gets no further file descriptor."""
    before, highest = resource.getrlimit(resource.RLIMIT_NOFILE)
    lowest_free = os.dup(0)
    os.close(lowest_free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest_free, highest))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (before, highest))


@pytest.fixture(params=[errno.EACCES, "srt_setsockopt", "srt_bind_acquire"])
def no_socket(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From its call on no socket can be had on this computer, for one of the reasons."""
    library, make = libsrt.load(), socket.socket

    def refused(family: int = -1, kind: int = -1, *more: Any, **others: Any) -> socket.socket:
        if kind == socket.SOCK_DGRAM:
            raise OSError(request.param, os.strerror(request.param))
        return make(family, kind, *more, **others)

    def deny() -> None:
        if isinstance(request.param, int):
            monkeypatch.setattr("console.receiver.libsrt.socket.socket", refused)
        else:
            monkeypatch.setattr(library, request.param, lambda *_: -1)

    return deny


def test_without_a_socket_for_libsrt_the_srt_latency_applies_and_the_reason_is_given(
    port: int, pieces: list[bytes], no_socket: Callable[[], None]
) -> None:
    no_socket()
    with SrtSender(port) as sender, receiver(port) as viewer:
        assert sender.viewer_joined.wait(PATIENCE_S)
        for piece in pieces[:5]:
            sender.send(piece)
        assert viewer.next_frame(PATIENCE_S).width == 320
        delivery = viewer.delivery
        assert delivery.kind is DeliveryChoice.SRT
        assert "libsrt gets no socket: " in delivery.reason
        assert "may open UDP sockets" in delivery.remedy
    with pytest.raises(UserError, match="direct delivery is not possible: libsrt gets no socket"):
        receiver(port, delivery=DeliveryChoice.DIRECT)


def test_without_descriptors_there_is_no_other_delivery(port: int) -> None:
    """The defect: GStreamer's source, which needs more of them, said that no SRT listener answers."""
    libsrt.load()
    with no_descriptors(), pytest.raises(StreamError, match="libsrt gets no socket: Too many open") as caught:
        receiver(port)
    assert caught.value.remedy.startswith("Type: ulimit -n")


def test_a_pipeline_without_descriptors_ends_the_stream(port: int) -> None:
    """The defect: its bus, which can't wait without one, was asked again without end."""
    with SrtSender(port), receiver(port, delivery=DeliveryChoice.SRT):
        pass  # GStreamer has loaded what it needs.
    with ExitStack() as stack:
        with no_descriptors():
            viewer = stack.enter_context(receiver(port, delivery=DeliveryChoice.SRT))
        with pytest.raises(StreamError, match=f"no stream from srt://127.0.0.1:{port}: GStreamer gets no"):
            viewer.next_frame(PATIENCE_S)


def test_a_fallback_without_a_socket_does_not_blame_the_robot(
    port: int, no_socket: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    local_port = free_udp_port()

    def element(kind: str, **properties: Any) -> Any:
        made = decoding.element(kind, **properties)
        if kind == "srtsrc":
            made.set_property("localaddress", NO_ADDRESS_OF_OURS)
            made.set_property("localport", local_port)
        return made

    no_socket()
    monkeypatch.setattr("console.receiver.srt.element", element)
    with (
        SrtSender(port),
        receiver(port) as viewer,
        pytest.raises(StreamError, match=r"no stream from srt://\S+: libsrt gets no socket: ") as caught,
    ):
        viewer.next_frame(PATIENCE_S)
    assert "may open UDP sockets" in caught.value.remedy


@pytest.mark.parametrize(
    ("no_socket", "remedy"),
    [
        (errno.EMFILE, "Type: ulimit -n"),
        (errno.EACCES, "Check that"),
        ("srt_setsockopt", "Check that"),
        ("srt_bind_acquire", "Check that"),
    ],
    indirect=["no_socket"],
)
def test_sockets_that_run_out_later_are_not_taken_for_a_silent_robot(
    port: int, no_socket: Callable[[], None], remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when the connection is made anew: the next one, of the session, has another delivery."""
    connect_to_it = DirectConnection._resolved

    def resolved(self: DirectConnection) -> str:
        no_socket()
        return connect_to_it(self)

    monkeypatch.setattr(DirectConnection, "_resolved", resolved)
    with (
        SrtSender(port),
        receiver(port) as viewer,
        pytest.raises(StreamError, match="libsrt gets no socket: ") as caught,
    ):
        viewer.next_frame(PATIENCE_S)
    assert caught.value.remedy.startswith(remedy)


def test_direct_alone_is_an_error_without_libsrt(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("console.receiver.libsrt.load", _missing)
    with pytest.raises(UserError, match="direct delivery is not possible: libsrt is not installed"):
        receiver(port, delivery=DeliveryChoice.DIRECT)


def test_srt_delivery_on_request(port: int, pieces: list[bytes]) -> None:
    with SrtSender(port) as sender, receiver(port, delivery=DeliveryChoice.SRT) as viewer:
        assert sender.viewer_joined.wait(PATIENCE_S)
        for piece in pieces[:5]:
            sender.send(piece)
        assert viewer.next_frame(PATIENCE_S).width == 320
        assert viewer.delivery.kind is DeliveryChoice.SRT


def test_srt_delivery_shows_torn_frames_and_says_so_of_each(
    port: int, pieces: list[bytes], whole: WholePictures
) -> None:
    """As players do. A packet of frame 40 is missing, and one of the key frame after it."""
    sent = list(pieces)
    for number, first in ((40, 188), (60, 0)):
        sent[number] = pieces[number][:first] + pieces[number][first + SRT_PAYLOAD :]

    def attempt() -> None:
        # In a stall, libsrt's socket overflows, or packets come too late.
        with no_stall():
            with SrtSender(port) as sender, receiver(port, delivery=DeliveryChoice.SRT) as viewer:
                assert sender.viewer_joined.wait(PATIENCE_S)
                play(sender, sent)
                frames = everything(viewer)
            torn = [number is None for number in whole.numbers(frames)]
            assert [frame.corrupt for frame in frames] == torn
            assert torn[:40] == [False] * 40
            assert all(torn[40:])

    undisturbed(attempt)


def test_every_frame_carries_its_capture_time(port: int) -> None:
    """The sender runs on the monotonic clock, so PTS is capture time and an hour."""
    captured_ns: set[int] = set()
    pipeline = Gst.parse_launch(
        "videotestsrc is-live=true ! video/x-raw,width=320,height=240,framerate=30/1 ! identity name=camera"
        " ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=10 ! h264parse config-interval=-1"
        f" ! mpegtsmux alignment=7 ! srtsink uri=srt://127.0.0.1:{port}?mode=listener"
        " wait-for-connection=false sync=false async=false"
    )
    pipeline.use_clock(Gst.SystemClock.obtain())
    pipeline.set_start_time(Gst.CLOCK_TIME_NONE)
    pipeline.set_base_time(0)

    def note(_pad: Any, info: Any) -> Any:
        captured_ns.add(info.get_buffer().pts)
        return Gst.PadProbeReturn.OK

    pad = pipeline.get_by_name("camera").get_static_pad("src")
    probe = pad.add_probe(Gst.PadProbeType.BUFFER, note)
    capture = CaptureClock(-3600 * 10**9, time.monotonic_ns)
    try:
        pipeline.set_state(Gst.State.PLAYING)
        with receiver(port, capture=capture) as viewer:
            frames = [viewer.next_frame(PATIENCE_S) for _ in range(20)]
    finally:
        stop(pipeline)
        pad.remove_probe(probe)
    now_ns = time.monotonic_ns()
    for frame in frames:
        assert frame.capture_ns is not None
        assert min(abs(frame.capture_ns - each) for each in captured_ns) < 1_000_000
        assert 0 < now_ns - frame.capture_ns < PATIENCE_S * 10**9
    assert len({frame.capture_ns for frame in frames}) == len(frames)


def restamped(piece: bytes, by_ticks: int) -> bytes:
    """The same with all PTS moved, over their wrap where it comes (ISO/IEC 13818-1 2.4.3.7)."""
    changed = bytearray(piece)
    for start in range(0, len(piece), 188):
        pes = start + 4 + (1 + piece[start + 4] if piece[start + 3] & 0x20 else 0)
        if piece[start + 1] & 0x40 and piece[pes : pes + 4] == b"\0\0\1\xe0":
            at = pes + 9
            upper, middle, lower = piece[at], *struct.unpack(">HH", piece[at + 1 : at + 5])
            ticks = (upper >> 1 & 7) << 30 | middle >> 1 << 15 | lower >> 1
            ticks = (ticks + by_ticks) % WRAP_TICKS
            changed[at] = upper & 0xF1 | ticks >> 30 << 1
            struct.pack_into(
                ">HH", changed, at + 1, (ticks >> 15 & 0x7FFF) << 1 | 1, (ticks & 0x7FFF) << 1 | 1
            )
    return bytes(changed)


def test_a_stream_whose_pts_wraps_goes_on_with_true_capture_times(
    port: int, pieces: list[bytes], whole: WholePictures
) -> None:
    """In the middle of it, with the age bounded as usual: no frame is lost, or taken for an old one."""
    hour_ticks, middle_ticks = 3600 * 90_000, FRAMES // 2 * 3000
    wrapping = [restamped(piece, -hour_ticks - middle_ticks) for piece in pieces]
    captured_ns = ticks_to_ns(WRAP_TICKS - middle_ticks)

    def attempt() -> None:
        begun_ns = time.monotonic_ns()
        capture = CaptureClock(0, lambda: captured_ns + time.monotonic_ns() - begun_ns)
        with no_stall():
            delivery, frames = watched(port, wrapping, Impairment(), capture=capture, max_age_s=PATIENCE_S)
            assert_every_frame(frames, whole)
            assert (delivery.rejoins, delivery.dropped_frames) == (0, 0)
        times_ns = [frame.capture_ns or 0 for frame in frames]
        expected_ns = [captured_ns + round(number * 1e9 / 30) for number in range(FRAMES)]
        assert times_ns == pytest.approx(expected_ns, rel=0, abs=20_000), "to a tick of 90 kHz, rounded twice"
        assert times_ns[0] < WRAP_TICKS * 100_000 // 9 < times_ns[-1]

    undisturbed(attempt)


def test_time_stamps_that_run_backwards_for_ever_do_no_harm(port: int, pieces: list[bytes]) -> None:
    """Each frame's is half a wrap from that of the frame before."""
    half, hour_ticks = WRAP_TICKS // 2, 3600 * 90_000
    with SrtSender(port) as sender, receiver(port, max_age_s=1e6) as viewer:
        show_the_first(restamped(pieces[0], -hour_ticks), sender, viewer)
        for number, piece in enumerate(pieces[1:20], 1):
            sender.send(restamped(piece, -hour_ticks - number * 3000 + number % 2 * half))
            assert viewer.next_frame(PATIENCE_S).width == 320
        assert viewer.delivery.rejoins == 0


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_defect_of_the_receiver_is_an_end_that_says_so(
    port: int, pieces: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_self: UnitDecoder, _unit: object) -> bool:
        raise OverflowError("-1 does not fit")

    monkeypatch.setattr(UnitDecoder, "push", fail)
    with SrtSender(port) as sender, receiver(port) as viewer:
        assert sender.viewer_joined.wait(PATIENCE_S)
        with (
            played_for_ever(sender, pieces),
            pytest.raises(StreamError, match=r"the receiver itself failed: OverflowError"),
        ):
            viewer.next_frame(PATIENCE_S)


@pytest.mark.timed
def test_over_a_narrow_link_no_frame_that_comes_is_a_second_old(port: int) -> None:
    """2500 kbit/s over 1500 kbit/s, with a queue that drops nothing: the connection is made anew in time.

    As from the robot, a viewer that joins has a key frame at once, and frames have capture times.
    """
    # The encoder's first frames are several times as large: a link as narrow as that never gets over them.
    pieces = encode("h264", STEADY_FROM + 150, gop=1, kbps=2500, pattern="snow")[STEADY_FROM:]
    whole = WholePictures(b"".join(pieces))
    first_ns = FIRST_PTS_NS + round(STEADY_FROM * FRAME_S * 1e9)

    def worst_age_s() -> float:
        begun_ns: list[int] = []
        capture = CaptureClock(-first_ns, lambda: time.monotonic_ns() - begun_ns[0] if begun_ns else None)
        with (
            SrtSender(port, latency_ms=125) as sender,
            UdpLink(port, Impairment(rate_kbps=1500, queue_s=5)) as link,
            receiver(link.port, capture=capture) as viewer,
        ):
            assert sender.viewer_joined.wait(PATIENCE_S)
            begun_ns.append(time.monotonic_ns())
            play(sender, pieces)
            frames = everything(viewer)
            assert viewer.delivery.rejoins > 0
        assert whole.torn(map(fingerprint, frames)) == 0
        return max(frame.arrival_s - (begun_ns[0] + (frame.capture_ns or 0)) / 1e9 for frame in frames)

    keeps(OLDEST_S, "s old at arrival over a narrow link", worst_age_s)
