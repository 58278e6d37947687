"""Checks whether the stream is encrypted where its listener is reached."""

import asyncio
from typing import Final

from common.findings import Finding, note
from gateway.config import GatewaySettings
from gateway.links.preview.exposure import video_exposure
from gateway.links.preview.wire import PreviewConnector
from gateway.links.watch import LinkLostError
from gateway.status.preview import Listener

_TIMEOUT_S: Final = 3.0
"""The service reports at once when it is asked; one that is busy with trials takes longer."""


def video_finding(settings: GatewaySettings) -> Finding:
    """Asks the preview service where its listener is; it must be reachable."""
    try:
        listener = asyncio.run(_listener(PreviewConnector(settings.preview.socket)))
    except LinkLostError as error:
        reason = error.reason
    except TimeoutError:
        reason = f"no answer for {_TIMEOUT_S:g} s"
    else:
        if listener:
            return video_exposure(settings, listener)
        reason = "its report has no listener"
    return note(
        "video",
        f"the preview service does not say where its listener is: {reason}",
        "That decides whether the video is encrypted",
        "Restart the preview service, and look into its log",
    )


async def _listener(connector: PreviewConnector) -> Listener | None:
    async with asyncio.timeout(_TIMEOUT_S), connector.connect() as client:
        async for report in client.reports():
            return report.listener
    return None
