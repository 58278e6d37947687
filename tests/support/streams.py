"""Transport streams made ahead of time, and an SRT sender that the test plays by hand."""

import threading
from types import TracebackType
from typing import Any, Self

from common.gst import GLib, Gst

SRT_PAYLOAD = 7 * 188
"""Bytes in a datagram: seven transport stream packets."""

MOVING_EVERYWHERE = "zone-plate kx2=10 ky2=10 kt2=2"
"""A pattern for `encode` in which each frame shows what is lacking of those before it."""

_X26X = "tune=zerolatency speed-preset=ultrafast bitrate={kbps} key-int-max={gop}"
_ENCODERS = {
    # Not a codec of ours: what a receiver says about it is tested.
    "mpeg4": "avenc_mpeg4 bitrate={kbps}000 gop-size={gop} ! mpeg4videoparse",
    "h264": f"x264enc {_X26X} ! h264parse config-interval=-1",
    "h265": f"x265enc {_X26X} ! h265parse config-interval=-1",
}


def encode(
    codec: str,
    frames: int,
    *,
    gop: int = 30,
    size: str = "320x240",
    fps: int = 30,
    kbps: int = 1000,
    pattern: str = "ball",
) -> list[bytes]:
    """A moving test pattern in an MPEG transport stream, cut into one piece per frame.

    Every piece ends with the end of its access unit; key frames carry their parameter sets.
    """
    width, height = size.split("x")
    encoder = _ENCODERS[codec].format(gop=gop, kbps=kbps)
    pipeline = Gst.parse_launch(
        f"videotestsrc num-buffers={frames} pattern={pattern}"
        f" ! video/x-raw,format=I420,width={width},height={height},framerate={fps}/1"
        f" ! {encoder} ! mpegtsmux alignment=0"
        f" ! appsink name=out sync=false buffer-list=true max-buffers=0"
    )
    pieces = []
    try:
        pipeline.set_state(Gst.State.PLAYING)
        out = pipeline.get_by_name("out")
        while sample := out.emit("try-pull-sample", 30 * Gst.SECOND):
            units = sample.get_buffer_list()
            buffers = [units.get(i) for i in range(units.length())] if units else [sample.get_buffer()]
            pieces.append(b"".join(one.extract_dup(0, one.get_size()) for one in buffers))
        assert len(pieces) == frames, f"{codec}: {len(pieces)} of {frames} frames encoded"
    finally:
        pipeline.set_state(Gst.State.NULL)
    return pieces


class SrtSender:
    """An SRT listener that sends what the test hands it, when the test hands it.

    Args:
        port: UDP port to listen on, at 127.0.0.1.
        latency_ms: SRT latency.
        passphrase: empty for no encryption.
    """

    def __init__(self, port: int, *, latency_ms: int = 20, passphrase: str = "") -> None:
        self.viewer_joined = threading.Event()
        self._pipeline = Gst.parse_launch(
            "appsrc name=in is-live=true format=time do-timestamp=true"
            f" ! srtsink name=out uri=srt://127.0.0.1:{port}?mode=listener latency={latency_ms}"
            " wait-for-connection=false sync=false async=false poll-timeout=1000"
        )
        sink = self._pipeline.get_by_name("out")
        if passphrase:
            sink.set_property("passphrase", passphrase)
            sink.set_property("pbkeylen", 32)
        self._sink = sink
        self._handler = sink.connect("caller-added", self._on_caller)
        self._input = self._pipeline.get_by_name("in")
        self._pipeline.set_state(Gst.State.PLAYING)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def send(self, piece: bytes) -> None:
        """Sends a piece of transport stream at once."""
        for start in range(0, len(piece), SRT_PAYLOAD):
            payload = Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(piece[start : start + SRT_PAYLOAD]))
            assert self._input.emit("push-buffer", payload) == Gst.FlowReturn.OK

    def close(self) -> None:
        """Hangs up on every viewer and frees the port."""
        self._pipeline.set_state(Gst.State.NULL)
        # GStreamer's sink holds our handler and we hold the sink: no collector would free either.
        if self._sink.handler_is_connected(self._handler):
            self._sink.disconnect(self._handler)

    def _on_caller(self, _sink: Any, _socket: int, _address: Any) -> None:
        self.viewer_joined.set()
