import pytest

from console.receiver.rejoins import Rejoins

BEGUN_S = 100.0


@pytest.fixture
def rejoins() -> Rejoins:
    return Rejoins(BEGUN_S)


def test_after_a_picture_the_next_connection_is_made_at_once(rejoins: Rejoins) -> None:
    assert [rejoins.pause_s(BEGUN_S + number, BEGUN_S + number) for number in range(50)] == [0.0] * 50


def test_connections_in_vain_are_made_ever_less_often_and_come_to_an_end(rejoins: Rejoins) -> None:
    """Each lasts as long as on a link that is far too narrow."""
    now_s, pauses_s = BEGUN_S, list[float | None]()
    while None not in pauses_s:
        now_s += 0.6 + (pauses_s[-1] or 0.0 if pauses_s else 0.0)
        pauses_s.append(rejoins.pause_s(now_s, None))
    assert pauses_s == [0.0, 0.25, 0.5, 1.0, 1.0, None]
    assert rejoins.without_s(now_s) == pytest.approx(6 * 0.6 + 2.75)


def test_a_picture_begins_it_anew(rejoins: Rejoins) -> None:
    for now_s in (101.0, 102.0, 103.0):
        rejoins.pause_s(now_s, None)
    assert rejoins.pause_s(104.0, 104.0) == 0.0
    assert [rejoins.pause_s(now_s, None) for now_s in (105.0, 106.0, 108.9)] == [0.0, 0.25, 0.5]
    assert rejoins.pause_s(109.0, None) is None


def test_one_long_connection_in_vain_is_no_end(rejoins: Rejoins) -> None:
    """As after a stall of this computer."""
    assert rejoins.pause_s(BEGUN_S + 60, None) == 0.0
    assert rejoins.pause_s(BEGUN_S + 61, None) is None


def test_the_time_without_a_picture_begins_with_the_last_one(rejoins: Rejoins) -> None:
    """Not with the end of its connection, which may have brought none for seconds."""
    assert rejoins.pause_s(104.0, 101.0) == 0.0
    assert rejoins.without_s(104.0) == 3.0
    assert rejoins.pause_s(104.6, None) == 0.0
    assert rejoins.pause_s(106.0, None) is None
