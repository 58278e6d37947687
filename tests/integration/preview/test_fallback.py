"""Encoders that fail, each in its own way: what takes over, what the status says, how long no frame comes."""

import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import mkdtemp

import psutil
import pytest

from omniseer.preview.v1 import preview_service_pb2 as pb
from tests.support.free import udp_port_is_free
from tests.support.processes import has_ended
from tests.support.promise import keeps
from tests.support.running_preview import RunningPreview
from tests.support.udp_link import UdpLink
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = pytest.mark.gst

ENCODERS = ["mpp-h265", "va-h265", "x264"]
TRIED = {"encoders": {"order": ENCODERS, "probe_timeout_s": 40}}
ORDER = TRIED | {"timeouts": {"source_silence_s": 1.5, "encoder_silence_s": 1.0}}
"""With the service's own figures, from which the promised outage follows."""
PATIENT = TRIED | {"timeouts": {"encoder_silence_s": 20}}
"""Where no encoder is silent."""
MAX_OUTAGE_S = 2.0
EXIT_HUNG = 70
STOP_WITHIN_S = 5.0
"""The containers' stop_grace_period."""


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("null-to-ready", "can't be opened"),
        ("ready-to-paused", "can't be opened"),
        ("no-output", "no output"),
        ("empty", "empty buffers"),
        ("error:3", "hardware fault"),
        ("hang:3", "hung"),
        ("crash:3", "crashed"),
    ],
)
def test_an_encoder_that_fails_its_trial_is_never_used(tmp_path: Path, fault: str, words: str) -> None:
    doubles = {"mpph265enc": fault, "vah265enc": "ok"}
    # Time enough for a busy machine, except for what only its end shows.
    patience_s = 8 if fault.startswith("hang") else 40
    settings = {
        "encoders": {"order": ENCODERS, "probe_timeout_s": patience_s},
        "timeouts": {"encoder_silence_s": 20},
    }
    with RunningPreview(tmp_path, settings, doubles) as preview:
        preview.enable()
        state = preview.running(within_s=2 * patience_s)
        assert (state.encoder.name, state.encoder.wanted) == ("va-h265", "mpp-h265")
        assert words in state.encoder.fallback_reason
        assert state.encoder.hardware
        assert state.last_error == ""
        assert state.counters == pb.Counters(starts=1)


@pytest.mark.timed
@pytest.mark.parametrize("enabled", [False, True])
def test_a_signal_ends_it_also_while_an_encoder_hangs_in_its_trial(tmp_path: Path, enabled: bool) -> None:
    settings = {"encoders": {"order": ["mpp-h265"], "probe_timeout_s": 60}}
    with RunningPreview(tmp_path, settings, {"mpph265enc": "hang:3"}) as preview:
        if enabled:
            preview.enable()
        (trial,) = wait_until(lambda: psutil.Process(preview.process.pid).children(), "the trial")
        preview.process.terminate()
        assert preview.process.wait(STOP_WITHIN_S) == 0
        wait_until(lambda: has_ended(trial.pid), "the trial has ended")


def test_an_element_that_is_not_there_is_named(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, PATIENT, {"vah265enc": "ok"}) as preview:
        preview.enable()
        state = preview.running()
        assert state.encoder.name == "va-h265"
        assert state.encoder.fallback_reason == "there is no GStreamer element mpph265enc"


def test_software_on_a_robot_with_hardware_is_a_visible_fault(tmp_path: Path) -> None:
    doubles = {"mpph265enc": "no-output", "vah265enc": "null-to-ready"}
    with RunningPreview(tmp_path, PATIENT, doubles) as preview:
        preview.enable()
        state = preview.running()
        assert state.encoder.name == "x264"
        assert not state.encoder.hardware
        assert "no hardware encoder works" in state.last_error


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("later null-to-ready", "can't be opened"),
        ("later ready-to-paused", "can't be opened"),
        ("later no-output", "no frame"),
        ("later empty", "no frame"),
    ],
)
@pytest.mark.timed
@pytest.mark.alone
def test_an_encoder_that_fails_at_the_start_is_passed_over(tmp_path: Path, fault: str, words: str) -> None:
    keeps_the_outage(tmp_path, partial(fails_at_the_start, fault, words))


def fails_at_the_start(fault: str, words: str, directory: Path) -> float:
    doubles = {"mpph265enc": fault, "vah265enc": "ok"}
    with RunningPreview(directory, ORDER, doubles) as preview:
        enabled_at = time.monotonic()
        preview.enable()
        state = preview.running()
        outage_s = time.monotonic() - enabled_at
        passed_over(state, "va-h265", words)
        return outage_s


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("later error:40", "hardware fault"),
        ("later hang:40", "no frame"),
        ("later no-output:40", "no frame"),
        ("later empty:40", "no frame"),
    ],
)
@pytest.mark.timed
@pytest.mark.alone
def test_a_viewer_gets_frames_again(tmp_path: Path, fault: str, words: str) -> None:
    keeps_the_outage(tmp_path, partial(fails_later, fault, words))


def fails_later(fault: str, words: str, directory: Path) -> float:
    doubles = {"mpph265enc": fault, "vah265enc": "ok"}
    with RunningPreview(directory, ORDER, doubles) as preview:
        preview.enable()
        preview.running()
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(10)
            state = preview.wait_for(
                lambda a: a.encoder.name == "va-h265" and a.state == pb.LIFECYCLE_STATE_RUNNING, "fallback"
            )
            watcher.wait_for_frames(30)
        passed_over(state, "va-h265", words)
        # Another connection: the pipeline is rebuilt whole, its listener included.
        assert watcher.lost
        return watcher.longest_pause_s


def test_an_encoder_that_hangs_ends_the_process_when_the_preview_is_disabled(tmp_path: Path) -> None:
    settings = TRIED | {"timeouts": {"stop_s": 1.0, "encoder_silence_s": 5}}
    with RunningPreview(tmp_path, settings, {"mpph265enc": "later hang:5", "vah265enc": "ok"}) as preview:
        preview.enable()
        preview.wait_for(lambda a: a.encoder.name == "va-h265", "fallback")
        preview.running()
        preview.disable()
        assert preview.process.wait(20) == EXIT_HUNG
        preview.start_again()
        preview.enable()
        state = preview.running()
        assert state.encoder.name == "va-h265"
        assert "hung" in state.encoder.fallback_reason
        assert state.counters.faults == 0


@pytest.mark.timed
@pytest.mark.alone
def test_a_driver_that_hangs_in_a_profile_change_blocks_nothing(tmp_path: Path) -> None:
    keeps_the_outage(tmp_path, hangs_in_a_profile_change)


def hangs_in_a_profile_change(directory: Path) -> float:
    doubles = {"mpph265enc": "later stuck:5", "vah265enc": "ok"}
    with RunningPreview(directory, ORDER, doubles) as preview:
        preview.enable(pb.PROFILE_BALANCED)
        preview.running()
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(10)
            preview.enable(pb.PROFILE_LOW_BW)
            # The loop answers while the driver does not.
            assert preview.stub.ListEncoders(pb.ListEncodersRequest(), timeout=20).encoders
            state = fallen_back(preview, watcher)
        passed_over(state, "va-h265", "hung when the profile was changed")
        assert state.profile == pb.PROFILE_LOW_BW
        # Whatever the driver keeps, the port is not among it.
        preview.disable()
        preview.disabled()
        assert udp_port_is_free(preview.port)
    return watcher.longest_pause_s


@pytest.mark.timed
@pytest.mark.alone
def test_a_driver_that_hangs_when_a_viewer_joins_blocks_nothing(tmp_path: Path) -> None:
    keeps_the_outage(tmp_path, hangs_when_a_viewer_joins)


def hangs_when_a_viewer_joins(directory: Path) -> float:
    doubles = {"mpph265enc": "later deaf:60", "vah265enc": "ok"}
    with RunningPreview(directory, ORDER, doubles) as preview:
        preview.enable()
        preview.running()
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(90)
            with Watcher(preview.port) as other:
                state = fallen_back(preview, watcher)
                other.wait_for_frames(10)
        passed_over(state, "va-h265", "hung when it was asked for a key frame")
    return watcher.longest_pause_s


@pytest.mark.timed
@pytest.mark.alone
def test_a_driver_that_hangs_when_the_bit_rate_follows_the_link_blocks_nothing(tmp_path: Path) -> None:
    keeps_the_outage(tmp_path, hangs_when_the_bit_rate_follows)


def hangs_when_the_bit_rate_follows(directory: Path) -> float:
    doubles = {"mpph265enc": "later stuck:5", "vah265enc": "ok"}
    settings = ORDER | {"adaptive": {"enabled": True}}
    with RunningPreview(directory, settings, doubles) as preview, UdpLink(preview.port) as link:
        preview.enable()
        preview.running()
        with Watcher(link.port, latency_ms=120) as watcher:
            watcher.wait_for_frames(10)
            link.impairment.loss = 0.4
            state = fallen_back(preview, watcher)
        passed_over(state, "va-h265", "hung when its bit rate was changed")
    return watcher.longest_pause_s


def fallen_back(preview: RunningPreview, watcher: Watcher) -> pb.ActualState:
    """Waits for the other encoder.

    The old frames flow on until the first one is given up; the port is free then, although its driver
    keeps the call.
    """
    state = preview.wait_for(
        lambda a: a.encoder.name == "va-h265" and a.state == pb.LIFECYCLE_STATE_RUNNING, "fallback"
    )
    watcher.wait_for_frames(10)
    return state


def keeps_the_outage(tmp_path: Path, scenario: Callable[[Path], float]) -> None:
    """Judges how long a scenario leaves a viewer without a frame; each attempt in a directory of its own."""
    keeps(MAX_OUTAGE_S, "s without a frame", lambda: scenario(Path(mkdtemp(dir=tmp_path))))


@pytest.mark.timed
@pytest.mark.alone
def test_an_encoder_that_takes_the_process_with_it_is_not_used_again(tmp_path: Path) -> None:
    keeps_the_outage(tmp_path, crashes_the_process)


def crashes_the_process(directory: Path) -> float:
    with RunningPreview(directory, ORDER, {"mpph265enc": "later crash:40", "vah265enc": "ok"}) as preview:
        preview.enable()
        preview.running()
        assert preview.process.wait(20) == -signal.SIGSEGV
        died_at = time.monotonic()
        # What the container engine and the gateway do.
        preview.start_again()
        preview.enable()
        state = preview.running()
        # A new viewer: one that was connected does not notice the crash, and reconnects only when its own
        # side of SRT gives up after 5 s.
        with Watcher(preview.port) as watcher:
            watcher.wait_for_frames(1)
        outage_s = watcher.arrivals_s[0] - died_at
        assert state.encoder.name == "va-h265"
        assert "crashed while it was in use (Segmentation fault)" in state.encoder.fallback_reason
        return outage_s


def test_an_encoder_is_not_blamed_for_a_process_that_was_killed(tmp_path: Path) -> None:
    with RunningPreview(tmp_path, PATIENT, {"mpph265enc": "ok", "vah265enc": "ok"}) as preview:
        preview.enable()
        preview.running()
        preview.process.kill()
        preview.process.wait(20)
        preview.start_again()
        preview.enable()
        state = preview.running()
        assert state.encoder.name == "mpp-h265"
        assert not state.encoder.fallback_reason


def test_when_every_encoder_has_failed_they_are_tried_again(tmp_path: Path) -> None:
    settings = {"encoders": {"order": ["mpp-h265"]}}
    with RunningPreview(tmp_path, settings, {"mpph265enc": "later null-to-ready"}) as preview:
        preview.enable()
        state = preview.wait_for(lambda a: a.counters.faults >= 2, "a second attempt")
        assert state.counters.fallbacks == 0
        assert "can't be opened" in state.last_error


def passed_over(state: pb.ActualState, now: str, words: str) -> None:
    assert (state.encoder.name, state.encoder.wanted) == (now, "mpp-h265")
    assert words in state.encoder.fallback_reason
    assert words in state.last_error
    assert (state.counters.faults, state.counters.fallbacks, state.counters.restarts) == (1, 1, 1)
