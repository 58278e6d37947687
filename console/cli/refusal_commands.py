"""What robotctl's user types at a refusal that a program ends by an argument of the client library."""

from collections.abc import Mapping
from typing import Final

from common.reasons import Reason

COMMANDS: Final[Mapping[str, str]] = {
    Reason.TELEOP_DISABLED: "Type: robotctl drive --enable",
    Reason.LEASE_HELD: "Type: robotctl drive --take-over",
    Reason.NO_VIDEO: "Type: robotctl record start --no-video",
    Reason.RECORDING_PINNED: (
        "Type: robotctl record unpin ID; an administrator may type: robotctl record delete ID --force"
    ),
    Reason.RECORDING_NOT_COPIED: (
        "Wait until it is copied, or as an administrator type: robotctl record delete ID --force"
    ),
}
"""In place of the library's own advice, by the gateway's reason."""
