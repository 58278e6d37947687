"""Which addresses may not connect, and for how long."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.rpc.connections.blocklist import (
    BLOCK_FACTOR,
    FIRST_BLOCK_S,
    FLOOD_BLOCK_S,
    FORGOTTEN_AFTER_S,
    LONGEST_BLOCK_S,
    MAX_BLOCKED,
    MAX_REMEMBERED,
    MAX_TRUSTED,
    TRUSTED_S,
    UNUSED_BURST,
    UNUSED_IF_STRICT,
    UNUSED_PER_S,
    Blocklist,
)
from tests.support.clock import Clock

STRANGER, OTHER = "10.0.0.1", "10.0.0.2"


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def blocklist(clock: Clock) -> Blocklist:
    return Blocklist(clock)


def persist(blocklist: Blocklist, prefix: str = STRANGER) -> None:
    """Connects without a call until it is blocked."""
    for _ in range(UNUSED_BURST + 1):
        blocklist.note_unused(prefix)


def block_s(blocklist: Blocklist, clock: Clock) -> float:
    """How long STRANGER is blocked from now on."""
    began_s = clock.now_s
    while STRANGER in blocklist.blocked():
        clock.now_s += 0.125
    return clock.now_s - began_s


def test_an_address_is_blocked_after_many_connections_without_a_call(blocklist: Blocklist) -> None:
    for _ in range(UNUSED_BURST):
        blocklist.note_unused(STRANGER)
    blocklist.note_unused(OTHER)
    assert not blocklist.blocked()
    blocklist.note_unused(STRANGER)
    assert blocklist.blocked() == {STRANGER}


def test_a_probe_every_second_is_never_blocked(blocklist: Blocklist, clock: Clock) -> None:
    for _ in range(10 * UNUSED_BURST):
        for _ in range(int(UNUSED_PER_S)):
            blocklist.note_unused(STRANGER)
        clock.now_s += 1
    assert not blocklist.blocked()


def test_who_persists_is_blocked_for_longer_each_time(blocklist: Blocklist, clock: Clock) -> None:
    blocks = []
    for _ in range(5):
        persist(blocklist)
        blocks.append(block_s(blocklist, clock))
    assert blocks == [1.0, 4.0, 16.0, 64.0, 64.0]
    assert blocks[0] == FIRST_BLOCK_S
    assert blocks[1] == FIRST_BLOCK_S * BLOCK_FACTOR
    assert blocks[-1] == LONGEST_BLOCK_S


def test_it_begins_anew_once_it_was_forgotten(blocklist: Blocklist, clock: Clock) -> None:
    for _ in range(2):
        persist(blocklist)
        block_s(blocklist, clock)
    clock.now_s += FORGOTTEN_AFTER_S
    persist(blocklist)
    assert block_s(blocklist, clock) == FIRST_BLOCK_S


def test_what_was_accepted_before_a_block_does_not_prolong_it(blocklist: Blocklist, clock: Clock) -> None:
    persist(blocklist)
    persist(blocklist)
    assert block_s(blocklist, clock) == FIRST_BLOCK_S


def test_a_flood_is_blocked_at_once_and_for_long(blocklist: Blocklist, clock: Clock) -> None:
    blocklist.note_flood(STRANGER)
    assert block_s(blocklist, clock) == FLOOD_BLOCK_S


def test_a_shorter_block_does_not_end_a_longer_one(blocklist: Blocklist, clock: Clock) -> None:
    for _ in range(UNUSED_BURST):
        blocklist.note_unused(STRANGER)
    blocklist.note_flood(STRANGER)
    blocklist.note_unused(STRANGER)
    assert block_s(blocklist, clock) == FLOOD_BLOCK_S


def test_if_strict_few_unused_connections_block_for_as_long_as_a_flood(
    blocklist: Blocklist, clock: Clock
) -> None:
    for _ in range(UNUSED_IF_STRICT):
        blocklist.note_unused(STRANGER, strict=True)
    assert not blocklist.blocked()
    blocklist.note_unused(STRANGER, strict=True)
    assert block_s(blocklist, clock) == FLOOD_BLOCK_S


def test_trust_is_reported_and_ends(blocklist: Blocklist, clock: Clock) -> None:
    assert not blocklist.is_trusted(STRANGER)
    blocklist.note_admitted(STRANGER)
    assert blocklist.is_trusted(STRANGER)
    assert blocklist.trusted() == {STRANGER, "127.0.0.1", "::", "fe80::"}
    clock.now_s += TRUSTED_S
    assert not blocklist.is_trusted(STRANGER)
    assert blocklist.trusted() == {"127.0.0.1", "::", "fe80::"}


def test_of_too_many_trusted_addresses_the_newest_are_reported(blocklist: Blocklist) -> None:
    for number in range(MAX_TRUSTED):
        blocklist.note_admitted(f"10.1.0.{number}")
    blocklist.note_admitted("10.1.0.0")
    blocklist.note_admitted(STRANGER)
    trusted = blocklist.trusted()
    assert {STRANGER, "10.1.0.0"} <= trusted
    assert "10.1.0.1" not in trusted


def test_an_address_with_an_admitted_call_is_not_blocked(blocklist: Blocklist, clock: Clock) -> None:
    """An operator may share it with a stranger: a router, or a tunnel."""
    blocklist.note_admitted(STRANGER)
    persist(blocklist)
    blocklist.note_flood(STRANGER)
    assert not blocklist.blocked()
    clock.now_s += TRUSTED_S
    persist(blocklist)
    assert blocklist.blocked() == {STRANGER}


def test_an_admitted_call_ends_a_block(blocklist: Blocklist) -> None:
    """Of a connection that was accepted before it."""
    blocklist.note_flood(STRANGER)
    blocklist.note_admitted(STRANGER)
    assert not blocklist.blocked()


@pytest.mark.parametrize("prefix", ["127.0.0.1", "::", "fe80::"])
def test_what_tunnels_and_neighbours_share_is_never_blocked(blocklist: Blocklist, prefix: str) -> None:
    blocklist.note_flood(prefix)
    persist(blocklist, prefix)
    assert not blocklist.blocked()


def test_of_too_many_those_go_that_end_first(blocklist: Blocklist, clock: Clock) -> None:
    persist(blocklist)
    for number in range(MAX_BLOCKED):
        clock.now_s += 0.001
        blocklist.note_flood(f"10.1.0.{number}")
    assert len(blocklist.blocked()) == MAX_BLOCKED
    assert STRANGER not in blocklist.blocked()
    blocklist.note_flood(OTHER)
    assert len(blocklist.blocked()) == MAX_BLOCKED
    assert OTHER in blocklist.blocked()
    assert "10.1.0.0" not in blocklist.blocked()


def test_a_crowd_of_addresses_displaces_neither_blocks_nor_trust(blocklist: Blocklist) -> None:
    blocklist.note_flood(STRANGER)
    blocklist.note_admitted(OTHER)
    for number in range(4 * MAX_REMEMBERED):
        blocklist.note_unused(f"10.{2 + number // 65536}.{number // 256 % 256}.{number % 256}")
    blocklist.note_flood(OTHER)
    assert blocklist.blocked() == {STRANGER}
    assert len(vars(blocklist)["_addresses"]) == MAX_REMEMBERED


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2000), st.floats(0, 100)), max_size=300))
def test_whatever_happens_the_lists_are_bounded_and_trust_holds(
    happened: list[tuple[int, int, float]],
) -> None:
    clock = Clock()
    blocklist = Blocklist(clock)
    trusted: dict[str, float] = {}
    for what, number, pause_s in happened:
        clock.now_s += pause_s
        prefix = f"10.0.{number // 256}.{number % 256}"
        if what == 0:
            blocklist.note_admitted(prefix)
            trusted[prefix] = clock.now_s
        elif what == 1:
            persist(blocklist, prefix)
        else:
            blocklist.note_flood(prefix)
        blocked = blocklist.blocked()
        assert len(blocked) <= MAX_BLOCKED
        assert not [each for each in blocked if clock.now_s - trusted.get(each, -TRUSTED_S) < TRUSTED_S]
        assert (prefix in blocked) is (clock.now_s - trusted.get(prefix, -TRUSTED_S) >= TRUSTED_S)
