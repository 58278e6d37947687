"""The schema of the socket, on the drive program's side."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drive.endpoint.wire import (
    INHIBITS,
    MAX_MESSAGE_BYTES,
    PHASES,
    ProtocolError,
    actual_state,
    decoded,
    episode_of,
    event_of,
    heartbeat,
    welcome,
)
from drive.motion.episode import Episode
from drive.motion.inhibits import Deadlines
from drive.motion.machine import Enable, EndLease, GrantLease, Reset, Rules, State, Stop
from drive.motion.phases import Phase
from drive.motion.values import (
    Command,
    Inhibit,
    Latch,
    Lease,
    LeaseEnd,
    Supervision,
    Surroundings,
    Velocity,
)
from omniseer.drive.v1 import drive_pb2 as pb

LONG = "\N{GRINNING FACE}" * 100_000


@pytest.mark.parametrize(
    ("message", "event"),
    [
        (pb.ToDrive(desired=pb.DesiredState(revision=3, enabled=True)), Enable(enabled=True)),
        (
            pb.ToDrive(grant=pb.GrantLease(session_id="s", holder="a", line_of_sight=True, streaming=True)),
            GrantLease(Lease("s", "a", Supervision.LINE_OF_SIGHT)),
        ),
        (pb.ToDrive(grant=pb.GrantLease(session_id="s")), GrantLease(Lease("s", "", streaming=False))),
        (
            pb.ToDrive(end=pb.EndLease(session_id="s", why=pb.LEASE_END_TAKEN_OVER)),
            EndLease("s", LeaseEnd.TAKEN_OVER),
        ),
        # A reason of a newer gateway, or none: the careful one.
        (pb.ToDrive(end=pb.EndLease(session_id="s")), EndLease("s", LeaseEnd.LOST)),
        (pb.ToDrive(stop=pb.Stop(by="ben", reason="a child")), Stop("ben", "a child")),
        (pb.ToDrive(reset=pb.Reset(stop_id=7)), Reset(7)),
        (
            pb.ToDrive(
                command=pb.Command(
                    session_id="s", sequence=2, held=True, vx_mps=0.1, vy_mps=0.2, wz_rad_s=0.3,
                    valid_until_ns=4, echo_ns=5, picture_ns=6,
                )
            ),
            Command("s", 2, True, Velocity(0.1, 0.2, 0.3), 4, 5, 6),
        ),
        (pb.ToDrive(picture=pb.Picture(running=True)), None),
        (pb.ToDrive(hello=pb.Hello()), None),
    ],
)  # fmt: skip
def test_each_message_is_its_event(message: pb.ToDrive, event: object) -> None:
    assert event_of(decoded(message.SerializeToString())) == event


def test_every_phase_and_reason_has_its_number() -> None:
    assert set(PHASES.values()) | {0} == set(pb.Phase.values())
    assert set(INHIBITS.values()) | {0} == set(pb.Inhibit.values())
    assert len(PHASES) == len(Phase)
    assert len(INHIBITS) == len(Inhibit)


@given(st.binary(max_size=200))
def test_any_packet_is_a_message_or_a_protocol_error(packet: bytes) -> None:
    try:
        message = decoded(packet)
    except ProtocolError:
        return
    event_of(message)


@pytest.mark.parametrize("graph", ["usual", "hostile"])
def test_neither_callers_nor_the_graph_make_a_report_larger_than_a_packet(graph: str) -> None:
    """A program may publish the lock under any number of names, and topics have long ones, too."""
    hostile = graph == "hostile"
    known = ["x" * 8 * 257, "x" * 257]
    around = Surroundings(commanded_on=("/" + "x" * 246,) * (16 if hostile else 0))
    stop = event_of(pb.ToDrive(stop=pb.Stop(by=LONG, reason=LONG)))
    grant = event_of(pb.ToDrive(grant=pb.GrantLease(session_id=LONG, holder=LONG)))
    assert isinstance(stop, Stop)
    assert isinstance(grant, GrantLease)
    latch = Latch(1, stop.by, stop.reason)
    by = f"stopped by {stop.by}: {stop.reason}"
    report = actual_state(
        State(phase=Phase.STOPPED, lease=grant.lease, latch=latch, surroundings=around),
        Rules(),
        0,
        revision=1,
        counters=pb.Counters(),
        episode=Episode(1, grant.lease.holder, 0, ended_by=by),
        problems=[*known, *([LONG] * 9 if hostile else [])],
    )
    assert report.ByteSize() < MAX_MESSAGE_BYTES - 1024
    assert list(report.problems[:2]) == known
    assert hostile == ("motion on /xx" in report.reset_obstacle)


@pytest.mark.parametrize("enabled", [True, False])
def test_a_report_says_whether_anyone_may_drive_although_the_phase_is_stopped(enabled: bool) -> None:
    state = State(phase=Phase.STOPPED, enabled=enabled, latch=Latch(4, "ben", "a child"))
    report = actual_state(state, Rules(), 0, revision=1, counters=pb.Counters(), episode=None, problems=[])
    assert report.HasField("enabled")
    assert report.enabled is enabled


@pytest.mark.parametrize(
    ("supervision", "speed_mps", "turn_rad_s"),
    [(Supervision.PICTURE, 0.10 / 0.58, 0.35 / 0.58), (Supervision.LINE_OF_SIGHT, 0.15, 0.4)],
)
def test_a_report_has_the_limits_by_which_the_motion_is_slowed_down(
    supervision: Supervision, speed_mps: float, turn_rad_s: float
) -> None:
    now_ns = 10**12
    command = Command("s", 1, True, Velocity(0.1), now_ns, now_ns, now_ns - 580_000_000)
    state = State(phase=Phase.DRIVING, lease=Lease("s", "anna", supervision), command=command)
    report = actual_state(
        state, Rules(), now_ns, revision=1, counters=pb.Counters(), episode=None, problems=[]
    )
    assert report.speed_limit_mps == pytest.approx(speed_mps)
    assert report.turn_limit_rad_s == pytest.approx(turn_rad_s)


def test_the_welcome_has_the_limits_in_effect() -> None:
    rules = Rules(deadlines=Deadlines(picture_ns=300_000_000))
    limits = welcome("1", rules, 500).welcome.limits
    assert welcome("1", rules, 500).welcome.base_timeout_ms == 500
    assert not welcome("1", rules).welcome.HasField("base_timeout_ms")
    assert limits.max_picture_age_ms == 300
    assert limits.max_vx_mps == pytest.approx(rules.limits.vx_mps)


def test_a_heartbeat_has_what_the_guard_keeps() -> None:
    latch, episode = Latch(4, "ben", "a child"), Episode(3, "anna", 10, 20, 0.5, 0.25, "released")
    beat = heartbeat(State(phase=Phase.STOPPED, latch=latch), episode, 2, lock_left=True)
    assert (beat.phase, beat.matched, beat.lock_left) == (PHASES[Phase.STOPPED], 2, True)
    assert (beat.stop.stop_id, beat.stop.by, beat.stop.reason) == (4, "ben", "a child")
    assert episode_of(beat) == episode
    assert not heartbeat(State(phase=Phase.ARMED), None, 0, lock_left=False).HasField("stop")
