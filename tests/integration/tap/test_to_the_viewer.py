"""From a ROS topic to decoded frames over SRT, with real rclpy, tap and preview, and what can fail there."""

import math
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.colour_eye import Eye
from tests.support.mpegts import analyse
from tests.support.recording import record
from tests.support.ros_camera import RosCamera, compressed, jpeg, picture, ros_camera
from tests.support.running_preview import RunningPreview
from tests.support.running_tap import RunningTap
from tests.support.undisturbed import without_stall
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.gst]

TOPIC = "/front/image_raw"
HOUR_S = 3600
WRAP_S = 2**33 / 90_000
PATIENT = {"source_silence_s": 6, "encoder_silence_s": 6}
"""A publisher or an encoder that stands still with the machine for seconds is no fault here."""


def ros(topic: str = TOPIC, **more: Any) -> dict[str, Any]:
    return {"kind": "ros", "topic": topic, **more}


@contextmanager
def preview_of(tap: RunningTap, directory: Path, **settings: Any) -> Iterator[RunningPreview]:
    """A preview with one ROS camera unless the settings say otherwise."""
    own = {"camera_tap": {"socket": str(tap.socket)}, "timeouts": PATIENT}
    with RunningPreview(directory, own | ({"source": ros()} | settings)) as preview:
        yield preview


@contextmanager
def shown(tap: RunningTap, directory: Path, **settings: Any) -> Iterator[tuple[RunningPreview, Eye]]:
    """A preview that shows its camera, and a viewer."""
    with preview_of(tap, directory, **settings) as preview:
        preview.enable()
        preview.running()
        with Eye(preview.port) as eye:
            eye.more_frames(5)
            yield preview, eye


def off_s(pts_s: float, published: RosCamera) -> float:
    """How far a time of presentation is from the nearest stamp; it wraps, as the stream's does."""
    return min(abs(math.remainder(pts_s - HOUR_S - stamp, WRAP_S)) for stamp in published.captured_s)


def camera(actual: pb.ActualState, name: str) -> tuple[str, str]:
    found = next(each for each in actual.cameras if each.name == name)
    return pb.CameraState.Name(found.state).removeprefix("CAMERA_STATE_"), found.error


def test_a_topic_is_shown_and_its_stamps_are_the_capture_times(tap: RunningTap, tmp_path: Path) -> None:
    with ros_camera(TOPIC) as published, shown(tap, tmp_path) as (preview, eye):
        eye.sees("red")
        published.age_s = 0.25
        # The capture times go on once these stamps are later than those before.
        wait_until(lambda: 200 < preview.running().measurement.last_frame_age_ms < 1000, "the age")
        units = analyse(record(preview.port, 3.0)).access_units
        errors = [off_s(unit.pts / 90_000, published) for unit in units]
        assert len(errors) > 10
        print(f"{len(errors)} frames, {max(errors) * 1e6:.0f} us between stamp and PTS at the most")
        assert max(errors) < 0.001
        counts = tap.state()["topics"][TOPIC]
        assert counts["frames"] > 30
        assert sum(counts["refused"].values()) == 0
        assert preview.running().counters == pb.Counters(starts=1)


def test_the_topic_is_subscribed_only_while_the_camera_is_wanted(tap: RunningTap, tmp_path: Path) -> None:
    with ros_camera(TOPIC) as published, preview_of(tap, tmp_path) as preview:
        tap.wait_for(lambda state: state["wanted"] == [], "nothing is wanted")
        assert published.subscribers == 0
        for _ in range(3):
            preview.enable()
            preview.running()
            assert published.subscribers == 1
            assert tap.state()["wanted"] == [TOPIC]
            preview.disable()
            preview.disabled()
            wait_until(lambda: published.subscribers == 0, "no subscription")
        tap.wait_for(lambda state: state["wanted"] == [], "nothing is wanted")
        threads, descriptors = tap.threads(), tap.descriptors()
        own = preview.descriptors()
        for _ in range(4):
            preview.enable()
            preview.running()
            preview.disable()
            preview.disabled()
        wait_until(lambda: tap.threads() <= threads and tap.descriptors() <= descriptors, "no leftovers")
        wait_until(lambda: preview.descriptors() <= own + 2, "no leftovers in the preview")


def test_size_and_rate_change_while_it_is_shown(tap: RunningTap, tmp_path: Path) -> None:
    with ros_camera(TOPIC) as published, shown(tap, tmp_path) as (preview, eye):
        for colour, size in (
            ("green", (641, 479)),
            ("blue", (64, 48)),
            ("red", (1280, 720)),
            ("green", (320, 240)),
        ):
            published.shows = picture(colour, *size)
            eye.sees(colour)
        published.hz = 10.0
        preview.wait_for(lambda a: 7 < a.measurement.fps < 13, "the new rate")
        assert preview.running().counters == pb.Counters(starts=1)
        assert eye.lost == []


@pytest.mark.parametrize("form", ["jpeg", "png"])
def test_compressed_pictures_are_shown(tap: RunningTap, tmp_path: Path, form: str) -> None:
    topic = f"{TOPIC}/compressed"
    message = compressed(jpeg("green", form=form), f"bgr8; {form} compressed bgr8")
    with ros_camera(topic, message) as published, shown(tap, tmp_path, source=ros(topic)) as (preview, eye):
        eye.sees("green")
        published.shows = compressed(jpeg("blue", 640, 480, form), form)
        eye.sees("blue")
        assert preview.running().counters == pb.Counters(starts=1)


@pytest.mark.parametrize("encoding", ["bgr8", "rgba8", "bgra8", "nv12", "uyvy", "yuyv", "bayer_rggb8"])
def test_colours_are_those_of_the_encoding(tap: RunningTap, tmp_path: Path, encoding: str) -> None:
    with ros_camera(TOPIC, picture("red", encoding=encoding)), shown(tap, tmp_path) as (_, eye):
        eye.sees("red")


def test_a_killed_tap_is_a_source_fault_and_its_return_mends_it(tap: RunningTap, tmp_path: Path) -> None:
    with ros_camera(TOPIC), shown(tap, tmp_path) as (preview, eye):
        tap.kill()
        # At once: its silence alone would be another fault.
        preview.faulted("the camera tap has closed the connection")
        preview.faulted("no camera tap serves")
        tap.start_again()
        preview.running()
        eye.sees("red")


def test_a_frozen_tap_is_a_source_fault_too(tap: RunningTap, tmp_path: Path) -> None:
    settings = {"timeouts": {"start_s": 5, "source_silence_s": 3}}
    with ros_camera(TOPIC), shown(tap, tmp_path, **settings) as (preview, eye):
        tap.process.send_signal(signal.SIGSTOP)
        preview.faulted("has sent no frame for")
        tap.process.send_signal(signal.SIGCONT)
        preview.running()
        eye.sees("red")


def test_a_camera_that_is_slow_by_nature_is_no_fault(tap: RunningTap, tmp_path: Path) -> None:
    """A thermal camera, for example: every two seconds a picture, where others have failed after one."""
    timeouts = {"source_silence_s": 1, "encoder_silence_s": 1, "start_s": 20}
    settings = {"source": ros(silence_s=9), "timeouts": timeouts}
    with ros_camera(TOPIC, hz=0.5) as published, preview_of(tap, tmp_path, **settings) as preview:
        preview.enable()
        preview.running()
        before = published.published
        wait_until(lambda: published.published >= before + 3, "three pictures more", 20)
        assert preview.running().counters == pb.Counters(starts=1)


def test_a_killed_preview_costs_the_tap_nothing(tap: RunningTap, tmp_path: Path) -> None:
    with ros_camera(TOPIC) as published, shown(tap, tmp_path) as (preview, _):
        preview.process.kill()
        preview.process.wait()
        wait_until(lambda: published.subscribers == 0, "no subscription")
        assert tap.wait_for(lambda state: state["wanted"] == [], "nothing is wanted")
        preview.start_again()
        preview.enable()
        preview.running()


def test_without_a_publisher_the_fault_says_so_until_there_is_one(tap: RunningTap, tmp_path: Path) -> None:
    with preview_of(tap, tmp_path) as preview:
        preview.enable()
        preview.faulted(f"nothing publishes {TOPIC}")
        with ros_camera(TOPIC):
            preview.running()
        preview.faulted(f"nothing publishes {TOPIC}")
        with ros_camera(TOPIC, picture("green")):
            preview.running()
            with Eye(preview.port) as eye:
                eye.sees("green")


def test_a_camera_that_is_not_in_use_says_that_its_topic_is_not_published(
    tap: RunningTap, tmp_path: Path
) -> None:
    """As after a mistake in the topic's name: the tap runs, and no operator has chosen the camera yet."""
    cameras = {"front": {"kind": "test"}, "arm": ros()}

    def is_so(state: str, error: str) -> Callable[[pb.ActualState], bool]:
        return lambda actual: camera(actual, "arm")[0] == state and error in camera(actual, "arm")[1]

    with preview_of(tap, tmp_path, cameras=cameras) as preview:
        preview.wait_for(is_so("FAILED", f"nothing publishes {TOPIC}"), "its state", 30)
        with ros_camera(TOPIC):
            preview.wait_for(is_so("READY", ""), "it is there", 30)
        preview.wait_for(is_so("FAILED", "nothing publishes"), "it is gone", 30)


def test_a_topic_of_another_type_is_named(tap: RunningTap, tmp_path: Path) -> None:
    from std_msgs.msg import Header  # noqa: PLC0415  # beside the others it would read as an image

    from tests.support.talker import talking  # noqa: PLC0415

    with talking() as talker, preview_of(tap, tmp_path) as preview:
        talker.publisher(TOPIC, Header)
        preview.enable()
        preview.faulted(f"{TOPIC} is published as std_msgs/msg/Header, not as sensor_msgs/msg/Image")


def test_a_topic_that_becomes_compressed_is_shown_again(tap: RunningTap, tmp_path: Path) -> None:
    with preview_of(tap, tmp_path) as preview:
        with ros_camera(TOPIC):
            preview.enable()
            preview.running()
        with ros_camera(TOPIC, compressed(jpeg("blue"), "jpeg")):
            preview.wait_for(lambda a: a.counters.starts > 1, "another start", 30)
            preview.running(within_s=30)
            with Eye(preview.port) as eye:
                eye.sees("blue")


def hostile() -> dict[str, Any]:
    """Messages that can't be shown, by the reason that is counted."""
    short = picture()
    del short.data[-1:]
    step = picture()
    step.step = 100
    vast = picture()
    vast.width = vast.height = 4_000_000_000
    depth = picture()
    depth.encoding = "32FC1"
    return {"data": short, "step": step, "size": vast, "encoding": depth}


@pytest.mark.parametrize("reason", ["data", "step", "size", "encoding"])
def test_hostile_messages_are_refused_counted_and_named(tap: RunningTap, tmp_path: Path, reason: str) -> None:
    with ros_camera(TOPIC) as published, shown(tap, tmp_path) as (preview, eye):
        good, published.shows = published.shows, hostile()[reason]
        preview.faulted(f"{TOPIC} can't be shown: a message has ")
        state = tap.wait_for(lambda s: s["topics"][TOPIC]["refused"][reason] > 3, "refusals")
        assert sum(state["topics"][TOPIC]["refused"].values()) == state["topics"][TOPIC]["refused"][reason]
        published.shows = good
        preview.running()
        eye.sees("red")


def test_bad_messages_between_good_ones_cost_only_themselves(tap: RunningTap, tmp_path: Path) -> None:
    bad = hostile()["data"]
    with (
        ros_camera(TOPIC),
        ros_camera(TOPIC, bad, hz=20),
        shown(tap, tmp_path) as (preview, eye),
    ):
        before = len(eye.seen)
        wait_until(lambda: len(eye.seen) > before + 60, "frames go on", 20)
        tap.wait_for(lambda s: s["topics"][TOPIC]["refused"]["data"] > 10, "refusals")
        assert preview.running().counters == pb.Counters(starts=1)


def test_a_picture_that_no_decoder_can_read_is_survived(tap: RunningTap, tmp_path: Path) -> None:
    whole = jpeg("green")
    with ros_camera(TOPIC, compressed(whole, "jpeg")) as published, shown(tap, tmp_path) as (preview, eye):
        torn = bytearray(whole)
        torn[len(torn) // 2 :] = os.urandom(len(torn) - len(torn) // 2)
        published.shows = compressed(bytes(torn), "jpeg")
        before = published.published
        wait_until(lambda: published.published > before + 60, "torn ones were sent")
        published.shows = compressed(jpeg("blue"), "jpeg")
        preview.running()
        eye.sees("blue", 30)
        assert preview.process.poll() is None


@pytest.mark.parametrize("stamp", ["none", "simulated time"])
def test_without_a_plausible_stamp_the_arrival_counts(tap: RunningTap, tmp_path: Path, stamp: str) -> None:
    message = picture()
    message.header.stamp.sec = 0 if stamp == "none" else 1234
    with _unstamped(message) as published, shown(tap, tmp_path) as (preview, eye):
        eye.more_frames(30)
        preview.wait_for(lambda a: 0 < a.measurement.last_frame_age_ms < 1000, "a young frame")
        counts = tap.state()["topics"][TOPIC]
        assert counts["stamps_replaced"] == counts["frames"] > 30
        assert published.published > 30


@contextmanager
def _unstamped(message: Any) -> Iterator[RosCamera]:
    with ros_camera(TOPIC, message, age_s=None) as published:
        yield published


def test_best_effort_publishers_are_received(tap: RunningTap, tmp_path: Path) -> None:
    from rclpy.qos import ReliabilityPolicy  # noqa: PLC0415  # of this test alone

    with (
        ros_camera(TOPIC, picture("green"), reliability=ReliabilityPolicy.BEST_EFFORT),
        shown(tap, tmp_path) as (_, eye),
    ):
        eye.sees("green")


def test_three_cameras_of_which_one_is_a_topic(tap: RunningTap, tmp_path: Path) -> None:
    """As docs/configuration.md shows it, with test patterns instead of two devices."""
    cameras = {
        "front": {"kind": "test", "pattern": "green"},
        "rear": {"kind": "test", "pattern": "blue"},
        "arm": ros(fallback="front"),
    }
    with preview_of(tap, tmp_path, cameras=cameras) as preview:
        preview.enable()
        preview.running()
        with Eye(preview.port) as eye:
            eye.sees("green")
            with ros_camera(TOPIC):
                choose(preview, "arm")
                eye.sees("red")
                choose(preview, "rear")
                eye.sees("blue")
                choose(preview, "arm")
                eye.sees("red")
                tap.kill()
                eye.sees("green")
                state, error = camera(
                    preview.wait_for(lambda a: camera(a, "arm")[0] == "FAILED", "it has failed"), "arm"
                )
                assert "camera tap" in error, state
                tap.start_again()
                eye.sees("red", 30)
            assert eye.lost == []
            assert preview.running().counters == pb.Counters(starts=1)


@pytest.mark.timeout(300)
def test_a_camera_whose_stamps_lag_takes_over_when_its_time_has_come(tap: RunningTap, tmp_path: Path) -> None:
    """Its frames are older than the last one that was shown: they wait, and the camera is not to blame."""
    # With the machine a camera may stand still for longer than it may be silent.
    without_stall(partial(takes_over_when_its_time_has_come, tap), tmp_path)


def takes_over_when_its_time_has_come(tap: RunningTap, directory: Path) -> None:
    lag_s = 4.0
    settings = {
        "cameras": {"front": {"kind": "test", "pattern": "green"}, "arm": ros(fallback="front")},
        # Less than the stamps lag.
        "timeouts": {"source_silence_s": 3, "encoder_silence_s": 1},
    }
    with ros_camera(TOPIC) as published, preview_of(tap, directory, **settings) as preview:
        published.age_s = lag_s
        preview.enable()
        preview.running()
        with Eye(preview.port) as eye:
            eye.sees("green")
            begin = len(eye.seen)
            choose(preview, "arm")
            eye.sees("red")
            eye.more_frames(10)
            # The colour at the change may be of frames that were decoded together.
            colours = [each.colour for each in eye.seen[begin:] if each.colour != "mixed"]
            assert colours == sorted(colours), "green, then red for good"
            assert lag_s - 1 < eye.longest_gap_s(begin) < lag_s + 1, "as long as the stamps lag"
            errors = [off_s(each.pts_s, published) for each in eye.seen[begin:] if each.colour == "red"]
            assert max(errors) < 0.001, "each is as old as it is"
        assert preview.running().counters == pb.Counters(starts=1)
        assert camera(preview.running(), "arm") == ("LIVE", "")


def choose(preview: RunningPreview, name: str) -> None:
    preview.revision += 1
    preview.apply(
        pb.DesiredState(revision=preview.revision, enabled=True, profile=pb.PROFILE_BALANCED, camera=name)
    )
