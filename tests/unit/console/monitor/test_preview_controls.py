"""The preview's controls: when they may be touched, what they do, what they say."""

from dataclasses import replace

import pytest

from console.client import (
    Camera,
    CameraState,
    DeadlineExceeded,
    DesiredPreview,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
    Unreachable,
)
from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState, PreviewRequest
from console.monitor.preview_controls import Controls, controls
from console.presentation.preview_switch import Note, next_camera
from console.presentation.severity_style import SeverityStyle
from omniseer.gateway.v1 import overlay_pb2, preview_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.snapshots import NOW_S, heard, snapshot

LOW, BALANCED, HIGH = PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY


def with_preview(
    state: states.PreviewState.ValueType, error: str = "", reachable: bool = True
) -> OverlaySnapshot:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        preview = made.status.preview
        preview.state, preview.last_error, preview.service_reachable = state, error, reachable
        preview.profile = preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY

    return snapshot(change)


RUNNING = with_preview(states.PREVIEW_RUNNING)
DISABLED = with_preview(states.PREVIEW_DISABLED)


def of(
    taken: OverlaySnapshot, request: PreviewRequest | None = None, selected: PreviewProfile | None = None
) -> Controls:
    return controls(heard(taken, request=request), selected, NOW_S)


def answer(taken: OverlaySnapshot, *, accepted: bool = True, ended_s: float = NOW_S) -> PreviewRequest:
    change = PreviewChange(accepted=accepted, message="the robot's words", preview=taken.status.preview)
    return PreviewRequest(DesiredPreview(True), change, ended_s)


def test_off_the_switch_turns_it_on_with_the_profile_in_force() -> None:
    now = of(DISABLED)
    assert (now.on, now.mark, now.profile) == (False, "DISABLED", HIGH)
    assert now.toggled() == DesiredPreview(True, HIGH)


def test_off_a_profile_is_only_selected_for_the_next_time() -> None:
    assert of(DISABLED).with_profile(LOW) is None
    assert of(DISABLED, selected=LOW).toggled() == DesiredPreview(True, LOW)


@pytest.mark.parametrize("state", [states.PREVIEW_RUNNING, states.PREVIEW_STARTING, states.PREVIEW_FAULTED])
def test_on_the_switch_turns_it_off_and_a_profile_is_taken_at_once(
    state: states.PreviewState.ValueType,
) -> None:
    now = of(with_preview(state))
    assert now.toggled() == DesiredPreview(False)
    assert now.with_profile(LOW) == DesiredPreview(True, LOW)


def test_on_the_robots_profile_counts_not_the_selected_one() -> None:
    assert of(RUNNING, selected=LOW).profile is HIGH


def test_an_unknown_profile_is_shown_as_balanced() -> None:
    assert of(snapshot()).profile is BALANCED


def test_while_a_request_runs_nothing_may_be_touched() -> None:
    now = of(DISABLED, PreviewRequest(DesiredPreview(True)))
    assert not now.enabled
    assert now.notes[0] == Note("Waiting for the robot ...", SeverityStyle.QUIET)


@pytest.mark.parametrize(
    "state",
    [
        MonitorState(Link(state=LinkState.CONNECTING, since_s=0)),
        replace(heard(RUNNING), link=Link(state=LinkState.LOST, since_s=0, error=Unreachable("gone"))),
    ],
)
def test_without_a_connection_nothing_may_be_touched_and_nothing_is_claimed(state: MonitorState) -> None:
    now = controls(state, None, NOW_S)
    assert not now.enabled
    assert (now.mark, now.style) == ("UNKNOWN", SeverityStyle.QUIET)


def test_a_refusal_stays_until_the_next_request() -> None:
    now = controls(heard(DISABLED, request=answer(DISABLED, accepted=False, ended_s=0)), None, NOW_S)
    assert now.notes == (Note("The robot refused: the robot's words", SeverityStyle.BAD),)
    assert now.enabled


def test_an_error_says_what_to_do() -> None:
    request = PreviewRequest(DesiredPreview(True), DeadlineExceeded("no answer within 8 s", "Try again"), 0.0)
    assert of(DISABLED, request).notes == (
        Note("Request failed: no answer within 8 s. Try again", SeverityStyle.BAD),
    )


def test_good_news_goes_away_by_itself() -> None:
    assert of(RUNNING, answer(RUNNING)).notes == (Note("the robot's words", SeverityStyle.QUIET),)
    assert of(RUNNING, answer(RUNNING, ended_s=NOW_S - 60)).notes == ()


def test_a_fault_is_reported_once_in_the_robots_words() -> None:
    faulted = with_preview(states.PREVIEW_FAULTED, "no encoder works. Type: robot-preview encoders")
    expected = (Note("no encoder works. Type: robot-preview encoders", SeverityStyle.BAD),)
    assert of(faulted).notes == expected
    assert of(faulted, answer(faulted)).notes == expected
    assert of(faulted).style is SeverityStyle.BAD


def test_an_unreachable_service_is_reported_while_the_preview_is_off() -> None:
    (note,) = of(with_preview(states.PREVIEW_DISABLED, reachable=False)).notes
    assert "does not answer" in note.text


def with_cameras(on: bool, wanted: str, **cameras: CameraState) -> OverlaySnapshot:
    taken = RUNNING if on else DISABLED
    listed = tuple(
        Camera(name=name, state=state, error="unplugged" if state is CameraState.FAILED else "", fallback="")
        for name, state in cameras.items()
    )
    preview = replace(taken.status.preview, wanted_camera=wanted, cameras=listed)
    return replace(taken, status=replace(taken.status, preview=preview))


LIVE, READY, FAILED = CameraState.LIVE, CameraState.READY, CameraState.FAILED


def test_a_camera_is_requested_at_once_or_selected_for_the_next_time() -> None:
    now = of(with_cameras(True, "front", front=LIVE, rear=READY))
    assert (now.wanted_camera, [each.name for each in now.cameras]) == ("front", ["front", "rear"])
    assert now.with_camera("rear") == DesiredPreview(True, camera="rear")
    assert now.summary.startswith("front")
    off = with_cameras(False, "front", front=READY, rear=READY)
    assert of(off).with_camera("rear") is None
    assert of(off).toggled() == DesiredPreview(True, HIGH)
    selected = controls(heard(off), None, NOW_S, "rear")
    assert selected.wanted_camera == "rear"
    assert selected.toggled() == DesiredPreview(True, HIGH, "rear")


def test_a_single_camera_is_not_mentioned() -> None:
    assert "camera" not in of(with_cameras(True, "camera", camera=LIVE)).summary


def test_a_wanted_camera_that_fails_is_a_note() -> None:
    now = of(with_cameras(True, "front", front=FAILED, rear=LIVE))
    assert [note.text for note in now.conditions] == [
        "Camera front does not work; rear is shown: unplugged",
    ]
    assert of(with_cameras(True, "rear", front=FAILED, rear=LIVE)).conditions == ()


@pytest.mark.parametrize(
    ("states_", "present", "following"),
    [
        ({"front": LIVE, "rear": READY, "arm": READY}, "front", "rear"),
        ({"front": READY, "rear": READY, "arm": LIVE}, "arm", "front"),
        ({"front": LIVE, "rear": FAILED, "arm": READY}, "front", "arm"),
        ({"front": LIVE, "rear": FAILED}, "front", ""),
        ({"front": LIVE}, "front", ""),
        ({}, "", ""),
        # The wanted one is of another configuration, or of a robot that does not say.
        ({"front": LIVE, "rear": READY}, "gone", "front"),
    ],
)
def test_the_next_camera_is_the_next_that_works(
    states_: dict[str, CameraState], present: str, following: str
) -> None:
    assert next_camera(with_cameras(True, present, **states_).status.preview.cameras, present) == following


def test_what_an_active_fault_says_is_no_note_beside_it() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        preview = made.status.preview
        preview.state, preview.last_error = states.PREVIEW_FAULTED, "camera unplugged"
        preview.encoder.wanted, preview.encoder.fallback_reason = "mpp-h265", "no driver"
        preview.bitrate_reason = "RTT 90 ms: 2.00 Mbit/s -> 1.00 Mbit/s"
        preview.service_reachable = True
        made.status.faults.add(id="preview.faulted", severity=3, active=True)
        made.status.faults.add(id="preview.fallback", severity=2, active=False)

    now = of(snapshot(change))
    assert [note.text for note in now.conditions] == [
        "camera unplugged",
        "Preferred mpp-h265: no driver",
        "Bit rate: RTT 90 ms: 2.00 Mbit/s -> 1.00 Mbit/s",
    ]
    assert now.beside_faults == now.conditions[1:], "a cleared fault does not say it"


def test_a_camera_that_has_a_fault_needs_no_note() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        preview = made.status.preview
        preview.state = states.PREVIEW_RUNNING
        preview.service_reachable = True
        preview.wanted_camera = "front"
        preview.cameras.add(name="front", state=preview_pb2.CAMERA_STATE_FAILED, error="unplugged")
        made.status.faults.add(id="preview.camera.front", severity=2, active=True)

    now = of(snapshot(change))
    assert len(now.conditions) == 1
    assert now.beside_faults == ()


def test_warnings_of_a_silent_robot_are_not_coloured() -> None:
    warned = with_preview(states.PREVIEW_FAULTED, "camera unplugged")
    (note,) = controls(heard(warned), None, NOW_S + 60).beside_faults
    assert note == Note("camera unplugged", SeverityStyle.QUIET)
