"""The parts of robotctl watch on a terminal that need no terminal: keys, requests, the view's height."""

import io
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import pytest
from rich.console import Console
from rich.text import Text

from console.cli.keyboard import Key, keys_in
from console.cli.live_screen import Fitted, live_view
from console.cli.preview_keys import PreviewKeys
from console.client import (
    Camera,
    CameraState,
    DesiredPreview,
    GatewayError,
    PreviewChange,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
    Unreachable,
)
from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.presentation.severity_style import SeverityStyle
from omniseer.gateway.v1 import fault_pb2, preview_pb2, states_pb2
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from tests.support.clock import Clock
from tests.support.gateway_double import healthy_status

PREVIEW = GET_SYSTEM_STATUS.decode(SystemStatus().SerializeToString()).preview


@pytest.fixture
def clock() -> Clock:
    return Clock(0.0)


@pytest.fixture
def asking(clock: Callable[[], float]) -> PreviewKeys:
    return PreviewKeys(clock)


def preview(state: PreviewState, profile: PreviewProfile = PreviewProfile.BALANCED) -> PreviewStatus:
    return replace(PREVIEW, state=state, profile=profile)


def shown(asking: PreviewKeys) -> str:
    message = asking.message()
    return message.text if message else ""


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        ("p", [Key.TOGGLE]),
        ("123q", [Key.LOW_BW, Key.BALANCED, Key.HIGH_QUALITY, Key.QUIT]),
        ("P Q", [Key.TOGGLE, Key.QUIT]),
        ("xyz 456\n\t", []),
        ("\x1b[A\x1b[1~\x1b[1;5C\x1bOP\x1bp\x1b", []),
        ("\x1b[1~1", [Key.LOW_BW]),
        ("\ufffdp", [Key.TOGGLE]),
    ],
)
def test_what_is_typed(typed: str, keys: list[Key]) -> None:
    assert list(keys_in(typed)) == keys


@pytest.mark.parametrize(
    ("state", "request_"),
    [
        (PreviewState.DISABLED, DesiredPreview(True)),
        (PreviewState.STOPPING, DesiredPreview(True)),
        (PreviewState.UNKNOWN, DesiredPreview(True)),
        (PreviewState.STARTING, DesiredPreview(False)),
        (PreviewState.RUNNING, DesiredPreview(False)),
        (PreviewState.FAULTED, DesiredPreview(False)),
    ],
)
def test_p_requests_the_opposite(asking: PreviewKeys, state: PreviewState, request_: DesiredPreview) -> None:
    assert asking.press(Key.TOGGLE, preview(state)) == request_
    offered = {key: does for key, does, _ in PreviewKeys().help(preview(state))}
    assert offered[Key.TOGGLE] == ("preview on" if request_.enabled else "preview off")


def test_v_takes_the_next_camera_that_works(asking: PreviewKeys) -> None:
    def robot(state: PreviewState, *cameras: str) -> PreviewStatus:
        listed = (Camera(name=name, state=CameraState.READY, error="", fallback="") for name in cameras)
        return replace(preview(state), cameras=tuple(listed), wanted_camera="front")

    off = robot(PreviewState.DISABLED, "front", "rear", "arm")
    assert asking.press(Key.CAMERA, off) is None
    assert asking.press(Key.CAMERA, off) is None
    assert shown(asking) == "camera arm: p turns the preview on with it"
    assert "camera (arm)" in [does for _, does, _ in asking.help(off)]
    assert asking.press(Key.TOGGLE, off) == DesiredPreview(True, camera="arm")
    running = robot(PreviewState.RUNNING, "front", "rear")
    asking.done(PreviewChange(accepted=True, message="preview is running, camera arm", preview=running))
    assert asking.press(Key.CAMERA, running) == DesiredPreview(True, camera="rear")
    assert shown(asking) == "camera rear: request sent ..."


def test_with_a_single_camera_v_has_nothing_to_do(asking: PreviewKeys) -> None:
    assert asking.press(Key.CAMERA, preview(PreviewState.RUNNING)) is None
    assert shown(asking) == "this robot has no other camera that works"
    assert Key.CAMERA not in [key for key, _, _ in asking.help(preview(PreviewState.RUNNING))]


def test_a_profile_is_switched_while_it_runs_and_marked_while_it_does_not(asking: PreviewKeys) -> None:
    assert asking.press(Key.LOW_BW, preview(PreviewState.DISABLED)) is None
    assert [key for key, _, is_so in asking.help(preview(PreviewState.DISABLED)) if is_so] == [Key.LOW_BW]
    assert asking.press(Key.TOGGLE, preview(PreviewState.DISABLED)) == DesiredPreview(
        True, PreviewProfile.LOW_BW
    )
    running = preview(PreviewState.RUNNING, PreviewProfile.LOW_BW)
    asking.done(PreviewChange(accepted=True, message="preview is running", preview=running))
    assert asking.press(Key.HIGH_QUALITY, running) == DesiredPreview(True, PreviewProfile.HIGH_QUALITY)


def test_one_thing_at_a_time(asking: PreviewKeys) -> None:
    off = preview(PreviewState.DISABLED)
    assert asking.press(Key.TOGGLE, off)
    assert asking.press(Key.TOGGLE, off) is None
    assert shown(asking) == "preview on: request sent ..."
    asking.done(PreviewChange(accepted=True, message="preview is on its way", preview=off))
    assert asking.press(Key.TOGGLE, off)


def test_a_success_expires_soon_and_a_failure_later(asking: PreviewKeys, clock: Clock) -> None:
    off = preview(PreviewState.DISABLED)
    asking.press(Key.TOGGLE, off)
    asking.done(PreviewChange(accepted=True, message="preview is running", preview=off))
    assert shown(asking) == "preview is running"
    clock.now_s += 6
    assert shown(asking) == ""
    asking.press(Key.TOGGLE, off)
    asking.done(PreviewChange(accepted=False, message="being serviced", preview=off))
    clock.now_s += 6
    message = asking.message()
    assert message
    assert (message.text, message.style) == (
        "preview on: the robot refused: being serviced",
        SeverityStyle.BAD,
    )
    clock.now_s += 20
    assert asking.message() is None


def test_a_failed_request_says_what_to_do(asking: PreviewKeys) -> None:
    asking.press(Key.TOGGLE, preview(PreviewState.RUNNING))
    asking.done(Unreachable("the link went silent", "Walk closer"))
    assert shown(asking) == "preview off failed: the link went silent. Walk closer"


@pytest.mark.parametrize(("height", "middle"), [(20, 10), (14, 10), (13, 9), (8, 4), (2, 1)])
def test_the_body_is_cut(height: int, middle: int) -> None:
    console = Console(file=io.StringIO(), width=60, height=height)
    body = Text("\n".join(f"row {number}" for number in range(10)))
    console.print(Fitted(Text("head\n"), body, Text("foot\nkeys")))
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert (lines[0], lines[-1]) == ("head", "keys")
    assert len(lines) == 4 + middle
    if middle < 10:
        assert lines[-3].startswith("... ")
        assert f"{11 - middle} more lines" in lines[-3]


def _trouble(message: SystemStatus) -> None:
    preview = message.preview
    preview.last_error, preview.bitrate_reason = "the camera was busy", "a narrow link"
    preview.encoder.wanted, preview.encoder.fallback_reason = "rkmpp", "the driver hangs"
    preview.endpoint.latency_ms = 125
    preview.wanted_camera = "rear"
    preview.cameras.add(name="front", state=preview_pb2.CAMERA_STATE_LIVE)
    preview.cameras.add(name="rear", state=preview_pb2.CAMERA_STATE_FAILED, error="is not plugged in")
    message.faults.add(
        id="odometry.stale",
        severity=fault_pb2.FAULT_SEVERITY_ERROR,
        message="odometry stopped coming",
        active=True,
    )


def drawn(error: GatewayError | None, *, troubled: bool = False) -> str:
    """The lines of the view 5.6 s after the last status, of a robot with cameras and faults if troubled."""
    message = healthy_status()
    message.preview.state = states_pb2.PREVIEW_RUNNING
    if troubled:
        _trouble(message)
    status = GET_SYSTEM_STATUS.decode(message.SerializeToString())
    out = Console(file=io.StringIO(), width=160, height=60)
    out.print(live_view(status, "lab:1", error=error, silent_ms=5600))
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


def test_during_an_outage_no_value_counts_as_fresh() -> None:
    assert "fresh" in drawn(None)
    during = drawn(Unreachable("gone"))
    assert "NO ANSWER, the values below are 5.6 s old" in during
    assert "fresh" not in during
    assert "last known: OK, robot healthy" in during
    assert "last known: RUNNING" in during


def test_during_an_outage_ages_count_on() -> None:
    """The double's odometry was 12 ms old."""
    (motion,) = (line for line in drawn(Unreachable("gone")).splitlines() if line.startswith("motion"))
    assert "STALE" in motion
    assert motion.rstrip().endswith("5.6 s")


SHOWN: Final = (
    "front (live)",
    "rear: wanted; is not plugged in",
    "odometry stopped coming",
    "the camera was busy",
    "a narrow link",
    "the driver hangs",
    "latency 125 ms",
)


def test_during_an_outage_nothing_of_cameras_preview_and_faults_is_present() -> None:
    """Each row says that it was so, as the rows of values do."""
    for error, known in ((None, False), (Unreachable("gone"), True)):
        lines = drawn(error, troubled=True).splitlines()
        for text in SHOWN:
            (line,) = (each for each in lines if text in each)
            assert ("last known:" in line) is known, line
            assert ("STALE" in line) is known, line
