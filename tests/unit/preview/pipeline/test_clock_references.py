"""Packets with nothing but the clock: what they say, when they are sent, when not."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from preview.pipeline import clock_references
from preview.pipeline.clock_references import ClockReferences, Reference, rhythm
from tests.support.waiting import wait_until

PID, COUNTER = 0x141, 9
PAYLOAD = bytes((0x47, PID >> 8, PID & 0xFF, 0x10 | COUNTER)).ljust(188, b"\0")
TABLE = bytes((0x47, 0x40, 0, 0x10)).ljust(188, b"\xff")
WRAP = (1 << 33) * 300


def frame(ticks: int) -> bytes:
    """A table, a packet with the clock, one more packet."""
    return TABLE + Reference(ticks, PID, 3).packet(0) + PAYLOAD


@pytest.mark.parametrize("ticks", [0, 299, 300, 123_456_789_012, WRAP - 1])
def test_what_is_written_is_read(ticks: int) -> None:
    found = clock_references.read(frame(ticks))
    assert found == Reference(ticks, PID, COUNTER)


def test_the_clock_wraps() -> None:
    found = clock_references.read(Reference(WRAP - 27_000, PID, 0).packet(0.002))
    assert found is not None
    assert found.ticks == 27_000


def test_a_frame_without_a_clock_is_left_alone() -> None:
    assert clock_references.read(TABLE + PAYLOAD) is None
    assert clock_references.read(b"") is None


@pytest.mark.parametrize("fps", [1, 2.5, 5, 10, 12, 15, 20, 24, 25, 30, 60, 120])
def test_never_more_than_40_ms_and_never_ahead_of_the_next_frame(fps: float) -> None:
    count, interval_s = rhythm(fps)
    last_s = count * interval_s
    assert interval_s <= 0.030
    assert last_s < 1 / fps
    assert 1 / fps - last_s <= 0.040
    assert (count == 0) == (fps >= 30)


class Listener:
    """Takes down the references that come, and counts the frames."""

    def __init__(self) -> None:
        self.packets: list[bytes] = []
        self.frames = 0

    def __call__(self, packet: bytes) -> None:
        self.packets.append(packet)

    @property
    def ticks(self) -> list[int]:
        return [found.ticks for packet in self.packets if (found := clock_references.read(packet))]


@pytest.fixture
def listener() -> Listener:
    return Listener()


@pytest.fixture
def slow(listener: Listener) -> Iterator[ClockReferences]:
    """Between frames that come ten times a second."""
    with made_for(listener, 10) as made:
        yield made


@contextmanager
def made_for(listener: Listener, fps: float) -> Iterator[ClockReferences]:
    """References until the block ends; their thread has ended then, too."""
    made = ClockReferences(listener, lambda: listener.frames, fps)
    try:
        yield made
    finally:
        made.stop()
        wait_until(lambda: not has_thread(), "the thread has ended")


def has_thread() -> bool:
    return any(thread.name == "clock-references" for thread in threading.enumerate())


def pass_on(references: ClockReferences, listener: Listener, ticks: int) -> None:
    """Passes a frame on, as the streaming thread does."""
    references.follow(frame(ticks))
    listener.frames += 1


def test_a_frame_is_followed_by_what_it_needs_and_no_more(slow: ClockReferences, listener: Listener) -> None:
    pass_on(slow, listener, 27_000_000)
    wait_until(lambda: len(listener.packets) == 3, "three references")
    # The next frame is late: the stream's clock does not run away from it.
    assert not threading.Event().wait(3 * rhythm(10)[1])
    assert listener.ticks == [27_000_000 + 27_000 * ms for ms in (25, 50, 75)]


def test_they_follow_the_newest_frame_and_keep_its_count(slow: ClockReferences, listener: Listener) -> None:
    pass_on(slow, listener, 0)
    slow.follow(frame(90 * 27_000))
    # Those of the first frame, where this thread has waited for a processor for so long.
    before = len(listener.packets)
    listener.frames += 1
    wait_until(lambda: len(listener.packets) == before + 3, "three references")
    assert listener.ticks[before:] == [27_000 * (90 + ms) for ms in (25, 50, 75)]
    # No payload, so the counter stands where the last packet of the frame left it.
    assert {packet[3] for packet in listener.packets} == {0x20 | COUNTER}
    assert {len(packet) for packet in listener.packets} == {188}


def test_none_comes_before_its_frame(slow: ClockReferences, listener: Listener) -> None:
    pass_on(slow, listener, 0)
    slow.follow(frame(90 * 27_000))
    before = len(listener.packets)
    assert not threading.Event().wait(2 * rhythm(10)[1])
    assert len(listener.packets) == before
    listener.frames += 1
    wait_until(lambda: len(listener.packets) == before + 3, "three references")
    assert listener.ticks[before:] == [27_000 * (90 + ms) for ms in (25, 50, 75)]


def test_where_frames_come_often_there_is_no_thread(listener: Listener) -> None:
    with made_for(listener, 30) as fast:
        pass_on(fast, listener, 0)
        assert not has_thread()
        fast.set_rate(15)
        for number in range(2):
            pass_on(fast, listener, number * 67 * 27_000)
        wait_until(lambda: len(listener.packets) == 1, "a reference")
        fast.set_rate(60)
        wait_until(lambda: not has_thread(), "the thread has ended")


def test_a_new_rhythm_begins_with_the_first_two_frames_in_it(listener: Listener) -> None:
    with made_for(listener, 30) as references:
        references.set_rate(10)
        period = 27_000 * 33
        for number in range(3):
            # What was on its way at the old rate: a reference 75 ms later would be ahead of the next one.
            pass_on(references, listener, number * period)
        assert not threading.Event().wait(0.1)
        assert listener.packets == []
        pass_on(references, listener, 2 * period + 2_700_000)
        wait_until(lambda: len(listener.packets) == 3, "three references")


def test_a_frame_from_before_a_detour_is_forgotten(listener: Listener) -> None:
    with made_for(listener, 10) as references:
        pass_on(references, listener, 0)
        references.set_rate(60)
        # Until then the frame counts: more of them where this thread has waited for a processor.
        before = len(listener.packets)
        pass_on(references, listener, 27_000 * 500)
        references.set_rate(10)
        assert not threading.Event().wait(0.1)
        assert len(listener.packets) == before


def test_after_stop_nothing_comes_and_the_thread_ends(listener: Listener) -> None:
    references = ClockReferences(listener, lambda: listener.frames, 10)
    pass_on(references, listener, 0)
    references.stop()
    wait_until(lambda: not has_thread(), "the thread has ended")
    came = len(listener.packets)
    pass_on(references, listener, 0)
    assert len(listener.packets) == came
