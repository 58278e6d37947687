"""Other ways to send live video over loopback, from the same camera with the same encoder settings.

`video.peer_rtp_ms` is bare RTP over UDP: nothing is repaired, nothing is encrypted. `video.peer_webrtc_ms` is
GStreamer's webrtcbin. Neither waits for lost packets, and both jitter buffers are set to 0 ms: they show
what remains when the SRT latency is taken away. Capture to decoded, median.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import foreign, reference, webrtc
from bench.video.camera import Camera, camera
from bench.video.plain_viewer import APPSINK, PlainViewer
from bench.video.viewing import Viewer, watch, watch_window
from tests.support.free import free_udp_port

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 3.0
WATCH_S: Final = 6.0
_RTP_CAPS: Final = "application/x-rtp,media=video,clock-rate=90000,encoding-name=H264,payload=96"

_Peer = Callable[[Camera], AbstractContextManager[Viewer]]


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    peers: dict[str, tuple[_Peer, str]] = {
        "video.peer_rtp_ms": (_rtp, "bare RTP over UDP"),
        "video.peer_webrtc_ms": (webrtc.viewer, "GStreamer's webrtcbin"),
    }
    peers = {name: peer for name, peer in peers.items() if name in wanted}
    medians_ms: dict[str, list[float]] = {name: [] for name in peers}
    with camera(workdir) as source:
        for _ in range(ROUNDS):
            for name, (connect, _) in peers.items():
                medians_ms[name].append(_round(source, connect, name))
    return [
        Row(
            name=name,
            what=f"{what}: capture to decoded, median, without repair of lost packets (720p30)",
            unit="ms",
            values=medians_ms[name],
            bar=None,
        )
        for name, (_, what) in peers.items()
    ]


def _round(source: Camera, connect: _Peer, name: str) -> float:
    with connect(source) as viewer:
        watch(viewer, SETTLE_S)
        window = watch_window(viewer, WATCH_S)
    delivered = window.delivered_percent(source.captured(window.from_s, window.until_s))
    log(f"{name}: {window.median_ms:.1f} ms, {delivered:.1f} % delivered")
    return window.median_ms


@contextmanager
def _rtp(source: Camera) -> Iterator[PlainViewer]:
    port = free_udp_port()
    receiver = (
        f"udpsrc address=127.0.0.1 port={port} buffer-size=2000000 caps={_RTP_CAPS}"
        f" ! rtpjitterbuffer latency=0 ! rtph264depay ! avdec_h264 ! {APPSINK}"
    )
    sender = (
        f"{source.source} ! {reference.same_encoder()}"
        " ! rtph264pay config-interval=-1 aggregate-mode=zero-latency"
        f" ! udpsink host=127.0.0.1 port={port} sync=false async=false"
    )
    with PlainViewer(receiver) as viewer, foreign.running("gst-launch-1.0", "-q", *sender.split()):
        yield viewer
