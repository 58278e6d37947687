"""One SRT connection and what decodes it."""

import socket
import threading
from collections import deque
from dataclasses import replace
from typing import Any

from common.errors import UserError
from common.gst import GLib, Gst
from console.receiver.address import StreamAddress
from console.receiver.decoding import CODECS, DecodingBranch, element
from console.receiver.errors import UndecodableError, ended, from_srt
from console.receiver.file_branch import FileBranch
from console.receiver.inbox import Inbox
from console.receiver.setup import Setup

_STOP = "stop"
_BRANCH_GONE = "branch-gone"


class Connection:
    """Calls the robot, fills the inbox, and ends it with a reason when the connection is over.

    GStreamer runs everything up to the decoder on the source's one thread; a second thread, ours, reads the
    bus. A change of codec makes the demultiplexer offer a new pad: it gets a decoder, the old one leaves.

    Args:
        address: what to call.
        inbox: where pictures and the end go.
        setup: what the caller wants of the pictures, and whether the stream is kept.

    Raises:
        UserError: a GStreamer element is not installed.
    """

    def __init__(self, address: StreamAddress, inbox: Inbox, setup: Setup) -> None:
        self._address = address
        self._inbox = inbox
        self._setup = setup
        self._file: FileBranch | None = None
        self._had_data = False
        self._branches: dict[str, DecodingBranch] = {}
        self._leaving: deque[DecodingBranch] = deque()
        self._pipeline = Gst.Pipeline.new(None)
        self._build()
        self._watcher = threading.Thread(target=self._watch, name="receiver-bus", daemon=True)
        self._watcher.start()
        self._pipeline.set_state(Gst.State.PLAYING)

    def close(self) -> None:
        """Hangs up. After it nothing more reaches the inbox."""
        self._tell_watcher(_STOP)
        self._watcher.join()
        self._pipeline.set_state(Gst.State.NULL)
        # GStreamer's objects hold our handlers and we hold them: without this no collector frees either, nor
        # the sockets they keep.
        for branch in (*self._branches.values(), *self._leaving):
            branch.detach(self._pipeline)
        self._branches.clear()
        if self._file:
            self._file.detach()
        if self._probe is not None:
            self._way_in.remove_probe(self._probe)
        for handler in self._handlers:
            self._demuxer.disconnect(handler)

    def _build(self) -> None:
        # The URI first: setting it resets the source's other properties.
        source = element("srtsrc", uri=f"{_with_number(self._address).uri}?mode=caller")
        for name, value in {
            "latency": self._address.latency_ms,
            # Whether and when to call again is the Receiver's decision.
            "auto-reconnect": False,
            # Bounds how long the source may take to notice that it shall stop.
            "poll-timeout": 200,
            "passphrase": self._address.passphrase or None,
        }.items():
            if value is not None and source.find_property(name):
                source.set_property(name, value)
        self._way_in = source.get_static_pad("src")
        self._probe: int | None = self._way_in.add_probe(Gst.PadProbeType.BUFFER, self._on_first_data)
        demuxer = element("tsdemux", latency=0)
        self._demuxer = demuxer
        self._handlers = [
            demuxer.connect("pad-added", self._on_pad_added),
            demuxer.connect("pad-removed", self._on_pad_removed),
        ]
        for one in (source, demuxer):
            self._pipeline.add(one)
        if self._setup.recording:
            self._file = FileBranch(self._setup.recording)
            self._file.attach(self._pipeline, source).link(demuxer)
        else:
            source.link(demuxer)

    # Called on GStreamer's thread.

    def _on_first_data(self, _pad: Any, _info: Any) -> Any:
        self._had_data = True
        self._probe = None
        return Gst.PadProbeReturn.REMOVE

    def _on_pad_added(self, _demuxer: Any, pad: Any) -> None:
        media_type = pad.query_caps(None).get_structure(0).get_name()
        if not media_type.startswith("video/"):
            return
        codec = CODECS.get(media_type)
        if codec is None:
            self._inbox.end(_undecodable(self._address, media_type))
            return
        try:
            branch = DecodingBranch(codec, self._inbox.put, self._setup)
        except UserError as error:
            self._inbox.end(UndecodableError(error.what, error.remedy, final=True))
            return
        self._branches[pad.get_name()] = branch
        branch.attach(self._pipeline, pad)

    def _on_pad_removed(self, _demuxer: Any, pad: Any) -> None:
        branch = self._branches.pop(pad.get_name(), None)
        if branch:
            self._leaving.append(branch)
            self._tell_watcher(_BRANCH_GONE)

    # Called on the watcher's thread.

    def _watch(self) -> None:
        bus = self._pipeline.get_bus()
        wanted = Gst.MessageType.ERROR | Gst.MessageType.EOS | Gst.MessageType.APPLICATION
        while True:
            message = bus.timed_pop_filtered(Gst.CLOCK_TIME_NONE, wanted)
            if message is None:
                continue
            if message.type == Gst.MessageType.ERROR:
                self._on_error(message)
            elif message.type == Gst.MessageType.EOS:
                self._inbox.end(ended(self._address))
            elif message.get_structure().get_name() == _STOP:
                return
            else:
                self._leaving.popleft().detach(self._pipeline)

    def _on_error(self, message: Any) -> None:
        error, detail = message.parse_error()
        if any(branch.is_mine(message.src) for branch in self._branches.values()) or error.matches(
            GLib.quark_from_string("gst-stream-error-quark"), Gst.StreamError.DECODE
        ):
            self._inbox.end(_undecodable(self._address, error.message))
        else:
            self._inbox.end(from_srt(self._address, detail or error.message, had_data=self._had_data))

    def _tell_watcher(self, what: str) -> None:
        self._pipeline.post_message(
            Gst.Message.new_application(self._pipeline, Gst.Structure.new_empty(what))
        )


def _with_number(address: StreamAddress) -> StreamAddress:
    """The same with a number for a name: of IPv4 where there is one. GLib would take IPv6 first."""
    try:
        found = socket.getaddrinfo(address.host, address.port, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError:
        # The source tries by itself, and says what is wrong.
        return address
    return replace(address, host=str(found[0][4][0]))


def _undecodable(address: StreamAddress, what: str) -> UndecodableError:
    return UndecodableError(
        f"{address.uri} sends {what}, which this receiver can't decode",
        "It takes H.264 and H.265 in an MPEG transport stream: is this the robot's preview port",
        final=True,
    )
