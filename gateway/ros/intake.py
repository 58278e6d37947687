"""Everything between the ROS 2 graph and the board, as one `with` block."""

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from common.ros_node import OwnNode, TypeMissingError, ros_node
from common.sampler import SAMPLING_HZ, Sampler
from gateway.config import SourceSettings
from gateway.ros.field_types import FieldMissingError
from gateway.ros.publishers import PublisherMonitor
from gateway.ros.readers import reader_for
from gateway.ros.source import Source
from gateway.ros.subscription import subscribe
from gateway.status.board import Board, Unusable

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Intake:
    """The running sampler, and its sources by name."""

    sampler: Sampler
    sources: Mapping[str, Source]


@contextmanager
def intake(
    settings: Sequence[SourceSettings], board: Board, *, rate_hz: float = SAMPLING_HZ
) -> Iterator[Intake]:
    """Reads the sources onto the board until the block ends; entering and leaving take about 0.1 s each.

    A source whose message type is not installed, or lacks its field, is left out; `board.unusable` has it.

    Raises:
        UserError: rclpy is missing or can't start, or a configured type has no reader.
    """
    for source in settings:
        reader_for(source)  # reports a mistake in the configuration before anything starts
    with ros_node(OwnNode.GATEWAY) as node:
        sources = dict(_open(node, settings, board))
        monitor = PublisherMonitor(node, [source for source in settings if source.name in sources], board)
        with Sampler((*sources.values(), monitor), board, rate_hz) as sampler:
            yield Intake(sampler, sources)


def _open(node: Any, settings: Sequence[SourceSettings], board: Board) -> Iterator[tuple[str, Source]]:
    for source in settings:
        try:
            subscription = subscribe(node, source)
        except (TypeMissingError, FieldMissingError) as error:
            board.unusable[source.spec] = Unusable(str(error), isinstance(error, TypeMissingError))
            log.warning("source '%s' is not read: %s", source.name, error)
        else:
            yield source.name, Source(source, subscription, board, created_at_s=time.monotonic())
            log.info("source '%s' reads %s (%s)", source.name, source.topic, source.type)
