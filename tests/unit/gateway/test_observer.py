from dataclasses import replace
from typing import Any

from gateway.status.board import Board
from gateway.status.event import EncoderFallback, Event, FaultRaised, ModeChanged, PreviewChanged
from gateway.status.fault import Severity
from gateway.status.mode_events import BURST
from gateway.status.preview import Camera, CameraState, Encoder, PreviewState, PreviewView, Profile
from gateway.status.snapshot import Snapshot, SourceRule
from gateway.status.sources import MODE, ODOMETRY, SourceSpec
from gateway.status.values import Mode, Received, Velocity
from tests.support import status
from tests.support.fault_rules import new_observer

OFF = replace(status.OFF, profile=Profile.BALANCED)
SOURCES: dict[SourceSpec[Any], SourceRule] = {
    ODOMETRY: SourceRule(1000, required=True),
    MODE: SourceRule(0, required=False),
}


def snapshot(board: Board, preview: PreviewView = OFF, now_s: float = 100.0) -> Snapshot:
    return status.snapshot_of(board, SOURCES, now_s=now_s, preview=preview)


def sentences(events: list[Event]) -> list[str]:
    """What the overlay's short list shows."""
    return [each.sentence for each in events if each.sentence is not None]


def test_the_first_look_is_the_ground_and_no_news() -> None:
    assert new_observer(startup_grace_s=5).observe(snapshot(Board())) == []


def test_a_source_that_comes_goes_and_returns_is_reported_each_time() -> None:
    observer, board = new_observer(startup_grace_s=0.2), Board()
    assert sentences(observer.observe(snapshot(board, now_s=99.0))) == []
    missing = "no odometry since the gateway started, and nothing on the robot publishes it"
    assert sentences(observer.observe(snapshot(board, now_s=99.2))) == [f"error: {missing}"]
    board[ODOMETRY] = Received(Velocity(0, 0, 0), at_s=100.0)
    assert sentences(observer.observe(snapshot(board, now_s=100.1))) == [f"cleared: {missing}"]
    assert sentences(observer.observe(snapshot(board, now_s=100.2))) == []
    assert sentences(observer.observe(snapshot(board, now_s=101.5))) == ["error: odometry stopped coming"]
    board[ODOMETRY] = Received(Velocity(0, 0, 0), at_s=102.0)
    assert sentences(observer.observe(snapshot(board, now_s=102.0))) == ["cleared: odometry stopped coming"]


def test_a_faulted_preview_is_reported_once_however_often_it_retries() -> None:
    observer = new_observer(startup_grace_s=60)
    observer.observe(snapshot(Board()))
    faulted = replace(OFF, state=PreviewState.FAULTED, last_error="no camera")
    starting = replace(faulted, state=PreviewState.STARTING)
    message = "the preview does not work: no camera"
    assert sentences(observer.observe(snapshot(Board(), faulted))) == [f"error: {message}"]
    for _ in range(3):
        assert sentences(observer.observe(snapshot(Board(), starting))) == []
        assert sentences(observer.observe(snapshot(Board(), faulted))) == []
    running = replace(OFF, state=PreviewState.RUNNING)
    assert sentences(observer.observe(snapshot(Board(), running))) == [
        f"cleared: {message}",
        "preview running, balanced",
    ]


def test_each_settled_state_of_the_preview_is_an_event_of_its_own() -> None:
    observer = new_observer(startup_grace_s=60)
    observer.observe(snapshot(Board()))

    def changes(state: PreviewState, profile: Profile, last_error: str = "") -> list[PreviewChanged]:
        view = replace(OFF, state=state, profile=profile, last_error=last_error)
        events = observer.observe(snapshot(Board(), view))
        return [each.detail for each in events if isinstance(each.detail, PreviewChanged)]

    running, low = PreviewState.RUNNING, Profile.LOW_BW
    assert changes(PreviewState.STARTING, low) == []
    assert changes(running, low) == [PreviewChanged(running, low, "")]
    assert changes(running, Profile.BALANCED) == [PreviewChanged(running, Profile.BALANCED, "")]
    faulted = PreviewChanged(PreviewState.FAULTED, Profile.BALANCED, "no camera")
    assert changes(PreviewState.FAULTED, Profile.BALANCED, "no camera") == [faulted]
    assert changes(running, Profile.BALANCED) == [PreviewChanged(running, Profile.BALANCED, "")]
    assert changes(PreviewState.STOPPING, Profile.BALANCED) == []
    off = PreviewChanged(PreviewState.DISABLED, Profile.BALANCED, "")
    assert changes(PreviewState.DISABLED, Profile.BALANCED) == [off]
    assert changes(PreviewState.DISABLED, low) == [], "the profile of the next preview is no event"


def test_another_live_camera_is_news_and_a_failed_one_a_fault() -> None:
    observer = new_observer(startup_grace_s=60)
    observer.observe(snapshot(Board()))

    def seen(*states: CameraState, wanted: str = "front") -> list[str]:
        names = ("front", "rear")
        cameras = tuple(Camera(*each, "ended") for each in zip(names, states, strict=True))
        running = replace(OFF, state=PreviewState.RUNNING, wanted_camera=wanted, cameras=cameras)
        return sentences(observer.observe(snapshot(Board(), running)))

    live, ready, starting, failed = (
        CameraState.LIVE,
        CameraState.READY,
        CameraState.STARTING,
        CameraState.FAILED,
    )
    assert seen(live, ready) == ["preview running, balanced, camera front"]
    assert seen(live, starting, wanted="rear") == []
    assert seen(ready, live, wanted="rear") == ["preview running, balanced, camera rear"]
    assert seen(live, ready) == ["preview running, balanced, camera front"]
    assert seen(failed, starting) == ["warning: camera front does not work: ended"]
    assert seen(failed, live) == ["preview running, balanced, camera rear"]
    cleared = "cleared: camera front does not work, and camera rear is shown instead: ended"
    assert seen(live, ready) == [cleared, "preview running, balanced, camera front"]
    assert seen(live, failed) == [], "one that no one wants is no fault"


def test_what_a_fault_says_to_programs() -> None:
    observer, board = new_observer(startup_grace_s=0.0), Board()
    raised = ((each, each.detail) for each in observer.observe(snapshot(board)))
    [(event, detail)] = [(each, detail) for each, detail in raised if isinstance(detail, FaultRaised)]
    assert (event.severity, event.component) == (Severity.ERROR, "odometry")
    assert event.message == detail.fault.condition.message, "without the word that the severity says"


def test_a_fallback_to_another_encoder_is_news() -> None:
    observer = new_observer(startup_grace_s=60)
    running = replace(OFF, state=PreviewState.RUNNING, encoder=Encoder("mpp-h265", True, "mpp-h265", ""))
    observer.observe(snapshot(Board(), running))
    fallen = replace(running, encoder=Encoder("x264", False, "mpp-h265", "no output for 2 s"))
    events = observer.observe(snapshot(Board(), fallen))
    assert sentences(events) == [
        "warning: x264 encodes on the robot's own processor instead of mpp-h265: no output for 2 s"
    ]
    details = [each.detail for each in events]
    assert EncoderFallback("x264", "mpp-h265", "no output for 2 s") in details
    assert sum(isinstance(each, FaultRaised) for each in details) == 1
    assert [each.severity for each in events].count(Severity.WARNING) == 1, "the warning once"
    assert observer.observe(snapshot(Board(), fallen)) == [], "once"


def test_another_mode_is_news() -> None:
    observer, board = new_observer(startup_grace_s=60), Board()
    board[MODE] = Received(Mode("idle"), at_s=99.0)
    observer.observe(snapshot(board))
    assert sentences(observer.observe(snapshot(board))) == []
    board[MODE] = Received(Mode("exploring"), at_s=100.0)
    assert sentences(observer.observe(snapshot(board))) == ["robot mode: exploring"]
    assert sentences(observer.observe(snapshot(board, now_s=5000.0)))[1:] == []


def test_a_mode_that_alternates_at_each_look_is_not_an_event_at_each() -> None:
    observer, board = new_observer(startup_grace_s=60), Board()
    events = 0
    for look in range(1000):
        board[MODE] = Received(Mode(("idle", "exploring")[look % 2]), at_s=100.0)
        found = observer.observe(snapshot(board))
        events += sum(isinstance(each.detail, ModeChanged) for each in found)
    assert events <= BURST + 1


def test_an_unreachable_service_is_an_event_and_worse_while_it_is_desired() -> None:
    observer = new_observer()
    observer.observe(snapshot(Board()))
    gone = replace(OFF, service_reachable=False)
    message = "the preview service does not answer: video is not available"

    def reported(preview: PreviewView) -> list[str]:
        said = sentences(observer.observe(snapshot(Board(), preview)))
        return [each for each in said if "preview service" in each]

    assert reported(gone) == [f"warning: {message}"]
    assert reported(replace(gone, state=PreviewState.FAULTED)) == [f"error now: {message}"]
    assert reported(OFF) == [f"cleared: {message}"]
