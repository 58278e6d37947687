"""The element `cameratapsrc`: frames of a ROS topic from the camera tap, as a source of a pipeline.

    thread of the connection: receive ---> appsrc ! (decoder) ! identity ---> src

Each frame is the tap's own memory, which is mapped when an element reads it and let go of when the last one
has. Its caps come with it, so the size may change from one frame to the next. Python runs once per frame,
for about a tenth of a millisecond: no element of GStreamer 1.22 takes frames of changing size with their
times from another process (unixfdsrc does, from 1.24 on).

| what happens | follows |
|---|---|
| no connection, or it ends: the tap was killed | ERROR, as of a camera that is unplugged |
| nothing comes for a second, and the tap knows why | ERROR with its reason: nothing is published, ... |
| nothing comes, and it is not known why | nothing; the watchdog of the source counts |
| raw frames become compressed ones, or the other way | ERROR: the next start takes them as they are |
| a frame from before the pipeline's start | dropped |
| the pipeline takes frames too slowly | appsrc keeps the newest one |
"""

import threading
import time
from pathlib import Path
from typing import Any, ClassVar, Final

from common.camera_tap import Header
from common.gst import GLib, GObject, Gst, GstAllocators
from preview.pipeline.sources import TAP_SOURCE
from preview.pipeline.tap_client import CONNECT_S, SharedFrame, TapClient, TapError

_POLL_S: Final = 0.25
PROBLEM_AFTER_S: Final = 1.0
"""Without a frame. Before its first one a topic has longer: publishers are found within some tenths."""
FIRST_PROBLEM_AFTER_S: Final = 3.0
_STOP_S: Final = CONNECT_S + 1.0
"""The thread may be connecting."""
_LEAKY_DOWNSTREAM: Final = 2
"""GstAppLeakyType: the oldest waiting frame is dropped."""
_DECODERS: Final = {"jpeg": "jpegdec", "png": "pngdec", "bayer": "bayer2rgb"}
_MEDIA_TYPES: Final = {"jpeg": "image/jpeg", "png": "image/png", "bayer": "video/x-bayer"}


class CameraTapSource(Gst.Bin):  # type: ignore[misc]  # gi has no types
    """The element."""

    __gstmetadata__ = ("Camera tap source", "Source/Video", "Frames of a ROS topic", "Robot Gateway")
    __gsttemplates__ = (
        Gst.PadTemplate.new("src", Gst.PadDirection.SRC, Gst.PadPresence.ALWAYS, Gst.Caps.new_any()),
    )
    __gproperties__: ClassVar[dict[str, Any]] = {
        "socket": (str, "Socket", "Path of the camera tap's socket", "", GObject.ParamFlags.READWRITE),
        "topic": (str, "Topic", "Full name of the topic", "", GObject.ParamFlags.READWRITE),
        "fps": (str, "Frame rate", "Frames per second, at the most", "30", GObject.ParamFlags.READWRITE),
    }

    def __init__(self) -> None:
        super().__init__()
        self._settings = {"socket": "", "topic": "", "fps": "30"}
        self._appsrc = Gst.ElementFactory.make("appsrc")
        for name, value in {
            "is-live": True,
            "format": Gst.Format.TIME,
            "max-buffers": 1,
            "max-bytes": 0,
            "leaky-type": _LEAKY_DOWNSTREAM,
        }.items():
            self._appsrc.set_property(name, value)
        self._end = Gst.ElementFactory.make("identity")
        self.add(self._appsrc)
        self.add(self._end)
        self.add_pad(Gst.GhostPad.new("src", self._end.get_static_pad("src")))
        self._decodes: str | None = None
        """What the elements between the two take; None before the first frame."""
        self._caps: tuple[tuple[str, int, int], Any] | None = None
        self._playing = False
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._client: TapClient | None = None
        self._allocator = GstAllocators.FdAllocator.new()

    def do_get_property(self, pspec: Any) -> Any:
        """Returns a property, for GObject."""
        return self._settings[pspec.name]

    def do_set_property(self, pspec: Any, value: Any) -> None:
        """Sets a property, for GObject."""
        self._settings[pspec.name] = value

    def do_change_state(self, transition: Any) -> Any:
        """Connects in PAUSED, as cameras are opened, and hands frames on while PLAYING."""
        if transition == Gst.StateChange.PAUSED_TO_READY:
            self._stop()
        if transition == Gst.StateChange.PLAYING_TO_PAUSED:
            self._playing = False
        outcome = Gst.Bin.do_change_state(self, transition)
        if outcome == Gst.StateChangeReturn.FAILURE:
            return outcome
        if transition == Gst.StateChange.READY_TO_PAUSED:
            self._start()
        if transition == Gst.StateChange.PAUSED_TO_PLAYING:
            self._playing = True
        return outcome

    def _start(self) -> None:
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="camera tap", daemon=True)
        self._thread.start()

    def _stop(self) -> None:
        self._stopping.set()
        if client := self._client:
            client.shut_down()
        if self._thread:
            self._thread.join(_STOP_S)
            self._thread = None

    def _run(self) -> None:
        try:
            client = self._client = TapClient(Path(self._settings["socket"]), self._settings["topic"])
            try:
                self._receive(client)
            finally:
                self._client = None
                client.close()
        except TapError as error:
            self._fail(str(error))

    def _receive(self, client: TapClient) -> None:
        silent_since_s, patience_s = time.monotonic(), FIRST_PROBLEM_AFTER_S
        while not self._stopping.is_set():
            frame = client.receive(_POLL_S)
            now_s = time.monotonic()
            if frame:
                silent_since_s, patience_s = now_s, PROBLEM_AFTER_S
                self._hand_on(frame)
            elif client.problem and now_s - silent_since_s > patience_s:
                raise TapError(client.problem)

    def _hand_on(self, frame: SharedFrame) -> None:
        """Pushes a frame with its capture time, as the running time of the pipeline.

        Raises:
            TapError: it does not fit what came before.
        """
        header = frame.header
        # The allocator owns the descriptor from here on. MAP_PRIVATE, because the memory is sealed.
        private = GstAllocators.FdMemoryFlags.MAP_PRIVATE
        memory = GstAllocators.FdAllocator.alloc(self._allocator, frame.memory, header.size, private)
        pts_ns = header.captured_ns - self.get_base_time()
        if not self._playing or pts_ns < 0:
            return
        caps = self._caps_of(header)
        buffer = Gst.Buffer.new()
        buffer.append_memory(memory)
        buffer.pts = pts_ns
        self._appsrc.emit("push-sample", Gst.Sample.new(buffer, caps, None, None))

    def _caps_of(self, header: Header) -> Any:
        key = (header.form, header.width, header.height)
        if self._caps is None or self._caps[0] != key:
            self._connect(header.form.partition("-")[0] if header.form[0].islower() else "")
            self._caps = key, Gst.Caps.from_string(_caps_text(header, self._settings["fps"]))
        return self._caps[1]

    def _connect(self, decodes: str) -> None:
        """Links what turns these frames into raw video, if that has not been done."""
        if self._decodes == decodes:
            return
        if self._decodes is not None:
            raise TapError(f"its frames have become {decodes or 'raw'} ones while it was shown")
        self._decodes = decodes
        if not decodes:
            self._appsrc.link(self._end)
            return
        decoder = Gst.ElementFactory.make(_DECODERS[decodes])
        if decoder is None:
            raise TapError(f"GStreamer's element {_DECODERS[decodes]} is missing here")
        self.add(decoder)
        self._appsrc.link(decoder)
        decoder.link(self._end)
        decoder.sync_state_with_parent()

    def _fail(self, what: str) -> None:
        """Posts an ERROR, unless the element is being stopped."""
        if not self._stopping.is_set():
            error = GLib.Error.new_literal(Gst.ResourceError.quark(), what, Gst.ResourceError.READ)
            self.post_message(Gst.Message.new_error(self, error, ""))


def _caps_text(header: Header, fps: str) -> str:
    """Returns the caps of a frame. The encoder counts on their rate; frames come when they come."""
    kind, _, order = header.form.partition("-")
    size = f"width={header.width},height={header.height},framerate={fps}/1"
    if kind == "bayer":
        return f"video/x-bayer,format={order},{size}"
    if kind in _MEDIA_TYPES:
        return f"{_MEDIA_TYPES[kind]},{size}"
    return f"video/x-raw,format={header.form},pixel-aspect-ratio=1/1,interlace-mode=progressive,{size}"


def register() -> None:
    """Makes the element known to GStreamer by its name; further calls do nothing."""
    if Gst.ElementFactory.find(TAP_SOURCE) is None:
        Gst.Element.register(None, TAP_SOURCE, Gst.Rank.NONE, CameraTapSource)
