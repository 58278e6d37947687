"""Every connection has its share, and none has the share of another."""

import gc
import weakref

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.config import LimitSettings
from gateway.rpc.calls.call import Peer
from gateway.rpc.calls.call import peer_of as peer_of_connection
from gateway.rpc.calls.methods import TELEOP
from gateway.rpc.connections.admission import FORGIVEN_AFTER_S, QUIET_AFTER_S, Admission
from gateway.rpc.connections.refusal_delay import REFUSAL_DELAY_S, REFUSAL_SPACING_S, RefusalDelay
from gateway.rpc.interceptors.rate_limit import RateLimit
from tests.support.calls import call_of
from tests.support.clock import Clock

SMALL = LimitSettings(connections=3, streams_per_connection=2, requests_per_s=10, burst=5)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def admission(clock: Clock) -> Admission:
    return Admission(SMALL, clock)


def peer_of(name: str) -> Peer:
    """A connection by gRPC's name, or that of a computer by one letter."""
    return peer_of_connection(name if ":" in name else f"ipv4:10.1.1.{ord(name)}:1")


def count(admission: Admission) -> int:
    """How many places are taken."""
    return int(vars(admission)["_places"].total())


def call(admission: Admission, peer: str) -> None:
    """A call that is admitted."""
    admission.take_token(peer_of(peer))
    admission.admit(peer_of(peer))


def refusal(admission: Admission, peer: str) -> TooMuchError:
    with pytest.raises(TooMuchError) as seen:
        call(admission, peer)
    return seen.value


def test_a_burst_is_served_and_then_one_by_one(admission: Admission, clock: Clock) -> None:
    for _ in range(SMALL.burst):
        admission.take_token(peer_of("a"))
    error = refusal(admission, "a")
    assert error.reason is Reason.TOO_MANY_REQUESTS
    assert error.retry_after_s == pytest.approx(0.1)
    clock.now_s += 0.1001
    admission.take_token(peer_of("a"))
    assert refusal(admission, "a").retry_after_s == pytest.approx(0.1, rel=0.01)


def test_who_was_refused_saves_nothing_up_until_it_is_forgiven(admission: Admission, clock: Clock) -> None:
    for _ in range(SMALL.burst):
        admission.take_token(peer_of("a"))
    refusal(admission, "a")
    clock.now_s += FORGIVEN_AFTER_S * 0.9
    admission.take_token(peer_of("a"))
    refusal(admission, "a")
    clock.now_s += FORGIVEN_AFTER_S
    for _ in range(SMALL.burst):
        admission.take_token(peer_of("a"))


def test_what_one_has_spent_the_other_still_has(admission: Admission) -> None:
    for _ in range(SMALL.burst):
        admission.take_token(peer_of("a"))
    refusal(admission, "a")
    admission.take_token(peer_of("b"))


def test_streams_are_counted_while_they_are_open(admission: Admission) -> None:
    call(admission, "a")
    admission.open_stream(peer_of("a"))
    admission.open_stream(peer_of("a"))
    with pytest.raises(TooMuchError) as seen:
        admission.open_stream(peer_of("a"))
    assert seen.value.reason is Reason.TOO_MANY_STREAMS
    admission.close_stream(peer_of("a"))
    admission.open_stream(peer_of("a"))


def test_a_new_connection_takes_the_place_of_the_quietest(admission: Admission, clock: Clock) -> None:
    for peer in ("a", "b", "c"):
        call(admission, peer)
    error = refusal(admission, "d")
    assert error.reason is Reason.TOO_MANY_CONNECTIONS
    assert error.retry_after_s
    clock.now_s += QUIET_AFTER_S
    call(admission, "a")
    call(admission, "d")
    assert count(admission) == 3
    call(admission, "c")
    assert refusal(admission, "b").reason is Reason.TOO_MANY_CONNECTIONS, "b was the quietest"


def test_one_address_may_take_its_part_of_the_connections_and_no_more(clock: Clock) -> None:
    admission = Admission(LimitSettings(connections=4, connections_per_address=2), clock)
    for peer in ("ipv4:10.0.0.5:1", "ipv4:10.0.0.5:2"):
        call(admission, peer)
    error = refusal(admission, "ipv4:10.0.0.5:3")
    assert error.reason is Reason.TOO_MANY_CONNECTIONS
    assert "of one address" in str(error)
    for peer in ("ipv4:10.0.0.6:1", "ipv6:[2001:db8::5]:1"):
        call(admission, peer)
    assert "all are taken" in str(refusal(admission, "ipv4:10.0.0.7:1"))
    clock.now_s += QUIET_AFTER_S
    for peer in ("ipv4:10.0.0.5:2", "ipv4:10.0.0.6:1"):
        call(admission, peer)
    call(admission, "ipv4:10.0.0.5:3")
    assert "of one address" in str(refusal(admission, "ipv4:10.0.0.5:1")), (
        "its quietest gave way, not another's"
    )
    call(admission, "ipv4:10.0.0.7:1")
    assert count(admission) == 4


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 5), st.floats(0, 3)), max_size=60))
def test_no_address_ever_has_more_than_its_part(asked: list[tuple[int, int, float]]) -> None:
    clock = Clock()
    admission = Admission(LimitSettings(connections=6, connections_per_address=3), clock)
    served: dict[str, float] = {}
    for host, port, pause_s in asked:
        clock.now_s += pause_s
        peer = f"ipv4:10.0.0.{host}:{port}"
        try:
            call(admission, peer)
        except TooMuchError:
            busy = [each for each, at_s in served.items() if clock.now_s - at_s < QUIET_AFTER_S]
            same = [each for each in busy if each.rpartition(":")[0] == peer.rpartition(":")[0]]
            assert len(same) >= 3 or len(busy) >= 6, "refused only where its part, or everything, is taken"
            continue
        served[peer] = clock.now_s
        assert count(admission) <= 6


def test_who_has_a_stream_open_is_never_put_out(admission: Admission, clock: Clock) -> None:
    for peer in ("a", "b", "c"):
        call(admission, peer)
        admission.open_stream(peer_of(peer))
    clock.now_s += 3600
    assert refusal(admission, "d").reason is Reason.TOO_MANY_CONNECTIONS


def limiting(admission: Admission) -> RateLimit:
    return RateLimit(admission, RefusalDelay(), admits=True)


def test_delayed_refusals_are_spaced() -> None:
    refusals = RefusalDelay()
    delays = [refusals.next_delay_s(100.0) for _ in range(3)]
    assert delays == pytest.approx([REFUSAL_DELAY_S + each * REFUSAL_SPACING_S for each in range(3)])
    assert refusals.next_delay_s(160.0) == pytest.approx(REFUSAL_DELAY_S)


def test_a_call_that_waited_for_its_turn_is_delayed_by_less() -> None:
    assert RefusalDelay().next_delay_s(100.0, waited_s=0.2) == pytest.approx(REFUSAL_DELAY_S - 0.2)
    refusals = RefusalDelay()
    assert refusals.next_delay_s(100.0, waited_s=60.0) == 0
    assert refusals.next_delay_s(100.0, waited_s=60.0) == pytest.approx(REFUSAL_SPACING_S), "still spaced"


def test_callers_that_leave_at_once_do_not_delay_others_for_ever() -> None:
    refusals = RefusalDelay()
    assert max(refusals.next_delay_s(100.0) for _ in range(100_000)) < 20


@given(st.lists(st.tuples(st.sampled_from("abcdef"), st.floats(0, 0.3)), max_size=200))
def test_no_caller_gets_more_than_its_share_whatever_the_others_do(asked: list[tuple[str, float]]) -> None:
    clock = Clock()
    admission = Admission(LimitSettings(connections=100, requests_per_s=10, burst=5), clock)
    served: dict[str, list[float]] = {}
    refused: list[TooMuchError] = []
    for peer, pause_s in asked:
        clock.now_s += pause_s
        try:
            call(admission, peer)
        except TooMuchError as error:
            refused.append(error)
        else:
            served.setdefault(peer, []).append(clock.now_s)
    assert all(0 < (error.retry_after_s or 0) <= 0.1 + 1e-9 for error in refused)
    for instants in served.values():
        for number, first_s in enumerate(instants):
            for later, last_s in enumerate(instants[number:], start=1):
                assert later <= 5 + (last_s - first_s) * 10 + 1e-6


def test_each_message_of_a_request_stream_takes_a_token(admission: Admission, clock: Clock) -> None:
    limit = limiting(admission)
    stream = call_of("Drive", request_streaming=True)
    assert limit.on_call(stream) is None
    for _ in range(SMALL.burst - 1):
        assert limit.on_request(stream, b"message") == b"message"
    with pytest.raises(TooMuchError) as seen:
        limit.on_request(stream, b"message")
    assert seen.value.reason is Reason.TOO_MANY_REQUESTS
    clock.now_s += 0.1001
    limit.on_request(stream, b"message")


def test_a_request_is_no_message_of_a_stream(admission: Admission) -> None:
    limit, stream = limiting(admission), call_of(streaming=True)
    limit.on_call(stream)
    for _ in range(3 * SMALL.burst):
        limit.on_request(stream, b"message")


async def test_a_delayed_refusal_leaves_no_garbage_behind() -> None:
    """A circle of references would keep call and error until the next collection, in a flood of them."""
    limit = limiting(Admission(LimitSettings(requests_per_s=0.1, burst=1)))
    ping = call_of()
    assert limit.on_call(ping) is None
    waiting = limit.on_call(ping)
    assert waiting is not None
    gc.disable()
    try:
        try:
            await waiting
        except TooMuchError as error:
            gone = weakref.ref(error)
        del waiting
        assert gone() is None
    finally:
        gc.enable()


def test_a_stop_is_never_refused_and_takes_nothing_from_others() -> None:
    """Whatever the connection has used up: calls, streams, places."""
    none_left = Admission(LimitSettings(connections=1, requests_per_s=1, burst=1), Clock())
    call(none_left, "a")
    limit = RateLimit(none_left, RefusalDelay(), admits=True)
    for peer in ("ipv4:10.1.1.97:1", "ipv4:10.9.9.9:1"):
        for _ in range(100):
            assert limit.on_call(call_of("StopRobot", peer=peer, service=TELEOP.full_name)) is None
    with pytest.raises(TooMuchError):
        none_left.take_token(peer_of("a"))


def test_a_stop_of_an_unknown_caller_takes_a_token() -> None:
    admission = Admission(LimitSettings(requests_per_s=1, burst=1), Clock())
    limit = RateLimit(admission, RefusalDelay(), admits=False)
    stop = call_of("StopRobot", peer="ipv4:10.1.1.97:1", service=TELEOP.full_name)
    stop.unlimited = False
    assert limit.on_call(stop) is None
    with pytest.raises(TooMuchError):
        admission.take_token(peer_of("a"))


def test_one_caller_may_have_its_connections_and_no_more_wherever_they_come_from(clock: Clock) -> None:
    admission = Admission(LimitSettings(connections_per_caller=2), clock)

    def admit(address: str, caller: str) -> None:
        admission.take_token(peer_of(address))
        admission.admit(peer_of(address), caller)

    admit("ipv4:10.0.0.5:1", "ben")
    admit("ipv4:10.0.0.6:1", "ben")
    with pytest.raises(TooMuchError, match="connections of ben") as seen:
        admit("ipv4:10.0.0.7:1", "ben")
    assert seen.value.reason is Reason.TOO_MANY_CONNECTIONS
    admit("ipv4:10.0.0.5:2", "anna")
    admission.open_stream(peer_of("ipv4:10.0.0.5:1"))
    clock.now_s += QUIET_AFTER_S
    admit("ipv4:10.0.0.7:1", "ben")
    assert admission.is_pending(peer_of("ipv4:10.0.0.6:1")), "the quiet one gave way"
    admission.dismiss(peer_of("ipv4:10.0.0.7:1"))
    admit("ipv4:10.0.0.8:1", "ben")
