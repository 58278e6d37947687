from dataclasses import replace

from gateway.status.board import Board, SourceKind
from gateway.status.events import KEPT, EventLog
from gateway.status.observer import Observer
from gateway.status.preview import Counters, Encoder, PreviewState, PreviewView, Profile
from gateway.status.snapshot import Identity, Rules, Snapshot, SourceRule, take
from gateway.status.values import Odometry, Received

OFF = PreviewView(
    state=PreviewState.DISABLED,
    profile=Profile.BALANCED,
    last_error="",
    service_reachable=True,
    listener=None,
    stream=None,
    encoder=None,
    measured=None,
    counters=Counters(),
)


def snapshot(board: Board, preview: PreviewView = OFF, now_s: float = 100.0) -> Snapshot:
    return take(
        identity=Identity("t", "0", insecure=False),
        rules=Rules({SourceKind.ODOMETRY: SourceRule(1000, required=True)}, 3000),
        board=board,
        preview=preview,
        events=(),
        now_s=now_s,
    )


def test_the_newest_events_are_kept_and_numbered_from_one() -> None:
    log = EventLog()
    for number in range(1, KEPT + 4):
        log.add(f"event {number}", now_s=float(number))
    assert [event.sequence for event in log.newest()] == list(range(4, KEPT + 4))
    assert log.newest()[-1].message == f"event {KEPT + 3}"


def test_the_first_look_is_the_ground_and_no_news() -> None:
    assert Observer().observe(snapshot(Board())) == []


def test_a_source_that_comes_goes_and_returns_is_told_each_time() -> None:
    observer, board = Observer(), Board()
    observer.observe(snapshot(board))
    board.odometry = Received(Odometry(0, 0, 0), at_s=100.0)
    assert observer.observe(snapshot(board, now_s=100.1)) == ["odometry received"]
    assert observer.observe(snapshot(board, now_s=100.2)) == []
    assert observer.observe(snapshot(board, now_s=101.5)) == ["odometry stale"]
    board.odometry = Received(Odometry(0, 0, 0), at_s=102.0)
    assert observer.observe(snapshot(board, now_s=102.0)) == ["odometry received"]


def test_a_faulted_preview_is_told_once_however_often_it_retries() -> None:
    observer = Observer()
    observer.observe(snapshot(Board()))
    faulted = replace(OFF, state=PreviewState.FAULTED, last_error="no camera")
    assert observer.observe(snapshot(Board(), faulted)) == ["preview faulted: no camera"]
    for _ in range(3):
        assert observer.observe(snapshot(Board(), replace(OFF, state=PreviewState.STARTING))) == []
        assert observer.observe(snapshot(Board(), faulted)) == []
    running = replace(OFF, state=PreviewState.RUNNING)
    assert observer.observe(snapshot(Board(), running)) == ["preview running, BALANCED"]


def test_a_fallback_to_another_encoder_is_news() -> None:
    observer = Observer()
    running = replace(OFF, state=PreviewState.RUNNING, encoder=Encoder("mpp-h265", True, "mpp-h265", ""))
    observer.observe(snapshot(Board(), running))
    fallen = replace(running, encoder=Encoder("x264", False, "mpp-h265", "no output for 2 s"))
    assert observer.observe(snapshot(Board(), fallen)) == [
        "preview running, BALANCED, encoder x264 instead of mpp-h265: no output for 2 s"
    ]


def test_an_unreachable_service_is_news() -> None:
    observer = Observer()
    observer.observe(snapshot(Board()))
    gone = replace(OFF, service_reachable=False)
    assert observer.observe(snapshot(Board(), gone)) == ["preview service unreachable"]
    assert observer.observe(snapshot(Board(), OFF)) == ["preview service connected"]
