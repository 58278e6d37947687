"""The element `cameradecoder`: what a camera delivers, raw frames or JPEG pictures, as raw frames.

    sink ---> identity ! (jpegdec) ! identity ---> src

Which of the two comes is known with the camera's first caps; the elements are linked then, so that raw
frames pass as if there were nothing between. jpegdec takes no raw frames, and a decodebin would put whatever
decoder the machine ranks highest in front of the encoder, a driver's among them.
"""

from typing import Any, Final

from common.gst import GLib, Gst
from preview.pipeline.sources import CAMERA_DECODER

_JPEG: Final = "image/jpeg"
_DECODER: Final = "jpegdec"


class CameraDecoder(Gst.Bin):  # type: ignore[misc]  # gi has no types
    """The element."""

    __gstmetadata__ = ("Camera decoder", "Decoder/Video", "Raw frames of a camera", "Robot Gateway")
    __gsttemplates__ = tuple(
        Gst.PadTemplate.new(name, direction, Gst.PadPresence.ALWAYS, Gst.Caps.new_any())
        for name, direction in (("sink", Gst.PadDirection.SINK), ("src", Gst.PadDirection.SRC))
    )

    def __init__(self) -> None:
        super().__init__()
        self._begin = Gst.ElementFactory.make("identity")
        self._end = Gst.ElementFactory.make("identity")
        for element, name in ((self._begin, "sink"), (self._end, "src")):
            self.add(element)
            self.add_pad(Gst.GhostPad.new(name, element.get_static_pad(name)))
        # No method of this object: pad and object would keep each other for ever.
        self._begin.get_static_pad("sink").add_probe(Gst.PadProbeType.EVENT_DOWNSTREAM, _link_for_caps)

    def link_for(self, media_type: str) -> None:
        """Links what turns this media type into raw frames."""
        if media_type != _JPEG:
            self._begin.link(self._end)
            return
        decoder = Gst.ElementFactory.make(_DECODER)
        if decoder is None:
            self._fail(f"GStreamer's element {_DECODER}, which its JPEG pictures need, is missing here")
            return
        self.add(decoder)
        self._begin.link(decoder)
        decoder.link(self._end)
        decoder.sync_state_with_parent()

    def _fail(self, what: str) -> None:
        error = GLib.Error.new_literal(Gst.CoreError.quark(), what, Gst.CoreError.MISSING_PLUGIN)
        self.post_message(Gst.Message.new_error(self, error, ""))


def _link_for_caps(pad: Any, info: Any) -> Any:
    """Links the elements before the first caps pass, on the camera's thread."""
    event = info.get_event()
    if event.type != Gst.EventType.CAPS:
        return Gst.PadProbeReturn.OK
    pad.get_parent_element().get_parent().link_for(event.parse_caps().get_structure(0).get_name())
    return Gst.PadProbeReturn.REMOVE


def register() -> None:
    """Makes the element known to GStreamer by its name; further calls do nothing."""
    if Gst.ElementFactory.find(CAMERA_DECODER) is None:
        Gst.Element.register(None, CAMERA_DECODER, Gst.Rank.NONE, CameraDecoder)
