from typing import Any

import pytest

from common.errors import UserError
from console.client import NotAllowed, NotTrusted, Unreachable
from console.client.results import PreviewState
from console.viewer.banner import banner
from console.viewer.state import STILL_AFTER_S, Facts, Phase, view_state
from tests.unit.viewer.previews import preview

NOW_S = 1000.0
GONE = Unreachable("no robot gateway at robot:50051")
OVER = NotAllowed("the token of anna was revoked")
SILENT = UserError("the stream from srt://robot:7100 fell silent")
RUNNING = preview(PreviewState.RUNNING)
FAULTED = preview(PreviewState.FAULTED, last_error="the camera is gone. Plug it in")


@pytest.mark.parametrize(
    ("facts", "phase"),
    [
        pytest.param({}, Phase.CONNECTING, id="nothing known yet"),
        pytest.param({"preview": RUNNING}, Phase.CONNECTING, id="called, no picture yet"),
        pytest.param({"preview": RUNNING, "picture_s": NOW_S - 0.1}, Phase.LIVE, id="a picture came"),
        pytest.param({"preview": RUNNING, "picture_s": NOW_S - 1.2}, Phase.FROZEN, id="silence"),
        pytest.param({"preview": preview(PreviewState.DISABLED)}, Phase.OFF, id="off"),
        pytest.param({"preview": preview(PreviewState.STOPPING), "picture_s": 1.0}, Phase.OFF, id="ending"),
        pytest.param({"preview": preview(PreviewState.STARTING)}, Phase.CONNECTING, id="starting"),
        pytest.param({"preview": FAULTED, "picture_s": NOW_S - 5}, Phase.FAULTED, id="the robot says why"),
        pytest.param({"gateway_trouble": GONE}, Phase.UNREACHABLE, id="nobody there"),
        pytest.param({"gateway_trouble": OVER}, Phase.NO_ACCESS, id="the login is over"),
        pytest.param({"gateway_trouble": NotTrusted("a stranger")}, Phase.NO_ACCESS, id="a stranger"),
        pytest.param(
            {"preview": RUNNING, "gateway_trouble": OVER, "picture_s": NOW_S - 0.1},
            Phase.LIVE,
            id="pictures although the login is over",
        ),
        pytest.param(
            {"preview": RUNNING, "gateway_trouble": GONE, "picture_s": NOW_S - 2},
            Phase.UNREACHABLE,
            id="both are silent",
        ),
        pytest.param(
            {"preview": RUNNING, "gateway_trouble": GONE, "picture_s": NOW_S - 0.1},
            Phase.LIVE,
            id="pictures without a gateway",
        ),
        pytest.param(
            {"preview": RUNNING, "stream_trouble": SILENT, "blocked": True}, Phase.BLOCKED, id="blocked"
        ),
        pytest.param(
            {"preview": FAULTED, "picture_s": NOW_S - 0.1}, Phase.LIVE, id="what is seen counts for more"
        ),
    ],
)
def test_the_phase_follows_from_the_facts(facts: dict[str, Any], phase: Phase) -> None:
    assert view_state(Facts(**facts), NOW_S).phase is phase


def test_a_picture_is_live_for_its_time_and_then_frozen_for_ever_longer() -> None:
    facts = Facts(preview=RUNNING, picture_s=NOW_S)
    assert view_state(facts, NOW_S + STILL_AFTER_S).phase is Phase.LIVE
    for still_s in (STILL_AFTER_S + 0.01, 3.0, 100.0):
        state = view_state(facts, NOW_S + still_s)
        assert (state.phase, state.still_s) == (Phase.FROZEN, pytest.approx(still_s))


@pytest.mark.parametrize(
    ("facts", "title", "detail"),
    [
        ({"preview": RUNNING, "picture_s": NOW_S - 1.2}, "Frozen for 1.2 s", ""),
        (
            {"preview": RUNNING, "picture_s": NOW_S - 75, "stream_trouble": SILENT, "redials": 7},
            "Frozen for 1 min 15 s",
            "The stream from srt://robot:7100 fell silent (called again 7 times)",
        ),
        ({"preview": FAULTED}, "Preview faulted", "The camera is gone. Plug it in"),
        (
            {"preview": FAULTED, "picture_s": NOW_S - 3},
            "Preview faulted - picture frozen for 3.0 s",
            "The camera is gone. Plug it in",
        ),
        ({"preview": preview(PreviewState.DISABLED)}, "Preview is off", "Press P to switch it on"),
        ({"preview": RUNNING, "redials": 1}, "Connecting", "Called again once"),
    ],
)
def test_the_banner_says_what_and_why(facts: dict[str, Any], title: str, detail: str) -> None:
    words = banner(view_state(Facts(**facts), NOW_S))
    assert words is not None
    assert (words.title, words.detail) == (title, detail)


def test_each_phase_but_live_has_words() -> None:
    assert banner(view_state(Facts(preview=RUNNING, picture_s=NOW_S), NOW_S)) is None
    trouble = banner(view_state(Facts(gateway_trouble=GONE), NOW_S))
    assert trouble is not None
    assert trouble.title == "Robot unreachable"
    assert trouble.detail.startswith("No robot gateway at robot:50051. Check the address")
