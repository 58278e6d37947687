"""Builds the pipeline of a plan, not yet started.

    source ! rate ! leaky queue ! scale, convert ! encoder ! parser ! muxer ! pipe (listener.py)

- The source is replaced while the rest goes on (camera_switch.py). Its last element gives its frames one
  timeline from the pipeline's start on, so that the encoder notices nothing.
- Frames are dropped to the profile's rate before any work is done on them. A source that generates any rate
  is negotiated to that rate as well.
- The only queue that drops frames is before the encoder: two wait there, older ones are dropped.
- Scaling and converting cost nothing where the source delivers what the encoder takes.
- Parameter sets come with every key frame, PAT and PMT at most 100 ms apart, a PCR with every frame (and
  between slow ones: clock_references.py).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from common.errors import UserError
from common.gst import GLib, Gst
from preview.encoders import properties
from preview.pipeline import camera_decoder, capture_clock, tap_source
from preview.pipeline.plan import Plan

_TABLES_EVERY: Final = 4500
"""In ticks of 90 kHz: 50 ms. At 10 frames per second and more, tables are at most 100 ms apart."""
_CLOCK_REFERENCE_EVERY: Final = 900
"""In ticks of 90 kHz: 10 ms, so that every frame has a PCR, up to 100 frames per second."""
_SQUARE: Final = "video/x-raw(ANY),pixel-aspect-ratio=1/1"
SOURCE_END: Final = "source_end"
"""Last element of every source, ..."""
SOURCE_TIME: Final = "source_time"
"""... and the one before it, behind which a camera's time is moved to the pipeline's (capture_clock.py)."""
_SOURCE_CAPS: Final = "source_caps"
_TRANSPARENT: Final = frozenset({"queue", "queue2", "identity"})

camera_decoder.register()
tap_source.register()


@dataclass(frozen=True, slots=True)
class Parts:
    """A pipeline, and the elements and pads that are used while it runs."""

    pipeline: Any
    source: Any
    """The live camera."""
    body: Any
    """Everything behind it."""
    body_pad: Any
    """Where its frames enter the rest."""
    rate: Any
    apply_target: Callable[[Plan, int], None]
    """Sets what changes with the profile behind the source, also while playing."""
    encoder: Any
    encoded_pad: Any
    """All access units pass it, ..."""
    parser_pad: Any
    """... and those that viewers are to get also this one."""
    muxer_pad: Any
    pipe_in: Any


def build(plan: Plan) -> Parts:
    """Builds the pipeline of a plan, with the bit rate of its profile.

    Raises:
        UserError: an element is missing, or the source's description is invalid.
    """
    pipeline = Gst.Pipeline.new("preview")
    capture_clock.use(pipeline)
    source = build_source(plan)
    body = _parsed(_body(plan), "rate", "sink", "install the GStreamer plugins: scripts/setup")
    pipeline.add(source)
    pipeline.add(body)
    if not source.link(body):
        raise UserError(f"{plan.source.label} does not end in raw video", plan.source.remedy)
    find = body.get_by_name
    encoder = find("encoder")
    apply_target = partial(_apply_target, find("rate_caps"), find("size"), encoder)
    highest_kbps = max(target.bitrate_kbps for target in plan.settings.profiles.targets.values())
    properties.configure(encoder, plan.encoder, plan.target.bitrate_kbps, plan.gop_frames, highest_kbps)
    apply_target(plan, plan.target.bitrate_kbps)
    parser_pad = find("parser").get_static_pad("src")
    return Parts(
        pipeline=pipeline,
        source=source,
        body=body,
        body_pad=body.get_static_pad("sink"),
        rate=find("rate"),
        apply_target=apply_target,
        encoder=encoder,
        encoded_pad=parser_pad,
        parser_pad=parser_pad.get_peer().get_parent_element().get_static_pad("src"),
        muxer_pad=find("muxer").get_static_pad("src"),
        pipe_in=find("pipe_in"),
    )


def _apply_target(rate: Any, size: Any, encoder: Any, plan: Plan, bitrate_kbps: int) -> None:
    """Sets frame rate, frame size and GOP length of the plan's profile, and the bit rate; also while playing.

    Bit rate and GOP length first: new caps reinitialise the encoder, with the properties it has then.
    """
    target = plan.target
    properties.set_rates(encoder, plan.encoder, bitrate_kbps, plan.gop_frames)
    rate_caps = Gst.Caps.from_string(f"video/x-raw(ANY),framerate=[ 0/1, {target.fps}/1 ]")
    _set_caps(size, properties.size_caps(plan.encoder, target))
    _set_caps(rate, rate_caps)


def apply_source_target(source: Any, plan: Plan) -> None:
    """Sets frame rate and frame size of a source that generates any; also while playing."""
    if capsfilter := source.get_by_name(_SOURCE_CAPS):
        target = plan.target
        size = f"width={target.width_px},height={target.height_px}"
        _set_caps(capsfilter, Gst.Caps.from_string(f"video/x-raw(ANY),framerate={target.fps}/1,{size}"))


def _set_caps(capsfilter: Any, caps: Any) -> None:
    # Setting equal caps again would reinitialise the encoder for nothing.
    if not capsfilter.get_property("caps").is_equal(caps):
        capsfilter.set_property("caps", caps)


def build_source(plan: Plan) -> Any:
    """Returns the plan's source as a bin with one pad, `src`, not yet started.

    Raises:
        UserError: an element is missing, or the source's description is invalid.
    """
    description = plan.source.description
    if plan.source.any_rate:
        description += f" ! capsfilter name={_SOURCE_CAPS}"
    # They are also needed by descriptions that end in caps, which must be followed by an element.
    description += f" ! identity name={SOURCE_TIME} ! identity name={SOURCE_END} single-segment=true"
    source = _parsed(description, SOURCE_END, "src", plan.source.remedy)
    for name, values in plan.source.properties.items():
        for key, value in values.items():
            source.get_by_name(name).set_property(key, value)
    _fill_in_square_pixels(source)
    apply_source_target(source, plan)
    return source


def _fill_in_square_pixels(source: Any) -> None:
    """Completes the caps behind sources of untyped bytes: shared memory, a socket, a raw file.

    Such caps are all that is known of the frames, and they rarely state the pixel aspect ratio. GStreamer
    leaves it open until videoscale negotiates it, and a capsfilter that would have to choose one then fails
    ("Filter caps do not completely specify the output format"). Such caps mean square pixels.
    """
    elements = source.iterate_all_by_element_factory_name("capsfilter")
    while (step := elements.next())[0] == Gst.IteratorResult.OK:
        if _follows_untyped_source(step[1]):
            square = step[1].get_property("caps").intersect(Gst.Caps.from_string(_SQUARE))
            # Empty where the caps state another aspect ratio, or are not raw video.
            if not square.is_empty():
                step[1].set_property("caps", square)


def _follows_untyped_source(element: Any) -> bool:
    """Whether only transparent elements separate this one from a source that can't state its caps."""
    pad = element.get_static_pad("sink").get_peer()
    while pad is not None and (before := pad.get_parent_element()) is not None:
        if before.numsinkpads == 0:
            return bool(pad.query_caps(None).is_any())
        if before.get_factory().get_name() not in _TRANSPARENT:
            return False
        pad = before.get_static_pad("sink").get_peer()
    return False


def _body(plan: Plan) -> str:
    return " ! ".join(
        [
            "videorate name=rate drop-only=true skip-to-first=true",
            "capsfilter name=rate_caps",
            "queue leaky=downstream max-size-buffers=2 max-size-bytes=0 max-size-time=0",
            properties.chain(plan.encoder),
            f"mpegtsmux name=muxer alignment=0 pat-interval={_TABLES_EVERY} pmt-interval={_TABLES_EVERY}"
            f" pcr-interval={_CLOCK_REFERENCE_EVERY}",
            "fdsink name=pipe_in sync=false async=false",
        ]
    )


def _parsed(description: str, border: str, pad: str, remedy: str) -> Any:
    """Returns a bin with one ghost pad, for the pad `pad` of the element `border`.

    parse_bin_from_description could choose that pad itself, but takes any unlinked pad, and those behind a
    decodebin are linked only once it knows the format.
    """
    try:
        made = Gst.parse_bin_from_description(description, False)
    except GLib.Error as error:
        raise UserError(f"the pipeline can't be built: {error.message}", remedy) from error
    made.add_pad(Gst.GhostPad.new(pad, made.get_by_name(border).get_static_pad(pad)))
    return made
