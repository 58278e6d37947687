"""Viewers, good and bad, at the SRT listener."""

import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from console.receiver.address import StreamAddress
from console.receiver.errors import StreamError
from omniseer.preview.v1 import preview_service_pb2 as pb
from preview.pipeline.viewer_limit import HANDSHAKES_OF_HOST
from tests.support.free import udp_port_is_free
from tests.support.promise import keeps
from tests.support.receiver import Receiver
from tests.support.running_preview import RunningPreview
from tests.support.udp_link import UdpLink
from tests.support.visitors import visit
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst

PASSPHRASE = "correct horse battery staple"
WATCHERS = 5
STUTTERS = 3
STRANGERS = 3
LONGEST_PAUSE_S = 1.0
PATIENCE_S = 10.0
"""Age of the frames beyond which a watcher connects anew: a stall of the machine is no reason."""


@contextmanager
def player(port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer in a process of its own, so that it can be stopped and killed."""
    process = subprocess.Popen(
        ["gst-launch-1.0", "-q", "srtsrc", f"uri=srt://127.0.0.1:{port}", "latency=20", "!", "fakesink"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def watch_for_ever(receiver: Receiver) -> None:
    while True:
        receiver.next_frame(timeout_s=10)


def viewers(preview: RunningPreview, count: int) -> pb.ActualState:
    return preview.wait_for(lambda a: a.measurement.viewer_count == count, f"{count} viewers")


def counters(preview: RunningPreview) -> pb.Counters:
    """But for refusals: a viewer that repeats its request, because the answer was late, may count as one."""
    found = preview.running().counters
    found.viewers_refused = 0
    return found


def test_a_viewer_that_joins_does_not_wait_for_the_next_key_frame(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, {"encoders": {"key_frame_interval_s": 30}}) as preview:
        preview.enable()
        preview.running()
        for _ in range(3):
            with Watcher(preview.port) as watcher:
                # Without a key frame of its own it would wait for half a minute.
                watcher.wait_for_frames(10)


def test_ten_viewers_at_once(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    with ExitStack() as stack:
        for _ in range(9):
            stack.enter_context(player(preview.port))
        # Before the watcher: srtsink listens with a backlog of one, and would refuse one of two at once.
        viewers(preview, 9)
        watcher = stack.enter_context(Watcher(preview.port, max_age_s=PATIENCE_S))
        viewers(preview, 10)
        watcher.wait_for_frames(30)
    assert watcher.lost == []
    state = viewers(preview, 0)
    assert state.counters.faults == 0


@pytest.mark.parametrize("passphrase", ["", PASSPHRASE])
def test_viewers_beyond_the_limit_are_refused_and_counted(tmp_path: Path, passphrase: str) -> None:
    with RunningPreview(tmp_path, {"srt": {"max_viewers": 2}}) as preview:
        preview.enable(passphrase=passphrase)
        preview.running()
        address = StreamAddress("127.0.0.1", preview.port, 20, passphrase)
        # One after the other: srtsink listens with a backlog of one (srt_listen), which two at once exceed.
        with ExitStack() as leaving:
            leaving.enter_context(Receiver(address)).next_frame(timeout_s=10)
            with Watcher(preview.port, passphrase, max_age_s=PATIENCE_S) as watcher:
                watcher.wait_for_frames(5)
                with Receiver(address) as third, pytest.raises(StreamError):
                    third.next_frame(timeout_s=8)
                state = preview.wait_for(lambda a: a.counters.viewers_refused >= 1, "counted")
                assert state.measurement.viewer_count == 2
                # A caller repeats its request after 250 ms.
                log = preview.log.read_text(encoding="utf-8")
                assert re.search(r"refused \d+ viewers: 2 are connected", log)
                leaving.close()
                viewers(preview, 1)
                with Receiver(address) as next_one:
                    next_one.next_frame(timeout_s=10)
                    viewers(preview, 2)
                assert watcher.lost == []
        assert preview.running().counters.faults == 0


def test_a_wrong_passphrase_takes_no_place_for_long(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, {"srt": {"max_viewers": 1}}) as preview:
        preview.enable(passphrase=PASSPHRASE)
        preview.running()
        wrong = StreamAddress("127.0.0.1", preview.port, 20, "incorrect horse battery staple")
        with Receiver(wrong) as stranger, pytest.raises(StreamError):
            stranger.next_frame(timeout_s=8)
        with Watcher(preview.port, PASSPHRASE) as watcher:
            watcher.wait_for_frames(5)
            viewers(preview, 1)


@pytest.mark.timed
@pytest.mark.timeout(300)
def test_viewers_that_freeze_stutter_vanish_or_die_pause_none_of_the_others(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    keeps(LONGEST_PAUSE_S, "s without a frame for the others", lambda: longest_pause_of_others_s(preview))
    assert preview.running().counters.faults == 0


def longest_pause_of_others_s(preview: RunningPreview) -> float:
    # Those of an earlier attempt are given up after SRT's own 5 s.
    viewers(preview, 0)
    with ExitStack() as stack:
        frozen, dying, stuttering = (
            [stack.enter_context(player(preview.port)) for _ in range(count)] for count in (2, 2, 1)
        )
        link = stack.enter_context(UdpLink(preview.port))
        stack.enter_context(player(link.port))
        # Before the watchers: srtsink listens with a backlog of one, and would refuse one of two at once.
        viewers(preview, 6)
        watchers = [Watcher(preview.port, max_age_s=PATIENCE_S) for _ in range(WATCHERS)]
        for watcher in watchers:
            stack.enter_context(watcher)
            watcher.wait_for_frames(5)
        viewers(preview, len(watchers) + 6)
        before = [len(watcher.arrivals_s) for watcher in watchers]
        for process in frozen:
            process.send_signal(signal.SIGSTOP)
        for process in dying:
            process.kill()
        link.impairment.loss = link.impairment.control_loss = 1.0
        for number in (signal.SIGSTOP, signal.SIGCONT) * STUTTERS:
            stuttering[0].send_signal(number)
            watchers[0].wait_for_frames(10)
        # All but the stuttering one are given up after SRT's own 5 s.
        viewers(preview, len(watchers) + 1)
        assert [watcher.lost for watcher in watchers] == [[]] * WATCHERS
        return max(
            later - sooner
            for watcher, earlier in zip(watchers, before, strict=True)
            for sooner, later in pairwise(watcher.arrivals_s[earlier - 1 :])
        )


def test_comers_and_goers(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    with Watcher(preview.port, max_age_s=PATIENCE_S) as watcher:
        watcher.wait_for_frames(5)
        for _ in range(20):
            with Receiver(StreamAddress("127.0.0.1", preview.port, latency_ms=20)) as guest:
                guest.next_frame(timeout_s=10)
        watcher.wait_for_frames(5)
        assert watcher.lost == []
    assert counters(preview) == pb.Counters(starts=1)


@pytest.mark.timed
@pytest.mark.timeout(300)
def test_two_hundred_come_and_go_within_one_stream(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    keeps(LONGEST_PAUSE_S, "s without a frame for another", lambda: longest_pause_of_another_s(preview))
    assert counters(preview) == pb.Counters(starts=1)
    preview.disable()
    preview.disabled()
    assert udp_port_is_free(preview.port)


def longest_pause_of_another_s(preview: RunningPreview) -> float:
    with Watcher(preview.port, max_age_s=PATIENCE_S) as watcher:
        watcher.wait_for_frames(5)
        # SRT keeps a closed connection, some hundred KiB, for a few seconds: this is the level of that.
        visit(preview.port, 200)
        viewers(preview, 1)
        descriptors, resident = preview.descriptors(), preview.resident_mib()
        visit(preview.port, 200)
        watcher.wait_for_frames(5)
        assert watcher.lost == []
        viewers(preview, 1)
        wait_until(lambda: preview.descriptors() <= descriptors, "as many descriptors as before")
        # The faster they come, the more of them SRT still keeps.
        wait_until(
            lambda: preview.resident_mib() - resident < 40, "little more memory; 150 MiB, were all kept"
        )
        print(f"200 visits: pause of another {watcher.longest_pause_s:.2f} s")
        return watcher.longest_pause_s


def test_garbage_on_the_port_is_ignored(preview: RunningPreview) -> None:
    preview.enable()
    preview.running()
    with (
        Watcher(preview.port, max_age_s=PATIENCE_S) as watcher,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        watcher.wait_for_frames(5)
        for size in range(1400):
            stranger.sendto(bytes([size % 256]) * size, ("127.0.0.1", preview.port))
        # A handshake that is cut short.
        stranger.sendto(
            b"\x80\x00" + bytes(14) + b"\x00\x00\x00\x05" + bytes(12), ("127.0.0.1", preview.port)
        )
        watcher.wait_for_frames(30)
        assert watcher.lost == []
    assert preview.running().counters.faults == 0


@pytest.mark.parametrize("key_length_bytes", [16, 32])
def test_a_passphrase_admits_only_viewers_that_know_it(tmp_path: Path, key_length_bytes: int) -> None:
    with RunningPreview(tmp_path, {"srt": {"key_length_bytes": key_length_bytes}}) as preview:
        preview.enable(passphrase=PASSPHRASE)
        state = preview.running()
        assert state.stream.encrypted
        for wrong in ("", "incorrect horse battery staple"):
            address = StreamAddress("127.0.0.1", preview.port, latency_ms=20, passphrase=wrong)
            with Receiver(address) as stranger, pytest.raises(StreamError):
                stranger.next_frame(timeout_s=8)
        with Watcher(preview.port, PASSPHRASE) as watcher:
            watcher.wait_for_frames(10)
        assert preview.running().counters.faults == 0
        assert PASSPHRASE not in preview.log.read_text(encoding="utf-8")


def test_another_passphrase_disconnects_viewers_with_the_old_one(preview: RunningPreview) -> None:
    preview.enable(passphrase=PASSPHRASE)
    preview.running()
    with Receiver(StreamAddress("127.0.0.1", preview.port, 20, PASSPHRASE)) as old:
        old.next_frame(timeout_s=10)
        preview.enable(passphrase="another horse battery")
        state = preview.running(revision=preview.revision)
        with pytest.raises(StreamError):
            watch_for_ever(old)
    with Watcher(preview.port, "another horse battery") as watcher:
        watcher.wait_for_frames(5)
    assert state.stream.encrypted


def test_a_port_that_is_taken_is_named_and_used_when_it_is_free(preview: RunningPreview) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", preview.port))
        preview.enable()
        state = preview.faulted(f"UDP port {preview.port} on 127.0.0.1 can't be used")
        assert f"sport = :{preview.port}" in state.last_error
        assert state.counters.fallbacks == 0
    freed_at = time.monotonic()
    preview.enable()
    preview.wait_for(lambda a: a.state == pb.LIFECYCLE_STATE_RUNNING, "running")
    assert time.monotonic() - freed_at < 10


def test_strangers_without_the_passphrase_keep_no_viewer_out(tmp_path: Path) -> None:
    """From another address, with as many handshakes as they can begin."""
    with RunningPreview(tmp_path, {"srt": {"max_viewers": 2}}) as preview:
        preview.enable(passphrase=PASSPHRASE)
        preview.running()
        with ExitStack() as leaving:
            for _ in range(STRANGERS):
                leaving.enter_context(stranger(preview.port))
            preview.wait_for(lambda a: a.counters.viewers_refused > HANDSHAKES_OF_HOST, "the strangers call")
            with Watcher(preview.port, PASSPHRASE) as watcher:
                watcher.wait_for_frames(5)
                viewers(preview, 1)


@contextmanager
def stranger(port: int) -> Iterator[subprocess.Popen[bytes]]:
    """Begins a handshake from ports of its own again and again, each without waiting for the last."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.support.srt_stranger", "127.0.0.2", str(port)],
        stdin=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
