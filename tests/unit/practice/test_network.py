"""The practice network: when what is sent arrives."""

import pytest

from practice.network import GAP_EVERY_S, NETWORKS, Network

GOOD, OLD_PICTURE, SILENT, DELAYS, GAPS, CUT = NETWORKS


def test_it_begins_with_a_good_one() -> None:
    assert GOOD.arrives_s(10.0) == pytest.approx(10.005)
    assert GOOD.picture_arrives_s(10.0) == pytest.approx(10.06)
    assert GOOD.camera


def test_each_has_a_title_and_a_lesson_of_its_own() -> None:
    assert len({each.title for each in NETWORKS}) == len({each.lesson for each in NETWORKS}) == len(NETWORKS)


def test_an_old_picture_and_long_delays() -> None:
    assert OLD_PICTURE.picture_arrives_s(10.0) == pytest.approx(10.45)
    assert OLD_PICTURE.arrives_s(10.0) == GOOD.arrives_s(10.0)
    assert DELAYS.arrives_s(10.0) == pytest.approx(10.15)


def test_a_silent_camera_sends_nothing_over_a_good_network() -> None:
    assert not SILENT.camera
    assert SILENT.arrives_s(10.0) == GOOD.arrives_s(10.0)


def test_what_is_sent_in_a_gap_arrives_after_it() -> None:
    begins_s = 4 * GAP_EVERY_S
    for sent_s in (begins_s, begins_s + 0.1, begins_s + 0.39):
        assert GAPS.arrives_s(sent_s) == pytest.approx(begins_s + 0.405)
        assert GAPS.picture_arrives_s(sent_s) == pytest.approx(begins_s + 0.46)
    assert GAPS.arrives_s(begins_s + 0.5) == pytest.approx(begins_s + 0.505)


@pytest.mark.parametrize("at_s", [0.0, 1.0, 1e6])
def test_a_cut_network_passes_nothing(at_s: float) -> None:
    assert CUT.arrives_s(at_s) is None
    assert CUT.picture_arrives_s(at_s) is None


def test_a_network_without_gaps_has_none_at_its_beginning() -> None:
    assert Network("", "").arrives_s(0.0) == pytest.approx(0.005)
