"""Who was refused types `robotctl login`, and the window goes on: the client takes the new login over."""

from collections.abc import AsyncIterator, Callable
from types import TracebackType
from typing import Self, TypeAlias

from common.errors import UserError
from console.client import (
    AsyncGatewayClient,
    CaughtUp,
    ClientOptions,
    Credentials,
    Event,
    EventGap,
    EventPosition,
    Outage,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
)

Login: TypeAlias = Callable[[], Credentials]
"""Reads what is stored for the robot at this moment. Raises a `UserError` where that can't be used."""


class RenewedClient:
    """An `AsyncGatewayClient`, and another one in its place after each new login. Belongs to one loop.

    Args:
        target: HOST:PORT.
        options: how patient to be.
        login: what is stored for the robot.
        shown: what it was when the program began.

    Raises:
        UserError: as `AsyncGatewayClient`.
    """

    def __init__(self, target: str, options: ClientOptions, login: Login, shown: Credentials) -> None:
        self._target = target
        self._options = options
        self._login = login
        self._shown = shown
        self._client = self._client_with(shown)

    async def overlay(self) -> OverlaySnapshot:
        """As the client's."""
        return await self._client.overlay()

    def events(
        self, after: EventPosition | None = None
    ) -> AsyncIterator[Event | EventGap | CaughtUp | Outage]:
        """As the client's; ends with `Cancelled` when another login is taken over."""
        return self._client.events(after)

    async def enable_preview(
        self, profile: PreviewProfile = PreviewProfile.UNKNOWN, *, settle_within_s: float = 10.0
    ) -> PreviewChange:
        """As the client's."""
        return await self._client.enable_preview(profile, settle_within_s=settle_within_s)

    async def disable_preview(self, *, settle_within_s: float = 10.0) -> PreviewChange:
        """As the client's."""
        return await self._client.disable_preview(settle_within_s=settle_within_s)

    async def renew(self) -> bool:
        """Takes over another login if one is stored now; calls under way end with `Cancelled`."""
        try:
            stored = self._login()
            if stored == self._shown:
                return False
            renewed = self._client_with(stored)
        except UserError:
            # Looked at while it was being written, or the robot was forgotten: the one in use still counts.
            return False
        before, self._client, self._shown = self._client, renewed, stored
        await before.close()
        return True

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self._client.close()

    def _client_with(self, shown: Credentials) -> AsyncGatewayClient:
        return AsyncGatewayClient(self._target, self._options, shown)
