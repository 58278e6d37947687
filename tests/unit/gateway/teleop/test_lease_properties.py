"""Whatever drivers and networks do: never two holders, and only the holder's growing sequence counts."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from gateway.status.teleop import LeaseEnd
from gateway.teleop.lease import (
    LANE_SILENT_S,
    MAX_LANES,
    RELEASED_S,
    SILENCE_S,
    Demand,
    Driver,
    Lease,
    LeaseRefusedError,
    Session,
    TooManyLanesError,
)

DRIVERS = tuple(Driver(name, name, f"{name}:1") for name in ("anna", "ben", "carl"))
ENDS = st.sampled_from([LeaseEnd.CLOSED, LeaseEnd.LOST, LeaseEnd.ACCESS_ENDED])


class Driving(RuleBasedStateMachine):
    """Three drivers at one robot. The model beside the lease is what each rule remembers."""

    def __init__(self) -> None:
        super().__init__()
        self.lease = Lease()
        self.now_s = 0.0
        self.sessions: list[Session] = []
        self.counted: dict[str, list[int]] = {}
        self.held_s: dict[str, float] = {}
        self.lanes: list[tuple[Session, int]] = []

    @rule(seconds=st.sampled_from([0.02, 0.3, 1.0, 2.5]))
    def time_passes(self, seconds: float) -> None:
        self.now_s += seconds

    @rule(driver=st.sampled_from(DRIVERS), demand=st.sampled_from(Demand))
    def demand(self, driver: Driver, demand: Demand) -> None:
        before = self.lease.holder
        session_id = str(len(self.sessions))
        try:
            session, last = self.lease.acquire(session_id, driver, demand, self.now_s, line_of_sight=False)
        except LeaseRefusedError:
            assert before is not None
            assert self.lease.holder is before
            return
        if last:
            assert last is before
            held_s = self.held_s.get(last.session_id, -RELEASED_S)
            own = not last.streaming and last.driver == driver
            rested = self.now_s - held_s >= RELEASED_S
            assert demand is Demand.TAKE_OVER_AS_ADMIN or own or (demand is Demand.TAKE_OVER and rested)
        if session not in self.sessions:
            self.sessions.append(session)
        if session.streaming:
            self.lanes.append((session, self.lease.add_lane(session, self.now_s)))

    @precondition(lambda self: self.lanes)
    @rule(data=st.data())
    def join(self, data: st.DataObject) -> None:
        session, _ = data.draw(st.sampled_from(self.lanes))
        try:
            number = self.lease.add_lane(session, self.now_s)
        except TooManyLanesError:
            assert len(session.lanes) == MAX_LANES
            assert all(self.now_s - heard_s < LANE_SILENT_S for heard_s in session.lanes.values())
        else:
            self.lanes.append((session, number))

    @precondition(lambda self: self.sessions)
    @rule(data=st.data(), sequence=st.integers(1, 12), held=st.booleans())
    def command(self, data: st.DataObject, sequence: int, held: bool) -> None:
        session = data.draw(st.sampled_from(self.sessions))
        counted = self.counted.setdefault(session.session_id, [])
        if session.lanes:
            self.lease.lane_heard(session, data.draw(st.sampled_from(sorted(session.lanes))), self.now_s)
        counts = self.lease.take(session, sequence, self.now_s, held=held)
        assert counts == (session is self.lease.holder and all(sequence > each for each in counted))
        if counts:
            counted.append(sequence)
            if held:
                self.held_s[session.session_id] = self.now_s

    @precondition(lambda self: self.lanes)
    @rule(data=st.data(), why=ENDS)
    def lane_ends(self, data: st.DataObject, why: LeaseEnd) -> None:
        session, number = self.lanes.pop(data.draw(st.integers(0, len(self.lanes) - 1)))
        had = session is self.lease.holder
        ended = self.lease.lane_gone(session, number, why)
        assert ended == (had and not session.lanes)
        if ended:
            assert session.ended is why

    @rule()
    def check_silence(self) -> None:
        before = self.lease.holder
        silent = self.lease.silent(self.now_s)
        if before:
            assert (silent is before) == (self.now_s - before.heard_s >= SILENCE_S)

    @invariant()
    def at_most_one_has_the_lease(self) -> None:
        having = [each for each in self.sessions if each.ended is None]
        assert having == ([self.lease.holder] if self.lease.holder else [])

    @invariant()
    def a_holder_that_streams_has_a_lane(self) -> None:
        holder = self.lease.holder
        assert holder is None or holder.lanes or not holder.streaming
        assert holder is None or len(holder.lanes) <= MAX_LANES


TestDriving = Driving.TestCase
TestDriving.settings = settings(max_examples=150, stateful_step_count=40)
