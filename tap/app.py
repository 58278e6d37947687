"""Assembles the camera tap, starts its parts in order and stops them in reverse."""

import asyncio
import json
import logging
import socket
import time
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, nullcontext
from typing import Any, Final, NoReturn

from common import bind, heartbeat
from common.metrics_endpoint import serving_metrics
from common.metrics_settings import MetricsSettings
from common.ros_node import OwnNode, ros_node
from common.tasks import cancel
from tap.camera import Graph
from tap.config import TapSettings
from tap.connection import Connection
from tap.metrics import TapMetrics
from tap.totals import Totals

_log = logging.getLogger(__name__)

MAX_CONNECTIONS: Final = 32
"""A preview has at most two cameras open, and asks for those of the others that are there."""
HUNG_AFTER_S: Final = 10.0
"""A thread inside the middleware for so long does not come back."""
_CHECK_EVERY_S: Final = 1.0
_JOIN_S: Final = 1.0


async def serve(settings: TapSettings, stop: asyncio.Event) -> None:
    """Serves until `stop`.

    Raises:
        UserError: the socket or ROS 2 can't be used.
    """
    totals = Totals()
    with ros_node(OwnNode.TAP) as node:
        connections = Connections(Graph(node), totals, 1 / settings.max_fps)
        async with connections.accepting(settings), _metrics(settings.metrics, totals):
            checking = asyncio.create_task(connections.check(), name="check threads")
            heartbeat.own().ready()
            _log.info("serving on %s", settings.socket)
            try:
                await stop.wait()
            finally:
                await cancel([checking])


class Connections:
    """The connections of the program; used on its loop.

    Args:
        graph: where the topics are.
        totals: what is counted.
        min_interval_s: between two frames of a connection.
    """

    def __init__(self, graph: Graph, totals: Totals, min_interval_s: float) -> None:
        self._graph, self._totals, self._min_interval_s = graph, totals, min_interval_s
        self._open: list[Connection] = []

    @asynccontextmanager
    async def accepting(self, settings: TapSettings) -> AsyncIterator[None]:
        """Accepts connections while the block lasts, then ends them.

        Raises:
            UserError: the socket can't be bound.
        """
        listener = bind.packet_socket(settings.socket)
        loop = asyncio.get_running_loop()
        loop.add_reader(listener, self._accept, listener)
        try:
            yield
        finally:
            loop.remove_reader(listener)
            listener.close()
            settings.socket.unlink(missing_ok=True)
            for each in self._open:
                each.close()
            for each in self._open:
                if not await asyncio.to_thread(each.join, _JOIN_S):
                    _log.error("%s: the middleware hangs", each.topic)

    async def check(self) -> NoReturn:
        """Withholds the heartbeat while a thread hangs in the middleware, until it is cancelled."""
        while True:
            self._open = [each for each in self._open if not each.has_ended]
            before_s = time.monotonic() - HUNG_AFTER_S
            hung = [each.topic for each in self._open if each.passed_s < before_s]
            heartbeat.own().withheld = f"the middleware hangs at {hung[0]}" if hung else ""
            await asyncio.sleep(_CHECK_EVERY_S)

    def _accept(self, listener: socket.socket) -> None:
        try:
            connected, _ = listener.accept()
        except BlockingIOError:
            return  # Gone again.
        except OSError as error:
            _log.error("a connection can't be accepted: %s", error.strerror)
            return
        self._open = [each for each in self._open if not each.has_ended]
        if len(self._open) >= MAX_CONNECTIONS:
            _log.warning("refused a connection: there are %d", len(self._open))
            connected.close()
            return
        connection = Connection(connected, self._graph, self._totals, self._state, self._min_interval_s)
        self._open.append(connection)
        connection.start()

    def _state(self) -> str:
        """Returns the state of the tap; called by any thread."""
        wanted = sorted({each.topic for each in self._open if each.topic and not each.has_ended})
        state: dict[str, Any] = {"wanted": wanted, "topics": self._totals.as_dict()}
        return json.dumps(state)


def _metrics(settings: MetricsSettings, totals: Totals) -> AbstractAsyncContextManager[int | None]:
    if settings.port is None:
        return nullcontext()
    return serving_metrics(TapMetrics(totals).text, settings.host, settings.port)
