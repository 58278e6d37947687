import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.status.watch_pacing import HEARTBEAT_MS, TICK_MS, WatchPacing

BEAT = HEARTBEAT_MS // TICK_MS


@pytest.mark.parametrize(("asked_ms", "ticks"), [(0, 1), (1, 1), (50, 1), (51, 2), (100, 2), (1000, 20)])
def test_an_interval_is_rounded_up_to_whole_ticks(asked_ms: int, ticks: int) -> None:
    pace = WatchPacing(asked_ms, now=7, version=1)
    assert next(number for number in range(1, 40) if pace.due(7 + number, version=2)) == ticks


def test_without_a_change_only_the_heartbeat_is_due() -> None:
    pace = WatchPacing(100, now=0, version=1)
    assert not pace.due(BEAT - 1, version=1)
    assert pace.due(BEAT, version=1)


def test_a_longer_interval_is_the_heartbeat_as_well() -> None:
    pace = WatchPacing(3000, now=0, version=1)
    assert not pace.due(3 * BEAT - 1, version=2)
    assert pace.due(3 * BEAT, version=1)


@given(
    st.integers(0, 60_000),
    st.lists(st.tuples(st.integers(1, 30), st.booleans()), min_size=1, max_size=200),
)
def test_never_too_often_and_every_change_is_sent(asked_ms: int, steps: list[tuple[int, bool]]) -> None:
    now, version, sent_at, sent_version = 0, 0, 0, 0
    pace = WatchPacing(asked_ms, now, version)
    for ticks, changed in steps:
        version += changed
        for _ in range(ticks):
            now += 1
            if pace.due(now, version):
                assert (now - sent_at) * TICK_MS >= min(asked_ms, HEARTBEAT_MS) or version != sent_version
                assert (now - sent_at) * TICK_MS >= asked_ms
                pace.sent(now, version)
                sent_at, sent_version = now, version
            else:
                late = now - sent_at >= max(BEAT, -(-asked_ms // TICK_MS))
                assert not late, "ages are shown in time"
