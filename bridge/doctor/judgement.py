"""From facts to findings: what is wrong, why it matters, what to do. Pure."""

from collections.abc import Iterator
from datetime import datetime
from typing import Final

from bridge.config import BridgeSettings, UploadSettings
from bridge.uploads import hours
from common.findings import Finding, good, note, wrong
from omniseer.gateway.v1 import cloud_pb2 as pb

_MIB: Final = 1024 * 1024
_FULL_PERCENT: Final = 80
_REMEDIES: Final = {
    pb.CLOUD_STATE_OFFLINE: "Compare hub.servers with the hub's addresses, and look at the network",
}


def folder_findings(settings: BridgeSettings, free_bytes: int, *, writable: bool) -> Iterator[Finding]:
    """Yields what the folder of the outbox shows.

    Args:
        settings: of the program.
        free_bytes: of its file system.
        writable: whether this user may write to it.
    """
    root, most = settings.root, settings.outbox.max_bytes
    if not writable:
        yield wrong(
            "disk.folder",
            f"{root} can't be written by this user",
            "Events can't be kept while the hub can't be reached",
            "Make it a directory of the bridge's user, or set root",
        )
    elif free_bytes < most:
        yield note(
            "disk.room",
            f"{root} has {free_bytes // _MIB} MiB free; the outbox may take {most // _MIB} MiB",
            "On a full disk events stay at the gateway, which keeps the newest 1024",
            "Free disk space, or set outbox.max_bytes lower",
        )
    else:
        yield good("disk.room", f"{root} has room for an outbox of {most // _MIB} MiB")


def hours_findings(settings: UploadSettings, now: datetime) -> Iterator[Finding]:
    """Yields by which clock recordings are uploaded, where that depends on one.

    Args:
        settings: of uploads.
        now: the instant, aware of its zone.
    """
    if hours.are_doubtful(settings, now):
        yield note("uploads.hours", hours.in_words(settings, now), hours.DOUBT, hours.REMEDY)
    elif settings.hours:
        yield good("uploads.hours", hours.in_words(settings, now))


def settings_findings(settings: BridgeSettings) -> Iterator[Finding]:
    """Yields what the configuration makes impossible, or opens."""
    hub = settings.hub
    if hub.ca is None or hub.credentials is None:
        yield note(
            "hub.security",
            "hub.ca or hub.credentials is not set: the hub is neither authenticated nor encrypted",
            "Others may read and change what the robot reports; this is for tests",
            "Enroll the robot (robot-bridge enroll NAME --out DIR, on the hub) and set both",
        )
    allowed = settings.commands.allowed
    if allowed:
        yield note(
            "commands",
            f"the hub may request: {', '.join(allowed)}",
            "The gateway's configuration has to allow the same; each request is in its audit log",
            "Nothing, if that is what you want; otherwise empty commands.allowed",
        )
    else:
        yield good("commands", "the hub may request nothing of this robot")


def program_findings(status: pb.CloudStatus) -> Iterator[Finding]:
    """Yields what the running program says of itself."""
    name = pb.CloudState.Name(status.state).removeprefix("CLOUD_STATE_").lower()
    if status.state == pb.CLOUD_STATE_CONNECTED and not status.last_error:
        yield good("bridge", f"robot-bridge is connected with fleet {status.fleet} as {status.robot}")
    else:
        yield wrong(
            "bridge",
            f"robot-bridge is {name}: {status.last_error}",
            f"{status.outbox_events} events wait; the fleet sees this robot as it was",
            _REMEDIES.get(status.state, "Do as the line says"),
        )
    if status.outbox_bytes * 100 > status.outbox_max_bytes * _FULL_PERCENT:
        yield note(
            "outbox",
            f"the outbox has {status.outbox_bytes // _MIB} of {status.outbox_max_bytes // _MIB} MiB",
            "When it is full the oldest INFO goes first, then the oldest of all",
            "Bring the connection back, or set outbox.max_bytes higher",
        )
    if status.events_dropped:
        yield note(
            "outbox.dropped",
            f"{status.events_dropped} events were dropped since the outbox was made",
            "The hub has a note in the place of each",
            "Set outbox.max_bytes higher for longer outages",
        )
