"""What viewers have to say to the preview service, beside the desired state: lost pictures, and their age."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final, NoReturn, Protocol, TypeAlias

from common.errors import NotRunningError
from common.tasks import cancel
from gateway.links.grpc_client import is_cancelled
from gateway.links.link import RefusedError, ServiceClient
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.watch import LinkLostError, SharingConnector, WatchConnector
from gateway.status.preview import PreviewState, PreviewView

_log = logging.getLogger(__name__)

_AGE_SPACING_S: Final = 0.1
"""The newest age is passed on at most this often; the adaptive bit rate looks at it every 0.6 s."""
_UNREACHABLE: Final = "the preview service can't be reached at the moment"
_REFUSALS: Final = {
    PreviewState.DISABLED: "the preview is off; turn it on first",
    PreviewState.STARTING: "the preview is starting; its first picture is a key frame",
    PreviewState.STOPPING: "the preview is being turned off",
}


class PreviewServiceClient(ServiceClient[PreviewSpec, PreviewReport], Protocol):
    """One connection to the preview service. Every method raises LinkLostError or RefusedError."""

    async def request_key_frame(self, newest_pts: int | None) -> bool:
        """Requests a key frame; returns whether one is forced for it."""

    async def report_picture_age(self, age_ms: int) -> None:
        """Reports the age of the oldest picture that a viewer shows."""


PreviewServiceConnector: TypeAlias = WatchConnector[PreviewServiceClient]
"""Opens connections to the preview service."""


class Feedback(SharingConnector[PreviewServiceClient]):
    """A connector for the link that uses its connection for the viewers' feedback as well.

    Args:
        connector: opens the connections.
    """

    def __init__(self, connector: PreviewServiceConnector) -> None:
        super().__init__(connector)
        self._age_ms = 0
        self._reported = asyncio.Event()

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[PreviewServiceClient]:
        """Yields a connection, and passes ages on while the block lasts."""
        async with super().connect() as client:
            passing_on = asyncio.create_task(self._pass_ages_on(client), name="pictures' age")
            try:
                yield client
            finally:
                await cancel([passing_on])

    async def request_key_frame(self, preview: PreviewView, newest_pts: int | None) -> bool:
        """Requests a key frame for a viewer that lost a picture.

        Args:
            preview: its present state.
            newest_pts: of the newest picture of which the viewer got anything; None if it does not say.

        Returns:
            Whether one is forced for this request; False when another serves it.

        Raises:
            NotRunningError: there is no running preview that could make one.
        """
        if preview.state is not PreviewState.RUNNING:
            raise NotRunningError(
                _REFUSALS.get(preview.state, f"the preview has failed: {preview.last_error}")
            )
        if self._client is None:
            raise NotRunningError(_UNREACHABLE)
        try:
            return await self._client.request_key_frame(newest_pts)
        except LinkLostError as error:
            raise NotRunningError(f"the preview service does not answer: {error.reason}") from None
        except RefusedError as error:
            raise NotRunningError(f"the preview service refused: {error}") from None
        except asyncio.CancelledError:
            if is_cancelled():
                raise
            raise NotRunningError(_UNREACHABLE) from None

    def pass_on(self, age_ms: int) -> None:
        """Queues an age to be passed on; a newer one replaces it. Never waits."""
        self._age_ms = age_ms
        self._reported.set()

    async def _pass_ages_on(self, client: PreviewServiceClient) -> NoReturn:
        self._reported.clear()  # What was reported without a connection is of no use by now.
        while True:
            # Each is passed on, also an equal one: the service forgets it after a while.
            await self._reported.wait()
            self._reported.clear()
            try:
                await client.report_picture_age(self._age_ms)
            except (LinkLostError, RefusedError) as error:
                # The link finds out by itself whether the connection is lost.
                _log.debug("the age of pictures was not passed on: %s", error)
            await asyncio.sleep(_AGE_SPACING_S)
