"""Takes over new credentials while a window is open: after `robotctl login` it goes on by itself."""

from collections.abc import Callable
from typing import Self, TypeAlias

from common.errors import UserError
from console.client import AsyncGatewayClient, ClientOptions, Credentials

LoadCredentials: TypeAlias = Callable[[], Credentials]
"""Reads the credentials stored for the robot at this moment. Raises a `UserError` if they can't be used."""


class RefreshingClient:
    """Holds an `AsyncGatewayClient`, replaced after each change of the credentials. Belongs to one loop.

    Args:
        target: HOST:PORT.
        options: deadlines and retries.
        load: reads the stored credentials.
        credentials: those to begin with.

    Raises:
        UserError: as `AsyncGatewayClient`.
    """

    def __init__(
        self, target: str, options: ClientOptions, load: LoadCredentials, credentials: Credentials
    ) -> None:
        self._target = target
        self._options = options
        self._load = load
        self._credentials = credentials
        self.client = self._make_client(credentials)
        """The client with the credentials in use."""

    async def refresh(self) -> bool:
        """Takes over other stored credentials, if any; pending calls end with `Cancelled`."""
        try:
            stored = self._load()
            if stored == self._credentials:
                return False
            client = self._make_client(stored)
        except UserError:
            # Read while it was being written, or the robot was removed: the credentials in use stay.
            return False
        before, self.client, self._credentials = self.client, client, stored
        await before.close()
        return True

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_error: object) -> None:
        await self.client.close()

    def _make_client(self, credentials: Credentials) -> AsyncGatewayClient:
        return AsyncGatewayClient(self._target, self._options, credentials)
