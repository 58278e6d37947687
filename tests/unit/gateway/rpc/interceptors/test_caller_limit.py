"""What a caller gets does not depend on how many connections it has."""

from collections.abc import Awaitable
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.access.credential import Principal
from gateway.access.role import Role
from gateway.config import LimitSettings
from gateway.rpc.calls.methods import TELEOP, Method
from gateway.rpc.connections.admission import FORGIVEN_AFTER_S, Admission
from gateway.rpc.connections.caller_shares import MAX_OPEN_CALLS, CallerShares
from gateway.rpc.connections.refusal_delay import RefusalDelay
from gateway.rpc.interceptors.caller_limit import CallerLimit
from gateway.rpc.interceptors.room import MAX_OPEN
from tests.support.calls import call_of
from tests.support.clock import Clock
from tests.support.virtual_time import in_virtual_time

if TYPE_CHECKING:
    from gateway.rpc.calls.call import CallContext

SMALL = LimitSettings(caller_requests_per_s=5, caller_streams=3)
BURST = 10


class Ground:
    """A limit, and the connections of callers."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.admission = Admission(SMALL, self.clock)
        self.refusals = RefusalDelay()
        self.limit = CallerLimit(CallerShares(SMALL, self.clock), self.admission, self.refusals)

    def call(self, who: str, port: int = 1, *, streaming: bool = False) -> "tuple[CallContext, bool]":
        """A call of this name, by another connection for each port; whether it is served."""
        call = call_of(peer=f"ipv4:10.0.0.5:{port}", streaming=streaming)
        call.principal = Principal(who, Role.VIEWER, ("id",)) if who else None
        waiting = self.limit.on_call(call)
        if waiting is not None:
            dismiss(waiting)
        return call, waiting is None

    def served(self, who: str, calls: int) -> int:
        return sum(self.call(who, port)[1] for port in range(1, calls + 1))


def dismiss(waiting: Awaitable[None]) -> None:
    close = getattr(waiting, "close")  # noqa: B009  # a coroutine, which is not awaited here
    close()


@pytest.fixture
def ground() -> Ground:
    return Ground()


def test_all_connections_of_a_caller_share_a_bucket_and_others_have_their_own(ground: Ground) -> None:
    assert ground.served("ben", 100) == BURST
    assert ground.served("anna", 100) == BURST
    ground.clock.now_s += 1
    assert ground.served("ben", 100) == SMALL.caller_requests_per_s


def test_without_a_name_the_address_is_the_caller(ground: Ground) -> None:
    assert ground.served("", 100) == BURST
    assert ground.served("ben", 100) == BURST


def test_so_are_streams_until_they_end(ground: Ground) -> None:
    opened = [ground.call("ben", port, streaming=True) for port in range(4)]
    assert [served for _, served in opened] == [True] * 3 + [False]
    assert ground.call("anna", streaming=True)[1]
    ground.limit.on_end(opened[0][0], None)
    assert ground.call("ben", 7, streaming=True)[1]


def test_so_are_other_calls_while_they_are_open(ground: Ground, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.rpc.connections.caller_shares.MAX_OPEN_CALLS", 3)
    opened = [ground.call("ben", port) for port in range(4)]
    assert [served for _, served in opened] == [True] * 3 + [False]
    assert ground.call("ben", 5, streaming=True)[1], "streams have a limit of their own"
    assert ground.call("anna")[1]
    ground.limit.on_end(opened[0][0], None)
    assert ground.call("ben", 6)[1]


def test_a_few_callers_can_not_take_all_the_calls_that_the_gateway_serves() -> None:
    assert 4 * (MAX_OPEN_CALLS + LimitSettings().caller_streams) < MAX_OPEN


@in_virtual_time
async def test_a_refusal_says_what_is_shared_and_is_delayed(ground: Ground) -> None:
    ground.served("ben", BURST)
    call = call_of()
    call.principal = Principal("ben", Role.VIEWER, ("id",))
    waiting = ground.limit.on_call(call)
    assert waiting is not None
    with pytest.raises(TooMuchError, match="connections of ben") as seen:
        await waiting
    assert seen.value.reason is Reason.TOO_MANY_REQUESTS


def test_stops_and_what_needs_no_credential_pass() -> None:
    limit = Ground().limit
    for path in (f"/{TELEOP.full_name}/StopRobot", "/grpc.health.v1.Health/Check"):
        assert not limit.applies_to(Method(path))
    assert limit.applies_to(Method(f"/{TELEOP.full_name}/Drive"))


def test_a_connection_whose_refusals_can_not_be_delayed_is_restrained_for_a_while(
    ground: Ground, monkeypatch: pytest.MonkeyPatch
) -> None:
    for port in (1, 2):
        peer = call_of(peer=f"ipv4:10.0.0.5:{port}").peer
        ground.admission.take_token(peer)
        ground.admission.admit(peer, "ben")
        assert not ground.admission.is_restrained(peer)
    ground.served("ben", BURST)
    ground.call("ben", 1)
    assert not ground.admission.is_restrained(call_of(peer="ipv4:10.0.0.5:1").peer)
    monkeypatch.setattr("gateway.rpc.connections.refusal_delay._MAX_DELAYED", 0)
    ground.call("ben", 1)
    assert ground.admission.is_restrained(call_of(peer="ipv4:10.0.0.5:1").peer)
    assert not ground.admission.is_restrained(call_of(peer="ipv4:10.0.0.5:2").peer)
    ground.clock.now_s += FORGIVEN_AFTER_S
    assert not ground.admission.is_restrained(call_of(peer="ipv4:10.0.0.5:1").peer)


@given(st.lists(st.tuples(st.sampled_from(["anna", "ben", ""]), st.floats(0, 0.5)), max_size=200))
def test_no_caller_gets_more_than_its_share_whatever_the_others_do(asked: list[tuple[str, float]]) -> None:
    ground = Ground()
    served: dict[str, list[float]] = {}
    for number, (who, pause_s) in enumerate(asked):
        ground.clock.now_s += pause_s
        if ground.call(who, 1 + number)[1]:
            served.setdefault(who, []).append(ground.clock.now_s)
    for instants in served.values():
        for number, first_s in enumerate(instants):
            for later, last_s in enumerate(instants[number:], start=1):
                assert later <= BURST + (last_s - first_s) * SMALL.caller_requests_per_s + 1e-6


def test_buckets_of_many_callers_do_not_stay(ground: Ground) -> None:
    shares = CallerShares(SMALL, ground.clock)
    for number in range(5000):
        ground.clock.now_s += 0.1
        shares.take_token(f"10.0.{number // 256}.{number % 256}")
    assert len(vars(shares)["_buckets"]) <= 256
