"""SRT's own delivery: one connection of GStreamer's srtsrc, every packet at SRT's latency."""

import socket
import threading
from collections import deque
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Final

from common.errors import UserError
from common.gst import GLib, Gst, stop
from console.name_lookup import resolve
from console.receiver.address import StreamAddress
from console.receiver.decoding import CODECS, DecodingBranch, Origin, element
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.errors import UndecodableError, ended, from_srt, no_socket, undecodable
from console.receiver.file_branch import add_file_branch
from console.receiver.frame_queue import FrameQueue
from console.receiver.libsrt import REMEDY_TOO_MANY_FILES, DirectImpossibleError, LocalSocketError
from console.receiver.options import CLOSES_WITHIN_S, ReceiverOptions
from console.receiver.stream_watch import StreamWatch

_STOP = "stop"
_BRANCH_GONE = "branch-gone"
_RESOLVES_WITHIN_S: Final = 3.0


class SrtConnection:
    """Connects to the robot, fills a frame queue, and ends the queue with the reason of a failure.

    GStreamer runs everything up to the decoder on the source's one thread; a second thread, our own, reads
    the bus. A change of codec makes the demultiplexer offer a new pad: it gets a decoder, and the old one is
    removed.

    Args:
        address: SRT listener to connect to.
        queue: takes the frames and the end of the stream.
        options: pixel format, decoders and recording.
        impossible: why delivery is not direct; None if it is not meant to be.

    Raises:
        UserError: a GStreamer element is not installed.
    """

    def __init__(
        self,
        address: StreamAddress,
        queue: FrameQueue,
        options: ReceiverOptions,
        impossible: DirectImpossibleError | None = None,
    ) -> None:
        self._impossible = impossible
        self.delivery = Delivery(
            kind=DeliveryChoice.SRT,
            reason=str(impossible) if impossible else "",
            remedy=impossible.remedy if impossible else "",
        )
        """The delivery in use."""
        self.received_s: float | None = None
        """Of direct delivery alone it is known when a frame was received."""
        self._address = address
        self._queue = queue
        self._options = options
        self._had_data = False
        self._branches: dict[str, DecodingBranch] = {}
        self._removed: deque[DecodingBranch] = deque()
        self._watch = StreamWatch()
        self._probes: dict[str, tuple[Any, int]] = {}
        """Pads of the demultiplexer with their probes, by name."""
        self._handlers = ExitStack()
        """Disconnects the handlers of GStreamer's signals."""
        self._pipeline = Gst.Pipeline.new(None)
        self._build()
        self._bus_reader = threading.Thread(target=self._read_bus, name="receiver-bus", daemon=True)
        self._bus_reader.start()
        self._pipeline.set_state(Gst.State.PLAYING)

    def close(self) -> bool:
        """Disconnects. Afterwards nothing reaches the queue.

        Returns:
            Whether that took less than `CLOSES_WITHIN_S`. A driver that hangs is left behind with its thread.
        """
        # GStreamer takes no timeout.
        closing = threading.Thread(target=self._disconnect, name="receiver-close", daemon=True)
        closing.start()
        closing.join(CLOSES_WITHIN_S)
        return not closing.is_alive()

    def _disconnect(self) -> None:
        self._post(_STOP)
        self._bus_reader.join()
        stop(self._pipeline)
        # GStreamer's objects hold our handlers and we hold them: without this no collector frees either, nor
        # the sockets they keep.
        for branch in (*self._branches.values(), *self._removed):
            branch.detach(self._pipeline)
        self._branches.clear()
        for pad, probe in (*self._probes.values(), (self._source_pad, self._probe)):
            pad.remove_probe(probe)
        self._probes.clear()
        self._handlers.close()

    def _build(self) -> None:
        # The URI first: setting it resets the source's other properties.
        source = element("srtsrc", uri=f"{_with_ipv4(self._address).uri}?mode=caller")
        for name, value in {
            "latency": self._address.latency_ms,
            # Whether and when to connect again is the caller's decision.
            "auto-reconnect": False,
            # Bounds how long the source takes to notice that it is to stop.
            "poll-timeout": 200,
            "passphrase": self._address.passphrase or None,
        }.items():
            if value is not None and source.find_property(name):
                source.set_property(name, value)
        self._source_pad = source.get_static_pad("src")
        self._probe: int = self._source_pad.add_probe(Gst.PadProbeType.BUFFER, self._on_data)
        demuxer = element("tsdemux", latency=0)
        for signal, handler in (("pad-added", self._on_pad_added), ("pad-removed", self._on_pad_removed)):
            self._handlers.callback(demuxer.disconnect, demuxer.connect(signal, handler))
        self._pipeline.add(source)
        self._pipeline.add(demuxer)
        if self._options.recording:
            source, release = add_file_branch(self._pipeline, source, self._options.recording)
            self._handlers.callback(release)
        source.link(demuxer)

    # On GStreamer's thread.

    def _on_data(self, _pad: Any, info: Any) -> Any:
        self._had_data = True
        buffer = info.get_buffer()
        self._watch.take(buffer.extract_dup(0, buffer.get_size()))
        return Gst.PadProbeReturn.OK

    def _on_unit(self, _pad: Any, info: Any) -> Any:
        buffer = info.get_buffer()
        self._watch.note(buffer.get_size(), buffer.pts)
        return Gst.PadProbeReturn.OK

    def _origin(self, pts_ns: int) -> Origin:
        return Origin(torn=self._watch.is_torn(pts_ns))

    def _on_pad_added(self, _demuxer: Any, pad: Any) -> None:
        media_type = pad.query_caps(None).get_structure(0).get_name()
        if not media_type.startswith("video/"):
            return
        codec = CODECS.get(media_type)
        if codec is None:
            self._queue.end(undecodable(self._address, media_type))
            return
        try:
            branch = DecodingBranch(codec, self._queue, self._options, origins=self._origin)
        except UserError as error:
            self._queue.end(UndecodableError(error.what, error.remedy, final=True))
            return
        self._probes[pad.get_name()] = pad, pad.add_probe(Gst.PadProbeType.BUFFER, self._on_unit)
        self._branches[pad.get_name()] = branch
        branch.attach(self._pipeline, pad)

    def _on_pad_removed(self, _demuxer: Any, pad: Any) -> None:
        if found := self._probes.pop(pad.get_name(), None):
            pad.remove_probe(found[1])
        branch = self._branches.pop(pad.get_name(), None)
        if branch:
            self._removed.append(branch)
            self._post(_BRANCH_GONE)

    # On the bus reader's thread.

    def _read_bus(self) -> None:
        bus = self._pipeline.get_bus()
        kinds = Gst.MessageType.ERROR | Gst.MessageType.EOS | Gst.MessageType.APPLICATION
        while True:
            message = bus.timed_pop_filtered(Gst.CLOCK_TIME_NONE, kinds)
            if message is None:
                # A bus that got no descriptor can't wait, and has lost what was posted.
                self._queue.end(
                    no_socket(self._address, "GStreamer gets no descriptor", REMEDY_TOO_MANY_FILES)
                )
                return
            if message.type == Gst.MessageType.ERROR:
                self._on_error(message)
            elif message.type == Gst.MessageType.EOS:
                self._queue.end(ended(self._address))
            elif message.get_structure().get_name() == _STOP:
                return
            else:
                self._removed.popleft().detach(self._pipeline)

    def _on_error(self, message: Any) -> None:
        error, detail = message.parse_error()
        why = self._impossible
        if any(branch.owns(message.src) for branch in self._branches.values()) or error.matches(
            GLib.quark_from_string("gst-stream-error-quark"), Gst.StreamError.DECODE
        ):
            self._queue.end(undecodable(self._address, error.message))
        elif isinstance(why, LocalSocketError) and error.matches(
            GLib.quark_from_string("gst-resource-error-quark"), Gst.ResourceError.OPEN_READ
        ):
            # The source has sent nothing either: the robot is not to blame.
            self._queue.end(no_socket(self._address, str(why), why.remedy))
        else:
            self._queue.end(from_srt(self._address, detail or error.message, had_data=self._had_data))

    def _post(self, name: str) -> None:
        self._pipeline.post_message(
            Gst.Message.new_application(self._pipeline, Gst.Structure.new_empty(name))
        )


def _with_ipv4(address: StreamAddress) -> StreamAddress:
    """Returns the address with its host resolved to IPv4 where there is one: GLib would prefer IPv6."""
    try:
        found = resolve(address.host, address.port, socket.SOCK_DGRAM, _RESOLVES_WITHIN_S)
    except OSError:
        # The source resolves the name itself and reports the failure.
        return address
    ipv4 = [str(each[4][0]) for each in found if each[0] == socket.AF_INET]
    return replace(address, host=ipv4[0]) if ipv4 else address
