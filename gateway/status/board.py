"""The board: the newest value of every source, handed over from the sampling threads to the asyncio loop.

Each hand-over is one assignment of an immutable value under a key that hashes by identity, which is atomic in
CPython. So there is no lock and no queue, and neither side waits; an older value is dropped.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gateway.status.sources import SourceSpec, ValueT
from gateway.status.values import Received


@dataclass(frozen=True, slots=True)
class Publishers:
    """The publishers of a source's topic in the ROS graph.

    Attributes:
        count: how many there are, of any type.
        qos_mismatch: why the QoS of each of them is incompatible with the gateway's; empty if one fits.
        wrong_type: whether all of them publish another type than configured.
    """

    count: int
    qos_mismatch: str = ""
    wrong_type: bool = False


@dataclass(frozen=True, slots=True)
class Unusable:
    """Why a source is not subscribed.

    Attributes:
        reason: for the log and the robot's doctor; it may name types.
        lacks_type: whether the message type is missing; otherwise its field is.
    """

    reason: str
    lacks_type: bool = True


class Board:
    """The newest value by source. Each source has exactly one writing thread; any thread may read.

    Attributes:
        publishers: by source; a source is absent until the graph was examined.
        unusable: sources that are not subscribed, with the reason.
        undecodable: sources of which the newest message could not be decoded.
        ros_passed_s: when the ROS sampler last had read all sources; monotonic seconds. None where no sampler
            runs.
    """

    __slots__ = ("_newest", "publishers", "ros_passed_s", "undecodable", "unusable")

    def __init__(self, newest: Mapping[SourceSpec[Any], Received[Any]] | None = None) -> None:
        self._newest: dict[SourceSpec[Any], Received[Any]] = dict(newest or {})
        self.publishers: dict[SourceSpec[Any], Publishers] = {}
        self.unusable: dict[SourceSpec[Any], Unusable] = {}
        self.undecodable: set[SourceSpec[Any]] = set()
        self.ros_passed_s: float | None = None

    def __getitem__(self, spec: SourceSpec[ValueT]) -> Received[ValueT] | None:
        """Returns the newest value; None before the first."""
        return self._newest.get(spec)

    def __setitem__(self, spec: SourceSpec[ValueT], received: Received[ValueT]) -> None:
        """Replaces the newest value, merging it with the present one where the spec says so."""
        present = self._newest.get(spec)
        if spec.merge and present:
            received = Received(spec.merge(present.value, received.value), received.at_s)
        self._newest[spec] = received
