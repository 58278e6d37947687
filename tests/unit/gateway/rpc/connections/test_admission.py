"""Which connections must go: those that take room without an admitted call."""

import pytest

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.config import LimitSettings
from gateway.rpc.calls.call import peer_of
from gateway.rpc.calls.methods import SERVICES
from gateway.rpc.connections.admission import (
    METHOD_RATES,
    NEWCOMER_S,
    NOTICE_S,
    PENDING_S,
    PENDING_STREAMS,
    QUIET_AFTER_S,
    SPARED_S,
    Admission,
)
from gateway.rpc.connections.blocklist import TRUSTED_S, UNUSED_BURST, UNUSED_IF_STRICT
from gateway.rpc.connections.packet_filter import ConnectPolicy
from gateway.rpc.connections.shedding import BURST, LOWER_AFTER_S, RAISE_FACTOR
from tests.support.clock import Clock

PLACES, PER_ADDRESS = 40, 20
"""Of connections with an admitted call, and the same of those without."""
LIMITS = LimitSettings(connections=PLACES, connections_per_address=PER_ADDRESS)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def admission(clock: Clock) -> Admission:
    return Admission(LIMITS, clock, max_connections=4 * PLACES)


def from_one(count: int, first_port: int = 1000, host: str = "10.0.0.5") -> list[str]:
    return [f"{host}:{first_port + number}" for number in range(count)]


def from_many(count: int) -> list[str]:
    return [f"10.1.0.{number}:1000" for number in range(count)]


def admit(admission: Admission, address: str, *credential_ids: str) -> None:
    admission.take_token(peer_of(f"ipv4:{address}"))
    admission.admit(peer_of(f"ipv4:{address}"), credential_ids=credential_ids)


def test_a_pending_connection_has_a_while(admission: Admission, clock: Clock) -> None:
    assert admission.surplus(["10.0.0.5:1"]) == []
    clock.now_s += PENDING_S
    assert admission.surplus(["10.0.0.5:1"]) == []
    clock.now_s += 0.1
    assert admission.surplus(["10.0.0.5:1"]) == ["10.0.0.5:1"]


def test_who_came_a_moment_ago_without_an_admitted_call_is_a_newcomer(
    admission: Admission, clock: Clock
) -> None:
    seen = [admission.has_newcomers()]
    admission.surplus(["10.0.0.5:1"])
    seen.append(admission.has_newcomers())
    clock.now_s += NEWCOMER_S
    admission.surplus(["10.0.0.5:1"])
    seen.append(admission.has_newcomers())
    admission.surplus(["10.0.0.5:1", "10.0.0.5:2"])
    seen.append(admission.has_newcomers())
    admit(admission, "10.0.0.5:2")
    seen.append(admission.has_newcomers())
    assert seen == [False, True, False, True, False]


def test_who_has_lost_access_is_not_cut_off_before_it_knows(admission: Admission, clock: Clock) -> None:
    """However many strangers want the room: it has streams whose end is on its way."""
    revoked = from_one(PER_ADDRESS)
    for address in revoked:
        admit(admission, address, "anna")
    crowd = from_many(2 * PLACES)
    admission.surplus([*revoked, *crowd])
    admission.dismiss_callers([("anna",)], {})
    assert not set(revoked).intersection(admission.surplus([*revoked, *crowd]))
    clock.now_s += NOTICE_S + 0.1
    assert set(revoked).intersection(admission.surplus([*revoked, *crowd]))


def test_calls_that_are_not_admitted_win_no_time(admission: Admission, clock: Clock) -> None:
    """Those of the health service, for example, which lasts as long as its caller likes."""
    peer = peer_of("ipv4:10.0.0.5:1")
    admission.take_token(peer)
    admission.open_stream(peer)
    for _ in range(5):
        admission.take_token(peer)
        admission.surplus([peer.address])
        clock.now_s += PENDING_S / 4
    assert admission.surplus([peer.address]) == [peer.address]
    admission.surplus([])
    admission.close_stream(peer)


def test_an_admitted_one_stays_however_quiet(admission: Admission, clock: Clock) -> None:
    admission.surplus(["10.0.0.5:1"])
    admit(admission, "10.0.0.5:1")
    clock.now_s += 1000 * PENDING_S
    assert admission.surplus(["10.0.0.5:1"]) == []


def test_an_address_that_is_used_again_begins_anew(admission: Admission, clock: Clock) -> None:
    admit(admission, "10.0.0.5:1")
    assert admission.surplus(["10.0.0.5:1"]) == []
    admission.surplus([])
    assert admission.surplus(["10.0.0.5:1"]) == []
    clock.now_s += PENDING_S + 0.1
    assert admission.surplus(["10.0.0.5:1"]) == ["10.0.0.5:1"]


def test_of_one_address_the_oldest_go(admission: Admission, clock: Clock) -> None:
    old, new = from_one(PER_ADDRESS), from_one(5, first_port=5000)
    assert admission.surplus(old) == []
    clock.now_s += SPARED_S + 0.1
    surplus = admission.surplus([*old, *new])
    assert len(surplus) == len(new)
    assert set(surplus) < set(old), "a newcomer has its chance"


def test_the_addresses_of_one_network_are_one(admission: Admission, clock: Clock) -> None:
    """A host chooses 64 bits of its IPv6 address itself."""
    addresses = [f"[2001:db8::{number:x}]:1000" for number in range(1, PER_ADDRESS + 4)]
    admission.surplus(addresses)
    clock.now_s += SPARED_S + 0.1
    assert len(admission.surplus(addresses)) == 3


def test_all_of_one_address_are_spared_for_a_moment_while_there_is_room(
    admission: Admission, clock: Clock
) -> None:
    """After a restart all operators behind one router come back at once."""
    back = from_one(PLACES)
    assert admission.surplus(back) == []
    clock.now_s += SPARED_S
    assert admission.surplus(back) == []
    clock.now_s += 0.1
    assert len(admission.surplus(back)) == PLACES - PER_ADDRESS
    assert len(admission.surplus(from_one(PLACES + 7, first_port=5000))) == 7, "there was no room"


def test_of_all_addresses_the_oldest_go(admission: Admission, clock: Clock) -> None:
    old = from_many(PLACES)
    assert admission.surplus(old) == []
    clock.now_s += 1
    surplus = admission.surplus([*old, "192.0.2.1:1", "192.0.2.2:1"])
    assert len(surplus) == 2
    assert set(surplus) < set(old)


def test_who_comes_from_elsewhere_keeps_its_place_in_a_stampede(admission: Admission, clock: Clock) -> None:
    """Thirty computers with ten connections each, all of them newer than the one of another."""
    operator = "192.0.2.1:1"
    assert admission.surplus([operator]) == []
    for wave in range(5):
        clock.now_s += 0.1
        crowd = [
            address
            for host in range(30)
            for address in from_one(10, first_port=1000 * (1 + wave), host=f"10.2.0.{host}")
        ]
        surplus = admission.surplus([operator, *crowd])
        assert len(surplus) == 1 + len(crowd) - PLACES
        assert operator not in surplus


def test_admitted_ones_take_no_place_of_the_others(admission: Admission) -> None:
    admitted = from_one(PER_ADDRESS)
    for address in admitted:
        admit(admission, address)
    assert admission.surplus([*admitted, *from_one(PER_ADDRESS, first_port=5000)]) == []


def test_pending_ones_take_no_place_of_the_admitted(admission: Admission) -> None:
    for address in from_many(PLACES):
        admission.take_token(peer_of(f"ipv4:{address}"))
        admission.open_stream(peer_of(f"ipv4:{address}"))
    admit(admission, "192.0.2.1:1")


def test_a_place_is_free_again_when_its_connection_has_gone(admission: Admission) -> None:
    for address in from_one(PER_ADDRESS):
        admit(admission, address)
    with pytest.raises(TooMuchError):
        admit(admission, "10.0.0.5:1")
    admission.surplus(["10.0.0.5:1", *from_one(PER_ADDRESS)[1:]])
    admit(admission, "10.0.0.5:1")


def test_who_loses_its_credential_loses_its_place(admission: Admission, clock: Clock) -> None:
    addresses = from_one(PER_ADDRESS)
    for address in addresses:
        admit(admission, address)
    for address in addresses:
        admission.dismiss(peer_of(f"ipv4:{address}"))
    admit(admission, "10.0.0.5:1")
    clock.now_s += PENDING_S + 0.1
    assert sorted(admission.surplus([*addresses, "10.0.0.5:1"])) == sorted(addresses)


def test_one_that_gave_way_has_a_while_to_call_again(admission: Admission, clock: Clock) -> None:
    first, *others = from_one(PER_ADDRESS + 1)
    admit(admission, first)
    clock.now_s += QUIET_AFTER_S
    for address in others:
        admit(admission, address)
    clock.now_s += PENDING_S
    assert admission.surplus([first, *others]) == []
    clock.now_s += 0.1
    assert admission.surplus([first, *others]) == [first]


def test_a_pending_connection_has_few_streams(admission: Admission) -> None:
    peer = peer_of("ipv4:10.0.0.5:1")
    admission.take_token(peer)
    for _ in range(PENDING_STREAMS):
        admission.open_stream(peer)
    with pytest.raises(TooMuchError) as seen:
        admission.open_stream(peer)
    assert seen.value.reason is Reason.TOO_MANY_STREAMS
    admission.admit(peer)
    admission.open_stream(peer)


def test_a_connection_is_pending_until_it_is_admitted(admission: Admission) -> None:
    peer = peer_of("ipv4:10.0.0.5:1")
    assert admission.is_pending(peer)
    admission.take_token(peer)
    assert admission.is_pending(peer)
    admission.admit(peer)
    assert not admission.is_pending(peer)
    admission.dismiss(peer)
    assert admission.is_pending(peer)
    assert not admission.is_pending(peer_of("unix:/run/gateway.sock"))


def test_connections_that_end_unused_get_their_address_blocked(admission: Admission) -> None:
    """Whether the peer closes them or the gateway does."""
    for port in range(UNUSED_BURST + 1):
        assert not admission.connect_policy().blocked
        admission.surplus([f"10.0.0.5:{port}"])
    assert not admission.connect_policy().blocked, "the last one may still call"
    admission.surplus([])
    assert admission.connect_policy().blocked == {"10.0.0.5"}


def test_those_with_an_admitted_call_do_not(admission: Admission) -> None:
    for port in range(2 * UNUSED_BURST):
        admit(admission, f"10.0.0.5:{port}")
        admission.surplus([f"10.0.0.5:{port}"])
    admission.surplus([])
    assert not admission.connect_policy().blocked


def overrun(admission: Admission) -> None:
    """More strangers connect at once than are accepted."""
    admission.surplus([f"10.1.{number}.1:1" for number in range(BURST + 1)])
    assert admission.overrun


def test_a_rush_of_strangers_has_a_share_of_their_attempts_dropped(
    admission: Admission, clock: Clock
) -> None:
    admit(admission, "10.0.0.5:1")
    assert admission.connect_policy() == ConnectPolicy()
    overrun(admission)
    policy = admission.connect_policy()
    assert policy.one_in == RAISE_FACTOR
    assert "10.0.0.5" in policy.spared
    clock.now_s += LOWER_AFTER_S * RAISE_FACTOR
    while admission.overrun:
        clock.now_s += LOWER_AFTER_S
        admission.surplus([])
    assert admission.connect_policy().one_in == 1


def test_connections_from_an_address_with_an_admitted_call_are_no_rush(admission: Admission) -> None:
    admit(admission, "10.0.0.5:1")
    admission.surplus([f"10.0.0.5:{port}" for port in range(1, 2 * BURST)])
    assert not admission.overrun


def test_an_address_is_trusted_for_as_long_as_it_has_a_place_and_a_while_longer(
    admission: Admission, clock: Clock
) -> None:
    """A session may last for hours, on a connection whose calls need be admitted once."""
    stranger = "10.0.0.5:2"
    admit(admission, "10.0.0.5:1")
    for _ in range(int(2 * TRUSTED_S / 60)):
        clock.now_s += 60
        admission.surplus(["10.0.0.5:1"])
    admission.note_flood(stranger)
    assert not admission.connect_policy().blocked
    clock.now_s += TRUSTED_S / 2
    admission.surplus([])
    admission.note_flood(stranger)
    assert not admission.connect_policy().blocked
    clock.now_s += TRUSTED_S
    admission.surplus([])
    admission.note_flood(stranger)
    assert admission.connect_policy().blocked == {"10.0.0.5"}


def test_amid_a_rush_few_unused_connections_get_an_address_blocked(admission: Admission) -> None:
    overrun(admission)
    for port in range(UNUSED_IF_STRICT + 1):
        assert "10.0.0.7" not in admission.connect_policy().blocked
        admission.surplus([f"10.0.0.7:{port}"])
    admission.surplus([])
    assert "10.0.0.7" in admission.connect_policy().blocked


def test_a_connection_that_is_closed_as_surplus_is_unused_once(admission: Admission, clock: Clock) -> None:
    for port in range(UNUSED_BURST):
        address = f"10.0.0.5:{port}"
        admission.surplus([address])
        clock.now_s += PENDING_S + 0.1
        assert admission.surplus([address]) == [address]
        assert admission.surplus([address]) == [address], "it is still there"
        admission.surplus([])
    assert not admission.connect_policy().blocked


def test_pending_connections_of_a_blocked_address_are_known(admission: Admission) -> None:
    admission.surplus(["10.0.0.5:1", "10.0.0.5:2", "10.0.0.6:1"])
    assert admission.pending_of_blocked() == []
    admission.note_flood("10.0.0.5:1")
    assert sorted(admission.pending_of_blocked()) == ["10.0.0.5:1", "10.0.0.5:2"]
    assert (admission.floods("10.0.0.5:1"), admission.floods("10.0.0.5:2")) == (True, False)


def test_a_unix_socket_is_not_limited(clock: Clock) -> None:
    """All of its callers have one name, and the container's own health check is among them."""
    admission = Admission(LimitSettings(connections=1, streams_per_connection=1, burst=1), clock)
    admit(admission, "10.0.0.5:1")
    peer = peer_of("unix:/run/gateway.sock")
    for _ in range(10):
        admission.take_token(peer)
        admission.open_stream(peer)
        admission.admit(peer)
    for _ in range(10):
        admission.close_stream(peer)
    assert admission.surplus(["10.0.0.5:1"]) == []


def test_a_method_may_have_a_rate_of_its_own(admission: Admission, clock: Clock) -> None:
    peer, other = peer_of("ipv4:10.0.0.5:1"), peer_of("ipv4:10.0.0.5:2")
    rate = METHOD_RATES["RequestKeyFrame"]
    for _ in range(int(rate)):
        admission.take_token(peer, "RequestKeyFrame")
    with pytest.raises(TooMuchError, match="calls RequestKeyFrame more than 3 times a second") as caught:
        admission.take_token(peer, "RequestKeyFrame")
    assert caught.value.reason is Reason.TOO_MANY_REQUESTS
    assert caught.value.retry_after_s == pytest.approx(1 / rate)
    admission.take_token(peer, "ReportPicture")
    admission.take_token(peer, "GetSystemStatus")
    admission.take_token(other, "RequestKeyFrame")
    clock.now_s += 1.1 / rate
    admission.take_token(peer, "RequestKeyFrame")


def test_every_method_with_a_rate_is_one_of_the_contract() -> None:
    assert set(METHOD_RATES) <= {name for each in SERVICES for name in each.methods_by_name}
