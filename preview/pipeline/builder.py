"""From a plan to a pipeline that is not yet started.

    source ! rate ! leaky queue ! scale, convert ! encoder ! parser ! muxer ! plain caps ! listener

- Frames are reduced to the profile's rate before anything is done to them. A source that makes any rate is
  asked for the right one instead.
- The only place where frames may be dropped is before the encoder: two wait there, older ones go.
- Scaling and converting cost nothing where the source delivers what the encoder takes.
- Stream headers are repeated with every key frame, tables at most 100 ms apart, a clock reference with every
  picture (and between slow ones: clock_references.py).
"""

from dataclasses import dataclass
from typing import Any, Final

from common.errors import UserError
from common.gst import GLib, Gst
from preview.encoders import properties
from preview.encoders.chain import chain, size_caps
from preview.pipeline import square_pixels
from preview.pipeline.plan import ListenerPlan, Plan
from preview.values import Target

_TABLES_EVERY: Final = 4500
"""50 ms of the 90 kHz clock: with ten pictures a second and more, tables are at most 100 ms apart."""
_CLOCK_REFERENCE_EVERY: Final = 900
"""10 ms of the 90 kHz clock: with every picture, however fast."""
_WITHOUT_TABLES: Final = "video/mpegts,systemstream=true,packetsize=188"
"""The muxer's caps bring its tables along, and srtsink would send them to every new viewer once more, with
counters that don't continue in the stream; the key frame that a new viewer gets brings them along anyway.

An element takes them out, not a probe: caps that a probe drops are sent again with every buffer.
"""
_SRT_POLL_MS: Final = 1000
"""The listener's thread wakes this often; for ever (the default) can hang a stop."""


@dataclass(frozen=True, slots=True)
class Dials:
    """What is turned while it runs.

    The listener is not among it: a driver that never answers keeps what it was handed, and a listener that
    somebody keeps holds its port.
    """

    rate_caps: Any
    size_caps: Any
    encoder: Any


@dataclass(frozen=True, slots=True)
class Parts:
    """A pipeline and the elements that are spoken to while it runs."""

    pipeline: Any
    source: Any
    rate: Any
    rate_caps: Any
    size_caps: Any
    encoder: Any
    parser_pad: Any
    muxer_pad: Any
    sink: Any

    @property
    def dials(self) -> Dials:
        """The part of it that another profile changes."""
        return Dials(self.rate_caps, self.size_caps, self.encoder)


def build(plan: Plan) -> Parts:
    """Builds a pipeline.

    Raises:
        UserError: an element is missing or the source's description makes no sense.
    """
    pipeline = Gst.Pipeline.new("preview")
    source = _source(plan)
    body = _parsed(
        _body(plan),
        "rate_caps" if plan.source.any_rate else "rate",
        "sink",
        "install the GStreamer plugins: scripts/setup",
    )
    pipeline.add(source)
    pipeline.add(body)
    if not source.link(body):
        raise UserError(f"{plan.source.label} does not end in raw video", plan.source.remedy)
    parts = _parts(pipeline, source, body)
    properties.configure(
        parts.encoder, plan.encoder, plan.target.bitrate_kbps, plan.gop_frames, plan.highest_kbps
    )
    _listen(parts.sink, plan.listener)
    apply_target(parts.dials, plan)
    return parts


def apply_target(dials: Dials, plan: Plan) -> None:
    """Sets rate, size and the encoder's figures; also while playing.

    The encoder's figures first: new caps make it start over, with what it has then.
    """
    properties.set_figures(dials.encoder, plan.encoder, plan.target.bitrate_kbps, plan.gop_frames)
    size = size_caps(plan.encoder, plan.target)
    rate = Gst.Caps.from_string(_rate_caps(plan.target, exact=plan.source.any_rate))
    # Where caps don't change, setting them again would make the encoder start over for nothing.
    for capsfilter, caps in ((dials.size_caps, size), (dials.rate_caps, rate)):
        if not capsfilter.get_property("caps").is_equal(caps):
            capsfilter.set_property("caps", caps)


def _source(plan: Plan) -> Any:
    description = plan.source.description
    if plan.source.capture_fps:
        # The camera's best rate up to this; a camera that has none in reach says so itself.
        description += f" ! video/x-raw,framerate=[ 1/1, {plan.source.capture_fps}/1 ]"
    # A description may end in caps only when something follows.
    source = _parsed(f"{description} ! identity name=source_end", "source_end", "src", plan.source.remedy)
    source.set_name("source")
    for name, values in plan.source.properties.items():
        for key, value in values.items():
            source.get_by_name(name).set_property(key, value)
    square_pixels.fill_in(source)
    return source


def _body(plan: Plan) -> str:
    rate = ["videorate name=rate drop-only=true skip-to-first=true", "capsfilter name=rate_caps"]
    if plan.source.any_rate:
        rate.reverse()
    return " ! ".join(
        [
            *rate,
            "queue leaky=downstream max-size-buffers=2 max-size-bytes=0 max-size-time=0",
            chain(plan.encoder),
            f"mpegtsmux name=muxer alignment=0 pat-interval={_TABLES_EVERY} pmt-interval={_TABLES_EVERY}"
            f" pcr-interval={_CLOCK_REFERENCE_EVERY}",
            f"capssetter replace=true join=false caps={_WITHOUT_TABLES}",
            "srtsink name=sink",
        ]
    )


def _parsed(description: str, border: str, pad: str, remedy: str) -> Any:
    """A bin with one pad to the outside: the pad `pad` of the element `border`.

    The parser could find that pad itself, but it would take any pad that is not linked yet, and those behind
    a decoder are linked only when the decoder knows what it decodes.
    """
    try:
        made = Gst.parse_bin_from_description(description, False)
    except GLib.Error as error:
        raise UserError(f"the pipeline can't be built: {error.message}", remedy) from error
    made.add_pad(Gst.GhostPad.new(pad, made.get_by_name(border).get_static_pad(pad)))
    return made


def _parts(pipeline: Any, source: Any, body: Any) -> Parts:
    return Parts(
        pipeline=pipeline,
        source=source,
        rate=body.get_by_name("rate"),
        rate_caps=body.get_by_name("rate_caps"),
        size_caps=body.get_by_name("size"),
        encoder=body.get_by_name("encoder"),
        parser_pad=body.get_by_name("parser").get_static_pad("src"),
        muxer_pad=body.get_by_name("muxer").get_static_pad("src"),
        sink=body.get_by_name("sink"),
    )


def _listen(sink: Any, listener: ListenerPlan) -> None:
    # The address first: setting it puts other properties back.
    host = f"[{listener.bind}]" if ":" in listener.bind else listener.bind
    sink.set_property("uri", f"srt://{host}:{listener.port}?mode=listener")
    sink.set_property("latency", listener.latency_ms)
    for name, value in (
        ("wait-for-connection", False),
        ("sync", False),
        ("async", False),
        ("poll-timeout", _SRT_POLL_MS),
        ("enable-last-sample", False),
    ):
        sink.set_property(name, value)
    if listener.encrypted:
        Gst.util_set_object_arg(sink, "pbkeylen", str(listener.key_length_bytes))
        sink.set_property("passphrase", listener.passphrase)


def _rate_caps(target: Target, *, exact: bool) -> str:
    rates = f"{target.fps}/1" if exact else f"[ 0/1, {target.fps}/1 ]"
    size = f",width={target.width_px},height={target.height_px}" if exact else ""
    return f"video/x-raw(ANY),framerate={rates}{size}"
