"""Other ways to send live video over loopback, beside ours: the same camera and the same encoder settings.

`video.peer_ours_*` is the preview service and direct delivery. `video.peer_rtp_*` is bare RTP over UDP:
nothing is repaired, nothing is encrypted. `video.peer_webrtc_*` is GStreamer's webrtcbin. None of them waits
for the SRT latency, and both jitter buffers are set to 0 ms. Capture to decoded.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import foreign, product, reference, webrtc
from bench.video.camera import Camera, camera
from bench.video.plain_viewer import APPSINK, PlainViewer
from bench.video.viewing import Viewer, watch, watch_window
from tests.support.free import free_udp_port

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 3.0
WATCH_S: Final = 6.0
LATENCY_MS: Final = 125
"""Of the robot's SRT listener: direct delivery does not wait for it."""
_RTP_CAPS: Final = "application/x-rtp,media=video,clock-rate=90000,encoding-name=H264,payload=96"

Peer = Callable[[Camera, product.Robot], AbstractContextManager[Viewer]]
"""Sends, and connects a viewer, until its block ends."""


@dataclass(frozen=True, slots=True)
class Seen:
    """What a viewer saw in one round."""

    median_ms: float
    p99_ms: float
    delivered_percent: float


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    peers = {name: peer for name, peer in PEERS.items() if any(row.startswith(name) for row in wanted)}
    seen: dict[str, list[Seen]] = {name: [] for name in peers}
    with (
        camera(workdir) as source,
        product.robot(workdir, source, LATENCY_MS, settings=product.FIXED_RATE) as robot,
    ):
        for _ in range(ROUNDS):
            for name in peers:
                seen[name].append(one_round(name, source, robot))
    return [
        row
        for name, (_, what) in peers.items()
        for row in _rows(name, what, seen[name])
        if row.name in wanted
    ]


def one_round(
    name: str, source: Camera, robot: product.Robot, settle_s: float = SETTLE_S, watch_s: float = WATCH_S
) -> Seen:
    """Returns what a viewer sees of one way to send."""
    connect, _ = PEERS[name]
    with connect(source, robot) as viewer:
        watch(viewer, settle_s)
        window = watch_window(viewer, watch_s)
    delivered_percent = window.delivered_percent(source.captured(window.from_s, window.until_s))
    found = Seen(window.median_ms, window.p99_ms, delivered_percent)
    log(
        f"{name}: median {found.median_ms:.1f} ms, 99th percentile {found.p99_ms:.1f} ms,"
        f" {delivered_percent:.1f} % delivered"
    )
    return found


def _rows(name: str, what: str, seen: list[Seen]) -> list[Row]:
    return [
        Row(
            name=f"{name}_ms",
            what=f"{what}: capture to decoded, median (720p30)",
            unit="ms",
            values=[each.median_ms for each in seen],
            bar=None,
        ),
        Row(
            name=f"{name}_p99_ms",
            what=f"{what}: the same, 99th percentile",
            unit="ms",
            values=[each.p99_ms for each in seen],
            bar=None,
        ),
        Row(
            name=f"{name}_delivered_percent",
            what=f"{what}: frames decoded whole, of those that the camera took",
            unit="%",
            values=[each.delivered_percent for each in seen],
            bar=None,
            better="higher",
        ),
    ]


@contextmanager
def _ours(_source: Camera, robot: product.Robot) -> Iterator[Viewer]:
    with robot.preview(), robot.viewer(product.DIRECT_DELIVERY) as viewer:
        yield viewer


@contextmanager
def _rtp(source: Camera, _robot: product.Robot) -> Iterator[Viewer]:
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


@contextmanager
def _webrtc(source: Camera, _robot: product.Robot) -> Iterator[Viewer]:
    with webrtc.viewer(source) as viewer:
        yield viewer


PEERS: Final[Mapping[str, tuple[Peer, str]]] = {
    "video.peer_ours": (_ours, "preview service and direct delivery"),
    "video.peer_rtp": (_rtp, "bare RTP over UDP, without repair of lost packets"),
    "video.peer_webrtc": (_webrtc, "GStreamer's webrtcbin"),
}
"""By the begin of their rows' names: how they send, and for people."""
