"""A small siege (bench/siege) of the real program, held to the promises of the large one."""

import asyncio

import pytest

from bench.siege.ground import own_ground
from bench.siege.judgement import REVOCATION_S
from bench.siege.operator import UNKNOWN_LOGIN_WITHIN_S
from bench.siege.rounds import Outcome, besiege
from bench.siege.size import SMALL
from gateway.rpc.connections.admission import MAX_PENDING
from gateway.rpc.connections.shedding import BURST

pytestmark = [pytest.mark.timed, pytest.mark.alone]

CONNECTION_KIB = 64
"""What a connection over TLS costs at most that only answers pings: 43 KiB of a gateway that closes none, up
to 53 here, with what those cost that are cut off and come back."""
CALL_KIB = 25
"""What a call costs whose refusal is delayed (gateway/rpc/connections/refusal_delay.py)."""
CALLS = 256
"""That a connection may have open."""


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    with own_ground(tmp_path_factory.mktemp("siege")) as ground:
        return asyncio.run(besiege(ground, SMALL))


def test_the_siege_was_one(outcome: Outcome) -> None:
    held, flooded = outcome.attacks
    plan = SMALL.holders
    assert held.tried >= plan.idle + plan.addresses * plan.idle_per_address + plan.slow
    assert held.opened > BURST
    assert flooded.tried >= SMALL.flooders
    assert flooded.opened


def test_every_call_of_the_operator_is_answered(outcome: Outcome) -> None:
    for record in (*outcome.alone, *outcome.besieged, *outcome.between):
        assert record.failures == []
        assert record.status_ms
    assert outcome.besieged[0].login_ms


def test_an_operator_at_an_address_that_the_gateway_has_never_heard_of_gets_in(outcome: Outcome) -> None:
    """After a while. How long that may be, docs/security.md says; no test can, because chance decides."""
    assert outcome.besieged[0].unknown_login_ms
    assert max(outcome.besieged[0].unknown_login_ms) < UNKNOWN_LOGIN_WITHIN_S * 1000


def test_a_revocation_ends_every_stream_amid_the_siege(outcome: Outcome) -> None:
    assert max(outcome.revocation_s) <= REVOCATION_S


def test_memory_grows_by_no_more_than_connections_and_calls_cost(outcome: Outcome) -> None:
    """Beyond what it has with the operator at work and the streams open."""
    plan = SMALL.holders
    connections = plan.idle + plan.addresses * plan.idle_per_address + plan.slow + SMALL.flooders
    assert outcome.unbesieged_mib > 0
    grown_kib = (outcome.peaks.resident_mib - outcome.unbesieged_mib) * 1024
    assert grown_kib <= connections * CONNECTION_KIB + SMALL.flooders * CALLS * CALL_KIB


def test_connections_without_an_admitted_call_are_closed(outcome: Outcome) -> None:
    """More than can be pending, when the attackers left."""
    assert outcome.closed
    assert outcome.closed > MAX_PENDING


def test_strangers_that_are_too_many_are_kept_away(outcome: Outcome) -> None:
    held, _ = outcome.attacks
    plan = SMALL.holders
    assert held.opened < 2 * (plan.idle + plan.addresses * plan.idle_per_address), (
        "they come back each second"
    )
