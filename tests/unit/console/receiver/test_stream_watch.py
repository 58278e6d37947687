"""Which frames of SRT's own delivery are torn, by a demultiplexer that the test plays."""

from dataclasses import dataclass, field

import pytest

from console.receiver.stream_watch import StreamWatch
from tests.support.mpegts_writer import Writer, coded_frame

GOP = 5
MANY = 1000


@dataclass
class Played:
    """A stream whose frames are of the same size, two by two, and the watch beside its demultiplexer."""

    watch: StreamWatch = field(default_factory=StreamWatch)
    writer: Writer = field(default_factory=Writer)
    frames: int = 0

    def send(self, *, lose: int | None = None) -> bytes:
        """Sends a frame without one of its packets; returns it as it was coded."""
        number, self.frames = self.frames, self.frames + 1
        key = number % GOP == 0
        data = coded_frame("h264", number, key=key, size=400 + number // 2 % 3)
        packets = [self.writer.tables()] if key else []
        packets += self.writer.unit(data, number * 3000)
        if lose is not None:
            del packets[lose]
        self.watch.take(b"".join(packets))
        return data

    def passed_on(self, data: bytes, time_ns: int | None = None) -> bool:
        """The demultiplexer passes a frame on, and the decoder gives it; returns whether it is torn."""
        time_ns = self.frames if time_ns is None else time_ns
        self.watch.note(len(data), time_ns)
        return self.watch.is_torn(time_ns)


@pytest.fixture
def played() -> Played:
    return Played()


def test_without_losses_none_is_torn(played: Played) -> None:
    assert not any(played.passed_on(played.send()) for _ in range(20))


def test_after_a_loss_all_are_torn_up_to_the_key_frame(played: Played) -> None:
    for _ in range(7):
        assert not played.passed_on(played.send())
    played.send(lose=-1)  # The demultiplexer leaves it out.
    assert [played.passed_on(played.send()) for _ in range(7)] == [True, True, *[False] * 5]


def test_a_key_frame_that_is_hit_ends_nothing(played: Played) -> None:
    for _ in range(5):
        assert not played.passed_on(played.send())
    played.send(lose=-1)
    assert [played.passed_on(played.send()) for _ in range(9)] == [True] * 4 + [False] * 5


def test_a_demultiplexer_that_begins_late_and_gives_several_at_once(played: Played) -> None:
    sent = [played.send() for _ in range(3)]
    assert not any(played.passed_on(each, number) for number, each in enumerate(sent))
    assert not played.passed_on(played.send())


def test_one_that_skips_a_whole_frame_is_followed(played: Played) -> None:
    played.passed_on(played.send())
    played.send()
    assert not played.passed_on(played.send())
    assert not played.passed_on(played.send())


def test_of_one_that_gives_something_else_nothing_is_known(played: Played) -> None:
    for _ in range(20):
        assert not played.passed_on(played.send() + bytes(1000))


def test_frames_that_the_decoder_drops_are_forgotten(played: Played) -> None:
    played.passed_on(played.send())
    for time_ns in range(MANY):
        played.watch.note(1, time_ns)
    assert sum(played.watch.is_torn(time_ns) for time_ns in range(MANY)) == 32


def test_video_of_another_codec_is_left_to_the_demultiplexer() -> None:
    played = Played(writer=Writer("mpeg4"))
    assert not any(played.passed_on(played.send()) for _ in range(20))
