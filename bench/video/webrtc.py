"""GStreamer's webrtcbin on loopback: a sender in a process of its own, and a viewer here.

The offer and the answer are exchanged as text once all ICE candidates are known (no trickle, RFC 8838), over
the sender's standard output and input.
"""

import json
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from bench.processes import first_line, piped_program
from bench.progress import log
from bench.video import reference
from bench.video.camera import Camera
from bench.video.plain_viewer import APPSINK, PlainViewer
from common.gst import Gst
from console.receiver.errors import StreamEndedError

import gi  # isort: skip  # after common.gst, which prepares the process for it

gi.require_version("GstSdp", "1.0")
gi.require_version("GstWebRTC", "1.0")
from gi.repository import GstSdp, GstWebRTC  # noqa: E402

_WITHIN_S: Final = 15.0
_FRAME_WITHIN_S: Final = 5.0
_ATTEMPTS: Final = 3
_BIN: Final = "webrtcbin name=peer bundle-policy=max-bundle latency=0"


@contextmanager
def viewer(source: Camera) -> Iterator[PlainViewer]:
    """Runs a sender and connects a viewer to it until the block ends; begun anew where no frame comes.

    It has happened that webrtcbin negotiates, and then sends nothing for good.
    """
    for attempt in range(1, _ATTEMPTS + 1):
        with _connected(source) as found:
            try:
                found.next_frame(_FRAME_WITHIN_S)
            except StreamEndedError:
                log(f"webrtcbin: no frame within {_FRAME_WITHIN_S:g} s, attempt {attempt}")
            else:
                yield found
                return
    raise RuntimeError("webrtcbin sends nothing")


@contextmanager
def _connected(source: Camera) -> Iterator[PlainViewer]:
    with piped_program("bench.video.webrtc", source.source) as sender:
        assert sender.stdin
        pipeline = _receiver()
        with PlainViewer(pipeline) as found:
            answer = _answer(pipeline.get_by_name("peer"), json.loads(first_line(sender)))
            sender.stdin.write(json.dumps(answer) + "\n")
            sender.stdin.flush()
            yield found


def _receiver() -> Any:
    """Returns a pipeline whose decoder is linked as soon as the stream appears."""
    pipeline = Gst.parse_launch(f"{_BIN} rtph264depay name=branch ! avdec_h264 ! {APPSINK}")
    branch = pipeline.get_by_name("branch")

    def on_pad_added(_peer: Any, pad: Any) -> None:
        if pad.direction == Gst.PadDirection.SRC:
            pad.link(branch.get_static_pad("sink"))

    pipeline.get_by_name("peer").connect("pad-added", on_pad_added)
    return pipeline


def _answer(peer: Any, offer: str) -> str:
    _call(peer, "set-remote-description", _description(GstWebRTC.WebRTCSDPType.OFFER, offer))
    return _describe(peer, "answer")


def _describe(peer: Any, kind: str) -> str:
    """Returns the text of an offer or an answer, with all ICE candidates."""
    promise = _call(peer, f"create-{kind}", None)
    # Each belongs to the one before, which PyGObject does not know: all are kept until the text is copied.
    reply = promise.get_reply()
    made = reply.get_value(kind)
    text = made.sdp.as_text()
    gathered = threading.Event()

    def on_gathering(*_: object) -> None:
        if peer.get_property("ice-gathering-state") == GstWebRTC.WebRTCICEGatheringState.COMPLETE:
            gathered.set()

    peer.connect("notify::ice-gathering-state", on_gathering)
    types = GstWebRTC.WebRTCSDPType
    _call(
        peer,
        "set-local-description",
        _description(types.OFFER if kind == "offer" else types.ANSWER, text),
    )
    on_gathering()
    if not gathered.wait(_WITHIN_S):
        raise RuntimeError("ICE candidates were not gathered")
    local = peer.get_property("local-description")
    return str(local.sdp.as_text())


def _call(peer: Any, signal: str, argument: Any) -> Any:
    """Emits an action signal of webrtcbin and returns its promise, which has been replied to."""
    promise = Gst.Promise.new()
    peer.emit(signal, argument, promise)
    if promise.wait() != Gst.PromiseResult.REPLIED:
        raise RuntimeError(f"webrtcbin did not reply to {signal}")
    return promise


def _description(kind: Any, text: str) -> Any:
    _, message = GstSdp.SDPMessage.new_from_text(text)
    return GstWebRTC.WebRTCSessionDescription.new(kind, message)


def _send(source: str) -> None:
    """Sends to one viewer until standard input closes."""
    pipeline = Gst.parse_launch(
        f"{source} ! {reference.same_encoder()} ! rtph264pay config-interval=-1 aggregate-mode=zero-latency"
        f" ! application/x-rtp,media=video,encoding-name=H264,payload=96 ! {_BIN}"
    )
    peer = pipeline.get_by_name("peer")
    negotiable = threading.Event()
    peer.connect("on-negotiation-needed", lambda _: negotiable.set())
    pipeline.set_state(Gst.State.PLAYING)
    if not negotiable.wait(_WITHIN_S):
        raise RuntimeError("webrtcbin never needed a negotiation")
    print(json.dumps(_describe(peer, "offer")), flush=True)
    answer = _description(GstWebRTC.WebRTCSDPType.ANSWER, json.loads(sys.stdin.readline()))
    _call(peer, "set-remote-description", answer)
    sys.stdin.read()
    pipeline.set_state(Gst.State.NULL)


if __name__ == "__main__":
    _send(sys.argv[1])
