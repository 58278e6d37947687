"""The bit rate follows a real SRT link that turns bad and good again.

A machine that stalls looks like a link with a queue, which is right, and not what these tests are about.
"""

import re
from pathlib import Path

import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from recorder.video.stream import STREAM_NOTE
from tests.support.running_preview import RunningPreview
from tests.support.tap_reader import TapRecording
from tests.support.udp_link import Impairment, UdpLink
from tests.support.undisturbed import without_stall
from tests.support.watcher import Watcher

pytestmark = [pytest.mark.gst, pytest.mark.timeout(300)]


def test_the_first_viewer_gets_a_low_rate_first_and_soon_the_target(tmp_path: Path) -> None:
    def attempt(directory: Path) -> None:
        with RunningPreview(directory, small=False) as preview:
            preview.enable(pb.PROFILE_BALANCED)
            assert preview.running().stream.target_bitrate_kbps == 2500
            # One watch from before the viewer on: the rate at the start lasts for a second.
            with preview.watching(60.0) as next_state:
                next_state(lambda a: a.stream.target_bitrate_kbps == 2500, "the rate without a viewer")
                with Watcher(preview.port) as watcher:
                    next_state(lambda a: a.stream.target_bitrate_kbps == 800, "the start")
                    stream = next_state(lambda a: a.stream.target_bitrate_kbps == 2500, "the target").stream
                    assert stream.bitrate_reason == ""
                    watcher.wait_for_frames(30)
                    preview.enable(pb.PROFILE_HIGH_QUALITY)
                    next_state(lambda a: a.stream.target_bitrate_kbps == 4500, "the higher target")
                    assert watcher.lost == []

    without_stall(attempt, tmp_path)


def test_a_bad_link_gets_less_and_a_good_one_more(tmp_path: Path) -> None:
    def attempt(directory: Path) -> None:
        with RunningPreview(directory) as preview, UdpLink(preview.port) as link:
            preview.enable()
            preview.running()
            # A viewer that calls before there is a listener gives up after 3 s, and calls again.
            with Watcher(link.port) as watcher:
                watcher.wait_for_frames(30)
                link.impairment.loss = 0.4
                # A round trip that was long by itself may have lowered it before the loss does.
                state = preview.wait_for(
                    lambda a: a.stream.target_bitrate_kbps < 600 and "% loss" in a.stream.bitrate_reason,
                    "a lower rate",
                )
                change = re.search(r"(\d+) kbit/s -> (\d+) kbit/s", state.stream.bitrate_reason)
                assert change
                before_kbps, after_kbps = map(int, change.groups())
                assert before_kbps > after_kbps == state.stream.target_bitrate_kbps
                low = preview.wait_for(lambda a: a.stream.target_bitrate_kbps == 150, "the floor").stream
                assert low.target_bitrate_kbps == 150
                link.impairment.loss = 0.0
                state = preview.wait_for(lambda a: a.stream.target_bitrate_kbps > 150, "a higher rate")
                assert "the link is quiet" in state.stream.bitrate_reason
                assert state.counters.starts == 1
                assert watcher.lost == []

    without_stall(attempt, tmp_path)


def test_a_recording_keeps_its_floor_under_the_bit_rate_and_gives_it_up_with_its_end(tmp_path: Path) -> None:
    floor_kbps = 400
    """Above those of the profiles: 150 of balanced, 200 of high-quality."""

    def held(actual: pb.ActualState) -> bool:
        stream = actual.stream
        words = f"at the floor of {floor_kbps} kbit/s"
        return stream.target_bitrate_kbps == floor_kbps and words in stream.bitrate_reason

    def attempt(directory: Path) -> None:
        tap = directory / "tap.sock"
        settings = {"video_tap": {"socket": str(tap), "floor_kbps": floor_kbps}}
        with (
            RunningPreview(directory, settings) as preview,
            UdpLink(preview.port) as link,
            Watcher(link.port) as watcher,
        ):
            preview.enable()
            preview.running()
            watcher.wait_for_frames(30)
            with TapRecording(tap) as recording, preview.watching(120.0) as next_state:
                recording.wait_for_frames(10)
                link.impairment.loss = 0.4
                next_state(held, "the recording's floor")
                preview.enable(pb.PROFILE_HIGH_QUALITY)
                next_state(lambda a: a.stream.target_bitrate_kbps > floor_kbps, "the start of the profile")
                next_state(held, "the recording's floor, in another profile")
            noted = [each.values for each in recording.notes(STREAM_NOTE)]
            assert min(int(each["bitrate_kbps"]) for each in noted if "bitrate_kbps" in each) == floor_kbps
            preview.wait_for(lambda a: a.stream.target_bitrate_kbps < floor_kbps, "the profile's own floor")

    without_stall(attempt, tmp_path)


@pytest.mark.timed
def test_random_loss_on_a_wide_link_costs_nothing(tmp_path: Path) -> None:
    def attempt(directory: Path) -> None:
        bad = Impairment(delay_s=0.02, loss=0.03, control_loss=0.03)
        with (
            RunningPreview(directory) as preview,
            UdpLink(preview.port, bad) as link,
            Watcher(link.port, latency_ms=125) as watcher,
        ):
            preview.enable()
            preview.running()
            watcher.wait_for_frames(300)
            state = preview.wait_for(lambda a: a.measurement.worst_loss_percent > 0, "loss is reported")
            assert (state.stream.target_bitrate_kbps, state.stream.bitrate_reason) == (600, "")

    without_stall(attempt, tmp_path)


def test_a_narrow_link_gets_what_it_carries(tmp_path: Path) -> None:
    def attempt(directory: Path) -> None:
        with (
            RunningPreview(directory) as preview,
            UdpLink(preview.port, Impairment(delay_s=0.02)) as link,
            Watcher(link.port, latency_ms=125) as watcher,
        ):
            preview.enable()
            preview.running()
            watcher.wait_for_frames(60)
            link.impairment.rate_kbps = 450
            state = preview.wait_for(lambda a: a.stream.target_bitrate_kbps < 450, "a lower rate")
            assert re.search("RTT|loss", state.stream.bitrate_reason)
            preview.wait_for(lambda a: a.measurement.worst_rtt_ms < 80, "the queue has drained")
            watcher.wait_for_frames(150)
            # A queue that grew for long, as on a busy machine, brings the first decrease down to the floor.
            preview.wait_for(lambda a: 225 <= a.stream.target_bitrate_kbps < 450, "half of it and more", 60)

    without_stall(attempt, tmp_path)


def test_switched_off_the_bit_rate_stays(tmp_path: Path) -> None:
    with (
        RunningPreview(tmp_path, {"adaptive": {"enabled": False}}) as preview,
        UdpLink(preview.port, Impairment(loss=0.4)) as link,
        Watcher(link.port) as watcher,
    ):
        preview.enable()
        preview.running()
        watcher.wait_for_frames(30)
        state = preview.wait_for(lambda a: a.measurement.worst_loss_percent > 8, "loss is reported")
        assert (state.stream.target_bitrate_kbps, state.stream.bitrate_reason) == (600, "")
