"""Decodes access units that are pushed into it: the GStreamer pipeline of direct delivery."""

import time
from contextlib import ExitStack
from typing import Any, Final

from common.errors import UserError
from common.gst import GLib, Gst, stop
from console.capture_time import ns_to_ticks
from console.receiver.address import StreamAddress
from console.receiver.decoder_queue import DecoderQueue
from console.receiver.decoder_time import DecoderTime
from console.receiver.decoding import DecodingBranch, Origin, element
from console.receiver.errors import UndecodableError, undecodable
from console.receiver.file_branch import add_file_branch
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions
from console.receiver.transport_stream import AccessUnit

_AHEAD: Final = 2
"""Access units that the decoder has at hand; further ones wait where they can be dropped."""
_MOST_DECODING: Final = 32
"""Access units whose frames may be due at a time: more than any decoder keeps."""


class UnitDecoder:
    """Decoder and recording behind an appsrc each. Used by one thread, not one of GStreamer's.

    Args:
        address: of the stream, for errors.
        queue: takes the frames.
        options: pixel format, decoders, recording and capture times.

    Raises:
        UserError: a GStreamer element is not installed.
    """

    def __init__(self, address: StreamAddress, queue: FrameQueue, options: ReceiverOptions) -> None:
        self._address = address
        self._queue = queue
        self._options = options
        self._codec = ""
        self._source: Any = None
        self._waiting = DecoderQueue()
        self._branch: DecodingBranch | None = None
        self._time = DecoderTime()
        """Over all connections: the decoder's time must not go back."""
        self._received_s: dict[int, float] = {}
        """When the access units that are in the decoder were received, by PTS in ns."""
        self.newest_s: float | None = None
        """When the newest access unit was received, decoded or not."""
        self._pipeline = Gst.Pipeline.new(None)
        self._recorder: Any = None
        self._release = ExitStack()
        if options.recording:
            self._recorder = element("appsrc", caps="video/mpegts,packetsize=188", is_live=True)
            self._pipeline.add(self._recorder)
            _, release = add_file_branch(self._pipeline, self._recorder, options.recording)
            self._release.callback(release)
        self._pipeline.set_state(Gst.State.PLAYING)

    def record(self, payload: bytes) -> None:
        """Hands packets of the transport stream to the recording, if there is one."""
        if self._recorder:
            self._recorder.emit("push-buffer", Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(payload)))

    def push(self, unit: AccessUnit) -> bool:
        """Decodes an access unit, as soon as the decoder has decoded those before it.

        Returns:
            Whether it was taken; the following ones depend on it. None are while the decoder is too slow, up
            to a key frame.

        Raises:
            UndecodableError: an element for its codec is not installed.
        """
        self.newest_s = time.monotonic()
        if unit.codec != self._codec:
            self._waiting.clear()
            self._change_codec(unit.codec)
        taken = self._waiting.put(unit, self.newest_s)
        self.feed()
        return taken

    def feed(self) -> None:
        """Gives the decoder what waits, as far as it has room; to be called often."""
        while self._source and self._source.get_property("current-level-buffers") < _AHEAD:
            waiting = self._waiting.take()
            if waiting is None:
                return
            self._decode(*waiting)

    @property
    def dropped_units(self) -> int:
        """Access units so far that the decoder was too slow for."""
        return self._waiting.dropped

    def check(self) -> None:
        """Raises the decoder's error.

        Raises:
            UndecodableError: there is one.
        """
        message = self._pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
        if message:
            raise undecodable(self._address, message.parse_error()[0].message)

    def close(self) -> None:
        """Stops; afterwards nothing reaches the queue."""
        stop(self._pipeline)
        self._remove_branch()
        self._release.close()

    def _decode(self, received_s: float, unit: AccessUnit) -> None:
        buffer = Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(unit.data))
        if unit.pts_ticks is not None:
            buffer.pts = self._time.time_ns(unit.pts_ticks)
            self._note_received(buffer.pts, received_s)
        if unit.first:
            buffer.set_flags(Gst.BufferFlags.DISCONT)
        self._source.emit("push-buffer", buffer)

    def _change_codec(self, codec: str) -> None:
        self._remove_branch()
        caps = f"video/x-{codec},stream-format=byte-stream,alignment=au"
        try:
            source = element("appsrc", caps=caps, is_live=True, format="time", max_bytes=0)
            self._branch = DecodingBranch(codec, self._queue, self._options, source, self._origin)
        except UserError as error:
            raise UndecodableError(error.what, error.remedy, final=True) from error
        self._codec, self._source = codec, source
        self._branch.attach(self._pipeline)

    def _remove_branch(self) -> None:
        if self._branch:
            self._branch.detach(self._pipeline)
            # It holds a method of ours: without this only a collector frees both, and GStreamer's sockets.
            self._branch = None

    def _note_received(self, pts_ns: int, received_s: float) -> None:
        self._received_s[pts_ns] = received_s
        if len(self._received_s) > _MOST_DECODING:
            # Of a frame that the decoder has dropped.
            self._received_s.pop(next(iter(self._received_s)), None)

    def _origin(self, pts_ns: int) -> Origin:
        """Returns the origin of a frame, for its decoder's time. On GStreamer's thread."""
        capture = self._options.capture
        captured_ns = capture.capture_ns(ns_to_ticks(pts_ns)) if capture else None
        return Origin(captured_ns, self._received_s.pop(pts_ns, None))
