"""Who can watch the stream, by where its listener is reached and whether it is encrypted."""

import logging

from common.addresses import bracketed, is_loopback
from common.findings import Finding, Verdict, good, note
from gateway.config import GatewaySettings
from gateway.status.preview import Listener
from gateway.status.snapshot import Snapshot

_log = logging.getLogger(__name__)


class ExposureLog:
    """Logs who can watch, whenever the listener is another one.

    Args:
        settings: say whether the stream is encrypted.
    """

    def __init__(self, settings: GatewaySettings) -> None:
        self._settings = settings
        self._listener: Listener | None = None

    def take(self, now: Snapshot) -> None:
        """Takes the snapshot of this instant."""
        listener = now.preview.listener
        if listener is None or listener == self._listener:
            return
        self._listener = listener
        found = video_exposure(self._settings, listener)
        if found.verdict is Verdict.GOOD:
            _log.info("%s", found.what)
        else:
            _log.warning("%s (%s). %s", found.what, found.why, found.remedy)


def video_exposure(settings: GatewaySettings, listener: Listener) -> Finding:
    """Returns a finding for log and doctor: a note if viewers on other machines need no passphrase."""
    at = f"{bracketed(listener.address) or 'an unknown address'}, UDP port {listener.port}"
    if settings.encrypts_preview(listener.address):
        return good("video", f"the video is encrypted; its listener is at {at}")
    if is_loopback(listener.address):
        return good(
            "video",
            f"the video is not encrypted; its listener at {at} is for this machine alone. Docker before 28 "
            "lets neighbours of the same network segment reach it: preview.encrypted: true keeps them out",
        )
    cause = (
        "preview.encrypted is false" if settings.preview.encrypted is False else "security.insecure is set"
    )
    return note(
        "video",
        f"the video is not encrypted; anyone who reaches its listener at {at} can watch",
        f"{cause} in the gateway's configuration",
        "Remove that setting, or let this machine alone reach the listener: 'srt: {bind: 127.0.0.1}' in the "
        "preview's configuration, with containers (Docker 28 or newer) PREVIEW_BIND=127.0.0.1 in .env",
    )
