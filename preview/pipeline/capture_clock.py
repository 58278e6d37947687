"""Timestamps of the stream: PTS is the capture time on CLOCK_MONOTONIC, plus a constant.

A pipeline's running time begins at 0 when it starts to play, and mpegtsmux writes it as PTS, an hour ahead.
So the pipeline runs on the monotonic clock, and its base time, where that clock stood when it began, is added
to the running time behind the source: PTS then means the same in every pipeline of every process, whatever
was switched, rebuilt or restarted in between, until the computer restarts.

- A base time of 0 would do the same without an offset, but sources see it: whatever plays at its own speed (a
  file behind clocksync, a description with identity sync=true) counts from 0, and would be late by all of the
  computer's uptime.
- The offset is before the encoder: a request for a key frame travels upstream through the pads behind it, and
  GStreamer adds a pad's offset to the time of the request even where that is "at once" (1.22).
- A camera that is started later (camera_switch.py) has a base time of its own, so that what plays at its own
  speed counts from 0 there as well. The difference is added in front of the source's last element, which
  stamps the frames anew: for everything behind it, time goes on as if nothing had been switched.
- It is the offset of a pad that sends (`src`), which then sends its segment again. One that receives applies
  its offset to later segments only, and that of a source which isn't live may have come before the base time
  is known.
- v4l2src stamps a frame with the driver's time of its capture, other live sources with the time at which they
  got it; a file's frame has the time at which it is due.
"""

from typing import Any, Final

from common.gst import Gst
from preview.state.values import CAPTURE_OFFSET_NS

PTS_WRAP: Final = 1 << 33
"""presentation_time_stamp has 33 bits (ISO/IEC 13818-1 2.4.3.7)."""
_PREROLL_NS: Final = 300 * 1_000_000
"""How long a start waits for the first frame of a source that isn't live, whose time begins with it."""


def use(pipeline: Any) -> None:
    """Makes a pipeline run on CLOCK_MONOTONIC, whatever clock its elements offer."""
    clock = Gst.SystemClock.obtain()
    Gst.util_set_object_arg(clock, "clock-type", "monotonic")
    pipeline.use_clock(clock)
    # The base time stays as `play` sets it.
    pipeline.set_start_time(Gst.CLOCK_TIME_NONE)


def play(pipeline: Any, source: Any) -> Any:
    """Starts a pipeline that `use` has prepared; may block in a driver.

    Args:
        pipeline: the pipeline.
        source: its first bin.

    Returns:
        The outcome, a Gst.StateChangeReturn.
    """
    outcome = pipeline.set_state(Gst.State.PAUSED)
    if outcome == Gst.StateChangeReturn.FAILURE:
        return outcome
    if outcome == Gst.StateChangeReturn.ASYNC:
        pipeline.get_state(_PREROLL_NS)
    base_time = pipeline.get_pipeline_clock().get_time()
    pipeline.set_base_time(base_time)
    source.get_static_pad("src").set_offset(base_time)
    return pipeline.set_state(Gst.State.PLAYING)


def play_beside(pipeline: Any, source: Any, source_time: Any) -> Any:
    """Starts another source in a pipeline that `play` has started; may block in a driver.

    Args:
        pipeline: the pipeline.
        source: a bin in it, whose state is locked.
        source_time: the last but one element of that bin; behind it, frames are stamped with their running
            time.

    Returns:
        The outcome, a Gst.StateChangeReturn.
    """
    outcome = source.set_state(Gst.State.PAUSED)
    if outcome == Gst.StateChangeReturn.FAILURE:
        return outcome
    if outcome == Gst.StateChangeReturn.ASYNC:
        source.get_state(_PREROLL_NS)
    base_time, pipeline_base_time = pipeline.get_pipeline_clock().get_time(), pipeline.get_base_time()
    source.set_base_time(base_time)
    source_time.get_static_pad("src").set_offset(base_time - pipeline_base_time)
    source.get_static_pad("src").set_offset(pipeline_base_time)
    return source.set_state(Gst.State.PLAYING)


def captured_ns(buffer: Any, pad: Any) -> int:
    """Returns the capture time of an access unit on CLOCK_MONOTONIC, in ns.

    Args:
        buffer: the access unit.
        pad: where it passes, behind the encoder.
    """
    segment = pad.get_sticky_event(Gst.EventType.SEGMENT, 0).parse_segment()
    return int(segment.to_running_time(Gst.Format.TIME, buffer.pts))


def pts_of(buffer: Any, pad: Any) -> int:
    """Returns the PTS that the muxer writes for an access unit, in ticks of 90 kHz; arguments as above."""
    return (captured_ns(buffer, pad) - CAPTURE_OFFSET_NS) * 9 // 100_000 % PTS_WRAP


def is_later(pts: int, other: int) -> bool:
    """Whether one PTS is later than another, at most half a wrap away."""
    return 0 < (pts - other) % PTS_WRAP < PTS_WRAP // 2
