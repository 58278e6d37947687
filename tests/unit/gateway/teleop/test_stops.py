"""Copies of a stop: which request has stopped the robot already."""

import pytest

from gateway.status.teleop import StopLatch
from gateway.teleop.stops import COPIES_NS, MOST_COPIES, Copies

NOW_NS = 10**15
STOP = StopLatch(stop_id=7, by="anna", reason="", since_ns=NOW_NS)
NEWER = StopLatch(stop_id=8, by="anna", reason="", since_ns=NOW_NS)


def copies() -> Copies:
    made = Copies()
    made.confirmed("anna", "one", STOP, NOW_NS)
    return made


def test_a_copy_gets_the_stop_of_the_first() -> None:
    assert copies().first("anna", "one", NOW_NS + 1) == STOP


@pytest.mark.parametrize(("by", "request_id"), [("anna", "two"), ("ben", "one"), ("anna", "")])
def test_any_other_request_is_no_copy(by: str, request_id: str) -> None:
    assert copies().first(by, request_id, NOW_NS + 1) is None


def test_a_request_without_an_id_has_no_copies() -> None:
    made = Copies()
    made.confirmed("anna", "", STOP, NOW_NS)
    assert made.first("anna", "", NOW_NS + 1) is None


def test_an_id_that_is_used_again_and_again_keeps_no_stop_out_for_long() -> None:
    made = copies()
    made.confirmed("anna", "one", STOP, NOW_NS + COPIES_NS // 2)
    assert made.first("anna", "one", NOW_NS + COPIES_NS - 1) == STOP
    assert made.first("anna", "one", NOW_NS + COPIES_NS) is None
    made.confirmed("anna", "one", NEWER, NOW_NS + COPIES_NS)
    assert made.first("anna", "one", NOW_NS + COPIES_NS + 1) == NEWER


def test_many_requests_push_out_the_oldest_which_then_stop_anew() -> None:
    made = copies()
    for number in range(MOST_COPIES - 1):
        made.confirmed("anna", f"another-{number}", NEWER, NOW_NS + 1)
    assert made.first("anna", "one", NOW_NS + 1) == STOP
    made.confirmed("anna", "one-more", NEWER, NOW_NS + 1)
    assert made.first("anna", "one", NOW_NS + 1) is None
    assert made.first("anna", "one-more", NOW_NS + 1) == NEWER
