"""CPU of the sender for each additional viewer, against gst-launch-1.0's srtsink.

The slope of the line through 1, 4 and 16 viewers, which receive and do not decode. Both senders are measured
in every round, each alone on the machine, with the same encoder settings.
"""

import json
from pathlib import Path
from typing import Final

from bench.processes import cpu_share, program
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, MeasurementError, Row
from bench.video import product, reference
from bench.video.camera import camera
from bench.video.window import slope
from tests.support.free import free_udp_port

ROUNDS: Final = FEWEST_ROUNDS
COUNTS: Final = (1, 4, 16)
SETTLE_S: Final = 1.0
WINDOW_S: Final = 5.0
LATENCY_MS: Final = 125
_LEAST_BYTES: Final = 0.8 * reference.BITRATE_KBPS * 1000 / 8 * (SETTLE_S + WINDOW_S)


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    theirs: list[float] = []
    ours: list[float] = []
    with (
        camera(workdir) as source,
        product.robot(workdir, source, LATENCY_MS, settings=product.FIXED_RATE) as robot,
    ):
        for _ in range(ROUNDS):
            port = free_udp_port()
            encoder = reference.same_encoder()
            with reference.sender(source, port, LATENCY_MS, encoder) as process:
                theirs.append(_per_viewer(process.pid, port, "gst-launch-1.0"))
            with robot.preview():
                ours.append(_per_viewer(robot.service.pid, robot.address.port, "ours"))
    return [
        Row(
            name="video.viewer_cpu",
            what=f"CPU of the sender per additional viewer, slope over {COUNTS[0]} to {COUNTS[-1]} viewers,"
            " against gst-launch-1.0",
            unit="% of a core",
            values=ours,
            references=theirs,
            bar=1.25,
        )
    ]


def _per_viewer(pid: int, port: int, name: str) -> float:
    """Returns the growth for each viewer, in percent of a core."""
    shares = []
    for count in COUNTS:
        with program("bench.video.receivers", str(port), str(LATENCY_MS), str(count)) as receivers:
            cpu_share(pid, SETTLE_S)
            shares.append(cpu_share(pid, WINDOW_S).whole)
            assert receivers.stdin
            assert receivers.stdout
            receivers.stdin.close()
            received = json.loads(receivers.stdout.readline())
        # Viewers that receive little need little.
        if min(received) < _LEAST_BYTES:
            raise MeasurementError(f"{name}: one of {count} viewers received only {min(received)} bytes")
    found = slope(COUNTS, shares)
    line = ", ".join(f"{share:.1f} % with {count}" for count, share in zip(COUNTS, shares, strict=True))
    log(f"{name}: {line} viewers: {found:.3f} % for each")
    return found
