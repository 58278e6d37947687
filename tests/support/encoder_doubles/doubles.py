"""GStreamer elements with the names and properties of hardware encoders, around software ones.

ENCODER_DOUBLES holds JSON: element name -> how it fails. Elements that are not named don't exist.

| word | what happens |
|---|---|
| ok | it encodes |
| null-to-ready | the device can't be opened |
| ready-to-paused | the device refuses later (as Rockchip's MPP does) |
| no-output[:N] | frames go in, after N of them nothing comes out, no error |
| empty[:N] | after N frames every buffer is empty |
| error:N | an ERROR message after N frames |
| hang:N | the driver never comes back after N frames, not even for a stop |
| stuck:N | after N frames, setting the bit rate never returns |
| deaf:N | after N frames, a request for a key frame never returns |
| crash:N | the process dies after N frames |

With "later " before it, the encoder proves itself in its trial and fails in the pipeline only.
"""

import json
import os
import signal
import sys
import threading
from typing import Any, ClassVar

from common.gst import GLib, GObject, Gst, GstVideo

VARIABLE = "ENCODER_DOUBLES"
_ENDLESS = threading.Event()


class _Double(Gst.Bin):  # type: ignore[misc]  # gi has no types
    """What the doubles share; the subclasses bring name, properties and the encoder inside."""

    element: ClassVar[str]
    inner: ClassVar[str]
    bitrate_property: ClassVar[str]
    bitrate_divisor: ClassVar[int]

    def __init__(self) -> None:
        super().__init__()
        self.figures: dict[str, Any] = {}
        self._frames = 0
        fault = _faults()[self.element]
        self._fault, _, count = fault.removeprefix("later ").partition(":")
        self._after = int(count or 0)
        if fault.startswith("later ") and _in_trial():
            self._fault = "ok"
        body = Gst.parse_bin_from_description(f"videoconvert ! {self.inner} name=inner", True)
        self.add(body)
        self.body = body
        for name in ("sink", "src"):
            self.add_pad(Gst.GhostPad.new(name, body.get_static_pad(name)))
        probe_on = "sink" if self._fault in {"hang", "crash", "error"} else "src"
        self.body.get_by_name("inner").get_static_pad(probe_on).add_probe(
            Gst.PadProbeType.BUFFER, self._on_frame
        )
        if self._fault == "deaf":
            self.get_static_pad("src").add_probe(Gst.PadProbeType.EVENT_UPSTREAM, self._on_request)

    def do_change_state(self, transition: Any) -> Any:
        for fault, refused in (
            ("null-to-ready", Gst.StateChange.NULL_TO_READY),
            ("ready-to-paused", Gst.StateChange.READY_TO_PAUSED),
        ):
            if self._fault == fault and transition == refused:
                self._complain("the device can't be opened")
                return Gst.StateChangeReturn.FAILURE
        return Gst.Bin.do_change_state(self, transition)

    def do_get_property(self, pspec: Any) -> Any:
        return self.figures.get(pspec.name, pspec.default_value)

    def do_set_property(self, pspec: Any, value: Any) -> None:
        self.figures[pspec.name] = value
        if pspec.name == self.bitrate_property:
            if self._fault == "stuck" and self._frames > self._after:
                _ENDLESS.wait()
            self.body.get_by_name("inner").set_property("bitrate", max(1, value // self.bitrate_divisor))

    def _on_frame(self, pad: Any, info: Any) -> Any:
        if info.get_buffer().get_size() == 0:
            return Gst.PadProbeReturn.OK
        self._frames += 1
        if self._frames <= self._after:
            return Gst.PadProbeReturn.OK
        if self._fault == "no-output":
            return Gst.PadProbeReturn.DROP
        if self._fault == "empty":
            pad.push(_emptied(info.get_buffer()))
            return Gst.PadProbeReturn.DROP
        self._fail_now()
        return Gst.PadProbeReturn.OK

    def _on_request(self, _pad: Any, info: Any) -> Any:
        if GstVideo.video_event_is_force_key_unit(info.get_event()) and self._frames > self._after:
            _ENDLESS.wait()
        return Gst.PadProbeReturn.OK

    def _fail_now(self) -> None:
        if self._fault == "error" and self._frames == self._after + 1:
            self._complain("the driver reports a hardware fault")
        elif self._fault == "hang":
            _ENDLESS.wait()
        elif self._fault == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)

    def _complain(self, text: str) -> None:
        error = GLib.Error.new_literal(Gst.ResourceError.quark(), text, Gst.ResourceError.OPEN_READ_WRITE)
        self.post_message(Gst.Message.new_error(self, error, "double"))


def _emptied(buffer: Any) -> Any:
    empty = Gst.Buffer.new()
    empty.pts, empty.dts, empty.duration = buffer.pts, buffer.dts, buffer.duration
    return empty


_X265 = "x265enc tune=zerolatency speed-preset=ultrafast option-string=bframes=0:repeat-headers=1"
_X264 = "x264enc tune=zerolatency speed-preset=ultrafast bframes=0"


class MppH265(_Double):
    """Rockchip's encoder; its bit rate is in bit/s."""

    element, inner, bitrate_property, bitrate_divisor = "mpph265enc", _X265, "bps", 1000
    __gproperties__: ClassVar = {
        "bps": (int, "bps", "bit/s", 0, 2**31 - 1, 0, GObject.ParamFlags.READWRITE),
        "gop": (int, "gop", "frames", -1, 2**31 - 1, -1, GObject.ParamFlags.READWRITE),
        "header-mode": (str, "header-mode", "", "first-frame", GObject.ParamFlags.READWRITE),
        "rc-mode": (str, "rc-mode", "", "vbr", GObject.ParamFlags.READWRITE),
        "max-pending": (int, "max-pending", "frames", 1, 64, 16, GObject.ParamFlags.READWRITE),
    }


class VaH265(_Double):
    """The VA-API encoder; its bit rate is in kbit/s."""

    element, inner, bitrate_property, bitrate_divisor = "vah265enc", _X265, "bitrate", 1
    __gproperties__: ClassVar = {
        "bitrate": (int, "bitrate", "kbit/s", 0, 2**21, 0, GObject.ParamFlags.READWRITE),
        "key-int-max": (int, "key-int-max", "frames", 0, 1024, 0, GObject.ParamFlags.READWRITE),
        "rate-control": (str, "rate-control", "", "cqp", GObject.ParamFlags.READWRITE),
        "b-frames": (int, "b-frames", "frames", 0, 31, 0, GObject.ParamFlags.READWRITE),
        "ref-frames": (int, "ref-frames", "frames", 0, 15, 3, GObject.ParamFlags.READWRITE),
    }


class MppH264(MppH265):
    """Rockchip's encoder for H.264."""

    element, inner = "mpph264enc", _X264


DOUBLES = {double.element: double for double in (MppH265, VaH265, MppH264)}


def register_from_environment() -> None:
    """Makes the elements that ENCODER_DOUBLES names known to this process."""
    for name in _faults():
        double = DOUBLES[name]
        double.set_metadata(name, "Codec/Encoder/Video", "A double of a hardware encoder", "the tests")
        assert Gst.Element.register(None, name, Gst.Rank.NONE, double)


def _faults() -> dict[str, str]:
    return dict(json.loads(os.environ.get(VARIABLE, "{}")))


def _in_trial() -> bool:
    return "preview.encoders.probe_child" in sys.orig_argv
