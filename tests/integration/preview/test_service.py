"""The service's life, seen from the gateway's side of the socket."""

from functools import partial
from pathlib import Path

import grpc
import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.free import udp_port_is_free
from tests.support.promise import keeps
from tests.support.recording import record
from tests.support.running_preview import RunningPreview
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst

WINDOW_ROUNDS = 10


def test_nothing_exists_until_it_is_enabled(preview: RunningPreview) -> None:
    state = preview.disabled()
    assert (state.applied_revision, state.last_error) == (0, "")
    assert not state.HasField("stream")
    assert not state.HasField("encoder")
    assert not state.HasField("measurement")
    assert (state.listener.port, state.listener.latency_ms) == (preview.port, 20)
    assert udp_port_is_free(preview.port)


def test_enable_serves_frames_and_disable_frees_the_port(preview: RunningPreview) -> None:
    answer = preview.enable(pb.PROFILE_BALANCED)
    assert answer.state == pb.LIFECYCLE_STATE_STARTING
    assert answer.applied_revision == 1
    state = preview.running()
    assert (state.stream.width_px, state.stream.height_px, state.stream.fps) == (320, 240, 30)
    assert state.stream.target_bitrate_kbps == 600
    assert state.stream.codec == pb.CODEC_H264
    assert (state.encoder.name, state.encoder.wanted, state.encoder.fallback_reason) == ("x264", "x264", "")
    with Watcher(preview.port) as watcher:
        watcher.wait_for_frames(10)
        measured = preview.wait_for(lambda a: a.measurement.viewer_count == 1, "one viewer").measurement
        assert measured.HasField("worst_rtt_ms")
        assert measured.HasField("worst_loss_percent")
    gone = preview.wait_for(lambda a: a.measurement.viewer_count == 0, "no viewer").measurement
    assert not gone.HasField("worst_rtt_ms")
    preview.disable()
    after = preview.disabled()
    assert udp_port_is_free(preview.port)
    assert after.profile == pb.PROFILE_BALANCED
    assert after.counters == pb.Counters(starts=1)


def test_the_figures_are_those_of_the_stream(preview: RunningPreview) -> None:
    preview.enable(pb.PROFILE_BALANCED)
    preview.running()
    state = preview.wait_for(lambda a: 20 < a.measurement.fps < 40, "a rate near 30")
    assert state.measurement.bitrate_kbps > 50
    assert state.measurement.last_frame_age_ms < 5000


def test_the_same_revision_changes_nothing(preview: RunningPreview) -> None:
    desired = pb.DesiredState(revision=7, enabled=True, profile=pb.PROFILE_BALANCED)
    preview.apply(desired)
    preview.running()
    other = pb.DesiredState(revision=7, enabled=False)
    assert preview.apply(desired).state == pb.LIFECYCLE_STATE_RUNNING
    assert preview.apply(other).state == pb.LIFECYCLE_STATE_RUNNING
    assert preview.running().counters.starts == 1


def test_an_unknown_profile_is_refused_and_changes_nothing(preview: RunningPreview) -> None:
    for profile in (0, 17):
        request = pb.DesiredState(revision=3, enabled=True, profile=profile)  # type: ignore[arg-type]
        with pytest.raises(grpc.RpcError) as refusal:
            preview.apply(request)
        assert refusal.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    assert preview.disabled().applied_revision == 0


def test_on_off_on_in_one_breath_ends_on(preview: RunningPreview) -> None:
    for profile in (pb.PROFILE_BALANCED, pb.PROFILE_LOW_BW):
        preview.enable(profile)
        preview.disable()
    preview.enable(pb.PROFILE_HIGH_QUALITY)
    state = preview.wait_for(
        lambda a: a.state == pb.LIFECYCLE_STATE_RUNNING and a.profile == pb.PROFILE_HIGH_QUALITY,
        "the last request",
    )
    assert state.applied_revision == 5
    assert state.counters.faults == 0
    with Watcher(preview.port) as watcher:
        watcher.wait_for_frames(5)


@pytest.mark.timed
def test_a_profile_switch_keeps_every_viewer(preview: RunningPreview) -> None:
    def runs_at(fps: int, actual: pb.ActualState) -> bool:
        return abs(actual.measurement.fps - fps) < fps / 5 and actual.stream.fps == fps

    def longest_pause_s() -> float:
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(10)
            for profile, fps in (
                (pb.PROFILE_HIGH_QUALITY, 60),
                (pb.PROFILE_LOW_BW, 15),
                (pb.PROFILE_BALANCED, 30),
            ):
                preview.enable(profile)
                state = preview.wait_for(partial(runs_at, fps), f"{fps} fps")
                assert state.state == pb.LIFECYCLE_STATE_RUNNING
                watcher.wait_for_frames(10)
            assert watcher.lost == []
            return watcher.longest_pause_s

    preview.enable(pb.PROFILE_BALANCED)
    preview.running()
    keeps(0.5, "s without a picture while the profile is switched", longest_pause_s)
    assert preview.running().counters.starts == 1


def test_unwatched_it_stops_by_itself_and_the_same_request_enables_it_again(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, {"timeouts": {"without_gateway_s": 3.0}}) as preview:
        desired = pb.DesiredState(revision=4, enabled=True, profile=pb.PROFILE_BALANCED)
        preview.apply(desired)
        wait_until(lambda: "stopped by itself" in preview.log.read_text(encoding="utf-8"), "unwatched")
        state = preview.disabled()
        assert "no gateway has watched it" in state.last_error
        assert state.applied_revision == 0
        preview.apply(desired)
        assert preview.running().last_error == ""


def test_encoders_are_listed_in_the_order_of_preference(preview: RunningPreview) -> None:
    answer = preview.stub.ListEncoders(pb.ListEncodersRequest(), timeout=30)
    first, *others = answer.encoders
    assert (first.name, first.family, first.element, first.codec) == (
        "x264",
        "x264",
        "x264enc",
        pb.CODEC_H264,
    )
    assert first.proven
    assert first.HasField("first_byte_ms")
    missing = next(one for one in others if one.name == "mpp-h265")
    assert (missing.present, missing.proven) == (False, False)
    assert missing.reason == "there is no GStreamer element mpph265enc"
    assert not missing.HasField("first_byte_ms")


def test_h265_in_software_from_end_to_end(tmp_path: Path) -> None:
    encoders = {"order": ["x264", "x265"], "codec": "h265", "probe_timeout_s": 40}
    with RunningPreview(tmp_path, {"encoders": encoders}) as preview:
        preview.enable()
        state = preview.running()
        assert state.stream.codec == pb.CODEC_H265
        assert (state.encoder.name, state.encoder.wanted) == ("x265", "x265")
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(30)
        assert set(watcher.codecs) == {"h265"}


@pytest.mark.timeout(300)
def test_again_and_again_leaves_nothing_behind(preview: RunningPreview) -> None:
    """The short form of the soak (bench/soak/programs.py)."""
    memory_mib: list[float] = []

    def one_round() -> None:
        preview.enable(pb.PROFILE_LOW_BW)
        preview.running(revision=preview.revision)
        record(preview.port, 0.0)
        preview.enable(pb.PROFILE_BALANCED)
        preview.wait_for(lambda a: a.profile == pb.PROFILE_BALANCED, "another profile")
        preview.disable()
        preview.disabled()
        memory_mib.append(preview.resident_mib())

    def lowest_mib(rounds: int) -> float:
        for _ in range(rounds):
            one_round()
        # libsrt keeps what is closed for some seconds, so memory goes up and down: the lowest figures speak.
        return min(memory_mib[-WINDOW_ROUNDS:])

    # The allocators' arenas grow for about forty rounds, by steps of up to 3 MiB, and then no more; for
    # longer where threads wait for a processor. What is left behind grows for ever.
    before_mib = lowest_mib(5 * WINDOW_ROUNDS)
    descriptors = preview.descriptors()
    for _ in range(4):
        after_mib = lowest_mib(3 * WINDOW_ROUNDS)
        grown_mib, before_mib = after_mib - before_mib, after_mib
        if grown_mib < 3:
            break
    assert grown_mib < 3
    wait_until(lambda: preview.descriptors() <= descriptors, "as many descriptors as before")
    assert threads(preview) < 60
    print(f"{grown_mib:.1f} MiB more after {3 * WINDOW_ROUNDS} rounds")


def threads(preview: RunningPreview) -> int:
    return len(list(Path(f"/proc/{preview.process.pid}/task").iterdir()))
