"""Who gets the lease, and when it ends."""

from itertools import product

import pytest

from gateway.status.teleop import LeaseEnd
from gateway.teleop.lease import (
    ANSWERS,
    LANE_SILENT_S,
    MAX_LANES,
    RELEASED_S,
    SILENCE_S,
    Answer,
    Demand,
    Driver,
    Lease,
    LeaseRefusedError,
    NotInSessionError,
    Occupancy,
    Session,
    TooManyLanesError,
)

ANNA, BEN = Driver("anna", "anna", "a:1"), Driver("ben", "ben", "b:1")


def acquired(lease: Lease, driver: Driver, demand: Demand = Demand.OPEN, now_s: float = 0.0) -> Session:
    session, _ = lease.acquire(f"{driver.key} at {now_s}", driver, demand, now_s, line_of_sight=False)
    return session


def occupied(occupancy: Occupancy) -> tuple[Lease, float]:
    """A lease, and when it is as the member says, for Anna."""
    lease = Lease()
    match occupancy:
        case Occupancy.OWN_UNARY:
            acquired(lease, ANNA, Demand.UNARY)
        case Occupancy.RESTING:
            acquired(lease, BEN)
        case Occupancy.HOLDING:
            lease.take(acquired(lease, BEN), 1, 0.0, held=True)
    return lease, 0.0


@pytest.mark.parametrize(("demand", "occupancy"), list(product(Demand, Occupancy)))
def test_each_demand_has_its_answer(demand: Demand, occupancy: Occupancy) -> None:
    lease, now_s = occupied(occupancy)
    assert lease.occupancy(ANNA, now_s) is occupancy
    before, answer = lease.holder, ANSWERS[demand][occupancy]
    if answer in {Answer.REFUSE, Answer.REFUSE_TOO_EARLY}:
        with pytest.raises(LeaseRefusedError) as refused:
            acquired(lease, ANNA, demand, now_s)
        assert (refused.value.holder, refused.value.answer) == ("ben", answer)
        assert lease.holder is before
        return
    session = acquired(lease, ANNA, demand, now_s)
    assert lease.holder is session
    assert (session is before) is (answer is Answer.CONTINUE)
    assert session.streaming is (demand is not Demand.UNARY)
    if before and session is not before:
        assert before.ended is LeaseEnd.TAKEN_OVER


def test_the_table_is_as_promised() -> None:
    """Written out, so that a change of the table is a change of the promise."""
    granted = {
        (demand, occupancy)
        for demand, row in ANSWERS.items()
        for occupancy, answer in row.items()
        if answer is Answer.GRANT
    }
    everyone = set(product(Demand, Occupancy))
    refused = everyone - granted - {(Demand.UNARY, Occupancy.OWN_UNARY)}
    assert refused == {
        (Demand.OPEN, Occupancy.RESTING),
        (Demand.OPEN, Occupancy.HOLDING),
        (Demand.TAKE_OVER, Occupancy.HOLDING),
        (Demand.UNARY, Occupancy.RESTING),
        (Demand.UNARY, Occupancy.HOLDING),
    }


def test_an_operator_may_take_over_when_the_driver_has_released_for_long_enough() -> None:
    lease = Lease()
    session = acquired(lease, BEN)
    lease.take(session, 1, 10.0, held=True)
    lease.take(session, 2, 10.1, held=False)
    with pytest.raises(LeaseRefusedError):
        acquired(lease, ANNA, Demand.TAKE_OVER, 10.0 + RELEASED_S - 0.01)
    assert acquired(lease, ANNA, Demand.TAKE_OVER, 10.0 + RELEASED_S) is lease.holder


def test_the_first_copy_of_a_command_counts() -> None:
    lease = Lease()
    session = acquired(lease, ANNA)
    lease.add_lane(session, 5.0)
    lease.add_lane(session, 5.0)
    assert lease.take(session, 1, 0.0, held=False)
    assert not lease.take(session, 1, 0.01, held=True)
    assert session.heard_s == 0.0
    assert lease.take(session, 3, 0.02, held=False)
    assert not lease.take(session, 2, 0.03, held=True), "overtaken on another lane"


def test_no_command_of_a_session_that_has_ended_counts() -> None:
    lease = Lease()
    session = acquired(lease, ANNA)
    acquired(lease, BEN, Demand.TAKE_OVER_AS_ADMIN)
    assert not lease.take(session, 1, 0.0, held=True)


def test_a_session_ends_with_its_last_lane() -> None:
    lease = Lease()
    session = acquired(lease, ANNA)
    first, second = lease.add_lane(session, 5.0), lease.add_lane(session, 5.0)
    assert not lease.lane_gone(session, first, LeaseEnd.LOST)
    assert lease.lane_gone(session, second, LeaseEnd.CLOSED)
    assert (session.ended, lease.holder) == (LeaseEnd.CLOSED, None)
    assert not lease.lane_gone(session, second, LeaseEnd.LOST), "once"


def test_a_session_has_no_more_than_its_lanes() -> None:
    lease = Lease()
    session = acquired(lease, ANNA)
    numbers = [lease.add_lane(session, 5.0) for _ in range(MAX_LANES)]
    with pytest.raises(TooManyLanesError):
        lease.add_lane(session, 5.0)
    lease.lane_gone(session, numbers[0], LeaseEnd.LOST)
    assert lease.add_lane(session, 5.0) not in numbers


def test_a_lane_that_brings_nothing_makes_room_for_another() -> None:
    """As one whose connection vanished: its driver notices that before the gateway does."""
    lease = Lease()
    session = acquired(lease, ANNA)
    vanished, *others = (lease.add_lane(session, 5.0) for _ in range(MAX_LANES))
    for other in others:
        lease.lane_heard(session, other, 5.0 + LANE_SILENT_S - 0.01)
    with pytest.raises(TooManyLanesError):
        lease.add_lane(session, 5.0 + LANE_SILENT_S - 0.01)
    new = lease.add_lane(session, 5.0 + LANE_SILENT_S)
    assert set(session.lanes) == {*others, new}
    lease.lane_heard(session, vanished, 7.0)
    assert not lease.lane_gone(session, vanished, LeaseEnd.LOST), "the others are its lanes now"
    assert session.ended is None
    with pytest.raises(TooManyLanesError):
        lease.add_lane(session, 5.0 + LANE_SILENT_S)


def test_only_its_own_driver_joins_a_session() -> None:
    lease = Lease()
    session = acquired(lease, ANNA)
    assert lease.find(session.session_id, ANNA) is session
    for session_id, driver in ((session.session_id, BEN), ("another", ANNA)):
        with pytest.raises(NotInSessionError):
            lease.find(session_id, driver)
    lease.end(session, LeaseEnd.DISABLED)
    with pytest.raises(NotInSessionError):
        lease.find(session.session_id, ANNA)


@pytest.mark.parametrize(("demand", "why"), [(Demand.OPEN, LeaseEnd.LOST), (Demand.UNARY, LeaseEnd.CLOSED)])
def test_silence_ends_a_session(demand: Demand, why: LeaseEnd) -> None:
    lease = Lease()
    session = acquired(lease, ANNA, demand, 5.0)
    lease.take(session, 1, 6.0, held=True)
    assert lease.silent(6.0 + SILENCE_S - 0.01) is None
    assert lease.silent(6.0 + SILENCE_S) is session
    assert (session.ended, lease.holder) == (why, None)
    assert lease.silent(100.0) is None
