"""Capture to decoded, beyond the SRT latency: both senders, each seen by both receivers.

Four cells separate what the sender contributes from what the receiver contributes. Both senders use the same
encoder with the same preset, bit rate and distance of key frames. Each cell is measured alone on the
machine, and all of them in every round.
"""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from bench.video import product, reference
from bench.video.camera import Camera, camera
from bench.video.viewing import Viewer, watch, watch_window
from console.receiver.address import StreamAddress
from tests.support.free import free_udp_port
from tests.support.receiver import Receiver

ROUNDS: Final = FEWEST_ROUNDS
SETTLE_S: Final = 2.5
"""Longer than the distance of key frames, for which the reference's viewers wait."""
WATCH_S: Final = 8.0
LATENCY_MS: Final = 125
_FRAME_INTERVAL_MS: Final = 33.0


@dataclass(frozen=True, slots=True)
class Cell:
    """A sender and a receiver.

    Args:
        our_sender: the preview service's, or the reference's.
        our_receiver: the console's, or the plain one.
    """

    our_sender: bool
    our_receiver: bool

    @property
    def name(self) -> str:
        """Common part of its rows' names."""
        sender = "ours" if self.our_sender else "reference"
        return f"video.excess_{sender}_sender_{'ours' if self.our_receiver else 'plain'}_receiver"

    def sender(self, source: Camera, robot: product.Robot, port: int) -> AbstractContextManager[Any]:
        """Sends until the block ends; the reference on `port`."""
        if self.our_sender:
            return robot.preview()
        return reference.sender(source, port, LATENCY_MS, reference.same_encoder())

    def receiver(self, port: int) -> AbstractContextManager[Viewer]:
        """Connects a receiver until the block ends."""
        if self.our_receiver:
            address = StreamAddress(product.HOST, port, LATENCY_MS)
            return Receiver(address, queue_size=4, options=product.SRT_DELIVERY)
        return reference.viewer(port, LATENCY_MS)


CELLS: Final = tuple(Cell(sender, receiver) for sender in (False, True) for receiver in (False, True))


@dataclass(frozen=True, slots=True)
class Outcome:
    """One round of a cell: median and 99th percentile beyond the SRT latency, and the frames delivered."""

    median_ms: float
    p99_ms: float
    delivered_percent: float


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    outcomes = {cell: list[Outcome]() for cell in CELLS if any(row.startswith(cell.name) for row in wanted)}
    with (
        camera(workdir) as source,
        product.robot(workdir, source, LATENCY_MS, settings=product.FIXED_RATE) as robot,
    ):
        for _ in range(ROUNDS):
            for cell, found in outcomes.items():
                found.append(measure(cell, source, robot))
    return [row for cell, found in outcomes.items() for row in _rows(cell, found) if row.name in wanted]


def measure(
    cell: Cell, source: Camera, robot: product.Robot, settle_s: float = SETTLE_S, watch_s: float = WATCH_S
) -> Outcome:
    """Returns one round of a cell.

    Args:
        cell: sender and receiver.
        source: the camera.
        robot: the product, its preview disabled.
        settle_s: time before the window.
        watch_s: length of the window.
    """
    port = robot.address.port if cell.our_sender else free_udp_port()
    with cell.sender(source, robot, port), cell.receiver(port) as viewer:
        watch(viewer, settle_s)
        window = watch_window(viewer, watch_s)
    delivered_percent = window.delivered_percent(source.captured(window.from_s, window.until_s))
    found = Outcome(window.median_ms - LATENCY_MS, window.p99_ms - LATENCY_MS, delivered_percent)
    median, p99 = f"{found.median_ms:.1f} ms", f"{found.p99_ms:.1f} ms"
    log(f"{cell.name}: median {median}, 99th percentile {p99}, {delivered_percent:.1f} % delivered")
    return found


def _rows(cell: Cell, found: list[Outcome]) -> list[Row]:
    sender = "our sender" if cell.our_sender else "reference sender"
    about = f"{sender}, {'our' if cell.our_receiver else 'plain'} receiver"
    promised = cell.our_sender and cell.our_receiver
    return [
        Row(
            name=f"{cell.name}_ms",
            what=f"{about}: capture to decoded beyond the SRT latency of {LATENCY_MS} ms, median (720p30)",
            unit="ms",
            values=[each.median_ms for each in found],
            bar=12 if promised else None,
        ),
        Row(
            name=f"{cell.name}_p99_ms",
            what=f"{about}: the same, 99th percentile",
            unit="ms",
            values=[each.p99_ms for each in found],
            bar=_FRAME_INTERVAL_MS if promised else None,
        ),
        Row(
            name=f"{cell.name}_delivered_percent",
            what=f"{about}: frames decoded whole, of those that the camera took",
            unit="%",
            values=[each.delivered_percent for each in found],
            bar=99 if promised else None,
            better="higher",
        ),
    ]
