"""Records of the tap and what they mean for the recording, hostile ones among them."""

import json
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.video_tap import Header, Kind, MalformedRecordError
from recorder.values import VIDEO_TOPIC, GapCause, Item, Loss, Note, Sample
from recorder.video.stream import CLOCK_NOTE, STREAM_NOTE, Now, Stream, channel

S = 1_000_000_000
NOW = Now(monotonic_ns=1000 * S, calendar_ns=1_800_000_000 * S)
KEY = b"".join(b"\0\0\1" + bytes([kind]) + b"data" for kind in (7, 8, 5))
DELTA = b"\0\0\1\x01data"
INFO = {"state": "running", "codec": "h264", "profile": "balanced", "error": ""}
CHANNEL = channel(frozenset({"driving"}))


class Run:
    """A stream, and the clock, which goes on with each record."""

    def __init__(self, *, informed: bool = True) -> None:
        self.stream = Stream(CHANNEL, NOW)
        self.now = NOW
        if informed:
            self.info(INFO)

    def take(self, header: Header, payload: bytes = b"") -> list[Item]:
        self.now = Now(self.now.monotonic_ns + S // 100, self.now.calendar_ns + S // 100)
        return self.stream.take(header, payload, self.now)

    def info(self, content: object) -> list[Item]:
        return self.take(Header(Kind.INFO, 0), json.dumps(content).encode())

    def gap(self, **content: object) -> list[Item]:
        return self.take(Header(Kind.GAP, 0), json.dumps(content).encode())

    def unit(self, data: bytes = KEY, *, key: bool | None = None, at_ns: int | None = None) -> list[Item]:
        captured_ns = self.now.monotonic_ns if at_ns is None else at_ns
        is_key = data == KEY if key is None else key
        return self.take(Header(Kind.ACCESS_UNIT, len(data), is_key, captured_ns), data)


def samples(items: list[Item]) -> list[Sample]:
    return [item for item in items if isinstance(item, Sample)]


def losses(items: list[Item]) -> list[Loss]:
    return [item for item in items if isinstance(item, Loss)]


def test_an_access_unit_is_stamped_by_both_clocks() -> None:
    run = Run()
    (sample,) = samples(run.unit(at_ns=NOW.monotonic_ns - 5))
    assert sample.channel is CHANNEL
    assert (sample.channel.topic, sample.channel.presets) == (VIDEO_TOPIC, frozenset({"driving"}))
    assert sample.publish_time_ns == NOW.calendar_ns - 5
    assert (sample.log_time_ns, sample.monotonic_ns) == (run.now.calendar_ns, run.now.monotonic_ns)


def test_a_frame_says_whether_a_decoder_can_begin_at_it() -> None:
    run = Run()
    found = [*run.unit(), *run.unit(DELTA), *run.unit(DELTA, key=True), *run.unit()]
    assert [each.follows for each in samples(found)] == [False, True, True, False]


def test_an_info_is_a_note_with_both_clocks() -> None:
    (note,) = Run().info({**INFO, "bitrate_kbps": 1500})
    assert isinstance(note, Note)
    assert note.name == STREAM_NOTE
    assert note.values["bitrate_kbps"] == "1500"
    assert int(note.values["realtime_ns"]) - int(note.values["monotonic_ns"]) == (
        NOW.calendar_ns - NOW.monotonic_ns
    )


def test_the_clocks_are_noted_every_ten_seconds() -> None:
    run = Run()
    notes = [
        item for _ in range(2500) for item in run.unit() if isinstance(item, Note) and item.name == CLOCK_NOTE
    ]
    assert len(notes) == 3


def test_it_begins_with_a_key_frame_that_is_one() -> None:
    run = Run()
    assert run.unit(DELTA) == []
    assert run.unit(DELTA, key=True) == [], "the flag alone is not enough"
    assert samples(run.unit(KEY))
    assert samples(run.unit(DELTA))


def test_a_gap_is_a_loss_and_then_comes_a_key_frame() -> None:
    run = Run()
    run.unit()
    at = run.now.monotonic_ns
    (loss,) = losses(run.gap(frames=7, from_ns=at, to_ns=at + 5))
    assert (loss.cause, loss.messages, loss.ended_ns - loss.began_ns) == (GapCause.VIDEO, 7, 5)
    assert run.unit(DELTA) == []
    assert samples(run.unit(KEY))


def test_a_connection_that_ends_is_a_loss_up_to_the_next_key_frame() -> None:
    run = Run()
    (last,) = samples(run.unit())
    run.stream.disconnected(run.now)
    run.stream.disconnected(run.now)
    run.info(INFO)
    assert run.unit(DELTA) == []
    items = run.unit(KEY)
    (loss,), (sample,) = losses(items), samples(items)
    assert (loss.began_ns, loss.ended_ns) == (last.publish_time_ns, sample.publish_time_ns)
    assert loss.messages is None
    assert items.index(loss) < items.index(sample)
    assert not losses(run.unit())


def test_a_preview_that_was_never_there_is_a_loss_to_the_end() -> None:
    run = Run(informed=False)
    run.stream.disconnected(NOW)
    later = Now(NOW.monotonic_ns + 9 * S, NOW.calendar_ns + 9 * S)
    (loss,) = losses(run.stream.end(later))
    assert loss.ended_ns - loss.began_ns == 9 * S
    assert Run().stream.end(later) == []


def test_a_loss_so_far_is_reported_and_goes_on() -> None:
    run = Run()
    (last,) = samples(run.unit())
    assert run.stream.loss_so_far(run.now) == []
    run.stream.disconnected(run.now)
    stopped, ended = Now(0, last.publish_time_ns + 3 * S), Now(0, last.publish_time_ns + 5 * S)
    (first,) = losses(run.stream.loss_so_far(stopped))
    (rest,) = losses(run.stream.end(ended))
    assert (first.began_ns, first.ended_ns) == (last.publish_time_ns, stopped.calendar_ns)
    assert (rest.began_ns, rest.ended_ns) == (stopped.calendar_ns, ended.calendar_ns)


@pytest.mark.parametrize("informed", [False, True])
def test_a_preview_that_sent_no_frame_so_far_is_a_loss_from_the_beginning(informed: bool) -> None:
    run = Run(informed=informed)
    later = Now(NOW.monotonic_ns + 9 * S, NOW.calendar_ns + 9 * S)
    (loss,) = losses(run.stream.loss_so_far(later))
    assert (loss.began_ns, loss.ended_ns) == (NOW.calendar_ns, later.calendar_ns)


def test_a_preview_whose_frames_do_not_flow_is_a_loss_since_the_last_one() -> None:
    run = Run()
    (last,) = samples(run.unit())
    run.info({"state": "faulted", "error": "no camera"})
    (loss,) = losses(run.stream.loss_so_far(run.now))
    assert (loss.began_ns, loss.ended_ns) == (last.publish_time_ns, run.now.calendar_ns)


def test_another_codec_begins_with_a_key_frame() -> None:
    run = Run()
    run.unit()
    run.info({**INFO, "codec": "h265"})
    assert run.unit(DELTA) == []


def test_it_knows_what_the_preview_says() -> None:
    run = Run()
    assert run.stream.running
    run.info({"state": "faulted", "error": "camera rkisp_mainpath has ended."})
    assert (run.stream.running, run.stream.error) == (False, "camera rkisp_mainpath has ended.")


@pytest.mark.parametrize(
    "content",
    [
        [],
        "text",
        {**INFO, "codec": "av1"},
        {str(number): 1 for number in range(33)},
        {"text": "x" * 70_000},
    ],
    ids=["list", "text", "codec", "entries", "size"],
)
def test_an_info_that_is_none_is_refused(content: object) -> None:
    with pytest.raises(MalformedRecordError):
        Run().info(content)


@pytest.mark.parametrize(
    "changed",
    [
        {"frames": -1},
        {"frames": "7"},
        {"frames": True},
        {"frames": 1 << 63},
        {"from_ns": None},
        {"to_ns": 1e300},
        {"to_ns": 10**300},
        {"from_ns": "1"},
    ],
    ids=str,
)
def test_a_gap_that_is_none_is_refused(changed: dict[str, Any]) -> None:
    gap = {"frames": 1, "from_ns": NOW.monotonic_ns, "to_ns": NOW.monotonic_ns}
    with pytest.raises(MalformedRecordError):
        Run().gap(**(gap | changed))


@pytest.mark.parametrize("at_ns", [0, NOW.monotonic_ns + 61 * S, (1 << 64) - 1])
def test_a_capture_time_of_another_clock_is_refused(at_ns: int) -> None:
    with pytest.raises(MalformedRecordError, match="capture time"):
        Run().unit(at_ns=at_ns)


def test_a_unit_before_its_codec_is_refused() -> None:
    with pytest.raises(MalformedRecordError, match="before its codec"):
        Run(informed=False).unit()


def test_a_long_text_is_cut() -> None:
    (note,) = Run().info({**INFO, "error": "x" * 5000})
    assert isinstance(note, Note)
    assert len(note.values["error"]) == 1000


def test_half_of_a_surrogate_pair_can_be_written() -> None:
    """JSON has it as an escape (RFC 8259 8.2); UTF-8 has not, and so no file would take it."""
    run = Run(informed=False)
    (note,) = run.info({"state": "faulted", "\ud800": "\ud800"})
    assert isinstance(note, Note)
    assert (note.values["?"], note.values["state"]) == ("?", "faulted")


@given(st.sampled_from(Kind), st.binary(max_size=300), st.booleans(), st.integers(0, (1 << 64) - 1))
def test_any_record_is_taken_or_refused(
    kind: Kind, payload: bytes, key: bool, at_ns: int
) -> None:  # hypothesis'
    with suppress(MalformedRecordError):
        Run().take(Header(kind, len(payload), key, at_ns), payload)
