"""The viewer's session against the real gateway, preview service and SRT: what an operator lives through."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from console.client.results import PreviewState
from console.receiver.address import StreamAddress
from console.receiver.recording import Recording
from console.viewer.playback import PlaybackState
from console.viewer.session import VideoSession
from tests.integration.console.viewer.conftest import following
from tests.support.free import free_udp_port
from tests.support.judges import decoded_frames
from tests.support.promise import keeps
from tests.support.streams import SrtSender, encode
from tests.support.undisturbed import no_stall, undisturbed
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until
from tests.unit.console.viewer.previews import preview

pytestmark = pytest.mark.gst

FREEZE_SHOWN_WITHIN_S = 0.7
BACK_WITHIN_S = 1.5


def is_live(session: VideoSession) -> bool:
    return session.playback().state is PlaybackState.LIVE


def becomes(session: VideoSession, state: PlaybackState) -> float:
    """Waits for a state and returns when it was seen."""
    wait_until(lambda: session.playback().state is state, f"{state}; it is {session.playback()}", 25)
    return time.monotonic()


def keeps_its_limits(of_its_limit: Callable[[], float]) -> None:
    """Judges how soon a freeze shows and ends; `of_its_limit` returns the larger share of its limit."""
    what = "time until a freeze shows, or ends, of its limit"
    keeps(1.0, what, of_its_limit, per_stalled_s=1 / FREEZE_SHOWN_WITHIN_S)


def test_it_follows_the_preview_from_off_to_on_and_back(ground: VideoGround, session: VideoSession) -> None:
    becomes(session, PlaybackState.OFF)
    ground.switch_on()
    becomes(session, PlaybackState.LIVE)
    frame = session.latest_frame()
    assert frame is not None
    assert (frame.width, frame.height, frame.codec) == (320, 240, "h264")
    assert frame.stride == 4 * frame.width, "four bytes a pixel: BGRx"
    assert frame.decoder == "avdec_h264"
    ground.switch_off()
    becomes(session, PlaybackState.OFF)
    assert session.latest_frame() is None


@pytest.mark.timeout(300)
@pytest.mark.timed
def test_a_killed_preview_is_a_freeze_at_once_and_back_at_once(
    ground: VideoGround, session: VideoSession
) -> None:
    def of_its_limit() -> float:
        if ground.preview.process.poll() is not None:  # an attempt has failed in between
            ground.preview.start_again()
            ground.preview.running()
        becomes(session, PlaybackState.LIVE)
        redials = session.redials
        ground.kill_preview()
        died_s = time.monotonic()
        wait_until(lambda: not is_live(session), "the freeze shows")
        frozen_s = time.monotonic() - died_s
        # The gateway says why a moment later; the frame that stands still stays marked as one.
        becomes(session, PlaybackState.FAULTED)
        assert session.playback().frame_age_s is not None
        assert "unreachable" in session.playback().reason
        wait_until(lambda: session.redials > redials, "called again")

        ground.preview.start_again()
        ground.preview.running()
        returned_s = time.monotonic()
        back_s = becomes(session, PlaybackState.LIVE) - returned_s
        return max(frozen_s / FREEZE_SHOWN_WITHIN_S, back_s / BACK_WITHIN_S)

    ground.switch_on()
    keeps_its_limits(of_its_limit)


@pytest.mark.timeout(300)
@pytest.mark.timed
@pytest.mark.parametrize("redials", [1, 3])
def test_a_preview_that_stands_still_is_a_freeze_and_goes_on(
    ground: VideoGround, session: VideoSession, redials: int
) -> None:
    """For a moment, and for longer than SRT itself keeps a connection."""

    def of_its_limit() -> float:
        becomes(session, PlaybackState.LIVE)
        before = session.redials
        ground.preview.process.send_signal(signal.SIGSTOP)
        stopped_s = time.monotonic()
        try:
            wait_until(lambda: not is_live(session), "the freeze shows")
            frozen_s = time.monotonic() - stopped_s
            wait_until(lambda: session.redials >= before + redials, "called again")
        finally:
            ground.preview.process.send_signal(signal.SIGCONT)
        went_on_s = time.monotonic()
        back_s = becomes(session, PlaybackState.LIVE) - went_on_s
        return max(frozen_s / FREEZE_SHOWN_WITHIN_S, back_s / BACK_WITHIN_S)

    ground.switch_on()
    keeps_its_limits(of_its_limit)


def test_frames_go_on_without_the_gateway(ground: VideoGround, session: VideoSession) -> None:
    ground.switch_on()
    becomes(session, PlaybackState.LIVE)
    ground.gateway.kill()
    wait_until(lambda: session.playback().reason, "the gateway is missed")
    becomes(session, PlaybackState.LIVE)
    ground.kill_preview()
    becomes(session, PlaybackState.UNREACHABLE)
    ground.preview.start_again()
    ground.start_gateway()
    becomes(session, PlaybackState.OFF)


def test_the_codec_may_change_with_the_stream(
    ground: VideoGround, session: VideoSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground.switch_on()
    becomes(session, PlaybackState.LIVE)
    ground.kill_preview()
    monkeypatch.setenv("PREVIEW__ENCODERS__ORDER", '["x265"]')
    ground.preview.start_again()
    wait_until(lambda: (frame := session.latest_frame()) and frame.codec == "h265", "H.265 is shown", 30)
    becomes(session, PlaybackState.LIVE)


def test_the_right_passphrase_comes_with_the_endpoint() -> None:
    port, pieces = free_udp_port(), encode("h264", 30)
    session = VideoSession()
    session.start()
    try:
        with SrtSender(port, passphrase="the right one") as sender:
            session.follow(preview(PreviewState.RUNNING, port=port, passphrase="a wrong passphrase"))
            becomes(session, PlaybackState.BLOCKED)
            assert "did not accept the passphrase" in session.playback().reason
            session.follow(preview(PreviewState.RUNNING, port=port, passphrase="the right one"))
            assert sender.viewer_joined.wait(20)

            # Again and again: a connection that is being made gets nothing of what is sent.
            def live_with_more() -> bool:
                sender.send(pieces[0])
                return is_live(session)

            wait_until(live_with_more, "the stream is shown", 25)
    finally:
        assert session.close()


def test_a_recording_goes_on_over_connections(ground: VideoGround, tmp_path: Path) -> None:
    recording = Recording(tmp_path / "drive.ts")
    with following(ground.target, recording=recording) as session:
        ground.switch_on()
        wait_until(lambda: session.frames >= 30, "frames")
        ground.kill_preview()
        wait_until(lambda: session.redials >= 1, "called again")
        ground.preview.start_again()
        before = session.frames
        wait_until(lambda: session.frames >= before + 30, "frames again", 30)
        kept_while_live = recording.size_bytes
        seen = session.frames
    recording.close()
    assert recording.error is None
    assert recording.gaps == 0
    assert recording.size_bytes >= kept_while_live > 0
    assert recording.size_bytes % 188 == 0
    # A frame that waits in the session is dropped for a newer one; the file has them all.
    assert decoded_frames(recording.file) >= seen >= 60


@pytest.mark.timeout(300)
def test_a_full_disk_ends_the_recording_alone(ground: VideoGround) -> None:
    def attempt() -> None:
        recording = Recording(Path("/dev/full"))
        # A session redials after a second without a frame.
        with no_stall(), following(ground.target, recording=recording) as session:
            wait_until(lambda: recording.error, "the disk is full")
            before = session.frames
            wait_until(lambda: session.frames >= before + 30, "frames go on")
            assert session.redials == 0
        recording.close()
        assert "ended early: No space left" in str(recording.error)

    ground.switch_on()
    undisturbed(attempt)


def test_a_disk_that_does_not_answer_delays_neither_the_video_nor_the_end(ground: VideoGround) -> None:
    """A terminal without a reader takes a few kB; then writing blocks for ever."""
    master, slave = os.openpty()
    recording = Recording(Path(os.ttyname(slave)))
    try:
        with following(ground.target, recording=recording) as session:
            ground.switch_on()
            becomes(session, PlaybackState.LIVE)
            ground.kill_preview()
            wait_until(lambda: session.redials >= 1, "called again, with a disk that hangs")
            ground.preview.start_again()
            before = session.frames
            wait_until(lambda: session.frames >= before + 30, "frames go on", 30)
        recording.close(timeout_s=0.2)
        assert "the disk does not answer" in str(recording.error)
    finally:
        os.close(master)
        os.close(slave)


@pytest.mark.timed
def test_closing_takes_no_time_whatever_it_does() -> None:
    def took_s() -> float:
        absent = StreamAddress("127.0.0.1", free_udp_port(), 20)
        session = VideoSession()
        session.start()
        session.follow(preview(PreviewState.RUNNING, port=absent.port))
        wait_until(lambda: session.redials >= 1, "no answer, it has redialed")
        begun_s = time.monotonic()
        assert session.close()
        return time.monotonic() - begun_s

    keeps(1.5, "s to close a session", took_s)


def test_an_encrypted_stream_needs_nothing_more(tmp_path: Path) -> None:
    """Each session has a passphrase of its own; the endpoint brings it, also the next one."""
    with (
        video_ground(tmp_path, gateway={"preview": {"encrypted": True}}) as ground,
        following(ground.target) as session,
    ):
        for _ in range(2):
            ground.switch_on()
            becomes(session, PlaybackState.LIVE)
            ground.switch_off()
            becomes(session, PlaybackState.OFF)
