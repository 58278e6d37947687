"""GStreamer elements with the names of hardware decoders around the software one for H.264.

DECODER_DOUBLES holds JSON: element name -> how it fails. Elements that are not named don't exist.

| word | what happens |
|---|---|
| ok | it decodes |
| refuse | the device can't be opened |
| silent | units go in, nothing comes out, no error |
| late | it holds frames back |
| wrong | its frames are too light |
| hang | the driver never comes back from its first frame |
| stuck | the driver never comes back from being opened |
| crash | the process dies |
| error | an ERROR message instead of a frame |

With "later " before it, the decoder proves itself in its trial and fails with the real stream only.
"""

import json
import os
import signal
import sys
import threading
from typing import Any, ClassVar

from common.gst import GLib, Gst

VARIABLE = "DECODER_DOUBLES"
_ENDLESS = threading.Event()
_BODIES = {
    "late": "avdec_h264 name=inner thread-type=frame max-threads=4",
    "wrong": "avdec_h264 name=inner ! videoconvert ! videobalance brightness=0.5 saturation=0",
}


class _Double(Gst.Bin):  # type: ignore[misc]  # gi has no types
    """One decoder."""

    element: ClassVar[str]

    def __init__(self) -> None:
        super().__init__()
        fault = _faults()[self.element]
        self._fault = fault.removeprefix("later ")
        if fault.startswith("later ") and "console.receiver.decoder_trial" in sys.orig_argv:
            self._fault = "ok"
        body = Gst.parse_bin_from_description(
            _BODIES.get(self._fault, "avdec_h264 name=inner thread-type=slice"), True
        )
        self.add(body)
        for name in ("sink", "src"):
            self.add_pad(Gst.GhostPad.new(name, body.get_static_pad(name)))
        body.get_by_name("inner").get_static_pad("sink").add_probe(Gst.PadProbeType.BUFFER, self._on_unit)

    def do_change_state(self, transition: Any) -> Any:
        if self._fault == "stuck" and transition == Gst.StateChange.NULL_TO_READY:
            _ENDLESS.wait()
        if self._fault == "refuse" and transition == Gst.StateChange.NULL_TO_READY:
            self._complain("the device can't be opened")
            return Gst.StateChangeReturn.FAILURE
        return Gst.Bin.do_change_state(self, transition)

    def _on_unit(self, _pad: Any, _info: Any) -> Any:
        match self._fault:
            case "silent":
                return Gst.PadProbeReturn.DROP
            case "hang":
                _ENDLESS.wait()
            case "crash":
                os.kill(os.getpid(), signal.SIGSEGV)
            case "error":
                self._complain("the driver reports a hardware fault")
                return Gst.PadProbeReturn.DROP
        return Gst.PadProbeReturn.OK

    def _complain(self, text: str) -> None:
        error = GLib.Error.new_literal(Gst.ResourceError.quark(), text, Gst.ResourceError.FAILED)
        self.post_message(Gst.Message.new_error(self, error, "double"))


class VaH264(_Double):
    element = "vah264dec"


class NvH264(_Double):
    element = "nvh264dec"


def register_from_environment() -> None:
    """Makes the elements that DECODER_DOUBLES names known to this process."""
    for double in (VaH264, NvH264):
        if double.element in _faults():
            double.set_metadata(double.element, "Codec/Decoder/Video", "A double of a decoder", "the tests")
            assert Gst.Element.register(None, double.element, Gst.Rank.NONE, double)


def _faults() -> dict[str, str]:
    return dict(json.loads(os.environ.get(VARIABLE, "{}")))
