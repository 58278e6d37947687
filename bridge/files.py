"""The files that the configuration names, read once before the program is started."""

from pathlib import Path
from typing import Final

from bridge.config import BridgeSettings
from bridge.robot.gateway import credentials
from common.errors import UserError
from fleet.errors import HubError
from fleet.identity import Credentials
from fleet.receipt_keys import read_public_keys

ENROLMENT: Final = "Copy it from the robot's enrolment (robot-bridge enroll NAME --out DIR, on the hub)"


def check_files(settings: BridgeSettings) -> None:
    """Reads each file.

    Raises:
        UserError: one can't be read, or is not what it has to be.
    """
    credentials(settings.gateway)
    hub = settings.hub
    for key, path in (("hub.ca", hub.ca), ("uploads.ca", settings.uploads.ca)):
        if path:
            _readable(key, path)
    if hub.credentials:
        _readable("hub.credentials", hub.credentials)
        try:
            Credentials.read(hub.credentials)
        except HubError as error:
            raise UserError(f"hub.credentials: {error}", ENROLMENT) from error
    if hub.receipts:
        _readable("hub.receipts", hub.receipts)
        read_public_keys(hub.receipts)


def _readable(key: str, path: Path) -> None:
    try:
        with path.open("rb") as file:
            file.read(1)
    except OSError as error:
        raise UserError(f"{key}: {path} can't be read: {error.strerror}", ENROLMENT) from error
