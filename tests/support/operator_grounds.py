"""Where the operator's contract is tried: the real gateway with the real preview service, and the double.

Both offer the same: an operator with raw stubs, and hands behind the scene that break the preview.
"""

import asyncio
import signal
import socket
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import grpc

from tests.support.gateway_double import GatewayDouble, serving
from tests.support.running_gateway import Operator, running_gateway
from tests.support.running_preview import RunningPreview
from tests.support.watcher import Watcher


class Ground(ABC):
    """A gateway to talk to, and what a test may do to the preview behind it."""

    def __init__(self, operator: Operator) -> None:
        self.operator = operator

    @abstractmethod
    @contextmanager
    def nothing_starts(self) -> Iterator[None]:
        """While the block lasts no pipeline can start."""

    @abstractmethod
    @asynccontextmanager
    def undisturbed(self) -> AsyncIterator[None]:
        """Fails if viewers of the running preview lose the stream in the block."""

    @abstractmethod
    def kill_preview(self) -> None:
        """The preview service dies without a word."""

    @abstractmethod
    def hang_preview(self) -> None:
        """The preview service stops in the middle of whatever it does."""


class RealGround(Ground):
    """The gateway in this loop, the preview service as a process of its own."""

    def __init__(self, operator: Operator, preview: RunningPreview) -> None:
        super().__init__(operator)
        self._preview = preview

    @contextmanager
    def nothing_starts(self) -> Iterator[None]:
        """Another program has the stream's port."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", self._preview.port))
            yield

    @asynccontextmanager
    async def undisturbed(self) -> AsyncIterator[None]:
        with Watcher(self._preview.port, max_age_s=10.0) as viewer:
            await asyncio.to_thread(viewer.wait_for_frames, 5)
            yield
            await asyncio.to_thread(viewer.wait_for_frames, 5)
            assert viewer.lost == []

    def kill_preview(self) -> None:
        self._preview.process.kill()
        self._preview.process.wait()

    def hang_preview(self) -> None:
        self._preview.process.send_signal(signal.SIGSTOP)


class DoubleGround(Ground):
    """The gateway that tests of the operator's side talk to."""

    def __init__(self, operator: Operator, double: GatewayDouble) -> None:
        super().__init__(operator)
        self._double = double

    @contextmanager
    def nothing_starts(self) -> Iterator[None]:
        self._double.works = False
        yield
        self._double.works = True

    @asynccontextmanager
    async def undisturbed(self) -> AsyncIterator[None]:
        before = self._stream()
        yield
        assert self._stream() == before

    def _stream(self) -> tuple[int, int, int, str]:
        """Returns what changes when the stream is lost: each start begins another one."""
        preview = self._double.status.preview
        return preview.state, preview.counters.starts, preview.counters.faults, preview.endpoint.uri

    def kill_preview(self) -> None:
        self._double.preview_service_dies()

    def hang_preview(self) -> None:
        self._double.preview_answers.clear()


@asynccontextmanager
async def real_ground(directory: Path) -> AsyncIterator[Ground]:
    """Two real programs' worth, and nothing left of them."""
    with RunningPreview(directory, small=False) as preview:
        try:
            async with running_gateway(preview.socket) as operator:
                yield RealGround(operator, preview)
        finally:
            # One that hangs could not end in good order.
            preview.process.send_signal(signal.SIGCONT)


@asynccontextmanager
async def double_ground(_directory: Path) -> AsyncIterator[Ground]:
    """The double behind a real connection."""
    double = GatewayDouble()
    with serving(double) as port:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
            yield DoubleGround(Operator(channel, port), double)
