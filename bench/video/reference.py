"""The reference: the usual pipeline, a gst-launch-1.0 sender and a plain receiver."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from bench.video import foreign
from bench.video.camera import Camera
from bench.video.plain_viewer import APPSINK, PlainViewer
from preview.encoders.catalogue import CATALOGUE
from preview.encoders.properties import vbv_ms

PLAIN_X264: Final = "x264enc tune=zerolatency speed-preset=veryfast bitrate=2500 key-int-max=30"
"""As it is usually written."""
KEY_FRAMES_APART_S: Final = 1.0
"""Of PLAIN_X264, at 30 frames per second."""
BITRATE_KBPS: Final = 2500
GOP_FRAMES: Final = 60


@contextmanager
def sender(
    source: Camera, port: int, latency_ms: int, encoder: str = PLAIN_X264
) -> Iterator[subprocess.Popen[bytes]]:
    """Sends until the block ends.

    Args:
        source: the camera.
        port: UDP port to listen on, at 127.0.0.1.
        latency_ms: SRT latency.
        encoder: element and properties.
    """
    description = (
        f"{source.source} ! {encoder} ! h264parse config-interval=-1 ! mpegtsmux alignment=7"
        f" ! srtsink uri=srt://127.0.0.1:{port}?mode=listener latency={latency_ms}"
        " wait-for-connection=false sync=false"
    )
    with foreign.running("gst-launch-1.0", "-q", *description.split()) as process:
        yield process


def viewer(port: int, latency_ms: int) -> PlainViewer:
    """Connects a plain receiver to an SRT listener on this machine."""
    return PlainViewer(
        f"srtsrc uri=srt://127.0.0.1:{port}?mode=caller latency={latency_ms}"
        f" ! tsdemux ! h264parse ! avdec_h264 ! {APPSINK}"
    )


def same_encoder() -> str:
    """Returns the preview service's encoder for balanced: its preset, bit rate and distance of key frames."""
    properties = CATALOGUE["x264"].properties
    values = {
        **properties.fixed,
        "bitrate": BITRATE_KBPS,
        "key-int-max": GOP_FRAMES,
        properties.vbv_ms: vbv_ms(BITRATE_KBPS),
    }
    return " ".join(["x264enc", *(f"{name}={value}" for name, value in values.items())])
