"""Records of the video tap as samples, losses and notes of a recording. Pure, but for the schema it encodes.

It trusts nothing that comes: a record is what common/video_tap.py says, or MalformedRecordError.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from common.video_tap import Header, Kind, MalformedRecordError, decode_object
from recorder.values import VIDEO_TOPIC, Channel, GapCause, Item, Loss, Note, Sample
from recorder.values.offered_qos import OfferedQos, as_yaml
from recorder.video import access_unit, message
from recorder.video.access_unit import Codec

FRAME_ID: Final = "preview"
STREAM_NOTE: Final = "video_stream"
CLOCK_NOTE: Final = "video_clock"
_MAX_OBJECT_BYTES: Final = 64 << 10
_MAX_ENTRIES: Final = 32
_MAX_TEXT: Final = 1000
_MAX_SKEW_NS: Final = 60 * 1_000_000_000
"""Between capture and reception. More: the two programs do not have the same CLOCK_MONOTONIC."""
_CLOCK_NOTE_EVERY_NS: Final = 10 * 1_000_000_000
_QOS: Final = as_yaml([OfferedQos(reliability="reliable", durability="volatile")])
"""What `ros2 bag play` publishes it with."""


def channel(presets: frozenset[str]) -> Channel:
    """Returns the channel of the video.

    Args:
        presets: names of those that record it.
    """
    return Channel(
        topic=VIDEO_TOPIC,
        type=message.TYPE,
        schema=message.SCHEMA,
        schema_encoding="ros2msg",
        offered_qos=_QOS,
        latched=False,
        presets=presets,
    )


@dataclass(frozen=True, slots=True)
class Now:
    """Both clocks, read one after the other.

    Args:
        monotonic_ns: CLOCK_MONOTONIC.
        calendar_ns: CLOCK_REALTIME.
    """

    monotonic_ns: int
    calendar_ns: int

    def calendar(self, monotonic_ns: int) -> int:
        """Returns the calendar time of another monotonic time."""
        return self.calendar_ns + monotonic_ns - self.monotonic_ns


class Stream:
    """The video of one recording, over all connections to the tap.

    Args:
        of: the channel.
        now: from when on frames are wanted.

    Attributes:
        running: whether the preview says that frames flow.
        error: what the preview says about frames that do not.
        frames: samples so far.
    """

    def __init__(self, of: Channel, now: Now) -> None:
        self.running = False
        self.error = ""
        self.frames = 0
        self._channel = of
        self._codec: Codec | None = None
        self._awaits_key_frame = True
        self._wanted_ns = now.calendar_ns
        self._last_ns: int | None = None
        """Capture time of the newest sample, by the calendar clock."""
        self._missing_since_ns: int | None = None
        """Begin of a loss whose end is not known yet."""
        self._clock_noted_ns = 0

    def disconnected(self, now: Now) -> None:
        """Takes the end of a connection, or an attempt that failed: a loss begins, unless one has."""
        self.running, self._codec, self._awaits_key_frame = False, None, True
        if self._missing_since_ns is None:
            self._missing_since_ns = now.calendar_ns if self._last_ns is None else self._last_ns

    def loss_so_far(self, now: Now) -> list[Item]:
        """Returns the loss up to now, if frames are missing; it lasts on until the next frame."""
        if self._missing_since_ns is None and not (self.running and self.frames):
            self._missing_since_ns = self._wanted_ns if self._last_ns is None else self._last_ns
        losses = self._loss_until(now.calendar_ns)
        if losses:
            self._missing_since_ns = now.calendar_ns
        return losses

    def end(self, now: Now) -> list[Item]:
        """Returns the loss that lasts when no more frames are wanted, if there is one."""
        return self._loss_until(now.calendar_ns)

    def take(self, header: Header, payload: bytes, now: Now) -> list[Item]:
        """Returns what a record means for the recording.

        Raises:
            MalformedRecordError: nothing that the tap would send.
        """
        match header.kind:
            case Kind.ACCESS_UNIT:
                return self._take_unit(header, payload, now)
            case Kind.INFO:
                return self._take_info(_object(payload), now)
            case Kind.GAP:
                return self._take_gap(_object(payload), now)

    def _take_unit(self, header: Header, unit: bytes, now: Now) -> list[Item]:
        codec = self._codec
        if codec is None:
            raise MalformedRecordError("an access unit before its codec is known")
        captured_ns = _calendar(header.captured_ns, now)
        # The flag alone says too little: a decoder can begin here, or not.
        follows = not (header.key_frame and access_unit.content(codec, unit).decodable)
        if self._awaits_key_frame and follows:
            return []
        self._awaits_key_frame = False
        sample = Sample(
            channel=self._channel,
            data=message.encode(captured_ns, FRAME_ID, unit, codec.value),
            log_time_ns=now.calendar_ns,
            publish_time_ns=captured_ns,
            sequence=0,
            monotonic_ns=now.monotonic_ns,
            follows=follows,
        )
        self.frames += 1
        self._last_ns = captured_ns
        return [*self._loss_until(captured_ns), *self._clock_note(now), sample]

    def _take_info(self, info: Mapping[str, Any], now: Now) -> list[Item]:
        if len(info) > _MAX_ENTRIES:
            raise MalformedRecordError(f"an info of {len(info)} entries")
        values = {_text(key): _text(value) for key, value in info.items()}
        self.running = values.get("state") == "running"
        self.error = values.get("error", "")
        if "codec" in values:
            try:
                codec = Codec(values["codec"])
            except ValueError as error:
                raise MalformedRecordError(f"codec '{values['codec']}'") from error
            if codec is not self._codec:
                self._codec, self._awaits_key_frame = codec, True
        return [Note(STREAM_NOTE, values | _pair(now))]

    def _take_gap(self, gap: Mapping[str, Any], now: Now) -> list[Item]:
        frames = gap.get("frames")
        began_ns, ended_ns = (_calendar(gap.get(name), now) for name in ("from_ns", "to_ns"))
        if frames is not None and not _is_count(frames):
            raise MalformedRecordError("a gap of no number of frames")
        self._awaits_key_frame = True
        return [Loss(self._channel, GapCause.VIDEO, began_ns, max(began_ns, ended_ns), frames)]

    def _loss_until(self, ended_ns: int) -> list[Item]:
        began_ns, self._missing_since_ns = self._missing_since_ns, None
        if began_ns is None:
            return []
        return [Loss(self._channel, GapCause.VIDEO, began_ns, max(began_ns, ended_ns), None)]

    def _clock_note(self, now: Now) -> list[Item]:
        if now.monotonic_ns - self._clock_noted_ns < _CLOCK_NOTE_EVERY_NS:
            return []
        self._clock_noted_ns = now.monotonic_ns
        return [Note(CLOCK_NOTE, _pair(now))]


def _pair(now: Now) -> dict[str, str]:
    return {"monotonic_ns": str(now.monotonic_ns), "realtime_ns": str(now.calendar_ns)}


def _object(payload: bytes) -> dict[str, Any]:
    if len(payload) > _MAX_OBJECT_BYTES:
        raise MalformedRecordError(f"a JSON object of {len(payload)} bytes")
    return decode_object(payload)


def _text(value: object) -> str:
    # JSON may have half of a surrogate pair (RFC 8259 8.2), which no file takes.
    return str(value)[:_MAX_TEXT].encode(errors="replace").decode()


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 63


def _calendar(monotonic_ns: object, now: Now) -> int:
    """Returns the calendar time of a capture.

    Raises:
        MalformedRecordError: it is no time that can be.
    """
    if not isinstance(monotonic_ns, int) or abs(monotonic_ns - now.monotonic_ns) > _MAX_SKEW_NS:
        raise MalformedRecordError(
            f"a capture time of {_text(monotonic_ns)} ns, while CLOCK_MONOTONIC is {now.monotonic_ns} ns here"
        )
    calendar_ns = now.calendar(monotonic_ns)
    if not 0 <= calendar_ns < message.MAX_TIME_NS:
        raise MalformedRecordError(f"the calendar clock is {calendar_ns} ns: no message can have that time")
    return calendar_ns
