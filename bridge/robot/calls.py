"""Unary calls and exports of the gateway, with the credentials as they are on the disk."""

import logging
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import TYPE_CHECKING

from bridge.config import GatewaySettings
from bridge.robot.gateway import credentials
from common import bridge_run
from common.errors import UserError
from console.client import AsyncGatewayClient, ClientOptions, results
from console.client.errors import NotAllowed

if TYPE_CHECKING:
    from console.credentials import Credentials

_log = logging.getLogger(__name__)


class GatewayCalls:
    """A client of the gateway that is replaced when the credentials are: a new login needs no restart.

    The files are read at each call; they are small, and calls are few. What the former client still sends
    ends with `Cancelled`, which uploads take for a cut.

    Args:
        settings: of the gateway.
        run_id: of this run of the bridge, by which the gateway recognises it.
    """

    def __init__(self, settings: GatewaySettings, run_id: str) -> None:
        self._settings = settings
        self._options = ClientOptions(metadata=((bridge_run.HEADER, run_id),))
        self._shown: Credentials | None = None
        self._client: AsyncGatewayClient | None = None

    async def list_recordings(self, page_size: int, page_token: str) -> results.RecordingPage:
        """Returns a page of the list, as AsyncGatewayClient does; all methods raise a `GatewayError`."""
        return await (await self._current()).list_recordings(page_size, page_token)

    async def recording(self, recording_id: str) -> results.Recording:
        """Returns a recording with its files."""
        return await (await self._current()).recording(recording_id)

    async def read_recording(
        self, recording_id: str, file: results.RecordingFile, offset: int = 0
    ) -> AsyncGenerator[bytes]:
        """Yields the bytes of a file."""
        client = await self._current()
        async with aclosing(client.read_recording(recording_id, file, offset)) as chunks:
            async for chunk in chunks:
                yield chunk

    async def aclose(self) -> None:
        """Closes the connection."""
        client, self._client, self._shown = self._client, None, None
        if client:
            await client.close()

    async def _current(self) -> AsyncGatewayClient:
        """Returns the client of the present credentials.

        Raises:
            NotAllowed: they can't be read, or would be sent in the clear.
        """
        try:
            shown = credentials(self._settings)
            if self._client and shown == self._shown:
                return self._client
            client = AsyncGatewayClient(self._settings.target, self._options, shown)
        except UserError as error:
            raise NotAllowed(error.what, error.remedy) from error
        former, self._client, self._shown = self._client, client, shown
        if former:
            _log.info("the gateway is called with new credentials")
            await former.close()
        return client
