"""Judges by its pixels whether a frame that is shown is whole.

A decoder conceals what is missing and does not report it: avdec_h264 and avdec_h265 of GStreamer 1.22 mark no
such frame. But for the same access units any decoder gives the same pixels (H.264 and H.265 leave it no
choice), so a whole frame is one that a decoder gives that has lost nothing of the stream.
"""

from collections.abc import Iterable, Sequence
from typing import Final
from zlib import crc32

from common.gst import GLib, Gst, GstVideo, stop
from console.receiver.frame import Frame

_ROW_STEP: Final = 8
_PATIENCE_NS: Final = 30_000_000_000


def fingerprint(frame: Frame, pixels: bytes | None = None) -> int:
    """Returns a number that only frames with the same luma share, of a frame in I420.

    Args:
        frame: which.
        pixels: of it, where they were read already.
    """
    return _fingerprint(pixels or frame.read(), frame.width, frame.height, frame.stride)


class WholePictures:
    """The frames that a stream has when nothing of it is lost, decoded in software.

    Args:
        stream: an MPEG transport stream, from a key frame on.
    """

    def __init__(self, stream: bytes) -> None:
        self.fingerprints = _decoded(stream) if stream else []
        """Of its frames, in order."""
        self._numbers = {found: number for number, found in enumerate(self.fingerprints)}

    def __contains__(self, shown: int) -> bool:
        return shown in self._numbers

    def torn(self, shown: Iterable[int]) -> int:
        """Returns how many frames, by their fingerprints, are none of the stream's."""
        return sum(each not in self for each in shown)

    def numbers(self, frames: Sequence[Frame]) -> list[int | None]:
        """Returns the place in the stream of each frame, from 0 on; None of a torn one."""
        assert len(self._numbers) == len(self.fingerprints), "frames that are alike can't be identified"
        return [self._numbers.get(fingerprint(frame)) for frame in frames]


def _decoded(stream: bytes) -> list[int]:
    """Returns the fingerprints of a stream's frames."""
    pipeline = Gst.parse_launch(
        "appsrc name=in caps=video/mpegts,systemstream=true,packetsize=188"
        " ! decodebin force-sw-decoders=true ! videoconvert ! video/x-raw,format=I420"
        " ! appsink name=out sync=false max-buffers=8"
    )
    found = []
    try:
        pipeline.set_state(Gst.State.PLAYING)
        source, out = pipeline.get_by_name("in"), pipeline.get_by_name("out")
        source.emit("push-buffer", Gst.Buffer.new_wrapped_bytes(GLib.Bytes.new(stream)))
        source.emit("end-of-stream")
        while sample := out.emit("try-pull-sample", _PATIENCE_NS):
            layout = GstVideo.VideoInfo.new_from_caps(sample.get_caps())
            buffer = sample.get_buffer()
            pixels = buffer.extract_dup(0, buffer.get_size())
            found.append(_fingerprint(pixels, layout.width, layout.height, layout.stride[0]))
        assert out.get_property("eos"), "the stream can't be decoded"
    finally:
        stop(pipeline)
    return found


def _fingerprint(pixels: bytes, width: int, height: int, stride: int) -> int:
    """Returns the CRC of each eighth row of luma: two of each block that a decoder conceals."""
    rows = range(0, height * stride, _ROW_STEP * stride)
    return crc32(b"".join(pixels[row : row + width] for row in rows))
