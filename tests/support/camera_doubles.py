"""A GStreamer element with the name, the properties and the failures of v4l2src, around a test pattern.

CAMERA_DOUBLES holds JSON: device -> {"modes": [[caps, pattern], ...], "fault": word}. A mode is what a driver
lists: one format with one size and one rate. Its pattern shows which one was negotiated.

| word | what happens |
|---|---|
| none | it delivers |
| closed | the device can't be opened |
| busy | another program has the device: it opens, and refuses a format |
| unplugged:N | an ERROR message after N frames, as of a poll on a device that is gone |
| silent:N | after N frames nothing comes, no error |

Devices that are not named can't be opened.
"""

import json
import os
from dataclasses import dataclass
from typing import Any, ClassVar

from common.gst import GLib, GObject, Gst

VARIABLE = "CAMERA_DOUBLES"
_LARGEST = (3840, 2160, 120)
"""What v4l2src prefers where its peer prefers nothing: width, height and rate (gst_v4l2src_negotiate)."""

_FRAMES = Gst.PadTemplate.new(
    "src",
    Gst.PadDirection.SRC,
    Gst.PadPresence.ALWAYS,
    Gst.Caps.from_string("video/x-raw; image/jpeg; video/x-h264"),
)


@dataclass(frozen=True)
class _Mode:
    caps: str
    pattern: str

    @property
    def description(self) -> str:
        if not self.caps.startswith("image/jpeg"):
            return f"videotestsrc is-live=true pattern={self.pattern} ! {self.caps} ! identity name=end"
        raw = self.caps.replace("image/jpeg", "video/x-raw,format=Y42B")
        return f"videotestsrc is-live=true pattern={self.pattern} ! {raw} ! jpegenc ! identity name=end"


class Camera(Gst.Bin):  # type: ignore[misc]  # gi has no types
    """The double."""

    __gstmetadata__ = ("v4l2src", "Source/Video", "A double of a camera", "the tests")
    __gsttemplates__ = (_FRAMES,)
    __gproperties__: ClassVar = {
        "device": (str, "device", "location", "/dev/video0", GObject.ParamFlags.READWRITE),
        "do-timestamp": (bool, "do-timestamp", "", False, GObject.ParamFlags.READWRITE),
    }

    def __init__(self) -> None:
        super().__init__()
        self.figures: dict[str, Any] = {"device": "/dev/video0", "do-timestamp": False}
        self._frames = 0
        self._pad = Gst.GhostPad.new_no_target_from_template("src", _FRAMES)
        self.add_pad(self._pad)

    def do_get_property(self, pspec: Any) -> Any:
        return self.figures[pspec.name]

    def do_set_property(self, pspec: Any, value: Any) -> None:
        self.figures[pspec.name] = value

    def do_change_state(self, transition: Any) -> Any:
        device = self.figures["device"]
        known = _cameras().get(device)
        fault, _, after = (known or {"fault": "closed"}).get("fault", "").partition(":")
        if transition == Gst.StateChange.NULL_TO_READY and fault == "closed":
            self._complain(
                f"Cannot identify device '{device}'.", Gst.ResourceError.NOT_FOUND, "No such device"
            )
            return Gst.StateChangeReturn.FAILURE
        if transition == Gst.StateChange.READY_TO_PAUSED:
            if fault == "busy":
                self._complain(
                    f"Device '{device}' is busy", Gst.ResourceError.BUSY, "Device or resource busy"
                )
                return Gst.StateChangeReturn.FAILURE
            modes = [_Mode(*mode) for mode in known["modes"]] if known else []
            self._begin(modes, fault, int(after or 0))
        return Gst.Bin.do_change_state(self, transition)

    def _begin(self, modes: list[_Mode], fault: str, after: int) -> None:
        mode = _negotiated(modes, self._pad.peer_query_caps(None))
        if mode is None:
            # What a source posts whose formats nothing behind it takes (gst_base_src_loop).
            domain, code = Gst.StreamError.quark(), Gst.StreamError.FAILED
            self._post(
                GLib.Error.new_literal(domain, "Internal data stream error.", code),
                "streaming stopped, reason not-negotiated (-4)",
            )
            return
        body = Gst.parse_bin_from_description(mode.description, False)
        self.add(body)
        end = body.get_by_name("end").get_static_pad("src")
        body.add_pad(Gst.GhostPad.new("src", end))
        self._pad.set_target(body.get_static_pad("src"))
        if fault:
            end.add_probe(Gst.PadProbeType.BUFFER, self._on_frame, fault, after)

    def _on_frame(self, _pad: Any, _info: Any, fault: str, after: int) -> Any:
        self._frames += 1
        if self._frames <= after:
            return Gst.PadProbeReturn.OK
        if fault == "unplugged" and self._frames == after + 1:
            self._complain(
                "Could not read from resource.", Gst.ResourceError.READ, "poll error 1: No such device (19)"
            )
        return Gst.PadProbeReturn.DROP

    def _complain(self, text: str, code: Any, details: str) -> None:
        self._post(GLib.Error.new_literal(Gst.ResourceError.quark(), text, code), details)

    def _post(self, error: Any, details: str) -> None:
        self.post_message(Gst.Message.new_error(self, error, details))


def _negotiated(modes: list[_Mode], wanted: Any) -> _Mode | None:
    """What v4l2src takes: the nearest to its peer's first structure, the rate before the size."""
    possible = [mode for mode in modes if Gst.Caps.from_string(mode.caps).can_intersect(wanted)]
    width, height, fps = _LARGEST
    if not wanted.is_any():
        preferred = wanted.get_structure(0).copy()
        preferred.fixate_field_nearest_int("width", width)
        preferred.fixate_field_nearest_int("height", height)
        preferred.fixate_field_nearest_fraction("framerate", fps, 1)
        width, height, fps = _figures(preferred, (width, height, fps))

    def distance(mode: _Mode) -> tuple[int, int]:
        own = _figures(Gst.Caps.from_string(mode.caps).get_structure(0), _LARGEST)
        return abs(own[2] - fps), abs(own[0] * own[1] - width * height)

    return min(possible, key=distance, default=None)


def _figures(structure: Any, unknown: tuple[int, int, int]) -> tuple[int, int, int]:
    """Width, height and rate of a structure."""
    width, height = structure.get_int("width"), structure.get_int("height")
    rate = structure.get_fraction("framerate")
    return (
        width[1] if width[0] else unknown[0],
        height[1] if height[0] else unknown[1],
        rate[1] // rate[2] if rate[0] else unknown[2],
    )


def register_from_environment() -> None:
    """Puts the double in the place of v4l2src in this process, if CAMERA_DOUBLES names any device."""
    if _cameras():
        assert Gst.Element.register(None, "v4l2src", Gst.Rank.PRIMARY, Camera)


def _cameras() -> dict[str, Any]:
    return dict(json.loads(os.environ.get(VARIABLE, "{}")))
