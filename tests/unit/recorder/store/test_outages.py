"""When the ring was not written."""

from recorder.store.outages import Outages
from recorder.values import Gap, GapCause


def gap(began_ns: int, ended_ns: int, cause: GapCause = GapCause.DISK) -> Gap:
    return Gap("", cause, began_ns, ended_ns, None)


def test_what_lies_in_a_window_is_cut_to_it() -> None:
    outages = Outages()
    assert not Outages().known
    outages.begin(GapCause.INTERRUPTED, 10)
    outages.begin(GapCause.DISK, 15)  # It still lasts.
    outages.end(20)
    outages.end(25)  # It lasts no more.
    outages.begin(GapCause.DISK, 30)
    assert outages.known
    assert outages.within(0, 100, now_ns=40) == (gap(10, 20, GapCause.INTERRUPTED), gap(30, 40))
    assert outages.within(15, 35, now_ns=40) == (gap(15, 20, GapCause.INTERRUPTED), gap(30, 35))
    assert outages.within(20, 30, now_ns=40) == ()


def test_a_clock_that_is_set_back_makes_no_negative_gap() -> None:
    outages = Outages()
    outages.begin(GapCause.DISK, 100)
    outages.end(50)
    assert outages.within(0, 200, now_ns=60) == (gap(100, 100),)
