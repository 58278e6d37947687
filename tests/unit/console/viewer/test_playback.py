from typing import Any

import pytest

from common.errors import UserError
from console.client import NotAllowed, NotTrusted, Unreachable
from console.client.results import PreviewState
from console.viewer.formatting import banner
from console.viewer.playback import FROZEN_AFTER_S, PlaybackInputs, PlaybackState, playback
from tests.unit.console.viewer.previews import preview

NOW_S = 1000.0
GONE = Unreachable("no robot gateway at robot:50051")
REVOKED = NotAllowed("the token of anna was revoked")
SILENT = UserError("the stream from srt://robot:7100 fell silent")
RUNNING = preview(PreviewState.RUNNING)
FAULTED = preview(PreviewState.FAULTED, last_error="the camera is gone. Plug it in")


@pytest.mark.parametrize(
    ("facts", "state"),
    [
        pytest.param({}, PlaybackState.CONNECTING, id="nothing known yet"),
        pytest.param({"preview": RUNNING}, PlaybackState.CONNECTING, id="called, no frame yet"),
        pytest.param({"preview": RUNNING, "frame_s": NOW_S - 0.1}, PlaybackState.LIVE, id="a frame came"),
        pytest.param({"preview": RUNNING, "frame_s": NOW_S - 1.2}, PlaybackState.FROZEN, id="silence"),
        pytest.param({"preview": preview(PreviewState.DISABLED)}, PlaybackState.OFF, id="off"),
        pytest.param(
            {"preview": preview(PreviewState.STOPPING), "frame_s": 1.0}, PlaybackState.OFF, id="ending"
        ),
        pytest.param({"preview": preview(PreviewState.STARTING)}, PlaybackState.CONNECTING, id="starting"),
        pytest.param(
            {"preview": FAULTED, "frame_s": NOW_S - 5}, PlaybackState.FAULTED, id="the robot says why"
        ),
        pytest.param({"gateway_error": GONE}, PlaybackState.UNREACHABLE, id="no gateway"),
        pytest.param({"gateway_error": REVOKED}, PlaybackState.NO_ACCESS, id="the login was revoked"),
        pytest.param({"gateway_error": NotTrusted("a stranger")}, PlaybackState.NO_ACCESS, id="a stranger"),
        pytest.param(
            {"preview": RUNNING, "gateway_error": REVOKED, "frame_s": NOW_S - 0.1},
            PlaybackState.LIVE,
            id="frames although the login was revoked",
        ),
        pytest.param(
            {"preview": RUNNING, "gateway_error": GONE, "frame_s": NOW_S - 2},
            PlaybackState.UNREACHABLE,
            id="both are silent",
        ),
        pytest.param(
            {"preview": RUNNING, "gateway_error": GONE, "frame_s": NOW_S - 0.1},
            PlaybackState.LIVE,
            id="frames without a gateway",
        ),
        pytest.param(
            {"preview": RUNNING, "stream_error": SILENT, "blocked": True}, PlaybackState.BLOCKED, id="blocked"
        ),
        pytest.param(
            {"preview": FAULTED, "frame_s": NOW_S - 0.1},
            PlaybackState.LIVE,
            id="what is seen counts for more",
        ),
    ],
)
def test_the_state_follows_from_the_facts(facts: dict[str, Any], state: PlaybackState) -> None:
    assert playback(PlaybackInputs(**facts), NOW_S).state is state


def test_a_frame_is_live_for_its_time_and_then_frozen_for_ever_longer() -> None:
    inputs = PlaybackInputs(preview=RUNNING, frame_s=NOW_S)
    assert playback(inputs, NOW_S + FROZEN_AFTER_S).state is PlaybackState.LIVE
    for frame_age_s in (FROZEN_AFTER_S + 0.01, 3.0, 100.0):
        now = playback(inputs, NOW_S + frame_age_s)
        assert now.state is PlaybackState.FROZEN
        assert now.frame_age_s == pytest.approx(frame_age_s)


@pytest.mark.parametrize(
    ("facts", "title", "detail"),
    [
        ({"preview": RUNNING, "frame_s": NOW_S - 1.2}, "Frozen for 1.2 s", ""),
        (
            {"preview": RUNNING, "frame_s": NOW_S - 75, "stream_error": SILENT, "redials": 7},
            "Frozen for 1 min 15 s",
            "The stream from srt://robot:7100 fell silent (reconnected 7 times)",
        ),
        ({"preview": FAULTED}, "Preview faulted", "The camera is gone. Plug it in"),
        (
            {"preview": FAULTED, "frame_s": NOW_S - 3},
            "Preview faulted - video frozen for 3.0 s",
            "The camera is gone. Plug it in",
        ),
        ({"preview": preview(PreviewState.DISABLED)}, "Preview is off", "Press P to switch it on"),
        ({"preview": RUNNING, "redials": 1}, "Connecting", "Reconnected once"),
    ],
)
def test_the_banner_says_what_and_why(facts: dict[str, Any], title: str, detail: str) -> None:
    text = banner(playback(PlaybackInputs(**facts), NOW_S))
    assert text is not None
    assert (text.title, text.detail) == (title, detail)


def test_each_state_but_live_has_a_banner() -> None:
    assert banner(playback(PlaybackInputs(preview=RUNNING, frame_s=NOW_S), NOW_S)) is None
    error = banner(playback(PlaybackInputs(gateway_error=GONE), NOW_S))
    assert error is not None
    assert error.title == "Robot unreachable"
    assert error.detail.startswith("No robot gateway at robot:50051. Check the address")
